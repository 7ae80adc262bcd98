//! Pictures in square parts with a margin, and sums over the neighbourhoods of their pixels.
//!
//! What is marked `#[inline(always)]` runs in a [`Kernel`](crate::simd::Kernel). It has plain loops: a closure
//! would be compiled for the baseline.

use crate::film::{Encoding, Picture};
use rayon::prelude::*;

/// Pixels to a side of a part.
pub const SIDE: usize = 64;
/// Pixels of a part.
pub const AREA: usize = SIDE * SIDE;
/// Sums that are made at a time.
const LANES: usize = 16;

/// A part of a picture of `width` by `height`: `SIDE` pixels to a side, of which those at the right and at the bottom may lie
/// beyond it.
#[derive(Clone, Copy, Debug)]
pub struct Tile {
    pub x: usize,
    pub y: usize,
    pub width: usize,
    pub height: usize,
}

impl Tile {
    /// Calls `work` for all parts on all threads; the answers are row by row.
    pub fn each<T: Send>(width: usize, height: usize, work: impl Fn(Self) -> T + Sync) -> Vec<T> {
        let (across, down) = (width.div_ceil(SIDE), height.div_ceil(SIDE));
        let tile = |i: usize| Self { x: i % across * SIDE, y: i / across * SIDE, width, height };
        (0..across * down).into_par_iter().map(|i| work(tile(i))).collect()
    }

    /// Red, green and blue of `long` by `long` pixels, of which the tile's first has `margin` before it in both
    /// directions: from 0 to 1 as a display shows them, NaN as 0. Beyond the picture its outermost pixels go on.
    #[expect(clippy::manual_clamp, reason = "of NaN and 0 `max` takes 0, where `clamp` keeps the NaN")]
    #[inline(always)]
    pub fn gather(&self, of: &Picture, margin: usize, long: usize) -> [Vec<f64>; 3] {
        let (width, height) = (of.width as usize, of.height as usize);
        let unit = if of.encoding == Encoding::Linear { 1.0 } else { 1.0 / 255.0 };
        let mut planes = [vec![0.0; long * long], vec![0.0; long * long], vec![0.0; long * long]];
        let [red, green, blue] = &mut planes;
        for y in 0..long {
            let row = (self.y + y).saturating_sub(margin).min(height - 1);
            let row = &of.pixels[row * width..][..width];
            let to = y * long..(y + 1) * long;
            let (red, green, blue) = (&mut red[to.clone()], &mut green[to.clone()], &mut blue[to]);
            for x in 0..long {
                let pixel = row[(self.x + x).saturating_sub(margin).min(width - 1)];
                red[x] = (f64::from(pixel[0]) * unit).max(0.0).min(1.0);
                green[x] = (f64::from(pixel[1]) * unit).max(0.0).min(1.0);
                blue[x] = (f64::from(pixel[2]) * unit).max(0.0).min(1.0);
            }
        }
        planes
    }

    /// Columns and rows that lie in the picture.
    pub fn inside(&self) -> (usize, usize) {
        (SIDE.min(self.width - self.x), SIDE.min(self.height - self.y))
    }
}

/// Sums along rows of `SIDE + taps.len() - 1` numbers: number `x` of an answer is the sum of `taps[k] * row[x + k]`.
#[inline(always)]
pub fn along_rows(rows: &[f64], taps: &[f64]) -> Vec<f64> {
    let long = SIDE + taps.len() - 1;
    let mut out = vec![0.0; rows.len() / long * SIDE];
    for (to, row) in out.chunks_exact_mut(SIDE).zip(rows.chunks_exact(long)) {
        for (i, to) in to.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
            *to = weighted(&row[i * LANES..], 1, taps);
        }
    }
    out
}

/// The same along columns of `SIDE + taps.len() - 1` rows of `SIDE` numbers.
#[inline(always)]
pub fn along_columns(rows: &[f64], taps: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; AREA];
    for (i, to) in out.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        *to = weighted(&rows[i * LANES..], SIDE, taps);
    }
    out
}

/// Sums of `taps[k] * from[k * step + i]` for so many `i` as are held in registers at a time.
#[inline(always)]
fn weighted(from: &[f64], step: usize, taps: &[f64]) -> [f64; LANES] {
    let mut sum = [0.0; LANES];
    for (k, tap) in taps.iter().enumerate() {
        let values = &from[k * step..k * step + LANES];
        for i in 0..LANES {
            sum[i] += tap * values[i];
        }
    }
    sum
}
