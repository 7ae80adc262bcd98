//! Materials as shading reads them: every weight resolved to linear RGB.

use glam::Vec3;

/// How a surface answers light. All colours are linear RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file.
    pub name: String,
    /// Multiplies the scene's ambient light.
    pub ambient: Vec3,
    /// Multiplies a light's colour and N·L.
    pub diffuse: Vec3,
    /// Multiplies a light's colour and (N·H)^shininess.
    pub specular: Vec3,
    /// Blinn-Phong exponent, at least 0.
    pub shininess: f32,
    /// Added whatever the light.
    pub emission: Vec3,
    /// The mirrored ray.
    pub reflect: Reflect,
    /// Weight of the refracted ray; under [`Reflect::Fresnel`] times `1 - F`.
    pub refract: Vec3,
    /// Index of refraction of the inside.
    pub ior: f64,
    /// What is absorbed on the way through the inside, per scene unit and channel (Beer-Lambert).
    pub absorption: Vec3,
    /// The image that its colours come from.
    pub texture: Option<Textured>,
}

/// How an image colours a material: each of these times the texel is added to the material's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Textured {
    /// Index into [`Scene::textures`](super::Scene::textures).
    pub image: u32,
    /// Adds to `ambient`.
    pub ambient: Vec3,
    /// Adds to `diffuse`.
    pub diffuse: Vec3,
    /// Adds to `specular`.
    pub specular: Vec3,
    /// Adds to `emission`.
    pub emission: Vec3,
}

/// Weight of the mirrored ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reflect {
    /// The same at every angle; zero for none.
    Constant(Vec3),
    /// The Fresnel equations for a dielectric of the material's `ior`.
    Fresnel,
    /// Schlick's formula for a metal with this colour head on.
    Metal(Vec3),
}

impl Default for Material {
    /// Light clay with a soft highlight.
    fn default() -> Self {
        Self {
            name: "default".into(),
            ambient: Vec3::new(0.62, 0.60, 0.57),
            diffuse: Vec3::new(0.62, 0.60, 0.57),
            specular: Vec3::splat(0.12),
            shininess: 30.0,
            emission: Vec3::ZERO,
            reflect: Reflect::NONE,
            refract: Vec3::ZERO,
            ior: 1.0,
            absorption: Vec3::ZERO,
            texture: None,
        }
    }
}

impl Reflect {
    /// No mirrored ray.
    pub const NONE: Self = Self::Constant(Vec3::ZERO);

    /// Largest weight at any angle.
    #[must_use]
    pub fn upper_bound(self) -> Vec3 {
        match self {
            Self::Constant(weight) => weight,
            Self::Fresnel | Self::Metal(_) => Vec3::ONE,
        }
    }
}

impl Material {
    /// Whether hits send out mirrored rays.
    #[must_use]
    pub fn reflects(&self) -> bool {
        match self.reflect {
            Reflect::Constant(weight) => weight != Vec3::ZERO,
            Reflect::Fresnel => self.ior != 1.0,
            Reflect::Metal(_) => true,
        }
    }

    /// Whether hits send out refracted rays.
    #[must_use]
    pub fn refracts(&self) -> bool {
        self.refract != Vec3::ZERO
    }

    /// Whether a light can change how it looks.
    #[must_use]
    pub fn is_lit(&self) -> bool {
        let textured = self.texture.is_some_and(|t| t.diffuse != Vec3::ZERO || t.specular != Vec3::ZERO);
        textured || self.diffuse != Vec3::ZERO || self.specular != Vec3::ZERO
    }

    /// Largest share of the light of its secondary rays that a hit passes on.
    #[must_use]
    pub fn passed_on(&self) -> f32 {
        match self.reflect {
            // F + (1 - F): never more than the larger of the two.
            Reflect::Fresnel => self.refract.max_element().max(1.0),
            other => (other.upper_bound() + self.refract).max_element(),
        }
    }
}
