//! Image files to texels.

use super::{Encoding, Texture};
use crate::film::Decoder;
use crate::math::colour;
use image::DynamicImage;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Longest file; some decoders take it in whole.
const LONGEST: u64 = 1 << 30;

const DECODER: Decoder = Decoder { kinds: "PNG, JPEG, BMP, HDR or PNM", most_memory: 256 << 20 };

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
    let image = DECODER.decode(BufReader::new(file))?;
    Ok(texture(image, encoding, nearest))
}

/// Bytes of all pixels of the image at `path`, as its head has it; nothing of one that cannot be read.
pub fn decoded_bytes(path: &Path) -> Option<u64> {
    DECODER.decoded_bytes(BufReader::new(File::open(path).ok()?))
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
