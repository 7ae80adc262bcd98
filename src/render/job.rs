//! What is to be rendered, how a run is watched and stopped, and what it tells afterwards.

use super::adapt;
use crate::film::{Aov, Film};
use crate::math::{Filter, Sampler, Sampling};
use crate::scene::desc::LensSampler;
use crate::scene::{Camera, Skip, Skips};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::Duration;

/// Pixels `x0 <= x < x1`, `y0 <= y < y1` of the whole image, counted from the top left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(missing_docs, reason = "said above")]
pub struct Crop {
    pub x0: u32,
    pub y0: u32,
    pub x1: u32,
    pub y1: u32,
}

/// One image to render.
#[derive(Clone, Debug)]
pub struct Job {
    /// Width and height of the whole image in pixels; the camera fits this.
    pub size: (u32, u32),
    /// The part to render; the film has just this part.
    pub crop: Crop,
    /// Samples per pixel, at least 1; the most that a pixel gets if there is something else to stop at.
    pub spp: u32,
    /// What else to stop at.
    pub stop: Stop,
    /// Stop after so long, once every pixel has a sample.
    pub time_limit: Option<Duration>,
    /// Estimate the error of sampling: some pixels are sampled twice.
    pub estimate: bool,
    /// Chooses the samples; the same seed gives the same bytes.
    pub seed: u32,
    /// Most reflections and refractions in a row.
    pub k_max: u32,
    /// A branch whose weight is below this in every channel is not traced.
    pub min_weight: f32,
    /// One sample a pixel goes through the exact centre, not through a point beside it.
    pub centre: bool,
    /// How samples are drawn.
    pub sampler: Sampler,
    /// How points of the lens are drawn.
    pub lens_sampler: LensSampler,
    /// Where in and around a pixel its samples lie, and what they count. Auxiliary images take them all alike. One
    /// sample a pixel is not filtered.
    pub filter: Filter,
    /// With [`Filter::Box`] camera rays pass within this many pixels of their pixel's centre, across and down; 0.5 is the
    /// whole pixel.
    pub jitter_radius: f64,
    /// Shadow rays at each light that has a size, per hit; at least 1.
    pub light_samples: u32,
    /// Auxiliary images to fill.
    pub aovs: Vec<Aov>,
    /// What is left out where nothing needs it.
    pub skips: Skips,
}

impl Job {
    /// All of an image of `size`, one sample a pixel, eight bounces deep and the whole tree.
    #[must_use]
    pub fn whole(size: (u32, u32)) -> Self {
        Self {
            size,
            crop: Crop { x0: 0, y0: 0, x1: size.0, y1: size.1 },
            spp: 1,
            stop: Stop::Count,
            time_limit: None,
            estimate: false,
            seed: 0,
            k_max: 8,
            min_weight: 0.0,
            centre: false,
            sampler: Sampler::default(),
            lens_sampler: LensSampler::default(),
            filter: Filter::default(),
            jitter_radius: 0.5,
            light_samples: 1,
            aovs: Vec::new(),
            skips: Skips::ALL,
        }
    }

    /// The job that it comes to where a bounded skip is switched off.
    #[must_use]
    pub fn settled(&self) -> Self {
        let mut job = self.clone();
        if !job.skips.has(Skip::WeightCut) {
            job.min_weight = 0.0;
        }
        if !job.skips.has(Skip::Converged) && matches!(job.stop, Stop::Noise(_)) {
            job.stop = Stop::Count;
        }
        job
    }

    /// Whether what auxiliary images show is gathered.
    #[must_use]
    pub fn gathers_hits(&self) -> bool {
        !self.aovs.is_empty() || !self.skips.has(Skip::Aovs)
    }

    /// Where `u` in `[0, 1)` is from a pixel's centre, across or down, in pixels.
    #[inline]
    #[must_use]
    pub fn offset(&self, u: f64) -> f64 {
        match self.filter {
            Filter::Box => 2.0 * self.jitter_radius * (u - 0.5),
            filter => filter.offset(u),
        }
    }

    /// [`offset`](Self::offset) for many numbers, to be inlined into code for wide vectors.
    #[inline(always)]
    #[must_use]
    pub fn offsets<const N: usize>(&self, u: &[f64; N]) -> [f64; N] {
        match self.filter {
            Filter::Box => u.map(|u| self.offset(u)),
            filter => filter.offsets(u),
        }
    }

    /// Whether some samples count negative.
    #[must_use]
    pub fn has_negative_samples(&self) -> bool {
        self.spp > 1 && self.filter.has_negative_lobes()
    }

    /// Samples that every pixel gets before any is found to have enough; a time limit may leave it fewer.
    pub const FIRST_SPP: u32 = adapt::FIRST;

    /// Where its samples lie.
    #[must_use]
    pub fn sampling(&self, camera: &Camera) -> Sampling {
        let sampling = Sampling::new(self.sampler, self.seed, self.spp, self.light_samples.max(1));
        if camera.lens.is_some() { sampling } else { sampling.without_lens() }
    }

    /// Whether pixels may get different numbers of samples.
    #[must_use]
    pub fn is_adaptive(&self) -> bool {
        self.stop != Stop::Count || self.time_limit.is_some()
    }
}

