//! Rays of all kinds, and how many a second are answered.

use super::subject::Sight;
use super::trio::{Asked, Trio, timed};
use super::{Error, Round};
use crate::backend::{AnyBackend, Backend};
use crate::bench::record::{Recording, Tapes};
use crate::geom::{LANES, PacketBatch, Ray, RayHitPacket, RayPacket, RayQueue};
use crate::math::Random;
use crate::render::{self, Control, Job, Surfaces};
use crate::scene::{Scene, Skip, Skips};
use glam::{DVec2, DVec3};
use rayon::ThreadPool;
use rayon::prelude::*;
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Pixels along a side of what the camera sees.
const SIDE: u32 = 512;
/// The same of what is rendered.
const RENDERED: u32 = 1024;
/// Time for the rounds of one row.
const ENOUGH: Duration = Duration::from_secs(5);
/// Rays that one thread takes at a time.
const CHUNK: usize = 4096;

/// Rays and how they are asked.
pub(super) struct Work {
    name: &'static str,
    rays: Rays,
}

enum Rays {
    Singly(Vec<Ray>),
    /// As they were asked, and the memory for the answers.
    Nearest(Vec<PacketBatch<RayHitPacket>>, Vec<PacketBatch<RayHitPacket>>),
    Any(Vec<PacketBatch<RayPacket>>, Vec<PacketBatch<RayPacket>>),
}

impl Work {
    pub(super) fn name(&self) -> &'static str {
        self.name
    }

    /// Mrays per second, in turn.
    pub(super) fn rounds(&mut self, trio: &Trio, pool: &ThreadPool, rounds: usize) -> Result<Vec<Round>, Error> {
        let asked = trio.asked();
        in_turn(rounds, || Ok(asked.each_ref().map(|a| Some(self.rate(a.as_deref()?, pool)))))
    }

    fn rate(&mut self, asked: &dyn Asked, pool: &ThreadPool) -> f64 {
        let (rays, seconds) = match &mut self.rays {
            Rays::Singly(rays) => {
                let sum = || black_box(rays.par_chunks(CHUNK).map(|chunk| asked.singly(chunk)).sum::<f32>());
                (rays.len(), timed(pool, sum).1)
            }
            Rays::Nearest(fresh, work) => {
                work.clone_from(fresh);
                (count(fresh), timed(pool, || work.par_iter_mut().for_each(|batch| asked.nearest(batch))).1)
            }
            Rays::Any(fresh, work) => {
                work.clone_from(fresh);
                (count(fresh), timed(pool, || work.par_iter_mut().for_each(|batch| asked.any(batch))).1)
            }
        };
        rays as f64 / seconds / 1e6
    }
}

fn count<P: RayQueue>(batches: &[PacketBatch<P>]) -> usize {
    batches.iter().map(PacketBatch::len).sum()
}

fn batches<P: RayQueue>(rays: &[Ray]) -> Vec<PacketBatch<P>> {
    let batch = |rays: &[Ray]| {
        let mut batch = PacketBatch::default();
        rays.iter().for_each(|ray| batch.push(ray));
        batch
    };
    rays.chunks(CHUNK).map(batch).collect()
}

/// Rays of all kinds through what there is to see.
pub(super) fn all(sight: &Sight, trio: &Trio) -> Result<Vec<Work>, Error> {
    let scene = &sight.scene;
    let camera = camera_rays(sight)?;
    let (shadow, bounced) = rays_from_hits(scene, trio.native.as_dyn(), &camera);
    let bounds = scene.local_bounds();
    let mut random = Random(13);
    let place = |random: &mut Random| bounds.center() + 0.5 * bounds.size() * random.point();
    let anywhere = |_| Ray::new(place(&mut random).as_vec3(), random.direction().as_vec3());
    let random: Vec<Ray> = (0..camera.len() / 2).map(anywhere).collect();
    Ok(vec![
        Work { name: "camera, packets", rays: Rays::Nearest(batches(&camera), Vec::new()) },
        Work { name: "camera, single", rays: Rays::Singly(camera) },
        Work { name: "shadow, packets", rays: Rays::Any(batches(&shadow), Vec::new()) },
        Work { name: "bounced, single", rays: Rays::Singly(bounced) },
        Work { name: "random, single", rays: Rays::Singly(random) },
    ])
}

