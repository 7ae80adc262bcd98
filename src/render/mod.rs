//! From a frozen scene and a backend to a film: tiles, waves of rays, shading.

pub(crate) mod block;
mod certificate;
mod contacts;
mod explain;
pub(crate) mod facets;
mod job;
mod lights;
mod media;
pub mod optics;
pub(crate) mod paint;
mod shade;
mod shapes;
mod surface;
mod surfaces;
pub(crate) mod tile;
mod wave;

pub use explain::explain_pixel;
pub use job::{Control, Crop, Job, Outcome, RayCounts, RenderStats};
pub use surface::SurfacePoint;
pub use surfaces::Surfaces;

use crate::backend::{AnyBackend, Backend};
use crate::film::{Aov, AovImage, Film};
use crate::geom::{Coherence, LANES, PacketBatch, RayHitPacket};
use crate::scene::{Camera, CameraDesc, Needs, Scene};
use certificate::Radiance;
use contacts::Contacts;
use glam::{DVec3, Vec3};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;
use wave::{Tally, Waves};

/// Renders on the current rayon pool. The same scene, job and backend give the same bytes,
/// however many threads there are.
///
/// # Errors
/// A sentence, if the camera cannot be used ([`CameraDesc::prepare`]).
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
    let camera = camera.prepare(&scene.frame, job.size)?;
    let needs = scene.needs();
    let outcome = if needs.secondary_rays() {
        Render::<B, true> { scene, camera, backend, job, control, needs }.all_tiles()
    } else {
        Render::<B, false> { scene, camera, backend, job, control, needs }.all_tiles()
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
    non_finite: u64,
}

impl<B: Backend, const SECONDARY: bool> Render<'_, B, SECONDARY> {
    fn all_tiles(&self) -> Outcome {
        let started = Instant::now();
        let crop = self.job.crop;
        let tiles = tile::tiles(crop);
        let radiance = Radiance::of(self.scene, &self.needs, self.job.k_max);
        let contacts = if self.needs.refraction { Contacts::of(self.scene) } else { Contacts::default() };
        let sum = Mutex::new(Sum {
            film: Film::new(crop.x1 - crop.x0, crop.y1 - crop.y0, &self.job.aovs),
            tally: Tally::default(),
            cut_max: [0.0; 2],
            cut_of_tile: vec![[0.0; 2]; tiles.len()],
            non_finite: 0,
        });
        let next = AtomicUsize::new(0);
        rayon::broadcast(|_| {
            let mut worker = TileWorker::new(self, &radiance, &contacts);
            while !self.control.is_cancelled() {
                let index = next.fetch_add(1, Relaxed);
                let Some(&tile) = tiles.get(index) else { break };
                if !worker.render(tile) {
                    break;
                }
                let mut sum = sum.lock().unwrap_or_else(PoisonError::into_inner);
                worker.hand_in(tile, index, &mut sum);
            }
            sum.lock().unwrap_or_else(PoisonError::into_inner).tally.add(&worker.waves.tally);
        });
        let sum = sum.into_inner().unwrap_or_else(PoisonError::into_inner);
        let pixels = (sum.film.finished.max(1)) as f64;
        let brightest = f64::from(sum.tally.brightest);
        let in_all = |cut: &[f64; 2]| cut[0] + brightest * cut[1];
        let stats = RenderStats {
            seconds: started.elapsed().as_secs_f64(),
            rays: sum.tally.rays,
            cut_off_max: in_all(&sum.cut_max),
            cut_off_mean: sum.cut_of_tile.iter().map(in_all).sum::<f64>() / pixels,
            cut_off_is_estimate: !radiance.is_proved() && sum.cut_max[1] > 0.0,
            non_finite_samples: sum.non_finite,
            shadow_rays_facing_away: sum.tally.facing_away,
            branches_below_cut: sum.tally.below_cut,
        };
        Outcome { film: sum.film, stats }
    }
}

