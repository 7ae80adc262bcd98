//! Sample points: where in the pixel, on the lens and on a light.

use glam::DVec2;

/// Points of one index block of the Sobol sequence; beyond it a new scramble begins.
const BLOCK: u32 = 1 << 16;

/// The sample points of one pixel: dimensions 0, 1 for the pixel, 2, 3 for the lens, then two
/// for each light that has a size.
///
/// Owen-scrambled Sobol points, a function of (pixel, sample, seed) alone, so that any
/// thread may draw any of them. Any count works; powers of two are better.
///
/// Source: B. Burley, "Practical Hash-based Owen Scrambling", JCGT 10(4), 2020.
#[derive(Clone, Copy, Debug, Default)]
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
        self.dimensions(0, index)
    }

    /// Where on light number `light` sample `index` looks from a hit at the end of `branch`, in
    /// `[0, 1)` squared.
    ///
    /// The camera ray's own hit takes further dimensions of the pixel's sequence, so that pixel,
    /// lens and light are spread together; hits after a bounce take sequences of their own.
    #[must_use]
    pub fn on_light(self, index: u32, light: u32, branch: Branch) -> [f64; 2] {
        let (set, half) = (1 + light / 2, 2 * (light % 2) as usize);
        let [a, b] = if branch == Branch::CAMERA && set < sobol_burley::NUM_DIMENSION_SETS_4D {
            let point = self.dimensions(set, index);
            [point[half], point[half + 1]]
        } else {
            let seed = hash(self.seed ^ hash(branch.0 ^ hash(light + 1)));
            let point = Self { seed }.dimensions(0, index);
            [point[0], point[1]]
        };
        [f64::from(a), f64::from(b)]
    }

    /// Draw number `number` of sample `index` beyond its point: independent, in `[0, 1)` squared.
    #[must_use]
    pub fn beyond(self, index: u32, number: u32) -> [f64; 2] {
        let first = hash(self.seed ^ hash(index ^ hash(number.wrapping_add(0x9e37_79b9))));
        [first, hash(first ^ 0x85eb_ca6b)].map(|bits| f64::from(bits) / 4_294_967_296.0)
    }

    #[inline]
    fn dimensions(self, set: u32, index: u32) -> [f32; 4] {
        let block = index / BLOCK;
        let seed = if block == 0 { self.seed } else { hash(self.seed ^ hash(block)) };
        sobol_burley::sample_4d(index % BLOCK, set, seed)
    }
}

/// Which of a sample's paths a ray is on: a hash of the bounces so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Branch(u32);

impl Branch {
    /// No bounce yet.
    pub const CAMERA: Self = Self(0);

    /// After one more bounce; `kind` tells branches of one hit apart.
    #[inline]
    #[must_use]
    pub fn bounced(self, kind: u32) -> Self {
        Self(hash(self.0.wrapping_mul(2).wrapping_add(kind) ^ 0x27d4_eb2f))
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

/// Uniform point of the unit disc from a uniform point of the unit square: radius `sqrt(u)`.
#[must_use]
pub fn polar_disc(u: f64, v: f64) -> DVec2 {
    uniform_radius_disc(u.sqrt(), v)
}

/// Point of the unit disc with *radius* `u`: too many in the middle, density `1 / (2π r)`. What is
/// averaged over them is biased, and more samples do not help.
#[must_use]
pub fn uniform_radius_disc(u: f64, v: f64) -> DVec2 {
    let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
    u * DVec2::new(cos, sin)
}

/// Uniform point of the unit disc by rejection: points of the square around it, `first` and then
/// those that `more` draws, until one lies inside.
#[must_use]
pub fn rejection_disc(first: [f64; 2], mut more: impl FnMut() -> [f64; 2]) -> DVec2 {
    /// Points drawn at most; that none of them lies inside has a chance of 1e-21.
    const MOST: u32 = 32;
    let mut p = 2.0 * DVec2::from(first) - 1.0;
    for _ in 1..MOST {
        if p.length_squared() <= 1.0 {
            return p;
        }
        p = 2.0 * DVec2::from(more()) - 1.0;
    }
    p.clamp_length_max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sampler_but_the_biased_one_covers_the_disc_uniformly() {
        let samples = PixelSamples::new(3, 4, 5);
        let n = 1 << 14;
        let within_half = |draw: &dyn Fn(u32, f64, f64) -> DVec2| {
            let points = (0..n).map(|i| {
                let [_, _, u, v] = samples.point(i).map(f64::from);
                draw(i, u, v)
            });
            let points: Vec<DVec2> = points.collect();
            let mean = points.iter().sum::<DVec2>() / f64::from(n);
            assert!(mean.length() < 5e-3 && points.iter().all(|p| p.length() <= 1.0), "{mean}");
            points.iter().filter(|p| p.length() < 0.5).count() as f64 / f64::from(n)
        };
        let rejection = |i, u, v| {
            let mut number = 0;
            rejection_disc([u, v], || {
                number += 1;
                samples.beyond(i, number)
            })
        };
        for (name, share, tolerance) in [
            ("concentric", within_half(&|_, u, v| concentric_disc(u, v)), 2e-3),
            ("polar", within_half(&|_, u, v| polar_disc(u, v)), 2e-3),
            ("rejection", within_half(&rejection), 1e-2),
        ] {
            assert!((share - 0.25).abs() < tolerance, "{name}: {share} of the points in a quarter of the area");
        }
        let biased = within_half(&|_, u, v| uniform_radius_disc(u, v));
        assert!((biased - 0.5).abs() < 2e-3, "{biased}");
    }

    #[test]
    fn points_on_lights_are_stratified_and_differ_by_light_and_branch() {
        let samples = PixelSamples::new(8, 1, 2);
        let bounced = Branch::CAMERA.bounced(0);
        assert_ne!(bounced, Branch::CAMERA.bounced(1));
        assert_ne!(bounced.bounced(1), Branch::CAMERA.bounced(1).bounced(0));
        for (light, branch) in [(0, Branch::CAMERA), (3, Branch::CAMERA), (200, Branch::CAMERA), (0, bounced)] {
            let points: Vec<_> = (0..16).map(|i| samples.on_light(i, light, branch)).collect();
            for dim in 0..2 {
                let mut strata: Vec<u32> = points.iter().map(|p| (p[dim] * 16.0) as u32).collect();
                strata.sort_unstable();
                assert_eq!(strata, (0..16).collect::<Vec<_>>(), "light {light}, {branch:?}");
            }
            assert_ne!(points[0], samples.on_light(0, light + 1, branch));
            assert_ne!(points[0], samples.on_light(0, light, branch.bounced(1)));
        }
    }

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
