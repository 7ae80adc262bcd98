//! Images that give surfaces their colour.

mod decode;
#[cfg(test)]
mod tests;

pub(super) use decode::{decoded_bytes, read};

use crate::math::colour;
use glam::{Vec2, Vec3};

/// An image in memory and how it is looked up.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Texels across.
    pub width: u32,
    /// Texels down.
    pub height: u32,
    /// The nearest texel instead of a blend of four.
    pub nearest: bool,
    texels: Texels,
}

/// RGB, row by row from the top.
#[derive(Clone)]
enum Texels {
    /// Three bytes a texel, and the linear value of each byte.
    Bytes(Vec<u8>, &'static [f32; 256]),
    /// Three linear numbers a texel.
    Floats(Vec<f32>),
}

impl std::fmt::Debug for Texels {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (kind, len) = match self {
            Self::Bytes(all, _) => ("Bytes", all.len()),
            Self::Floats(all) => ("Floats", all.len()),
        };
        write!(f, "{kind}({len})")
    }
}

/// What the whole numbers of an image file mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// The sRGB curve.
    Srgb,
    /// Linear light: 255 is 1.
    Linear,
}

/// `byte / 255`.
static SHARES: [f32; 256] = {
    let mut table = [0.0; 256];
    let mut i = 0;
    while i < 256 {
        table[i] = i as f32 / 255.0;
        i += 1;
    }
    table
};

impl Texture {
    /// An image of RGB bytes, row by row from the top.
    ///
    /// # Panics
    /// If it has no texel, or not three bytes for each.
    #[must_use]
    pub fn from_bytes((width, height): (u32, u32), rgb: Vec<u8>, encoding: Encoding, nearest: bool) -> Self {
        let table = match encoding {
            Encoding::Srgb => colour::linear_of_srgb8(),
            Encoding::Linear => &SHARES,
        };
        Self::checked((width, height), rgb.len(), Texels::Bytes(rgb, table), nearest)
    }

    /// An image of linear RGB, row by row from the top.
    ///
    /// # Panics
    /// If it has no texel, or not three numbers for each.
    #[must_use]
    pub fn from_floats((width, height): (u32, u32), rgb: Vec<f32>, nearest: bool) -> Self {
        Self::checked((width, height), rgb.len(), Texels::Floats(rgb), nearest)
    }

    fn checked((width, height): (u32, u32), components: usize, texels: Texels, nearest: bool) -> Self {
        assert!(width > 0 && height > 0, "an image has texels");
        assert_eq!(components, 3 * width as usize * height as usize, "a texel has three components");
        Self { width, height, nearest, texels }
    }

    /// Linear RGB at `uv`: u to the right, v down from the top, each 1 across the whole image,
    /// which repeats in both directions.
    ///
    /// The nearest texel is that of column `floor(u * width)` and row `floor(v * height)`, exactly. A
    /// blend has the texels' middles at halves, and goes on over the border with the texels of
    /// the opposite one. What is no finite number is taken for 0.
    #[must_use]
    pub fn sample(&self, uv: Vec2) -> Vec3 {
        let (x, y) = (place(uv.x, self.width), place(uv.y, self.height));
        if self.nearest {
            return self.texel(cell(x, self.width), cell(y, self.height));
        }
        let ((x0, x1, right), (y0, y1, down)) = (neighbours(x, self.width), neighbours(y, self.height));
        let above = self.texel(x0, y0).lerp(self.texel(x1, y0), right);
        let below = self.texel(x0, y1).lerp(self.texel(x1, y1), right);
        above.lerp(below, down)
    }

    /// Largest component of any texel; 1 for bytes, whichever there are.
    #[must_use]
    pub fn brightest(&self) -> f32 {
        match &self.texels {
            Texels::Bytes(..) => 1.0,
            Texels::Floats(all) => all.iter().copied().fold(0.0, f32::max),
        }
    }

    #[inline]
    fn texel(&self, x: usize, y: usize) -> Vec3 {
        let at = 3 * (y * self.width as usize + x);
        match &self.texels {
            Texels::Bytes(all, table) => {
                let texel = &all[at..at + 3];
                Vec3::new(table[usize::from(texel[0])], table[usize::from(texel[1])], table[usize::from(texel[2])])
            }
            Texels::Floats(all) => Vec3::from_slice(&all[at..at + 3]),
        }
    }

    /// Bytes of the texels.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match &self.texels {
            Texels::Bytes(all, _) => all.len(),
            Texels::Floats(all) => size_of_val(&all[..]),
        }
    }
}

/// Where `x` is in a row of `n` texels that repeats, in texels from its start. The product of 24 and
/// 17 bits is exact.
#[inline]
fn place(x: f32, n: u32) -> f64 {
    // No call of `floor`, which old processors have no instruction for; beyond 2^24 all are whole.
    let x = if x.abs() < 1e9 { f64::from(x) } else { 0.0 };
    let part = x - (x as i64) as f64;
    let part = if part < 0.0 { part + 1.0 } else { part };
    part * f64::from(n)
}

/// The texel around `at`, which rounding can have brought to the very end.
#[inline]
fn cell(at: f64, n: u32) -> usize {
    (at as usize).min(n as usize - 1)
}

/// The texels with their middles around `at`, and the share of the second one.
#[inline]
fn neighbours(at: f64, n: u32) -> (usize, usize, f32) {
    let (at, last) = (at + 0.5, n as usize - 1);
    let second = (at as usize).min(n as usize);
    let share = at - second as f64;
    let first = if second == 0 { last } else { second - 1 };
    (first, if second > last { 0 } else { second }, share as f32)
}
