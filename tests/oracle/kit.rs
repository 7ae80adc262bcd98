//! Shapes to try, rays to try them with, and the comparison with the truth.
use super::truth::{Solid, truth};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::sync::Arc;
use tison::geom::{Affine, Cube, Cylinder, Lanes, Plain, Quad, Shape, ShapePoint, ShapeSet, Sphere};
pub use tison::math::Random;
use tison::simd::{self, Kernel, Level};

/// One primitive, as the library and as the oracle have it.
#[derive(Clone)]
pub struct Specimen {
    pub name: String,
    pub solid: Solid,
    pub to_world: DAffine3,
    pub set: Arc<dyn Tested>,
}

/// [`ShapeSet`] of one primitive, 16 lanes wide.
pub trait Tested {
    fn hit(&self, ray: &Ray64) -> Option<f64>;
    fn refine(&self, ray: &Ray64, t: f64) -> ShapePoint;
    fn lanes(&self, rays: &[Ray64; 16]) -> Option<[f64; 16]>;
    fn bounds(&self) -> tison::geom::Bounds;
}

#[derive(Clone, Copy, Debug)]
pub struct Ray64 {
    pub o: DVec3,
    pub d: DVec3,
    pub t_near: f64,
    pub t_far: f64,
}

pub fn ray(o: DVec3, d: DVec3) -> Ray64 {
    Ray64 { o, d, t_near: 0.0, t_far: f64::INFINITY }
}

struct One<S>(S);

impl<S: ShapeSet> Tested for One<S> {
    fn hit(&self, r: &Ray64) -> Option<f64> {
        let t = self.0.hit(0, r.o, r.d, r.t_near, r.t_far);
        assert_eq!(self.0.occludes(0, r.o, r.d, r.t_near, r.t_far), t.is_some());
        t
    }

    fn refine(&self, r: &Ray64, t: f64) -> ShapePoint {
        self.0.refine(0, r.o, r.d, r.t_near, t)
    }

    fn lanes(&self, rays: &[Ray64; 16]) -> Option<[f64; 16]> {
        with_lanes(rays, |lanes| self.0.hit_lanes(0, lanes))
    }

    fn bounds(&self) -> tison::geom::Bounds {
        self.0.bounds(0)
    }
}

pub fn with_lanes<const N: usize, R>(rays: &[Ray64; N], f: impl FnOnce(&Lanes<'_, f64, N>) -> R) -> R {
    let o: [[f64; N]; 3] = std::array::from_fn(|k| rays.map(|r| r.o[k]));
    let d: [[f64; N]; 3] = std::array::from_fn(|k| rays.map(|r| r.d[k]));
    let (t_near, t_far) = (rays.map(|r| r.t_near), rays.map(|r| r.t_far));
    f(&Lanes { o: o.each_ref(), d: d.each_ref(), t_near: &t_near, t_far: &t_far })
}

pub fn plain<S: Shape>(name: &str, shape: S, solid: Solid, to_world: DAffine3) -> Specimen {
    let mut set = Plain::default();
    set.push(shape);
    Specimen { name: name.into(), solid, to_world, set: Arc::new(One(set)) }
}

pub fn affine<S: Shape>(name: &str, shape: S, solid: Solid, to_world: DAffine3) -> Specimen {
    let mut set = Affine::default();
    set.push(shape, to_world).expect("the transform can be inverted");
    Specimen { name: name.into(), solid, to_world, set: Arc::new(One(set)) }
}

pub const HALF: DVec3 = DVec3::new(1.0, 0.7, 0.4);

pub fn unit_sphere() -> Sphere {
    Sphere::new(DVec3::ZERO, 1.0).expect("a sphere")
}

pub fn cube() -> Cube {
    Cube::new(DVec3::ZERO, HALF).expect("a cube")
}

pub fn cylinder(capped: bool) -> Cylinder {
    Cylinder::new(1.0, 1.6, capped).expect("a cylinder")
}

pub fn quad() -> Quad {
    Quad::new(DVec2::new(1.0, 0.7)).expect("a quad")
}

/// Each shape as the world sees it under `to_world`.
pub fn all_under(what: &str, to_world: DAffine3) -> Vec<Specimen> {
    let named = |shape: &str| format!("{shape}, {what}");
    vec![
        affine(&named("sphere"), unit_sphere(), Solid::Sphere, to_world),
        affine(&named("cube"), cube(), Solid::Cube(HALF.into()), to_world),
        affine(&named("tube"), cylinder(false), Solid::Cylinder { half: 0.8, capped: false }, to_world),
        affine(&named("can"), cylinder(true), Solid::Cylinder { half: 0.8, capped: true }, to_world),
        affine(&named("quad"), quad(), Solid::Quad([1.0, 0.7]), to_world),
    ]
}

/// Each shape in its own space.
pub fn all_plain() -> Vec<Specimen> {
    let id = DAffine3::IDENTITY;
    vec![
        plain("sphere", unit_sphere(), Solid::Sphere, id),
        plain("cube", cube(), Solid::Cube(HALF.into()), id),
        plain("tube", cylinder(false), Solid::Cylinder { half: 0.8, capped: false }, id),
        plain("can", cylinder(true), Solid::Cylinder { half: 0.8, capped: true }, id),
        plain("quad", quad(), Solid::Quad([1.0, 0.7]), id),
    ]
}

/// The transforms every shape must stand.
pub fn transforms() -> Vec<(&'static str, DAffine3)> {
    let turn = DMat3::from_rotation_z(0.7) * DMat3::from_rotation_x(-1.1);
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(1.5, 1.0, 0.3), DVec3::new(-0.4, 2.0, 1.0));
    let near = DVec3::new(0.3, -2.0, 1.0);
    let at = DAffine3::from_mat3_translation;
    vec![
        ("turned", at(turn, near)),
        ("mirrored", at(turn * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), near)),
        ("scaled 1000:1", at(turn * DMat3::from_diagonal(DVec3::new(1000.0, 1.0, 1.0)), near)),
        ("scaled 1:1000", at(turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1e-3)), near)),
        ("sheared", at(shear, near)),
        ("sheared, mirrored, stretched", at(turn * shear * DMat3::from_diagonal(DVec3::new(0.1, -20.0, 3.0)), near)),
        ("1e5 away", at(turn, DVec3::new(1e5, -1e5, 5e4))),
        ("tiny", at(turn * 1e-12, near * 1e-12)),
        ("huge", at(shear * 1e12, near * 1e12)),
    ]
}

