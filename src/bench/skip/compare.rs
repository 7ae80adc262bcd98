//! The same picture with all skips and without one.

use super::Error;
use super::subject::{Assets, Subject};
use crate::backend::{AnyBackend, BackendKind, BuildOptions};
use crate::film::{Aov, Film};
use crate::render::{self, Control, Job, Outcome};
use crate::scene::{CameraDesc, CameraOverrides, Loaded, Skip, Skips, View};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// A picture, and what it was made from.
#[derive(Debug)]
pub struct Done {
    loaded: Loaded,
    outcome: Outcome,
    quick: bool,
    /// To read, build and render.
    pub seconds: f64,
}

/// Renders `subject` with `skips`.
///
/// # Errors
/// See [`Error`].
pub fn done(subject: &Subject, assets: &Assets, kind: BackendKind, skips: Skips) -> Result<Done, Error> {
    let (start, cancel) = (Instant::now(), AtomicBool::new(false));
    let mut loaded = subject.load(assets, skips)?;
    let job = Job { skips, ..subject.job.clone() };
    let camera = camera(&loaded, &job)?;
    if loaded.cameras.is_empty() && loaded.scene.lights.is_empty() {
        loaded.scene.light_from(&camera);
    }
    let rays = job.crop.pixels() * u64::from(job.spp) * (1 + loaded.scene.lights.len() as u64);
    let rays_expected = if skips.has(Skip::BuildQuality) { rays } else { u64::MAX };
    let options = BuildOptions { rays_expected, ..BuildOptions::new(&cancel) };
    let backend = AnyBackend::build(kind, &loaded.scene, &options)?;
    let outcome = render::run(&loaded.scene, &camera, &backend, &job, &Control::default()).map_err(Error::Camera)?;
    Ok(Done { quick: backend.is_quick(), loaded, outcome, seconds: start.elapsed().as_secs_f64() })
}

/// The scene's first camera, or one that sees all of it.
fn camera(loaded: &Loaded, job: &Job) -> Result<CameraDesc, Error> {
    let aspect = f64::from(job.size.0) / f64::from(job.size.1);
    match loaded.cameras.first() {
        Some(named) => Ok(named.camera),
        None => {
            loaded.scene.auto_camera(View::ThreeQuarter, &CameraOverrides::default(), aspect).map_err(Error::Camera)
        }
    }
}

/// How much `skip` left out, and of what.
#[must_use]
pub fn left_out(skip: Skip, on: &Done, off: &Done) -> (u64, &'static str) {
    let (stats, without) = (&on.outcome.stats, &off.outcome.stats);
    let (work, more) = (&stats.work, &without.work);
    let (count, without, what) = match skip {
        Skip::UnusedAssets => {
            let images = |d: &Done| d.loaded.scene.textures.len() as u64;
            (images(on), images(off), "images")
        }
        Skip::Uv => {
            let bytes = |d: &Done| d.loaded.scene.bytes() as u64;
            (bytes(on), bytes(off), "bytes of coordinates")
        }
        Skip::Normals => (work.smooth_blocks, more.smooth_blocks, "blocks of normals"),
        Skip::Lens => (work.lens_points, more.lens_points, "points of the lens"),
        Skip::Jitter => (work.pixel_points, more.pixel_points, "points of pixels"),
        Skip::DarkLights => {
            let lit = |d: &Done| d.outcome.stats.work.highlights + d.outcome.stats.blocks_without_highlight;
            (lit(on), lit(off), "blocks lit")
        }
        Skip::ShadowRays | Skip::Enclosed | Skip::FaintLights => {
            (stats.rays.shadow, without.rays.shadow, "shadow rays")
        }
        Skip::AnyHit => (work.nearest_occluders, more.nearest_occluders, "nearest hits"),
        Skip::Powf => (work.highlights, more.highlights, "blocks of highlights"),
        Skip::Secondary | Skip::Fresnel => (work.hits_asked_on, more.hits_asked_on, "hits asked for branches"),
        Skip::WeightCut => {
            (stats.rays.reflected + stats.rays.refracted, without.rays.reflected + without.rays.refracted, "branches")
        }
        Skip::Inside => (without.rays_inside, stats.rays_inside, "traversals"),
        Skip::Bounds => (without.packets_outside, stats.packets_outside, "packets of rays"),
        Skip::Aovs => (work.hits_kept, more.hits_kept, "hits kept"),
        Skip::Converged => (stats.samples, without.samples, "samples"),
        Skip::Geometry => (work.hits_sorted, more.hits_sorted, "rays sorted"),
        Skip::BuildQuality => (u64::from(off.quick), u64::from(on.quick), "good builds"),
    };
    (without.saturating_sub(count), what)
}

/// What a pair of pictures shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Proof {
    /// Every number of every pixel is the same to the last bit.
    SameBytes,
    /// So many pixels show another of two things that are equally far away.
    Ties(usize),
    /// The difference and its bound, linear.
    Within {
        /// The largest of a pixel, or the root mean square where the bound is of that.
        difference: f64,
        /// What the render with the skip says.
        bound: f64,
    },
    /// The skip changes what it must not: largest difference of a pixel, and pixels that differ.
    Broken {
        /// Linear.
        difference: f64,
        /// How many.
        pixels: usize,
    },
}