impl Crop {
    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        u64::from(self.x1 - self.x0) * u64::from(self.y1 - self.y0)
    }

    /// Place of a pixel of the whole image in this part of it, row by row.
    #[must_use]
    pub fn index(&self, (x, y): (u32, u32)) -> usize {
        (y - self.y0) as usize * (self.x1 - self.x0) as usize + (x - self.x0) as usize
    }
}

/// When there are enough samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Stop {
    /// When every pixel has as many as the job says.
    #[default]
    Count,
    /// A pixel is done when its standard error, as if its samples were independent, is below this share of the root of its
    /// light, and that of its neighbours too.
    Noise(f64),
    /// When the root mean square error of the image, over pixels and channels, linear, is estimated to be at most this.
    Rmse(f64),
}

/// Shared with whoever watches a render: progress out, cancellation in.
#[derive(Debug, Default)]
pub struct Control {
    /// Set to stop at the next tile.
    pub cancel: AtomicBool,
    /// Rays of all kinds so far.
    pub rays: AtomicU64,
    /// Pixels finished so far.
    pub pixels: AtomicU64,
}

impl Control {
    /// Whether somebody asked to stop.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.cancel.load(Relaxed)
    }
}

/// Rays traced, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(missing_docs, reason = "the kinds")]
pub struct RayCounts {
    pub camera: u64,
    pub shadow: u64,
    pub reflected: u64,
    pub refracted: u64,
}

impl RayCounts {
    /// Adds what another thread or frame sent.
    pub fn add(&mut self, o: &Self) {
        self.camera += o.camera;
        self.shadow += o.shadow;
        self.reflected += o.reflected;
        self.refracted += o.refracted;
    }

    /// All of them.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.camera + self.shadow + self.reflected + self.refracted
    }
}

/// What was done that a scene may not need.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Points drawn in pixels, for camera rays.
    pub pixel_points: u64,
    /// Points drawn on the lens.
    pub lens_points: u64,
    /// Blocks of up to sixteen hits whose corner normals were interpolated.
    pub smooth_blocks: u64,
    /// Blocks whose highlights were computed, once for each light.
    pub highlights: u64,
    /// Shadow rays that asked for the nearest hit.
    pub nearest_occluders: u64,
    /// Hits that went through the stage of secondary rays.
    pub hits_asked_on: u64,
    /// Hits that were kept for auxiliary images.
    pub hits_kept: u64,
    /// Rays whose hits were sorted into those of shapes and of meshes.
    pub hits_sorted: u64,
}

impl Work {
    /// Adds what another thread or frame did.
    pub fn add(&mut self, o: &Self) {
        self.pixel_points += o.pixel_points;
        self.lens_points += o.lens_points;
        self.smooth_blocks += o.smooth_blocks;
        self.highlights += o.highlights;
        self.nearest_occluders += o.nearest_occluders;
        self.hits_asked_on += o.hits_asked_on;
        self.hits_kept += o.hits_kept;
        self.hits_sorted += o.hits_sorted;
    }
}

/// What a render did, what it left out, and how wrong that can have made it.
#[derive(Clone, Debug, Default)]
pub struct RenderStats {
    /// Wall time of the render loop.
    pub seconds: f64,
    /// Rays traced for the image.
    pub rays: RayCounts,
    /// Rays traced for the estimate of the error alone, of all kinds.
    pub rays_for_estimate: u64,
    /// Samples taken, of all pixels together.
    pub samples: u64,
    /// Estimate of the root mean square error of sampling, over pixels and channels, linear; if it was asked for.
    pub sampling_rmse: Option<f64>,
    /// How an adaptive render went.
    pub adapted: Option<Adapted>,
    /// Largest bound of any pixel on what branches below the weight cut or beyond `k_max` could add, linear.
    pub cut_off_max: f64,
    /// Mean of the same over all pixels.
    pub cut_off_mean: f64,
    /// The two above take the brightest surface of the image for the brightest there is: some
    /// light gets arbitrarily strong near by.
    pub cut_off_is_estimate: bool,
    /// Samples that came out NaN or infinite; they are left out of their pixel.
    pub non_finite_samples: u64,
    /// Shadow rays not sent because the light is behind the surface.
    pub shadow_rays_facing_away: u64,
    /// Shadow rays not sent because they start inside of a closed shape and the light is outside.
    pub shadow_rays_enclosed: u64,
    /// Shadow rays not sent, after a bounce, because the light would have added less than the weight cut.
    pub shadow_rays_faint: u64,
    /// Rays inside of shapes that touch nothing: no backend was asked about them.
    pub rays_inside: u64,
    /// Branches below the weight cut.
    pub branches_below_cut: u64,
    /// What was done that can be left out.
    pub work: Work,
    /// Packets of camera rays that missed the box around the scene.
    pub packets_outside: u64,
    /// Blocks of up to sixteen hits that a light shone on without a highlight.
    pub blocks_without_highlight: u64,
}

/// How an adaptive render went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adapted {
    /// Rounds of sampling.
    pub rounds: u32,
    /// Why there was no further one.
    pub ended: Ended,
    /// Pixels that did not get the most samples a pixel may get.
    pub stopped_early: u64,
}

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// What was asked for is reached.
    Enough,
    /// Every pixel that should go on has the most samples it may get.
    Most,
    /// The time was over.
    Time,
    /// Somebody asked to stop.
    Stopped,
}

/// An image and its story.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The pixels.
    pub film: Film,
    /// The figures.
    pub stats: RenderStats,
}
