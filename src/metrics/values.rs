//! Figures that look at each pixel by itself.

use crate::film::Encoding;
use rayon::prelude::*;

/// Pixels that one task adds up. The figures depend on it in their last digits.
const CHUNK: usize = 1 << 14;
/// Keeps relative errors of the dark finite, in light from 0 to 1.
const DARK: f64 = 1e-2;

/// How each value differs. Linear light is taken as it is, sRGB from 0 to 255, but for [`relmse`](Self::relmse) and
/// [`smape`](Self::smape), which take it from 0 to 1.
///
/// Pixels that are not finite in both pictures are left out; where that leaves none, means are NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values {
    /// Root of the mean of the squared differences, over all pixels and channels.
    pub rmse: f64,
    /// Largest difference of any channel.
    pub max: f64,
    /// `20 log10(white / rmse)` in dB, where white is 255, or 1 of linear light; infinite where nothing differs.
    pub psnr: f64,
    /// Mean of `(a - b)² / (b² + 0.01)`.
    pub relmse: f64,
    /// The same without the 0.1 % of pixels (rounded down) where it is largest: a few fireflies do not decide.
    pub relmse_trimmed: f64,
    /// Mean of `|a - b| / (|a| + |b| + 0.01)`, from 0 to 1.
    ///
    /// Source: T. Vogels et al., "Denoising with Kernel Prediction and Asymmetric Loss Functions", SIGGRAPH 2018.
    pub smape: f64,
    /// Share of pixels with a channel that is off by more than 1/255 of white.
    pub beyond_1_255: f64,
    /// Pixels that differ at all, or are not finite in just one of the pictures, or in another way.
    pub differing: u64,
    /// Pixels that are not finite in at least one of the pictures, and so are left out.
    pub non_finite: u64,
    /// Of those, the ones that are not the same in both.
    pub non_finite_differing: u64,
    /// What is not finite in each picture.
    pub non_finite_in: [NonFinite; 2],
}

impl Values {
    /// Whether every pixel is the same in both pictures, NaN and infinities included.
    #[must_use]
    pub fn identical(&self) -> bool {
        self.differing == 0
    }
}

/// Pixels of one picture that are not finite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NonFinite {
    /// Those with a NaN.
    pub nan: u64,
    /// Others with an infinity.
    pub infinite: u64,
    /// The first of them: column and row.
    pub first: Option<(u32, u32)>,
}

impl NonFinite {
    /// All of them.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        self.nan + self.infinite
    }

    fn see(&mut self, pixel: [f32; 3], place: impl Fn() -> (u32, u32)) {
        if pixel.iter().all(|v| v.is_finite()) {
            return;
        }
        let nan = pixel.iter().any(|v| v.is_nan());
        *(if nan { &mut self.nan } else { &mut self.infinite }) += 1;
        self.first.get_or_insert_with(place);
    }

    fn and(self, later: Self) -> Self {
        Self { nan: self.nan + later.nan, infinite: self.infinite + later.infinite, first: self.first.or(later.first) }
    }
}

/// What is added up.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    finite: u64,
    squares: f64,
    relative: f64,
    symmetric: f64,
    max: f64,
    beyond: u64,
    differing: u64,
    non_finite_differing: u64,
    non_finite_in: [NonFinite; 2],
}

impl Sums {
    fn and(self, later: Self) -> Self {
        let [a, b] = self.non_finite_in;
        Self {
            finite: self.finite + later.finite,
            squares: self.squares + later.squares,
            relative: self.relative + later.relative,
            symmetric: self.symmetric + later.symmetric,
            max: self.max.max(later.max),
            beyond: self.beyond + later.beyond,
            differing: self.differing + later.differing,
            non_finite_differing: self.non_finite_differing + later.non_finite_differing,
            non_finite_in: [a.and(later.non_finite_in[0]), b.and(later.non_finite_in[1])],
        }
    }