impl Tally {
    fn add(&mut self, o: &Self) {
        self.rays.camera += o.rays.camera;
        self.rays.shadow += o.rays.shadow;
        self.rays.reflected += o.rays.reflected;
        self.rays.refracted += o.rays.refracted;
        self.facing_away += o.facing_away;
        self.below_cut += o.below_cut;
        self.brightest = self.brightest.max(o.brightest);
    }
}

/// One thread's buffers, and the tile it works on.
struct TileWorker<'a, B, const SECONDARY: bool> {
    render: &'a Render<'a, B, SECONDARY>,
    waves: Waves<'a, B, SECONDARY>,
    batch: PacketBatch<RayHitPacket>,
    pixels: Vec<(u32, u32)>,
    sums: Vec<PixelSum>,
    /// One per pixel; empty unless auxiliary images are wanted.
    first_hits: Vec<FirstHits>,
}

/// A pixel while its samples come in.
#[derive(Clone, Copy, Debug, Default)]
struct PixelSum {
    color: DVec3,
    cut: [f64; 2],
    counted: u32,
}

/// What the auxiliary images show of a pixel, while its samples come in.
#[derive(Clone, Copy, Debug, Default)]
struct FirstHits {
    hits: u32,
    depth: f64,
    normal: DVec3,
    albedo: Vec3,
    id: [u32; 2],
    cost: u32,
}

impl<'a, B: Backend, const SECONDARY: bool> TileWorker<'a, B, SECONDARY> {
    fn new(render: &'a Render<'a, B, SECONDARY>, radiance: &'a Radiance, contacts: &'a Contacts) -> Self {
        let waves =
            Waves::new(render.scene, &render.camera, render.backend, render.job, &render.needs, radiance, contacts);
        Self {
            render,
            waves,
            batch: PacketBatch::default(),
            pixels: Vec::new(),
            sums: Vec::new(),
            first_hits: Vec::new(),
        }
    }

    /// Whether the tile was finished, not given up on the way.
    fn render(&mut self, tile: Crop) -> bool {
        let Render { camera, job, control, .. } = self.render;
        tile::pixels(tile, &mut self.pixels);
        self.sums.clear();
        self.sums.resize(self.pixels.len(), PixelSum::default());
        self.first_hits.clear();
        if !job.aovs.is_empty() {
            self.first_hits.resize(self.pixels.len(), FirstHits::default());
        }
        let pixels = std::mem::take(&mut self.pixels);
        let mut first_pixel = 0;
        for segment in tile::segments(&pixels, job.spp) {
            // A tile of many samples takes long.
            if control.is_cancelled() {
                return false;
            }
            let before = self.waves.tally.rays.total();
            segment.camera_rays(camera, job, &mut self.batch);
            self.waves.trace(&mut self.batch, &segment, Coherence::Coherent);
            self.add_up(first_pixel, &segment);
            if segment.first + segment.samples == job.spp {
                first_pixel += segment.pixels.len();
            }
            control.rays.fetch_add(self.waves.tally.rays.total() - before, Relaxed);
        }
        self.pixels = pixels;
        true
    }

    /// Adds the samples of a segment to their pixels, in order.
    fn add_up(&mut self, first_pixel: usize, segment: &tile::Segment<'_>) {
        let samples = segment.samples as usize;
        let gathered = &self.waves.gathered;
        for (sum, colors) in self.sums[first_pixel..].iter_mut().zip(gathered.color.chunks_exact(samples)) {
            for color in colors.iter().map(|c| c.as_vec3()) {
                if color.is_finite() {
                    sum.color += color.as_dvec3();
                    sum.counted += 1;
                }
            }
        }
        if SECONDARY {
            for (sum, cuts) in self.sums[first_pixel..].iter_mut().zip(gathered.cut.chunks_exact(samples)) {
                for cut in cuts {
                    sum.cut[0] += cut[0];
                    sum.cut[1] += cut[1];
                }
            }
        }
        if !self.first_hits.is_empty() {
            self.first_hits(first_pixel, segment);
        }
    }

