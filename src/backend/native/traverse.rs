//! The way of one ray through a hierarchy.

use super::bvh::{Block, Bvh, Child, MAX_DEPTH, WIDTH};
use super::ray::{BoxRay, BoxRay4, Line, TriangleRay, prepare, prepare_placed};
use crate::geom::Ray;
use crate::geom::triangle::{self, TriangleHit};
use glam::{DVec3, Vec3};

/// A child that is still to be visited, and where the ray enters it.
pub(super) type Waiting = (f32, Child);

/// Most children that wait at once in any tree: all but one of each node on the way.
pub(super) const STACK: usize = (WIDTH - 1) * MAX_DEPTH;

/// Enough for nearly every tree, and quicker to make.
pub(super) const SMALL_STACK: usize = 63;

/// Where rays are traced: in the scene, or in the space of a placed mesh.
pub(super) trait Space {
    /// Whether rays come from another space, so that their origins are rounded to f32.
    const PLACED: bool;

    fn bvh(&self) -> &Bvh;

    /// Tests `apart[index]` of the hierarchy; whether it is the best hit now. `stack` is free
    /// to use.
    fn apart<const ANY: bool>(&self, walk: &mut Walk, index: usize, stack: &mut [Waiting]) -> bool;
}

/// The best hit so far.
#[derive(Clone, Copy)]
pub(super) struct Best {
    pub(super) hit: TriangleHit,
    /// Number of what was hit. Of a triangle in a placed mesh it is the mesh's.
    pub(super) id: u32,
    /// The triangle, if it is one.
    pub(super) at: Slot,
}

/// Where a triangle is: block and lane.
#[derive(Clone, Copy)]
pub(super) struct Slot(u32, u32);

impl Slot {
    /// Of what is no triangle.
    pub(super) const NONE: Self = Self(u32::MAX, 0);

    /// Number of the triangle.
    pub(super) fn id(self, bvh: &Bvh) -> u32 {
        bvh.blocks[self.0 as usize].id[self.1 as usize]
    }

    /// Normal of the triangle as wound, in units of the coordinates squared.
    #[inline]
    pub(super) fn normal(self, bvh: &Bvh) -> DVec3 {
        let [a, b, c] = bvh.blocks[self.0 as usize].triangle(self.1 as usize).map(Vec3::as_dvec3);
        (b - a).cross(c - a)
    }
}

/// A ray on its way.
pub(super) struct Walk {
    pub(super) boxes: BoxRay,
    pub(super) line: Line,
    /// Made for the first triangles that the ray comes by.
    triangles: Option<TriangleRay>,
    best: Option<Best>,
    /// The `t`, as boxes count it, from where on nothing matters.
    pub(super) cull: f32,
}

impl Walk {
    /// `None` for a ray that meets nothing whatever there is.
    #[inline(always)]
    pub(super) fn new(ray: &Ray) -> Option<Self> {
        prepare(ray).map(Self::prepared)
    }

    /// The same for a ray in the space of a placed mesh.
    #[inline(always)]
    pub(super) fn placed(line: &Line) -> Option<Self> {
        prepare_placed(line).map(Self::prepared)
    }

    #[inline(always)]
    fn prepared((boxes, line): (BoxRay, Line)) -> Self {
        let cull = boxes.cull(line.t_far);
        Self { boxes, line, triangles: None, best: None, cull }
    }

    /// The best hit.
    #[inline]
    pub(super) fn best(&self) -> Option<&Best> {
        self.best.as_ref()
    }

    /// Takes a hit inside the interval if it is better; whether it was.
    #[inline]
    pub(super) fn offer(&mut self, hit: Best) -> bool {
        let better = self.best.is_none_or(|b| hit.hit.t < b.hit.t || hit.id < b.id);
        if better {
            // Just past it, so that an equal `t` with a lower number still passes.
            self.line.t_far = hit.hit.t.next_up();
            self.cull = self.boxes.cull(self.line.t_far);
            self.best = Some(hit);
        }
        better
    }

    /// Visits all below `from`; whether the ray met anything there. With `ANY` it stops at
    /// the first hit.
    #[inline]
    pub(super) fn descend<const ANY: bool, S: Space>(&mut self, space: &S, from: Child, stack: &mut [Waiting]) -> bool {
        if from.is_leaf() {
            return self.leaf::<ANY, S>(space, from, stack);
        }
        let boxes = self.boxes.splat();
        let mut met = false;
        let mut waiting = 0;
        let mut child = from;
        loop {
            if child.is_leaf() {
                met |= self.leaf::<ANY, S>(space, child, &mut stack[waiting..]);
                if ANY && met {
                    return true;
                }
            } else if let Some(next) = nearest_child(space, child, &boxes, self.cull, stack, &mut waiting) {
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

    /// Tests what is in a leaf; whether something there is the best now.
    #[inline]
    fn leaf<const ANY: bool, S: Space>(&mut self, space: &S, leaf: Child, stack: &mut [Waiting]) -> bool {
        let (index, blocks) = (leaf.leaf_index(), &space.bvh().blocks);
        match blocks.get(index) {
            Some(block) => self.block::<S>(block, index, leaf.lanes()),
            None => space.apart::<ANY>(self, index - blocks.len(), stack),
        }
    }

    #[inline(always)]
    fn block<S: Space>(&mut self, block: &Block, index: usize, lanes: u32) -> bool {
        let mut lanes = self.triangle_ray().candidates::<S>(block) & lanes;
        let mut better = false;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % WIDTH;
            lanes &= lanes - 1;
            let t_far = self.line.t_far;
            let exact = &mut self.triangle_ray().exact;
            exact.t_far = t_far;
            if let Some(hit) = triangle::intersect_permuted(exact, block.permuted(lane, exact.axes())) {
                better |= self.offer(Best { hit, id: block.id[lane], at: Slot(index as u32, lane as u32) });
            }
        }
        better
    }

    #[inline(always)]
    fn triangle_ray(&mut self) -> &mut TriangleRay {
        self.triangles.get_or_insert_with(|| TriangleRay::new(&self.line))
    }
}

/// Nearest child that the ray enters; the others wait, farthest first.
#[inline]
fn nearest_child<S: Space>(
    space: &S,
    node: Child,
    boxes: &BoxRay4,
    cull: f32,
    stack: &mut [Waiting],
    waiting: &mut usize,
) -> Option<Child> {
    let node = &space.bvh().nodes[node.node_index()];
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
