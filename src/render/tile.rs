//! A tile of the image: which rays it sends and where their colours go.

use super::job::{Crop, Job};
use crate::geom::{LANES, PacketBatch, RayHitPacket};
use crate::math::{PixelSamples, Sampling, concentric_disc, polar_disc, rejection_disc, uniform_radius_disc};
use crate::scene::desc::LensSampler;
use crate::scene::{Camera, CameraRays, Skip};
use crate::simd;
use glam::DVec2;
use std::ops::Range;

/// Pixels along the side of a tile.
pub const TILE: u32 = 32;

/// Camera rays of one wave: what fits in the second-level cache with its answers.
const SEGMENT: usize = 256;

/// Where a lone sample goes through its pixel: beside the centre, so that a camera aligned
/// with a mesh does not send every ray at a vertex or along an edge.
const BESIDE_CENTRE: (f64, f64) = (0.500_37, 0.500_61);
const CENTRE: (f64, f64) = (0.5, 0.5);

/// The tiles of `crop`, row by row.
#[must_use]
pub fn tiles(crop: Crop) -> Vec<Crop> {
    let starts = |from: u32, to: u32| (from..to).step_by(TILE as usize);
    starts(crop.y0, crop.y1)
        .flat_map(|y| starts(crop.x0, crop.x1).map(move |x| (x, y)))
        .map(|(x, y)| Crop { x0: x, y0: y, x1: (x + TILE).min(crop.x1), y1: (y + TILE).min(crop.y1) })
        .collect()
}

/// Pixels of a tile along a Z-curve, so that any 4 or 16 in a row form a square.
pub fn pixels(tile: Crop, out: &mut Vec<(u32, u32)>) {
    out.clear();
    let whole = (tile.x1 - tile.x0, tile.y1 - tile.y0) == (TILE, TILE);
    for &(dx, dy) in &Z_CURVE {
        let (x, y) = (tile.x0 + u32::from(dx), tile.y0 + u32::from(dy));
        if whole || (x < tile.x1 && y < tile.y1) {
            out.push((x, y));
        }
    }
}

/// The way through a tile: even bits of the index are x, odd ones y.
static Z_CURVE: [(u8, u8); (TILE * TILE) as usize] = {
    let mut curve = [(0, 0); (TILE * TILE) as usize];
    let mut i = 0;
    while i < curve.len() {
        let mut bit = 0;
        while bit < 5 {
            curve[i].0 |= ((i >> (2 * bit) & 1) << bit) as u8;
            curve[i].1 |= ((i >> (2 * bit + 1) & 1) << bit) as u8;
            bit += 1;
        }
        i += 1;
    }
    curve
};

/// Samples of a few neighbouring pixels that travel as one wave. Sample `j` of pixel `i` is
/// ray `i * samples + j`, so the lanes of a packet hold a square of pixels, or many samples
/// of one pixel: whatever is most alike.
#[derive(Clone, Copy, Debug)]
pub struct Segment<'a> {
    /// The pixels.
    pub pixels: &'a [(u32, u32)],
    /// First sample.
    pub first: u32,
    /// Samples of each pixel.
    pub samples: u32,
    /// Where they lie.
    pub sampling: &'a Sampling,
}

/// Splits samples `range` of all pixels into segments; all samples of a pixel come in order.
pub fn segments<'a>(
    pixels: &'a [(u32, u32)],
    range: Range<u32>,
    sampling: &'a Sampling,
) -> impl Iterator<Item = Segment<'a>> {
    let samples = (range.end - range.start).min(LANES as u32);
    let at_once = SEGMENT / samples as usize;
    pixels.chunks(at_once).flat_map(move |pixels| {
        range.clone().step_by(samples as usize).map(move |first| Segment {
            pixels,
            first,
            samples: samples.min(range.end - first),
            sampling,
        })
    })
}

impl<'a> Segment<'a> {
    /// The sample points of the pixel that ray `slot` of the segment goes through, and which of
    /// them is the ray's.
    #[must_use]
    pub fn samples_of(&self, slot: u32) -> (PixelSamples<'a>, u32) {
        let (x, y) = self.pixels[(slot / self.samples) as usize];
        (self.sampling.pixel(x, y), self.first + slot % self.samples)
    }

    /// What the sample of ray `slot` counts in its pixel: [`Filter::weight`](crate::math::Filter::weight).
    #[must_use]
    pub fn weight(&self, slot: u32, job: &Job) -> f64 {
        let (samples, sample) = self.samples_of(slot);
        let [a, b, ..] = samples.point(sample);
        job.filter.weight(job.offset(a), job.offset(b))
    }

