//! `verify`: both backends and both readers, compared.

#[cfg(feature = "embree")]
mod backends;
mod json;
mod text;

use super::args::{ProgressMode, ReadingArgs};
use super::exit::{Exit, Failure};
use super::message::Messages;
use super::notice::Notice;
use super::plan::Input;
use super::progress::Progress;
use super::render::Reading;
use super::settings::SIZE;
use super::signals::Signals;
use super::target::Target;
use super::{limits, output, parse, render, system};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use tison::film;
use tison::math::Frame;
use tison::render::Control;
use tison::scene::{FreeMemory, Loaded, MeshFormat};
use tison::verify::Report;
use tison::verify::readers::{self, Compared};

/// What the help ends with.
pub const AFTER_HELP: &str = "\
A disagreement that rounding explains (edge, tie, grazing) is counted and does no harm; t, normal and real are
not explained. docs/verify.md says what is sent and how wide the bands are.

Exit codes: 0 no more than rounding, 5 an unexplained disagreement of the backends or of the readers;
the others as for tison render.";

#[derive(Args, Debug)]
pub struct VerifyArgs {
    /// Scene (.toml, .json, .ray) or mesh (.obj, .ply) to send rays through
    #[arg(value_name = "FILE")]
    pub input: PathBuf,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// Rays of each kind; camera rays as many as the picture has pixels [default: 200000; fewer for few primitives]
    #[arg(
        long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000_000_000),
        allow_negative_numbers = true
    )]
    pub rays: Option<u64>,
    /// Pixels of the picture [default: the scene's or 1280x720; about as many as --rays says]
    #[arg(long, value_name = "WxH", value_parser = parse::size)]
    pub size: Option<(u64, u64)>,
    /// Chooses the rays
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub seed: u32,
    /// Threads to work with [default: all]
    #[arg(
        short = 'j', long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024),
        allow_negative_numbers = true
    )]
    pub threads: Option<u16>,
    /// Compare the readers of OBJ files only; works without Embree too
    #[arg(long, conflicts_with_all = ["rays", "size", "seed"])]
    pub readers: bool,
    /// One JSON object on stdout instead of the table, or in FILE beside it
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true, default_missing_value = "-")]
    pub json: Option<PathBuf>,
}

/// What came of it all.
struct Story<'a> {
    file: &'a Path,
    seed: u32,
    size: (u32, u32),
    /// Rays of each aimed kind.
    aimed: u64,
    /// Absent where only readers were compared.
    backends: Option<Report>,
    /// Of the scene, for the lines that repeat a ray.
    frame: Frame,
    readers: Vec<Compared>,
    seconds: f64,
}

impl Story<'_> {
    fn disagrees(&self) -> bool {
        self.backends.as_ref().is_some_and(|report| report.unexplained() > 0)
            || self.readers.iter().any(|r| !r.differences.is_empty())
    }
}

/// Compares, tells, and leaves with 5 if something differs that should not.
pub fn verify(args: &VerifyArgs, messages: &Messages) -> Result<Exit, Failure> {
    Input::of(&args.input).check_reading(&args.reading, &args.input)?;
    if !args.readers && !cfg!(feature = "embree") {
        let what = "this tison was built without Embree: there is one backend, and nothing to compare it with";
        return Err(Failure::usage(what).help("--readers compares the readers of OBJ files, which needs no Embree"));
    }
    let target = args.json.clone().map(Target::of);
    if let Some(Target::File(path)) = &target {
        film::check_target(path)?;
    }
    let control = Arc::new(Control::default());
    let signals =
        Signals::install(&control).map_err(|e| Failure::new(Exit::Internal, "cannot listen for signals").because(e))?;
    let threads = args.threads.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Failure::new(Exit::Render, format!("cannot start {threads} threads")).because(e))?;
    let progress = Progress::start(ProgressMode::Auto, &control);
    let run = Run { args, messages, control: &control, progress: &progress };
    let story = pool.install(|| run.story());
    drop(progress);
    if let Some(exit) = signals.caught() {
        return Err(Failure::new(exit, "stopped"));
    }
    let story = story?;
    let json = || format!("{:#}\n", json::of(&story));
    match &target {
        Some(Target::Stdout) => output::print(json().as_bytes())?,
        Some(Target::File(path)) => {
            film::save(path, |out| out.write_all(json().as_bytes()))?;
            output::print(text::of(&story).as_bytes())?
        }
        None => output::print(text::of(&story).as_bytes())?,
    };
    Ok(if story.disagrees() { Exit::Differs } else { Exit::Done })
}

