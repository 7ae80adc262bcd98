//! What the rays of a thread bring in, and what they were.

use super::block::{Block, F32};
use super::certificate::Bound;
use super::job::{RayCounts, Work};
use super::surface::SurfacePoint;
use super::tile::Drawn;
use glam::Vec3;

/// What the rays of a segment gather, one entry per sample.
#[derive(Debug, Default)]
pub struct Gathered {
    /// Linear RGB.
    pub color: Vec<[f64; 3]>,
    /// Bound on what was left out by the weight cut and `k_max`, linear: `(fixed, scaled)` as in [`Bound`].
    pub cut: Vec<[f64; 2]>,
    /// Rays sent for it, of all kinds; kept only if somebody asked.
    pub cost: Option<Vec<u32>>,
    /// The hits of the camera rays with their samples, in order; kept only if somebody asked.
    pub seen: Option<Vec<(u32, SurfacePoint)>>,
}

impl Gathered {
    /// Adds what the hits of a block show.
    pub fn add(&mut self, block: &Block) {
        let add: [F32; 3] = [0, 1, 2].map(|k| {
            let mut add = block.weight[k];
            add.iter_mut().zip(&block.color[k]).for_each(|(weight, color)| *weight *= color);
            add
        });
        for (lane, &slot) in block.slot[..block.len].iter().enumerate() {
            self.add_one(slot, Block::vec3(&add, lane));
        }
    }

    /// Adds to a sample.
    #[inline]
    pub fn add_one(&mut self, slot: u32, add: Vec3) {
        for (sum, add) in self.color[slot as usize].iter_mut().zip(add.to_array()) {
            *sum += f64::from(add);
        }
    }

    /// Notes that a branch of weight `most` was left out that could have brought `bound`.
    pub fn leave_out(&mut self, slot: u32, most: f32, bound: Bound) {
        let cut = &mut self.cut[slot as usize];
        cut[0] += f64::from(most) * f64::from(bound.fixed);
        cut[1] += f64::from(most) * f64::from(bound.scaled);
    }
}

/// What was sent and what was left out.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// Rays sent.
    pub rays: RayCounts,
    /// Shadow rays that a surface facing away from its light made needless.
    pub facing_away: u64,
    /// Shadow rays from the inside of a closed shape to a light outside of it.
    pub enclosed: u64,
    /// Shadow rays to lights that would have added less than the weight cut.
    pub faint: u64,
    /// Rays inside of shapes that touch nothing, which no backend had to be asked about.
    pub inside: u64,
    /// Branches below the weight cut.
    pub below_cut: u64,
    /// What was done that can be left out.
    pub work: Work,
    /// Packets of camera rays that the backend was not asked about.
    pub packets_outside: u64,
    /// Blocks without a highlight, once for each light that shone on them.
    pub dull: u64,
    /// Rays of all kinds that were sent to compare with, and are not counted above.
    pub again: u64,
    /// Largest answer of a surface to all lights; kept only where a bound needs it.
    pub brightest: f32,
}

impl Tally {
    /// Adds those of another thread.
    pub fn add(&mut self, o: &Self) {
        self.rays.add(&o.rays);
        self.facing_away += o.facing_away;
        self.enclosed += o.enclosed;
        self.faint += o.faint;
        self.inside += o.inside;
        self.below_cut += o.below_cut;
        self.work.add(&o.work);
        self.packets_outside += o.packets_outside;
        self.dull += o.dull;
        self.again += o.again;
        self.brightest = self.brightest.max(o.brightest);
    }

    /// Counts what was drawn for so many camera rays.
    pub fn note_drawn(&mut self, drawn: Drawn, rays: usize) {
        self.work.pixel_points += if drawn.pixel { rays as u64 } else { 0 };
        self.work.lens_points += if drawn.lens { rays as u64 } else { 0 };
    }
}
