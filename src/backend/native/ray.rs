//! A ray prepared once for boxes and triangles, four at a time.
//!
//! In the scene a ray is f32 and exact. In the space of a placed mesh it is f64: boxes and the
//! filter see it rounded, which their bounds account for, the f64 test sees it as it is.

use super::bvh::{Block, Node};
use super::traverse::Space;
use crate::geom::Ray;
use crate::geom::triangle::ShearedRay;
use glam::{DVec3, Vec3, Vec4};

/// What box tests may be off by, as a factor: a difference, a reciprocal and a product are
/// three roundings of 2^-24 at each end of the interval, 2^-20 is above both together.
///
/// In the space of a placed mesh the direction is rounded as well, and the origin o. Unless
/// |o| > 2 |side|, half an ulp of o is at most one of the side, by which boxes are wider than they
/// need be; else it is at most 2^-23 of the difference, and both ends together still stay below.
///
/// Source: T. Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013.
pub(super) const SLACK: f32 = 1.0 + 1.0 / (1 << 20) as f32;

/// A ray as boxes see it, in little memory.
///
/// Its `t` counts in units of a power of two times the direction's length, so that no
/// direction is too long or too short for f32.
pub(super) struct BoxRay {
    pub(super) o: [f32; 3],
    pub(super) inv_d: [f32; 3],
    /// Per axis, which side of a box the ray meets first.
    pub(super) near: [u8; 3],
    pub(super) t_near: f32,
    /// The `t` of boxes is `unit` times the ray's own.
    unit: f64,
}

/// A [`BoxRay`] for four boxes at once.
pub(super) struct BoxRay4 {
    o: [Vec4; 3],
    inv_d: [Vec4; 3],
    near: [usize; 3],
    t_near: Vec4,
}

/// A ray in f64, as it is decided about.
#[derive(Clone, Copy)]
pub(super) struct Line {
    pub(super) o: DVec3,
    pub(super) d: DVec3,
    /// Start of the open interval, which holds the `t` whose f32 lies in the ray's.
    pub(super) t_near: f64,
    /// End of it; shrinks as hits are found.
    pub(super) t_far: f64,
}

/// A ray as triangles see it.
pub(super) struct TriangleRay {
    /// For the test in f64.
    pub(super) exact: ShearedRay,
    /// Origin in the order of the sheared axes.
    o: [f32; 3],
    shear: [f32; 2],
    /// What the rounding of an origin moves sheared coordinates by, at most.
    off: f32,
}

/// Prepares `ray`; `None` where it meets nothing because it has no direction, is not finite
/// or ends before it begins.
#[inline(always)]
pub(super) fn prepare(ray: &Ray) -> Option<(BoxRay, Line)> {
    let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
    let unit = unit(o, d).filter(|_| ray.t_near < ray.t_far)?;
    let (t_near, t_far) = interval(ray);
    let boxes = BoxRay::new(ray.o, (d * (1.0 / unit)).as_vec3(), t_near, unit);
    Some((boxes, Line { o, d, t_near, t_far }))
}

/// The same for a ray in the space of a placed mesh; `None` as well for one that starts beyond f32,
/// where the mesh is a speck.
#[inline(always)]
pub(super) fn prepare_placed(line: &Line) -> Option<(BoxRay, Line)> {
    let Line { o, d, t_near, .. } = *line;
    let unit = unit(o, d)?;
    // What is shorter cannot move a hit, and its reciprocal would not fit.
    let scaled = d * (1.0 / unit);
    let scaled = DVec3::select(scaled.abs().cmplt(DVec3::splat(f32::MIN_POSITIVE.into())), DVec3::ZERO, scaled);
    let near = o.as_vec3();
    if !near.is_finite() {
        return None;
    }
    Some((BoxRay::new(near, scaled.as_vec3(), t_near, unit), Line { d: scaled * unit, ..*line }))
}

