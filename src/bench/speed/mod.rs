//! `tison bench speed`: the native tracer, Embree through tison, and a bare loop over Embree's own calls; the same rays
//! in turn, in one process.
//!
//! | part | job |
//! |---|---|
//! | `subject` | what is traced: generated meshes, spheres, files; and the time it takes to read them |
//! | `trio` | the three that answer, and the time it takes to build them |
//! | `work` | rays of all kinds, and how many a second are answered |
//! | `tell` | tables, plots |
//!
//! The bare loop asks the very hierarchy that tison asks, so that where that lies in memory is the same for both; only
//! for spheres it asks one of Embree's own sphere primitive, which tison has no use for.

mod subject;
mod tell;
mod trio;
mod work;

use super::report::Report;
use crate::backend;
use crate::scene;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::io;
use std::path::PathBuf;
use std::time::Instant;
use subject::{Sight, Subject};
use trio::Trio;
use work::Work;

/// What to trace.
#[derive(Clone, Debug)]
pub struct Options {
    /// Triangles of generated meshes.
    pub triangles: Vec<u64>,
    /// Numbers of spheres at random places.
    pub spheres: Vec<u32>,
    /// Scene and mesh files, looked at through their first camera.
    pub files: Vec<PathBuf>,
    /// Numbers of threads; none is 1, 2, 4 and so on, and all.
    pub threads: Vec<usize>,
    /// Times that everything is traced; the medians count. At least 1.
    pub rounds: usize,
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
    #[error("no rays can be made: {0}")]
    Camera(String),
    #[error("so many threads cannot be had")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    #[error("a mesh of {triangles} triangles cannot be written to the temporary folder (TMPDIR says where that is)")]
    Write {
        triangles: u64,
        #[source]
        source: io::Error,
    },
}

/// Primitives from which on a scene is read and built only once.
const LARGE: usize = 2_000_000;

/// Measures; `tell` hears what it is at.
///
/// # Errors
/// See [`Error`].
pub fn run(options: &Options, tell: &dyn Fn(&str)) -> Result<Report, Error> {
    let threads = if options.threads.is_empty() { thread_counts() } else { options.threads.clone() };
    let rounds = options.rounds.max(1);
    let subjects = subject::all(options);
    let (started, steps) = (Instant::now(), subjects.len() * threads.len());
    let (mut found, mut step) = (Vec::new(), 0);
    for subject in &subjects {
        let mut tell = |name: &str, threads: usize| {
            step += 1;
            let seconds = started.elapsed().as_secs();
            let threads = if threads == 1 { "one thread".into() } else { format!("{threads} threads") };
            tell(&format!("{name} by {threads} ({step} of {steps}; {seconds} s so far)"));
        };
        found.extend(measured(subject, &threads, rounds, &mut tell)?);
    }
    Ok(tell::report(&found, &threads, options))
}

/// 1, 2, 4 and so on, and all.
fn thread_counts() -> Vec<usize> {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let mut counts: Vec<usize> = std::iter::successors(Some(1), |n| Some(2 * n)).take_while(|&n| n < all).collect();
    counts.push(all);
    counts
}

/// What kind of things a scene has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Triangles,
    Spheres,
    File,
}

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    /// Seconds to read the file, which no backend has to do with.
    Load,
    /// Seconds to build the hierarchy.
    Build,
    /// Mrays per second of one kind.
    Rays(&'static str),
    /// The same of a whole render, shading and all.
    Render,
}

/// What one row of a table tells.
#[derive(Clone, Debug)]
struct Found {
    scene: String,
    kind: Kind,
    primitives: usize,
    threads: usize,
    what: What,
    /// Medians of native, Embree and bare Embree, as far as there are such.
    values: [Option<f64>; 3],
    /// Median of the rounds' ratios of native to Embree.
    native_to_embree: Option<f64>,
    /// Likewise of Embree to bare Embree.
    embree_to_bare: Option<f64>,
}

/// One round's values of native, Embree and bare Embree.
type Round = [Option<f64>; 3];

/// What every row about a scene and a number of threads begins with.
struct Rows<'a> {
    name: &'a str,
    kind: Kind,
    primitives: usize,
    threads: usize,
}