struct Run<'a, 'r> {
    args: &'a VerifyArgs,
    messages: &'r Messages,
    control: &'r Control,
    progress: &'r Progress,
}

impl<'a> Run<'a, '_> {
    fn story(&self) -> Result<Story<'a>, Failure> {
        let (started, args) = (Instant::now(), self.args);
        let reading = Reading {
            reader: args.reading.obj_reader,
            skips: tison::scene::Skips::ALL,
            exact: false,
            smooth: None,
            allow: &args.reading.allow_path,
            defines: &args.reading.define,
        };
        let loaded = render::load(&args.input, &reading, self.control, self.progress)?;
        self.progress.aside(|| self.messages.warnings(&Notice::about(&loaded), false, "tison check shows all"));
        let readers = self.compare_readers(&loaded)?;
        let frame = loaded.scene.frame;
        let (size, aimed) = (self.size(&loaded)?, self.aimed(&loaded));
        #[cfg(feature = "embree")]
        let backends = if args.readers { None } else { Some(self.compare_backends(loaded, size, aimed)?) };
        #[cfg(not(feature = "embree"))]
        let backends = None;
        let seconds = started.elapsed().as_secs_f64();
        Ok(Story { file: &args.input, seed: args.seed, size, aimed, backends, frame, readers, seconds })
    }

    /// Every OBJ file that was read.
    fn compare_readers(&self, loaded: &Loaded) -> Result<Vec<Compared>, Failure> {
        let is_obj = |path: &&PathBuf| MeshFormat::of(path) == Some(MeshFormat::Obj);
        // A pipe is empty by now.
        let meshes = loaded.files.iter().filter(is_obj).filter(|path| path.is_file());
        let compare = |path: &PathBuf| {
            let (allow, cancel) = (&self.args.reading.allow_path, &self.control.cancel);
            readers::compare(path, allow, cancel, FreeMemory::new(&system::available_memory)).map_err(Failure::from)
        };
        meshes.map(compare).collect()
    }

    fn size(&self, loaded: &Loaded) -> Result<(u32, u32), Failure> {
        let own = loaded.render.size.map_or(SIZE, |(w, h)| (u64::from(w), u64::from(h)));
        let size = match (self.args.size, self.args.rays) {
            (Some(size), _) => size,
            (None, Some(rays)) => {
                let by = (rays as f64 / (own.0 as f64 * own.1 as f64)).sqrt();
                let side = |side: u64| ((side as f64 * by).round() as u64).max(1);
                (side(own.0), side(own.1))
            }
            (None, None) => own,
        };
        if size.0.max(size.1) > limits::MAX_SIDE {
            let what =
                format!("a picture of {}x{} pixels: no side may be longer than {}", size.0, size.1, limits::MAX_SIDE);
            return Err(Failure::new(Exit::Limit, what).help("choose a smaller --size, or fewer --rays"));
        }
        Ok((size.0 as u32, size.1 as u32))
    }

    /// So many that every primitive of a small scene is aimed at often.
    fn aimed(&self, loaded: &Loaded) -> u64 {
        const MOST: u64 = 200_000;
        const LEAST: u64 = 20_000;
        const EACH: u64 = 200;
        let primitives = (loaded.scene.stored_triangles() + loaded.scene.shapes()) as u64;
        self.args.rays.unwrap_or_else(|| (EACH * primitives).clamp(LEAST, MOST))
    }
}
