//! How far a picture is from what it would be with endlessly many samples.
//!
//! Some pixels are sampled a second time, by sequences with a scramble of their own, and not shown. Half of the squared
//! difference of the two is, on average, the squared error of one: independent errors of equal size add up. It needs no
//! model of how evenly samples are spread, and what a pixel missed altogether shows too, once in two.
//!
//! Which pixels err is known for all: the spread of a pixel's own samples ([`PixelSum::error`]) tells, only too
//! high. So the twice sampled pixels decide by what factor, and the sum over all pixels is divided by it, the ratio estimator
//! of W. G. Cochran, "Sampling Techniques", 1977, ch. 6.

use super::job::Crop;
use super::pixel::PixelSum;
use crate::math::hash;

/// Sums over pixels.
#[derive(Clone, Copy, Debug, Default)]
pub struct ErrorSum {
    /// Squared errors by the spread of samples, all pixels.
    all: f64,
    /// The same, pixels that are sampled twice.
    twice: f64,
    /// Squared errors by the difference of the two, the same pixels.
    apart: f64,
    pixels: u64,
    pairs: u64,
}

impl ErrorSum {
    /// Adds a pixel that is sampled once.
    pub fn add(&mut self, pixel: &PixelSum) {
        self.all += pixel.error();
        self.pixels += 1;
    }

    /// Adds that a pixel, which has been added, is sampled a second time.
    pub fn add_pair(&mut self, pixel: &PixelSum, again: &PixelSum) {
        self.twice += 0.5 * (pixel.error() + again.error());
        self.apart += (pixel.mean() - again.mean()).length_squared() / 6.0;
        self.pairs += 1;
    }

    /// Adds up parts.
    pub fn merge(&mut self, o: &Self) {
        self.all += o.all;
        self.twice += o.twice;
        self.apart += o.apart;
        self.pixels += o.pixels;
        self.pairs += o.pairs;
    }

    /// What squared errors by the spread of samples are to be multiplied by.
    #[must_use]
    pub fn factor(&self) -> f64 {
        if self.twice > 0.0 { self.apart / self.twice } else { 1.0 }
    }

    /// Root of the mean squared error over pixels and channels, linear; `None` without pairs.
    #[must_use]
    pub fn rmse(&self) -> Option<f64> {
        let per_pair = self.pixels as f64 / self.pairs as f64;
        let sum = if self.twice > 0.0 { self.all * self.factor() } else { self.all + self.apart * per_pair };
        (self.pairs > 0).then(|| (sum / self.pixels as f64).sqrt())
    }
}

/// Which pixels of an image are sampled twice: one in each square of so many pixels a side.
#[derive(Clone, Copy, Debug)]
pub struct Twice {
    side: u32,
    seed: u32,
}

impl Twice {
    /// Pairs that an estimate should have; small images make do with one pixel in four.
    const ENOUGH: u64 = 2048;
    /// Of fewer pixels all are sampled twice: one in four could be none.
    const TINY: u64 = 64;

    /// For an image of this size.
    #[must_use]
    pub fn of(crop: Crop, seed: u32) -> Self {
        let pixels = crop.pixels();
        let enough = |&side: &u32| pixels / u64::from(side * side) >= Self::ENOUGH;
        let small = if pixels < Self::TINY { 1 } else { 2 };
        Self { side: [8, 4].into_iter().find(enough).unwrap_or(small), seed }
    }

    /// Whether pixel `(x, y)` is.
    #[must_use]
    pub fn is(&self, (x, y): (u32, u32)) -> bool {
        let (column, row) = (x / self.side, y / self.side);
        let chosen = hash(column ^ hash(row ^ hash(self.seed)));
        (x % self.side, y % self.side) == (chosen % self.side, chosen / self.side % self.side)
    }