impl Proof {
    /// Of a picture with `skip` and one without.
    #[must_use]
    pub fn of(skip: Skip, on: &Done, off: &Done) -> Self {
        let (with, without) = (&on.outcome, &off.outcome);
        match skip {
            Skip::WeightCut | Skip::FaintLights => {
                // Both were rounded to f32.
                let slack = 2.0 * f64::from(f32::EPSILON) * brightest(&without.film);
                within(most(&with.film, &without.film), with.stats.cut_off_max, slack, &with.film, &without.film)
            }
            Skip::Converged => {
                let bound = [with, without].map(|o| o.stats.sampling_rmse.unwrap_or(0.0)).iter().sum();
                within(rms(&with.film, &without.film), bound, 0.0, &with.film, &without.film)
            }
            Skip::BuildQuality => ties(&with.film, &without.film),
            _ => same(&with.film, &without.film),
        }
    }

    /// Whether the skip may be on.
    #[must_use]
    pub fn holds(self) -> bool {
        !matches!(self, Self::Broken { .. })
    }
}

impl std::fmt::Display for Proof {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::SameBytes => f.write_str("same bytes"),
            Self::Ties(pixels) => write!(f, "same bytes but for {pixels} ties"),
            Self::Within { difference, bound } => write!(f, "differs by {difference:.2e}, bound {bound:.2e}"),
            Self::Broken { difference, pixels } => {
                write!(f, "WRONG: {pixels} pixels differ, by up to {difference:.2e}")
            }
        }
    }
}

fn same(a: &Film, b: &Film) -> Proof {
    match differing(a, b).count() {
        0 => Proof::SameBytes,
        _ => broken(a, b),
    }
}

fn broken(a: &Film, b: &Film) -> Proof {
    Proof::Broken { difference: most(a, b), pixels: differing(a, b).count() }
}

fn within(difference: f64, bound: f64, slack: f64, a: &Film, b: &Film) -> Proof {
    if difference <= bound + slack { Proof::Within { difference, bound } } else { broken(a, b) }
}

/// Pixels whose numbers differ in any bit.
fn differing<'a>(a: &'a Film, b: &'a Film) -> impl Iterator<Item = usize> + 'a {
    let bits = |c: [f32; 3]| c.map(f32::to_bits);
    (0..a.color.len()).filter(move |&i| bits(a.color[i]) != bits(b.color[i]))
}

/// Two things that are as far away to within rounding may change places.
fn ties(a: &Film, b: &Film) -> Proof {
    const CLOSE: f32 = 4.0 * f32::EPSILON;
    let of = |film: &Film, kind: Aov, i: usize| {
        let image = film.aovs.iter().find(|image| image.kind == kind)?;
        let channels = image.data.len() / film.color.len();
        Some(image.data[i * channels..(i + 1) * channels].to_vec())
    };
    let ids = |film, i| of(film, Aov::Id, i).map(|id| id.iter().map(|id| id.to_bits()).collect::<Vec<_>>());
    let tie = |i: usize| match (of(a, Aov::Depth, i), of(b, Aov::Depth, i)) {
        (Some(x), Some(y)) => ids(a, i) != ids(b, i) && (x[0] - y[0]).abs() <= CLOSE * x[0].abs(),
        _ => false,
    };
    match differing(a, b).count() {
        0 => Proof::SameBytes,
        n if differing(a, b).all(tie) => Proof::Ties(n),
        _ => broken(a, b),
    }
}

fn differences<'a>(a: &'a Film, b: &'a Film) -> impl Iterator<Item = f64> + 'a {
    let pairs = a.color.as_flattened().iter().zip(b.color.as_flattened());
    pairs.map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs())
}

fn most(a: &Film, b: &Film) -> f64 {
    differences(a, b).fold(0.0, f64::max)
}

fn rms(a: &Film, b: &Film) -> f64 {
    (differences(a, b).map(|d| d * d).sum::<f64>() / (3 * a.color.len()).max(1) as f64).sqrt()
}

fn brightest(film: &Film) -> f64 {
    film.color.as_flattened().iter().copied().fold(0f32, f32::max).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::AovImage;

    fn film(value: f32) -> Film {
        let mut film = Film::new(2, 1, &[Aov::Id, Aov::Depth]);
        film.color = vec![[value; 3], [0.5; 3]];
        film
    }

    #[test]
    fn one_bit_is_a_difference() {
        assert_eq!(same(&film(0.25), &film(0.25)), Proof::SameBytes);
        let next = f32::from_bits(0.25f32.to_bits() + 1);
        let Proof::Broken { difference, pixels } = same(&film(0.25), &film(next)) else { panic!("it differs") };
        assert!(difference > 0.0 && pixels == 1);
        assert!(!same(&film(0.0), &film(-0.0)).holds(), "so is the sign of zero");
    }

    #[test]
    fn what_exceeds_its_bound_is_broken() {
        let (a, b) = (film(0.25), film(0.5));
        assert_eq!(within(most(&a, &b), 0.25, 0.0, &a, &b), Proof::Within { difference: 0.25, bound: 0.25 });
        assert_eq!(within(most(&a, &b), 0.2, 0.0, &a, &b), Proof::Broken { difference: 0.25, pixels: 1 });
        assert!((rms(&a, &b) - (0.25f64 * 0.25 / 2.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn only_equal_distances_are_ties() {
        let image = |film: &mut Film, kind: Aov| -> usize {
            film.aovs.iter().position(|image: &AovImage| image.kind == kind).expect("it was asked for")
        };
        let (mut a, mut b) = (film(0.25), film(0.5));
        assert!(!ties(&a, &b).holds(), "the same thing in another colour");
        let (id, depth) = (image(&mut a, Aov::Id), image(&mut a, Aov::Depth));
        b.aovs[id].data[1] = f32::from_bits(7);
        (a.aovs[depth].data[0], b.aovs[depth].data[0]) = (2.0, 2.0);
        assert_eq!(ties(&a, &b), Proof::Ties(1));
        b.aovs[depth].data[0] = 2.001;
        assert!(!ties(&a, &b).holds());
    }
}
