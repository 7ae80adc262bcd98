//! Structural similarity.
//!
//! Source: Z. Wang, A. Bovik, H. Sheikh, E. Simoncelli, "Image Quality Assessment: From Error Visibility to Structural
//! Similarity", IEEE Transactions on Image Processing 13(4), 2004: a Gaussian window of 11x11 with a standard
//! deviation of 1.5, `C1 = (0.01 L)²`, `C2 = (0.03 L)²`, the mean over all windows that lie in the picture.

use super::tiles::{SIDE, Tile, along_columns, along_rows};
use crate::film::{Encoding, Picture};
use crate::math::colour::srgb_of_all;
use crate::simd::{self, Kernel};

/// Pixels to a side of the window.
const WINDOW: usize = 11;
const SIGMA: f64 = 1.5;
/// Pixels to a side of a part with its margin.
const LONG: usize = SIDE + WINDOW - 1;
/// The luma runs from 0 to 1.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// The mean over all windows, of the luma as a display shows the pictures; nothing where no window fits.
pub fn of(a: &Picture, b: &Picture) -> Option<f64> {
    let windows = |side: u32| (side as usize + 1).checked_sub(WINDOW).filter(|n| *n > 0);
    let (width, height) = (windows(a.width)?, windows(a.height)?);
    let taps = window();
    let sums = Tile::each(width, height, |tile| simd::run(Part { a, b, tile, taps: &taps }));
    Some(sums.iter().sum::<f64>() / (width * height) as f64)
}

/// One row of the Gaussian, which sums to 1.
fn window() -> [f64; WINDOW] {
    let weight = |i: usize| (-0.5 * ((i as f64 - (WINDOW / 2) as f64) / SIGMA).powi(2)).exp();
    let weights: [f64; WINDOW] = std::array::from_fn(weight);
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}

/// Windows that begin in one tile.
struct Part<'a> {
    a: &'a Picture,
    b: &'a Picture,
    tile: Tile,
    taps: &'a [f64; WINDOW],
}

impl Kernel for Part<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let (a, b) = (lumas(self.a, self.tile), lumas(self.b, self.tile));
        let (mean_a, mean_b) = (mean(&a, self.taps), mean(&b, self.taps));
        let aa = mean(&product(&a, &a), self.taps);
        let bb = mean(&product(&b, &b), self.taps);
        let ab = mean(&product(&a, &b), self.taps);
        let (across, down) = self.tile.inside();
        let mut sum = 0.0;
        for y in 0..down {
            for i in y * SIDE..y * SIDE + across {
                let (ma, mb) = (mean_a[i], mean_b[i]);
                let (va, vb, covariance) = (aa[i] - ma * ma, bb[i] - mb * mb, ab[i] - ma * mb);
                sum += (2.0 * ma * mb + C1) * (2.0 * covariance + C2) / ((ma * ma + mb * mb + C1) * (va + vb + C2));
            }
        }
        sum
    }
}

/// ITU-R BT.709 weights, on values of the sRGB curve.
#[inline(always)]
fn lumas(of: &Picture, tile: Tile) -> Vec<f64> {
    let [mut red, mut green, mut blue] = tile.gather(of, 0, LONG);
    if of.encoding == Encoding::Linear {
        srgb_of_all(&mut red);
        srgb_of_all(&mut green);
        srgb_of_all(&mut blue);
    }
    for i in 0..red.len() {
        red[i] = 0.2126 * red[i] + 0.7152 * green[i] + 0.0722 * blue[i];
    }
    red
}

#[inline(always)]
fn mean(values: &[f64], taps: &[f64]) -> Vec<f64> {
    along_columns(&along_rows(values, taps), taps)
}

#[inline(always)]
fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = a.to_vec();
    for (p, b) in product.iter_mut().zip(b) {
        *p *= b;
    }
    product
}