    /// One pixel more; returns its largest difference and its relative error, neither if it is not finite.
    fn see(&mut self, a: [f32; 3], b: [f32; 3], unit: f64, place: impl Fn() -> (u32, u32)) -> Option<(f64, f64)> {
        if !a.iter().chain(&b).all(|v| v.is_finite()) {
            self.non_finite_in[0].see(a, &place);
            self.non_finite_in[1].see(b, &place);
            let same = a.iter().zip(&b).all(|(a, b)| a == b || (a.is_nan() && b.is_nan()));
            self.differing += u64::from(!same);
            self.non_finite_differing += u64::from(!same);
            return None;
        }
        let (mut largest, mut relative) = (0f64, 0.0);
        for (a, b) in a.into_iter().zip(b) {
            let (a, b) = (f64::from(a), f64::from(b));
            let d = a - b;
            self.squares += d * d;
            largest = largest.max(d.abs());
            let (a, b, d) = (a * unit, b * unit, d * unit);
            relative += d * d / (b * b + DARK) / 3.0;
            self.symmetric += d.abs() / (a.abs() + b.abs() + DARK);
        }
        self.finite += 1;
        self.relative += relative;
        self.max = self.max.max(largest);
        self.beyond += u64::from(largest * unit > 1.0 / 255.0);
        self.differing += u64::from(largest > 0.0);
        Some((largest, relative))
    }
}

/// The figures of two pictures `width` pixels wide, and the largest difference of each pixel, NaN where it is not finite.
pub fn of(a: &[[f32; 3]], b: &[[f32; 3]], width: u32, encoding: Encoding) -> (Values, Vec<f32>) {
    let unit = unit(encoding);
    let parts: Vec<_> = (a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)).enumerate())
        .map(|(i, (part_a, part_b))| {
            let mut sums = Sums::default();
            let (mut largest, mut relative) = (Vec::with_capacity(part_a.len()), Vec::with_capacity(part_a.len()));
            for (k, (&a, &b)) in part_a.iter().zip(part_b).enumerate() {
                let seen = sums.see(a, b, unit, || place(i * CHUNK + k, width));
                largest.push(seen.map_or(f32::NAN, |(largest, _)| largest as f32));
                relative.extend(seen.map(|(_, relative)| relative));
            }
            (sums, largest, relative)
        })
        .collect();
    let sums = parts.iter().fold(Sums::default(), |all, part| all.and(part.0));
    let relative = parts.iter().flat_map(|part| &part.2).copied().collect();
    let values = values(&sums, trimmed(relative), a.len() as u64, unit);
    (values, parts.into_iter().flat_map(|part| part.1).collect())
}

fn values(sums: &Sums, relmse_trimmed: f64, pixels: u64, unit: f64) -> Values {
    let finite = sums.finite as f64;
    let rmse = (sums.squares / (3.0 * finite)).sqrt();
    Values {
        rmse,
        max: if sums.finite == 0 { f64::NAN } else { sums.max },
        psnr: -20.0 * (rmse * unit).log10(),
        relmse: sums.relative / finite,
        relmse_trimmed,
        smape: sums.symmetric / (3.0 * finite),
        beyond_1_255: sums.beyond as f64 / finite,
        differing: sums.differing,
        non_finite: pixels - sums.finite,
        non_finite_differing: sums.non_finite_differing,
        non_finite_in: sums.non_finite_in,
    }
}

/// What brings white to 1.
fn unit(encoding: Encoding) -> f64 {
    match encoding {
        Encoding::Linear => 1.0,
        Encoding::Srgb8 => 1.0 / 255.0,
    }
}

fn place(index: usize, width: u32) -> (u32, u32) {
    // Both are below the sides of the picture.
    ((index % width as usize) as u32, (index / width as usize) as u32)
}

/// The mean without the largest thousandth.
fn trimmed(values: Vec<f64>) -> f64 {
    let kept = values.len() - values.len() / 1000;
    if kept == values.len() {
        return sum(&values, f64::INFINITY).0 / kept as f64;
    }
    let mut order = values.clone();
    let (_, &mut largest_kept, _) = order.select_nth_unstable_by(kept - 1, f64::total_cmp);
    // In the order of the pixels, so that it does not matter how the selection shuffles.
    let (below, count) = sum(&values, largest_kept);
    (below + (kept - count) as f64 * largest_kept) / kept as f64
}

/// Sum and number of the values less than `limit`.
fn sum(values: &[f64], limit: f64) -> (f64, usize) {
    let below = values.iter().filter(|v| **v < limit);
    below.fold((0.0, 0), |(sum, count), v| (sum + v, count + 1))
}
