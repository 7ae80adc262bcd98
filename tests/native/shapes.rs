//! Sets of analytic shapes.

use crate::kit::{Numbers, build, check, check_batches, every_class, loop_over, placements, rays, shapes, view};
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;
use tison::backend::Backend;
use tison::geom::{Affine, Cube, Plain, Quad, Ray, Sphere};
use tison::scene::{AnyShapes, Object};

fn spheres(of: impl IntoIterator<Item = (DVec3, f64)>) -> Object {
    let mut set = Plain::default();
    for (center, radius) in of {
        set.push(Sphere::new(center, radius).expect("a sphere"));
    }
    shapes(AnyShapes::Spheres(Arc::new(set)))
}

#[test]
fn every_class_answers_like_a_loop() {
    let mut numbers = Numbers(1);
    for n in [1, 2, 5, 60] {
        for set in every_class(&placements(&mut numbers, n, 0.3)) {
            let objects = [shapes(set)];
            let rays = rays(&mut numbers);
            let want: Vec<_> = rays.iter().map(|ray| loop_over(&objects, ray)).collect();
            assert!(want.iter().flatten().count() >= n);
            check(&build(&objects), &rays, &want);
        }
    }
}

/// A hit says `t` and whose it is; the rest is for who refines it.
#[test]
fn of_a_shape_only_t_and_ids_are_told() {
    let native = build(&[spheres([]), spheres([(DVec3::ZERO, 1.0), (3.0 * DVec3::X, 0.5)])]);
    let hit = native.intersect(&Ray::new(6.0 * Vec3::X, -2.0 * Vec3::X)).expect("aimed at it");
    assert_eq!((hit.t, hit.u, hit.v, hit.ng, hit.prim_id, hit.geom_id), (1.25, 0.0, 0.0, Vec3::ZERO, 1, 1));
}

/// Boxes must not lose what f64 decides, however far away the ray starts.
#[test]
fn far_origins_answer_like_a_loop() {
    let mut numbers = Numbers(2);
    for set in every_class(&placements(&mut numbers, 30, 0.3)) {
        let objects = [shapes(set)];
        let native = build(&objects);
        for k in 1..=7 {
            let eye = 10f32.powi(k) * numbers.direction();
            let rays = view(eye, Vec3::ZERO, 0.5);
            let want: Vec<_> = rays.iter().map(|ray| loop_over(&objects, ray)).collect();
            assert!(want.iter().flatten().count() > 10);
            check(&native, &rays, &want);
        }
    }
}

#[test]
fn any_scale_answers_like_a_loop() {
    let mut numbers = Numbers(3);
    for k in [-15, -6, 6, 15] {
        let scale = 10f64.powi(k);
        let to = DAffine3::from_scale(DVec3::splat(scale));
        let placements: Vec<_> = placements(&mut numbers, 20, 0.3).into_iter().map(|p| to * p).collect();
        for set in every_class(&placements) {
            let objects = [shapes(set)];
            let scaled = |r: Ray| Ray { o: r.o * scale as f32, t_near: 0.0, ..r };
            let rays: Vec<_> = rays(&mut numbers).into_iter().map(scaled).collect();
            let want: Vec<_> = rays.iter().map(|ray| loop_over(&objects, ray)).collect();
            check(&build(&objects), &rays, &want);
        }
    }
}

#[test]
fn the_interval_is_open() {
    let mut numbers = Numbers(4);
    for set in every_class(&placements(&mut numbers, 40, 0.4)) {
        let native = build(&[shapes(set)]);
        let mut hits = 0;
        for _ in 0..300 {
            let mut from = Ray::new(2.0 * numbers.point(), numbers.direction());
            let mut seen = Vec::new();
            while let Some(hit) = native.intersect(&from) {
                assert!(hit.t > from.t_near, "{from:?}");
                seen.push(hit.prim_id);
                assert!(seen.iter().filter(|&&p| p == hit.prim_id).count() <= 2, "{from:?}: {seen:?}");
                let ends = Ray { t_far: hit.t, ..from };
                assert_eq!(native.intersect(&ends), None);
                assert!(!native.occluded(&ends));
                let reaches = Ray { t_far: hit.t.next_up(), ..from };
                assert_eq!(native.intersect(&reaches), Some(hit));
                assert!(native.occluded(&reaches));
                from.t_near = hit.t;
                hits += 1;
            }
        }
        assert!(hits > 50, "{hits}");
    }
}

