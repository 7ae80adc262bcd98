//! Which pixels go on: rounds of sampling, each of which doubles the samples of some pixels.

use super::pixel::PixelSum;
use rayon::prelude::*;

/// Samples of every pixel before any may stop: fewer miss too much.
pub const FIRST: u32 = 16;

/// What twice as many samples leave of a squared error: that of an edge under evenly spread samples.
const LEFT: f64 = 0.4;

/// How many times fewer samples the neighbours of a pixel may have that goes on for the sake of the whole image: what they
/// missed is in the estimate of its error.
const BEHIND: u32 = 4;

/// Pixels worked on by one thread at a time: a fixed number, so that sums are the same for any number of threads.
const PART: usize = 1 << 14;

/// What the choice of pixels goes by, row by row.
#[derive(Clone, Copy, Debug, Default)]
pub struct Progress {
    /// Squared error by the spread of samples.
    pub error: f64,
    /// Mean of the channels.
    pub mean: f64,
    /// Samples so far.
    pub taken: u32,
}

/// The pixels that go on.
#[derive(Debug)]
pub struct Choice {
    /// One for each pixel.
    pub go_on: Vec<bool>,
    /// Samples still to come, as far as can be told.
    pub expected: u64,
}

/// What the choice aims at.
#[derive(Clone, Copy, Debug)]
pub enum Goal {
    /// Every pixel's own error is below this share of the root of its light.
    Noise(f64),
    /// The image's root mean square error.
    Rmse(f64),
}

/// Chooses the pixels that get twice the samples they have, at least [`FIRST`] and at most `most`.
///
/// `factor` is what squared errors are multiplied by ([`ErrorSum::factor`](super::estimate::ErrorSum::factor)).
pub fn choose(pixels: &[Progress], width: usize, most: u32, goal: Goal, factor: f64) -> Choice {
    if pixels.iter().any(|p| p.taken < FIRST.min(most)) {
        return Choice { go_on: vec![true; pixels.len()], expected: pixels.len() as u64 * u64::from(FIRST) };
    }
    let (wanted, behind): (Vec<u64>, u32) = match goal {
        Goal::Noise(threshold) => {
            let more = |p: &Progress| if p.is_noisy(threshold) { u64::from(p.taken.min(most - p.taken)) } else { 0 };
            (pixels.iter().map(more).collect(), 1)
        }
        Goal::Rmse(target) => (Allocation { pixels, most, factor }.towards(target), BEHIND),
    };
    Choice { expected: wanted.iter().sum(), go_on: dilated(pixels, &wanted, width, most, behind) }
}

impl Progress {
    /// Of a pixel.
    pub fn of(pixel: &PixelSum) -> Self {
        Self { error: pixel.error(), mean: pixel.mean().element_sum() / 3.0, taken: pixel.taken }
    }

    /// Whether its own standard error is above `threshold` times the root of its light: what eyes see as equal.
    pub fn is_noisy(&self, threshold: f64) -> bool {
        /// Of light that counts as none.
        const DARK: f64 = 1e-4;
        self.error.sqrt() >= threshold * (DARK + self.mean.max(0.0).sqrt())
    }
}

/// Samples where they lower the error most.
///
/// The mean squared error is least, for a number of samples, where one more sample would lower it by the same everywhere. So
/// pixels double as long as that lowers their error by more than `price` a sample; the price is found for which the
/// target is reached.
struct Allocation<'a> {
    pixels: &'a [Progress],
    most: u32,
    factor: f64,
}

impl Allocation<'_> {
    /// Samples that each pixel should still get until the image's RMSE is `target`.
    fn towards(&self, target: f64) -> Vec<u64> {
        let allowed = target * target * self.pixels.len() as f64;
        let highest = self.pixels.iter().map(|p| self.gain(self.factor * p.error, p.taken)).fold(0.0, f64::max);
        if highest == 0.0 {
            // The samples of each pixel agree, and yet there is an error: nothing tells where.
            return self.pixels.iter().map(|p| u64::from(p.taken.min(self.most - p.taken))).collect();
        }
        // At 2^-60 of the highest price all pixels have the most samples they can have.
        let (mut low, mut high) = (-60.0, 0.0);
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            if self.error_at(highest * f64::exp2(middle)) > allowed { high = middle } else { low = middle }
        }
        let price = highest * f64::exp2(low);
        self.pixels.par_iter().map(|p| u64::from(self.at_price(p, price).0 - p.taken)).collect()
    }

    /// What a doubling takes from a squared error, per sample.
    fn gain(&self, error: f64, taken: u32) -> f64 {
        error * (1.0 - LEFT) / f64::from(taken)
    }

    /// Samples and squared error of a pixel where a sample costs `price`.
    fn at_price(&self, p: &Progress, price: f64) -> (u32, f64) {
        let (mut taken, mut error) = (p.taken, self.factor * p.error);
        while taken < self.most && self.gain(error, taken) > price {
            taken = taken.saturating_mul(2).min(self.most);
            error *= LEFT;
        }
        (taken, error)
    }

    fn error_at(&self, price: f64) -> f64 {
        let parts =
            self.pixels.par_chunks(PART).map(|part| part.iter().map(|p| self.at_price(p, price).1).sum::<f64>());
        parts.collect::<Vec<_>>().iter().sum()
    }
}

