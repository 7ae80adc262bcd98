//! What is refused before anything is read or allocated.

use super::exit::{Exit, Failure};
use super::frame::Frame;
use super::memory::Memory;
use super::style::bytes;
use tison::film::{Aov, Film};
use tison::render;

/// Longest side of what is rendered at once: what the header of a JPEG can state.
pub const MAX_SIDE: u64 = 65_535;

/// Refuses images that are too large for tison or for this machine's free memory.
/// What it takes is kept free from now on.
pub fn check(frame: &Frame, aovs: &[Aov], adaptive: bool, memory: &Memory) -> Result<(), Failure> {
    if frame.pixel.is_some() {
        return Ok(());
    }
    let crop = frame.crop;
    let (width, height) = (u64::from(crop.x1 - crop.x0), u64::from(crop.y1 - crop.y0));
    let needed = memory_needed(width, height, aovs, adaptive);
    memory.reserve(0);
    refuse(width, height, needed, memory.free()).map_err(|f| memory.explained(f))?;
    memory.reserve(needed);
    Ok(())
}

/// The film, and as much again for the encoder's copy of it; before that, what adaptive sampling knows of the pixels.
fn memory_needed(width: u64, height: u64, aovs: &[Aov], adaptive: bool) -> u64 {
    let film = Film::bytes(width, height, aovs);
    let pixels = if adaptive { width.saturating_mul(height).saturating_mul(render::bytes_per_pixel(aovs)) } else { 0 };
    film.saturating_add(film.max(pixels))
}

fn refuse(width: u64, height: u64, needed: u64, available: Option<u64>) -> Result<(), Failure> {
    let why = if width > MAX_SIDE || height > MAX_SIDE {
        format!("no side may be longer than {MAX_SIDE} pixels")
    } else {
        match available {
            Some(free) if needed > free => format!("{} are free", bytes(free)),
            _ => return Ok(()),
        }
    };
    let what = format!("an image of {width}x{height} pixels needs about {} of memory; {why}", bytes(needed));
    Err(Failure::new(Exit::Limit, what).help("choose a smaller --size or --scale, or render parts of it with --crop"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_limits_from_both_sides() {
        const GB: u64 = 1_000_000_000;
        let cases = [
            ("ordinary", 1280, 720, GB, Some(2 * GB), true),
            ("exactly what is free", 1280, 720, GB, Some(GB), true),
            ("one byte more", 1280, 720, GB, Some(GB - 1), false),
            ("nobody knows what is free", 1280, 720, GB, None, true),
            ("longest side", MAX_SIDE, 1, GB, None, true),
            ("longer", MAX_SIDE + 1, 1, 1, None, false),
            ("higher", 1, MAX_SIDE + 1, 1, None, false),
        ];
        for (name, w, h, needed, free, ok) in cases {
            let result = refuse(w, h, needed, free);
            assert_eq!(result.is_ok(), ok, "{name}");
            assert!(result.err().is_none_or(|f| f.exit == Exit::Limit), "{name}");
        }
    }
}
