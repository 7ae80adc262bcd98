//! The triangle as a shape: one whose corners are f64.

use super::shape::some_lane;
use super::triangle::{self, ShearedRay, TriangleHit};
use super::{Bounds, Lanes, Shape, ShapePoint};
use glam::{DAffine3, DVec2, DVec3};

/// The triangle between three points, met from both sides. One without area is never met.
///
/// Hit or miss by the watertight test of [`triangle::intersect`]. Its normal is `(b - a) x (c - a)`, its texture
/// coordinates are the weights of `b` and `c`. One part, number 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactTriangle {
    corners: [DVec3; 3],
}

impl ExactTriangle {
    /// The triangle from `a` over `b` to `c`, which must be finite.
    #[must_use]
    pub fn new([a, b, c]: [DVec3; 3]) -> Self {
        Self { corners: [a, b, c] }
    }

    /// The corners in their order.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 3] {
        self.corners
    }

    /// The triangle between the points that `to_world` makes of the corners.
    #[must_use]
    pub fn under(&self, to_world: &DAffine3) -> Self {
        Self { corners: self.corners.map(|p| to_world.transform_point3(p)) }
    }

    fn meet(&self, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> Option<TriangleHit> {
        // The test knows no empty triangle: along its line edge functions are rounding.
        let [a, b, c] = self.corners;
        if (b - a).cross(c - a) == DVec3::ZERO {
            return None;
        }
        triangle::intersect_exact(&ShearedRay::new(o, d, t_near, t_far), self.corners)
    }
}

impl Shape for ExactTriangle {
    fn bounds(&self, to_world: &DAffine3) -> Bounds {
        self.under(to_world).corners.into_iter().collect()
    }

    fn hit(&self, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> Option<f64> {
        self.meet(o, d, t_near, t_far).map(|hit| hit.t)
    }

    #[inline(always)]
    fn hit_lanes<T: Copy + Into<f64>, const N: usize>(&self, rays: &Lanes<'_, T, N>) -> Option<[f64; N]> {
        let mut t = [0.0; N];
        for (i, t) in t.iter_mut().enumerate() {
            *t = self.hit(rays.o(i), rays.d(i), rays.t_near(i), rays.t_far(i)).unwrap_or(f64::INFINITY);
        }
        some_lane(t)
    }

    fn contains(&self, _: DVec3) -> bool {
        false
    }

    fn refine_for(&self, o: DVec3, d: DVec3, t_near: f64, t: f64, _: bool) -> ShapePoint {
        let [a, b, c] = self.corners;
        let (e1, e2) = (b - a, c - a);
        let hit = self.meet(o, d, t_near, f64::INFINITY).unwrap_or_else(|| {
            let near = triangle::refine_exact(o, d, self.corners, (0.0, 0.0));
            TriangleHit { t, u: near.u, v: near.v }
        });
        let extent = 0.5 * self.bounds(&DAffine3::IDENTITY).size().max_element();
        ShapePoint {
            t: hit.t,
            p: a + hit.u * e1 + hit.v * e2,
            ng: e1.cross(e2).normalize_or(DVec3::Z),
            uv: DVec2::new(hit.u, hit.v),
            extent,
            part: 0,
        }
    }
}
