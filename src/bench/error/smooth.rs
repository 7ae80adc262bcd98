//! Pixels without an edge of any kind in them: there an integrand is smooth, and a good sampler shows what it can.

use super::subject::Subject;
use crate::backend::{AnyBackend, BackendKind};
use crate::geom::{PacketBatch, Ray, RayHitPacket};
use crate::math::{Branch, PixelSamples, Sampling, concentric_disc};
use crate::render::tile::Segment;
use crate::render::{Job, SurfacePoint, Surfaces};
use crate::scene::{Camera, CameraDesc, Light, Scene};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Rays through each pixel and its lens.
pub const SAMPLES: u32 = 256;
/// That are traced at once.
const AT_ONCE: u32 = 16;
/// Of the rays; no picture has it.
const SEED: u32 = 0x5300_0000;
/// Least cosine between normals.
const ALIKE: f64 = 0.9;
/// End of a shadow ray: just short of the light.
const BEFORE_THE_LIGHT: f32 = 1.0 - 2.0 * f32::EPSILON;
/// Lights that are looked at; where there are more, the others are taken for alike.
const LIGHTS: usize = 64;

/// In words, for the report.
pub const DEFINITION: &str = "A pixel is smooth if all of 256 rays through it and the lens meet the same primitive with \
    normals alike (cosine above 0.9), all see the same lights unoccluded (one point each of those that have a size), and \
    the material neither mirrors nor refracts nor has an image. For this, pixel, lens and lights are taken as 1.5 times as \
    wide as they are: an edge that 256 rays may miss shows in 4096.";
/// How much wider.
const WIDER: f64 = 1.5;

/// Of each pixel, row by row: whether it is smooth.
///
/// # Errors
/// A sentence, if the camera cannot be used.
pub fn pixels(subject: &Subject) -> Result<Vec<bool>, String> {
    let (width, height) = subject.job.size;
    let wide = CameraDesc { aperture: WIDER * subject.camera.aperture, ..subject.camera };
    let camera = wide.prepare(&subject.scene.frame, subject.job.size)?;
    let jitter_radius = WIDER * subject.job.jitter_radius;
    let job = Job { spp: SAMPLES, seed: SEED, jitter_radius, ..subject.job.clone() };
    let sampling = job.sampling(&camera);
    let backend = subject.backend(BackendKind::Native);
    let row = |y: u32| {
        let mut look = Look {
            scene: &subject.scene,
            camera: &camera,
            job: &job,
            sampling: &sampling,
            backend,
            surfaces: Surfaces::new(&subject.scene),
        };
        (0..width).map(|x| look.is_smooth((x, y))).collect::<Vec<_>>()
    };
    Ok((0..height).into_par_iter().flat_map_iter(row).collect())
}

struct Look<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    job: &'a Job,
    sampling: &'a Sampling,
    backend: &'a AnyBackend,
    surfaces: Surfaces<'a>,
}

