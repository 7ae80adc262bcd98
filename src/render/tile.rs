//! A tile of the image: which rays it sends and where their colours go.

use super::job::{Crop, Job};
use crate::geom::{LANES, PacketBatch, RayHitPacket};
use crate::math::{
    PixelSamples, Sampling, SobolLanes, concentric_disc, polar_disc, rejection_disc, uniform_radius_disc,
};
use crate::scene::desc::LensSampler;
use crate::scene::{Camera, CameraRays, Skip};
use crate::simd::{self, Kernel};
use glam::DVec2;
use std::ops::Range;

/// Pixels along the side of a tile.
pub const TILE: u32 = 32;

/// Camera rays of one wave: what fits in the second-level cache with its answers.
pub const SEGMENT: usize = 256;
/// The same where rays are sent on: the more of them, the more go alike.
pub const WIDE_SEGMENT: usize = 1024;

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

/// Splits samples `range` of all pixels into segments of at most `rays`; all samples of a pixel come in order.
pub fn segments<'a>(
    pixels: &'a [(u32, u32)],
    range: Range<u32>,
    sampling: &'a Sampling,
    rays: usize,
) -> impl Iterator<Item = Segment<'a>> {
    let samples = (range.end - range.start).min(LANES as u32);
    let at_once = rays / samples as usize;
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
        let drawn = Drawn::of(camera, job);
        let draw = Draw::of(self, drawn);
        let (mut asked, mut at, mut lens) = (Asked::default(), [[0.0; LANES]; 2], [[0.0; LANES]; 2]);
        for (k, (packet, live)) in batch.packets_mut().enumerate() {
            self.ask((k * LANES) as u32, live, &mut asked);
            let points = draw.points(self.sampling, &asked, live);
            match &points {
                Some([a, b, ..]) if job.spp > 1 => simd::run(Jittered { job, of: [a, b], asked: &asked, at: &mut at }),
                _ => {
                    let (dx, dy) = if job.centre { CENTRE } else { BESIDE_CENTRE };
                    at = [asked.x.map(|x| f64::from(x) + dx), asked.y.map(|y| f64::from(y) + dy)];
                }
            }
            if let (Some([_, _, u, v]), true) = (&points, drawn.lens) {
                for lane in 0..live {
                    let samples = self.sampling.pixel(asked.x[lane], asked.y[lane]);
                    let disc = on_lens(job.lens_sampler, samples, asked.sample[lane], [u[lane], v[lane]]);
                    (lens[0][lane], lens[1][lane]) = (disc.x, disc.y);
                }
            }
            CameraRays { camera, at: &at, lens: &lens, packet: &mut packet.ray }.fill();
        }
        drawn
    }
}

impl Segment<'_> {
    /// Pixels and samples of rays from `first` on.
    fn ask(&self, first: u32, live: usize, asked: &mut Asked) {
        if self.samples == 1 {
            for (lane, &(x, y)) in self.pixels[first as usize..][..live].iter().enumerate() {
                (asked.x[lane], asked.y[lane]) = (x, y);
            }
            asked.sample = [self.first; LANES];
            return;
        }
        let (mut pixel, mut sample) = (first / self.samples, first % self.samples);
        for lane in 0..live {
            (asked.x[lane], asked.y[lane]) = self.pixels[pixel as usize];
            asked.sample[lane] = self.first + sample;
            sample += 1;
            if sample == self.samples {
                (pixel, sample) = (pixel + 1, 0);
            }
        }
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

/// How the sample points of a segment's camera rays are drawn.
enum Draw {
    /// Not at all.
    None,
    /// Those of the pixel only.
    Pixel(SobolLanes<2>),
    /// Those of the lens too.
    All(SobolLanes<4>),
    OneByOne,
}

impl Draw {
    fn of(segment: &Segment<'_>, drawn: Drawn) -> Self {
        let end = segment.first + segment.samples;
        let found = match drawn {
            Drawn { pixel: false, .. } => return Self::None,
            Drawn { lens: false, .. } => segment.sampling.lanes(end).map(Self::Pixel),
            _ => segment.sampling.lanes(end).map(Self::All),
        };
        found.unwrap_or(Self::OneByOne)
    }

    fn points(&self, sampling: &Sampling, asked: &Asked, live: usize) -> Option<[[f64; LANES]; 4]> {
        match *self {
            Self::None => None,
            Self::Pixel(of) => {
                let [a, b] = simd::run(Points { of, asked });
                Some([a, b, [0.0; LANES], [0.0; LANES]])
            }
            Self::All(of) => Some(simd::run(Points { of, asked })),
            Self::OneByOne => {
                let mut points = [[0.0; LANES]; 4];
                for lane in 0..live {
                    let point = sampling.pixel(asked.x[lane], asked.y[lane]).point(asked.sample[lane]);
                    points.iter_mut().zip(point).for_each(|(to, x)| to[lane] = x);
                }
                Some(points)
            }
        }
    }
}

/// The rays of a packet: pixel and sample.
#[derive(Debug, Default)]
struct Asked {
    x: [u32; LANES],
    y: [u32; LANES],
    sample: [u32; LANES],
}

struct Points<'a, const DIMENSIONS: usize> {
    of: SobolLanes<DIMENSIONS>,
    asked: &'a Asked,
}

impl<const DIMENSIONS: usize> Kernel for Points<'_, DIMENSIONS> {
    type Output = [[f64; LANES]; DIMENSIONS];

    #[inline(always)]
    fn run(self) -> Self::Output {
        self.of.points([&self.asked.x, &self.asked.y], &self.asked.sample)
    }
}

/// Image points around the middles of their pixels.
struct Jittered<'a> {
    job: &'a Job,
    of: [&'a [f64; LANES]; 2],
    asked: &'a Asked,
    at: &'a mut [[f64; LANES]; 2],
}

impl Kernel for Jittered<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [dx, dy] = [self.job.offsets(self.of[0]), self.job.offsets(self.of[1])];
        for lane in 0..LANES {
            self.at[0][lane] = f64::from(self.asked.x[lane]) + (0.5 + dx[lane]);
            self.at[1][lane] = f64::from(self.asked.y[lane]) + (0.5 + dy[lane]);
        }
    }
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
            for s in segments(&all, 0..spp, &sampling, SEGMENT) {
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
