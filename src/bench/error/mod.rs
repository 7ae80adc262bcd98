//! `tison bench error`: run time against error, measured against references that state their own noise.
//!
//! | part | job |
//! |---|---|
//! | `subject` | a scene, ready to be rendered by everybody |
//! | `reference` | the picture that the others are compared with, and its noise |
//! | `smooth` | pixels without an edge of any kind in them |
//! | `candidates` | who renders, and with how many samples |
//! | `measure` | pictures, seconds, figures |
//! | `fit` | slopes, and where a curve crosses a level |
//! | `tell` | tables, plots and pictures of all that |
//! | `precision` | the same question about single rays |
//!
//! Source of the protocol: the usual one of papers about sampling: error over time at equal settings, both
//! axes logarithmic, the slope as the rate at which the error falls.

mod candidates;
mod fit;
mod measure;
mod precision;
mod reference;
mod smooth;
mod subject;
mod tell;

pub use subject::OWN;

use super::report::{Machine, Report, Section};
use crate::backend;
use crate::render::Control;
use crate::scene;
use candidates::Candidate;
use measure::Measured;
use reference::Reference;
use std::cell::Cell;
use std::path::PathBuf;
use subject::Subject;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Pictures: the error that samples leave.
    Sampling,
    /// Single rays: the error of the numbers.
    Precision,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Sampling, Self::Precision];

    /// Name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sampling => "sampling",
            Self::Precision => "precision",
        }
    }
}

/// How much to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Parts to measure.
    pub parts: Vec<Part>,
    /// Names of scenes that come with the program ([`OWN`]), or scene files; none for all that come with it.
    pub scenes: Vec<PathBuf>,
    /// Pixels of the pictures; `None`: 96 across, in the shape that the scene asks for.
    pub size: Option<(u32, u32)>,
    /// Pictures for each number of samples; medians count. At least 1.
    pub seeds: u32,
    /// Most samples a pixel.
    pub most: u32,
    /// Samples a pixel of each of the reference's blocks.
    pub reference: u32,
    /// Whether every candidate gets as many samples as ours.
    pub all_to_most: bool,
}

impl Options {
    /// What takes a few minutes.
    #[must_use]
    pub fn quick(scenes: Vec<PathBuf>) -> Self {
        Self {
            parts: Part::ALL.to_vec(),
            scenes,
            size: None,
            seeds: 3,
            most: 4096,
            reference: 4096,
            all_to_most: false,
        }
    }

    /// All of it.
    #[must_use]
    pub fn full(scenes: Vec<PathBuf>) -> Self {
        Self { seeds: 5, reference: 16_384, all_to_most: true, ..Self::quick(scenes) }
    }
}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum Error {
    #[error("{}", .0)]
    Load(#[from] scene::Error),
    #[error("the scene {name} cannot be built")]
    Build {
        name: String,
        #[source]
        source: backend::Error,
    },
    #[error("a scene to measure with cannot be built")]
    Precision(#[from] backend::Error),
    #[error("{name} cannot be looked at: {why}")]
    Camera { name: String, why: String },
}

/// Who looks on.
pub struct Watch<'a> {
    /// Asked whether to stop; counts pixels.
    pub control: &'a Control,
    /// Told what begins.
    pub tell: &'a dyn Fn(&str),
    /// Told the shares of all the work before and after what begins, and the pixels that it takes.
    pub next: &'a dyn Fn(f64, f64, u64),
}

impl std::fmt::Debug for Watch<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Watch").field("control", self.control).finish_non_exhaustive()
    }
}

/// How much of the work is done, counted in samples.
struct Progress<'a> {
    watch: &'a Watch<'a>,
    total: f64,
    done: Cell<f64>,
}

impl Progress<'_> {
    /// What begins takes `spp` samples of each of `pixels`.
    fn begin(&self, pixels: u64, spp: u32) {
        let before = self.done.get();
        let after = before + pixels as f64 * f64::from(spp);
        self.done.set(after);
        (self.watch.next)(before / self.total, (after / self.total).min(1.0), pixels);
    }
}

/// Measures. After [`Control::cancel`] is set, the report has what was finished by then.
///
/// # Errors
/// See [`Error`].
pub fn run(options: &Options, watch: &Watch<'_>) -> Result<Report, Error> {
    let asked = |part| options.parts.contains(&part);
    let subjects = if asked(Part::Sampling) { Subject::all(options)? } else { Vec::new() };
    let candidates = candidates::all(options);
    let samples = |subject: &Subject| {
        let levels = candidates.iter().filter(|c| c.takes_part(subject)).flat_map(Candidate::levels);
        levels.map(f64::from).sum::<f64>() * f64::from(options.seeds.max(1))
            + f64::from(reference::BLOCKS) * f64::from(options.reference)
            + f64::from(smooth::SAMPLES)
    };
    let sampling: f64 = subjects.iter().map(|s| s.pixels() as f64 * samples(s)).sum();
    let precision = if asked(Part::Precision) { precision::samples() } else { 0.0 };
    let progress = Progress { watch, total: sampling + precision, done: Cell::new(0.0) };
    let mut sections = Vec::new();
    for subject in &subjects {
        if !watch.control.is_cancelled() {
            (watch.tell)(&subject.name);
            sections.extend(sections_of(subject, &candidates, options, &progress)?);
        }
    }
    if asked(Part::Precision) && !watch.control.is_cancelled() {
        (watch.tell)(Part::Precision.name());
        sections.extend(precision::sections(&progress)?);
    }
    Ok(Report {
        title: "tison: run time against error".into(),
        about: tell::ABOUT.into(),
        machine: Machine::this(),
        sections,
    })
}

/// Nothing, if it was stopped before there was anything to tell.
fn sections_of(
    subject: &Subject,
    candidates: &[Candidate],
    options: &Options,
    progress: &Progress<'_>,
) -> Result<Vec<Section>, Error> {
    let failed = |why| Error::Camera { name: subject.name.clone(), why };
    let Some(reference) = Reference::render(subject, options.reference, progress).map_err(failed)? else {
        return Ok(Vec::new());
    };
    progress.begin(subject.pixels(), smooth::SAMPLES);
    let smooth = smooth::pixels(subject).map_err(failed)?;
    let reference = reference.with_smooth(smooth);
    let candidates: Vec<Candidate> = candidates.iter().filter(|c| c.takes_part(subject)).cloned().collect();
    let measured = Measured::all(subject, &reference, &candidates, options, progress).map_err(failed)?;
    Ok(if measured.is_empty() { Vec::new() } else { tell::sections(subject, &reference, &measured, options) })
}
