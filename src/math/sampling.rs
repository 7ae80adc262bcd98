//! Sample points: where in the pixel, on the lens and on a light.

mod lanes;
mod strata;

use glam::DVec2;
pub use lanes::SobolLanes;
use strata::Strata;

/// Points of one index block of the Sobol sequence; beyond it a new scramble begins.
const BLOCK: u32 = 1 << 16;

/// How sample points are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sampler {
    /// Owen-scrambled Sobol points: pixel, lens and lights are spread over together. Any count works; powers of two are
    /// better.
    ///
    /// Source: B. Burley, "Practical Hash-based Owen Scrambling", JCGT 10(4), 2020.
    #[default]
    Sobol,
    /// Independent uniform numbers of 32 bits: the error falls with the square root of the count, whatever is seen.
    Random,
    /// One jittered point in each of as many cells as there are samples, for pixel, lens and each light apart; which
    /// point of the one goes with which of the other is left to chance. Only a whole set is stratified, so the count
    /// has to be known before.
    ///
    /// Source: A. Kensler, "Correlated Multi-Jittered Sampling", Pixar Technical Memo 13-01, 2013.
    Stratified,
}

impl Sampler {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Sobol, Self::Random, Self::Stratified];

    /// The name in scene files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sobol => "sobol",
            Self::Random => "random",
            Self::Stratified => "stratified",
        }
    }
}

/// The sample points of a picture: what those of all its pixels have in common.
#[derive(Clone, Copy, Debug)]
pub struct Sampling {
    sampler: Sampler,
    /// Hash of the seed.
    seed: u32,
    /// Cells of the pixel, and of the lens.
    in_pixel: Strata,
    /// Cells of a light.
    at_light: Strata,
    /// The pair of dimensions that looks at the first light.
    first_light: u32,
}

impl Sampling {
    /// Of `spp` samples a pixel, each of which looks `light_samples` times at a light.
    #[must_use]
    pub fn new(sampler: Sampler, seed: u32, spp: u32, light_samples: u32) -> Self {
        let (in_pixel, at_light) = (Strata::new(spp), Strata::new(spp.saturating_mul(light_samples)));
        Self { sampler, seed: hash(seed), in_pixel, at_light, first_light: 2 }
    }

    /// The same where no point of the lens is asked for: the dimensions of the lens look at the first light, which is
    /// then spread together with the pixel as well as can be.
    #[must_use]
    pub fn without_lens(self) -> Self {
        Self { first_light: 1, ..self }
    }

    /// The same kind of points, scrambled or drawn independently.
    #[must_use]
    pub fn with_seed(self, seed: u32) -> Self {
        Self { seed: hash(seed), ..self }
    }

    /// The points of pixel `(x, y)`.
    #[inline]
    #[must_use]
    pub fn pixel(&self, x: u32, y: u32) -> PixelSamples<'_> {
        PixelSamples { sampling: self, seed: hash(x ^ hash(y ^ self.seed)) }
    }
}

/// The sample points of one pixel: dimensions 0, 1 for the pixel, 2, 3 for the lens if there is one, then two
/// for each light that has a size.
///
/// They are a function of (pixel, sample, seed) and the kind of [`Sampling`] alone, so that any thread may draw any
/// of them.
#[derive(Clone, Copy, Debug)]
pub struct PixelSamples<'a> {
    sampling: &'a Sampling,
    seed: u32,
}

impl PixelSamples<'_> {
    /// Point `index`, each coordinate in `[0, 1)`.
    #[inline]
    #[must_use]
    pub fn point(self, index: u32) -> [f64; 4] {
        match self.sampling.sampler {
            Sampler::Sobol => sobol(0, index, self.seed),
            Sampler::Random => join([0, 1].map(|pair| random(self.seed, index, pair))),
            Sampler::Stratified => {
                join([0, LENS].map(|pair| self.sampling.in_pixel.point(index, hash(self.seed ^ pair))))
            }
        }
    }

    /// Where on light number `light` sample `index` looks from a hit at the end of `branch`, in
    /// `[0, 1)` squared. With more than one look a sample, `index` counts looks.
    ///
    /// Sobol: the camera ray's own hit takes further dimensions of the pixel's sequence, so that pixel,
    /// lens and light are spread together; hits after a bounce take sequences of their own.
    #[must_use]
    pub fn on_light(self, index: u32, light: u32, branch: Branch) -> [f64; 2] {
        let own_seed = || hash(self.seed ^ hash(branch.0 ^ hash(light + 1)));
        match self.sampling.sampler {
            Sampler::Sobol => {
                let pair = self.sampling.first_light + light;
                let (set, half) = (pair / 2, 2 * (pair % 2) as usize);
                if branch == Branch::CAMERA && set < sobol_burley::NUM_DIMENSION_SETS_4D {
                    let point = sobol(set, index, self.seed);
                    [point[half], point[half + 1]]
                } else {
                    let [a, b, ..] = sobol(0, index, own_seed());
                    [a, b]
                }
            }
            Sampler::Random => random(own_seed(), index, 2),
            Sampler::Stratified => self.sampling.at_light.point(index, own_seed()),
        }
    }

    /// Draw number `number` of sample `index` beyond its point: independent, in `[0, 1)` squared.
    #[must_use]
    pub fn beyond(self, index: u32, number: u32) -> [f64; 2] {
        let first = hash(self.seed ^ hash(index ^ hash(number.wrapping_add(0x9e37_79b9))));
        [first, hash(first ^ 0x85eb_ca6b)].map(unit)
    }
}

/// Tells the lens from the pixel.
const LENS: u32 = 0x68e3_1da4;

/// Four dimensions of the Sobol sequence, scrambled by `seed`.
#[inline]
fn sobol(set: u32, index: u32, seed: u32) -> [f64; 4] {
    let block = index / BLOCK;
    let seed = if block == 0 { seed } else { hash(seed ^ hash(block)) };
    sobol_burley::sample_4d(index % BLOCK, set, seed).map(f64::from)
}

/// Two numbers that depend on nothing but what is given: the counter-based use of splitmix64.
///
/// Source: G. L. Steele, D. Lea, C. H. Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014.
#[inline]
fn random(seed: u32, index: u32, pair: u32) -> [f64; 2] {
    let start = mix(u64::from(seed) << 32 | u64::from(index));
    let bits = mix(start.wrapping_add(u64::from(pair + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
    [(bits >> 32) as u32, bits as u32].map(unit)
}

/// 32 bits as a number in `[0, 1)`.
#[inline]
fn unit(bits: u32) -> f64 {
    f64::from(bits) / 4_294_967_296.0
}

#[inline]
fn join([[a, b], [c, d]]: [[f64; 2]; 2]) -> [f64; 4] {
    [a, b, c, d]
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
#[inline(always)]
#[must_use]
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Splitmix64's finaliser, a bijection: every bit in changes every bit out half of the time.
#[must_use]
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
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
mod tests;
