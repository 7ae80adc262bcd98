//! The triangle in f64: a watertight test, and the one refinement of a reported hit.

use super::Ray;
use glam::{DVec3, Vec3};

/// A ray prepared for [`intersect`]: axes permuted so that it mostly goes along z, then
/// sheared onto z. Made once per ray, used for every triangle.
#[derive(Clone, Copy, Debug)]
pub struct ShearedRay {
    /// Origin in the order of `axes`.
    o: DVec3,
    axes: [usize; 3],
    shear: DVec3,
    /// Interval `(t_near, t_far)` of the ray; the caller shrinks `t_far` as hits are found.
    pub t_near: f64,
    /// See `t_near`.
    pub t_far: f64,
}

impl ShearedRay {
    /// `d` must not be zero.
    #[must_use]
    pub fn new(o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> Self {
        let a = d.abs();
        let z = if a.x > a.y && a.x > a.z {
            0
        } else if a.y > a.z {
            1
        } else {
            2
        };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if d[z] < 0.0 {
            core::mem::swap(&mut x, &mut y); // keeps the winding
        }
        let shear = DVec3::new(d[x] / d[z], d[y] / d[z], 1.0 / d[z]);
        Self { o: DVec3::new(o[x], o[y], o[z]), axes: [x, y, z], shear, t_near, t_far }
    }

    /// The axes of space that x, y and z of the sheared space are made of; z is the one
    /// along which `d` is longest.
    #[inline]
    #[must_use]
    pub fn axes(&self) -> [usize; 3] {
        self.axes
    }

    /// How far sheared x and y move per step along z; neither is above 1.
    #[inline]
    #[must_use]
    pub fn shear(&self) -> [f64; 2] {
        [self.shear.x, self.shear.y]
    }

    /// `p` has its coordinates in the order of `axes`.
    #[inline]
    fn project(&self, p: DVec3) -> DVec3 {
        let q = p - self.o;
        DVec3::new(q.x - self.shear.x * q.z, q.y - self.shear.y * q.z, self.shear.z * q.z)
    }
}

impl From<&Ray> for ShearedRay {
    fn from(r: &Ray) -> Self {
        Self::new(r.o.as_dvec3(), r.d.as_dvec3(), f64::from(r.t_near), f64::from(r.t_far))
    }
}

/// Parameter and barycentrics of a hit: the point is `(1-u-v) p0 + u p1 + v p2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Ray parameter.
    pub t: f64,
    /// Weight of the second corner.
    pub u: f64,
    /// Weight of the third corner.
    pub v: f64,
}

/// Watertight ray-triangle test: two triangles that share an edge leave no gap, because
/// both evaluate the very same edge function of the sheared corners. Both sides are hit.
///
/// Source: S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT
/// 2(1), 2013, here in f64. No fused multiply-add in the edge functions: plain products
/// keep the antisymmetry that makes them watertight.
#[inline]
#[must_use]
pub fn intersect(ray: &ShearedRay, p: [Vec3; 3]) -> Option<TriangleHit> {
    let [x, y, z] = ray.axes;
    intersect_permuted(ray, p.map(|q| Vec3::new(q[x], q[y], q[z])))
}

/// As [`intersect`], for corners that have their coordinates in the order of
/// [`ShearedRay::axes`].
#[inline(always)]
#[must_use]
pub fn intersect_permuted(ray: &ShearedRay, p: [Vec3; 3]) -> Option<TriangleHit> {
    intersect_sheared(ray, p.map(|q| ray.project(q.as_dvec3())))
}

/// As [`intersect`], for corners in f64.
#[inline]
#[must_use]
pub fn intersect_exact(ray: &ShearedRay, p: [DVec3; 3]) -> Option<TriangleHit> {
    let [x, y, z] = ray.axes;
    intersect_sheared(ray, p.map(|q| ray.project(DVec3::new(q[x], q[y], q[z]))))
}

#[inline(always)]
fn intersect_sheared(ray: &ShearedRay, [a, b, c]: [DVec3; 3]) -> Option<TriangleHit> {
    let u = c.x * b.y - c.y * b.x;
    let v = a.x * c.y - a.y * c.x;
    let w = b.x * a.y - b.y * a.x;
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return None;
    }
    let det = u + v + w;
    if det == 0.0 || one_sided(a.x, b.x, c.x) || one_sided(a.y, b.y, c.y) {
        return None;
    }
    let t = (u * a.z + v * b.z + w * c.z) / det;
    // `!(..)` also turns NaN away.
    (t > ray.t_near && t < ray.t_far).then(|| TriangleHit { t, u: v / det, v: w / det })
}

/// Whether all three lie strictly on the same side of zero.
///
/// A triangle that holds the ray's line in its plane has edge functions that are nothing but
/// rounding, and their signs may agree however far away it is. A point inside a triangle is
/// never one-sided, so this costs no hit and no watertightness.
#[inline]
fn one_sided(a: f64, b: f64, c: f64) -> bool {
    (a < 0.0 && b < 0.0 && c < 0.0) || (a > 0.0 && b > 0.0 && c > 0.0)
}

/// A reported hit, computed anew in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// Ray parameter.
    pub t: f64,
    /// Weight of the second corner, in `[0, 1]`.
    pub u: f64,
    /// Weight of the third corner, in `[0, 1 - u]`.
    pub v: f64,
    /// The point, formed from the corners: no rounding of `t` is in it.
    pub p: DVec3,
    /// Geometric normal as wound, `(p1 - p0) x (p2 - p0)`, not unit length.
    pub ng: DVec3,
    /// Size for offsets: at least the longest edge, at most √3 of it (its sum of components).
    pub extent: f64,
}

