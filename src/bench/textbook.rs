//! Shapes as most books and tutorials test them, in f32: what ours are compared with.
//!
//! Without the absolute epsilons that are often found in them, which would only add failures at other scales.

use crate::geom::Ray;
use glam::Vec3;

/// `t` if it lies in the open interval.
#[inline]
pub(super) fn inside(ray: &Ray, t: f32) -> Option<f32> {
    (t > ray.t_near && t < ray.t_far).then_some(t)
}

/// The first of two parameters in the interval, if `ok` says so of it.
#[inline]
pub(super) fn first(ray: &Ray, near: f32, far: f32, ok: impl Fn(f32) -> bool) -> Option<f32> {
    [near, far].into_iter().find(|&t| inside(ray, t).is_some() && ok(t))
}

/// The quadratic formula with `b^2 - 4ac`.
#[inline]
fn roots(a: f32, b: f32, c: f32) -> Option<(f32, f32)> {
    let disc = b * b - 4.0 * a * c;
    if disc < 0.0 {
        return None;
    }
    let root = disc.sqrt();
    Some(((-b - root) / (2.0 * a), (-b + root) / (2.0 * a)))
}

/// Around the origin.
#[inline]
#[must_use]
pub fn sphere(radius: f32, ray: &Ray) -> Option<f32> {
    let (o, d) = (ray.o, ray.d);
    let (near, far) = roots(d.dot(d), 2.0 * o.dot(d), o.dot(o) - radius * radius)?;
    first(ray, near, far, |_| true)
}

/// Around the origin, by slabs and reciprocals.
#[inline]
#[must_use]
pub fn cube(half: Vec3, ray: &Ray) -> Option<f32> {
    let inverse = ray.d.recip();
    let (a, b) = ((-half - ray.o) * inverse, (half - ray.o) * inverse);
    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
    if enter <= leave { first(ray, enter, leave, |_| true) } else { None }
}

/// Around the z axis, open.
#[inline]
#[must_use]
pub fn cylinder(radius: f32, half: f32, ray: &Ray) -> Option<f32> {
    let (o, d) = (ray.o.truncate(), ray.d.truncate());
    let (near, far) = roots(d.dot(d), 2.0 * o.dot(d), o.dot(o) - radius * radius)?;
    first(ray, near, far, |t| (ray.o.z + t * ray.d.z).abs() <= half)
}

/// T. Möller, B. Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", JGT 2(1), 1997.
#[inline]
#[must_use]
pub fn triangle([a, b, c]: [Vec3; 3], ray: &Ray) -> Option<f32> {
    let (e1, e2) = (b - a, c - a);
    let p = ray.d.cross(e2);
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let inverse = 1.0 / det;
    let s = ray.o - a;
    let u = s.dot(p) * inverse;
    if !(0.0..=1.0).contains(&u) {
        return None;
    }
    let q = s.cross(e1);
    let v = ray.d.dot(q) * inverse;
    if v < 0.0 || u + v > 1.0 {
        return None;
    }
    inside(ray, e2.dot(q) * inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn head_on_they_are_right() {
        let ray = Ray::new(Vec3::new(0.1, 0.0, 5.0), Vec3::new(0.0, 0.0, -2.0));
        let close = |t: Option<f32>, want: f32| assert!((t.expect("a hit") - want).abs() < 1e-5, "{t:?}");
        close(sphere(1.0, &ray), 0.5 * (5.0 - 0.99f32.sqrt()));
        close(cube(Vec3::new(1.0, 2.0, 3.0), &Ray { d: Vec3::new(0.01, 0.01, -2.0), ..ray }), 1.0);
        close(triangle([Vec3::ZERO, Vec3::X, Vec3::Y], &Ray { o: Vec3::new(0.2, 0.2, 5.0), ..ray }), 2.5);
        assert_eq!(cylinder(1.0, 1.0, &Ray { o: Vec3::new(3.0, 0.0, 0.0), ..ray }), None);
        close(cylinder(1.0, 1.0, &Ray::new(Vec3::new(3.0, 0.0, 0.0), -Vec3::X)), 2.0);
        assert_eq!(sphere(1.0, &Ray { t_far: 1.0, ..ray }), None);
    }
}
