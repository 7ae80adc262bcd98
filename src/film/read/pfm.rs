//! Portable float maps.

use super::{DECODER, Encoding, Picture};

/// Whether a file begins as one, of three channels or of one.
pub fn is_pfm(bytes: &[u8]) -> bool {
    matches!(bytes, [b'P', b'F' | b'f', space, ..] if space.is_ascii_whitespace())
}

/// Rows from the bottom up; the sign of the scale says in which order the bytes of a number are, and its size is
/// not used: no two programs mean the same by it.
pub fn read(bytes: &[u8]) -> Result<Picture, String> {
    let mut rest = bytes;
    let mut word = || {
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let long = rest[start..].iter().position(u8::is_ascii_whitespace)?;
        let word = std::str::from_utf8(&rest[start..start + long]).ok();
        // One byte of white space ends the last word; what follows are numbers.
        rest = &rest[start + long + 1..];
        word
    };
    let header = || "has a damaged PFM header: it is PF or Pf, width, height and scale".to_owned();
    let kind = word().ok_or_else(header)?;
    let mut size = || word().and_then(|w| w.parse::<u32>().ok());
    let (width, height) = size().zip(size()).ok_or_else(header)?;
    let scale = word().and_then(|w| w.parse::<f64>().ok()).filter(|s| s.is_finite() && *s != 0.0).ok_or_else(header)?;
    let channels = if kind == "PF" { 3 } else { 1 };
    let needed = 4 * channels * u64::from(width) * u64::from(height);
    DECODER.check_size((width, height), needed)?;
    if (rest.len() as u64) < needed {
        return Err(format!("cannot be decoded: the file is cut off, {} of {needed} bytes are there", rest.len()));
    }
    let number = |b: &[u8; 4]| if scale < 0.0 { f32::from_le_bytes(*b) } else { f32::from_be_bytes(*b) };
    let numbers: &[[u8; 4]] = rest[..needed as usize].as_chunks().0;
    let rows = numbers.chunks_exact(channels as usize * width as usize).rev();
    let pixels = if channels == 3 {
        rows.flat_map(|row| row.as_chunks::<3>().0).map(|p| p.each_ref().map(number)).collect()
    } else {
        rows.flatten().map(|b| [number(b); 3]).collect()
    };
    Ok(Picture { width, height, encoding: Encoding::Linear, pixels, transparent: false })
}
