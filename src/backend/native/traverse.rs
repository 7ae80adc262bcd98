//! The way of one ray through the hierarchy.

use super::bvh::{Bvh, Child, MAX_DEPTH, WIDTH};
use super::ray::{BoxRay, BoxRay4, TriangleRay, prepare};
use crate::geom::Ray;
use crate::geom::triangle::{self, TriangleHit};
use glam::Vec3;

/// A child that is still to be visited, and where the ray enters it.
pub(super) type Waiting = (f32, Child);

/// Most children that wait at once in any tree: all but one of each node on the way.
const STACK: usize = (WIDTH - 1) * MAX_DEPTH;

/// Enough for nearly every tree, and quicker to make.
pub(super) const SMALL_STACK: usize = 63;

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

/// A ray on its way.
pub(super) struct Walk {
    pub(super) boxes: BoxRay,
    triangles: TriangleRay,
    best: Option<Best>,
    /// The `t`, as boxes count it, from where on nothing matters.
    pub(super) cull: f32,
}

impl Bvh {
    /// The nearest hit of `ray`; the lowest number among equal `t`.
    pub(super) fn nearest(&self, ray: &Ray) -> Option<Found> {
        let mut walk = Walk::new(ray)?;
        self.walk::<false>(&mut walk);
        walk.found(self)
    }

    /// Whether `ray` meets anything.
    pub(super) fn any(&self, ray: &Ray) -> bool {
        Walk::new(ray).is_some_and(|mut walk| self.walk::<true>(&mut walk))
    }

    #[inline]
    fn walk<const ANY: bool>(&self, walk: &mut Walk) -> bool {
        match self.stack_len() {
            0 => false,
            1..=SMALL_STACK => walk.descend::<ANY>(self, Child::ROOT, &mut [(0.0, Child::NONE); SMALL_STACK]),
            _ => walk.descend::<ANY>(self, Child::ROOT, &mut [(0.0, Child::NONE); STACK]),
        }
    }

    /// Most children that wait at once in this tree.
    pub(super) fn stack_len(&self) -> usize {
        (WIDTH - 1) * self.depth
    }
}

impl Walk {
    /// `None` for a ray that meets nothing whatever there is.
    #[inline]
    pub(super) fn new(ray: &Ray) -> Option<Self> {
        let (boxes, triangles) = prepare(ray)?;
        let cull = boxes.cull(triangles.exact.t_far);
        Some(Self { boxes, triangles, best: None, cull })
    }

    /// Visits all below `from`; whether the ray met anything there. With `ANY` it stops at
    /// the first hit.
    #[inline]
    pub(super) fn descend<const ANY: bool>(&mut self, bvh: &Bvh, from: Child, stack: &mut [Waiting]) -> bool {
        if from.is_leaf() {
            return self.leaf(bvh, from);
        }
        let boxes = self.boxes.splat();
        let mut met = false;
        let mut waiting = 0;
        let mut child = from;
        loop {
            if child.is_leaf() {
                met |= self.leaf(bvh, child);
                if ANY && met {
                    return true;
                }
            } else if let Some(next) = nearest_child(bvh, child, &boxes, self.cull, stack, &mut waiting) {
                child = next;
                continue;
            }
            loop {
                if waiting == 0 {
                    return met;
                }
                waiting -= 1;
                let (enter, next) = stack[waiting];
                if enter <= self.cull {
                    child = next;
                    break;
                }
            }
        }
    }

    /// Tests the triangles of a leaf; whether one of them is the best now.
    #[inline]
    fn leaf(&mut self, bvh: &Bvh, leaf: Child) -> bool {
        let index = leaf.block_index();
        let block = &bvh.blocks[index];
        let mut lanes = self.triangles.candidates(block) & leaf.lanes();
        let exact = &mut self.triangles.exact;
        let mut better = false;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % WIDTH;
            lanes &= lanes - 1;
            let Some(hit) = triangle::intersect_permuted(exact, block.permuted(lane, exact.axes())) else {
                continue;
            };
            let id = block.id[lane];
            if self.best.as_ref().is_none_or(|b| hit.t < b.hit.t || id < b.id) {
                // Just past it, so that an equal `t` with a lower number still passes.
                exact.t_far = hit.t.next_up();
                self.best = Some(Best { hit, id, block: index, lane });
                better = true;
            }
        }
        if better {
            self.cull = self.boxes.cull(self.triangles.exact.t_far);
        }
        better
    }

    /// Whether there is a hit.
    pub(super) fn has_met(&self) -> bool {
        self.best.is_some()
    }

    /// The best hit.
    pub(super) fn found(&self, bvh: &Bvh) -> Option<Found> {
        let best = self.best.as_ref()?;
        let triangle = bvh.blocks[best.block].triangle(best.lane);
        let TriangleHit { t, u, v } = best.hit;
        // A `t` beyond f32 is still a hit, and inside every interval without end.
        let t = (t as f32).min(f32::MAX);
        Some(Found { t, u: u as f32, v: v as f32, ng: normal(triangle), id: best.id })
    }
}

/// Nearest child that the ray enters; the others wait, farthest first.
#[inline]
fn nearest_child(
    bvh: &Bvh,
    node: Child,
    boxes: &BoxRay4,
    cull: f32,
    stack: &mut [Waiting],
    waiting: &mut usize,
) -> Option<Child> {
    let node = &bvh.nodes[node.node_index()];
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

/// Geometric normal as wound: in units of the coordinates squared, unless that is too
/// small for f32; then of length about 1.
fn normal(triangle: [Vec3; 3]) -> Vec3 {
    let [a, b, c] = triangle.map(Vec3::as_dvec3);
    let ng = (b - a).cross(c - a);
    let largest = ng.abs().max_element();
    if largest < 1e-30 { (ng / largest).as_vec3() } else { ng.as_vec3() }
}
