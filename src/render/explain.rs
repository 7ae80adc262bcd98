//! One pixel told in words: every ray of its first sample and what became of it.

use super::aim::{self, Asked, Rules, Shine};
use super::block::{Block, Path};
use super::job::Job;
use super::known::Known;
use super::lights;
use super::media::Media;
use super::shade::Onwards;
use super::surface::SurfacePoint;
use super::tile::Segment;
use crate::backend::{AnyBackend, Backend};
use crate::geom::{Coherence, Hit, PacketBatch, Ray, RayPacket};
use crate::scene::{CameraDesc, Needs, Scene};
use glam::{DVec3, Vec3};
use std::fmt::Write;

/// Rays told before the rest is only counted.
const MOST_RAYS: usize = 500;

/// Deeper rays are not moved further to the right.
const MOST_INDENT: usize = 40;

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

/// The pixel and what its rays have in common.
struct Told<'a> {
    segment: Segment<'a>,
    seen_from: Option<DVec3>,
    clip: Option<(f64, f64)>,
    known: Known,
    needs: Needs,
    media: Media,
    out: String,
}

struct Pending {
    what: &'static str,
    ray: Ray,
    path: Path,
}

impl<B: Backend> Teller<'_, B> {
    fn tell(&self, camera: &CameraDesc, x: u32, y: u32) -> Result<String, String> {
        let camera = camera.prepare(&self.scene.frame, self.job.size)?;
        let mut batch = PacketBatch::default();
        let sampling = self.job.sampling(&camera);
        let segment = Segment { pixels: &[(x, y)], first: 0, samples: 1, sampling: &sampling };
        segment.camera_rays(&camera, self.job, &mut batch);
        let ray = batch.packets()[0].ray.get(0);
        let needs = self.scene.needs();
        let mut told = Told {
            segment,
            seen_from: self.scene.course_rules.then_some(camera.eye),
            clip: camera.clip,
            known: Known::of(self.scene, &camera, self.job, &needs),
            needs,
            media: Media::new(),
            out: String::new(),
        };
        let mut out = format!("pixel {x},{y}\n");
        if self.job.has_negative_samples() {
            let weight = told.segment.weight(0, self.job);
            writeln!(out, "filter {}: the sample counts {weight:.6}", self.job.filter.name())
                .expect("a string takes everything");
        }
        let mut stack = vec![Pending { what: "camera", ray, path: Path::of_sample(0) }];
        let (mut count, mut color) = (0, Vec3::ZERO);
        while let Some(next) = stack.pop() {
            count += 1;
            told.out.clear();
            color += self.one_ray(&next, &mut stack, &mut told);
            if count <= MOST_RAYS {
                out.push_str(&told.out);
            }
        }
        if count > MOST_RAYS {
            writeln!(out, "… and {} rays more", count - MOST_RAYS).expect("a string takes everything");
        }
        writeln!(out, "colour {:.6} {:.6} {:.6} (linear)", color.x, color.y, color.z)
            .expect("a string takes everything");
        Ok(out)
    }

    /// What a ray meets, and how far away in scene units.
    fn meet(&self, this: &Pending, clip: Option<(f64, f64)>) -> Option<(Hit, f64)> {
        let hit = self.backend.intersect(&this.ray)?;
        let far = this.ray.d.as_dvec3().length() * f64::from(hit.t);
        let seen = this.path.depth > 0 || clip.is_none_or(|(near, far_end)| (near..=far_end).contains(&far));
        seen.then_some((hit, far))
    }

    /// Tells one ray, puts its branches on the stack, returns what it adds.
    fn one_ray(&self, this: &Pending, stack: &mut Vec<Pending>, told: &mut Told<'_>) -> Vec3 {
        let indent = "  ".repeat((this.path.depth as usize).min(MOST_INDENT) + 1);
        let met = self.meet(this, told.clip);
        let distance = met.map_or(f64::INFINITY, |(_, far)| far);
        let path = Path { weight: told.media.absorbed(&self.scene.materials, &this.path, distance), ..this.path };
        let weight = path.weight.max_element();
        let Some((hit, far)) = met else {
            let add = path.weight * self.scene.background;
            told.out +=
                &format!("{indent}{} weight {weight:.4}: nothing hit, background adds {}\n", this.what, rgb(add));
            return add;
        };
        let block = Block::single(self.scene, &this.ray, &hit, &path);
        let point = SurfacePoint::of_lane(&block, 0);
        let m = &self.scene.materials[point.material];
        let p = self.scene.frame.to_world(point.p);
        let far = far * self.scene.frame.world_per_local();
        let kind = if self.scene.objects[hit.geom_id as usize].mesh().is_some() { "triangle" } else { "shape" };
        told.out += &format!(
            "{indent}{} weight {weight:.4}: object {} {kind} {} '{}' at {:.9} {:.9} {:.9}, distance {far:.9}, normal {:.6} {:.6} {:.6}, {}\n",
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
        let own = path.weight * Block::vec3(&block.color, 0);
        told.out += &format!("{indent}  ambient and emission: {}\n", rgb(own));
        let mut add = own;
        for index in 0..told.known.lights.len() {
            add += self.light(index, &block, &indent, told);
        }
        self.branches(&path, &block, stack, told, &indent);
        add
    }

    /// Tells about one light and returns what it adds.
    fn light(&self, index: usize, block: &Block, indent: &str, told: &mut Told<'_>) -> Vec3 {
        let light = &told.known.lights[index];
        let faint = Rules::FAINT_SHARE * self.job.min_weight;
        let rules = Rules { faint, outside: told.known.enclosures.is_outside(index), power: false };
        let (mut batch, mut shine) = (PacketBatch::<RayPacket>::default(), Shine::NONE);
        let asked = aim::at_center(block, light, told.seen_from, rules, batch.push_packet(), &mut shine);
        let rounds = if light.radius > 0.0 { self.job.light_samples.max(1) } else { 1 };
        let (samples, sample) = told.segment.samples_of(0);
        let mut through = 0.0;
        for round in 0..rounds {
            if light.radius > 0.0 {
                let points = lights::points_on(block, light, |lane| {
                    samples.on_light(sample * rounds + round, index as u32, block.branch[lane])
                });
                batch.clear();
                aim::at_points(block, &points, asked.sent, batch.push_packet());
            }
            self.backend.occluded_many(&mut batch, Coherence::Coherent);
            through += lights::unoccluded(&batch.packets()[0])[0];
        }
        let visible = through / rounds as f32;
        if visible == 0.0 {
            told.out += &format!("{indent}  light {index}: {}\n", why_dark(asked));
            return Vec3::ZERO;
        }
        let lit = Block::vec3(&block.weight, 0) * (Block::vec3(&shine.add, 0) * visible);
        let part = if visible < 1.0 { format!(" ({:.0} % of it visible)", 100.0 * visible) } else { String::new() };
        told.out += &format!("{indent}  light {index}: {}{part}\n", rgb(lit));
        lit
    }

    fn branches(&self, path: &Path, block: &Block, stack: &mut Vec<Pending>, told: &mut Told<'_>, indent: &str) {
        let m = &self.scene.materials[block.material[0] as usize];
        if !told.needs.may_branch(m) {
            return;
        }
        let mut onwards = Onwards::default();
        onwards.find(self.scene, &told.known.contacts, &mut told.media, block, 1);
        let sent = onwards.lane(self.scene, block, 0);
        // The stack gives back the last first: the mirrored branch is told first.
        let ways = [("refracted", sent.refracted, 1, sent.behind), ("reflected", sent.reflected, 0, path.medium)];
        for (what, branch, kind, medium) in ways {
            let Some(branch) = branch else { continue };
            let weight = path.weight * branch.weight;
            if path.depth >= self.job.k_max || weight.max_element() < self.job.min_weight {
                told.out += &format!("{indent}  {what} weight {:.6}: cut\n", weight.max_element());
                continue;
            }
            let ray = Ray::new(branch.o, branch.d);
            let branch = path.branch.bounced(kind);
            stack.push(Pending { what, ray, path: Path { depth: path.depth + 1, weight, branch, medium, ..*path } });
        }
    }
}

fn why_dark(asked: Asked) -> &'static str {
    match asked {
        Asked { sent: 1.., .. } => "in shadow",
        Asked { facing_away: 1.., .. } => "behind the surface",
        Asked { enclosed: 1.., .. } => "outside of the shape that the point is inside of",
        Asked { faint: 1.., .. } => "too faint: cut",
        _ => "nothing to light",
    }
}

fn rgb(c: Vec3) -> String {
    format!("{:.6} {:.6} {:.6}", c.x, c.y, c.z)
}