/// The power of two at or below the largest component of `d`: scaling by it is exact. `None`
/// where the ray is not finite or has no direction.
fn unit(o: DVec3, d: DVec3) -> Option<f64> {
    let longest = d.abs().max_element();
    let usable = o.is_finite() && d.is_finite() && longest >= f64::MIN_POSITIVE;
    usable.then(|| f64::from_bits(longest.to_bits() & (0x7ff << 52)))
}

/// All `t` that lie between `t_near` and `t_far` once they are rounded to f32.
///
/// A hit is so inside the open interval as the caller sees it, and a ray that goes on
/// from the `t` of a hit does not meet it again.
fn interval(ray: &Ray) -> (f64, f64) {
    let middle = |a: f32, b: f32| 0.5 * f64::from(a) + 0.5 * f64::from(b);
    (middle(ray.t_near, ray.t_near.next_up()), middle(ray.t_far.next_down(), ray.t_far))
}

impl BoxRay {
    /// `d` is the ray's direction divided by `unit`.
    fn new(o: Vec3, d: Vec3, t_near: f64, unit: f64) -> Self {
        // Infinite where the ray is parallel to the sides. A box side through the origin
        // then gives NaN, and lanes with NaN may turn out either way: boxes are wider than
        // what is in them, so an origin on a side is outside of that.
        let inv_d = d.recip().to_array();
        let near = inv_d.map(|i| u8::from(i.is_sign_negative()));
        Self { o: o.to_array(), inv_d, near, t_near: ((t_near * unit) as f32).next_down(), unit }
    }

    /// Whether both meet the same sides of boxes first, run parallel to none, and count `t`
    /// alike.
    pub(super) fn is_like(&self, o: &Self) -> bool {
        // So large a reciprocal overflows when multiplied, but not to NaN: only infinity does.
        self.near == o.near && self.unit == o.unit && self.inv_d.iter().all(|i| i.is_finite())
    }

    /// The `t` from where on no box matters once there is a hit at `t`.
    #[inline]
    pub(super) fn cull(&self, t: f64) -> f32 {
        (t * self.unit) as f32 * SLACK + f32::MIN_POSITIVE
    }

    /// The same four times side by side.
    #[inline]
    pub(super) fn splat(&self) -> BoxRay4 {
        BoxRay4 {
            o: self.o.map(Vec4::splat),
            inv_d: self.inv_d.map(Vec4::splat),
            near: self.near.map(usize::from),
            t_near: Vec4::splat(self.t_near),
        }
    }
}

impl BoxRay4 {
    /// Bits of the children whose boxes the ray meets up to `cull`, and where it enters them.
    #[inline]
    pub(super) fn enter(&self, node: &Node, cull: f32) -> (u32, [f32; 4]) {
        let side = |axis: usize, side: usize| (node.bounds[axis][side & 1] - self.o[axis]) * self.inv_d[axis];
        let [x, y, z] = self.near;
        let enter = side(0, x).max(side(1, y)).max(side(2, z).max(self.t_near));
        let leave = side(0, 1 - x).min(side(1, 1 - y)).min(side(2, 1 - z)) * SLACK;
        let hit = enter.cmple(leave.min(Vec4::splat(cull)));
        (hit.bitmask(), enter.to_array())
    }
}

impl TriangleRay {
    pub(super) fn new(line: &Line) -> Self {
        let exact = ShearedRay::new(line.o, line.d, line.t_near, line.t_far);
        let o = line.o.as_vec3();
        // Half an ulp of x or y and as much of z, sheared; twice that, as for the other bounds.
        let off = o.abs().max_element() * (2.0 * f32::EPSILON);
        Self { exact, o: exact.axes().map(|axis| o[axis]), shear: exact.shear().map(|s| s as f32), off }
    }

