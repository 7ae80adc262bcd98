//! Triangle meshes against a loop over all triangles, and against what must hold for every
//! mesh: no leak, no order, no scale.

use crate::kit::{Numbers, ball, batches, built, bumpy, check_batches, key, mesh, objects, round, soup};
use glam::Vec3;
use proptest::prelude::*;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tison::backend::Backend;
use tison::backend::native::{BuildError, BuildOptions, Native, Quality};
use tison::geom::triangle::{self, ShearedRay};
use tison::geom::{BAD_FACE, Hit, Ray, TriangleMesh};

/// Whether the ray lies in the triangle's plane as far as f64 can tell.
fn edge_on(ray: &Ray, [a, b, c]: [Vec3; 3]) -> bool {
    let [a, b, c, d] = [a, b, c, ray.d].map(Vec3::as_dvec3);
    let n = (b - a).cross(c - a).normalize();
    n.dot(d.normalize()).abs() < 1e-12
}

/// `(t, geom_id, prim_id)` of the nearest hit, by asking every triangle.
fn brute_force(meshes: &[Arc<TriangleMesh>], ray: &Ray) -> Option<(f32, u32, u32)> {
    brute_force_if(meshes, ray, |_| true)
}

/// The same among some triangles.
fn brute_force_if(
    meshes: &[Arc<TriangleMesh>],
    ray: &Ray,
    wanted: impl Fn([Vec3; 3]) -> bool,
) -> Option<(f32, u32, u32)> {
    let mut line = ShearedRay::from(ray);
    (line.t_near, line.t_far) = (f64::NEG_INFINITY, f64::INFINITY);
    let mut best: Option<(f64, u32, u32)> = None;
    for (geom, mesh) in (0..).zip(meshes) {
        for (prim, face) in (0..).zip(mesh.faces()).filter(|(_, f)| **f != BAD_FACE) {
            let Some(h) = triangle::intersect(&line, face.map(|i| mesh.point(i))) else { continue };
            let inside = h.t as f32 > ray.t_near && (h.t as f32) < ray.t_far;
            let nearer = inside && best.is_none_or(|b| (h.t, geom, prim) < b);
            if nearer && wanted(mesh.triangle(prim)) {
                best = Some((h.t, geom, prim));
            }
        }
    }
    best.map(|(t, geom, prim)| (t as f32, geom, prim))
}

// ---- against brute force ----

/// Coordinates on a coarse lattice: shared planes, edges and corners everywhere.
fn lattice() -> impl Strategy<Value = Vec3> + Clone {
    [-4i8..=4, -4i8..=4, -4i8..=4].prop_map(|p| Vec3::from(p.map(f32::from)))
}

fn point() -> impl Strategy<Value = Vec3> + Clone {
    [-4f32..4.0, -4f32..4.0, -4f32..4.0].prop_map(Vec3::from)
}

/// One in four is a sliver: two corners close together.
fn triangles(p: impl Strategy<Value = Vec3> + Clone) -> impl Strategy<Value = Vec<[Vec3; 3]>> {
    let sliver = (p.clone(), p.clone(), point(), -6i32..-1).prop_map(|(a, b, e, k)| [a, b, b + e * 10f32.powi(k)]);
    proptest::collection::vec(prop_oneof![3 => [p.clone(), p.clone(), p], 1 => sliver], 1..60)
}

/// What a ray is aimed at, in terms of the triangles.
#[derive(Clone, Debug)]
enum Aim {
    Along(Vec3),
    Axis(usize, bool),
    Corner(prop::sample::Index, usize),
    Edge(prop::sample::Index, usize, f32),
    Inside(prop::sample::Index, f32, f32),
}

fn aim() -> impl Strategy<Value = Aim> {
    let pick = || any::<prop::sample::Index>();
    prop_oneof![
        point().prop_map(Aim::Along),
        (0..3usize, any::<bool>()).prop_map(|(axis, back)| Aim::Axis(axis, back)),
        (pick(), 0..3usize).prop_map(|(t, k)| Aim::Corner(t, k)),
        (pick(), 0..3usize, 0f32..1.0).prop_map(|(t, k, s)| Aim::Edge(t, k, s)),
        (pick(), 0f32..1.0, 0f32..1.0).prop_map(|(t, a, b)| Aim::Inside(t, a, b)),
    ]
}

