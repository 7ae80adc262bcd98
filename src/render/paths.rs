//! The paths that the rays of a batch are on.

use super::block::{Block, Path};
use crate::geom::LANES;

/// The paths of the rays of a batch.
pub trait Paths {
    /// That of ray `i`.
    fn one(&self, i: usize) -> Path;

    /// Those of a packet, from ray `first` on.
    fn sixteen(&self, first: usize, block: &mut Block) {
        for lane in 0..LANES {
            block.set(lane, &self.one(first + lane));
        }
    }
}

/// Those of camera rays: ray `i` belongs to sample `i`.
pub struct OfSamples;

impl Paths for OfSamples {
    #[inline]
    fn one(&self, i: usize) -> Path {
        Path::of_sample(i as u32)
    }

    #[inline]
    fn sixteen(&self, first: usize, block: &mut Block) {
        block.set_samples(first as u32);
    }
}

impl Paths for Vec<Path> {
    #[inline]
    fn one(&self, i: usize) -> Path {
        self[i]
    }
}
