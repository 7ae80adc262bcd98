//! Shapes to try, rays to try them with, and the comparison with the truth.
use glam::{DAffine3, DMat3, DVec2, DVec3};
use tison::backend::BackendKind;
use tison::bench::truth::{Solid, truth};
use tison::geom::{Cube, Cylinder, ExactTriangle, Quad, Sphere};
pub use tison::math::Random;
use tison::probe::{Answer, ProbeRay, Prober};
use tison::scene::{OneShape, Scene};

/// One shape, as each backend and the oracle have it.
pub struct Specimen {
    pub name: String,
    pub solid: Solid,
    pub to_world: DAffine3,
    pub probers: Vec<(BackendKind, Prober)>,
}

pub const SOLIDS: [(&str, Solid); 5] = [
    ("sphere", Solid::Sphere),
    ("cube", Solid::Cube([1.0, 0.7, 0.4])),
    ("tube", Solid::Cylinder { half: 0.8, capped: false }),
    ("can", Solid::Cylinder { half: 0.8, capped: true }),
    ("quad", Solid::Quad([1.0, 0.7])),
];

fn shape(solid: Solid) -> OneShape {
    match solid {
        Solid::Sphere => OneShape::Sphere(Sphere::new(DVec3::ZERO, 1.0).expect("a sphere")),
        Solid::Cube(half) => OneShape::Cube(Cube::new(DVec3::ZERO, half.into()).expect("a cube")),
        Solid::Cylinder { half, capped } => {
            OneShape::Cylinder(Cylinder::new(1.0, 2.0 * half, capped).expect("a cylinder"))
        }
        Solid::Quad(half) => OneShape::Quad(Quad::new(DVec2::from(half)).expect("a quad")),
        Solid::Triangle(corners) => OneShape::Triangle(ExactTriangle::new(corners)),
    }
}

/// A prober for each backend there is.
pub fn probers(make: impl Fn() -> Scene) -> Vec<(BackendKind, Prober)> {
    let all = BackendKind::COMPILED.iter();
    all.map(|&kind| (kind, Prober::new(make(), kind).expect("it can be built"))).collect()
}

pub fn placed(what: &str, solid: Solid, to_world: DAffine3) -> Specimen {
    let one = shape(solid);
    let probers = probers(|| Scene::of_one(one, &to_world).expect("it can be placed"));
    Specimen { name: what.into(), solid, to_world, probers }
}

pub fn all_under(what: &str, to_world: DAffine3) -> Vec<Specimen> {
    SOLIDS.iter().map(|&(name, solid)| placed(&format!("{name}, {what}"), solid, to_world)).collect()
}

/// The transforms every shape must stand.
pub fn transforms() -> Vec<(&'static str, DAffine3)> {
    let turn = DMat3::from_rotation_z(0.7) * DMat3::from_rotation_x(-1.1);
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(1.5, 1.0, 0.3), DVec3::new(-0.4, 2.0, 1.0));
    let near = DVec3::new(0.3, -2.0, 1.0);
    let at = DAffine3::from_mat3_translation;
    vec![
        ("as it is", DAffine3::IDENTITY),
        ("turned", at(turn, near)),
        ("mirrored", at(turn * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), near)),
        ("scaled 1000:1", at(turn * DMat3::from_diagonal(DVec3::new(1000.0, 1.0, 1.0)), near)),
        ("scaled 1:1000", at(turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1e-3)), near)),
        ("sheared", at(shear, near)),
        ("sheared, mirrored, stretched", at(turn * shear * DMat3::from_diagonal(DVec3::new(0.1, -20.0, 3.0)), near)),
        ("1e5 away", at(turn, DVec3::new(1e5, -1e5, 5e4))),
        ("1e6 away", at(shear, DVec3::new(-1e6, 3e5, 1e6))),
        ("tiny", at(turn * 1e-15, near * 1e-15)),
        ("huge", at(shear * 1e15, near * 1e15)),
    ]
}

/// What is allowed.
#[derive(Clone, Copy)]
pub struct Limits {
    /// A yes or no, or the part that is hit, counts only if it is this far from changing.
    pub margin: f64,
    /// Error of t relative to t, or to a thousandth of the shape where t is less.
    pub t: f64,
    /// Angle between the normals.
    pub radians: f64,
}

pub const PROMISED: Limits = Limits { margin: 1e-6, t: 2.5e-7, radians: 2e-6 };

/// Compares every backend with the truth; whether it was a decidable hit.
#[track_caller]
pub fn check(s: &Specimen, r: &ProbeRay, limits: &Limits) -> Option<bool> {
    assert_eq!(r.t_max, f64::INFINITY, "the oracle knows no end");
    let want = truth(s.solid, &s.to_world, r.o, r.d, r.t_min);
    if want.margin.is_nan() || want.margin < limits.margin {
        return None;
    }
    for (kind, prober) in &s.probers {
        let got = prober.probe(r);
        let place = format!("{} by {}: {r:?}, margin {:e}", s.name, kind.name(), want.margin);
        assert_eq!(got.is_some(), want.hit.is_some(), "{place}");
        let (Some(got), Some((t, n))) = (got, want.hit) else { continue };
        let bounds = prober.scene().bounds();
        let size = 0.5 * bounds.size().max_element();
        let off = (got.t - t).abs() / t.abs().max(1e-3 * size / r.d.length());
        assert!(off <= limits.t, "t {:e} for {t:e}, off by {off:e}; {place}", got.t);
        let angle = angle(got.ng, n);
        assert!(angle <= limits.radians, "normal {} for {n}, off by {angle:e}; {place}", got.ng);
        consistent(&got, r, &place);
    }
    Some(want.hit.is_some())
}

/// What an answer says must fit together.
#[track_caller]
pub fn consistent(got: &Answer, r: &ProbeRay, place: &str) {
    assert!((got.ng.length() - 1.0).abs() < 1e-15 && (got.n.length() - 1.0).abs() < 1e-15, "{place}");
    assert!(got.n.dot(r.d) <= 0.0, "the shading normal faces the ray; {place}");
    assert_eq!(got.entering, got.ng.dot(r.d) < 0.0, "{place}");
    assert!(r.t_min < got.t && got.t < r.t_max, "{place}");
    let along = (got.t * r.d).length();
    let scale = r.o.length() + along + got.p.length();
    assert!((r.o + got.t * r.d - got.p).length() <= 1e-15 * scale + 1e-12 * along, "{got:?}; {place}");
}

pub fn angle(a: DVec3, b: DVec3) -> f64 {
    2.0 * (0.5 * (a - b).length()).min(1.0).asin()
}

/// A ray from `distance` away, aimed at the shape's surroundings.
pub fn towards(random: &mut Random, s: &Specimen, distance: f64) -> ProbeRay {
    let o = s.to_world.transform_point3(distance * random.direction());
    let target = s.to_world.transform_point3(1.3 * random.point());
    ProbeRay::new(o, target - o)
}
