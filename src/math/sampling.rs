//! Sample points: where in the pixel and where on the lens.

use glam::DVec2;

/// Points of one index block of the Sobol sequence; beyond it a new scramble begins.
const BLOCK: u32 = 1 << 16;

/// The 4-D sample points of one pixel: dimensions 0, 1 for the pixel, 2, 3 for the lens.
///
/// Owen-scrambled Sobol points, a function of (pixel, sample, seed) alone, so that any
/// thread may draw any of them. Any count works; powers of two are better.
///
/// Source: B. Burley, "Practical Hash-based Owen Scrambling", JCGT 10(4), 2020.
#[derive(Clone, Copy, Debug)]
pub struct PixelSamples {
    seed: u32,
}

impl PixelSamples {
    /// The points of pixel `(x, y)`.
    #[must_use]
    pub fn new(x: u32, y: u32, seed: u32) -> Self {
        Self { seed: hash(x ^ hash(y ^ hash(seed))) }
    }

    /// Point `index`, each coordinate in `[0, 1)`.
    #[inline]
    #[must_use]
    pub fn point(self, index: u32) -> [f32; 4] {
        let block = index / BLOCK;
        let seed = if block == 0 { self.seed } else { hash(self.seed ^ hash(block)) };
        sobol_burley::sample_4d(index % BLOCK, 0, seed)
    }
}

/// A bijective 32-bit hash ("lowbias32" of C. Wellons' hash prospector).
#[must_use]
fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Uniform point of the unit disc from a uniform point of the unit square.
///
/// Source: P. Shirley, K. Chiu, "A Low Distortion Map Between Disk and Square", JGT 2(3), 1997.
#[must_use]
pub fn concentric_disc(u: f64, v: f64) -> DVec2 {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    if a == 0.0 && b == 0.0 {
        return DVec2::ZERO;
    }
    let (r, phi) = if a.abs() > b.abs() { (a, FRAC_PI_4 * (b / a)) } else { (b, FRAC_PI_2 - FRAC_PI_4 * (a / b)) };
    let (sin, cos) = phi.sin_cos();
    r * DVec2::new(cos, sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_disc_is_covered_uniformly() {
        let n = 512;
        let points = (0..n * n).map(|i| {
            let (u, v) = ((i % n) as f64 + 0.5, (i / n) as f64 + 0.5);
            concentric_disc(u / n as f64, v / n as f64)
        });
        let (mut inner, mut mean, mut worst) = (0, DVec2::ZERO, 0f64);
        for p in points {
            inner += usize::from(p.length() < 0.5);
            mean += p;
            worst = worst.max(p.length());
        }
        let total = (n * n) as f64;
        assert!((inner as f64 / total - 0.25).abs() < 1e-3, "a quarter of the area lies within half the radius");
        assert!(mean.length() / total < 1e-12 && worst <= 1.0 + 1e-12);
    }

    #[test]
    fn each_block_of_sixteen_is_stratified_in_every_dimension() {
        for pixel in 0..50 {
            let samples = PixelSamples::new(pixel, 3 * pixel + 1, 7);
            for dim in 0..4 {
                let mut strata: Vec<u32> = (0..16).map(|i| (samples.point(i)[dim] * 16.0) as u32).collect();
                strata.sort_unstable();
                assert_eq!(strata, (0..16).collect::<Vec<_>>(), "pixel {pixel}, dimension {dim}");
            }
        }
    }

    #[test]
    fn samples_past_the_first_block_are_new() {
        let samples = PixelSamples::new(5, 6, 0);
        assert_ne!(samples.point(1), samples.point(BLOCK + 1));
        assert_ne!(PixelSamples::new(5, 6, 1).point(0), samples.point(0));
    }
}
