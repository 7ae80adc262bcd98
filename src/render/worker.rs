//! One thread's part of a render: samples of pixels, by segments.

use super::estimate::Twice;
use super::gathered::Tally;
use super::pixel::{FirstHits, Lone, PixelSum};
use super::tile::{self, Segment};
use super::wave::Waves;
use super::{Common, Render};
use crate::backend::Backend;
use crate::geom::{Coherence, LANES, PacketBatch, RayHitPacket};
use crate::math::Sampling;
use std::ops::Range;
use std::sync::atomic::Ordering::Relaxed;

/// Pixels of a tile that are sampled together.
#[derive(Debug, Default)]
pub struct Pixels {
    /// Where they are, along a Z-curve.
    pub at: Vec<(u32, u32)>,
    /// One for each; empty where they are lone.
    pub sums: Vec<PixelSum>,
    /// What they are instead of sums if they get one sample each.
    pub lone: Option<Lone>,
    /// One for each; empty unless auxiliary images are wanted.
    pub hits: Vec<FirstHits>,
}

impl Pixels {
    /// None of them.
    pub fn clear(&mut self) {
        self.at.clear();
        self.sums.clear();
        self.lone = None;
        self.hits.clear();
    }

    /// Those at some `places`.
    pub fn of(&self, places: &[usize]) -> Self {
        Self {
            at: places.iter().map(|&i| self.at[i]).collect(),
            sums: places.iter().map(|&i| self.sums[i]).collect(),
            lone: None,
            hits: if self.hits.is_empty() { Vec::new() } else { places.iter().map(|&i| self.hits[i]).collect() },
        }
    }

    /// Puts them back where they were taken from.
    pub fn give_back(&self, places: &[usize], to: &mut Self) {
        for (&place, sum) in places.iter().zip(&self.sums) {
            to.sums[place] = *sum;
        }
        for (&place, hits) in places.iter().zip(&self.hits) {
            to.hits[place] = *hits;
        }
    }

    /// Starts anew with the pixels that are `at` places, `hits` if auxiliary images are wanted; `lone` if they get one
    /// sample each.
    pub fn start(&mut self, hits: bool, lone: bool) {
        let n = self.at.len();
        self.sums.clear();
        self.lone = lone.then(|| self.lone.take().unwrap_or_default());
        match &mut self.lone {
            Some(lone) => lone.clear(),
            None => self.sums.resize(n, PixelSum::default()),
        }
        self.hits.clear();
        self.hits.resize(if hits { n } else { 0 }, FirstHits::default());
    }
}

/// One thread's buffers.
pub struct TileWorker<'a, B, const SECONDARY: bool> {
    render: &'a Render<'a, B, SECONDARY>,
    pub waves: Waves<'a, B, SECONDARY>,
    batch: PacketBatch<RayHitPacket>,
}

impl<'a, B: Backend, const SECONDARY: bool> TileWorker<'a, B, SECONDARY> {
    /// Empty buffers.
    pub fn new(render: &'a Render<'a, B, SECONDARY>, common: &'a Common) -> Self {
        let waves = Waves::new(render, common);
        Self { render, waves, batch: PacketBatch::default() }
    }

    /// Takes samples `samples` of all `pixels`. Whether that was finished, not given up on the way.
    pub fn sample(&mut self, pixels: &mut Pixels, samples: Range<u32>) -> bool {
        self.trace(pixels, samples, &self.render.sampling)
    }

    /// The same from other sequences, to compare with: counted apart.
    pub fn sample_again(&mut self, pixels: &mut Pixels, samples: Range<u32>, twice: &Twice) -> bool {
        let before = self.waves.tally;
        let whole = self.trace(pixels, samples, &self.render.sampling.with_seed(twice.seed()));
        let again = self.waves.tally.rays.total() - before.rays.total();
        self.waves.tally = Tally { again: before.again + again, ..before };
        whole
    }

