//! A pixel while its samples come in.

use super::surface::SurfacePoint;
use crate::film::{Aov, AovImage};
use crate::geom::{LANES, RayHitPacket};
use crate::simd::{self, Kernel};
use glam::{DVec3, Vec3};

/// The sums of one pixel's samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSum {
    /// Linear RGB of the samples that count, times their weights.
    pub color: DVec3,
    /// Where weights differ from 1: the same without weights, and what the weights lack of 1 in all.
    pub plain: DVec3,
    /// See `plain`.
    pub lack: f64,
    /// Squared deviations from the mean, over the channels and the samples that count; kept only if somebody asked.
    pub deviation: f64,
    /// As in [`Bound`](super::certificate::Bound).
    pub cut: [f64; 2],
    /// Samples taken.
    pub taken: u32,
    /// Samples that are finite: they count.
    pub counted: u32,
}

impl PixelSum {
    /// Linear RGB, the mean; black if nothing counts.
    ///
    /// Weights are moved to a mean of 1: a flat area stays flat, where the weights alone would make it noisy. What that adds
    /// to the expected value falls with the number of samples. It is the control variate `weight - 1`, with the plain
    /// mean as its coefficient.
    #[must_use]
    pub fn mean(&self) -> DVec3 {
        let n = f64::from(self.counted.max(1));
        if n == 1.0 && self.lack == 0.0 {
            return self.color; // a lone sample needs no division
        }
        if self.lack == 0.0 { self.color / n } else { (self.color + self.plain * (self.lack / n)) / n }
    }

    /// Mean over the channels of the squared standard error of the mean, were the samples independent.
    ///
    /// Samples that are spread evenly do better: at edges its root is 2 to 3 times too large, on smooth
    /// surfaces more so with every sample.
    #[must_use]
    pub fn error(&self) -> f64 {
        let n = f64::from(self.counted);
        if self.counted < 2 { 0.0 } else { self.deviation / (3.0 * n * (n - 1.0)) }
    }

    /// Adds samples in their order.
    pub fn add(&mut self, samples: &[impl Copy + Into<DVec3>], deviations: bool) {
        self.taken += samples.len() as u32;
        if !deviations {
            for color in samples.iter().filter_map(|&s| kept(s.into())) {
                self.color += color;
                self.counted += 1;
            }
            return;
        }
        for part in samples.chunks(LANES) {
            let before = *self;
            let (mut colors, mut count) = ([DVec3::ZERO; LANES], 0);
            for color in part.iter().filter_map(|&s| kept(s.into())) {
                self.color += color;
                colors[count] = color;
                count += 1;
            }
            self.counted += count as u32;
            self.deviate(&before, colors[..count].iter().copied());
        }
    }

    /// Adds samples that count as much as their weights say.
    pub fn add_weighed(&mut self, samples: impl Iterator<Item = (DVec3, f64)> + Clone, deviations: bool) {
        self.taken += samples.clone().count() as u32;
        let before = *self;
        let samples = samples.filter_map(|(sample, weight)| Some((kept(sample)?, weight)));
        for (color, weight) in samples.clone() {
            self.color += weight * color;
            self.plain += color;
            self.lack += 1.0 - weight;
            self.counted += 1;
        }
        if deviations {
            // Of what the control variate leaves.
            let middle = (self.plain - before.plain) / f64::from((self.counted - before.counted).max(1));
            self.deviate(&before, samples.map(|(color, weight)| color + (weight - 1.0) * (color - middle)));
        }
    }

    /// Source: T. F. Chan, G. H. Golub, R. J. LeVeque, "Updating Formulae and a Pairwise Algorithm for Computing Sample
    /// Variances", 1979, eq. 2.1.
    fn deviate(&mut self, before: &Self, samples: impl Iterator<Item = DVec3> + Clone) {
        let (n, m) = (f64::from(before.counted), f64::from(self.counted - before.counted));
        if m == 0.0 {
            return;
        }
        let mean = samples.clone().sum::<DVec3>() / m;
        self.deviation += samples.map(|c| (c - mean).length_squared()).sum::<f64>();
        if n > 0.0 {
            self.deviation += (mean - before.mean()).length_squared() * n * m / (n + m);
        }
    }
}

