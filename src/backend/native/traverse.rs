//! The way of one ray through the hierarchy.

use super::bvh::{Bvh, Child, MAX_DEPTH, WIDTH};
use super::ray::{BoxRay, TriangleRay, prepare};
use crate::geom::Ray;
use crate::geom::triangle::{self, TriangleHit};
use glam::{DVec3, Vec3};

/// Children waiting on the way down: all but one of each node.
const STACK: usize = (WIDTH - 1) * MAX_DEPTH;

/// Enough for nearly every tree, and quicker to make.
const SMALL_STACK: usize = 63;

/// The nearest triangle, by its number.
pub(super) struct Found {
    pub(super) t: f32,
    pub(super) u: f32,
    pub(super) v: f32,
    pub(super) ng: Vec3,
    pub(super) id: u32,
}

/// The best hit so far.
struct Best {
    hit: TriangleHit,
    id: u32,
    block: usize,
    lane: usize,
}

impl Bvh {
    /// The nearest hit of `ray`; the lowest number among equal `t`.
    pub(super) fn nearest(&self, ray: &Ray) -> Option<Found> {
        let best = self.trace::<false>(ray)?;
        let triangle = self.blocks[best.block].triangle(best.lane);
        let TriangleHit { t, u, v } = best.hit;
        // A `t` beyond f32 is still a hit, and inside every interval without end.
        let t = (t as f32).min(f32::MAX);
        Some(Found { t, u: u as f32, v: v as f32, ng: normal(triangle), id: best.id })
    }

    /// Whether `ray` meets anything.
    pub(super) fn any(&self, ray: &Ray) -> bool {
        self.trace::<true>(ray).is_some()
    }

    #[inline]
    fn trace<const ANY: bool>(&self, ray: &Ray) -> Option<Best> {
        if self.nodes.is_empty() {
            return None;
        }
        if (WIDTH - 1) * self.depth <= SMALL_STACK {
            self.descend::<ANY, SMALL_STACK>(ray)
        } else {
            self.descend::<ANY, STACK>(ray)
        }
    }

    fn descend<const ANY: bool, const STACK: usize>(&self, ray: &Ray) -> Option<Best> {
        let (boxes, mut triangles) = prepare(ray)?;
        let mut best = None;
        let mut cull = boxes.cull(triangles.exact.t_far);
        let mut stack = [(0.0, Child::NONE); STACK];
        let mut waiting = 0;
        let mut child = Child::node(0);
        loop {
            if child.is_leaf() {
                if self.leaf(child, &mut triangles, &mut best) {
                    if ANY {
                        return best;
                    }
                    cull = boxes.cull(triangles.exact.t_far);
                }
            } else if let Some(next) = self.node(child, &boxes, cull, &mut stack, &mut waiting) {
                child = next;
                continue;
            }
            loop {
                if waiting == 0 {
                    return best;
                }
                waiting -= 1;
                let (enter, next) = stack[waiting];
                if enter <= cull {
                    child = next;
                    break;
                }
            }
        }
    }

    /// Nearest child that the ray enters; the others wait, farthest first.
    #[inline]
    fn node(
        &self,
        child: Child,
        boxes: &BoxRay,
        cull: f32,
        stack: &mut [(f32, Child)],
        waiting: &mut usize,
    ) -> Option<Child> {
        let node = &self.nodes[child.node_index()];
        let (mut lanes, enter) = boxes.enter(node, cull);
        if lanes == 0 {
            return None;
        }
        let mut take = || {
            let lane = lanes.trailing_zeros() as usize % WIDTH;
            lanes &= lanes - 1;
            ((enter[lane], node.child[lane]), lanes != 0)
        };
        let (mut nearest, mut more) = take();
        let bottom = *waiting;
        while more {
            let mut next;
            (next, more) = take();
            if next.0 < nearest.0 {
                core::mem::swap(&mut next, &mut nearest);
            }
            let mut at = *waiting;
            while at > bottom && stack[at - 1].0 < next.0 {
                stack[at] = stack[at - 1];
                at -= 1;
            }
            stack[at] = next;
            *waiting += 1;
        }
        Some(nearest.1)
    }

    /// Tests the triangles of a leaf; whether one of them is the best now.
    #[inline]
    fn leaf(&self, leaf: Child, ray: &mut TriangleRay, best: &mut Option<Best>) -> bool {
        let index = leaf.block_index();
        let block = &self.blocks[index];
        let mut lanes = ray.candidates(block) & leaf.lanes();
        let mut better = false;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % WIDTH;
            lanes &= lanes - 1;
            let Some(hit) = triangle::intersect(&ray.exact, block.triangle(lane)) else {
                continue;
            };
            let id = block.id[lane];
            if best.as_ref().is_none_or(|b| hit.t < b.hit.t || id < b.id) {
                // Just past it, so that an equal `t` with a lower number still passes.
                ray.exact.t_far = hit.t.next_up();
                *best = Some(Best { hit, id, block: index, lane });
                better = true;
            }
        }
        better
    }
}

/// Geometric normal as wound: in units of the coordinates squared unless that is too
/// small for f32, then of length about 1.
fn normal(triangle: [Vec3; 3]) -> Vec3 {
    let [a, b, c] = triangle.map(Vec3::as_dvec3);
    let ng: DVec3 = (b - a).cross(c - a);
    let largest = ng.abs().max_element();
    if largest < 1e-30 { (ng / largest).as_vec3() } else { ng.as_vec3() }
}
