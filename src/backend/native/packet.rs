//! Sixteen rays that go the same way, taken through a hierarchy together.
//!
//! A node is tested once for all rays with interval arithmetic, what passes is then tested
//! with each ray, and a subtree that only a few rays enter is left to them one by one. So
//! a packet that turns out to diverge costs little more than its rays would alone.

use super::beam::Beam;
use super::bvh::{Child, WIDTH};
use super::traverse::{Space, Waiting, Walk};
use super::wide::Wide;
use super::world::World;
use crate::geom::{Coherence, Hit, LANES, RayPacket};

/// So few rays go on alone.
const FEW: u32 = 2;

/// A child of a node that waits to be visited: where the first ray may enter it, the node
/// and the lane.
#[derive(Clone, Copy, Debug)]
struct WaitingLane {
    enter: f32,
    node: u32,
    lane: u8,
}

/// The rays of a packet on their way through one hierarchy.
#[derive(Default)]
pub(super) struct Level {
    pub(super) walks: Vec<Option<Walk>>,
    waiting: Vec<WaitingLane>,
}

/// What the scene needs for a packet besides its rays.
#[derive(Default)]
pub(super) struct Tools {
    /// The rays in the space of a placed mesh.
    pub(super) placed: Level,
    /// The rays in f64 for shapes.
    pub(super) wide: Wide,
}

/// Takes packets through the scene, with the memory that needs; kept from packet to packet.
pub(super) struct Packets<'a> {
    world: &'a World,
    level: Level,
    single: Vec<Waiting>,
    tools: Tools,
}

impl<'a> Packets<'a> {
    pub(super) fn new(world: &'a World) -> Self {
        let single = vec![(0.0, Child::NONE); world.stack_len];
        Self { world, level: Level::default(), single, tools: Tools::default() }
    }

    /// Traces the first `live` rays of a packet; with `ANY` each up to its first hit.
    pub(super) fn trace<const ANY: bool>(&mut self, rays: &RayPacket, live: usize, coherence: Coherence) {
        let Self { world, level, single, tools } = self;
        level.walks.clear();
        level.walks.extend((0..live).map(|lane| Walk::new(&rays.get(lane))));
        if world.bvh().nodes.is_empty() {
            return;
        }
        if coherence == Coherence::Coherent && world.has_shapes {
            tools.wide.fill(&level.walks);
        }
        level.trace::<ANY, World>(world, coherence, single, tools);
    }

    /// What the ray of `lane` met.
    pub(super) fn hit(&self, lane: usize) -> Option<Hit> {
        Some(self.world.hit(self.level.walks[lane].as_ref()?.best()?))
    }

    /// Whether the ray of `lane` met anything.
    pub(super) fn any(&self, lane: usize) -> bool {
        self.level.walks[lane].as_ref().is_some_and(|walk| walk.best().is_some())
    }
}

impl Level {
    /// Takes all rays through the hierarchy of `space`, together where they are alike.
    pub(super) fn trace<const ANY: bool, S: Space>(
        &mut self,
        space: &S,
        coherence: Coherence,
        single: &mut [Waiting],
        tools: &mut S::Tools,
    ) {
        let beam = if coherence == Coherence::Coherent { Beam::new(&self.walks) } else { None };
        if let Some(beam) = beam {
            self.together::<ANY, S>(space, beam, single, tools);
        } else {
            for walk in self.walks.iter_mut().flatten() {
                walk.descend::<ANY, S>(space, Child::ROOT, single);
            }
        }
    }

    fn together<const ANY: bool, S: Space>(
        &mut self,
        space: &S,
        mut beam: Beam,
        single: &mut [Waiting],
        tools: &mut S::Tools,
    ) {
        self.waiting.clear();
        self.enter(space, &beam, Child::ROOT);
        while let Some(WaitingLane { enter, node, lane }) = self.waiting.pop() {
            if enter > beam.last_t {
                continue;
            }
            let (node, lane) = (&space.bvh().nodes[node as usize], usize::from(lane));
            let lanes = beam.enter(node, lane);
            let (child, few) = (node.child[lane], lanes.count_ones() <= FEW);
            if !child.is_leaf() && !few {
                self.enter(space, &beam, child);
                continue;
            }
            let apart = if few { None } else { space.bvh().apart_index(child) };
            let met = match apart {
                Some(index) => space.apart_together::<ANY>(index, lanes, &mut self.walks, single, tools),
                None => self.one_by_one::<ANY, S>(space, child, lanes, single),
            };
            for lane in bits(met) {
                let Some(walk) = &self.walks[lane] else { continue };
                beam.shorten(lane, if ANY { f32::NEG_INFINITY } else { walk.cull });
            }
            if met != 0 {
                beam.shortened();
            }
        }
    }

    /// Bits of the rays of `lanes` that met something below `child`.
    #[inline]
    fn one_by_one<const ANY: bool, S: Space>(
        &mut self,
        space: &S,
        child: Child,
        lanes: u32,
        single: &mut [Waiting],
    ) -> u32 {
        let mut met = 0;
        for lane in bits(lanes) {
            let Some(walk) = &mut self.walks[lane] else { continue };
            met |= u32::from(walk.descend::<ANY, S>(space, child, single)) << lane;
        }
        met
    }

    /// Lets the children of a node wait that any ray may enter, farthest first.
    fn enter<S: Space>(&mut self, space: &S, beam: &Beam, node: Child) {
        let index = node.node_index();
        let (mut lanes, enter) = beam.enter_any(&space.bvh().nodes[index]);
        let bottom = self.waiting.len();
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % WIDTH;
            lanes &= lanes - 1;
            let next = WaitingLane { enter: enter[lane], node: index as u32, lane: lane as u8 };
            let mut at = self.waiting.len();
            while at > bottom && self.waiting[at - 1].enter < next.enter {
                at -= 1;
            }
            self.waiting.insert(at, next);
        }
    }
}

/// The lanes whose bits are set.
#[inline]
pub(super) fn bits(mut lanes: u32) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let lane = lanes.trailing_zeros() as usize % LANES;
        let some = lanes != 0;
        lanes &= lanes.wrapping_sub(1);
        some.then_some(lane)
    })
}
