//! From a frozen scene and a backend to a film: tiles, waves of rays, shading.

mod adapt;
mod aim;
mod area;
pub(crate) mod block;
mod certificate;
mod contacts;
mod enclosures;
mod estimate;
mod explain;
pub(crate) mod facets;
mod gathered;
mod job;
mod known;
mod lights;
mod media;
pub mod optics;
pub(crate) mod paint;
mod paths;
mod pixel;
mod reach;
mod rounds;
mod shade;
mod shadows;
mod shapes;
mod surface;
mod surfaces;
pub(crate) mod tile;
mod wave;
mod worker;

pub use explain::explain_pixel;
pub use job::{Adapted, Control, Crop, Ended, Job, Outcome, RayCounts, RenderStats, Stop, Work};
pub use surface::SurfacePoint;
pub use surfaces::Surfaces;

use crate::backend::{AnyBackend, Backend};
use crate::film::{Aov, Film};
use crate::math::{Sampler, Sampling};
use crate::scene::{Camera, CameraDesc, Needs, Scene, Skip};
use adapt::Progress;
use area::Area;
use estimate::{ErrorSum, Twice};
use gathered::Tally;
use known::Known;
use pixel::{FirstHits, PixelSum};
use rounds::Rounds;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use worker::TileWorker;

/// Renders on the current rayon pool. The same scene, job and backend give the same bytes,
/// however many threads there are.
///
/// # Errors
/// A sentence, if the camera cannot be used ([`CameraDesc::prepare`]), or if samples are to be stratified and their number to be
/// found.
pub fn run(
    scene: &Scene,
    camera: &CameraDesc,
    backend: &AnyBackend,
    job: &Job,
    control: &Control,
) -> Result<Outcome, String> {
    match backend {
        #[cfg(feature = "embree")]
        AnyBackend::Embree(b) => run_with(scene, camera, b, job, control),
        AnyBackend::Native(b) => run_with(scene, camera, b, job, control),
    }
}

/// Memory that adaptive sampling takes, for refusing an image before it is begun.
#[must_use]
pub fn bytes_per_pixel(aovs: &[Aov]) -> u64 {
    let hits = if aovs.is_empty() { 0 } else { size_of::<FirstHits>() };
    // Its place and its sums, as much again for one in four; what is looked at between rounds.
    (size_of::<(u32, u32)>() + size_of::<PixelSum>() * 5 / 4 + hits + size_of::<Progress>() + size_of::<u64>() + 1)
        as u64
}

/// As [`run`], for any implementation of the seam.
///
/// # Errors
/// As [`run`].
pub fn run_with<B: Backend>(
    scene: &Scene,
    camera: &CameraDesc,
    backend: &B,
    job: &Job,
    control: &Control,
) -> Result<Outcome, String> {
    let job = &job.settled();
    let camera = camera.prepare(&scene.frame, job.size)?;
    if job.is_adaptive() && job.sampler == Sampler::Stratified {
        return Err("stratified samples are spread as a whole: how many there are must be known before".into());
    }
    let needs = Needs::of(scene, job.skips);
    let sampling = job.sampling(&camera);
    let twice = (job.is_adaptive() || (job.estimate && job.spp > 1)).then(|| Twice::of(job.crop, job.seed));
    let outcome = if needs.secondary_rays() || !job.skips.has(Skip::Secondary) {
        Render::<B, true> { scene, camera, backend, job, control, needs, sampling, twice }.run()
    } else {
        Render::<B, false> { scene, camera, backend, job, control, needs, sampling, twice }.run()
    };
    Ok(outcome)
}

struct Render<'a, B, const SECONDARY: bool> {
    scene: &'a Scene,
    camera: Camera,
    backend: &'a B,
    job: &'a Job,
    control: &'a Control,
    needs: Needs,
    /// Where samples lie.
    sampling: Sampling,
    /// Pixels that are sampled twice, if the error is to be estimated.
    twice: Option<Twice>,
}

/// What all tiles add up to.
struct Sum {
    film: Film,
    tally: Tally,
    /// As in [`Bound`](certificate::Bound).
    cut_max: [f64; 2],
    /// One per tile, summed in the tiles' order at the end: the figure too is the same for
    /// any number of threads.
    cut_of_tile: Vec<[f64; 2]>,
    /// Likewise; zero unless the error is estimated.
    error_of_tile: Vec<ErrorSum>,
    samples: u64,
    non_finite: u64,
}

