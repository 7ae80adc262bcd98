//! Shadow rays of many blocks on their way to one light.

use super::aim::Shine;
use super::block::{Block, F32};
use super::lights::unoccluded;
use crate::backend::Backend;
use crate::geom::{Coherence, LANES, PacketBatch, RayPacket};
use crate::simd::{self, Kernel};

/// A batch of them, and whose they are.
///
/// `DENSE` moves the rays of many blocks together, so that packets are full where many lanes need
/// none, as after bounces; else every block has a packet of its own.
#[derive(Debug)]
pub struct Shadows<const DENSE: bool> {
    batch: PacketBatch<RayPacket>,
    /// The block of each packet; of each ray, if dense, block and lane.
    owners: Vec<u32>,
    aimed: Box<RayPacket>,
    visible: Vec<F32>,
}

impl<const DENSE: bool> Shadows<DENSE> {
    /// None yet.
    #[must_use]
    pub fn new() -> Self {
        let aimed = Box::new(RayPacket::EMPTY);
        Self { batch: PacketBatch::default(), owners: Vec::new(), aimed, visible: Vec::new() }
    }

    /// Forgets all, and makes room for the answers of `blocks`.
    pub fn start(&mut self, blocks: usize) {
        self.batch.clear();
        self.owners.clear();
        self.visible.clear();
        self.visible.resize(blocks, [0.0; LANES]);
    }

    /// A packet to be filled with the rays of block `index` by `aim`, which tells the lanes that hold one; those
    /// of the others have ended at minus infinity.
    #[inline]
    pub fn push<A>(&mut self, index: usize, aim: impl FnOnce(&mut RayPacket) -> (A, u32)) -> A {
        if DENSE {
            let (asked, mut lanes) = aim(&mut self.aimed);
            while lanes != 0 {
                let lane = lanes.trailing_zeros();
                self.batch.push(&self.aimed.get(lane as usize));
                self.owners.push((index * LANES) as u32 + lane);
                lanes &= lanes - 1;
            }
            return asked;
        }
        let (asked, lanes) = aim(self.batch.push_packet());
        if lanes == 0 {
            self.batch.pop_packet();
        } else {
            self.owners.push(index as u32);
        }
        asked
    }

    /// Asks `backend` which of them get through.
    pub fn trace(&mut self, backend: &impl Backend) {
        backend.occluded_many(&mut self.batch, Coherence::Coherent);
        if DENSE {
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
    }

    /// For each block: 1 in the lanes whose rays got through, 0 in the others.
    #[must_use]
    pub fn visible(&self) -> &[F32] {
        &self.visible
    }
}

/// Adds what a light would add where it is visible.
pub fn take(block: &mut Block, shine: &Shine, visible: &F32) {
    simd::run(Take { block, shine, visible });
}

struct Take<'a> {
    block: &'a mut Block,
    shine: &'a Shine,
    visible: &'a F32,
}

impl Kernel for Take<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (color, add) in self.block.color.iter_mut().zip(&self.shine.add) {
            for lane in 0..LANES {
                color[lane] += if self.visible[lane] > 0.0 { add[lane] } else { 0.0 };
            }
        }
    }
}
