//! Shapes as careful books test them, in f32: what can be had without f64.

use super::textbook::{first, inside};
use crate::geom::Ray;
use glam::{Vec2, Vec3};

/// Where a line meets a circle or sphere of radius `r` around the origin; the caller's vectors say of how many dimensions.
///
/// The discriminant is the squared distance of the line from the middle, which does not cancel, and of the two roots
/// the one that would is got from the other.
///
/// Source: E. Haines, J. Günther, T. Akenine-Möller, "Precision Improvements for Ray/Sphere Intersection", Ray Tracing
/// Gems, chapter 7, 2019.
#[inline]
fn roots(r: f32, dd: f32, od: f32, oo: f32, beside: f32) -> Option<(f32, f32)> {
    let disc = r * r - beside;
    if disc < 0.0 {
        return None;
    }
    let root = (dd * disc).sqrt();
    let q = if od < 0.0 { root - od } else { -root - od };
    let c = (oo.sqrt() - r) * (oo.sqrt() + r);
    let (a, b) = (c / q, q / dd);
    Some((a.min(b), a.max(b)))
}

/// Around the origin.
#[inline]
#[must_use]
pub fn sphere(radius: f32, ray: &Ray) -> Option<f32> {
    let (o, d) = (ray.o, ray.d);
    let (dd, od) = (d.dot(d), o.dot(d));
    let beside: Vec3 = o - (od / dd) * d;
    let (near, far) = roots(radius, dd, od, o.dot(o), beside.dot(beside))?;
    first(ray, near, far, |_| true)
}

/// Around the origin, by slabs and quotients; the far end is moved by what rounding may have taken from it.
///
/// Source: T. Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013.
#[inline]
#[must_use]
pub fn cube(half: Vec3, ray: &Ray) -> Option<f32> {
    /// `1 + 2 γ(3)` with `γ(n) = nε / (1 - nε)`, ε half of [`f32::EPSILON`].
    const FARTHER: f32 = 1.0 + 3.0 * f32::EPSILON;
    let (a, b) = ((-half - ray.o) / ray.d, (half - ray.o) / ray.d);
    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
    if enter <= leave * FARTHER { first(ray, enter, leave, |_| true) } else { None }
}

/// Around the z axis, open.
#[inline]
#[must_use]
pub fn cylinder(radius: f32, half: f32, ray: &Ray) -> Option<f32> {
    let (o, d) = (ray.o.truncate(), ray.d.truncate());
    let (dd, od) = (d.dot(d), o.dot(d));
    let beside: Vec2 = o - (od / dd) * d;
    let (near, far) = roots(radius, dd, od, o.dot(o), beside.dot(beside))?;
    first(ray, near, far, |t| (ray.o.z + t * ray.d.z).abs() <= half)
}

/// Watertight: seen along the ray, the origin lies on one side of each edge or on the other, for both triangles at it.
///
/// Source: S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013, without its second
/// look in f64 at rays exactly on an edge.
#[inline]
#[must_use]
pub fn triangle(corners: [Vec3; 3], ray: &Ray) -> Option<f32> {
    let z = ray.d.abs().max_position();
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    let scale = 1.0 / ray.d[z];
    let shear = Vec2::new(ray.d[x], ray.d[y]) * scale;
    let [a, b, c] = corners.map(|p| p - ray.o);
    let seen = |p: Vec3| Vec2::new(p[x], p[y]) - shear * p[z];
    let [pa, pb, pc] = [a, b, c].map(seen);
    let (u, v, w) = (pb.perp_dot(pc), pc.perp_dot(pa), pa.perp_dot(pb));
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return None;
    }
    let det = u + v + w;
    if det == 0.0 {
        return None;
    }
    inside(ray, (u * a[z] + v * b[z] + w * c[z]) * scale / det)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn head_on_they_are_right() {
        let ray = Ray::new(Vec3::new(0.1, 0.0, 5.0), Vec3::new(0.0, 0.0, -2.0));
        let close = |t: Option<f32>, want: f32| assert!((t.expect("a hit") - want).abs() < 1e-5, "{t:?}");
        close(sphere(1.0, &ray), 0.5 * (5.0 - 0.99f32.sqrt()));
        close(sphere(1.0, &Ray { o: Vec3::new(0.1, 0.0, 0.0), ..ray }), 0.5 * 0.99f32.sqrt());
        close(cube(Vec3::new(1.0, 2.0, 3.0), &Ray { d: Vec3::new(0.01, 0.01, -2.0), ..ray }), 1.0);
        close(triangle([Vec3::ZERO, Vec3::X, Vec3::Y], &Ray { o: Vec3::new(0.2, 0.2, 5.0), ..ray }), 2.5);
        close(triangle([Vec3::X, Vec3::ZERO, Vec3::Y], &Ray { o: Vec3::new(0.2, 0.2, 5.0), ..ray }), 2.5);
        assert_eq!(triangle([Vec3::ZERO, Vec3::X, Vec3::Y], &Ray { o: Vec3::new(0.6, 0.6, 5.0), ..ray }), None);
        assert_eq!(cylinder(1.0, 1.0, &Ray { o: Vec3::new(3.0, 0.0, 0.0), ..ray }), None);
        close(cylinder(1.0, 1.0, &Ray::new(Vec3::new(3.0, 0.0, 0.0), -Vec3::X)), 2.0);
        assert_eq!(cylinder(1.0, 1.0, &Ray::new(Vec3::new(3.0, 0.0, 1.5), -Vec3::X)), None);
        assert_eq!(sphere(1.0, &Ray { t_far: 1.0, ..ray }), None);
        assert_eq!(sphere(1.0, &Ray { o: Vec3::new(1.1, 0.0, 5.0), ..ray }), None);
    }

    #[test]
    fn far_away_the_sphere_is_better_than_the_textbook_s() {
        let at = |y: f32| Ray::new(Vec3::new(0.0, y, 3000.0), Vec3::NEG_Z);
        for (y, want) in [(0.999, Some(3000.0)), (1.001, None), (0.0, Some(2999.0))] {
            let t = sphere(1.0, &at(y));
            assert_eq!(t.is_some(), want.is_some(), "{y}");
            assert!(t.zip(want).is_none_or(|(t, want)| (t - want).abs() < 0.1), "{y}: {t:?}");
        }
        assert!(super::super::textbook::sphere(1.0, &at(1.001)).is_some(), "what it is better than");
    }
}