#[test]
fn the_length_of_a_direction_only_scales_t() {
    let mut numbers = Numbers(5);
    for set in every_class(&placements(&mut numbers, 40, 0.4)) {
        let native = build(&[shapes(set)]);
        for _ in 0..200 {
            let (o, d) = (1.5 * numbers.point(), numbers.direction());
            let Some(near) = native.intersect(&Ray::new(o, d)) else { continue };
            for k in [-99, -33, 33, 66] {
                let hit = native.intersect(&Ray::new(o, d * 2f32.powi(k))).expect("as before");
                assert_eq!((hit.t, hit.prim_id), (near.t * 2f32.powi(-k), near.prim_id), "2^{k}");
            }
        }
    }
}

/// The same shape many times, within a set and in several: rays cannot tell them apart.
#[test]
fn of_equal_hits_the_lowest_number_is_reported() {
    let mut numbers = Numbers(6);
    let base = placements(&mut numbers, 9, 0.5);
    let many: Vec<_> = base.iter().cycle().take(90).copied().collect();
    for (set, more) in every_class(&base).into_iter().zip(every_class(&many)) {
        let native = build(&[shapes(more.clone()), shapes(set), shapes(more)]);
        let rays = rays(&mut numbers);
        let hits: Vec<_> = rays.iter().filter_map(|ray| native.intersect(ray)).collect();
        assert!(hits.len() > 100 && hits.iter().all(|h| h.geom_id == 0 && h.prim_id < 9));
        check_batches(&native, &rays);
    }
}

/// A flat shape along the axes has a box without thickness, an axis-parallel ray lies in the sides of boxes.
#[test]
fn flat_boxes_are_hit_in_their_plane_and_at_their_border() {
    let mut quads = Affine::default();
    let mut cubes = Plain::default();
    for (i, j) in (0..8).flat_map(|i| (0..8).map(move |j| (i, j))) {
        let at = DVec3::new(f64::from(i), f64::from(j), 2.0);
        quads.push(Quad::new(glam::DVec2::splat(0.5)).expect("a quad"), DAffine3::from_translation(at)).expect("moved");
        cubes.push(Cube::new(at + 2.0 * DVec3::Z, DVec3::splat(0.5)).expect("a cube"));
    }
    let [quads, cubes] = [AnyShapes::Quads(Arc::new(quads)), AnyShapes::Cubes(Arc::new(cubes))].map(shapes);
    let both = [cubes, quads];
    for (objects, z) in [(&both[1..], 2.0), (&both[..1], 3.5), (&both[..], 2.0)] {
        let native = build(objects);
        for (x, y) in (-1..16).flat_map(|x| (-1..16).map(move |y| (0.5 * x as f32, 0.5 * y as f32))) {
            for zero in [0.0, -0.0] {
                let hit = native.intersect(&Ray::new(Vec3::new(x, y, 0.0), Vec3::new(zero, zero, 1.0)));
                assert_eq!(hit.map(|h| h.t), Some(z), "at {x}, {y}");
            }
        }
    }
}

#[test]
fn what_is_too_large_for_f32_is_traced_or_missed() {
    let set = [(DVec3::ZERO, 1.0), (1e300 * DVec3::X, 1e300), (DVec3::splat(-1e39), 1e38), (DVec3::Y * 1e30, 1e30)];
    let native = build(&[spheres(set)]);
    let hit = native.intersect(&Ray::new(-3.0 * Vec3::X, Vec3::X)).expect("the small one");
    assert_eq!((hit.t, hit.prim_id), (2.0, 0));
    let hit = native.intersect(&Ray::new(Vec3::new(2.0, -3.0, 0.0), Vec3::Y)).expect("one of the large ones");
    assert!(hit.prim_id == 1 || hit.prim_id == 3, "{hit:?}");
    let mut numbers = Numbers(7);
    let rays: Vec<_> = (0..256).map(|i| Ray::new(numbers.point() * 10f32.powi(i % 38), numbers.direction())).collect();
    check_batches(&native, &rays);
}

#[test]
fn a_million_spheres_are_built_and_traced() {
    let mut numbers = Numbers(8);
    let of = (0..1_000_000).map(|_| (numbers.point().as_dvec3(), 0.002 + 0.004 * f64::from(numbers.next())));
    let objects = [spheres(of.collect::<Vec<_>>())];
    let native = build(&objects);
    assert!(native.bytes() < 80_000_000, "{}", native.bytes());
    let rays = view(3.0 * Vec3::ONE, Vec3::ZERO, 0.2);
    check_batches(&native, &rays);
    let some: Vec<_> = rays.into_iter().step_by(97).collect();
    let want: Vec<_> = some.iter().map(|ray| loop_over(&objects, ray)).collect();
    assert!(want.iter().all(Option::is_some));
    check(&native, &some, &want);
}
