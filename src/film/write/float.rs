//! Formats of linear floats: Radiance HDR and portable float maps.

use crate::film::save::Sink;
use image::Rgb;
use image::codecs::hdr::HdrEncoder;
use std::io;

/// Radiance HDR. Its pixels share one exponent and cannot be negative.
pub fn hdr(width: u32, height: u32, pixels: &[[f32; 3]], out: &mut dyn Sink) -> io::Result<()> {
    let pixels: Vec<Rgb<f32>> = pixels.iter().map(|p| Rgb(p.map(|c| c.max(0.0)))).collect();
    HdrEncoder::new(out).encode(&pixels, width as usize, height as usize).map_err(io::Error::other)
}

/// Portable float map of 1 or 3 channels: rows from the bottom up, little-endian (the
/// negative scale says so).
pub fn pfm(width: u32, channels: usize, values: &[f32], out: &mut dyn Sink) -> io::Result<()> {
    let row = width as usize * channels;
    let kind = if channels == 1 { "Pf" } else { "PF" };
    write!(out, "{kind}\n{width} {}\n-1.0\n", values.len() / row)?;
    for row in values.chunks_exact(row).rev() {
        let bytes: Vec<u8> = row.iter().flat_map(|v| v.to_le_bytes()).collect();
        out.write_all(&bytes)?;
    }
    Ok(())
}
