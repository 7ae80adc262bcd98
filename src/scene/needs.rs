//! What a scene uses, asked once when it is loaded: the render leaves out the rest.

use super::Scene;
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
    /// There are lights, and materials that they can change.
    pub shadow_rays: bool,
}

impl Needs {
    /// Asks the frozen scene.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let any = |f: fn(&super::Material) -> bool| scene.materials.iter().any(f);
        let lights = scene.lights.iter().any(|l| l.color != Vec3::ZERO);
        Self {
            reflection: any(super::Material::reflects),
            refraction: any(super::Material::refracts),
            specular: lights && any(|m| m.specular != Vec3::ZERO),
            smooth_normals: scene.objects.iter().any(|o| o.normals.is_some()),
            shadow_rays: lights && any(super::Material::is_lit),
        }
    }

    /// Whether one hit can lead to another ray that is shaded.
    #[must_use]
    pub fn secondary_rays(&self) -> bool {
        self.reflection || self.refraction
    }

    /// Each need by name.
    #[must_use]
    pub fn list(&self) -> [(&'static str, bool); 5] {
        [
            ("reflection", self.reflection),
            ("refraction", self.refraction),
            ("specular", self.specular),
            ("smooth_normals", self.smooth_normals),
            ("shadow_rays", self.shadow_rays),
        ]
    }
}
