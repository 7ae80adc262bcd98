//! How far two pictures are apart, in figures and as a picture. Knows `math` and `film`.
//!
//! The second picture, B, is the reference. Every figure is a sum in f64 over parts of fixed size, added up in a
//! fixed order: the same for any number of threads.

mod difference;
mod flip;
mod map;
mod ssim;
mod tiles;
mod values;

pub use difference::Difference;
pub use flip::{Flip, PIXELS_PER_DEGREE};
pub use map::Map;
pub use values::{NonFinite, Values};

use crate::film::{Encoding, Picture};

/// Why two pictures cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum Error {
    #[error("pictures of {}x{} and {}x{} pixels cannot be compared: they must be of the same size", a.0, a.1, b.0, b.1)]
    Size { a: (u32, u32), b: (u32, u32) },
    #[error("{0} pixels per degree: at least 1 and at most 1000 make sense")]
    PixelsPerDegree(f64),
}

/// What comparing two pictures gives.
#[derive(Clone, Debug)]
pub struct Report {
    /// How the pixels were compared: [`Encoding::Linear`] if both are, else as sRGB from 0 to 255.
    pub encoding: Encoding,
    /// Whether only one of them was linear, so that it was turned into [`Encoding::Srgb8`].
    pub mixed: bool,
    /// Pixel by pixel.
    pub values: Values,
    /// Mean structural similarity of the luma, 1 for equal pictures; nothing where a side is shorter than its
    /// window of 11 pixels.
    pub ssim: Option<f64>,
    /// What an eye sees when it looks at one and then at the other.
    pub flip: Flip,
    /// Largest difference of each pixel's channels.
    pub largest: Map,
}

/// Compares `a` with the reference `b`, both seen with so many pixels to a degree of the eye's field.
///
/// A pixel that is not finite in one of them is left out of [`Values`] and counted there; SSIM and FLIP see what a
/// display shows, NaN as black and infinity as white.
///
/// # Errors
/// The sizes differ, or the pixels per degree are out of range.
pub fn compare(a: &Picture, b: &Picture, pixels_per_degree: f64) -> Result<Report, Error> {
    let size = |p: &Picture| (p.width, p.height);
    if size(a) != size(b) {
        return Err(Error::Size { a: size(a), b: size(b) });
    }
    if !(1.0..=1000.0).contains(&pixels_per_degree) {
        return Err(Error::PixelsPerDegree(pixels_per_degree));
    }
    if a.encoding != b.encoding {
        let [a, b] = [a, b].map(|p| p.clone().into_srgb8());
        return compare(&a, &b, pixels_per_degree).map(|report| Report { mixed: true, ..report });
    }
    let (values, largest) = values::of(&a.pixels, &b.pixels, a.width, a.encoding);
    let brightest = if values.max.is_nan() { 0.0 } else { values.max };
    let largest = Map { width: a.width, height: a.height, values: largest, brightest };
    Ok(Report {
        encoding: a.encoding,
        mixed: false,
        values,
        ssim: ssim::of(a, b),
        flip: flip::of(a, b, pixels_per_degree),
        largest,
    })
}
