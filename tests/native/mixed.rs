//! Meshes, placed meshes and shapes in one scene.

use crate::kit::{
    Numbers, bare, build, check, check_batches, every_class, loop_over, mesh, placed, placements, rays, shapes, soup,
};
use glam::{DAffine3, DVec2, DVec3, Vec3};
use proptest::prelude::*;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tison::backend::Backend;
use tison::backend::native::{BuildError, BuildOptions, Native, Quality};
use tison::geom::{Affine, Cube, Plain, Quad, Ray, Sphere};
use tison::scene::{AnyShapes, Object};

/// Up to three objects of each kind, in any order.
fn scene(numbers: &mut Numbers) -> Vec<Object> {
    let triangles: Vec<_> = (0..40).map(|_| numbers.point()).map(|p| [p, p, p]).collect();
    let triangles: Vec<_> = triangles.into_iter().map(|t| t.map(|p| p + 0.3 * numbers.point())).collect();
    let own = bare(&soup(&triangles));
    let mut objects = vec![Object::Mesh(own.clone()), Object::Mesh(bare(&mesh(&[], vec![])))];
    objects.extend(placements(numbers, 3, 0.4).into_iter().map(|p| placed(&own, p)));
    objects.extend(every_class(&placements(numbers, 6, 0.2)).map(shapes));
    for i in (1..objects.len()).rev() {
        objects.swap(i, (numbers.next() * (i + 1) as f32) as usize % (i + 1));
    }
    objects.truncate(1 + (numbers.next() * objects.len() as f32) as usize);
    objects
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn a_mixed_scene_answers_like_a_loop(seed in any::<u64>(), fast in any::<bool>()) {
        let mut numbers = Numbers(seed);
        let objects = scene(&mut numbers);
        let quality = if fast { Quality::Fast } else { Quality::Good };
        let native = Native::build(&objects, &BuildOptions { quality, cancel: &AtomicBool::new(false), memory_limit: None });
        let rays = rays(&mut numbers);
        let want: Vec<_> = rays.iter().map(|ray| loop_over(&objects, ray)).collect();
        check(&native.expect("never cancelled"), &rays, &want);
    }
}

/// Four things with a face in the plane z = 1, met by rays along z from a lattice: `t` is exact.
fn level() -> [Object; 4] {
    let square = [(-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0)];
    let corners = square.map(|(x, y)| Vec3::new(x, y, 1.0));
    let own = bare(&mesh(&corners, vec![[0, 1, 2], [0, 2, 3]]));
    let mut quads = Affine::default();
    let mut cubes = Plain::default();
    for x in [0.0, 0.5] {
        let to = DAffine3::from_translation(DVec3::new(x, 0.0, 1.0));
        quads.push(Quad::new(DVec2::splat(4.0)).expect("a quad"), to).expect("moved");
        cubes.push(Cube::new(DVec3::new(x, 0.0, 3.0), DVec3::new(4.0, 4.0, 2.0)).expect("a cube"));
    }
    let lifted =
        DAffine3::from_translation(DVec3::new(0.0, 0.0, 3.0)) * DAffine3::from_scale(DVec3::new(2.0, 2.0, -2.0));
    [
        Object::Mesh(own.clone()),
        placed(&own, lifted),
        shapes(AnyShapes::Quads(Arc::new(quads))),
        shapes(AnyShapes::Cubes(Arc::new(cubes))),
    ]
}

#[test]
fn of_equal_hits_the_first_object_is_reported_whatever_it_is() {
    let rays: Vec<_> =
        (0..64).map(|i| Ray::new(Vec3::new((i % 8) as f32 - 3.75, (i / 8) as f32 - 3.5, 0.0), Vec3::Z)).collect();
    let slanted: Vec<_> = rays.iter().map(|r| Ray::new(r.o, Vec3::new(0.125, 0.25, 1.0))).collect();
    for turn in 0..24 {
        let mut objects = level().to_vec();
        // Every order of the four.
        let (a, b, c) = (turn % 4, turn / 4 % 3, turn / 12);
        let first = objects.remove(a);
        let second = objects.remove(b);
        let third = objects.remove(c);
        objects.splice(0..0, [first, second, third]);
        let native = build(&objects);
        for rays in [&rays, &slanted] {
            let want: Vec<_> = rays.iter().map(|ray| loop_over(&objects, ray)).collect();
            assert!(want.iter().all(|w| w.is_some_and(|(t, geom, _)| t == 1.0 && geom == 0)), "{turn}");
            check(&native, rays, &want);
        }
    }
}

