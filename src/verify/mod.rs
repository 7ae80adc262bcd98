//! The same rays through two backends, the same file through two readers: where do they differ, and is it
//! rounding?
//!
//! [`run`] sends a picture's worth of camera, shadow and bounced rays, and rays aimed at what is hard to
//! decide, through both backends. Where the answers differ, `facts` computes in f64 what is true
//! about the ray and the primitives that were named, and within which band f32 cannot know it; `judge` makes a
//! [`Class`] of that. [`readers`] does the same for OBJ files. `docs/verify.md` tells how to read it all.

mod aim;
mod facts;
mod judge;
pub mod readers;
mod report;
mod targets;
mod trace;

pub use report::{Answer, Case, Class, Group, Report, Tally};

use crate::backend::Backend;
use crate::scene::{CameraDesc, Scene};
use aim::Aim;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use trace::{Part, Tracer};

/// What to send.
#[derive(Clone, Copy)]
pub struct Options<'a> {
    /// Pixels of the picture: a camera ray each.
    pub size: (u32, u32),
    /// Rays of each kind that is aimed.
    pub aimed: u64,
    /// Chooses the rays; the same seed sends the same.
    pub seed: u32,
    /// Set by another thread to give up: what was compared by then is reported.
    pub cancel: &'a AtomicBool,
    /// Told the share that is done, from any thread.
    pub progress: Option<&'a (dyn Fn(f64) + Sync)>,
}

impl std::fmt::Debug for Options<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut f = f.debug_struct("Options");
        f.field("size", &self.size).field("aimed", &self.aimed).field("seed", &self.seed).finish_non_exhaustive()
    }
}

/// Rays of one unit of work; a part of the picture has at most as many.
const AT_ONCE: u64 = 1024;
const SIDE: u32 = 32;

/// Compares two backends over `scene`, seen by `camera`, on the current rayon pool. The report does not depend
/// on the number of threads.
///
/// # Errors
/// A sentence, if the camera cannot be used ([`CameraDesc::prepare`]).
pub fn run<A: Backend, B: Backend>(
    scene: &Scene,
    camera: &CameraDesc,
    (first, second): (&A, &B),
    options: &Options<'_>,
) -> Result<Report, String> {
    let camera = camera.prepare(&scene.frame, options.size)?;
    let aim = Aim::new(scene, options.seed);
    let parts = parts(options.size).into_iter().map(Job::Picture);
    let jobs: Vec<Job> = AIMED
        .into_iter()
        .flat_map(|group| (0..options.aimed.div_ceil(AT_ONCE)).map(move |i| Job::Aimed(group, i * AT_ONCE)))
        .chain(parts)
        .collect();
    let (done, total) = (AtomicU64::new(0), jobs.len() as f64);
    let tracer = || Tracer::new(scene, first, second, options.seed);
    let tracers = jobs.into_par_iter().fold(tracer, |mut tracer, job| {
        if options.cancel.load(Relaxed) {
            return tracer;
        }
        match job {
            Job::Picture(part) => tracer.picture(&camera, part),
            Job::Aimed(group, from) => tracer.aimed(&aim, group, from, (from + AT_ONCE).min(options.aimed)),
        }
        if let Some(tell) = options.progress {
            tell((done.fetch_add(1, Relaxed) + 1) as f64 / total);
        }
        tracer
    });
    Ok(tracers.map(|tracer| tracer.report).reduce(Report::default, Report::with))
}

/// A unit of work.
#[derive(Clone, Copy)]
enum Job {
    /// A part of the picture.
    Picture(Part),
    /// Rays of an aimed group, from this one on.
    Aimed(Group, u64),
}

const AIMED: [Group; 5] = [Group::Vertices, Group::Edges, Group::Silhouettes, Group::Interiors, Group::Chords];

/// The picture in squares.
fn parts((width, height): (u32, u32)) -> Vec<Part> {
    let starts = |to: u32| (0..to).step_by(SIDE as usize);
    let part = |x: u32, y: u32| Part { x: [x, (x + SIDE).min(width)], y: [y, (y + SIDE).min(height)], width };
    starts(height).flat_map(|y| starts(width).map(move |x| part(x, y))).collect()
}
