//! `bench error`: run time against error.

use super::ReportArgs;
use crate::cli::args::ProgressMode;
use crate::cli::exit::{Exit, Failure};
use crate::cli::message::Messages;
use crate::cli::parse;
use crate::cli::progress::Progress;
use crate::cli::signals::Signals;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::path::PathBuf;
use std::sync::Arc;
use tison::bench::error::{self, Options, Part, Watch};
use tison::render::Control;

/// What the help ends with.
pub const AFTER_HELP: &str = "\
SCENE is lens, shadow or edges, which come with tison, or a scene or mesh file. docs/error.md says what the report
means. Ctrl-C ends the run early: what was finished by then is reported, and the exit code is 130.";

#[derive(Args, Debug)]
pub struct ErrorArgs {
    /// Scenes to measure with [default: lens, shadow and edges]
    #[arg(value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    /// Pixels of the pictures [default: 96 across, in the scene's shape]
    #[arg(long, value_name = "WxH", value_parser = parse::size)]
    size: Option<(u64, u64)>,
    /// Pictures for each number of samples, of which the medians count [default: 3, with --full 5]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000), allow_negative_numbers = true)]
    seeds: Option<u32>,
    /// Most samples per pixel [default: 4096]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65_536), allow_negative_numbers = true)]
    spp: Option<u32>,
    /// Samples per pixel of each of the four blocks of the reference [default: 4096, with --full 16384]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65_536), allow_negative_numbers = true)]
    reference: Option<u32>,
    /// Every candidate as many samples as ours, five seeds, a reference of 65536 samples: takes five times as long
    #[arg(long)]
    full: bool,
    /// Parts to measure: the error that samples leave in pictures, the error of the numbers of single rays [default: both]
    #[arg(long, value_name = "PART,…", value_delimiter = ',', value_parser = part())]
    only: Vec<Part>,
    /// How to show progress, on stderr
    #[arg(long, value_enum, value_name = "HOW", default_value = "auto")]
    progress: ProgressMode,
    #[command(flatten)]
    report: ReportArgs,
}

fn part() -> impl TypedValueParser<Value = Part> {
    PossibleValuesParser::new(Part::ALL.map(Part::name))
        .map(|name| Part::ALL.into_iter().find(|p| p.name() == name).expect("only their names are possible"))
}

/// Measures, shows how far it is, and tells what was finished.
pub fn error(args: &ErrorArgs, messages: &Messages) -> Result<Exit, Failure> {
    args.report.check()?;
    let options = options(args)?;
    let control = Arc::new(Control::default());
    let signals =
        Signals::install(&control).map_err(|e| Failure::new(Exit::Internal, "cannot listen for signals").because(e))?;
    let progress = Progress::start(args.progress, &control);
    let report = {
        let tell = |scene: &str| progress.aside(|| messages.line(&format!("measuring {scene}")));
        let next = |from: f64, to: f64, pixels: u64| progress.measure(from, to, pixels);
        error::run(&options, &Watch { control: &control, tell: &tell, next: &next })
    };
    drop(progress);
    let report = report.map_err(|e| match e {
        error::Error::Load(e) => e.into(),
        error::Error::Camera { .. } => Failure::new(Exit::Input, e.to_string()),
        e => Failure::new(Exit::Render, "cannot measure").because(e),
    })?;
    let Some(exit) = signals.caught() else { return args.report.tell(&report, messages) };
    if report.sections.is_empty() {
        return Err(Failure::new(exit, "stopped before anything was measured"));
    }
    args.report.tell(&report, messages)?;
    messages.line("stopped: the report has what was finished by then");
    Ok(exit)
}

fn options(args: &ErrorArgs) -> Result<Options, Failure> {
    let all = if args.full { Options::full(args.scenes.clone()) } else { Options::quick(args.scenes.clone()) };
    let size = args.size.map(small).transpose()?;
    let parts = if args.only.is_empty() { all.parts.clone() } else { args.only.clone() };
    if !parts.contains(&Part::Sampling) && !args.scenes.is_empty() {
        return Err(Failure::usage("the precision of single rays is measured without a scene")
            .help("leave out the scenes, or add sampling to --only"));
    }
    Ok(Options {
        parts,
        size,
        seeds: args.seeds.unwrap_or(all.seeds),
        most: args.spp.unwrap_or(all.most),
        reference: args.reference.unwrap_or(all.reference),
        ..all
    })
}

/// Pictures that a page can hold, and a few minutes.
fn small((width, height): (u64, u64)) -> Result<(u32, u32), Failure> {
    /// Most pixels.
    const MOST: u64 = 1 << 20;
    match (u32::try_from(width), u32::try_from(height)) {
        (Ok(w), Ok(h)) if width.saturating_mul(height) <= MOST => Ok((w, h)),
        _ => {
            let what = format!("pictures of {width}x{height} pixels are too large to measure so often");
            Err(Failure::new(Exit::Limit, what).help(format!("choose a --size of at most {MOST} pixels in all")))
        }
    }
}
