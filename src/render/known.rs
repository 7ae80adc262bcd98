//! What is found out about a scene once, before its rays are traced.

use super::certificate::Radiance;
use super::contacts::Contacts;
use super::enclosures::Enclosures;
use super::job::Job;
use super::reach::Reach;
use crate::scene::{Camera, Light, Needs, Scene, Skip};
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
    /// The box around all that camera rays can hit, if any may pass it.
    pub reach: Option<Reach>,
}

impl Known {
    /// What a render of `scene` that has these `needs` uses.
    #[must_use]
    pub fn of(scene: &Scene, camera: &Camera, job: &Job, needs: &Needs) -> Self {
        let skips = job.skips;
        let dark_too = !skips.has(Skip::DarkLights);
        let lights = if needs.shadow_rays { lights(scene, dark_too) } else { Vec::new() };
        let rays_inside = needs.refraction && skips.has(Skip::Inside);
        Self {
            radiance: Radiance::of(scene, needs, job.k_max),
            contacts: if needs.refraction { Contacts::of(scene) } else { Contacts::default() },
            enclosures: Enclosures::of(scene, &lights, skips.has(Skip::Enclosed), rays_inside),
            reach: if skips.has(Skip::Bounds) { Reach::of(scene, camera, job.size) } else { None },
            lights,
        }
    }
}

/// The lights that can change anything, and the others behind them if those are to be asked too: samples go by the
/// numbers of lights.
fn lights(scene: &Scene, dark_too: bool) -> Vec<Light> {
    let (mut lights, dark): (Vec<_>, Vec<_>) = scene.lights.iter().copied().partition(|l| l.color != Vec3::ZERO);
    if dark_too {
        lights.extend(dark);
    }
    lights
}
