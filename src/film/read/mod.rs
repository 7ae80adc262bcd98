//! Image files as pictures in memory.
//!
//! What kind a file is, its first bytes say, not its name.

mod decode;
mod exr;
mod pfm;

pub(crate) use decode::Decoder;

use crate::math::colour::Srgb8;
use image::DynamicImage;
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::{Path, PathBuf};

/// What the numbers of a picture mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// Linear light; any number, NaN and infinities too.
    Linear,
    /// The sRGB curve, from 0 to 255, whole numbers where the file has 8 bits.
    Srgb8,
}

impl Encoding {
    /// The name in figures for programs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Srgb8 => "srgb8",
        }
    }
}

/// An image as a file has it, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// What the numbers mean.
    pub encoding: Encoding,
    /// Red, green, blue; grey has all three alike.
    pub pixels: Vec<[f32; 3]>,
    /// Whether the file has a pixel that something would show through. [`Encoding::Srgb8`] is then as seen over
    /// black; linear light is so by definition.
    pub transparent: bool,
}

impl Picture {
    /// The 8-bit picture that tison writes of it: the exact sRGB curve, cut off at 0 and 1, rounded; NaN is black.
    /// One that is on the curve already stays as it is.
    #[must_use]
    pub fn into_srgb8(mut self) -> Self {
        if self.encoding == Encoding::Linear {
            let table = Srgb8::table();
            self.pixels.par_iter_mut().for_each(|p| *p = table.rgb(*p).map(f32::from));
            self.encoding = Encoding::Srgb8;
        }
        self
    }

    /// The part from `(x0, y0)` to before `(x1, y1)`.
    ///
    /// # Panics
    /// If it is empty or reaches beyond the picture.
    #[must_use]
    pub fn crop(&self, (x0, y0): (u32, u32), (x1, y1): (u32, u32)) -> Self {
        assert!(x0 < x1 && x1 <= self.width && y0 < y1 && y1 <= self.height, "the part lies in the picture");
        let rows = self.pixels.chunks_exact(self.width as usize);
        let rows = rows.take(y1 as usize).skip(y0 as usize);
        let pixels = rows.flat_map(|row| &row[x0 as usize..x1 as usize]).copied().collect();
        Self { width: x1 - x0, height: y1 - y0, pixels, ..*self }
    }
}

/// Why a picture was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum ReadError {
    #[error("cannot read {}", path.display())]
    Open {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    #[error("{} {what}", path.display())]
    Bad { path: PathBuf, what: String },
    #[error("{} has no layer '{layer}', but {there}", path.display())]
    NoLayer { path: PathBuf, layer: String, there: String },
}

/// Longest file.
const LONGEST: u64 = 2 << 30;
/// Most bytes that the numbers of a file may take in memory.
const MOST_MEMORY: u64 = 2 << 30;

/// Other formats than those of [`exr`] and [`pfm`].
const DECODER: Decoder = Decoder { kinds: "PNG, JPEG, BMP, HDR, PNM, PFM or EXR", most_memory: MOST_MEMORY };

/// Reads the picture at `path`: EXR, Radiance HDR and PFM as linear light; PNG (8 and 16 bits), JPEG, BMP and PNM
/// (8 and 16 bits) as sRGB from 0 to 255. Colour profiles and gamma tags are not looked at. Transparent 8-bit
/// pictures are composed on black, in sRGB as viewers do.
///
/// Of an EXR the colours are taken, `R G B` or else the grey `Y`; `layer` names other channels: a part, what stands before the
/// dot, or a channel alone (`albedo`, `normal`, `depth`, `hits`, … as tison writes them). Other formats have no layers.
///
/// # Errors
/// The file cannot be opened, is none of these, is cut off or damaged, too large, or has not that layer.
pub fn read(path: &Path, layer: Option<&str>) -> Result<Picture, ReadError> {
    let bytes = contents(path)?;
    let bad = |what| ReadError::Bad { path: path.to_owned(), what };
    if exr::is_exr(&bytes) {
        return exr::read(&bytes, layer).map_err(|e| match (e, layer) {
            (exr::Error::NoLayer(there), Some(layer)) => {
                ReadError::NoLayer { path: path.to_owned(), layer: layer.to_owned(), there }
            }
            (exr::Error::NoLayer(there), None) => bad(format!("has no colours, but {there}: name a layer")),
            (exr::Error::Bad(what), _) => bad(what),
        });
    }
    if let Some(layer) = layer {
        let there = "only EXR files have layers".to_owned();
        return Err(ReadError::NoLayer { path: path.to_owned(), layer: layer.to_owned(), there });
    }
    if pfm::is_pfm(&bytes) {
        return pfm::read(&bytes).map_err(bad);
    }
    DECODER.decode(Cursor::new(&bytes)).and_then(|image| whole(&bytes).map(|()| picture(image))).map_err(bad)
}

