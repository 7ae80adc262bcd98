//! The sphere.

use super::shape::{Roots, first_inside, inverse_length, size, some_hit, some_lane};
use super::{Bounds, Lanes, Shape, ShapeError, ShapePoint};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// All points at distance `radius` from `center`.
///
/// Bounds of the error: hit or miss is right for every ray that passes the silhouette by more
/// than 1e-6 radii, from up to 1e7 radii away; `t` within 1e-9 of itself, or of a thousandth of
/// the radius where it is less; the refined point on the surface within 1e-12 radii. One part, number 0.
///
/// Texture: `u = 1/2 + atan2(-n.x, -n.z) / 2π`, `v = 1/2 - asin(n.y)/π`, with `n` the normal turned
/// to the side that the ray comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    center: DVec3,
    radius: f64,
}

/// `a t^2 - 2 b t + c = 0` where the ray meets the sphere.
struct Quadratic {
    a: f64,
    b: f64,
    c: f64,
    /// A quarter of the discriminant; negative or NaN for a miss.
    disc: f64,
}

impl Sphere {
    /// # Errors
    /// When the radius is not a finite number above 0 or the centre is not finite.
    pub fn new(center: DVec3, radius: f64) -> Result<Self, ShapeError> {
        let radius = size("radius", radius)?;
        if !center.is_finite() {
            return Err(ShapeError::Center { center });
        }
        Ok(Self { center, radius })
    }

    /// One that was there before, taken apart.
    #[inline(always)]
    pub(crate) fn known(center: DVec3, radius: f64) -> Self {
        Self { center, radius }
    }

    /// Middle.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// Distance of the surface from the centre.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The sphere that `to_world` makes of this one, if that is a sphere with the same texture
    /// coordinates: only for shifts and scales that are the same, and positive, along all axes.
    #[must_use]
    pub fn under(&self, to_world: &DAffine3) -> Option<Self> {
        let scale = to_world.matrix3.x_axis.x;
        let plain = scale > 0.0 && to_world.matrix3 == DMat3::from_diagonal(DVec3::splat(scale));
        plain.then(|| Self::new(to_world.transform_point3(self.center), self.radius * scale).ok()).flatten()
    }

    /// [`refine_for`](Shape::refine_for) without texture coordinates and without a branch, for a loop over lanes: the
    /// same bits. The point and the normal.
    #[inline(always)]
    pub(crate) fn refine_straight(&self, o: DVec3, d: DVec3, t_near: f64, reported: f64) -> (DVec3, DVec3) {
        let t = self.quadratic(o, d).nearest(t_near, f64::INFINITY);
        let t = if t < f64::INFINITY { t } else { reported };
        let p = (o - self.center) + t * d;
        let ng = p * inverse_length(p.dot(p), self.radius);
        let finite = ng.x.is_finite() & ng.y.is_finite() & ng.z.is_finite();
        let recip = 1.0 / d.dot(d).sqrt();
        let back = if recip.is_finite() & (recip > 0.0) { -(d * recip) } else { DVec3::NEG_Z };
        let pick = |a: f64, b: f64| if finite { a } else { b };
        let ng = DVec3::new(pick(ng.x, back.x), pick(ng.y, back.y), pick(ng.z, back.z));
        (self.center + self.radius * ng, ng)
    }

    /// `b^2 - a c` cancels when the origin is far. The distance of the line from the centre,
    /// `|f x d| / |d|`, does not, so the discriminant is formed from that: `a r^2 - |f x d|^2`,
    /// the same by Lagrange's identity.
    ///
    /// As right as the perpendicular form of E. Haines et al., "Precision Improvements for
    /// Ray/Sphere Intersection" (Ray Tracing Gems, ch. 7, 2019), and a miss costs no division.
    #[inline(always)]
    fn quadratic(&self, o: DVec3, d: DVec3) -> Quadratic {
        let f = o - self.center;
        let w = f.cross(d);
        let rr = self.radius * self.radius;
        let a = d.dot(d);
        // Not `-f.d`: of the two zeros only +0.
        Quadratic { a, b: 0.0 - f.dot(d), c: f.dot(f) - rr, disc: a * rr - w.dot(w) }
    }
}

impl Quadratic {
    #[inline(always)]
    fn nearest(&self, t_near: f64, t_far: f64) -> f64 {
        let roots = Roots::new(self.a, self.b, self.c, self.disc.sqrt());
        first_inside(roots.near(), roots.far(), t_near, t_far, self.disc >= 0.0)
    }
}

impl Shape for Sphere {
    fn bounds(&self, to_world: &DAffine3) -> Bounds {
        let rows = to_world.matrix3.transpose();
        let half = self.radius * DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length());
        let center = to_world.transform_point3(self.center);
        Bounds { lo: center - half, hi: center + half }
    }

    #[inline]
    fn hit(&self, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> Option<f64> {
        let quadratic = self.quadratic(o, d);
        if quadratic.disc >= 0.0 { some_hit(quadratic.nearest(t_near, t_far)) } else { None }
    }

    #[inline(always)]
    fn hit_lanes<T: Copy + Into<f64>, const N: usize>(&self, rays: &Lanes<'_, T, N>) -> Option<[f64; N]> {
        let (mut a, mut b, mut c, mut disc) = ([0.0; N], [0.0; N], [0.0; N], [0.0; N]);
        let mut any = 0u64;
        for i in 0..N {
            let q = self.quadratic(rays.o(i), rays.d(i));
            (a[i], b[i], c[i], disc[i]) = (q.a, q.b, q.c, q.disc);
            any |= u64::from(q.disc >= 0.0);
        }
        if any == 0 {
            return None;
        }
        let mut t = [0.0; N];
        for (i, t) in t.iter_mut().enumerate() {
            let q = Quadratic { a: a[i], b: b[i], c: c[i], disc: disc[i] };
            *t = q.nearest(rays.t_near(i), rays.t_far(i));
        }
        some_lane(t)
    }

    fn contains(&self, p: DVec3) -> bool {
        (p - self.center).length_squared() < self.radius * self.radius
    }

    #[inline]
    fn refine_for(&self, o: DVec3, d: DVec3, t_near: f64, t: f64, uv: bool) -> ShapePoint {
        let t = self.hit(o, d, t_near, f64::INFINITY).unwrap_or(t);
        let p = (o - self.center) + t * d;
        let ng = p * inverse_length(p.length_squared(), self.radius);
        let ng = if ng.is_finite() { ng } else { -d.normalize_or(DVec3::Z) };
        let n = if d.dot(ng) > 0.0 { -ng } else { ng };
        let map = || DVec2::new(0.5 + (-n.x).atan2(-n.z) / TAU, 0.5 - n.y.clamp(-1.0, 1.0).asin() / PI);
        let uv = if uv { map() } else { DVec2::ZERO };
        ShapePoint { t, p: self.center + self.radius * ng, ng, uv, extent: self.radius, part: 0 }
    }
}
