//! Shadow rays of many blocks on their way to one light.

use super::aim::{BEFORE_THE_LIGHT, Shine};
use super::block::{Block, F32, lanes};
use super::lights::unoccluded;
use crate::backend::Backend;
use crate::geom::{Coherence, INVALID_ID, LANES, PacketBatch, RayHitPacket, RayPacket};
use crate::simd::{self, Kernel};

const ALL_LANES: u32 = (1 << LANES) - 1;

/// A batch of them, and whose they are.
///
/// Either every block has a packet of its own, or the rays of many blocks move together, so that packets are full
/// where many lanes need none, as after bounces.
#[derive(Debug)]
pub struct Shadows {
    dense: bool,
    batch: PacketBatch<RayPacket>,
    /// The block of each packet; of each ray, if dense, block and lane.
    owners: Vec<u32>,
    aimed: Box<RayPacket>,
    visible: Vec<F32>,
    /// The lanes of each block whose answers count.
    needed: Vec<u32>,
    how: How,
    /// Rays that asked for the nearest hit.
    pub nearest: u64,
}

/// How rays are asked about that need not be asked so.
#[derive(Clone, Copy, Debug, Default)]
pub struct How {
    /// Ask for the nearest hit, though any would do.
    pub nearest: bool,
    /// Send the rays of all lanes, though the answers of some do not count.
    pub all: bool,
}

impl Shadows {
    /// None yet.
    #[must_use]
    pub fn new(how: How) -> Self {
        Self {
            dense: false,
            batch: PacketBatch::default(),
            owners: Vec::new(),
            aimed: Box::new(RayPacket::EMPTY),
            visible: Vec::new(),
            needed: Vec::new(),
            how,
            nearest: 0,
        }
    }

    /// Forgets all, and makes room for the answers of `blocks`, whose rays move together if they are to be `dense`.
    pub fn start(&mut self, blocks: usize, dense: bool) {
        self.dense = dense;
        self.batch.clear();
        self.owners.clear();
        self.visible.clear();
        self.visible.resize(blocks, [0.0; LANES]);
        self.needed.clear();
        self.needed.resize(blocks, 0);
    }

    /// A packet to be filled with the rays of a block, which is number `index` and has `len` lanes, by `aim`: it tells the
    /// lanes that need one, and ends those of the others at minus infinity. Returns what `aim` tells, and the lanes whose
    /// rays are sent.
    #[inline]
    pub fn push<A>(&mut self, index: usize, len: usize, aim: impl FnOnce(&mut RayPacket) -> (A, u32)) -> (A, u32) {
        let packet = if self.dense { &mut *self.aimed } else { self.batch.push_packet() };
        let (told, mut sent) = aim(packet);
        self.needed[index] = sent;
        if self.how.all {
            packet.t_far[..len].fill(BEFORE_THE_LIGHT);
            sent = (1 << len) - 1;
        }
        if self.dense {
            for lane in lanes(sent) {
                self.batch.push(&self.aimed.get(lane));
                self.owners.push((index * LANES + lane) as u32);
            }
        } else if sent == 0 {
            self.batch.pop_packet();
        } else {
            self.owners.push(index as u32);
        }
        (told, sent)
    }

    /// Asks `backend` which of them get through.
    pub fn trace(&mut self, backend: &impl Backend) {
        if self.how.nearest {
            self.trace_nearest(backend);
        } else {
            backend.occluded_many(&mut self.batch, Coherence::Coherent);
        }
        if self.dense {
            for (k, packet) in self.batch.packets().iter().enumerate() {
                for (owner, through) in self.owners[k * LANES..].iter().zip(unoccluded(packet)) {
                    self.visible[*owner as usize / LANES][*owner as usize % LANES] = through;
                }
            }
        } else {
            for (packet, &owner) in self.batch.packets().iter().zip(&self.owners) {
                self.visible[owner as usize] = unoccluded(packet);
            }
        }
        if self.how.all {
            for (visible, &needed) in self.visible.iter_mut().zip(&self.needed) {
                lanes(!needed & ALL_LANES).for_each(|lane| visible[lane] = 0.0);
            }
        }
    }

    /// Whether anything is in the way by what is nearest.
    fn trace_nearest(&mut self, backend: &impl Backend) {
        self.nearest += self.batch.len() as u64;
        let mut batch = PacketBatch::<RayHitPacket>::default();
        batch.resize(self.batch.len());
        batch.packets_mut().zip(self.batch.packets()).for_each(|((to, _), from)| to.ray = from.clone());
        backend.intersect_many(&mut batch, Coherence::Coherent);
        for ((packet, _), found) in self.batch.packets_mut().zip(batch.packets()) {
            for (t_far, &geom) in packet.t_far.iter_mut().zip(&found.hit.geom_id) {
                *t_far = if geom == INVALID_ID { *t_far } else { f32::NEG_INFINITY };
            }
        }
    }

    /// For each block: 1 in the lanes whose rays got through, 0 in the others.
    #[must_use]
    pub fn visible(&self) -> &[F32] {
        &self.visible
    }
}

/// Adds what a light would add, as far as it is visible: `share` for each ray that got through.
pub fn take(block: &mut Block, shine: &Shine, visible: &F32, share: f32) {
    simd::run(Take { block, shine, visible, share });
}

struct Take<'a> {
    block: &'a mut Block,
    shine: &'a Shine,
    visible: &'a F32,
    share: f32,
}

impl Kernel for Take<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let through = self.visible.map(|rays| rays * self.share);
        for (color, add) in self.block.color.iter_mut().zip(&self.shine.add) {
            for lane in 0..LANES {
                color[lane] += if through[lane] > 0.0 { add[lane] * through[lane] } else { 0.0 };
            }
        }
    }
}