/// One ray per pixel, in blocks of 4 x 4.
fn camera_rays(sight: &Sight) -> Result<Vec<Ray>, Error> {
    let camera = sight.camera.prepare(&sight.scene.frame, (SIDE, SIDE)).map_err(Error::Camera)?;
    let lanes = LANES as u32;
    let ray = |i: u32| {
        let (block, lane) = (i / lanes, i % lanes);
        let (x, y) = (block % (SIDE / 4) * 4 + lane % 4, block / (SIDE / 4) * 4 + lane / 4);
        let (o, d) = camera.ray(f64::from(x) + 0.500_37, f64::from(y) + 0.500_61, DVec2::ZERO);
        Ray::new(o.as_vec3(), d.as_vec3())
    };
    Ok((0..SIDE * SIDE).map(ray).collect())
}

/// From what the camera sees to one light, and on in a random direction.
fn rays_from_hits(scene: &Scene, backend: &dyn Backend, camera: &[Ray]) -> (Vec<Ray>, Vec<Ray>) {
    let (bounds, mut random) = (scene.local_bounds(), Random(11));
    let light = bounds.center() + bounds.size().length() * DVec3::new(0.6, 1.0, 0.9);
    let (mut shadow, mut bounced) = (Vec::new(), Vec::new());
    let (mut surfaces, mut packet) = (Surfaces::new(scene), RayHitPacket::EMPTY);
    for ray in camera {
        packet.ray.set(0, ray);
        packet.set_hit(0, backend.intersect(ray).as_ref());
        let Some(point) = surfaces.of(&packet, 1)[0] else { continue };
        let (start, normal) = (point.origin_towards(point.ng), point.ng);
        let to_light = light - start.as_dvec3();
        if normal.dot(to_light) > 0.0 {
            shadow.push(Ray::segment(start, to_light.as_vec3(), 1.0));
        }
        bounced.push(Ray::new(start, (normal + 0.999 * random.direction()).as_vec3()));
    }
    (shadow, bounced)
}

/// Mrays per second of whole renders, camera and shadow rays, and of the bare loop over the rays of the one through
/// Embree.
pub(super) fn renders(sight: &Sight, trio: &Trio, pool: &ThreadPool, rounds: usize) -> Result<Vec<Round>, Error> {
    let (scene, camera) = (&sight.scene, &sight.camera);
    // The bare loop is asked about rays that pass the scene too.
    let job = Job { k_max: 0, skips: Skips::ALL.without(Skip::Bounds), ..Job::whole((RENDERED, RENDERED)) };
    let tapes: Option<Tapes> = match &trio.embree {
        #[cfg(feature = "embree")]
        Some(AnyBackend::Embree(embree)) => {
            Some(Tapes::of(scene, camera, embree, &job, pool).map_err(Error::Camera)?.0)
        }
        _ => None,
    };
    let rendered = |backend: &AnyBackend| -> Result<f64, Error> {
        let outcome = pool.install(|| render::run(scene, camera, backend, &job, &Control::default()));
        let stats = outcome.map_err(Error::Camera)?.stats;
        Ok(stats.rays.total() as f64 / stats.seconds / 1e6)
    };
    let bare = trio.bare();
    let replayed = || {
        let (tapes, bare) = (tapes.as_ref()?, bare.as_deref()?);
        let spent = tapes.replay(pool, |recording| match recording {
            Recording::Nearest(batch, _) => bare.nearest(batch),
            Recording::Any(batch) => bare.any(batch),
        });
        Some(tapes.rays() as f64 / spent.as_secs_f64() / 1e6)
    };
    in_turn(rounds, || Ok([Some(rendered(&trio.native)?), trio.embree.as_ref().map(rendered).transpose()?, replayed()]))
}

/// What `round` answers so many times, or fewer when [`ENOUGH`] is over, after a first time that warms the caches.
fn in_turn(rounds: usize, mut round: impl FnMut() -> Result<Round, Error>) -> Result<Vec<Round>, Error> {
    round()?;
    let started = Instant::now();
    let mut all = vec![round()?];
    while all.len() < rounds && started.elapsed() < ENOUGH {
        all.push(round()?);
    }
    Ok(all)
}