/// Pixels with a sample each, of which there is nothing to add up.
#[derive(Clone, Debug, Default)]
pub struct Lone {
    /// Linear RGB; black where the sample does not count.
    pub color: Vec<[f32; 3]>,
    /// As in [`Bound`](super::certificate::Bound); empty if nothing is ever cut.
    pub cut: Vec<[f64; 2]>,
    /// Samples that do not count.
    pub non_finite: u64,
}

impl Lone {
    /// None of them.
    pub fn clear(&mut self) {
        self.color.clear();
        self.cut.clear();
        self.non_finite = 0;
    }

    /// The next ones.
    pub fn add(&mut self, samples: &[[f64; 3]], cut: &[[f64; 2]]) {
        let before = self.color.len();
        self.color.resize(before + samples.len(), [0.0; 3]);
        let new = &mut self.color[before..];
        if !simd::run(Narrow { from: samples.as_flattened(), to: new.as_flattened_mut() }) {
            for color in new.iter_mut().filter(|color| color.iter().any(|c| !c.is_finite())) {
                *color = [0.0; 3];
                self.non_finite += 1;
            }
        }
        self.cut.extend_from_slice(cut);
    }
}

/// Rounds to f32, and tells whether all of that is finite.
struct Narrow<'a> {
    from: &'a [f64],
    to: &'a mut [f32],
}

impl Kernel for Narrow<'_> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let mut finite = true;
        for (to, from) in self.to.iter_mut().zip(self.from) {
            *to = *from as f32;
            finite &= to.abs() < f32::INFINITY;
        }
        finite
    }
}

/// The sample as films hold it, if it can be held.
#[inline]
fn kept(sample: DVec3) -> Option<DVec3> {
    let sample = sample.as_vec3();
    sample.is_finite().then(|| sample.as_dvec3())
}

/// What the auxiliary images show of a pixel, while its samples come in.
#[derive(Clone, Copy, Debug, Default)]
pub struct FirstHits {
    hits: u32,
    depth: f64,
    normal: DVec3,
    albedo: Vec3,
    id: [u32; 2],
    cost: u32,
}

impl FirstHits {
    /// Object and primitive, each plus one, of the pixel's first sample.
    pub fn identify(&mut self, packet: &RayHitPacket, lane: usize) {
        self.id = [packet.hit.geom_id[lane] + 1, packet.hit.prim_id[lane] + 1];
    }

    /// Rays sent for a sample.
    pub fn spend(&mut self, rays: u32) {
        self.cost += rays;
    }

    /// A hit, `depth` world units from the ray's start.
    pub fn see(&mut self, depth: f64, point: &SurfacePoint) {
        self.hits += 1;
        self.depth += depth;
        self.normal += point.ns;
        self.albedo += point.albedo;
    }