impl Sum {
    /// What was cut off in the pixels of a tile.
    fn note_cut(&mut self, tile: usize, pixels: impl Iterator<Item = [f64; 2]>) {
        let mut total = [0.0; 2];
        for cut in pixels {
            for ((max, total), own) in self.cut_max.iter_mut().zip(&mut total).zip(cut) {
                *max = max.max(own);
                *total += own;
            }
        }
        self.cut_of_tile[tile] = total;
    }
}

/// What the tiles of a render have in common.
struct Common {
    started: Instant,
    tiles: Vec<Crop>,
    known: Known,
}

impl<B: Backend, const SECONDARY: bool> Render<'_, B, SECONDARY> {
    fn run(&self) -> Outcome {
        let common = Common {
            started: Instant::now(),
            tiles: tile::tiles(self.job.crop),
            known: Known::of(self.scene, &self.camera, self.job, &self.needs),
        };
        match self.twice {
            Some(twice) if self.job.is_adaptive() => Rounds::new(self, &common, twice).run(),
            _ => self.all_at_once(&common),
        }
    }

    /// Every tile gets all of its samples, goes into the film and is forgotten.
    fn all_at_once(&self, common: &Common) -> Outcome {
        let sum = Mutex::new(self.nothing(common));
        let next = AtomicUsize::new(0);
        rayon::broadcast(|_| {
            let mut worker = TileWorker::new(self, common);
            let mut area = Area::default();
            while !self.control.is_cancelled() {
                let index = next.fetch_add(1, Relaxed);
                let Some(&tile) = common.tiles.get(index) else { break };
                area.become_tile(tile, self.job, self.twice.as_ref());
                if !area.begin(&mut worker, self.job.spp, self.twice.as_ref()) {
                    break;
                }
                area.settle();
                let mut sum = lock(&sum);
                let pixels = area.hand_in::<SECONDARY>(index, self.job.crop, &mut sum);
                self.control.pixels.fetch_add(pixels as u64, Relaxed);
            }
            lock(&sum).tally.add(&worker.waves.tally);
        });
        let sum = sum.into_inner().unwrap_or_else(PoisonError::into_inner);
        self.outcome(common, sum, None)
    }

    fn nothing(&self, common: &Common) -> Sum {
        let crop = self.job.crop;
        Sum {
            film: Film::new(crop.x1 - crop.x0, crop.y1 - crop.y0, &self.job.aovs),
            tally: Tally::default(),
            cut_max: [0.0; 2],
            cut_of_tile: vec![[0.0; 2]; common.tiles.len()],
            error_of_tile: vec![ErrorSum::default(); if self.twice.is_some() { common.tiles.len() } else { 0 }],
            samples: 0,
            non_finite: 0,
        }
    }

    fn outcome(&self, common: &Common, sum: Sum, adapted: Option<Adapted>) -> Outcome {
        let pixels = (sum.film.finished.max(1)) as f64;
        let brightest = f64::from(sum.tally.brightest);
        let in_all = |cut: &[f64; 2]| cut[0] + brightest * cut[1];
        let mut error = ErrorSum::default();
        sum.error_of_tile.iter().for_each(|tile| error.merge(tile));
        let stats = RenderStats {
            seconds: common.started.elapsed().as_secs_f64(),
            rays: sum.tally.rays,
            rays_for_estimate: sum.tally.again,
            samples: sum.samples,
            sampling_rmse: error.rmse(),
            adapted,
            cut_off_max: in_all(&sum.cut_max),
            cut_off_mean: sum.cut_of_tile.iter().map(in_all).sum::<f64>() / pixels,
            cut_off_is_estimate: !common.known.radiance.is_proved() && sum.cut_max[1] > 0.0,
            non_finite_samples: sum.non_finite,
            shadow_rays_facing_away: sum.tally.facing_away,
            shadow_rays_enclosed: sum.tally.enclosed,
            shadow_rays_faint: sum.tally.faint,
            rays_inside: sum.tally.inside,
            branches_below_cut: sum.tally.below_cut,
            work: sum.tally.work,
            packets_outside: sum.tally.packets_outside,
            blocks_without_highlight: sum.tally.dull,
        };
        Outcome { film: sum.film, stats }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