    /// Fills `batch` with the camera rays; what was drawn for each.
    pub fn camera_rays(&self, camera: &Camera, job: &Job, batch: &mut PacketBatch<RayHitPacket>) -> Drawn {
        batch.resize(self.pixels.len() * self.samples as usize);
        let samples = self.first..self.first + self.samples;
        let mut points = self.pixels.iter().flat_map(|&pixel| samples.clone().map(move |sample| (pixel, sample)));
        let (mut at, mut lens) = ([[0.0; LANES]; 2], [[0.0; LANES]; 2]);
        let drawn = Drawn::of(camera, job);
        for (packet, live) in batch.packets_mut() {
            for (lane, (pixel, sample)) in points.by_ref().take(live).enumerate() {
                let (x, y, disc) = image_point(drawn, job, self.sampling, pixel, sample);
                (at[0][lane], at[1][lane]) = (x, y);
                (lens[0][lane], lens[1][lane]) = (disc.x, disc.y);
            }
            simd::run(CameraRays { camera, at: &at, lens: &lens, packet: &mut packet.ray });
        }
        drawn
    }
}

/// What is drawn for a camera ray.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// The sample's point.
    pub pixel: bool,
    /// A point of the lens from it.
    pub lens: bool,
}

impl Drawn {
    fn of(camera: &Camera, job: &Job) -> Self {
        let lens = camera.lens.is_some() || !job.skips.has(Skip::Lens);
        Self { pixel: job.spp > 1 || lens || !job.skips.has(Skip::Jitter), lens }
    }
}

/// Where sample `sample` of `pixel` goes through the image, in pixels, and through the unit lens.
#[inline]
fn image_point(drawn: Drawn, job: &Job, sampling: &Sampling, pixel: (u32, u32), sample: u32) -> (f64, f64, DVec2) {
    let (x, y) = (f64::from(pixel.0), f64::from(pixel.1));
    let lone = if job.centre { CENTRE } else { BESIDE_CENTRE };
    if !drawn.pixel {
        return (x + lone.0, y + lone.1, DVec2::ZERO);
    }
    let samples = sampling.pixel(pixel.0, pixel.1);
    let [a, b, u, v] = samples.point(sample);
    let (dx, dy) = if job.spp == 1 { lone } else { (0.5 + job.offset(a), 0.5 + job.offset(b)) };
    let disc = if drawn.lens { on_lens(job.lens_sampler, samples, sample, [u, v]) } else { DVec2::ZERO };
    (x + dx, y + dy, disc)
}

/// A point of the unit disc by the sampler that was asked for.
fn on_lens(sampler: LensSampler, samples: PixelSamples<'_>, sample: u32, [u, v]: [f64; 2]) -> DVec2 {
    match sampler {
        LensSampler::Concentric => concentric_disc(u, v),
        LensSampler::Polar => polar_disc(u, v),
        LensSampler::PolarUniformRadius => uniform_radius_disc(u, v),
        LensSampler::Rejection => {
            let mut number = 0;
            rejection_disc([u, v], || {
                number += 1;
                samples.beyond(sample, number)
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Sampler;
    use std::collections::HashSet;

    const CROP: Crop = Crop { x0: 5, y0: 3, x1: 80, y1: 50 };

    fn pixels_of(tile: Crop) -> Vec<(u32, u32)> {
        let mut all = Vec::new();
        pixels(tile, &mut all);
        all
    }

    #[test]
    fn tiles_cover_the_crop_once() {
        let mut seen = HashSet::new();
        for tile in tiles(CROP) {
            for p in pixels_of(tile) {
                assert!(seen.insert(p), "{p:?} twice");
            }
        }
        assert_eq!(seen.len(), 75 * 47);
        assert!(seen.iter().all(|&(x, y)| (5..80).contains(&x) && (3..50).contains(&y)));
    }

    #[test]
    fn sixteen_pixels_in_a_row_are_a_square() {
        let all = pixels_of(Crop { x0: 64, y0: 32, x1: 96, y1: 64 });
        assert_eq!(all.len(), 1024);
        for block in all.chunks(16) {
            let spread = |f: fn(&(u32, u32)) -> u32| {
                block.iter().map(f).max().expect("16 of them") - block.iter().map(f).min().expect("16 of them")
            };
            assert_eq!((spread(|p| p.0), spread(|p| p.1)), (3, 3));
        }
    }

    #[test]
    fn segments_hold_every_sample_once_and_in_order() {
        let all = pixels_of(tiles(CROP)[0]);
        let sampling = Sampling::new(Sampler::Sobol, 0, 70, 1);
        for spp in [1, 2, 5, 16, 17, 70] {
            let mut next = vec![0; all.len()];
            let mut at = std::collections::HashMap::new();
            at.extend(all.iter().enumerate().map(|(i, &p)| (p, i)));
            for s in segments(&all, 0..spp, &sampling) {
                assert!((1..=SEGMENT).contains(&(s.pixels.len() * s.samples as usize)));
                for p in s.pixels {
                    assert_eq!(next[at[p]], s.first, "spp {spp}");
                    next[at[p]] += s.samples;
                }
            }
            assert!(next.iter().all(|&n| n == spp), "spp {spp}");
        }
    }
}
