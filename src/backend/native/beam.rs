//! The rays of a packet as boxes see them: each ray, and bounds of all of them.
//!
//! Source: S. Boulos, I. Wald, P. Shirley, "Geometric and Arithmetic Culling Methods for
//! Entire Ray Packets", Univ. of Utah UUCS-06-010, 2006.

use super::bvh::{Node, WIDTH};
use super::ray::{BoxRay, SLACK};
use super::traverse::Walk;
use crate::geom::LANES;
use core::array;
use glam::Vec4;

/// So many rays are worth being taken together.
pub(super) const ENOUGH: usize = LANES / 2;

/// Registers of four lanes that hold one number of each ray.
const GROUPS: usize = LANES / WIDTH;

pub(super) struct Beam {
    o: [[Vec4; GROUPS]; 3],
    inv_d: [[Vec4; GROUPS]; 3],
    t_near: [Vec4; GROUPS],
    cull: [Vec4; GROUPS],
    /// Per axis, which side of a box all rays meet first.
    near: [usize; 3],
    /// Per axis, the origin from which a box is nearest, and the one from which it is farthest.
    first_o: [Vec4; 3],
    last_o: [Vec4; 3],
    /// Per axis, the least and the largest reciprocal.
    inv_d_range: [[Vec4; 2]; 3],
    first_t: Vec4,
    /// The `t`, as boxes count it, from where on nothing matters to any ray.
    pub(super) last_t: f32,
}

impl Beam {
    /// `None` unless most lanes hold a ray, and all of those meet the same sides of boxes
    /// first, run parallel to none, and count `t` alike.
    pub(super) fn new(walks: &[Option<Walk>]) -> Option<Self> {
        let first = &walks.iter().flatten().next()?.boxes;
        if walks.iter().flatten().count() < ENOUGH || !walks.iter().flatten().all(|w| w.boxes.is_like(first)) {
            return None;
        }
        // A lane without a ray repeats the first one, but ends before it begins.
        let walk = |i: usize| walks.get(i).and_then(Option::as_ref);
        let rays: [&BoxRay; LANES] = array::from_fn(|i| walk(i).map_or(first, |w| &w.boxes));
        let o = array::from_fn(|axis| gather(&rays, |b| b.o[axis]));
        let inv_d = array::from_fn(|axis| gather(&rays, |b| b.inv_d[axis]));
        let t_near = gather(&rays, |b| b.t_near);
        let culls: [f32; LANES] = array::from_fn(|i| walk(i).map_or(f32::NEG_INFINITY, |w| w.cull));
        let cull = gather(&culls, |&cull| cull);
        let near = first.near.map(usize::from);
        let ends = |v: &[Vec4; GROUPS]| [least(v), most(v)].map(Vec4::splat);
        Some(Self {
            first_o: array::from_fn(|axis| ends(&o[axis])[1 - near[axis]]),
            last_o: array::from_fn(|axis| ends(&o[axis])[near[axis]]),
            inv_d_range: array::from_fn(|axis| ends(&inv_d[axis])),
            first_t: Vec4::splat(least(&t_near)),
            last_t: most(&cull),
            o,
            inv_d,
            t_near,
            cull,
            near,
        })
    }

    /// Says from where on nothing matters to the ray of `lane`.
    #[inline]
    pub(super) fn shorten(&mut self, lane: usize, cull: f32) {
        self.cull[lane / WIDTH][lane % WIDTH] = cull;
    }

    /// To be called after rays were shortened.
    #[inline]
    pub(super) fn shortened(&mut self) {
        self.last_t = most(&self.cull);
    }

    /// Bits of the children of `node` that any ray may enter, and where the first of them may.
    ///
    /// Differences and products round the same way for the bounds as for each ray, and
    /// rounding keeps order: no ray enters where this says that none does.
    #[inline]
    pub(super) fn enter_any(&self, node: &Node) -> (u32, [f32; WIDTH]) {
        let enter = |axis: usize| {
            let way = node.bounds[axis][self.near[axis] & 1] - self.first_o[axis];
            let [least, most] = self.inv_d_range[axis];
            (way * least).min(way * most)
        };
        let leave = |axis: usize| {
            let way = node.bounds[axis][!self.near[axis] & 1] - self.last_o[axis];
            let [least, most] = self.inv_d_range[axis];
            (way * least).max(way * most)
        };
        let enter = enter(0).max(enter(1)).max(enter(2).max(self.first_t));
        let leave = leave(0).min(leave(1)).min(leave(2)) * SLACK;
        (enter.cmple(leave.min(Vec4::splat(self.last_t))).bitmask(), enter.to_array())
    }

    /// Bits of the rays that enter the box of one child.
    #[inline]
    pub(super) fn enter(&self, node: &Node, lane: usize) -> u32 {
        let side = |axis: usize, side: usize| Vec4::splat(node.bounds[axis][side & 1][lane]);
        let near: [Vec4; 3] = array::from_fn(|axis| side(axis, self.near[axis]));
        let far: [Vec4; 3] = array::from_fn(|axis| side(axis, !self.near[axis]));
        let mut lanes = 0;
        for g in 0..GROUPS {
            let at = |axis: usize, side: Vec4| (side - self.o[axis][g]) * self.inv_d[axis][g];
            let enter = at(0, near[0]).max(at(1, near[1])).max(at(2, near[2]).max(self.t_near[g]));
            let leave = at(0, far[0]).min(at(1, far[1])).min(at(2, far[2])) * SLACK;
            lanes |= enter.cmple(leave.min(self.cull[g])).bitmask() << (g * WIDTH);
        }
        lanes
    }
}

/// One number of each ray.
#[inline(always)]
fn gather<T>(of: &[T; LANES], f: impl Fn(&T) -> f32) -> [Vec4; GROUPS] {
    array::from_fn(|g| Vec4::from_array(array::from_fn(|i| f(&of[g * WIDTH + i]))))
}

fn least(v: &[Vec4; GROUPS]) -> f32 {
    v.iter().copied().fold(Vec4::INFINITY, Vec4::min).min_element()
}

fn most(v: &[Vec4; GROUPS]) -> f32 {
    v.iter().copied().fold(Vec4::NEG_INFINITY, Vec4::max).max_element()
}