    /// What the auxiliary images show of the camera rays' hits.
    fn first_hits(&mut self, first_pixel: usize, segment: &tile::Segment<'_>) {
        let (scene, samples) = (self.render.scene, segment.samples as usize);
        let sums = &mut self.first_hits[first_pixel..];
        if let Some(cost) = &self.waves.gathered.cost {
            for (sum, cost) in sums.iter_mut().zip(cost.chunks_exact(samples)) {
                sum.cost += cost.iter().sum::<u32>();
            }
        }
        for (slot, point) in self.waves.gathered.seen.iter().flatten() {
            let slot = *slot as usize;
            let (packet, lane) = (&self.batch.packets()[slot / LANES], slot % LANES);
            let sum = &mut sums[slot / samples];
            if slot.is_multiple_of(samples) && segment.first == 0 {
                sum.id = [packet.hit.geom_id[lane] + 1, packet.hit.prim_id[lane] + 1];
            }
            sum.hits += 1;
            sum.depth += (point.p - packet.ray.get(lane).o.as_dvec3()).length() * scene.frame.world_per_local();
            sum.normal += point.ns;
            sum.albedo += point.albedo;
        }
    }

    /// Puts the finished tile into the film.
    fn hand_in(&self, tile: Crop, index: usize, sum: &mut Sum) {
        let (crop, spp) = (self.render.job.crop, self.render.job.spp);
        let width = sum.film.width as usize;
        let at = |(x, y): (u32, u32)| (y - crop.y0) as usize * width + (x - crop.x0) as usize;
        let (mut counted, mut cut) = (0, [0.0; 2]);
        for (&xy, pixel) in self.pixels.iter().zip(&self.sums) {
            let color = if spp == 1 { pixel.color } else { pixel.color / f64::from(pixel.counted.max(1)) };
            sum.film.color[at(xy)] = color.as_vec3().to_array();
            counted += u64::from(pixel.counted);
            if SECONDARY {
                let ends = sum.cut_max.iter_mut().zip(&mut cut);
                for ((max, total), own) in ends.zip(pixel.cut.map(|c| c / f64::from(spp))) {
                    *max = max.max(own);
                    *total += own;
                }
            }
        }
        sum.non_finite += self.pixels.len() as u64 * u64::from(spp) - counted;
        sum.cut_of_tile[index] = cut;
        for (&xy, pixel) in self.pixels.iter().zip(&self.first_hits) {
            sum.film.aovs.iter_mut().for_each(|image| pixel.write(image, at(xy), spp));
        }
        let pixels = self.pixels.len();
        debug_assert_eq!(pixels, ((tile.x1 - tile.x0) * (tile.y1 - tile.y0)) as usize);
        sum.film.finished += pixels;
        self.render.control.pixels.fetch_add(pixels as u64, Relaxed);
    }
}

impl FirstHits {
    fn write(&self, image: &mut AovImage, at: usize, spp: u32) {
        let hits = f64::from(self.hits.max(1));
        let set = |data: &mut [f32], values: &[f32]| {
            data[at * values.len()..][..values.len()].copy_from_slice(values);
        };
        match image.kind {
            Aov::Depth if self.hits == 0 => set(&mut image.data, &[f32::INFINITY]),
            Aov::Depth => set(&mut image.data, &[(self.depth / hits) as f32]),
            Aov::Normal => set(&mut image.data, &(self.normal / hits).as_vec3().to_array()),
            Aov::Albedo => set(&mut image.data, &(self.albedo / spp as f32).to_array()),
            Aov::Id => set(&mut image.data, &self.id.map(f32::from_bits)),
            Aov::Hits => set(&mut image.data, &[self.hits as f32 / spp as f32]),
            Aov::Cost => set(&mut image.data, &[self.cost as f32]),
        }
    }
}