fn direction(aim: &Aim, o: Vec3, triangles: &[[Vec3; 3]]) -> Vec3 {
    let target = match aim {
        Aim::Along(d) => return *d,
        Aim::Axis(axis, back) => {
            // The other two are +0 or -0.
            let mut d = if *back { Vec3::splat(-0.0) } else { Vec3::ZERO };
            d[*axis] = if *back { -1.0 } else { 1.0 };
            return d;
        }
        Aim::Corner(t, k) => t.get(triangles)[*k],
        Aim::Edge(t, k, s) => t.get(triangles)[*k].lerp(t.get(triangles)[(k + 1) % 3], *s),
        Aim::Inside(t, a, b) => {
            let [p, q, r] = t.get(triangles);
            p.lerp(*q, *a).lerp(*r, *b)
        }
    };
    target - o
}

fn compare(triangles: &[[Vec3; 3]], rays: &[(Vec3, Aim)], quality: Quality) -> Result<(), TestCaseError> {
    let (a, b) = triangles.split_at(triangles.len() / 2);
    let meshes = [soup(a), mesh(&[], vec![]), soup(b)];
    let native = built(&meshes, quality);
    for (o, aim) in rays {
        let d = direction(aim, *o, triangles);
        for ray in [Ray::new(*o, d), Ray::segment(*o, d, 1.0), Ray { t_near: 0.5, ..Ray::new(*o, d) }] {
            let mut want = if d == Vec3::ZERO { None } else { brute_force(&meshes, &ray) };
            let got = key(native.intersect(&ray));
            if want.is_some_and(|(_, g, p)| edge_on(&ray, meshes[g as usize].triangle(p))) && got != want {
                // Its `t` is rounding and may lie before its box: it may be passed over.
                want = brute_force_if(&meshes, &ray, |t| !edge_on(&ray, t));
                if got.is_some_and(|(_, g, p)| edge_on(&ray, meshes[g as usize].triangle(p))) {
                    continue;
                }
            }
            prop_assert_eq!(got, want, "{:?}", ray);
            prop_assert_eq!(native.occluded(&ray), got.is_some(), "{:?}", ray);
        }
    }
    Ok(())
}

fn quality() -> impl Strategy<Value = Quality> {
    prop_oneof![Just(Quality::Good), Just(Quality::Fast)]
}

fn rays(p: impl Strategy<Value = Vec3>) -> impl Strategy<Value = Vec<(Vec3, Aim)>> {
    proptest::collection::vec((p, aim()), 16)
}

proptest! {
    #[test]
    fn a_soup_answers_like_a_loop(t in triangles(point()), rays in rays(point()), q in quality()) {
        compare(&t, &rays, q)?;
    }

    #[test]
    fn a_lattice_answers_like_a_loop(t in triangles(lattice()), rays in rays(lattice()), q in quality()) {
        compare(&t, &rays, q)?;
    }

    /// Boxes must not lose what f64 decides, however far away the ray starts.
    #[test]
    fn far_origins_answer_like_a_loop(t in triangles(point()), rays in rays(point()), k in 1i32..9) {
        let far: Vec<_> = rays.into_iter().map(|(o, aim)| (o * 10f32.powi(k), aim)).collect();
        compare(&t, &far, Quality::Good)?;
    }

    #[test]
    fn any_scale_answers_like_a_loop(
        t in triangles(point()), rays in rays(point()), k in -15i32..=15, shift in point()
    ) {
        let scale = |p: Vec3| (p + shift) * 10f32.powi(k);
        let t: Vec<_> = t.into_iter().map(|t| t.map(scale)).collect();
        let rays: Vec<_> = rays.into_iter().map(|(o, aim)| (scale(o), aim)).collect();
        compare(&t, &rays, Quality::Good)?;
    }
}

// ---- closed meshes ----