impl Rows<'_> {
    fn row(&self, what: What, rounds: &[Round]) -> Found {
        let of = |value: &dyn Fn(&Round) -> Option<f64>| {
            let all: Vec<f64> = rounds.iter().filter_map(value).collect();
            (!all.is_empty()).then(|| super::cost::median(all))
        };
        Found {
            scene: self.name.to_owned(),
            kind: self.kind,
            primitives: self.primitives,
            threads: self.threads,
            what,
            values: [0, 1, 2].map(|i| of(&|r| r[i])),
            native_to_embree: of(&|r| Some(r[0]? / r[1]?)),
            embree_to_bare: of(&|r| Some(r[1]? / r[2]?)),
        }
    }
}

fn measured(
    subject: &Subject,
    threads: &[usize],
    rounds: usize,
    tell: &mut dyn FnMut(&str, usize),
) -> Result<Vec<Found>, Error> {
    let (mut out, mut sight, mut work) = (Vec::new(), None, None);
    let file = subject.file()?;
    for &threads in threads {
        tell(&subject.name(), threads);
        let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
        let mut loading = Vec::new();
        for file in file.iter().flat_map(|file| std::iter::repeat_n(file, times(subject.about(), rounds))) {
            // The last one goes before the next one comes.
            drop(sight.take());
            let (loaded, seconds) = subject::load(file.path(), &pool)?;
            // Nobody but tison reads files, whoever traces.
            loading.push([Some(seconds), None, None]);
            sight = Some(loaded);
        }
        let sight = match &mut sight {
            Some(sight) => &*sight,
            empty => &*empty.insert(subject.made()?),
        };
        let name = subject.name_of(&sight.scene);
        let primitives = sight.scene.stored_triangles() + sight.scene.shapes();
        let rows = Rows { name: &name, kind: subject.kind(), primitives, threads };
        out.extend((!loading.is_empty()).then(|| rows.row(What::Load, &loading)));
        out.extend(traced(sight, &rows, &mut work, &pool, rounds)?);
    }
    Ok(out)
}

/// Builds and asks. `work` is made of the first hierarchy, and the same for all numbers of threads.
fn traced(
    sight: &Sight,
    rows: &Rows<'_>,
    work: &mut Option<Vec<Work>>,
    pool: &ThreadPool,
    rounds: usize,
) -> Result<Vec<Found>, Error> {
    let (mut trio, mut building) = Trio::build(sight, pool).map(|(trio, seconds)| (trio, vec![seconds]))?;
    for _ in 1..times(rows.primitives, rounds) {
        // Memory for one of each is enough.
        drop(trio);
        let (again, seconds) = Trio::build(sight, pool)?;
        building.push(seconds);
        trio = again;
    }
    let mut out = vec![rows.row(What::Build, &building)];
    let work = match work {
        Some(work) => work,
        empty => empty.insert(work::all(sight, &trio)?),
    };
    for work in work {
        out.push(rows.row(What::Rays(work.name()), &work.rounds(&trio, pool, rounds)?));
    }
    out.push(rows.row(What::Render, &work::renders(sight, &trio, pool, rounds)?));
    Ok(out)
}

/// How often something is done that takes longer, the more primitives there are.
fn times(primitives: usize, rounds: usize) -> usize {
    if primitives > LARGE { 1 } else { rounds.min(3) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_of_the_rounds_ratios_and_not_the_ratio_of_medians() {
        let rows = Rows { name: "a", kind: Kind::File, primitives: 1, threads: 1 };
        let rounds = [[Some(1.0), Some(2.0), Some(4.0)], [Some(9.0), Some(3.0), None], [Some(2.0), Some(10.0), None]];
        let row = rows.row(What::Render, &rounds);
        assert_eq!(row.values, [Some(2.0), Some(3.0), Some(4.0)]);
        assert_eq!((row.native_to_embree, row.embree_to_bare), (Some(0.5), Some(0.5)));
        let none = rows.row(What::Build, &[[Some(1.0), None, None]]);
        assert_eq!((none.values, none.embree_to_bare), ([Some(1.0), None, None], None));
    }

    #[test]
    fn all_threads_are_among_the_counts_once() {
        let counts = thread_counts();
        assert_eq!(counts[0], 1);
        assert!(counts.is_sorted_by(|a, b| a < b), "{counts:?}");
    }
}
