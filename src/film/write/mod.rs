//! Images as files.
//!
//! The same film gives the same bytes, with any number of threads: nothing in a file tells
//! the time, the place or who made it.

mod exr;
mod float;
mod png;
mod visible;

use super::save::{SaveError, Sink, save};
use super::{Aov, AovImage, Display, Film, Format, Tonemap};
use ::image::{ExtendedColorType, ImageEncoder, codecs};
use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

/// What is noted in a file that has room for it (PNG, EXR).
#[derive(Clone, Debug, Default)]
pub struct Notes {
    /// The program and its version.
    pub software: String,
    /// Name of what is shown.
    pub title: String,
    /// Settings that the pixels depend on.
    pub comment: String,
    /// What is known of how wrong they can be.
    pub error: String,
}

/// The files that [`save_all`] writes: the colours first, then each auxiliary image that
/// has a file of its own.
#[must_use]
pub fn files(path: &Path, format: Format, aovs: &[Aov]) -> Vec<PathBuf> {
    let own = if format.holds_aovs() { &[] } else { aovs };
    std::iter::once(path.to_owned()).chain(own.iter().map(|&kind| aov_path(path, kind))).collect()
}

/// Writes a film as files, each whole or not at all; returns their names and sizes in bytes.
///
/// # Errors
///
/// As [`save`], at the first file that fails.
pub fn save_all(
    film: &Film,
    path: &Path,
    format: Format,
    display: &Display,
    notes: &Notes,
) -> Result<Vec<(PathBuf, u64)>, SaveError> {
    let bytes = save(path, |out| encode(film, format, display, notes, out))?;
    let mut written = vec![(path.to_owned(), bytes)];
    let own: &[AovImage] = if format.holds_aovs() { &[] } else { &film.aovs };
    for aov in own {
        let path = aov_path(path, aov.kind);
        let bytes = save(&path, |out| encode_aov(film, aov, format, display, notes, out))?;
        written.push((path, bytes));
    }
    Ok(written)
}

/// Writes the colours; for [`Format::Exr`] all auxiliary images too.
///
/// # Errors
///
/// Those of the sink, and of the format (a JPEG has at most 65535 pixels a side).
pub fn encode(film: &Film, format: Format, display: &Display, notes: &Notes, out: &mut dyn Sink) -> io::Result<()> {
    let (width, height) = (film.width, film.height);
    match format {
        Format::Exr => {
            let aovs = film.aovs.iter().flat_map(exr::aov_channels);
            exr::write(width, height, exr::color_channels(&film.color).into_iter().chain(aovs), notes, out)
        }
        Format::Hdr => float::hdr(width, height, &film.color, out),
        Format::Pfm => float::pfm(width, 3, film.color.as_flattened(), out),
        _ => {
            // Stretched values are on no curve that a viewer knows.
            let meaning = if display.tonemap == Tonemap::Stretch { Meaning::Data } else { Meaning::Colour };
            eight_bit(width, height, &display.bytes(&film.color), meaning, format, notes, out)
        }
    }
}

/// Writes one auxiliary image.
///
/// PFM and EXR hold the values themselves (in PFM ids are the floats object, primitive, 0, exact up to 2^24). The others
/// show them: `visible` says how.
fn encode_aov(
    film: &Film,
    aov: &AovImage,
    format: Format,
    display: &Display,
    notes: &Notes,
    out: &mut dyn Sink,
) -> io::Result<()> {
    let (width, height) = (film.width, film.height);
    match format {
        Format::Exr => exr::write(width, height, exr::aov_channels(aov), notes, out),
        Format::Pfm if aov.kind == Aov::Id => {
            let padded: Vec<[f32; 3]> = aov
                .data
                .as_chunks()
                .0
                .iter()
                .map(|&[object, prim]| [object.to_bits() as f32, prim.to_bits() as f32, 0.0])
                .collect();
            float::pfm(width, 3, padded.as_flattened(), out)
        }
        Format::Pfm => float::pfm(width, aov.kind.channels(), &aov.data, out),
        Format::Hdr => float::hdr(width, height, &visible::linear(aov), out),
        _ => {
            let meaning = if aov.kind == Aov::Albedo { Meaning::Colour } else { Meaning::Data };
            eight_bit(width, height, &visible::bytes(aov, display), meaning, format, notes, out)
        }
    }
}

/// `a/b.png` and depth give `a/b.depth.png`.
fn aov_path(path: &Path, kind: Aov) -> PathBuf {
    let mut extension = OsString::from(kind.name());
    if let Some(old) = path.extension() {
        extension.push(".");
        extension.push(old);
    }
    path.with_extension(extension)
}

/// What 8-bit values are: light on the sRGB curve, or numbers that no viewer should bend.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Meaning {
    Colour,
    Data,
}

fn eight_bit(
    width: u32,
    height: u32,
    pixels: &[[u8; 3]],
    meaning: Meaning,
    format: Format,
    notes: &Notes,
    mut out: &mut dyn Sink,
) -> io::Result<()> {
    let bytes = pixels.as_flattened();
    let rgb = ExtendedColorType::Rgb8;
    match format {
        Format::Ppm => {
            write!(out, "P6\n{width} {height}\n255\n")?;
            out.write_all(bytes)
        }
        Format::Jpeg => codecs::jpeg::JpegEncoder::new_with_quality(&mut out, 95)
            .write_image(bytes, width, height, rgb)
            .map_err(io::Error::other),
        Format::Bmp => {
            codecs::bmp::BmpEncoder::new(&mut out).write_image(bytes, width, height, rgb).map_err(io::Error::other)
        }
        _ => png::write(width, height, bytes, meaning, notes, out),
    }
}

#[cfg(test)]
mod tests;