#[test]
fn nothing_is_hit_where_nothing_is() {
    let empty: Vec<Object> = every_class(&[]).into_iter().map(shapes).collect();
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    for objects in [vec![], empty] {
        let native = build(&objects);
        assert_eq!((native.intersect(&ray), native.occluded(&ray)), (None, false));
        check_batches(&native, &[ray; 40]);
    }
}

#[test]
fn rays_that_are_none_meet_nothing() {
    let [sphere, ..] = every_class(&[DAffine3::IDENTITY]);
    let whole = Ray::new(Vec3::ZERO, Vec3::X);
    let around = [[Vec3::new(2.0, -9.0, -9.0), Vec3::new(2.0, 9.0, -9.0), Vec3::new(2.0, 0.0, 9.0)]];
    let placed = placed(&bare(&soup(&around)), DAffine3::from_scale(DVec3::splat(0.9)));
    for objects in [vec![shapes(sphere.clone())], vec![placed.clone()], vec![placed, shapes(sphere)]] {
        let native = build(&objects);
        assert!(native.occluded(&whole));
        let none = [
            Ray { d: Vec3::ZERO, ..whole },
            Ray { d: Vec3::new(f32::NAN, 1.0, 0.0), ..whole },
            Ray { d: Vec3::new(f32::INFINITY, 1.0, 0.0), ..whole },
            Ray { o: Vec3::NAN, ..whole },
            Ray { o: Vec3::splat(f32::NEG_INFINITY), ..whole },
            Ray { t_far: f32::NEG_INFINITY, ..whole },
            Ray { t_far: 0.5, ..whole },
            Ray { t_far: f32::NAN, ..whole },
            Ray { t_near: f32::NAN, ..whole },
            Ray { t_near: f32::INFINITY, ..whole },
        ];
        for ray in none {
            assert_eq!(native.intersect(&ray), None, "{ray:?}");
            assert!(!native.occluded(&ray), "{ray:?}");
        }
        // Among good ones of the same packet.
        let rays: Vec<_> = (0..160).map(|i| if i % 3 == 1 { none[i % 10] } else { whole }).collect();
        check_batches(&native, &rays);
    }
}

#[test]
fn a_build_can_be_cancelled() {
    let cancel = AtomicBool::new(true);
    let mut numbers = Numbers(5);
    let own = bare(&soup(&[[Vec3::ZERO, Vec3::X, Vec3::Y]; 9]));
    let all = placements(&mut numbers, 5, 0.3);
    let mut scenes: Vec<Vec<Object>> = every_class(&all).into_iter().map(|set| vec![shapes(set)]).collect();
    scenes.push(all.iter().map(|&p| placed(&own, p)).collect());
    for objects in scenes {
        let result =
            Native::build(&objects, &BuildOptions { quality: Quality::Good, cancel: &cancel, memory_limit: None });
        assert_eq!(result.err(), Some(BuildError::Cancelled));
    }
}

/// A sphere in front of a mesh hides it; a shadow ray is stopped by either.
#[test]
fn shapes_hide_meshes_and_meshes_hide_shapes() {
    let wall = bare(&soup(&[[Vec3::new(-9.0, -9.0, 0.0), Vec3::new(9.0, -9.0, 0.0), Vec3::new(0.0, 9.0, 0.0)]]));
    let mut set = Plain::default();
    set.push(Sphere::new(DVec3::Z, 0.5).expect("a sphere"));
    set.push(Sphere::new(-DVec3::Z, 0.5).expect("a sphere"));
    let native = build(&[Object::Mesh(wall), shapes(AnyShapes::Spheres(Arc::new(set)))]);
    let through = |z: f32, d: f32| Ray::new(Vec3::new(0.0, 0.0, z), Vec3::new(0.0, 0.0, d));
    let seen = |ray: Ray| native.intersect(&ray).map(|h| (h.t, h.geom_id, h.prim_id));
    assert_eq!(seen(through(3.0, -1.0)), Some((1.5, 1, 0)));
    assert_eq!(seen(through(-3.0, 1.0)), Some((1.5, 1, 1)));
    assert_eq!(seen(through(0.25, -1.0)), Some((0.25, 0, 0)));
    assert!(native.occluded(&Ray { t_far: 0.5, ..through(0.25, -1.0) }));
    assert!(!native.occluded(&Ray { t_far: 0.2, ..through(0.25, -1.0) }));
}