    /// Bits of the lanes of `block` that the ray's line may meet: all that the f64 test
    /// would not turn away for its edge functions, and some more.
    ///
    /// The same edge functions in f32, with a bound of their error. With e = 2^-24, s the
    /// largest sheared coordinate and z the largest distance along the ray's main axis:
    /// a sheared coordinate is off by less than d = 8e (s + z) (one rounding of a
    /// difference not above s + z, three of a product not above z, one of the result), an
    /// edge function by less than 4 d s + 2 d^2 + 4e s^2 <= 5 d (s + d), to which the
    /// smallest normal float is added for products that vanish. Where a bound overflows
    /// nothing is turned away. An origin that was rounded adds to d.
    #[inline]
    pub(super) fn candidates<S: Space>(&self, block: &Block) -> u32 {
        let [x, y, z] = self.exact.axes();
        let project = |corner: &[Vec4; 3]| {
            let along = corner[z] - self.o[2];
            let a = corner[x] - self.o[0] - self.shear[0] * along;
            let b = corner[y] - self.o[1] - self.shear[1] * along;
            (a, b, along.abs(), a.abs().max(b.abs()))
        };
        let (ax, ay, az, a) = project(&block.corners[0]);
        let (bx, by, bz, b) = project(&block.corners[1]);
        let (cx, cy, cz, c) = project(&block.corners[2]);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let s = a.max(b).max(c);
        let d = (s + az.max(bz).max(cz)) * (8.0 / (1 << 24) as f32);
        let d = if S::PLACED { d + self.off } else { d };
        let bound = d * (s + d) * 6.0 + f32::MIN_POSITIVE;
        let least = u.min(v).min(w);
        let most = u.max(v).max(w);
        !((least.cmplt(-bound)) & (most.cmpgt(bound))).bitmask() & 0b1111
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::native::world::World;
    use crate::geom::triangle;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vec3> {
        [-1f32..1.0, -1f32..1.0, -1f32..1.0].prop_map(Vec3::from)
    }

    proptest! {
        /// Rays at edges, up to 1e-9 of the distance beside them, from near and far.
        #[test]
        fn the_filter_keeps_what_f64_lets_hit(
            t in [point(), point(), point()], o in point(), far in -2i32..8, scale in -18i32..=17,
            s in 0f32..=1.0, beside in point(), off in -9i32..0
        ) {
            let unit = 10f32.powi(scale);
            let o = o * 10f32.powi(far);
            let target = t[0].lerp(t[1], s) + beside * 10f32.powi(off);
            let ray = Ray::new(o * unit, target - o);
            prop_assume!(ray.d != Vec3::ZERO);
            let (_, line) = prepare(&ray).expect("finite");
            let triangles = TriangleRay::new(&line);
            let mut block = Block::EMPTY;
            let corners = t.map(|p| p * unit);
            block.set(2, corners, 7);
            if triangle::intersect(&triangles.exact, corners).is_some() {
                prop_assert!(triangles.candidates::<World>(&block) & 0b100 != 0);
            }
        }
    }

    #[test]
    fn the_filter_turns_away_what_is_clearly_missed() {
        let mut block = Block::EMPTY;
        for lane in 0..4 {
            let p = Vec3::new(lane as f32, 0.0, 5.0);
            block.set(lane, [p, p + 0.9 * Vec3::X, p + 0.9 * Vec3::Y], lane as u32);
        }
        for lane in 0..4 {
            let ray = Ray::new(Vec3::new(lane as f32 + 0.3, 0.3, 0.0), Vec3::Z);
            let (_, line) = prepare(&ray).expect("finite");
            let triangles = TriangleRay::new(&line);
            assert_eq!(triangles.candidates::<World>(&block), 1 << lane);
        }
    }

    #[test]
    fn the_interval_is_that_of_rounded_t() {
        for (t_near, t_far) in [(0.0, f32::INFINITY), (1.0, 2.0), (0.1, 1e30), (1e-40, 1e-39)] {
            let (near, far) = interval(&Ray { t_near, t_far, ..Ray::new(Vec3::ZERO, Vec3::X) });
            assert!(near.next_up() as f32 > t_near && near.next_down() as f32 <= t_near);
            assert!((far.next_down() as f32) < t_far || t_far.is_infinite());
            assert!(far.next_up() as f32 >= t_far);
        }
    }
}
