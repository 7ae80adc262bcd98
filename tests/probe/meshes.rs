//! Scenes of meshes, placed and not, against a loop over all triangles in f64.
use super::kit::*;
use glam::{DAffine3, DMat3, DVec3};
use std::sync::Arc;
use tison::backend::BackendKind;
use tison::geom::{Plain, Sphere, TriangleMesh};
use tison::math::Frame;
use tison::probe::ProbeRay;
use tison::scene::{AnyShapes, Instance, Mesh, MeshData, MeshPaint, Object, Scene, Shapes, smooth};

/// A closed bumpy ball of radius about 1 with `4 n (n - 1)` triangles, wound outwards.
fn blob(n: u32) -> TriangleMesh {
    use std::f64::consts::PI;
    let around = 2 * n;
    let mut points = Vec::new();
    for i in 0..=n {
        for j in 0..around {
            let (theta, phi) = (PI * f64::from(i) / f64::from(n), PI * f64::from(j) / f64::from(n));
            let r = 1.0 + 0.1 * (5.0 * theta).sin() * (4.0 * phi).cos() * theta.sin();
            let p = r * DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
            points.extend(p.as_vec3().to_array());
        }
    }
    // One pole each, whatever the angle is.
    let at = |i: u32, j: u32| if i == 0 || i == n { i * around } else { i * around + j % around };
    let faces = (0..n).flat_map(|i| (0..around).map(move |j| (i, j))).flat_map(|(i, j)| {
        let lower = (i + 1 < n).then(|| [at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
        let upper = (i > 0).then(|| [at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        lower.into_iter().chain(upper)
    });
    TriangleMesh::new(points, faces.collect())
}

fn mesh(triangles: TriangleMesh, normals: bool, mirrored: bool) -> Mesh {
    let normals = normals.then(|| smooth::crease_normals(&triangles, 60.0));
    let data = MeshData { triangles: Arc::new(triangles), normals, uvs: None, face_materials: None };
    Mesh { data: Arc::new(data), paint: MeshPaint::One(0), mirrored }
}

fn scene(objects: Vec<Object>, frame: Frame) -> Scene {
    Scene { frame, ..Scene::of(objects) }
}

/// What the objects are in the world, in f64: of each triangle object, number, corners and whether it is mirrored.
struct Facet {
    object: u32,
    prim: u32,
    corners: [DVec3; 3],
    mirrored: bool,
}

fn facets(scene: &Scene) -> Vec<Facet> {
    let mut all = Vec::new();
    for (object, o) in scene.objects.iter().enumerate() {
        let (mesh, to) = match o {
            Object::Mesh(mesh) => (mesh, DAffine3::IDENTITY),
            Object::Instance(i) => (&i.mesh, i.to_scene),
            Object::Shapes(_) => continue,
        };
        for prim in 0..mesh.data.triangles.face_count() as u32 {
            let corners = mesh.data.triangles.triangle(prim);
            let corners = corners.map(|p| scene.frame.to_world(to.transform_point3(p.as_dvec3())));
            all.push(Facet { object: object as u32, prim, corners, mirrored: mesh.mirrored });
        }
    }
    all
}

/// `t` and the least weight.
fn meet(corners: &[DVec3; 3], o: DVec3, d: DVec3) -> (f64, f64) {
    let [a, b, c] = *corners;
    let (e1, e2) = (b - a, c - a);
    let n = e1.cross(e2);
    let (s, det) = (o - a, -d.dot(n));
    let q = s.cross(d);
    let (u, v) = (e2.dot(q) / det, -e1.dot(q) / det);
    (s.dot(n) / det, u.min(v).min(1.0 - u - v))
}

/// Nearest facet, unless rounding decides which.
fn nearest<'f>(facets: &'f [Facet], r: &ProbeRay) -> Option<Option<(f64, &'f Facet)>> {
    const DECIDED: f64 = 1e-4;
    let mut best: Option<(f64, &Facet)> = None;
    for facet in facets {
        let (t, inside) = meet(&facet.corners, r.o, r.d);
        if t <= r.t_min || t >= r.t_max || inside < -DECIDED || !t.is_finite() {
            continue;
        }
        if inside < DECIDED {
            return None;
        }
        if best.is_none_or(|b| t < b.0) {
            best = Some((t, facet));
        }
    }
    Some(best)
}

fn objects() -> Vec<Object> {
    let turn = DMat3::from_rotation_z(0.7) * DMat3::from_rotation_x(-1.1);
    let shared = mesh(blob(12), true, false);
    let to = |scale: DVec3, at: DVec3| DAffine3::from_mat3_translation(turn * DMat3::from_diagonal(scale), at);
    let plain = to(DVec3::new(0.4, 0.2, 0.3), DVec3::new(2.0, 0.0, 0.0));
    let mirror = to(DVec3::new(-0.3, 0.3, 0.5), DVec3::new(-2.0, 0.3, 0.0));
    vec![
        Object::Mesh(mesh(blob(20), false, false)),
        Object::Instance(Instance::new(shared.clone(), plain)),
        Object::Instance(Instance::new(Mesh { mirrored: true, ..shared }, mirror)),
    ]
}

const FRAMES: [Frame; 3] = [
    Frame::IDENTITY,
    Frame { origin: DVec3::new(5e5, -4e6, 100.0), exponent: 7 },
    Frame { origin: DVec3::new(1e-9, 0.0, 0.0), exponent: -40 },
];

#[test]
fn meshes_and_their_placed_copies() {
    for frame in FRAMES {
        let make = || scene(objects(), frame);
        let all = facets(&make());
        for (kind, prober) in probers(make) {
            let mut random = Random(31);
            let (mut hits, mut misses) = (0, 0);
            for i in 0..600 {
                let far = [4.0, 30.0, 1e4][i % 3];
                let (o, at) = (far * random.direction(), DVec3::new(2.5, 1.2, 1.2) * random.point());
                let (o, at) = (frame.to_world(o), frame.to_world(at));
                let r = ProbeRay::new(o, (at - o) * (0.5 + random.unit()));
                let Some(want) = nearest(&all, &r) else { continue };
                let got = prober.probe(&r);
                let place = format!("{} in {frame:?}: {r:?}", kind.name());
                assert_eq!(got.map(|a| (a.object, a.prim)), want.map(|w| (w.1.object, w.1.prim)), "{place}");
                let (Some(got), Some((t, facet))) = (got, want) else {
                    misses += 1;
                    continue;
                };
                assert!((got.t / t - 1.0).abs() < 1e-10, "{place}: {} for {t}", got.t);
                let [a, b, c] = facet.corners;
                let n = (b - a).cross(c - a).normalize() * if facet.mirrored { -1.0 } else { 1.0 };
                assert!(angle(got.ng, n) < 1e-8, "{place}: {} for {n}", got.ng);
                consistent_but_for_smooth_normals(&got, &r, &place);
                hits += 1;
            }
            assert!(hits > 100 && misses > 50, "{hits} and {misses}");
        }
    }
}

fn consistent_but_for_smooth_normals(got: &tison::probe::Answer, r: &ProbeRay, place: &str) {
    // An interpolated normal may look away where the facet does not, but not from the facet.
    let front = if got.entering { got.ng } else { -got.ng };
    assert!(got.n.dot(front) >= 0.0, "{place}");
    consistent(&tison::probe::Answer { n: front, ..*got }, r, place);
}

#[test]
fn outside_is_where_the_file_says_under_a_mirror_as_well() {
    for (_, prober) in probers(|| scene(objects(), Frame::IDENTITY)) {
        for (center, object) in [(DVec3::ZERO, 0), (DVec3::new(2.0, 0.0, 0.0), 1), (DVec3::new(-2.0, 0.3, 0.0), 2)] {
            let o = center + DVec3::new(0.0, 0.03, 6.0);
            let hit = prober.probe(&ProbeRay::new(o, center + DVec3::new(0.011, 0.017, 0.0) - o)).expect("aimed at it");
            assert_eq!((hit.object, hit.entering), (object, true));
            let hit = prober.probe(&ProbeRay::new(center, DVec3::new(0.1, 0.2, 1.0))).expect("from inside");
            assert_eq!((hit.object, hit.entering), (object, false));
        }
    }
}

#[test]
fn intervals_begin_and_end_where_f64_says() {
    for frame in FRAMES {
        for (kind, prober) in probers(|| scene(objects(), frame)) {
            let mut random = Random(32);
            for _ in 0..200 {
                let (o, at) = (frame.to_world(5.0 * random.direction()), frame.to_world(random.point()));
                let r = ProbeRay::new(o, at - o);
                let Some(hit) = prober.probe(&r) else { continue };
                let place = format!("{} in {frame:?}: {r:?}", kind.name());
                let within = |t_min, t_max| prober.probe(&ProbeRay { t_min, t_max, ..r });
                let same = within(hit.t * (1.0 - 1e-9), hit.t * (1.0 + 1e-9)).expect(&place);
                assert_eq!((same.prim, same.object), (hit.prim, hit.object), "{place}");
                assert!((same.t / hit.t - 1.0).abs() < 1e-10, "{place}");
                assert_eq!(within(0.0, hit.t * (1.0 - 1e-9)), None, "{place}");
                let next = within(hit.t * (1.0 + 1e-9), f64::INFINITY);
                assert!(next.is_some_and(|n| n.t > hit.t && (n.prim, n.object) != (hit.prim, hit.object)), "{place}");
                // From the surface itself, on both sides.
                let onward = ProbeRay { t_min: 1e-9, ..ProbeRay::new(hit.p, r.d) };
                let inside = prober.probe(&onward).expect(&place);
                assert!((inside.t + hit.t - next.unwrap().t).abs() < 1e-8, "{place}");
            }
        }
    }
}

/// Rays from inside a closed mesh, at random and exactly at its vertices and edges, all meet it.
#[test]
fn nothing_leaks_out_of_a_closed_mesh() {
    let make = || scene(vec![Object::Mesh(mesh(blob(24), false, false))], Frame::IDENTITY);
    let all = facets(&make());
    for (kind, prober) in probers(make) {
        let mut random = Random(33);
        let o = 0.3 * random.point();
        for facet in &all {
            let [a, b, _] = facet.corners;
            for target in [a, a.lerp(b, 0.5), a.lerp(b, random.unit()), o + random.direction()] {
                let hit = prober.probe(&ProbeRay::new(o, target - o));
                assert!(hit.is_some(), "{}: from {o} at {target}", kind.name());
            }
        }
    }
}

#[test]
fn shapes_and_meshes_hide_each_other() {
    let make = || {
        let mut balls = Plain::default();
        for i in 0..40 {
            let at = 1.2 * Random(100 + i).direction();
            balls.push(Sphere::new(at, 0.1).unwrap());
        }
        let shapes = Shapes { set: AnyShapes::Spheres(Arc::new(balls)), materials: vec![0; 40] };
        scene(vec![Object::Mesh(mesh(blob(20), false, false)), Object::Shapes(shapes)], FRAMES[1])
    };
    let probers = probers(make);
    let native = &probers.iter().find(|p| p.0 == BackendKind::Native).expect("it is always there").1;
    let mut random = Random(34);
    let mut met = [0; 2];
    for _ in 0..3000 {
        let (o, at) = (FRAMES[1].to_world(5.0 * random.direction()), FRAMES[1].to_world(1.2 * random.point()));
        let r = ProbeRay::new(o, at - o);
        let want = native.probe(&r);
        for (kind, prober) in &probers {
            let got = prober.probe(&r);
            assert_eq!(got.map(|a| (a.object, a.prim)), want.map(|a| (a.object, a.prim)), "{}: {r:?}", kind.name());
            if let (Some(got), Some(want)) = (got, want) {
                assert!((got.t / want.t - 1.0).abs() < 1e-12, "{}: {r:?}", kind.name());
            }
        }
        if let Some(hit) = want {
            met[hit.object as usize] += 1;
        }
    }
    assert!(met[0] > 300 && met[1] > 300, "{met:?}");
}