/// The wanted pixels, and neighbours that have no more than their share `1 / behind` of the samples: they may have missed
/// what those saw.
fn dilated(pixels: &[Progress], wanted: &[u64], width: usize, most: u32, behind: u32) -> Vec<bool> {
    let height = pixels.len() / width;
    let goes = |x: usize, y: usize| {
        let own = &pixels[y * width + x];
        let around = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
        own.taken < most
            && around(y, height).any(|v| {
                around(x, width).any(|u| {
                    let i = v * width + u;
                    wanted[i] > 0 && ((u, v) == (x, y) || own.taken.saturating_mul(behind) <= pixels[i].taken)
                })
            })
    };
    (0..pixels.len()).into_par_iter().map(|i| goes(i % width, i / width)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 20;

    fn flat() -> Vec<Progress> {
        vec![Progress { error: 0.0, mean: 0.25, taken: 64 }; WIDTH * 10]
    }

    fn chosen(choice: &Choice) -> Vec<(usize, usize)> {
        let places = choice.go_on.iter().enumerate().filter(|&(_, &goes)| goes);
        places.map(|(i, _)| (i % WIDTH, i / WIDTH)).collect()
    }

    #[test]
    fn a_noisy_pixel_goes_on_with_its_neighbours() {
        let mut pixels = flat();
        pixels[4 * WIDTH + 7].error = 0.01f64.powi(2);
        let with = |threshold| choose(&pixels, WIDTH, 1024, Goal::Noise(threshold), 1.0);
        let around: Vec<_> = (3..6).flat_map(|y| (6..9).map(move |x| (x, y))).collect();
        assert_eq!(chosen(&with(0.019)), around, "0.01 is 0.02 of the root of the light");
        assert_eq!(with(0.019).expected, 64);
        assert_eq!(chosen(&with(0.021)), []);
        pixels[0].error = 1.0;
        let corner = choose(&pixels, WIDTH, 1024, Goal::Noise(0.021), 1.0);
        assert_eq!(chosen(&corner), [(0, 0), (1, 0), (0, 1), (1, 1)]);
    }

    #[test]
    fn nobody_gets_more_than_the_most_nor_less_than_the_first() {
        let mut pixels = flat();
        pixels[50].error = 1.0;
        assert_eq!(chosen(&choose(&pixels, WIDTH, 64, Goal::Noise(0.01), 1.0)), []);
        assert_eq!(chosen(&choose(&pixels, WIDTH, 64, Goal::Rmse(1e-9), 1.0)), []);
        assert_eq!(choose(&pixels, WIDTH, 80, Goal::Noise(0.01), 1.0).expected, 16);
        pixels.iter_mut().for_each(|p| *p = Progress { taken: 1, ..Progress::default() });
        assert!(!choose(&pixels, WIDTH, 1024, Goal::Rmse(1.0), 1.0).go_on.contains(&false));
    }

    /// Rounds until the model says that the target is reached; samples of all pixels.
    fn to_target(pixels: &mut [Progress], target: f64) -> u64 {
        loop {
            let rmse = (pixels.iter().map(|p| p.error).sum::<f64>() / pixels.len() as f64).sqrt();
            if rmse <= target {
                return pixels.iter().map(|p| u64::from(p.taken)).sum();
            }
            let choice = choose(pixels, WIDTH, 1 << 20, Goal::Rmse(target.max(0.5 * rmse)), 1.0);
            assert!(choice.go_on.contains(&true), "{rmse} is above {target}");
            for (p, _) in pixels.iter_mut().zip(&choice.go_on).filter(|&(_, &goes)| goes) {
                p.taken *= 2;
                p.error *= LEFT;
            }
        }
    }

    #[test]
    fn samples_go_where_the_error_is() {
        // A column of edges in a clean picture: uniform sampling needs 2^9 times 64 samples everywhere.
        let (mut pixels, mut uniform) = (flat(), flat());
        for y in 0..10 {
            pixels[y * WIDTH + 10].error = 0.1;
            uniform[y * WIDTH + 10].error = 0.1;
        }
        let target = (0.1 * LEFT.powi(9) / WIDTH as f64).sqrt() * 1.0001;
        let spent = to_target(&mut pixels, target);
        let all = uniform.len() as u64 * (64 << 9);
        assert!(spent < all / 5, "{spent} of {all}");
        assert!(spent > all / 30, "the edges alone need a twentieth");
        assert_eq!(pixels[0].taken, 64, "far from the edges nothing is to be gained");
    }

    #[test]
    fn neighbours_are_not_left_too_far_behind() {
        let mut pixels = flat();
        pixels[4 * WIDTH + 7].error = 0.1;
        to_target(&mut pixels, 1e-4);
        let (own, next, far) = (pixels[4 * WIDTH + 7], pixels[4 * WIDTH + 8], pixels[4 * WIDTH + 9]);
        assert!(
            own.taken >= 1024 && next.taken >= own.taken / (2 * BEHIND) && next.taken < own.taken,
            "{own:?} {next:?}"
        );
        assert_eq!(far.taken, 64);
    }

    #[test]
    fn an_error_that_no_pixel_shows_is_looked_for_everywhere() {
        let mut pixels = flat();
        assert!(!choose(&pixels, WIDTH, 1024, Goal::Rmse(0.1), 1.0).go_on.contains(&false));
        pixels[3].taken = 1024;
        let choice = choose(&pixels, WIDTH, 1024, Goal::Rmse(0.1), 1.0);
        assert_eq!(choice.go_on.iter().filter(|&&goes| !goes).count(), 1, "who has the most stays");
    }

    #[test]
    fn a_picture_of_equal_pixels_is_sampled_evenly() {
        let mut pixels = flat();
        pixels.iter_mut().for_each(|p| p.error = 1e-4);
        to_target(&mut pixels, 1e-3);
        assert!(pixels.iter().all(|p| p.taken == pixels[0].taken));
    }
}