    /// Fills pixel `at` of an auxiliary image, of `spp` samples.
    pub fn write(&self, image: &mut AovImage, at: usize, spp: u32) {
        let hits = f64::from(self.hits.max(1));
        let set = |data: &mut [f32], values: &[f32]| {
            data[at * values.len()..][..values.len()].copy_from_slice(values);
        };
        match image.kind {
            Aov::Depth if self.hits == 0 => set(&mut image.data, &[f32::INFINITY]),
            Aov::Depth => set(&mut image.data, &[(self.depth / hits) as f32]),
            Aov::Normal => set(&mut image.data, &(self.normal / hits).as_vec3().to_array()),
            Aov::Albedo => set(&mut image.data, &(self.albedo / spp as f32).to_array()),
            Aov::Id => set(&mut image.data, &self.id.map(f32::from_bits)),
            Aov::Hits => set(&mut image.data, &[self.hits as f32 / spp as f32]),
            Aov::Cost => set(&mut image.data, &[self.cost as f32]),
            Aov::Samples => set(&mut image.data, &[spp as f32]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    fn samples(n: usize, bright: f64) -> Vec<DVec3> {
        let mut random = Random(7);
        (0..n).map(|_| bright + random.point()).collect()
    }

    /// By the definition, of the samples as they are kept.
    fn squared_error(samples: &[DVec3]) -> f64 {
        let n = samples.len() as f64;
        let kept: Vec<DVec3> = samples.iter().map(|s| s.as_vec3().as_dvec3()).collect();
        let mean = kept.iter().sum::<DVec3>() / n;
        kept.iter().map(|s| (*s - mean).length_squared()).sum::<f64>() / (n - 1.0) / n / 3.0
    }

    #[test]
    fn the_error_is_that_of_the_definition_in_whatever_parts_the_samples_come() {
        for bright in [1.0, 1e4] {
            let samples = samples(100, bright);
            let want = squared_error(&samples);
            for part in [1, 3, 16, 100] {
                let mut sum = PixelSum::default();
                samples.chunks(part).for_each(|part| sum.add(part, true));
                assert!((sum.error() / want - 1.0).abs() < 1e-6, "{} in parts of {part}, want {want}", sum.error());
                assert_eq!((sum.taken, sum.counted), (100, 100));
            }
        }
    }

    #[test]
    fn weights_leave_flat_areas_flat_and_slopes_what_they_are() {
        let weights = [1.145, -1.145, 1.145, 1.145, 0.8];
        let weighed = |samples: &[DVec3]| {
            let mut sum = PixelSum::default();
            for part in samples.chunks(16) {
                sum.add_weighed(part.iter().copied().zip(weights.iter().copied().cycle()), true);
            }
            sum
        };
        let flat = weighed(&[DVec3::splat(0.7); 40]);
        assert!((flat.mean() - 0.7f32 as f64).abs().max_element() < 1e-12 && flat.error() < 1e-20, "{flat:?}");
        assert_eq!((flat.taken, flat.counted), (40, 40));
        let samples = samples(80, 1.0);
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for part in samples.chunks(16) {
            for (sample, weight) in part.iter().zip(weights.iter().cycle()) {
                sum += *weight * sample.as_vec3().as_dvec3();
                total += 1.0 - weight;
            }
        }
        let plain = samples.iter().map(|s| s.as_vec3().as_dvec3()).sum::<DVec3>() / 80.0;
        let want = (sum + plain * total) / 80.0;
        assert!((weighed(&samples).mean() - want).length() < 1e-12);
        // Samples around 1 that deviate by a third, times weights of a root mean square of 1.08.
        let ratio = weighed(&samples).error() / squared_error(&samples);
        assert!((1.0..1.35).contains(&ratio), "{ratio}");
    }

    #[test]
    fn a_lone_sample_is_the_sum_of_one() {
        let some = [[0.1, 0.7, 1.0 / 3.0], [f64::NAN; 3], [1e300, 0.0, 0.0], [-0.1, 0.0, 9.0]];
        let mut lone = Lone::default();
        lone.add(&some[..1], &[]);
        lone.add(&some[1..], &[]);
        let sums = some.map(|sample| {
            let mut sum = PixelSum::default();
            sum.add(&[sample], false);
            sum
        });
        assert_eq!(lone.color, sums.map(|sum| sum.mean().as_vec3().to_array()));
        assert_eq!(lone.non_finite, sums.iter().map(|sum| u64::from(sum.taken - sum.counted)).sum::<u64>());
    }

    #[test]
    fn what_is_not_finite_does_not_count() {
        let good = samples(20, 1.0);
        let mut bad = good.clone();
        bad.insert(0, DVec3::NAN);
        bad.insert(5, DVec3::new(0.0, f64::INFINITY, 0.0));
        bad.push(DVec3::splat(1e300)); // not finite in a film
        let (mut with, mut without) = (PixelSum::default(), PixelSum::default());
        bad.chunks(4).for_each(|part| with.add(part, true));
        without.add(&good, true);
        assert_eq!((with.taken, with.counted), (23, 20));
        assert_eq!(with.mean(), without.mean());
        assert!((with.error() / without.error() - 1.0).abs() < 1e-9);
        let mut none = PixelSum::default();
        none.add(&[DVec3::NAN; 3], true);
        assert_eq!((none.mean(), none.error()), (DVec3::ZERO, 0.0));
    }
}
