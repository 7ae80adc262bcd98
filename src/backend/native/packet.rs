//! Sixteen rays that go the same way, taken through the hierarchy together.
//!
//! A node is tested once for all rays with interval arithmetic, what passes is then tested
//! with each ray, and a subtree that only a few rays enter is left to them one by one. So
//! a packet that turns out to diverge costs little more than its rays would alone.
//!
//! Source: S. Boulos, I. Wald, P. Shirley, "Geometric and Arithmetic Culling Methods for
//! Entire Ray Packets", Univ. of Utah UUCS-06-010, 2006.

use super::bvh::{Bvh, Child, Node, WIDTH};
use super::ray::{BoxRay, SLACK};
use super::traverse::{Found, Waiting, Walk};
use crate::geom::{Coherence, LANES, RayPacket};
use core::array;
use glam::Vec4;

/// So few rays go on alone.
const FEW: u32 = 2;

/// So many rays are worth being taken together.
const ENOUGH: usize = LANES / 2;

/// Registers of four lanes that hold one number of each ray.
const GROUPS: usize = LANES / WIDTH;

/// A child of a node that waits to be visited: where the first ray may enter it, the node
/// and the lane.
#[derive(Clone, Copy, Debug)]
struct WaitingLane {
    enter: f32,
    node: u32,
    lane: u8,
}

/// Rays of one packet on their way, with the memory they need; kept from packet to packet.
pub(super) struct Packets<'a> {
    bvh: &'a Bvh,
    walks: Vec<Option<Walk>>,
    single: Vec<Waiting>,
    together: Vec<WaitingLane>,
}

impl<'a> Packets<'a> {
    pub(super) fn new(bvh: &'a Bvh) -> Self {
        let single = vec![(0.0, Child::NONE); bvh.stack_len()];
        Self { bvh, walks: Vec::with_capacity(LANES), single, together: Vec::with_capacity(bvh.stack_len()) }
    }

    /// Traces the first `live` rays of a packet; with `ANY` each up to its first hit.
    pub(super) fn trace<const ANY: bool>(&mut self, rays: &RayPacket, live: usize, coherence: Coherence) {
        self.walks.clear();
        self.walks.extend((0..live).map(|lane| Walk::new(&rays.get(lane))));
        if self.bvh.nodes.is_empty() {
            return;
        }
        let beam = if coherence == Coherence::Coherent { Beam::new(&self.walks) } else { None };
        if let Some(beam) = beam {
            self.together::<ANY>(beam);
        } else {
            for walk in self.walks.iter_mut().flatten() {
                walk.descend::<ANY>(self.bvh, Child::ROOT, &mut self.single);
            }
        }
    }

    /// What the ray of `lane` met.
    pub(super) fn found(&self, lane: usize) -> Option<Found> {
        self.walks[lane].as_ref()?.found(self.bvh)
    }

    /// Whether the ray of `lane` met anything.
    pub(super) fn any(&self, lane: usize) -> bool {
        self.walks[lane].as_ref().is_some_and(Walk::has_met)
    }

    fn together<const ANY: bool>(&mut self, mut beam: Beam) {
        self.together.clear();
        self.enter(&beam, Child::ROOT);
        while let Some(WaitingLane { enter, node, lane }) = self.together.pop() {
            if enter > beam.last_t {
                continue;
            }
            let (node, lane) = (&self.bvh.nodes[node as usize], usize::from(lane));
            let mut lanes = beam.enter(node, lane);
            let child = node.child[lane];
            if !child.is_leaf() && lanes.count_ones() > FEW {
                self.enter(&beam, child);
                continue;
            }
            let mut met = false;
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize % LANES;
                lanes &= lanes - 1;
                let Some(walk) = &mut self.walks[lane] else { continue };
                if walk.descend::<ANY>(self.bvh, child, &mut self.single) {
                    met = true;
                    beam.cull[lane / WIDTH][lane % WIDTH] = if ANY { f32::NEG_INFINITY } else { walk.cull };
                }
            }
            if met {
                beam.last_t = most(&beam.cull);
            }
        }
    }

    /// Lets the children of a node wait that any ray may enter, farthest first.
    fn enter(&mut self, beam: &Beam, node: Child) {
        let index = node.node_index();
        let (mut lanes, enter) = beam.enter_any(&self.bvh.nodes[index]);
        let bottom = self.together.len();
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % WIDTH;
            lanes &= lanes - 1;
            let next = WaitingLane { enter: enter[lane], node: index as u32, lane: lane as u8 };
            let mut at = self.together.len();
            while at > bottom && self.together[at - 1].enter < next.enter {
                at -= 1;
            }
            self.together.insert(at, next);
        }
    }
}

/// The rays of a packet, as boxes see them: each ray, and bounds of all of them.
struct Beam {
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
    last_t: f32,
}

impl Beam {
    /// `None` unless most lanes hold a ray, and all of those meet the same sides of boxes
    /// first, run parallel to none, and count `t` alike.
    fn new(walks: &[Option<Walk>]) -> Option<Self> {
        let first = &walks.iter().flatten().next()?.boxes;
        if walks.iter().flatten().count() < ENOUGH || !walks.iter().flatten().all(|w| w.boxes.is_like(first)) {
            return None;
        }
        // A lane without a ray repeats the first one, but ends before it begins.
        let walk = |i: usize| walks.get(i).and_then(Option::as_ref);
        let lane = |i: usize| walk(i).map_or(first, |w| &w.boxes);
        let gather = |f: &dyn Fn(&BoxRay) -> f32| -> [Vec4; GROUPS] {
            array::from_fn(|g| Vec4::from_array(array::from_fn(|i| f(lane(g * WIDTH + i)))))
        };
        let o = array::from_fn(|axis| gather(&|b| b.o[axis]));
        let inv_d = array::from_fn(|axis| gather(&|b| b.inv_d[axis]));
        let t_near = gather(&|b| b.t_near);
        let culls = |i: usize| walk(i).map_or(f32::NEG_INFINITY, |w| w.cull);
        let cull = array::from_fn(|g| Vec4::from_array(array::from_fn(|i| culls(g * WIDTH + i))));
        let near = first.near.map(usize::from);
        let ends = |axis: usize| [least(&o[axis]), most(&o[axis])].map(Vec4::splat);
        Some(Self {
            first_o: array::from_fn(|axis| ends(axis)[1 - near[axis]]),
            last_o: array::from_fn(|axis| ends(axis)[near[axis]]),
            inv_d_range: array::from_fn(|axis| [least(&inv_d[axis]), most(&inv_d[axis])].map(Vec4::splat)),
            first_t: Vec4::splat(least(&t_near)),
            last_t: most(&cull),
            o,
            inv_d,
            t_near,
            cull,
            near,
        })
    }

    /// Bits of the children of `node` that any ray may enter, and where the first of them may.
    ///
    /// Differences and products round the same way for the bounds as for each ray, and
    /// rounding keeps order: no ray enters where this says that none does.
    #[inline]
    fn enter_any(&self, node: &Node) -> (u32, [f32; WIDTH]) {
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
    fn enter(&self, node: &Node, lane: usize) -> u32 {
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

fn least(v: &[Vec4; GROUPS]) -> f32 {
    v.iter().copied().fold(Vec4::INFINITY, Vec4::min).min_element()
}

fn most(v: &[Vec4; GROUPS]) -> f32 {
    v.iter().copied().fold(Vec4::NEG_INFINITY, Vec4::max).max_element()
}