/// What `check` allows.
pub struct Limits {
    /// A yes or no, or the part that is hit, counts only if it is this far from changing.
    pub margin: f64,
    /// Error of t relative to t, or to a thousandth of the shape where t is less.
    pub t: f64,
    /// Angle between the normals.
    pub radians: f64,
}

pub const STRICT: Limits = Limits { margin: 1e-6, t: 1e-9, radians: 1e-6 };

/// Compares with the truth; whether it was a decidable hit.
pub fn check(s: &Specimen, r: &Ray64, limits: &Limits) -> Option<bool> {
    let want = truth(s.solid, &s.to_world, r.o, r.d, r.t_near);
    let got = s.set.hit(r);
    if want.margin.is_nan() || want.margin < limits.margin {
        return None;
    }
    assert_eq!(got.is_some(), want.hit.is_some(), "{}: {r:?}, margin {:e}", s.name, want.margin);
    let (Some(t), Some((want_t, want_n))) = (got, want.hit) else { return Some(false) };
    let size = 0.5 * s.set.bounds().size().max_element();
    let off = (t - want_t).abs() / want_t.max(1e-3 * size / r.d.length());
    assert!(off <= limits.t, "{}: t {t} for {want_t}, off by {off:e}; {r:?}", s.name);
    let point = s.set.refine(r, t);
    assert_eq!(point.t, t, "{}: refined as hit", s.name);
    let angle = 2.0 * (0.5 * (point.ng - want_n).length()).asin();
    assert!(angle <= limits.radians, "{}: normal {} for {want_n}, off by {angle:e}; {r:?}", s.name, point.ng);
    assert!((point.ng.length() - 1.0).abs() < 1e-15);
    assert_eq!(point.entering(r.d), want_n.dot(r.d) < 0.0, "{}: {r:?}", s.name);
    Some(true)
}

/// A kernel that tests one shape.
pub struct Test<'a, S, T, const N: usize>(pub &'a S, pub &'a Lanes<'a, T, N>);

impl<S: Shape, T: Copy + Into<f64>, const N: usize> Kernel for Test<'_, S, T, N> {
    type Output = Option<[f64; N]>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        self.0.hit_lanes(self.1)
    }
}

/// The lanes' answers as bits, at every level this processor has; they must be the same.
pub fn lanes_at_all_levels<S: Shape, const N: usize>(shape: &S, rays: &[Ray64; N]) -> [u64; N] {
    let run = |level| with_lanes(rays, |lanes| simd::run_at(level, Test(shape, lanes)));
    let base = run(Level::Baseline);
    for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
        let answer = run(level);
        assert_eq!(answer.map(|t| t.map(f64::to_bits)), base.map(|t| t.map(f64::to_bits)), "{level:?}");
    }
    base.map_or([f64::INFINITY.to_bits(); N], |t| t.map(f64::to_bits))
}

/// A ray from `distance` away, aimed at the shape's surroundings.
pub fn towards(random: &mut Random, s: &Specimen, distance: f64) -> Ray64 {
    let local = distance * random.direction();
    let o = s.to_world.transform_point3(local);
    let target = s.to_world.transform_point3(1.3 * random.point());
    ray(o, target - o)
}
