//! Images that give surfaces their colour.

use glam::{Vec2, Vec3};

/// An image in memory and how it is looked up.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Texels across.
    pub width: u32,
    /// Texels down.
    pub height: u32,
    /// Linear RGB, row by row from the top.
    texels: Vec<[f32; 3]>,
    /// The nearest texel instead of a blend of four.
    pub nearest: bool,
}

impl Texture {
    /// Linear RGB at `uv`: u to the right, v down from the top; the image repeats.
    #[must_use]
    pub fn sample(&self, uv: Vec2) -> Vec3 {
        let at = |x: f32, n: u32| ((x - x.floor()) * n as f32).min(n as f32 - 1.0) as usize;
        let (x, y) = (at(uv.x, self.width), at(uv.y, self.height));
        Vec3::from(self.texels[y * self.width as usize + x])
    }

    /// Bytes of the texels.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.texels[..])
    }
}
