//! What is true about one ray and one primitive, in f64, as far as f32 can be asked to know it.
//!
//! Rays and corners are f32 and exact. What rounds is the arithmetic between them: Embree subtracts the origin
//! from each corner, which moves it by up to half an f32 ulp of the distance `reach` of the farthest corner from
//! the origin, and evaluates edge functions whose terms are products of that distance, a side and the direction. Divided by the side,
//! each of some ten roundings moves the side by as much again. So whether a ray that passes a side within
//!
//! > `slack = 16 · 2⁻²⁴ · reach` (eight ulps of the distance)
//!
//! hits is not for f32 to decide. The same moves the corners against each other: the normal is off by up to `tilt = slack / height`,
//! with the least height of the triangle, and by `16 · 2⁻²⁴ · longest side / height` more for what the cross product of a sliver's
//! sides loses. Along the ray the hit is off by up to `slack / |cos|` for an angle between ray and normal whose cosine is
//! well above `tilt`; twice that is allowed. Below `2 tilt` the ray may as well lie in the plane: its `t` is a quotient of
//! two roundings and can be anything. A triangle seen so obliquely, or so thin, that the ray is within the slack of the lines
//! of two sides is not decided by its edge functions: their signs may agree beyond its end as well. A placed mesh adds what its transform rounds ([`placement`]).
//!
//! A shape is decided in f64 by both backends with one formula. Only boxes can lose it, and the native
//! backend passes over what is met by less than a millionth of its size: `slack` is the same, with the farthest
//! corner of its box. Its `t` must be the same to two ulps.

use crate::geom::{BAD_FACE, Bounds, Ray, ShapeSet, cofactors};
use crate::scene::{Instance, Mesh, Object, Scene};
use crate::with_shapes;
use glam::{Affine3A, DAffine3, DMat3, DVec2, DVec3, Vec3};

/// Half an f32 ulp of 1.
const EPS: f64 = 0.5 * f32::EPSILON as f64;
/// Roundings between a ray, a corner and a side's edge function, each of half an ulp of the distance.
const ROUNDINGS: f64 = 16.0;
/// The same for the distance of a plane from an end of the ray: the corners are near then, and a ray that starts four
/// of them off a surface never meets it.
const END_ROUNDINGS: f64 = 2.0;

/// On which side of its boundary a ray meets a primitive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// It is hit.
    In,
    /// It is missed.
    Out,
    /// The ray passes the boundary, or an end of its own interval, closer than f32 can tell.
    Boundary,
    /// Two of its edge functions may have either sign in f32: it is seen in line, and may be missed or reported even
    /// where the ray passes beyond its end.
    InLine,
}

/// A ray and a primitive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facts {
    pub(super) side: Side,
    /// Where along the ray it may be hit; empty where it is not at all.
    pub(super) t: Range,
    /// Most that a reported normal may be off, rad.
    pub(super) normal_slack: f64,
    /// Distance of the ray from the boundary in units of the slack; above 1 it is decided.
    pub(super) margin: f64,
}

impl Facts {
    const NOTHING: Self = Self { side: Side::Out, t: Range::NONE, normal_slack: 0.0, margin: f64::MAX };

    /// Whether a hit may be reported at `t`.
    pub(super) fn allows(&self, t: f32) -> bool {
        self.side != Side::Out && self.t.overlaps(Range::around(t.into(), 0.0))
    }
}

/// Parameters of a ray from `lo` to `hi`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub(super) lo: f64,
    pub(super) hi: f64,
}

impl Range {
    const ALL: Self = Self { lo: f64::NEG_INFINITY, hi: f64::INFINITY };
    const NONE: Self = Self { lo: f64::INFINITY, hi: f64::NEG_INFINITY };

    pub(super) fn around(t: f64, slack: f64) -> Self {
        Self { lo: t - slack, hi: t + slack }
    }

    fn extend(&mut self, t: f64) {
        *self = Self { lo: self.lo.min(t), hi: self.hi.max(t) };
    }

    pub(super) fn is_anywhere(self) -> bool {
        self.length() == f64::INFINITY
    }

    pub(super) fn length(self) -> f64 {
        self.hi - self.lo
    }

    /// Whether a `t` in f32 may be in both.
    pub(super) fn overlaps(self, other: Self) -> bool {
        let ulp = 2.0 * EPS * self.lo.abs().min(other.lo.abs());
        self.lo - ulp <= other.hi && other.lo - ulp <= self.hi
    }
}

