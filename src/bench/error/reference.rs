//! The picture that the others are compared with, and its own noise.

use super::Progress;
use super::subject::Subject;
use crate::backend::BackendKind;
use crate::film::{Encoding, Film, Picture};
use crate::render::{self, Job};

/// Parts of the reference that are rendered with seeds of their own.
pub const BLOCKS: u32 = 4;
/// Of the blocks; no candidate has one of these.
const FIRST_SEED: u32 = 0x7ef0_0000;

/// The mean of all blocks.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Samples a pixel of each block.
    pub spp: u32,
    /// Linear RGB.
    pub picture: Picture,
    /// Each pixel's variance of the mean, channel by channel, as the spread between the blocks tells.
    variance: Vec<[f64; 3]>,
    /// RMSE of the picture itself, from that.
    pub noise: f64,
    /// Of each pixel: whether it is smooth; of none if there are too few to tell about.
    smooth: Vec<bool>,
    /// RMSE of the smooth pixels themselves; NaN if there are none.
    pub noise_smooth: f64,
}

impl Reference {
    /// Renders the blocks with the native backend: shading in f64, the whole tree of rays up to the scene's depth, the
    /// same number of samples everywhere. Nothing if it was stopped.
    ///
    /// # Errors
    /// A sentence, if the camera cannot be used.
    pub fn render(subject: &Subject, spp: u32, progress: &Progress<'_>) -> Result<Option<Self>, String> {
        let control = progress.watch.control;
        let mut blocks = Vec::new();
        for block in 0..BLOCKS {
            progress.begin(subject.pixels(), spp);
            let job = Job { spp, seed: FIRST_SEED + block, min_weight: 0.0, ..subject.job.clone() };
            let backend = subject.backend(BackendKind::Native);
            let film = render::run(&subject.scene, &subject.camera, backend, &job, control)?.film;
            if control.is_cancelled() {
                return Ok(None);
            }
            blocks.push(film);
        }
        Ok(Some(Self::of(&blocks, spp)))
    }

    /// The mean of films of one size, summed in f64.
    fn of(blocks: &[Film], spp: u32) -> Self {
        let n = blocks.len() as f64;
        let first = &blocks[0];
        let values = |i: usize, k: usize| blocks.iter().map(move |b| f64::from(b.color[i][k]));
        let (mut pixels, mut variance) = (Vec::new(), Vec::new());
        for i in 0..first.color.len() {
            let mean: [f64; 3] = std::array::from_fn(|k| values(i, k).sum::<f64>() / n);
            let squares = |k: usize| values(i, k).map(|v| (v - mean[k]).powi(2)).sum::<f64>();
            variance.push(std::array::from_fn(|k| squares(k) / (n - 1.0) / n));
            pixels.push(mean.map(|v| v as f32));
        }
        let (width, height) = (first.width, first.height);
        let picture = Picture { width, height, encoding: Encoding::Linear, pixels, transparent: false };
        let all = vec![true; variance.len()];
        let noise = root_mean(&variance, &all);
        Self { spp, picture, variance, noise, smooth: Vec::new(), noise_smooth: f64::NAN }
    }

    /// The same, knowing which pixels are smooth. Fewer than one in a hundred are not looked at.
    pub fn with_smooth(self, mut smooth: Vec<bool>) -> Self {
        const FEW: usize = 100;
        if FEW * smooth.iter().filter(|&&s| s).count() < smooth.len() {
            smooth.fill(false);
        }
        Self { noise_smooth: root_mean(&self.variance, &smooth), smooth, ..self }
    }

    /// Share of the pixels that are smooth.
    pub fn smooth_share(&self) -> f64 {
        self.smooth.iter().filter(|&&s| s).count() as f64 / self.smooth.len().max(1) as f64
    }

    /// RMSE of the smooth pixels of `film`; NaN if there are none.
    pub fn rmse_of_smooth(&self, film: &Film) -> f64 {
        let pairs = film.color.iter().zip(&self.picture.pixels);
        let square =
            |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|k| (f64::from(a[k]) - f64::from(b[k])).powi(2));
        root_mean(&pairs.map(square).collect::<Vec<[f64; 3]>>(), &self.smooth)
    }
}

/// Root of the mean of the pixels that `of` names; NaN if there are none.
fn root_mean(squares: &[[f64; 3]], of: &[bool]) -> f64 {
    let chosen = || squares.iter().zip(of).filter(|(_, of)| **of).map(|(s, _)| s);
    (chosen().flatten().sum::<f64>() / (3 * chosen().count()) as f64).sqrt()
}

/// What is left of a measured RMSE without the reference's `noise`: the two are independent, so their squares add up.
pub fn without_noise(measured: f64, noise: f64) -> f64 {
    (measured * measured - noise * noise).max(0.0).sqrt()
}

/// Whether that is less than the noise itself, so that it says little.
pub fn is_lost(measured: f64, noise: f64) -> bool {
    without_noise(measured, noise) < noise
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    fn film(color: Vec<[f32; 3]>) -> Film {
        Film { width: color.len() as u32, height: 1, finished: color.len(), color, aovs: vec![] }
    }

    #[test]
    fn mean_and_noise_by_hand() {
        let blocks = [1.0, 2.0, 3.0, 6.0].map(|v| film(vec![[v, 0.5, 0.0], [1.0; 3]]));
        let r = Reference::of(&blocks, 8);
        assert_eq!(r.picture.pixels, [[3.0, 0.5, 0.0], [1.0; 3]]);
        // Squares 4, 1, 0, 9: a variance of 14 / 3, a quarter of it for the mean, one of six values.
        assert!((r.noise - (14.0f64 / 3.0 / 4.0 / 6.0).sqrt()).abs() < 1e-15);
        let r = r.with_smooth(vec![false, true]);
        assert_eq!((r.noise_smooth, r.smooth_share()), (0.0, 0.5));
        assert!((r.rmse_of_smooth(&film(vec![[9.0; 3], [1.5, 1.0, 1.0]])) - (0.25f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!(r.with_smooth(vec![false; 2]).rmse_of_smooth(&blocks[0]).is_nan());
        let many = [0.0, 1.0].map(|v| film(vec![[v; 3]; 200]));
        let r = Reference::of(&many, 1);
        let first = |n| (0..200).map(|i| i < n).collect::<Vec<_>>();
        assert_eq!(r.clone().with_smooth(first(2)).smooth_share(), 0.01);
        assert_eq!(r.with_smooth(first(1)).smooth_share(), 0.0, "one of 200 is too few");
    }

    #[test]
    fn the_noise_that_is_told_is_the_noise_that_there_is() {
        let mut random = Random(5);
        let mut noisy =
            |spread: f64| film((0..20_000).map(|_| [0; 3].map(|_| (0.5 + spread * random.signed()) as f32)).collect());
        let blocks: Vec<Film> = (0..BLOCKS).map(|_| noisy(0.1)).collect();
        let r = Reference::of(&blocks, 1);
        let squares: Vec<[f64; 3]> = r.picture.pixels.iter().map(|p| p.map(|v| (f64::from(v) - 0.5).powi(2))).collect();
        let all = vec![true; squares.len()];
        let real = root_mean(&squares, &all);
        assert!((r.noise / real - 1.0).abs() < 0.02, "{} told, {real} real", r.noise);
        // And what is measured against it is right without it.
        let candidate = noisy(0.05);
        let r = r.with_smooth(all);
        let own = without_noise(r.rmse_of_smooth(&candidate), r.noise);
        assert!((own / (0.05 / 3f64.sqrt()) - 1.0).abs() < 0.02, "{own}");
    }
}