/// Rays from `o` to every corner, three places of every edge and in `random` directions
/// that meet nothing.
fn leaks(points: &[Vec3], faces: &[[u32; 3]], o: Vec3, random: usize) -> usize {
    let native = built(&[mesh(points, faces.to_vec())], Quality::Good);
    let leaks = |d: Vec3| usize::from(native.intersect(&Ray::new(o, d)).is_none());
    let corners: usize = points.iter().map(|&p| leaks(p - o)).sum();
    let along = |[a, b]: [u32; 2], s: f32| leaks(points[a as usize].lerp(points[b as usize], s) - o);
    let edges = faces.iter().flat_map(|f| [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]]);
    let edges: usize = edges.map(|e| along(e, 0.5) + along(e, 0.25) + along(e, 0.001)).sum();
    let mut numbers = Numbers(5);
    corners + edges + (0..random).map(|_| leaks(numbers.direction())).sum::<usize>()
}

#[test]
fn a_closed_mesh_does_not_leak() {
    for (name, (points, faces)) in [("round", ball(40, round)), ("bumpy", ball(48, bumpy))] {
        for o in [Vec3::ZERO, Vec3::new(0.31, -0.2, 0.17), points[7] * 0.999] {
            assert_eq!(leaks(&points, &faces, o, 100_000), 0, "{name} from {o}");
        }
    }
}

#[test]
fn a_closed_mesh_does_not_leak_at_any_scale() {
    let (points, faces) = ball(12, bumpy);
    for k in [-15, -9, -3, 3, 9, 15] {
        let s = 10f32.powi(k);
        let scaled: Vec<_> = points.iter().map(|&p| p * s).collect();
        assert_eq!(leaks(&scaled, &faces, Vec3::new(0.1, 0.2, -0.3) * s, 5_000), 0, "scale 1e{k}");
    }
}

#[test]
fn a_closed_mesh_does_not_leak_at_any_place() {
    let (points, faces) = ball(12, bumpy);
    for shift in [1e2, 1e4, 1e5] {
        let to = Vec3::new(shift, -0.5 * shift, shift);
        let moved: Vec<_> = points.iter().map(|&p| p + to).collect();
        assert_eq!(leaks(&moved, &faces, to + 0.1, 5_000), 0, "shift {shift:e}");
    }
}

/// A flat grid seen head on from over every corner and edge, its border included: the ray
/// lies in the sides of boxes, and two of its components are zero.
#[test]
fn axis_parallel_rays_in_the_sides_of_boxes_hit() {
    let n = 8u32;
    let points: Vec<_> = (0..=n).flat_map(|y| (0..=n).map(move |x| Vec3::new(x as f32, y as f32, 2.0))).collect();
    let at = |x: u32, y: u32| y * (n + 1) + x;
    let faces: Vec<_> = (0..n)
        .flat_map(|y| (0..n).map(move |x| (x, y)))
        .flat_map(|(x, y)| [[at(x, y), at(x + 1, y), at(x, y + 1)], [at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]])
        .collect();
    for (turn, shift) in (0..3).flat_map(|turn| [0.0, -3.0, 5.0, -8.0].map(|shift| (turn, shift))) {
        let turned = |p: Vec3| Vec3::new(p[turn], p[(turn + 1) % 3], p[(turn + 2) % 3]);
        let placed = |p: Vec3| turned(p + Vec3::new(shift, shift, 0.0));
        let points: Vec<_> = points.iter().map(|&p| placed(p)).collect();
        let native = built(&[mesh(&points, faces.clone())], Quality::Good);
        for (x, y) in (0..=2 * n).flat_map(|y| (0..=2 * n).map(move |x| (0.5 * x as f32, 0.5 * y as f32))) {
            for (z, dz, zero) in [(0.0, 1.0, 0.0), (0.0, 1.0, -0.0), (7.0, -1.0, 0.0), (7.0, -1.0, -0.0)] {
                let (o, d) = (placed(Vec3::new(x, y, z)), turned(Vec3::new(zero, zero, dz)));
                let t = native.intersect(&Ray::new(o, d)).map(|h| h.t);
                assert_eq!(t, Some((z - 2.0).abs()), "from {o} along {d}");
            }
        }
    }
}

// ---- answers ----