/// What is true about `ray` and primitive `prim` of object `geom`. A primitive that is not there is missed.
pub(super) fn of(scene: &Scene, ray: &Ray, geom: u32, prim: u32) -> Facts {
    if !has(scene, geom, prim) {
        return Facts::NOTHING;
    }
    let corners = |mesh: &Mesh| mesh.data.triangles.triangle(prim).map(Vec3::as_dvec3);
    match &scene.objects[geom as usize] {
        Object::Shapes(shapes) => with_shapes!(&shapes.set, set => of_shape(&**set, prim, ray)),
        Object::Mesh(mesh) => of_triangle(ray, corners(mesh), &Rounding { slack: 0.0, sliver: 1.0, normal: 0.0 }),
        Object::Instance(instance) => {
            let local = corners(&instance.mesh);
            let placed = local.map(|p| instance.to_scene.transform_point3(p));
            let rounding = placement(instance, ray, local, placed);
            of_triangle(ray, placed, &rounding)
        }
    }
}

/// Whether the scene has primitive `prim` of object `geom`.
pub(super) fn has(scene: &Scene, geom: u32, prim: u32) -> bool {
    match scene.objects.get(geom as usize) {
        None => false,
        Some(Object::Shapes(shapes)) => prim < shapes.set.len(),
        Some(object) => object.mesh().is_some_and(|mesh| {
            let face = mesh.data.triangles.faces().get(prim as usize);
            face.is_some_and(|&face| face != BAD_FACE)
        }),
    }
}

/// What a transform adds.
struct Rounding {
    /// Distance in scene space.
    slack: f64,
    /// The `k` of the triangle in its own space.
    sliver: f64,
    /// Normals, rad.
    normal: f64,
}

/// Longest side squared over twice the area: 1.15 for an equilateral triangle, large for slivers.
fn sliver(p: [DVec3; 3]) -> f64 {
    let (a, b) = (p[1] - p[0], p[2] - p[0]);
    let longest = a.length_squared().max(b.length_squared()).max((p[2] - p[1]).length_squared());
    longest / a.cross(b).length().max(f64::MIN_POSITIVE)
}

fn largest_distance(from: DVec3, p: &[DVec3]) -> f64 {
    p.iter().map(|&q| (q - from).length()).fold(0.0, f64::max)
}

/// What Embree's way into the mesh's space rounds. It keeps the transform and its inverse in f32, the translation
/// folded in, and takes the ray's origin and direction there: what the two in a row make of a point is off
/// by their product less the identity, which is computed here, and by half an ulp for each term of the sums. Its order of
/// operations need not be the one here: four times that much is allowed. The triangle test itself then rounds in the
/// mesh's space.
fn placement(instance: &Instance, ray: &Ray, local: [DVec3; 3], placed: [DVec3; 3]) -> Rounding {
    let there = instance.to_scene.as_affine3a();
    let back = there.inverse();
    let (there, back) = (wide(&there), wide(&back));
    let size = |m: &DMat3| DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
    let o = ray.o.as_dvec3();
    // The farthest that a point on the ray's way to the triangle is from the origin, axis by axis.
    let reach = placed.iter().fold(o.abs(), |m, p| m.max(p.abs()).max((*p - o).abs()));
    let product = instance.to_scene * back;
    let off = size(&(product.matrix3 - DMat3::IDENTITY)) * reach + product.translation.abs();
    let sums = size(&there.matrix3) * (size(&back.matrix3) * reach + back.translation.abs());
    let own = local.iter().fold(DVec3::ZERO, |m, p| m.max(p.abs()));
    let matrix = size(&there.matrix3) * own + there.translation.abs();
    let in_local = largest_distance(back.transform_point3(o), &local);
    let test = (size(&there.matrix3) * DVec3::splat(slack_at(in_local))).max_element();
    let slack = 4.0 * (off + EPS * (4.0 * sums + matrix)).max_element() + test;
    let cofactors = cofactors(&there.matrix3);
    let ng = (local[1] - local[0]).cross(local[2] - local[0]).normalize_or_zero();
    let normal = 8.0 * EPS * (size(&cofactors) * (ng.abs() + sliver(local))).length()
        / (cofactors * ng).length().max(f64::MIN_POSITIVE);
    Rounding { slack, sliver: sliver(local), normal }
}

fn wide(m: &Affine3A) -> DAffine3 {
    DAffine3 { matrix3: m.matrix3.as_dmat3(), translation: m.translation.as_dvec3() }
}

