//! How much light the branches that are not traced can carry.

use crate::scene::{Needs, Scene};

/// Bounds on what one ray can bring back, by how many bounces it may still make.
///
/// A hit adds at most `L`, its own answer to all lights unshadowed, and passes on at most
/// the share `rho` of what its secondary rays bring: `R_j = max(background, L + rho R_(j-1))`
/// with `R_0 = max(background, L)`. Lights here do not fall off with distance, so `L` is a
/// true bound and no estimate.
#[derive(Debug)]
pub struct Radiance {
    by_bounces_left: Vec<f32>,
    beyond: f32,
}

impl Radiance {
    /// The bounds for rays of `scene` that start with up to `k_max` bounces.
    #[must_use]
    pub fn of(scene: &Scene, needs: &Needs, k_max: u32) -> Self {
        let lights: glam::Vec3 = scene.lights.iter().map(|l| l.color).sum();
        let background = scene.background.max_element();
        let (mut local, mut rho) = (0f32, 0f32);
        for m in &scene.materials {
            // N·L and N·H are at most 1.
            let at_hit = m.emission + m.ambient * scene.ambient + lights * (m.diffuse + m.specular);
            local = local.max(at_hit.max_element());
            rho = rho.max(m.passed_on());
        }
        let mut by_bounces_left = vec![background.max(local)];
        let longest = if needs.secondary_rays() { k_max as usize } else { 0 };
        while by_bounces_left.len() <= longest {
            let last = by_bounces_left[by_bounces_left.len() - 1];
            let next = background.max(local + rho * last);
            if next == last || !next.is_finite() {
                break; // settled: all further ones are the same
            }
            by_bounces_left.push(next);
        }
        let last = by_bounces_left[by_bounces_left.len() - 1];
        let beyond = if rho < 1.0 { background.max(local / (1.0 - rho)) } else { last };
        Self { by_bounces_left, beyond }
    }

    /// Most that a ray can bring which may make `bounces` more.
    #[inline]
    #[must_use]
    pub fn within(&self, bounces: u32) -> f32 {
        self.by_bounces_left[(bounces as usize).min(self.by_bounces_left.len() - 1)]
    }

    /// Most that a ray can bring which may bounce for ever. Where surfaces pass on all that
    /// they get, nothing bounds that: then it is what `k_max` bounces can bring.
    #[inline]
    #[must_use]
    pub fn beyond(&self) -> f32 {
        self.beyond
    }
}
