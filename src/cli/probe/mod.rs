//! `probe`: rays on stdin, exact answers on stdout.
//!
//! | file | job |
//! |---|---|
//! | `stream` | input in, answers out: in order, in parallel, in constant memory |
//! | `lines` | one JSON object a line |
//! | `line` | what such a line says |
//! | `json` | a reader of one line that knows its columns |
//! | `rows` | rays as the rows of a NumPy array, answers as records |
//! | `npy` | the header of such arrays |

mod json;
mod line;
mod lines;
mod npy;
mod rows;
mod stream;

use super::args::{ProgressMode, ReadingArgs};
use super::both::Backends;
use super::exit::{Exit, Failure};
use super::message::Messages;
use super::notice::Notice;
use super::plan::{self, Input};
use super::progress::{Progress, Stage};
use super::render::{self, Reading};
use super::signals::Signals;
use clap::{Args, ValueEnum};
use lines::Lines;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stream::Stream;
use tison::backend::{BackendKind, BuildOptions, ExactMaker};
use tison::probe::Prober;
use tison::render::Control;
use tison::scene::Scene;

/// What the long help ends with.
const AFTER_HELP: &str = r#"With SCENE each line is a ray in world space; t counts in units of d, of any length:
  {"o": [0, 0, 5], "d": [0, 0, -1], "tmin": 0, "tmax": 1e9}
Without it each line brings its own shape:
  {"shape": "sphere", "params": {"center": [0, 0, 0], "radius": 1},
   "object_to_world": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "ray": {"o": [0, 0, 5], "d": [0, 0, -1]}}
Shapes: sphere (center, radius), cube (half, center), cylinder (radius, height, capped; around z), quad (half),
triangle (a, b, c). Left out: tmin 0, tmax infinity, center 0 0 0, capped false, object_to_world nothing.
Each answer is a line, {"hit":false} for a miss:
  {"hit":true,"t":4.0,"p":[..],"n":[..],"ng":[..],"uv":[..],"object":0,"prim":0,"entering":true}"#;

#[derive(Args, Debug)]
#[command(after_long_help = AFTER_HELP)]
pub struct ProbeArgs {
    /// Scene (.toml, .json, .ray) or mesh (.obj, .ply) to cast rays at; without one each line has a shape of its own
    pub scene: Option<PathBuf>,
    /// Who answers the rays
    #[arg(long, value_name = "NAME", value_parser = Backends::parser_of_one())]
    pub backend: Option<BackendKind>,
    /// Round rays to f32 and take the first word of the backend, as a render does
    #[arg(long)]
    pub as_rendered: bool,
    /// How rays come and answers go
    #[arg(long, value_enum, default_value = "jsonl")]
    pub format: Format,
    /// Threads to work with [default: all]
    #[arg(
        short = 'j', long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024),
        allow_negative_numbers = true
    )]
    pub threads: Option<u16>,
    #[command(flatten)]
    pub reading: ReadingArgs,
}

/// How rays come and answers go.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// A JSON object per line
    Jsonl,
    /// A NumPy array of rows ox oy oz dx dy dz [tmin [tmax]], float32 or float64; answers as an array of records
    Npy,
}

/// Answers the rays on stdin.
pub fn probe(args: &ProbeArgs, messages: &Messages) -> Result<Exit, Failure> {
    let kind = Backends::chosen_one(args.backend)?;
    let threads = args.threads.map_or_else(plan::all_threads, usize::from);
    match &args.scene {
        Some(scene) => Input::of(scene).check_reading(&args.reading, scene)?,
        None if args.format == Format::Npy => {
            return Err(Failure::usage("--format npy has no room for shapes").help("name a scene: tison probe SCENE"));
        }
        None if args.as_rendered => {
            return Err(Failure::usage("--as-rendered is about the rays of a render, and no scene is named")
                .help("name a scene: tison probe SCENE --as-rendered"));
        }
        None if !args.reading.define.is_empty() => {
            return Err(Failure::usage("-D sets keys of a scene file, and none is named"));
        }
        None => {}
    }
    let control = Arc::new(Control::default());
    let signals =
        Signals::install(&control).map_err(|e| Failure::new(Exit::Internal, "cannot listen for signals").because(e))?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Failure::new(Exit::Render, format!("cannot start {threads} threads")).because(e))?;
    let run = Run { args, kind, threads, control: &control };
    let done = pool.install(|| run.answer(messages));
    match (done, signals.caught()) {
        (Err(failure), None) => Err(failure),
        // Whatever was answered before the signal is written.
        (_, Some(exit)) => Ok(exit),
        (Ok(()), None) => Ok(Exit::Done),
    }
}

struct Run<'a> {
    args: &'a ProbeArgs,
    kind: BackendKind,
    threads: usize,
    control: &'a Arc<Control>,
}

impl Run<'_> {
    fn answer(&self, messages: &Messages) -> Result<(), Failure> {
        let maker = ExactMaker::new(self.kind, self.threads).map_err(|e| render::build_failure(&e))?;
        let prober = match &self.args.scene {
            Some(path) => Some(self.prober(path, &maker, messages)?),
            None => None,
        };
        let mut stream = Stream::of_stdin(&self.control.cancel)
            .map_err(|e| Failure::new(Exit::Internal, "cannot start a thread that reads").because(e))?;
        match (&prober, self.args.format) {
            (Some(prober), Format::Npy) => rows::answer(prober, &mut stream),
            (prober, _) => stream.answer(&Lines::new(prober.as_ref(), &maker, &self.control.cancel)),
        }
    }

    fn prober(&self, path: &Path, maker: &ExactMaker, messages: &Messages) -> Result<Prober, Failure> {
        let progress = Progress::start(ProgressMode::Auto, self.control);
        progress.stage(Stage::Read);
        let reading = &self.args.reading;
        let reading = Reading {
            reader: reading.obj_reader,
            skips: tison::scene::Skips::ALL,
            exact: true,
            smooth: None,
            allow: &reading.allow_path,
            defines: &reading.define,
        };
        let loaded = render::load(path, &reading, self.control, &progress)?;
        progress.aside(|| messages.warnings(&Notice::about(&loaded), false, "tison check shows all"));
        progress.stage(Stage::Build);
        let report = |share| progress.report(share);
        let options = BuildOptions {
            threads: self.threads,
            // Nobody knows; a good hierarchy is soon worth it.
            rays_expected: u64::MAX,
            cancel: &self.control.cancel,
            memory_limit: None,
            progress: Some(&report),
        };
        let scene: Scene = loaded.scene;
        let built = if self.args.as_rendered {
            Prober::rounded(scene, self.kind, &options)
        } else {
            Prober::build(scene, maker, &options)
        };
        built.map_err(|e| render::build_failure(&e))
    }
}
