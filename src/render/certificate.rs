//! How much light the branches that are not traced can carry.

use crate::scene::{Light, Needs, Scene, Textured};
use glam::Vec3;

/// Bounds on what one ray can bring back, by how many bounces it may still make.
///
/// A hit adds at most `L`, its own answer to all lights unshadowed, and passes on at most
/// the share `rho` of what its secondary rays bring: `R_j = max(background, L + rho R_(j-1))`
/// with `R_0 = max(background, L)`. `L` is proved where every light keeps its strength over distance or
/// stands outside of the box around all surfaces, so that the least distance is known. Else the
/// bounds are kept as `fixed + L * scaled`, and `L` becomes the largest answer that the image showed: an
/// estimate.
#[derive(Debug)]
pub struct Radiance {
    by_bounces_left: Vec<Bound>,
    beyond: Bound,
    proved: bool,
}

/// `fixed + L * scaled`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bound {
    /// The part that is known beforehand.
    pub fixed: f32,
    /// How many times the largest answer of a surface; 0 where that is in `fixed`.
    pub scaled: f32,
}

impl Radiance {
    /// The bounds for rays of `scene` that start with up to `k_max` bounces.
    #[must_use]
    pub fn of(scene: &Scene, needs: &Needs, k_max: u32) -> Self {
        let shining = scene.lights.iter().filter(|l| l.color != Vec3::ZERO);
        let lights: Option<Vec3> = shining.map(|l| strongest(scene, l)).sum();
        let background = scene.background.max_element();
        let (mut local, mut rho) = (0f32, 0f32);
        for m in &scene.materials {
            // N·L and N·H are at most 1.
            let most = |f: fn(&Textured) -> Vec3| {
                m.texture.as_ref().map_or(Vec3::ZERO, |t| f(t) * scene.textures[t.image as usize].brightest())
            };
            let ambient = m.ambient + most(|t| t.ambient);
            let lit = m.diffuse + m.specular + most(|t| t.diffuse + t.specular);
            let emission = m.emission + most(|t| t.emission);
            let at_hit = emission + ambient * scene.ambient + lights.unwrap_or(Vec3::ZERO) * lit;
            local = local.max(at_hit.max_element());
            rho = rho.max(m.passed_on());
        }
        let proved = lights.is_some();
        let step = Step { background, local, rho, proved };
        let mut by_bounces_left = vec![step.first()];
        let longest = if needs.secondary_rays() { k_max as usize } else { 0 };
        while by_bounces_left.len() <= longest {
            let last = by_bounces_left[by_bounces_left.len() - 1];
            let next = step.after(last);
            if next == last || !(next.fixed + next.scaled).is_finite() {
                break; // settled: all further ones are the same
            }
            by_bounces_left.push(next);
        }
        let last = by_bounces_left[by_bounces_left.len() - 1];
        let beyond = if rho < 1.0 { step.limit() } else { last };
        Self { by_bounces_left, beyond, proved }
    }

    /// Most that a ray can bring which may make `bounces` more.
    #[inline]
    #[must_use]
    pub fn within(&self, bounces: u32) -> Bound {
        self.by_bounces_left[(bounces as usize).min(self.by_bounces_left.len() - 1)]
    }

    /// Most that a ray can bring which may bounce for ever. Where surfaces pass on all that
    /// they get, nothing bounds that: then it is what `k_max` bounces can bring.
    #[inline]
    #[must_use]
    pub fn beyond(&self) -> Bound {
        self.beyond
    }

    /// Whether the bounds hold whatever the image shows.
    #[inline]
    #[must_use]
    pub fn is_proved(&self) -> bool {
        self.proved
    }
}

/// The recursion.
struct Step {
    background: f32,
    local: f32,
    rho: f32,
    proved: bool,
}

impl Step {
    fn first(&self) -> Bound {
        match self.proved {
            true => Bound { fixed: self.background.max(self.local), scaled: 0.0 },
            false => Bound { fixed: self.background, scaled: 1.0 },
        }
    }

    fn after(&self, last: Bound) -> Bound {
        match self.proved {
            true => Bound { fixed: self.background.max(self.local + self.rho * last.fixed), scaled: 0.0 },
            false => Bound { fixed: self.background.max(self.rho * last.fixed), scaled: 1.0 + self.rho * last.scaled },
        }
    }

    /// After any number of steps, for `rho < 1`.
    fn limit(&self) -> Bound {
        let series = 1.0 / (1.0 - self.rho);
        match self.proved {
            true => Bound { fixed: self.background.max(self.local * series), scaled: 0.0 },
            false => Bound { fixed: self.background, scaled: series },
        }
    }
}

/// Most that arrives from a light at any surface, or `None` where it may be any amount.
fn strongest(scene: &Scene, light: &Light) -> Option<Vec3> {
    let Some(falloff) = light.falloff else { return Some(light.color) };
    let bounds = scene.local_bounds();
    let nearest = (light.position.clamp(bounds.lo, bounds.hi) - light.position).length_squared();
    (nearest > 0.0).then(|| light.color * (1.0 / (falloff * nearest)) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scaled_bound_is_never_below_the_proved_one() {
        for (background, local, rho) in [(0.0, 1.0, 0.5), (2.0, 0.1, 0.9), (0.3, 1.0, 1.0), (5.0, 2.0, 0.2)] {
            let step = |proved| Step { background, local, rho, proved };
            let (mut proved, mut scaled) = (step(true).first(), step(false).first());
            for bounces in 0..20 {
                let loose = scaled.fixed + local * scaled.scaled;
                assert!(loose >= proved.fixed && proved.scaled == 0.0, "{bounces}: {loose} {}", proved.fixed);
                (proved, scaled) = (step(true).after(proved), step(false).after(scaled));
            }
            if rho < 1.0 {
                assert!(step(true).limit().fixed >= proved.fixed);
            }
        }
    }
}
