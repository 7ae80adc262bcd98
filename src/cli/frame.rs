//! The image's size and the part of it that is rendered.

use super::args::PictureArgs;
use super::exit::{Exit, Failure};
use super::limits::MAX_SIDE;
use super::parse::Region;
use tison::render::Crop;

/// Which pixels.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Of the whole image.
    pub size: (u32, u32),
    /// What is rendered of it.
    pub crop: Crop,
    /// Only this one is told about.
    pub pixel: Option<(u32, u32)>,
}

impl Frame {
    /// What the flags make of an image of `size`.
    pub fn new(picture: &PictureArgs, size: (u64, u64)) -> Result<Self, Failure> {
        let size = scaled(size, picture.scale.unwrap_or(1.0))?;
        let pixel = picture.pixel.map(|p| inside(p, size)).transpose()?;
        Ok(Self { size, crop: crop(picture.crop, size)?, pixel })
    }
}

/// Sides beyond what any image may have are refused here, because they may not even fit a `u32`.
fn scaled(size: (u64, u64), scale: f64) -> Result<(u32, u32), Failure> {
    /// Largest whole image, of which parts may be rendered.
    const MAX_WHOLE: f64 = 1e9;
    let scaled = |side: u64| (side as f64 * scale).round().max(1.0);
    let (w, h) = (scaled(size.0), scaled(size.1));
    if w > MAX_WHOLE || h > MAX_WHOLE {
        let what = format!("an image of {w}x{h} pixels is larger than tison can count");
        return Err(
            Failure::new(Exit::Limit, what).help(format!("choose a --size of at most {MAX_SIDE} pixels a side"))
        );
    }
    Ok((w as u32, h as u32))
}

/// The pixels of a region, which must hold some and not reach beyond the image.
pub fn crop(region: Option<Region>, (width, height): (u32, u32)) -> Result<Crop, Failure> {
    let whole = Crop { x0: 0, y0: 0, x1: width, y1: height };
    let sides = [width, height, width, height];
    let edges = match region {
        None => return Ok(whole),
        Some(Region::Pixels(edges)) => edges,
        // Rounded the same way on both sides, so that neighbouring parts meet without gap or overlap.
        Some(Region::Shares(shares)) => std::array::from_fn(|i| (shares[i] * f64::from(sides[i])).round() as u64),
    };
    if edges[2] > u64::from(width) || edges[3] > u64::from(height) {
        return Err(Failure::usage(format!("--crop reaches beyond the image, which has {width}x{height} pixels")));
    }
    let [x0, y0, x1, y1] = edges.map(|e| e as u32);
    if x0 >= x1 || y0 >= y1 {
        return Err(Failure::usage(format!("--crop holds no pixel of an image of {width}x{height}")));
    }
    Ok(Crop { x0, y0, x1, y1 })
}

fn inside((x, y): (u64, u64), (width, height): (u32, u32)) -> Result<(u32, u32), Failure> {
    if x < u64::from(width) && y < u64::from(height) {
        Ok((x as u32, y as u32))
    } else {
        let what = format!("pixel {x},{y} is outside the image, which has {width}x{height} pixels counted from 0");
        Err(Failure::usage(what))
    }
}