    /// The seed of the second sequences.
    #[must_use]
    pub fn seed(&self) -> u32 {
        hash(self.seed ^ 0x51ed_270b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;
    use glam::DVec3;
    use std::collections::HashSet;

    const CROP: Crop = Crop { x0: 16, y0: 8, x1: 16 + 640, y1: 8 + 320 };

    #[test]
    fn one_pixel_in_each_square_is_sampled_twice() {
        let crops = [
            (CROP, 8),
            (Crop { x0: 0, y0: 0, x1: 256, y1: 160 }, 4),
            (Crop { x1: 56, y1: 24, ..CROP }, 2),
            (Crop { x1: 19, y1: 11, ..CROP }, 1),
        ];
        for (crop, side) in crops {
            let twice = Twice::of(crop, 3);
            let all = (crop.y0..crop.y1).flat_map(|y| (crop.x0..crop.x1).map(move |x| (x, y)));
            let chosen: Vec<_> = all.filter(|&p| twice.is(p)).collect();
            let squares: HashSet<_> = chosen.iter().map(|(x, y)| (x / side, y / side)).collect();
            assert_eq!(squares.len(), chosen.len(), "side {side}");
            assert_eq!(chosen.len() as u64, crop.pixels() / u64::from(side * side), "side {side}");
            let places: HashSet<_> = chosen.iter().map(|(x, y)| (x % side, y % side)).collect();
            assert!(side == 1 || places.len() > 2, "not the same place in each");
        }
    }

    /// A pixel with samples around `mean`, whose mean is better than that of independent ones by `evenly`.
    fn pixel(random: &mut Random, mean: f64, spread: f64, evenly: f64) -> PixelSum {
        let mut noise = || DVec3::splat((0..12).map(|_| random.unit() - 0.5).sum::<f64>());
        let n = 64;
        let samples: Vec<DVec3> = (0..n).map(|_| spread * noise()).collect();
        let off = samples.iter().sum::<DVec3>() / f64::from(n);
        let mut sum = PixelSum::default();
        let samples: Vec<DVec3> = samples.iter().map(|s| mean + *s - off * (1.0 - 1.0 / evenly)).collect();
        sum.add(&samples, true);
        sum
    }

    #[test]
    fn the_estimate_is_the_error_however_evenly_samples_are_spread() {
        for evenly in [1.0, 3.0, 20.0] {
            let (mut random, mut sum, mut error) = (Random(5), ErrorSum::default(), 0.0);
            for i in 0..20_000 {
                // Few pixels have most of the error.
                let spread = if i % 50 == 0 { 1.0 } else { 0.02 };
                let mean = f64::from(i % 7);
                let picture = pixel(&mut random, mean, spread, evenly);
                error += (picture.mean().x - mean).powi(2);
                sum.add(&picture);
                if i % 9 == 0 {
                    sum.add_pair(&picture, &pixel(&mut random, mean, spread, evenly));
                }
            }
            let (rmse, estimate) = ((error / 20_000.0).sqrt(), sum.rmse().expect("there are pairs"));
            assert!((estimate / rmse - 1.0).abs() < 0.25, "{estimate} for {rmse}, evenly {evenly}");
            assert!((sum.factor() * evenly * evenly - 1.0).abs() < 0.5, "{} for {evenly}", sum.factor());
        }
    }

    #[test]
    fn without_spread_or_pairs_it_says_what_it_can() {
        let mut sum = ErrorSum::default();
        let flat = pixel(&mut Random(1), 1.0, 0.0, 1.0);
        sum.add(&flat);
        assert_eq!(sum.rmse(), None, "no pair");
        sum.add_pair(&flat, &flat);
        assert_eq!(sum.rmse(), Some(0.0));
        // Nothing in the samples, but the two differ: one of them missed something.
        sum.add_pair(&flat, &pixel(&mut Random(1), 3.0, 0.0, 1.0));
        assert_eq!(sum.rmse(), Some(1.0), "half of 2 squared, in one of two pairs");
    }
}