/// All of a file, which may be a pipe.
fn contents(path: &Path) -> Result<Vec<u8>, ReadError> {
    let failed = |source| ReadError::Open { path: path.to_owned(), source };
    let file = File::open(path).map_err(failed)?;
    let mut bytes = Vec::new();
    file.take(LONGEST + 1).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > LONGEST {
        let what = format!("is longer than {} MiB", LONGEST >> 20);
        return Err(ReadError::Bad { path: path.to_owned(), what });
    }
    Ok(bytes)
}

/// Refuses a JPEG that ends early, for which the decoder makes up the rest: no end-of-image marker comes after the
/// last start of a scan.
fn whole(bytes: &[u8]) -> Result<(), String> {
    let last = |marker: [u8; 2]| bytes.windows(2).rposition(|w| w == marker);
    if bytes.starts_with(&[0xff, 0xd8]) && last([0xff, 0xd9]) < last([0xff, 0xda]) {
        return Err("cannot be decoded: the file is cut off".into());
    }
    Ok(())
}

fn picture(image: DynamicImage) -> Picture {
    let (width, height) = (image.width(), image.height());
    let alpha = image.color().has_alpha();
    let (encoding, pixels, transparent) = match image {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            let raw = image.into_rgb32f().into_raw();
            (Encoding::Linear, raw.as_chunks().0.to_vec(), false)
        }
        image if image.color().bytes_per_pixel() > image.color().channel_count() => {
            // 65535 is 257 times 255: what 8 bits can hold stays a whole number.
            const STEP: f32 = 257.0;
            if alpha {
                let raw = image.into_rgba16().into_raw();
                let seen = composed(raw.as_chunks().0, |c| f32::from(c) / STEP, u16::MAX);
                (Encoding::Srgb8, seen.0, seen.1)
            } else {
                let raw = image.into_rgb16().into_raw();
                let pixels = raw.as_chunks().0.par_iter().map(|p: &[u16; 3]| p.map(|c| f32::from(c) / STEP)).collect();
                (Encoding::Srgb8, pixels, false)
            }
        }
        image if alpha => {
            let raw = image.into_rgba8().into_raw();
            let seen = composed(raw.as_chunks().0, f32::from, u8::MAX);
            (Encoding::Srgb8, seen.0, seen.1)
        }
        image => {
            let raw = image.into_rgb8().into_raw();
            let pixels = raw.as_chunks().0.par_iter().map(|p: &[u8; 3]| p.map(f32::from)).collect();
            (Encoding::Srgb8, pixels, false)
        }
    };
    Picture { width, height, encoding, pixels, transparent }
}

/// Colours over black, and whether that changes any.
fn composed<T>(pixels: &[[T; 4]], value: impl Fn(T) -> f32 + Sync, opaque: T) -> (Vec<[f32; 3]>, bool)
where
    T: Copy + PartialEq + Sync,
{
    let full = value(opaque);
    let over_black = |&[r, g, b, a]: &[T; 4]| {
        let colour = [r, g, b].map(&value);
        if a == opaque { colour } else { colour.map(|c| c * value(a) / full) }
    };
    (pixels.par_iter().map(over_black).collect(), pixels.par_iter().any(|p| p[3] != opaque))
}

#[cfg(test)]
mod tests;
