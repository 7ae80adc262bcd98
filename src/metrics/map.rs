//! A number for each pixel, made visible.

use crate::film::Film;
use crate::math::colour::linear_of_srgb8;
use rayon::prelude::*;

/// One number a pixel, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// The numbers, from 0; NaN where there is none.
    pub values: Vec<f32>,
    /// What the brightest colour stands for.
    pub brightest: f64,
}

/// Every 17th colour of "magma", by S. van der Walt and N. Smith for matplotlib, in the public domain (CC0): as lightness it is even,
/// so that equal steps of a number look like equal steps. What lies between is at most 3 steps of a byte off the original.
const MAGMA: [[u8; 3]; 16] = [
    [0, 0, 4],
    [11, 9, 36],
    [32, 17, 75],
    [59, 15, 112],
    [87, 21, 126],
    [114, 31, 129],
    [140, 41, 129],
    [168, 50, 125],
    [196, 60, 117],
    [222, 73, 104],
    [241, 96, 93],
    [250, 127, 94],
    [254, 159, 109],
    [254, 191, 132],
    [253, 222, 160],
    [252, 253, 191],
];
/// No colour of the map.
const NOTHING: [u8; 3] = [0, 255, 0];

impl Map {
    /// From black over purple to a light yellow: 0 to [`Self::brightest`]. Green where there is no number.
    #[must_use]
    pub fn coloured(&self) -> Film {
        let light = linear_of_srgb8();
        let per_unit = if self.brightest > 0.0 { 1.0 / self.brightest } else { 0.0 };
        let colour = |&v: &f32| {
            let byte = if v.is_nan() { NOTHING } else { magma(f64::from(v) * per_unit) };
            byte.map(|b| light[usize::from(b)])
        };
        self.film(self.values.par_iter().map(colour).collect())
    }

    /// The numbers themselves, as grey.
    #[must_use]
    pub fn plain(&self) -> Film {
        self.film(self.values.par_iter().map(|&v| [v; 3]).collect())
    }

    fn film(&self, color: Vec<[f32; 3]>) -> Film {
        Film { width: self.width, height: self.height, finished: color.len(), color, aovs: Vec::new() }
    }
}

/// The colour of a share from 0 to 1.
fn magma(share: f64) -> [u8; 3] {
    let at = share.clamp(0.0, 1.0) * (MAGMA.len() - 1) as f64;
    let first = (at as usize).min(MAGMA.len() - 2);
    let (low, high, part) = (MAGMA[first], MAGMA[first + 1], at - first as f64);
    std::array::from_fn(|i| {
        let (low, high) = (f64::from(low[i]), f64::from(high[i]));
        (low + (high - low) * part).round_ties_even() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::colour::{Srgb8, linear};

    #[test]
    fn the_original_s_colours_are_met() {
        // matplotlib 3.11.2, colormaps["magma"] at 0, 1, 8, 42, 93, 128, 187, 222, 254, 255 of 255.
        let original = [
            (0, [0, 0, 4]),
            (1, [1, 0, 5]),
            (8, [3, 3, 18]),
            (42, [44, 17, 95]),
            (93, [126, 36, 130]),
            (128, [183, 55, 121]),
            (187, [250, 127, 94]),
            (222, [254, 193, 133]),
            (254, [252, 251, 189]),
            (255, [252, 253, 191]),
        ];
        for (i, want) in original {
            let got = magma(f64::from(i) / 255.0);
            for (g, w) in got.into_iter().zip::<[u8; 3]>(want) {
                assert!(g.abs_diff(w) <= 3, "{i}: {got:?}, not {want:?}");
            }
        }
    }

    #[test]
    fn more_is_lighter() {
        let lightness = |i: u32| {
            let [r, g, b] = magma(f64::from(i) / 255.0).map(|c| linear(f64::from(c) / 255.0));
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        for i in 1..=255 {
            assert!(lightness(i) > lightness(i - 1), "{i}");
        }
    }

    #[test]
    fn the_scale_ends_at_the_brightest_and_what_is_no_number_is_green() {
        let map = |brightest| Map { width: 4, height: 1, values: vec![0.0, 2.0, 9.0, f32::NAN], brightest };
        let bytes = |film: &Film| film.color.iter().map(|&c| Srgb8::table().rgb(c)).collect::<Vec<_>>();
        assert_eq!(bytes(&map(2.0).coloured()), [MAGMA[0], MAGMA[15], MAGMA[15], NOTHING]);
        assert_eq!(bytes(&map(0.0).coloured()), [MAGMA[0], MAGMA[0], MAGMA[0], NOTHING]);
        assert_eq!(map(2.0).plain().color[1], [2.0; 3]);
    }
}
