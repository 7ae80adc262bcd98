//! Image files to texels.

use super::{Encoding, Texture};
use crate::math::colour;
use image::{DynamicImage, ImageDecoder, ImageError, ImageReader, Limits};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Most texels to a side.
const LARGEST_SIDE: u32 = 65_536;
/// Most bytes that decoding may take.
const MOST_MEMORY: u64 = 256 << 20;
/// Longest file; some decoders take it in whole.
const LONGEST: u64 = 1 << 30;

/// Reads the image at `path`, of whatever kind its first bytes say. Bytes stay bytes; 16 bits become
/// linear floats, as the numbers of an HDR image are already.
///
/// # Errors
/// What is wrong with the file, in words that go on after its name.
pub fn read(path: &Path, encoding: Encoding, nearest: bool) -> Result<Texture, String> {
    let file = File::open(path).map_err(|e| format!("cannot be opened: {e}"))?;
    let length = file.metadata().map_err(|e| format!("cannot be opened: {e}"))?.len();
    if length > LONGEST {
        return Err(format!("is {length} bytes long, more than {} MiB", LONGEST >> 20));
    }
    let reader = ImageReader::new(BufReader::new(file)).with_guessed_format();
    let mut reader = reader.map_err(|e| format!("cannot be read: {e}"))?;
    if reader.format().is_none() {
        return Err("is no PNG, JPEG, BMP, HDR or PNM image".into());
    }
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MOST_MEMORY);
    reader.limits(limits.clone());
    let mut decoder = reader.into_decoder().map_err(|e| why(&e))?;
    let (size, bytes) = (decoder.dimensions(), decoder.total_bytes());
    check_size(size, bytes)?;
    limits.reserve(bytes).and_then(|()| decoder.set_limits(limits)).map_err(|e| why(&e))?;
    let image = DynamicImage::from_decoder(decoder).map_err(|e| why(&e))?;
    Ok(texture(image, encoding, nearest))
}

fn check_size((width, height): (u32, u32), bytes: u64) -> Result<(), String> {
    if width == 0 || height == 0 {
        return Err("has no pixels".into());
    }
    if width.max(height) > LARGEST_SIDE {
        return Err(format!("has {width}x{height} pixels, but a side may have at most {LARGEST_SIDE}"));
    }
    if bytes > MOST_MEMORY {
        let (mib, most) = (bytes >> 20, MOST_MEMORY >> 20);
        return Err(format!(
            "has {width}x{height} pixels and would take {mib} MiB to decode, but at most {most} are given: make it smaller"
        ));
    }
    Ok(())
}

fn why(e: &ImageError) -> String {
    match e {
        ImageError::Limits(_) => format!("takes more than {} MiB to decode: make it smaller", MOST_MEMORY >> 20),
        ImageError::Unsupported(_) => "is no PNG, JPEG, BMP, HDR or PNM image that can be decoded".into(),
        e => format!("cannot be decoded: {e}"),
    }
}

fn texture(image: DynamicImage, encoding: Encoding, nearest: bool) -> Texture {
    let size = (image.width(), image.height());
    match image {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            Texture::from_floats(size, image.into_rgb32f().into_raw(), nearest)
        }
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            let table = table_of_words(encoding);
            let words = image.into_rgb16().into_raw();
            Texture::from_floats(size, words.into_iter().map(|w| table[usize::from(w)]).collect(), nearest)
        }
        image => Texture::from_bytes(size, image.into_rgb8().into_raw(), encoding, nearest),
    }
}

/// Linear value of every 16-bit number.
fn table_of_words(encoding: Encoding) -> Vec<f32> {
    let linear = |share| match encoding {
        Encoding::Srgb => colour::linear(share),
        Encoding::Linear => share,
    };
    (0..=u16::MAX).map(|w| linear(f64::from(w) / 65_535.0) as f32).collect()
}
