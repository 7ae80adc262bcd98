//! What is found out about a scene once, before its rays are traced.

use super::certificate::Radiance;
use super::contacts::Contacts;
use super::enclosures::Enclosures;
use crate::scene::{Light, Needs, Scene};
use glam::Vec3;

/// Shared by all threads.
#[derive(Debug)]
pub struct Known {
    /// The lights that can change anything.
    pub lights: Vec<Light>,
    /// What branches can carry.
    pub radiance: Radiance,
    /// Solids that touch.
    pub contacts: Contacts,
    /// What is known about the insides of shapes.
    pub enclosures: Enclosures,
}

impl Known {
    /// What a render of `scene` that has these `needs` uses.
    #[must_use]
    pub fn of(scene: &Scene, needs: &Needs, k_max: u32) -> Self {
        let lights = scene.lights.iter().filter(|l| needs.shadow_rays && l.color != Vec3::ZERO);
        let lights: Vec<Light> = lights.copied().collect();
        Self {
            radiance: Radiance::of(scene, needs, k_max),
            contacts: if needs.refraction { Contacts::of(scene) } else { Contacts::default() },
            enclosures: Enclosures::of(scene, &lights, needs.refraction),
            lights,
        }
    }
}