    fn trace(&mut self, pixels: &mut Pixels, samples: Range<u32>, sampling: &Sampling) -> bool {
        let control = self.render.control;
        let rays = if SECONDARY && self.render.job.k_max > 0 { tile::WIDE_SEGMENT } else { tile::SEGMENT };
        let mut first_pixel = 0;
        let last = samples.end;
        let Pixels { at, sums, lone, hits } = pixels;
        for segment in tile::segments(at, samples, sampling, rays) {
            // A tile of many samples takes long.
            if control.is_cancelled() {
                return false;
            }
            let before = self.waves.tally.rays.total();
            let drawn = segment.camera_rays(&self.render.camera, self.render.job, &mut self.batch);
            self.waves.tally.note_drawn(drawn, self.batch.len());
            self.waves.trace(&mut self.batch, &segment, Coherence::Coherent);
            match lone {
                Some(lone) => lone.add(&self.waves.gathered.color, &self.waves.gathered.cut),
                None => self.add_up(&mut sums[first_pixel..], &segment),
            }
            if !hits.is_empty() {
                self.first_hits(&mut hits[first_pixel..], &segment);
            }
            if segment.first + segment.samples == last {
                first_pixel += segment.pixels.len();
            }
            control.rays.fetch_add(self.waves.tally.rays.total() - before, Relaxed);
        }
        true
    }

    /// Adds the samples of a segment to their pixels, in order.
    fn add_up(&self, sums: &mut [PixelSum], segment: &Segment<'_>) {
        let samples = segment.samples as usize;
        let gathered = &self.waves.gathered;
        let deviations = self.render.twice.is_some();
        if self.render.job.has_negative_samples() {
            return self.add_up_weighed(sums, segment, deviations);
        }
        for (sum, colors) in sums.iter_mut().zip(gathered.color.chunks_exact(samples)) {
            sum.add(colors, deviations);
        }
        if SECONDARY {
            for (sum, cuts) in sums.iter_mut().zip(gathered.cut.chunks_exact(samples)) {
                for cut in cuts {
                    sum.cut[0] += cut[0];
                    sum.cut[1] += cut[1];
                }
            }
        }
    }

    /// The same where the pixel filter weighs them. What was left out counts as much, whatever the sign.
    fn add_up_weighed(&self, sums: &mut [PixelSum], segment: &Segment<'_>, deviations: bool) {
        let (samples, job, gathered) = (segment.samples as usize, self.render.job, &self.waves.gathered);
        for (i, (sum, colors)) in sums.iter_mut().zip(gathered.color.chunks_exact(samples)).enumerate() {
            // A segment takes at most a packet's worth of each pixel.
            let mut weights = [0.0; LANES];
            for (k, weight) in weights[..samples].iter_mut().enumerate() {
                *weight = segment.weight((i * samples + k) as u32, job);
            }
            sum.add_weighed(colors.iter().map(|&color| color.into()).zip(weights), deviations);
            let cuts = gathered.cut.get(i * samples..(i + 1) * samples).unwrap_or_default();
            for (cut, weight) in cuts.iter().zip(&weights) {
                sum.cut[0] += cut[0] * weight.abs();
                sum.cut[1] += cut[1] * weight.abs();
            }
        }
    }

    /// What the auxiliary images show of the camera rays' hits.
    fn first_hits(&self, hits: &mut [FirstHits], segment: &Segment<'_>) {
        let (scene, samples) = (self.render.scene, segment.samples as usize);
        if let Some(cost) = &self.waves.gathered.cost {
            for (sum, cost) in hits.iter_mut().zip(cost.chunks_exact(samples)) {
                sum.spend(cost.iter().sum::<u32>());
            }
        }
        for (slot, point) in self.waves.gathered.seen.iter().flatten() {
            let slot = *slot as usize;
            let (packet, lane) = (&self.batch.packets()[slot / LANES], slot % LANES);
            let sum = &mut hits[slot / samples];
            if slot.is_multiple_of(samples) && segment.first == 0 {
                sum.identify(packet, lane);
            }
            let depth = (point.p - packet.ray.get(lane).o.as_dvec3()).length() * scene.frame.world_per_local();
            sum.see(depth, point);
        }
    }
}