#[test]
fn nothing_is_hit_in_an_empty_scene() {
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    let bad = mesh(&[Vec3::ZERO, Vec3::X, Vec3::NAN], vec![[0, 1, 2], [0, 1, 9], [0, 0, 1]]);
    for meshes in [vec![], vec![mesh(&[], vec![])], vec![bad]] {
        let native = built(&meshes, Quality::Good);
        assert_eq!(native.intersect(&ray), None);
        assert!(!native.occluded(&ray));
    }
}

#[test]
fn a_single_triangle_gives_point_normal_and_ids() {
    let t = [Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 3.0, 0.0)];
    let native = built(&[soup(&[t])], Quality::Good);
    let hit = native.intersect(&Ray::new(Vec3::new(0.5, 1.0, 5.0), Vec3::new(0.0, 0.0, -2.0)));
    let want = Hit { t: 2.5, u: 0.25, v: 1.0 / 3.0, ng: Vec3::new(0.0, 0.0, 6.0), prim_id: 0, geom_id: 0 };
    assert_eq!(hit, Some(want));
    assert_eq!(native.intersect(&Ray::new(Vec3::new(2.0, 3.0, 5.0), -Vec3::Z)), None);
}

#[test]
fn a_tiny_triangle_has_a_normal() {
    let t = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p * 1e-25);
    let native = built(&[soup(&[t])], Quality::Good);
    let hit = native.intersect(&Ray::new(Vec3::new(2e-26, 2e-26, 1.0), -Vec3::Z)).expect("aimed inside");
    assert_eq!((hit.t, hit.ng), (1.0, Vec3::Z));
}

#[test]
fn faces_keep_their_numbers_beside_bad_ones() {
    let p = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(0.0, 0.0, f32::NAN)];
    let bad = mesh(&p, vec![[0, 1, 3]; 3]);
    let good = mesh(&p, vec![[0, 1, 3], [0, 1, 1], [0, 1, 2], [9, 1, 2]]);
    let native = built(&[bad, good], Quality::Good);
    let hit = native.intersect(&Ray::new(Vec3::new(0.2, 0.2, 1.0), -Vec3::Z)).expect("aimed inside");
    assert_eq!((hit.geom_id, hit.prim_id), (1, 2));
}

#[test]
fn of_equal_hits_the_lowest_number_is_reported() {
    let mut numbers = Numbers(3);
    let base: Vec<[Vec3; 3]> = (0..40).map(|_| [numbers.point(), numbers.point(), numbers.point()]).collect();
    // Every triangle three times in each of three meshes, in three different orders.
    let rotated = |k: usize| base.iter().cycle().skip(k).take(3 * base.len()).copied().collect::<Vec<_>>();
    let meshes = [0, 13, 29].map(|k| soup(&rotated(k)));
    for quality in [Quality::Good, Quality::Fast] {
        let native = built(&meshes, quality);
        let mut hits = 0;
        for _ in 0..2000 {
            let o = numbers.point() * 3.0;
            let ray = Ray::new(o, numbers.point() - o);
            let want = brute_force(&meshes, &ray);
            assert_eq!(key(native.intersect(&ray)), want);
            if let Some((_, geom, prim)) = want {
                assert!(geom == 0 && prim < 40);
                hits += 1;
            }
        }
        assert!(hits > 500, "{hits}");
    }
}

#[test]
fn coinciding_triangles_fill_many_leaves() {
    let native = built(&[soup(&[[Vec3::ZERO, Vec3::X, Vec3::Y]; 5000])], Quality::Good);
    let hit = native.intersect(&Ray::new(Vec3::new(0.3, 0.3, -1.0), Vec3::Z)).expect("aimed inside");
    assert_eq!((hit.t, hit.prim_id), (1.0, 0));
}