impl Look<'_> {
    fn is_smooth(&mut self, pixel: (u32, u32)) -> bool {
        let mut first: Option<(SurfacePoint, u64)> = None;
        let mut batch = PacketBatch::<RayHitPacket>::default();
        for sample in (0..SAMPLES).step_by(AT_ONCE as usize) {
            let segment = Segment { pixels: &[pixel], first: sample, samples: AT_ONCE, sampling: self.sampling };
            segment.camera_rays(self.camera, self.job, &mut batch);
            self.backend.as_dyn().intersect_many(&mut batch, crate::geom::Coherence::Coherent);
            for packet in batch.packets() {
                let points = self.surfaces.of(packet, AT_ONCE as usize);
                for (lane, point) in points.into_iter().enumerate() {
                    let shown = point.filter(|p| self.is_seen(p, &packet.ray.get(lane)) && self.is_matte(p));
                    let Some(point) = shown else { return false };
                    let (samples, number) = segment.samples_of(lane as u32);
                    let lit = self.lights_seen(&point, samples, number);
                    let (as_first, lit_first) = first.get_or_insert((point, lit));
                    let alike = point.id == as_first.id && point.ns.dot(as_first.ns) > ALIKE && lit == *lit_first;
                    if !alike {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// Whether the camera shows what is so far away.
    fn is_seen(&self, point: &SurfacePoint, ray: &Ray) -> bool {
        let far = (point.p - ray.o.as_dvec3()).length();
        self.camera.clip.is_none_or(|(near, far_end)| (near..=far_end).contains(&far))
    }

    fn is_matte(&self, point: &SurfacePoint) -> bool {
        let material = &self.scene.materials[point.material];
        !(material.reflects() || material.refracts() || material.texture.is_some())
    }

    /// A bit for each light that shines on the point.
    fn lights_seen(&self, point: &SurfacePoint, samples: PixelSamples<'_>, number: u32) -> u64 {
        let lights = self.scene.lights.iter().filter(|light| light.color != Vec3::ZERO);
        lights.take(LIGHTS).enumerate().fold(0, |seen, (i, light)| {
            let square = if light.radius > 0.0 { samples.on_light(number, i as u32, Branch::CAMERA) } else { [0.5; 2] };
            let to = place_on(light, point.p, square) - point.p;
            let faces = point.ng.dot(to) > 0.0 && point.ns.dot(to) > 0.0;
            let start = point.origin_towards(point.ng);
            let along = (point.p + to - start.as_dvec3()).as_vec3();
            let lit = faces && !self.backend.as_dyn().occluded(&Ray::segment(start, along, BEFORE_THE_LIGHT));
            seen | u64::from(lit) << i
        })
    }
}

/// A point of the disc that a light that is [`WIDER`] shows to `p`.
fn place_on(light: &Light, p: DVec3, [u, v]: [f64; 2]) -> DVec3 {
    let (across, up) = (light.position - p).normalize_or(DVec3::Z).any_orthonormal_pair();
    let disc = WIDER * light.radius * concentric_disc(u, v);
    light.position + across * disc.x + up * disc.y
}

#[cfg(test)]
mod tests {
    use super::super::Options;
    use super::*;
    use std::path::PathBuf;

    /// `text` as a scene seen by 12 by 8 pixels.
    fn mask(text: &str) -> Vec<bool> {
        let folder = tempfile::tempdir().expect("there is room");
        let path: PathBuf = folder.path().join("a.toml");
        std::fs::write(&path, text).expect("there is room");
        let options = Options { size: Some((12, 8)), ..Options::quick(vec![path]) };
        let subjects = Subject::all(&options).expect("a good scene");
        pixels(&subjects[0]).expect("a good camera")
    }

    /// A square that fills the view, of which the sixth to the right is in another material.
    fn scene(camera: &str, more: &str) -> String {
        format!(
            "tison = 1\n[camera.main]\neye = [0, 0, 4]\ntarget = [0, 0, 0]\ntype = 'orthographic'\nheight = 2\n{camera}\n\
             [light.lamp]\nposition = [0, 3, 3]\ncolor = 1\n[material.dull]\ncolor = 0.5\n[material.mirror]\nreflect = 0.5\n\
             [[object]]\nshape = 'quad'\nhalf = 9\nmaterial = 'dull'\n{more}"
        )
    }

    fn count(mask: &[bool]) -> usize {
        mask.iter().filter(|&&m| m).count()
    }

    #[test]
    fn a_plain_wall_is_smooth_and_edges_shadows_and_mirrors_are_not() {
        assert_eq!(count(&mask(&scene("", ""))), 96, "all of a wall");
        // A strip up to the middle of the fourth column, which throws no shadow to speak of.
        let strip = "[[object]]\nshape = 'cube'\nhalf = [0.875, 9, 0.001]\nmaterial = 'dull'\n\
                     transform = [{ translate = [-1.5, 0, 0.001] }]\n";
        let with_strip = mask(&scene("", strip));
        assert!((0..8).all(|y| with_strip[12 * y] && with_strip[12 * y + 2]), "within the strip");
        assert!((0..8).all(|y| !with_strip[12 * y + 3]), "its edge is in the middle of the pixel");
        assert!((0..8).all(|y| with_strip[12 * y + 5]), "beyond");
        assert_eq!(count(&mask(&scene("", &strip.replace("dull", "mirror")))), 8 * 8, "mirrors are not smooth");
        // Seen from all points of the lens, the strip's edge is wider.
        let lens = "lens = { radius = 0.8, focus = 2 }";
        assert!(count(&mask(&scene(lens, strip))) < count(&with_strip));
        // Far before the wall, out of the picture: its shadow has edges.
        let roof = "[[object]]\nshape = 'cube'\nhalf = [9, 0.1, 0.1]\nmaterial = 'dull'\ntransform = [{ translate = [0, 1.5, 1.5] }]\n";
        let shadow = count(&mask(&scene("", roof)));
        assert!((12..96).contains(&shadow), "{shadow}");
    }

    #[test]
    fn nothing_at_all_is_not_smooth() {
        assert_eq!(
            count(&mask(
                "tison = 1\n[camera.main]\neye = [0, 0, 9]\ntarget = [0, 0, 0]\nfov = 10\n\
            [[object]]\nshape = 'sphere'\ncenter = [99, 0, 0]\n"
            )),
            0
        );
    }
}
