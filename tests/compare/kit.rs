//! Two pictures by formula, in whole numbers so that any program can make them.

use tison::film::{Encoding, Picture};

/// Of the small pictures.
pub const SMALL: (u32, u32) = (61, 47);
/// Of the large ones, which are worked in several parts.
pub const LARGE: (u32, u32) = (150, 131);

/// The reference: slopes, edges and points.
fn base(x: i64, y: i64, c: usize) -> i64 {
    let mut v = [4 * x, 5 * y, 255 - 2 * (x + y)][c];
    if (x / 9 + y / 7) % 2 == 0 {
        v = v.div_euclid(2);
    }
    if x % 16 == 5 && y % 11 == 3 {
        v = 255;
    }
    v.clamp(0, 255)
}

/// A hash of a pixel's channel.
fn noise(x: i64, y: i64, c: usize) -> i64 {
    let [x, y, c] = [x, y, c as i64].map(|n| n as u32);
    let mut v = (x.wrapping_mul(0x9e37_79b1))
        .wrapping_add(y.wrapping_mul(0x85eb_ca77))
        .wrapping_add(c.wrapping_mul(0xc2b2_ae3d));
    v ^= v >> 15;
    v = v.wrapping_mul(0x2c1b_3c6d);
    v ^= v >> 12;
    v = v.wrapping_mul(0x297a_2d39);
    v ^= v >> 15;
    i64::from(v)
}

/// The lower half shifted by a pixel, noise everywhere, and a box inverted.
fn changed(x: i64, y: i64, c: usize) -> i64 {
    let mut v = base(if y >= 24 { x + 1 } else { x }, y, c) + noise(x, y, c) % 13 - 6;
    if (30..44).contains(&x) && (8..17).contains(&y) {
        v = 255 - v;
    }
    v.clamp(0, 255)
}

pub fn picture((width, height): (u32, u32), encoding: Encoding, value: impl Fn(i64, i64, usize) -> f32) -> Picture {
    let pixel = |i: u32| {
        let (x, y) = (i64::from(i % width), i64::from(i / width));
        [0, 1, 2].map(|c| value(x, y, c))
    };
    Picture { width, height, encoding, pixels: (0..width * height).map(pixel).collect(), transparent: false }
}

/// The changed one and the reference, from 0 to 255.
pub fn srgb8(size: (u32, u32)) -> [Picture; 2] {
    [
        picture(size, Encoding::Srgb8, |x, y, c| changed(x, y, c) as f32),
        picture(size, Encoding::Srgb8, |x, y, c| base(x, y, c) as f32),
    ]
}

/// The same numbers by 64: light up to almost 4.
pub fn linear(size: (u32, u32)) -> [Picture; 2] {
    srgb8(size).map(|picture| Picture {
        encoding: Encoding::Linear,
        pixels: picture.pixels.iter().map(|p| p.map(|v| v / 64.0)).collect(),
        ..picture
    })
}