/// Each layer is larger and farther out by the same factor: planes at equal distances peel
/// off a few at a time, and the tree gets deep.
#[test]
fn a_deep_tree_is_walked() {
    let layer = |i: i32| {
        let s = 1.15f32.powi(i % 500 - 250);
        let z = if i < 500 { s } else { -s };
        [Vec3::new(-s, -s, z), Vec3::new(3.0 * s, -s, z), Vec3::new(-s, 3.0 * s, z)]
    };
    let layers: Vec<_> = (0..1000).map(layer).collect();
    let meshes = [soup(&layers)];
    let native = built(&meshes, Quality::Good);
    let mut numbers = Numbers(11);
    for [corner, ..] in layers {
        let o = Vec3::new(0.0, 0.0, corner.z * 1.01);
        for d in [Vec3::Z, -Vec3::Z, numbers.direction()] {
            let ray = Ray::new(o, d);
            assert_eq!(key(native.intersect(&ray)), brute_force(&meshes, &ray), "{ray:?}");
        }
    }
}

#[test]
fn the_interval_is_open() {
    let (points, faces) = ball(6, bumpy);
    let native = built(&[mesh(&points, faces)], Quality::Good);
    let mut numbers = Numbers(7);
    for _ in 0..5000 {
        let o = numbers.point() * 2.0;
        // From hit to hit: `t` grows, and no triangle is met twice.
        let mut from = Ray::new(o, numbers.point() - o);
        let mut seen = Vec::new();
        while let Some(hit) = native.intersect(&from) {
            assert!(hit.t > from.t_near, "{from:?}");
            assert!(!seen.contains(&hit.prim_id), "{from:?} meets {} again", hit.prim_id);
            seen.push(hit.prim_id);
            let ends = Ray { t_far: hit.t, ..from };
            assert_eq!(native.intersect(&ends), None);
            assert!(!native.occluded(&ends));
            let reaches = Ray { t_far: hit.t.next_up(), ..from };
            assert_eq!(native.intersect(&reaches), Some(hit));
            assert!(native.occluded(&reaches));
            from.t_near = hit.t;
        }
    }
}

#[test]
fn the_length_of_a_direction_only_scales_t() {
    let (points, faces) = ball(10, bumpy);
    let native = built(&[mesh(&points, faces)], Quality::Good);
    let mut numbers = Numbers(9);
    for _ in 0..500 {
        let (o, d) = (numbers.point() * 0.5, numbers.direction());
        let near = native.intersect(&Ray::new(o, d)).expect("from inside");
        for k in [-99, -33, 33, 66] {
            // A power of two is exact: the answers must be the same to the bit.
            let hit = native.intersect(&Ray::new(o, d * 2f32.powi(k))).expect("from inside");
            assert_eq!(hit, Hit { t: near.t * 2f32.powi(-k), ..near }, "2^{k}");
        }
        for s in [1e-30, 1e-25, 1e-10, 1e10, 1e20] {
            let hit = native.intersect(&Ray::new(o, d * s)).expect("from inside");
            let t = hit.t * s;
            assert!((t / near.t - 1.0).abs() < 1e-5, "{s:e}: {t} against {}", near.t);
        }
    }
}

#[test]
fn rays_that_are_none_meet_nothing() {
    let (points, faces) = ball(4, round);
    let native = built(&[mesh(&points, faces)], Quality::Good);
    let whole = Ray::new(Vec3::ZERO, Vec3::X);
    assert!(native.occluded(&whole));
    for ray in [
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
    ] {
        assert_eq!(native.intersect(&ray), None, "{ray:?}");
        assert!(!native.occluded(&ray), "{ray:?}");
    }
}

// ---- batches and builds ----

#[test]
fn batches_answer_like_single_rays() {
    let (points, faces) = ball(30, |d| bumpy(d) + 0.2 * (31.0 * d.x).sin());
    let native = built(&[mesh(&points, faces)], Quality::Good);
    let nothing = built(&[], Quality::Good);
    for rays in batches(&mut Numbers(21), &points) {
        check_batches(&native, &rays);
        check_batches(&nothing, &rays);
    }
}

#[test]
fn a_build_can_be_cancelled() {
    let (points, faces) = ball(60, bumpy);
    let objects = objects(&[mesh(&points, faces)]);
    let cancel = AtomicBool::new(true);
    for quality in [Quality::Good, Quality::Fast] {
        let result = Native::build(&objects, &BuildOptions { quality, cancel: &cancel, memory_limit: None });
        assert_eq!(result.err(), Some(BuildError::Cancelled));
    }
}
