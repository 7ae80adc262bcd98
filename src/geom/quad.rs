//! The rectangle.

use super::shape::{size, some_hit, some_lane};
use super::{Bounds, Lanes, Shape, ShapeError, ShapePoint};
use glam::{DAffine3, DVec2, DVec3};

/// The rectangle `|x| <= half.x`, `|y| <= half.y`, `z = 0`, met from both sides, its border included.
///
/// Bounds of the error: `t` within 1e-9 of itself, or of a thousandth of the size where it is less. Its normal is +z. One part, number 0. A ray
/// in its plane misses. Texture: `u = (1 + x/half.x) / 2`, `v = (1 - y/half.y) / 2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quad {
    half: DVec2,
}

impl Quad {
    /// # Errors
    /// When a half size is not a finite number above 0.
    pub fn new(half: DVec2) -> Result<Self, ShapeError> {
        Ok(Self { half: DVec2::new(size("half size x", half.x)?, size("half size y", half.y)?) })
    }

    /// Distances of the border from the middle.
    #[must_use]
    pub fn half(&self) -> DVec2 {
        self.half
    }

    #[inline(always)]
    fn nearest(&self, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> f64 {
        let t = (0.0 - o.z) / d.z;
        let (x, y) = (o.x + t * d.x, o.y + t * d.y);
        // In the plane t is NaN or infinite.
        let ok = (x.abs() <= self.half.x) & (y.abs() <= self.half.y);
        if ok & (t > t_near) & (t < t_far) { t } else { f64::INFINITY }
    }
}

impl Shape for Quad {
    fn bounds(&self, to_world: &DAffine3) -> Bounds {
        let m = to_world.matrix3;
        let half = m.x_axis.abs() * self.half.x + m.y_axis.abs() * self.half.y;
        let center = to_world.translation;
        Bounds { lo: center - half, hi: center + half }
    }

    #[inline]
    fn hit(&self, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> Option<f64> {
        some_hit(self.nearest(o, d, t_near, t_far))
    }

    #[inline(always)]
    fn hit_lanes<T: Copy + Into<f64>, const N: usize>(&self, rays: &Lanes<'_, T, N>) -> Option<[f64; N]> {
        let mut t = [0.0; N];
        for (i, t) in t.iter_mut().enumerate() {
            *t = self.nearest(rays.o(i), rays.d(i), rays.t_near(i), rays.t_far(i));
        }
        some_lane(t)
    }

    fn contains(&self, _: DVec3) -> bool {
        false
    }

    #[inline]
    fn refine_for(&self, o: DVec3, d: DVec3, t_near: f64, t: f64, _: bool) -> ShapePoint {
        let t = self.hit(o, d, t_near, f64::INFINITY).unwrap_or(t);
        let p = (o + t * d).truncate().clamp(-self.half, self.half);
        let q = p / self.half;
        let uv = DVec2::new(0.5 + 0.5 * q.x, 0.5 - 0.5 * q.y);
        ShapePoint { t, p: p.extend(0.0), ng: DVec3::Z, uv, extent: self.half.max_element(), part: 0 }
    }
}
