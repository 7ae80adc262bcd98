//! ꟻLIP: what an eye notices when it looks at one picture and then at the other.
//!
//! Source: P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. Fairchild, "FLIP: A Difference Evaluator for
//! Alternating Images", Proceedings of the ACM on Computer Graphics and Interactive Techniques 3(2), 2020. The one
//! for pictures of low dynamic range, with all constants as given there.
//!
//! Colours are blurred as the eye's contrast sensitivity does at the given distance, and their difference is taken in a space
//! where it is even to the eye; where edges or points appear or vanish, the difference is amplified.

mod colour;
mod filters;

use super::Map;
use super::tiles::{AREA, SIDE, Tile, along_columns, along_rows};
use crate::film::{Encoding, Picture};
use crate::math::colour::linear_of_all;
use crate::math::pow01;
use crate::simd::{self, Kernel};
use filters::Filters;

/// Those of the source: 0.7 m from a screen that is 0.7 m and 3840 pixels wide.
pub const PIXELS_PER_DEGREE: f64 = 67.0;

/// Exponent of colour differences.
const COLOUR_POWER: f64 = 0.7;
/// Up to this share of the largest colour difference all is spread over [`SPREAD`] of the answer.
const KNEE: f64 = 0.4;
const SPREAD: f64 = 0.95;

/// The difference.
#[derive(Clone, Debug)]
pub struct Flip {
    /// Mean of [`Self::map`], from 0, where nothing is seen, to 1.
    pub mean: f64,
    /// The difference at each pixel, from 0 to 1.
    pub map: Map,
}

/// Compares two pictures of the same size, as a display shows them.
pub fn of(a: &Picture, b: &Picture, pixels_per_degree: f64) -> Flip {
    let filters = Filters::new(pixels_per_degree);
    let farthest = colour::farthest();
    let (width, height) = (a.width as usize, a.height as usize);
    let parts = Tile::each(width, height, |tile| {
        (tile, simd::run(Part { pictures: [a, b], tile, filters: &filters, farthest }))
    });
    let (mut sum, mut values) = (0.0, vec![0.0; width * height]);
    for (tile, errors) in parts {
        let (across, down) = tile.inside();
        for (y, row) in errors.chunks_exact(SIDE).take(down).enumerate() {
            sum += row[..across].iter().sum::<f64>();
            let to = (tile.y + y) * width + tile.x;
            values[to..to + across].iter_mut().zip(row).for_each(|(to, &error)| *to = error as f32);
        }
    }
    let map = Map { width: a.width, height: a.height, values, brightest: 1.0 };
    Flip { mean: sum / (width * height) as f64, map }
}

/// The pixels of one tile.
struct Part<'a> {
    pictures: [&'a Picture; 2],
    tile: Tile,
    filters: &'a Filters,
    /// Largest difference of two colours.
    farthest: f64,
}

impl Kernel for Part<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run(self) -> Vec<f64> {
        let a = Seen::of(self.pictures[0], self.tile, self.filters);
        let b = Seen::of(self.pictures[1], self.tile, self.filters);
        let mut errors = vec![0.0; AREA];
        let scale = 1.0 / self.farthest;
        for (i, error) in errors.iter_mut().enumerate() {
            let (dl, da, db) = (a.lightness[i] - b.lightness[i], a.red[i] - b.red[i], a.yellow[i] - b.yellow[i]);
            // Rounding must not take the farthest colours beyond 1.
            let apart = ((dl.abs() + (da * da + db * db).sqrt()) * scale).min(1.0);
            let power = pow01(apart, COLOUR_POWER);
            let below = power * (SPREAD / KNEE);
            let above = SPREAD + (power - KNEE) * ((1.0 - SPREAD) / (1.0 - KNEE));
            let colour = if power < KNEE { below } else { above };
            let (edge, point) = ((a.edges[i] - b.edges[i]).abs(), (a.points[i] - b.points[i]).abs());
            let feature = (edge.max(point) * std::f64::consts::FRAC_1_SQRT_2).min(1.0);
            *error = pow01(colour.min(1.0), 1.0 - feature.sqrt());
        }
        errors
    }
}

/// What an eye makes of each pixel of a tile.
struct Seen {
    lightness: Vec<f64>,
    red: Vec<f64>,
    yellow: Vec<f64>,
    edges: Vec<f64>,
    points: Vec<f64>,
}

impl Seen {
    #[inline(always)]
    fn of(picture: &Picture, tile: Tile, f: &Filters) -> Self {
        let [mut first, mut second, mut third] = tile.gather(picture, f.radius, SIDE + 2 * f.radius);
        if picture.encoding == Encoding::Srgb8 {
            linear_of_all(&mut first);
            linear_of_all(&mut second);
            linear_of_all(&mut third);
        }
        for i in 0..first.len() {
            [first[i], second[i], third[i]] = colour::opponent([first[i], second[i], third[i]]);
        }
        let [lightness, red, yellow] = perceived([&first, &second, &third], f);
        let smooth = along_rows(&first, &f.smooth);
        let edges = strength(&along_rows(&first, &f.slope), &smooth, &f.slope, &f.smooth);
        let points = strength(&along_rows(&first, &f.bend), &smooth, &f.bend, &f.smooth);
        Self { lightness, red, yellow, edges, points }
    }
}

/// Opponent colours, blurred, as they are perceived.
#[inline(always)]
fn perceived([light, red, blue]: [&[f64]; 3], f: &Filters) -> [Vec<f64>; 3] {
    let [(near_share, near), (far_share, far)] = &f.blue_yellow;
    let (mut first, mut second) = (blurred(light, &f.achromatic), blurred(red, &f.red_green));
    let (mut third, far) = (blurred(blue, near), blurred(blue, far));
    for i in 0..AREA {
        let blue = near_share * third[i] + far_share * far[i];
        [first[i], second[i], third[i]] = colour::perceived(colour::displayed([first[i], second[i], blue]));
    }
    [first, second, third]
}

#[inline(always)]
fn blurred(plane: &[f64], taps: &[f64]) -> Vec<f64> {
    along_columns(&along_rows(plane, taps), taps)
}

/// Length of what a derivative answers in both directions; `rows` and `smooth` are its answer and the Gaussian's along
/// rows.
#[inline(always)]
fn strength(rows: &[f64], smooth: &[f64], derivative: &[f64], gaussian: &[f64]) -> Vec<f64> {
    // From the opponent space's scale to 0 to 1; derivatives sum to 0, so that its offset does not matter.
    const SCALE: f64 = 1.0 / 116.0;
    let mut strength = along_columns(rows, gaussian);
    let down = along_columns(smooth, derivative);
    for (x, y) in strength.iter_mut().zip(&down) {
        *x = (*x * *x + y * y).sqrt() * SCALE;
    }
    strength
}
