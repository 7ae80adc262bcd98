//! Many Sobol points side by side, for vector code.

use super::{BLOCK, Sampler, Sampling, hash};
use sobol_burley::parts::{hash as burley_hash, owen_scramble_rev, sobol_rev, u32_to_f32_norm};
use std::sync::LazyLock;

/// Bits of an index of the sequence.
const BITS: usize = 16;

/// What each bit of a shuffled index, highest first, adds to each of the first four dimensions.
static DIRECTIONS: LazyLock<[[u32; BITS]; 4]> =
    LazyLock::new(|| [0, 1, 2, 3].map(|dimension| std::array::from_fn(|bit| sobol_rev(1 << (31 - bit), dimension))));

/// Where `sobol_burley` tells its own seeds apart: of the index, and of the dimensions.
const INDEX_SEED: u32 = 0x79c6_8e4a;
const DIMENSION_SEEDS: [u32; 4] = [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8];

/// The first `DIMENSIONS` coordinates of sample points, one a lane.
#[derive(Clone, Copy, Debug)]
pub struct SobolLanes<const DIMENSIONS: usize> {
    directions: &'static [[u32; BITS]; 4],
    seed: u32,
}

impl Sampling {
    /// The points of samples up to number `end`, many at once; `None` where one by one is the only way.
    #[must_use]
    pub fn lanes<const DIMENSIONS: usize>(&self, end: u32) -> Option<SobolLanes<DIMENSIONS>> {
        let suits = self.sampler == Sampler::Sobol && end <= BLOCK;
        suits.then(|| SobolLanes { directions: &DIRECTIONS, seed: self.seed })
    }
}

impl<const DIMENSIONS: usize> SobolLanes<DIMENSIONS> {
    /// What [`PixelSamples::point`](super::PixelSamples::point) tells of sample `index` of pixel `(x, y)` in each
    /// lane. Plain loops, to be inlined into code for wide vectors.
    #[inline(always)]
    #[must_use]
    pub fn points<const N: usize>(self, [x, y]: [&[u32; N]; 2], index: &[u32; N]) -> [[f64; N]; DIMENSIONS] {
        let (mut seeds, mut shuffled) = ([0; N], [0; N]);
        for i in 0..N {
            seeds[i] = hash(x[i] ^ hash(y[i] ^ self.seed));
            shuffled[i] = owen_scramble_rev(index[i].reverse_bits(), burley_hash(seeds[i] ^ INDEX_SEED));
        }
        let mut points = [[0.0; N]; DIMENSIONS];
        for (dimension, to) in points.iter_mut().enumerate() {
            let mut sobol = [0u32; N];
            for (bit, direction) in self.directions[dimension].iter().enumerate() {
                for i in 0..N {
                    // All ones where the bit is set.
                    sobol[i] ^= direction & (shuffled[i] >> (31 - bit) & 1).wrapping_neg();
                }
            }
            for i in 0..N {
                let scramble = burley_hash(seeds[i].wrapping_mul(0x9c8f_2d3b) ^ DIMENSION_SEEDS[dimension]);
                to[i] = f64::from(u32_to_f32_norm(owen_scramble_rev(sobol[i], scramble).reverse_bits()));
            }
        }
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_are_what_single_points_are() {
        let sampling = Sampling::new(Sampler::Sobol, 7, 64, 1);
        let lanes = sampling.lanes::<4>(BLOCK).expect("within one block");
        for start in [0, 1, 500, BLOCK - 16] {
            let x: [u32; 16] = std::array::from_fn(|i| (start + 31 * i as u32) % 4000);
            let y = x.map(|x| x.wrapping_mul(2_654_435_761) >> 20);
            let index = std::array::from_fn(|i| start + i as u32);
            let points = lanes.points([&x, &y], &index);
            for i in 0..16 {
                assert_eq!(points.map(|of| of[i]), sampling.pixel(x[i], y[i]).point(index[i]));
            }
        }
        assert!(sampling.lanes::<2>(BLOCK + 1).is_none());
        assert!(Sampling::new(Sampler::Random, 7, 64, 1).lanes::<2>(1).is_none());
    }
}