fn of_triangle(ray: &Ray, p: [DVec3; 3], rounding: &Rounding) -> Facts {
    let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
    let ng = (p[1] - p[0]).cross(p[2] - p[0]);
    let (Some(normal), Some(along)) = (ng.try_normalize(), d.try_normalize()) else { return Facts::NOTHING };
    let slack = slack_at(largest_distance(o, &p)) + rounding.slack;
    let longest = (0..3).map(|i| (p[i] - p[(i + 1) % 3]).length()).fold(0.0, f64::max);
    let height = ng.length() / longest;
    let normal_slack = slack / height + ROUNDINGS * EPS * sliver(p).max(rounding.sliver) + rounding.normal;
    let cos = along.dot(normal).abs();
    let t = (p[0] - o).dot(normal) / d.dot(normal);
    // Seen along the ray, which is the origin of the plane.
    let (x, y) = along.any_orthonormal_pair();
    let flat = p.map(|q| DVec2::new((q - o).dot(x), (q - o).dot(y)));
    let inside = signed_distance(flat) / slack;
    let edge_on = cos <= 2.0 * normal_slack;
    let t_slack = slack / (0.5 * cos * d.length());
    let range = if edge_on { Range::ALL } else { Range::around(t, t_slack) };
    // How far the hit is inside the interval, in units of what its ends are told apart by.
    let end_slack = slack * END_ROUNDINGS / ROUNDINGS / (cos * d.length());
    let from_end = (t - f64::from(ray.t_near)).min(f64::from(ray.t_far) - t) / end_slack;
    // Sides whose edge functions may have either sign.
    let unclear = |i: usize| {
        let j = (i + 1) % 3;
        flat[i].perp_dot(flat[j]).abs() <= slack * (p[j] - p[i]).length()
    };
    let in_line = (0..3).filter(|&i| unclear(i)).count() >= 2;
    let side = if in_line && edge_on {
        Side::InLine
    } else if from_end < -1.0 {
        Side::Out
    } else if inside.abs() <= 1.0 {
        Side::Boundary
    } else if in_line {
        Side::InLine
    } else if inside < 0.0 {
        Side::Out
    } else if from_end <= 1.0 {
        Side::Boundary
    } else {
        Side::In
    };
    Facts { side, t: range, normal_slack, margin: inside.abs().min(from_end.abs()) }
}

/// Distance of the origin from the boundary of a triangle, negative outside.
fn signed_distance(p: [DVec2; 3]) -> f64 {
    let sides = [0, 1, 2].map(|i| p[i].perp_dot(p[(i + 1) % 3]));
    let inside = sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0);
    let to_side = |i: usize| {
        let (a, b) = (p[i], p[(i + 1) % 3]);
        let e = b - a;
        let s = (-a.dot(e) / e.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (a + s * e).length()
    };
    let distance = (0..3).map(to_side).fold(f64::INFINITY, f64::min);
    if inside { distance } else { -distance }
}

/// Rays beside this one tell how far the boundary is, whatever the shape.
fn of_shape<S: ShapeSet>(set: &S, prim: u32, ray: &Ray) -> Facts {
    /// Roundings of `t` that both backends may make.
    const T_ROUNDINGS: f64 = 4.0;
    /// Shares of the slack at which rays are tried.
    const SHARES: [f64; 4] = [0.125, 0.25, 0.5, 1.0];
    let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
    let Some(along) = d.try_normalize() else { return Facts::NOTHING };
    let bounds = set.bounds(prim);
    let slack = slack_at(largest_distance(o, &corners(&bounds)));
    // Rays beside this one start where it does: what it leaves must not come in between. They are apart by the slack
    // where the shape is.
    let distance = (bounds.center() - o).dot(along).max(bounds.size().max_element() / 8.0);
    let turn = slack / distance * d.length();
    let (near, far) = (f64::from(ray.t_near), f64::from(ray.t_far));
    let exact = set.hit(prim, o, d, near, far);
    let (mut margin, mut range) = (None, Range::NONE);
    exact.iter().for_each(|&t| range.extend(t));
    for share in SHARES {
        let hits = beside(d, along, share * turn).map(|d| set.hit(prim, o, d, near, far));
        hits.iter().flatten().for_each(|&t| range.extend(t));
        if hits.iter().any(|hit| hit.is_some() != exact.is_some()) {
            margin.get_or_insert(share);
        }
    }
    let close = |end: f64| exact.is_some_and(|t| end.is_finite() && (t - end).abs() <= T_ROUNDINGS * EPS * end);
    let side = match (margin, exact) {
        (Some(_), _) => Side::Boundary,
        _ if close(near) || close(far) => Side::Boundary,
        (None, Some(_)) => Side::In,
        (None, None) => Side::Out,
    };
    let t = match (side, exact) {
        (Side::In, Some(t)) => Range::around(t, T_ROUNDINGS * EPS * t.abs()),
        _ => range,
    };
    Facts { side, t, normal_slack: ROUNDINGS * EPS, margin: margin.unwrap_or(1.0) }
}

/// Eight vectors around `v`, off by `by` across the direction.
pub(super) fn beside(v: DVec3, along: DVec3, by: f64) -> [DVec3; 8] {
    let (x, y) = along.any_orthonormal_pair();
    std::array::from_fn(|i| {
        let (sin, cos) = (i as f64 * std::f64::consts::FRAC_PI_4).sin_cos();
        v + by * (cos * x + sin * y)
    })
}

fn corners(b: &Bounds) -> [DVec3; 8] {
    std::array::from_fn(|i| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { b.lo[axis] } else { b.hi[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    })
}

/// Slack of what is `reach` away.
pub(super) fn slack_at(reach: f64) -> f64 {
    ROUNDINGS * EPS * reach
}
