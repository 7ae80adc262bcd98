//! What a scene uses, asked once when it is loaded: the render leaves out the rest.

use super::{Reflect, Scene, Skip, Skips};
use glam::Vec3;

/// What rendering this scene takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needs {
    /// Some reachable material mirrors.
    pub reflection: bool,
    /// Some reachable material refracts.
    pub refraction: bool,
    /// Some lit material has a highlight.
    pub specular: bool,
    /// Some object has normals to interpolate.
    pub smooth_normals: bool,
    /// Some reachable material samples an image.
    pub textures: bool,
    /// Some light has a size: it is sampled at many points.
    pub area_lights: bool,
    /// Some reachable material absorbs light on the way through.
    pub absorption: bool,
    /// There are lights, and materials that they can change.
    pub shadow_rays: bool,
}

impl Needs {
    /// Asks the frozen scene. What is switched off in `skips` is taken to be needed.
    #[must_use]
    pub fn of(scene: &Scene, skips: Skips) -> Self {
        let any = |f: fn(&super::Material) -> bool| scene.materials.iter().any(f);
        let lights = scene.lights.iter().any(|l| l.color != Vec3::ZERO || !skips.has(Skip::DarkLights));
        let fresnel = |m: &super::Material| !skips.has(Skip::Fresnel) && m.reflect == Reflect::Fresnel;
        Self {
            reflection: scene.materials.iter().any(|m| m.reflects() || fresnel(m)),
            refraction: any(super::Material::refracts),
            specular: lights
                && any(|m| m.specular != Vec3::ZERO || m.texture.is_some_and(|t| t.specular != Vec3::ZERO)),
            smooth_normals: scene.objects.iter().filter_map(super::Object::mesh).any(|m| m.data.normals.is_some()),
            textures: any(|m| m.texture.is_some()),
            area_lights: scene.lights.iter().any(|l| l.color != Vec3::ZERO && l.radius > 0.0),
            absorption: any(|m| m.refracts() && m.absorption != Vec3::ZERO),
            shadow_rays: lights && (any(super::Material::is_lit) || !skips.has(Skip::ShadowRays)),
        }
    }

    /// Whether one hit can lead to another ray that is shaded.
    #[must_use]
    pub fn secondary_rays(&self) -> bool {
        self.reflection || self.refraction
    }

    /// Whether hits of a material may send rays on. Where something refracts, a boundary of index 1 may be one between two
    /// media, and mirrors.
    #[must_use]
    pub fn may_branch(&self, m: &super::Material) -> bool {
        m.reflects() || m.refracts() || (self.refraction && m.reflect == Reflect::Fresnel)
    }

    /// Each need by name.
    #[must_use]
    pub fn list(&self) -> [(&'static str, bool); 8] {
        [
            ("reflection", self.reflection),
            ("refraction", self.refraction),
            ("specular", self.specular),
            ("smooth_normals", self.smooth_normals),
            ("textures", self.textures),
            ("area_lights", self.area_lights),
            ("absorption", self.absorption),
            ("shadow_rays", self.shadow_rays),
        ]
    }
}
