//! Meshes in a space of their own.

use crate::kit::{
    NEVER, Numbers, ball, bare, build, bumpy, check, loop_over, mesh, placed, placements, rays, round, view,
};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use tison::backend::Backend;
use tison::backend::native::{BuildError, BuildOptions, Native, Quality};
use tison::geom::{Ray, ShapeError, TriangleMesh};
use tison::scene::{Mesh, Object};

/// The placements that every mesh must stand.
fn transforms() -> Vec<(&'static str, DAffine3)> {
    let turn = DMat3::from_rotation_z(0.7) * DMat3::from_rotation_x(-1.1);
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(1.5, 1.0, 0.3), DVec3::new(-0.4, 2.0, 1.0));
    let stretch = |x, y, z| DMat3::from_diagonal(DVec3::new(x, y, z));
    let near = DVec3::new(0.3, -2.0, 1.0);
    let at = DAffine3::from_mat3_translation;
    vec![
        ("as it is", DAffine3::IDENTITY),
        ("turned", at(turn, near)),
        ("mirrored", at(turn * stretch(-1.0, 1.0, 1.0), near)),
        ("scaled 1000:1", at(turn * stretch(1000.0, 1.0, 1.0), near)),
        ("scaled 1:1000", at(turn * stretch(1.0, 1.0, 1e-3), near)),
        ("sheared", at(shear, near)),
        ("sheared, mirrored, stretched", at(turn * shear * stretch(0.1, -20.0, 3.0), near)),
        ("1e5 away", at(turn, DVec3::new(1e5, -1e5, 5e4))),
        ("tiny", at(turn * 1e-12, near * 1e-12)),
        ("huge", at(shear * 1e12, near * 1e12)),
        ("thin as nothing", at(stretch(1e-25, 1.0, 1e3), DVec3::new(0.0, -2.0, 1.0))),
    ]
}

/// `t` and the distance from the nearest edge as a share of the triangle: textbook formula on the
/// corners in scene space, in f64.
fn baked(ray: &Ray, corners: [DVec3; 3]) -> (f64, f64) {
    let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
    let [a, b, c] = corners;
    let n = (b - a).cross(c - a);
    let t = (a - o).dot(n) / d.dot(n);
    let p = o + t * d;
    let share = |q: DVec3, r: DVec3| (q - p).cross(r - p).dot(n) / n.dot(n);
    (t, share(a, b).min(share(b, c)).min(share(c, a)))
}

#[test]
fn a_placed_mesh_is_hit_where_the_baked_one_is() {
    let (points, faces) = ball(6, bumpy);
    let triangles = mesh(&points, faces);
    let own = bare(&triangles);
    for (name, to_scene) in transforms() {
        let native = build(&[placed(&own, to_scene)]);
        let corners = |prim: u32| triangles.triangle(prim).map(|p| to_scene.transform_point3(p.as_dvec3()));
        let mut numbers = Numbers(1);
        let mut hits = 0;
        for _ in 0..1500 {
            // In f32 from the start, so that both see the same ray.
            let o = to_scene.transform_point3(2.5 * numbers.direction().as_dvec3()).as_vec3();
            let target = to_scene.transform_point3(1.2 * numbers.point().as_dvec3()).as_vec3();
            let ray = Ray::new(o, target - o);
            let all = (0..triangles.face_count() as u32).map(|prim| (prim, baked(&ray, corners(prim))));
            let ahead = all.filter(|(_, (t, _))| *t > 0.0);
            let want = ahead.clone().filter(|(_, (_, margin))| *margin >= 0.0).min_by(|a, b| a.1.0.total_cmp(&b.1.0));
            if ahead.clone().any(|(_, (_, margin))| margin.abs() < 1e-9) {
                continue; // rounding may decide
            }
            let hit = native.intersect(&ray);
            assert_eq!(hit.map(|h| h.prim_id), want.map(|w| w.0), "{name}: {ray:?}");
            assert_eq!(native.occluded(&ray), want.is_some(), "{name}: {ray:?}");
            let (Some(hit), Some((prim, (t, _)))) = (hit, want) else { continue };
            assert!((f64::from(hit.t) / t - 1.0).abs() < 1.5e-7, "{name}: t {} for {t}", hit.t);
            // Of the moved edges: moved corners cancel far from the origin.
            let [a, b, c] = triangles.triangle(prim).map(Vec3::as_dvec3);
            let [e1, e2] = [b - a, c - a].map(|e| to_scene.transform_vector3(e));
            let ng = e1.cross(e2);
            let off = (hit.ng.as_dvec3() - ng).length() / ng.length();
            assert!(off < 1e-6, "{name}: normal {} for {ng}", hit.ng);
            hits += 1;
        }
        assert!(hits > 300, "{name}: {hits}");
    }
}

#[test]
fn many_placed_meshes_answer_like_a_loop() {
    let mut numbers = Numbers(3);
    let (points, faces) = ball(3, bumpy);
    let (round, flat) = (bare(&mesh(&points, faces)), bare(&mesh(&[Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])));
    for n in [1, 4, 30] {
        let all = placements(&mut numbers, n, 0.3);
        let objects: Vec<_> =
            all.iter().enumerate().map(|(i, &p)| placed(if i % 3 == 0 { &flat } else { &round }, p)).collect();
        let rays = rays(&mut numbers);
        let want: Vec<_> = rays.iter().map(|ray| loop_over(&objects, ray)).collect();
        check(&build(&objects), &rays, &want);
    }
}

