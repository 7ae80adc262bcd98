//! One pixel told in words: every ray of its first sample and what became of it.

use super::block::Block;
use super::job::Job;
use super::surface::SurfacePoint;
use super::tile::Segment;
use super::{lights, shade};
use crate::backend::{AnyBackend, Backend};
use crate::geom::{Coherence, LANES, PacketBatch, Ray, RayPacket};
use crate::scene::{CameraDesc, Scene};
use glam::{DVec3, Vec3};
use std::fmt::Write;

/// Rays told before the rest is only counted.
const MOST_RAYS: usize = 500;

/// The ray tree of pixel `(x, y)`, one ray a line, deeper ones indented; points and
/// distances in world units.
///
/// # Errors
/// A sentence, if the camera cannot be used ([`CameraDesc::prepare`]).
pub fn explain_pixel(
    scene: &Scene,
    camera: &CameraDesc,
    backend: &AnyBackend,
    job: &Job,
    x: u32,
    y: u32,
) -> Result<String, String> {
    match backend {
        #[cfg(feature = "embree")]
        AnyBackend::Embree(b) => Teller { scene, backend: b, job }.tell(camera, x, y),
        AnyBackend::Native(b) => Teller { scene, backend: b, job }.tell(camera, x, y),
    }
}

struct Teller<'a, B> {
    scene: &'a Scene,
    backend: &'a B,
    job: &'a Job,
}

struct Pending {
    what: &'static str,
    ray: Ray,
    depth: u32,
    weight: Vec3,
}

impl<B: Backend> Teller<'_, B> {
    fn tell(&self, camera: &CameraDesc, x: u32, y: u32) -> Result<String, String> {
        let camera = camera.prepare(&self.scene.frame, self.job.size)?;
        let mut batch = PacketBatch::default();
        Segment { pixels: &[(x, y)], first: 0, samples: 1 }.camera_rays(&camera, self.job, &mut batch);
        let ray = batch.packets()[0].ray.get(0);
        let mut out = format!("pixel {x},{y}\n");
        let mut stack = vec![Pending { what: "camera", ray, depth: 0, weight: Vec3::ONE }];
        let (mut told, mut color) = (0, Vec3::ZERO);
        while let Some(next) = stack.pop() {
            told += 1;
            let mut line = String::new();
            color += self.one_ray(&next, &mut stack, &mut line);
            if told <= MOST_RAYS {
                out.push_str(&line);
            }
        }
        if told > MOST_RAYS {
            writeln!(out, "… and {} rays more", told - MOST_RAYS).expect("a string takes everything");
        }
        writeln!(out, "colour {:.6} {:.6} {:.6} (linear)", color.x, color.y, color.z)
            .expect("a string takes everything");
        Ok(out)
    }

    /// Tells one ray into `out`, puts its branches on the stack, returns what it adds.
    fn one_ray(&self, this: &Pending, stack: &mut Vec<Pending>, out: &mut String) -> Vec3 {
        let indent = "  ".repeat(this.depth as usize + 1);
        let weight = this.weight.max_element();
        let Some(hit) = self.backend.intersect(&this.ray) else {
            let add = this.weight * self.scene.background;
            *out += &format!("{indent}{} weight {weight:.4}: nothing hit, background adds {}\n", this.what, rgb(add));
            return add;
        };
        let mut block = Block::single(self.scene, &this.ray, &hit);
        let point = SurfacePoint::of_lane(&block, 0);
        let m = &self.scene.materials[point.material];
        let p = self.scene.frame.to_world(point.p);
        let far = (point.p - this.ray.o.as_dvec3()).length() * self.scene.frame.world_per_local();
        *out += &format!(
            "{indent}{} weight {weight:.4}: object {} triangle {} '{}' at {:.9} {:.9} {:.9}, distance {far:.9}, normal {:.6} {:.6} {:.6}, {}\n",
            this.what,
            hit.geom_id,
            hit.prim_id,
            m.name,
            p.x,
            p.y,
            p.z,
            point.ns.x,
            point.ns.y,
            point.ns.z,
            if point.entering { "outside" } else { "inside" },
        );
        let own = m.emission + m.ambient * self.scene.ambient;
        *out += &format!("{indent}  ambient and emission: {}\n", rgb(this.weight * own));
        let mut add = this.weight * own;
        for (i, light) in self.scene.lights.iter().enumerate() {
            let mut batch = PacketBatch::<RayPacket>::default();
            let (sent, facing_away) = lights::aim(&block, light, batch.push_packet());
            if sent == 0 {
                let why = if facing_away > 0 { "behind the surface" } else { "nothing to light" };
                *out += &format!("{indent}  light {i}: {why}\n");
                continue;
            }
            self.backend.occluded_many(&mut batch, Coherence::Coherent);
            if batch.packets()[0].is_occluded(0) {
                *out += &format!("{indent}  light {i}: in shadow\n");
                continue;
            }
            block.color = [[0.0; LANES]; 3];
            lights::add(&mut block, light, &batch.packets()[0]);
            let lit = this.weight * Block::vec3(&block.color, 0);
            *out += &format!("{indent}  light {i}: {}\n", rgb(lit));
            add += lit;
        }
        self.branches(this, &point, stack, out, &indent);
        add
    }

    fn branches(&self, this: &Pending, point: &SurfacePoint, stack: &mut Vec<Pending>, out: &mut String, indent: &str) {
        let m = &self.scene.materials[point.material];
        if !(m.reflects() || m.refracts()) {
            return;
        }
        let d: DVec3 = -point.to_eye.as_dvec3().normalize();
        let (reflected, refracted) = shade::branches(m, point, d);
        // The stack gives back the last first: the mirrored branch is told first.
        for (what, branch) in [("refracted", refracted), ("reflected", reflected)] {
            let Some(branch) = branch else { continue };
            let weight = this.weight * branch.weight;
            if this.depth >= self.job.k_max || weight.max_element() < self.job.min_weight {
                *out += &format!("{indent}  {what} weight {:.6}: cut\n", weight.max_element());
                continue;
            }
            let ray = Ray::new(point.origin_towards(branch.d), branch.d.as_vec3());
            stack.push(Pending { what, ray, depth: this.depth + 1, weight });
        }
    }
}

fn rgb(c: Vec3) -> String {
    format!("{:.6} {:.6} {:.6}", c.x, c.y, c.z)
}