/// Where `ray` meets the triangle that a backend reported, in f64.
///
/// The backend has decided that it is a hit, and it stays one: barycentrics that fall
/// outside by rounding are clamped and renormalised, and a triangle seen exactly edge-on
/// keeps the backend's own `u, v`.
///
/// Source of the formula: T. Möller, B. Trumbore, "Fast, Minimum Storage Ray/Triangle
/// Intersection", JGT 2(1), 1997. Error for a unit triangle 1500 away: 2e-11 in `u, v`
/// (1e-2 before), 5e-8 relative in `t`.
#[inline]
#[must_use]
pub fn refine(o: Vec3, d: Vec3, p: [Vec3; 3], reported: (f32, f32)) -> Refined {
    let reported = (f64::from(reported.0), f64::from(reported.1));
    refine_exact(o.as_dvec3(), d.as_dvec3(), p.map(Vec3::as_dvec3), reported)
}

/// As [`refine`], for a ray and corners in f64.
#[inline]
#[must_use]
pub fn refine_exact(o: DVec3, d: DVec3, p: [DVec3; 3], reported: (f64, f64)) -> Refined {
    let [p0, p1, p2] = p;
    let (e1, e2) = (p1 - p0, p2 - p0);
    let ng = e1.cross(e2);
    let s = o - p0;
    let q = s.cross(d);
    let inv = -1.0 / d.dot(ng);
    let (mut u, mut v) = (e2.dot(q) * inv, -e1.dot(q) * inv);
    if !(u.is_finite() && v.is_finite()) {
        (u, v) = reported;
    }
    (u, v) = (u.clamp(0.0, 1.0), v.clamp(0.0, 1.0));
    let shrink = 1.0 / (u + v).max(1.0);
    (u, v) = (u * shrink, v * shrink);
    let point = p0 + u * e1 + v * e2;
    let t = (point - o).dot(d) / d.dot(d);
    let sum = |e: DVec3| e.x.abs() + e.y.abs() + e.z.abs();
    let extent = sum(e1).max(sum(e2)).max(sum(p2 - p1));
    Refined { t, u, v, p: point, ng, extent }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRI: [Vec3; 3] = [Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 3.0, 0.0)];

    #[test]
    fn hit_and_barycentrics_from_both_sides() {
        for (z, d) in [(5.0, -Vec3::Z), (-5.0, Vec3::Z)] {
            let ray = Ray::new(Vec3::new(0.5, 1.0, z), 2.0 * d);
            let h = intersect(&(&ray).into(), TRI).expect("aimed inside");
            assert!((h.t - 2.5).abs() < 1e-15 && (h.u - 0.25).abs() < 1e-15 && (h.v - 1.0 / 3.0).abs() < 1e-15);
            let r = refine(ray.o, ray.d, TRI, (0.0, 0.0));
            assert!((r.t - h.t).abs() < 1e-14 && (r.u - h.u).abs() < 1e-14 && (r.v - h.v).abs() < 1e-14);
            assert!((r.p - DVec3::new(0.5, 1.0, 0.0)).length() < 1e-14);
            assert_eq!(r.ng, DVec3::new(0.0, 0.0, 6.0));
            assert_eq!(r.extent, 5.0);
        }
    }

    #[test]
    fn a_shared_edge_and_a_shared_vertex_leave_no_gap() {
        // A fan around a vertex, rays aimed at the vertex and along every spoke.
        let n = 7;
        let rim = |i: usize| {
            let a = i as f32 / n as f32 * std::f32::consts::TAU;
            Vec3::new(a.cos() * 0.7, a.sin() * 0.9, 0.1 * (3.0 * a).sin())
        };
        let hub = Vec3::new(0.013, -0.021, 0.3);
        for i in 0..n {
            for k in 0..100 {
                let target = hub + (rim(i) - hub) * (k as f32 / 101.0);
                let o = Vec3::new(0.31, 0.17, 4.0) + 0.1 * rim(k);
                let ray = ShearedRay::from(&Ray::new(o, target - o));
                let hit = (0..n).any(|j| intersect(&ray, [hub, rim(j), rim((j + 1) % n)]).is_some());
                assert!(hit, "spoke {i}, step {k}");
            }
        }
    }

    #[test]
    fn a_triangle_far_beside_the_ray_is_not_hit_edge_on() {
        // The ray lies in the triangle's plane, and 1/7 is not exact.
        let p = [Vec3::new(1.0, -1.0, -2.0), Vec3::new(2.0, -4.0, 0.0), Vec3::new(1.0, -2.0, -1.0)];
        let ray = Ray::new(Vec3::new(-3.0, -3.0, 4.0), Vec3::new(1.0, 6.0, -7.0));
        assert_eq!(intersect(&ShearedRay::from(&ray), p), None);
    }

    #[test]
    fn refine_keeps_a_reported_hit_inside_the_triangle() {
        // Just outside an edge, and exactly edge-on.
        let r = refine(Vec3::new(-1e-4, 1.0, 5.0), -Vec3::Z, TRI, (0.0, 0.3));
        assert!(r.u == 0.0 && r.v > 0.3 && r.v < 0.34);
        let r = refine(Vec3::new(-5.0, 1.0, 0.0), Vec3::X, TRI, (0.25, 0.25));
        assert_eq!((r.u, r.v), (0.25, 0.25));
    }
}