/// A mesh that lies far from the origin of its own space, and what brings it back.
fn astray(points: &[Vec3], faces: &[[u32; 3]], shift: f32) -> (Mesh, DAffine3) {
    let shift = shift * Vec3::new(1.0, -2.0, 0.4);
    let points: Vec<_> = points.iter().map(|&p| p + shift).collect();
    (bare(&mesh(&points, faces.to_vec())), DAffine3::from_translation(-shift.as_dvec3()))
}

/// Boxes and the filter see a rounded origin: nothing may be lost by that.
#[test]
fn origins_that_f32_cannot_hold_lose_nothing() {
    let mut numbers = Numbers(4);
    let (points, faces) = ball(5, bumpy);
    for (k, shift) in (-6..=6).flat_map(|k| [0.0, 300.0, 1e5].map(|shift| (k, shift))) {
        let (own, back) = astray(&points, &faces, shift);
        let to_scene = DAffine3::from_scale_rotation_translation(
            DVec3::splat(10f64.powi(k)),
            glam::DQuat::from_rotation_y(0.3),
            DVec3::new(0.1, 1.0, 0.7),
        );
        let objects = [placed(&own, to_scene * back)];
        let native = build(&objects);
        for far in [0.0, 1.5, 1e3, 1e6] {
            let centre = to_scene.translation.as_vec3();
            let eye = (to_scene.translation + far * 10f64.powi(k) * numbers.direction().as_dvec3()).as_vec3();
            let target = if far == 0.0 { eye + numbers.direction() } else { centre };
            let half = if far == 0.0 { 0.5 } else { 10f32.powi(k) };
            let rays = view(eye, target, half);
            let want: Vec<_> = rays.iter().map(|ray| loop_over(&objects, ray)).collect();
            check(&native, &rays, &want);
        }
    }
}

/// Rays from inside to every corner and three places of every edge, as placed, that meet nothing.
fn leaks(own: &Mesh, to_scene: DAffine3, inside: Vec3) -> usize {
    let native = build(&[placed(own, to_scene)]);
    let triangles = &own.data.triangles;
    let scene = |p: DVec3| to_scene.transform_point3(p).as_vec3();
    let o = to_scene.transform_point3(inside.as_dvec3()).as_vec3();
    let leaks = |p: DVec3| usize::from(native.intersect(&Ray::new(o, scene(p) - o)).is_none());
    let points = (0..triangles.vertex_count() as u32).map(|i| leaks(triangles.point(i).as_dvec3()));
    let edges = (0..triangles.face_count() as u32).flat_map(|prim| {
        let [a, b, c] = triangles.triangle(prim).map(Vec3::as_dvec3);
        [(a, b), (b, c), (c, a)]
    });
    let along = |(a, b): (DVec3, DVec3)| [0.5, 0.25, 0.001].map(|s| leaks(a.lerp(b, s))).iter().sum::<usize>();
    points.sum::<usize>() + edges.map(along).sum::<usize>()
}

#[test]
fn a_closed_placed_mesh_does_not_leak() {
    for (points, faces) in [ball(16, round), ball(20, bumpy)] {
        for (name, to_scene) in transforms() {
            for shift in [0.0, 1e3, 1e4] {
                let (own, back) = astray(&points, &faces, shift);
                let inside = Vec3::new(0.11, -0.2, 0.17) - back.translation.as_vec3();
                assert_eq!(leaks(&own, to_scene * back, inside), 0, "{name}, from {shift}");
            }
        }
    }
}

#[test]
fn copies_share_one_hierarchy() {
    let (points, faces) = ball(20, bumpy);
    let (own, other) = (bare(&mesh(&points, faces.clone())), bare(&mesh(&points, faces)));
    let copies = |n| (0..n).map(|i| placed(&own, DAffine3::from_translation(DVec3::splat(f64::from(i)))));
    let bytes = |objects: Vec<Object>| build(&objects).bytes();
    let one = bytes(copies(1).collect());
    assert!(bytes(copies(100).collect()) < one + 100 * 320);
    let two = bytes(copies(1).chain([placed(&other, DAffine3::IDENTITY)]).collect());
    assert!(two > one + one * 9 / 10);
}

#[test]
fn a_placement_that_cannot_be_undone_is_refused() {
    let own = bare(&mesh(&[Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]));
    let flat = DAffine3::from_mat3(DMat3::from_diagonal(DVec3::new(1.0, 0.0, 1.0)));
    let nowhere = DAffine3::from_translation(DVec3::NAN);
    let error = |to_scene| {
        let objects = [placed(&own, DAffine3::IDENTITY), placed(&own, to_scene)];
        Native::build(&objects, &BuildOptions { quality: Quality::Good, cancel: &NEVER, memory_limit: None }).err()
    };
    let singular = ShapeError::Singular { volume: 0.0 };
    assert_eq!(error(flat), Some(BuildError::Transform { object: 1, source: singular }));
    assert_eq!(error(nowhere), Some(BuildError::Transform { object: 1, source: ShapeError::TransformNotFinite }));
}

#[test]
fn an_empty_mesh_can_be_placed() {
    let empty = bare(&mesh(&[], vec![]));
    let bad = bare(&std::sync::Arc::new(TriangleMesh::new(vec![0.0; 9], vec![[0, 1, 2]])));
    let good = bare(&mesh(&[Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]));
    let ray = Ray::new(Vec3::new(0.2, 0.2, 1.0), -Vec3::Z);
    let nothing = build(&[&empty, &bad].map(|m| placed(m, DAffine3::IDENTITY)));
    assert_eq!((nothing.intersect(&ray), nothing.occluded(&ray)), (None, false));
    let native = build(&[&empty, &bad, &good].map(|m| placed(m, DAffine3::IDENTITY)));
    assert_eq!(native.intersect(&ray).map(|h| (h.t, h.geom_id, h.prim_id)), Some((1.0, 2, 0)));
}
