//! `tison bench skip`: what each skip saves, and the proof that it changes nothing, or no more than it may.
//!
//! | part | job |
//! |---|---|
//! | `subject` | scenes that have something to leave out |
//! | `compare` | the same picture with and without a skip |
//! | `tell` | what came of it, as a report |

mod compare;
mod subject;
mod tell;

pub use compare::{Done, Proof, done, left_out};
pub use subject::{Assets, Scale, Subject};

use super::cost::median;
use super::report::Report;
use crate::backend::{self, BackendKind};
use crate::render::Job;
use crate::scene::{self, Skip, Skips};
use std::path::PathBuf;

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Scene and mesh files to leave something out of, instead of a scene for each skip.
    pub files: Vec<PathBuf>,
    /// The skips to measure.
    pub skips: Vec<Skip>,
    /// Who answers the rays.
    pub backend: BackendKind,
    /// Times that each pair is rendered; the medians count. At least 1.
    pub rounds: usize,
    /// How large the scenes are that come with tison.
    pub scale: Scale,
}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum Error {
    #[error("a scene cannot be built")]
    Build(#[from] backend::Error),
    #[error("a scene cannot be read")]
    Load(#[from] scene::Error),
    #[error("the scenes cannot be written to a temporary folder")]
    Assets(#[from] std::io::Error),
    #[error("no picture can be made: {0}")]
    Camera(String),
}

/// A report, and the skips that changed what they must not.
#[derive(Debug)]
pub struct Measured {
    /// What was measured.
    pub report: Report,
    /// A sentence for each.
    pub broken: Vec<String>,
}

/// What one row of the table tells.
#[derive(Debug)]
struct Found {
    skip: Skip,
    scene: String,
    /// How many of what.
    left_out: (u64, &'static str),
    proof: Proof,
    /// Medians with and without the skip, and the median of the pairs' ratios of without to with; `None` if there was
    /// nothing to leave out.
    seconds: Option<Seconds>,
}

#[derive(Clone, Copy, Debug)]
struct Seconds {
    with: f64,
    without: f64,
    ratio: f64,
}

/// Measures; `tell` hears what it is at.
///
/// # Errors
/// See [`Error`].
pub fn run(options: &Options, tell: &dyn Fn(&str)) -> Result<Measured, Error> {
    let assets = Assets::new(options.scale)?;
    let mut found = Vec::new();
    for &skip in &options.skips {
        tell(skip.name());
        let own = || vec![Subject::of(skip, options.scale)];
        let files = || options.files.iter().map(|path| Subject::file(path, of_a_file(skip))).collect();
        let subjects: Vec<Subject> = if options.files.is_empty() { own() } else { files() };
        for subject in &subjects {
            found.push(measured(skip, subject, &assets, options)?);
        }
    }
    let broken = found.iter().filter(|f| !f.proof.holds());
    let broken = broken.map(|f| format!("{} in {}: {}", f.skip.name(), f.scene, f.proof)).collect();
    Ok(Measured { report: tell::report(&found, options), broken })
}

/// A picture of somebody's scene that `skip` can be measured with.
fn of_a_file(skip: Skip) -> Job {
    let own = Subject::of(skip, Scale::Full).job;
    // The weight cut of a render that says nothing.
    if skip == Skip::WeightCut { Job { min_weight: 1.0 / 1024.0, k_max: 8, ..own } } else { own }
}

fn measured(skip: Skip, subject: &Subject, assets: &Assets, options: &Options) -> Result<Found, Error> {
    let render = |skips| done(subject, assets, options.backend, skips);
    let pair = || Ok::<_, Error>((render(Skips::ALL)?, render(Skips::ALL.without(skip))?));
    // The first pair warms the caches; each pair is compared.
    let (on, off) = pair()?;
    let (left_out, mut proof) = (left_out(skip, &on, &off), Proof::of(skip, &on, &off));
    drop((on, off));
    let mut times = Vec::new();
    while left_out.0 > 0 && times.len() < options.rounds.max(1) {
        let (on, off) = pair()?;
        let again = Proof::of(skip, &on, &off);
        proof = if again.holds() { proof } else { again };
        times.push((on.seconds, off.seconds));
    }
    let median_of = |of: fn(&(f64, f64)) -> f64| median(times.iter().map(of).collect());
    let seconds = (!times.is_empty()).then(|| Seconds {
        with: median_of(|t| t.0),
        without: median_of(|t| t.1),
        ratio: median_of(|t| t.1 / t.0),
    });
    Ok(Found { skip, scene: subject.name.clone(), left_out, proof, seconds })
}
