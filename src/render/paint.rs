//! What lights ask of a material, in one place, and the images that colour it.

use super::block::Block;
use crate::scene::{Material, Scene, Textured};
use glam::{Vec2, Vec3};

/// A material in the scene's ambient light.
#[derive(Clone, Copy, Debug)]
pub struct Paint {
    /// Emission, and the answer to the ambient light.
    pub own: Vec3,
    /// Multiplies a light's colour and N·L.
    pub diffuse: Vec3,
    /// Multiplies a light's colour and (N·H)^shininess.
    pub specular: Vec3,
    /// Blinn-Phong exponent.
    pub shininess: f32,
    /// What a texel adds to the first three: the ambient light and the emission are in `ambient`.
    pub texture: Option<Textured>,
}

impl Paint {
    fn new(m: &Material, ambient: Vec3) -> Self {
        Self {
            own: m.emission + m.ambient * ambient,
            diffuse: m.diffuse,
            specular: m.specular,
            shininess: m.shininess,
            texture: m.texture.map(|t| Textured { ambient: t.ambient * ambient + t.emission, ..t }),
        }
    }
}

/// The paints of all materials.
#[derive(Debug)]
pub struct Palette {
    paints: Vec<Paint>,
    textured: bool,
}

impl Palette {
    /// Those of `scene`.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let paints: Vec<Paint> = scene.materials.iter().map(|m| Paint::new(m, scene.ambient)).collect();
        let textured = paints.iter().any(|p| p.texture.is_some());
        Self { paints, textured }
    }

    /// The paint of a material.
    #[inline]
    #[must_use]
    pub fn get(&self, material: u32) -> &Paint {
        &self.paints[material as usize]
    }

    /// Whether a material samples an image.
    #[inline]
    #[must_use]
    pub fn has_texture(&self, material: u32) -> bool {
        self.textured && self.paints[material as usize].texture.is_some()
    }

    /// Adds the texels to the lanes of `block` whose material samples an image; `uv` tells the
    /// texture coordinates of a lane. A surface without any keeps the colour that it has without the image.
    pub fn add_texels(&self, scene: &Scene, block: &mut Block, uv: impl Fn(&Block, usize) -> Option<Vec2>) {
        if !self.textured {
            return;
        }
        for lane in 0..block.len {
            let Some(t) = &self.paints[block.material[lane] as usize].texture else { continue };
            let texel = uv(block, lane).map_or(Vec3::ONE, |uv| scene.textures[t.image as usize].sample(uv));
            for axis in 0..3 {
                block.color[axis][lane] += t.ambient[axis] * texel[axis];
                block.diffuse[axis][lane] += t.diffuse[axis] * texel[axis];
                block.specular[axis][lane] += t.specular[axis] * texel[axis];
            }
        }
    }
}
