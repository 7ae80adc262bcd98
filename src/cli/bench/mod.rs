//! `bench`: how right and how fast the tracer is.

mod error;
mod skip;

use super::exit::{Exit, Failure};
use super::message::Messages;
use super::{output, style};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};
use tison::bench::report::Report;
use tison::bench::speed;
use tison::bench::stability::{self, Part};
use tison::film;

/// What can be measured.
#[derive(Debug, Subcommand)]
pub enum Bench {
    /// Wrong answers, leaks and false shadows over distance, scale and place, and what accuracy costs
    Stability(StabilityArgs),
    /// The native tracer, Embree, and a bare loop over Embree: seconds to read and build, rays per second, whole renders,
    /// over sizes and threads
    Speed(SpeedArgs),
    /// Run time against error of pictures: who needs how many samples and seconds, and how fast the error falls
    #[command(after_long_help = error::AFTER_HELP)]
    Error(error::ErrorArgs),
    /// What is left out because a scene does not need it: what that saves, and that the picture is the same
    #[command(after_long_help = skip::AFTER_HELP)]
    Skip(skip::SkipArgs),
}

/// Where what was measured goes.
#[derive(Args, Debug)]
pub struct ReportArgs {
    /// Write a page with the tables and plots
    #[arg(short, long, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Write what was measured for programs; `-` is stdout, instead of the tables
    #[arg(long, value_name = "FILE.json")]
    json: Option<PathBuf>,
    /// Write the same for spreadsheets; `-` is stdout, instead of the tables
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
}

/// `bench stability`.
#[derive(Args, Debug)]
pub struct StabilityArgs {
    /// Rays for each case of leaks and of false shadows [default: so many that all takes about a minute]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), allow_negative_numbers = true)]
    rays: Option<u64>,
    /// Parts to measure [default: all]
    #[arg(long, value_name = "PART,…", value_delimiter = ',', value_parser = part())]
    only: Vec<Part>,
    #[command(flatten)]
    report: ReportArgs,
}

/// `bench speed`.
#[derive(Args, Debug)]
pub struct SpeedArgs {
    /// Scenes or meshes to trace, instead of generated ones unless those are asked for too
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Triangles of generated meshes; 0 is none [default: 10000,100000,1000000,10000000, for which the
    /// temporary folder needs 1 GB]
    #[arg(
        long, value_name = "N,…", value_delimiter = ',', allow_negative_numbers = true,
        value_parser = clap::value_parser!(u64).range(..=100_000_000)
    )]
    triangles: Vec<u64>,
    /// Spheres at random places; 0 is none [default: 10,1000,100000,1000000]
    #[arg(
        long, value_name = "N,…", value_delimiter = ',', allow_negative_numbers = true,
        value_parser = clap::value_parser!(u32).range(..=10_000_000)
    )]
    spheres: Vec<u32>,
    /// Numbers of threads [default: 1, 2, 4 and so on, and all]
    #[arg(
        long, value_name = "N,…", value_delimiter = ',', allow_negative_numbers = true,
        value_parser = clap::value_parser!(u16).range(1..=1024)
    )]
    threads: Vec<u16>,
    /// Rounds, of which the medians count
    #[arg(
        long, value_name = "N", default_value = "5", allow_negative_numbers = true,
        value_parser = clap::value_parser!(u16).range(1..)
    )]
    rounds: u16,
    #[command(flatten)]
    report: ReportArgs,
}

fn part() -> impl TypedValueParser<Value = Part> {
    PossibleValuesParser::new(Part::ALL.map(Part::name))
        .map(|name| Part::ALL.into_iter().find(|p| p.name() == name).expect("only their names are possible"))
}

/// Measures what was asked for.
pub fn bench(what: &Bench, messages: &Messages) -> Result<Exit, Failure> {
    match what {
        Bench::Stability(args) => stability(args, messages),
        Bench::Speed(args) => speed(args, messages),
        Bench::Error(args) => error::error(args, messages),
        Bench::Skip(args) => skip::run(args, messages),
    }
}

fn stability(args: &StabilityArgs, messages: &Messages) -> Result<Exit, Failure> {
    args.report.check()?;
    let parts = if args.only.is_empty() { Part::ALL.to_vec() } else { args.only.clone() };
    let options = stability::Options { rays: args.rays, parts };
    let report = stability::run(&options, &|part| messages.line(&format!("measuring {part}")));
    let report = report.map_err(|e| Failure::new(Exit::Render, "cannot measure").because(e))?;
    args.report.tell(&report, messages)
}

fn speed(args: &SpeedArgs, messages: &Messages) -> Result<Exit, Failure> {
    args.report.check()?;
    let mut options = speed::Options {
        triangles: args.triangles.clone(),
        spheres: args.spheres.clone(),
        files: args.files.clone(),
        threads: args.threads.iter().map(|&n| usize::from(n)).collect(),
        rounds: usize::from(args.rounds),
    };
    if options.files.is_empty() && options.triangles.is_empty() && options.spheres.is_empty() {
        options.triangles = vec![10_000, 100_000, 1_000_000, 10_000_000];
        options.spheres = vec![10, 1000, 100_000, 1_000_000];
    }
    options.triangles.retain(|&n| n > 0);
    options.spheres.retain(|&n| n > 0);
    let report = speed::run(&options, &|scene| messages.line(&format!("measuring {scene}")));
    let report = report.map_err(|e| match e {
        speed::Error::Load(e) => e.into(),
        e => Failure::new(Exit::Render, "cannot measure").because(e),
    })?;
    args.report.tell(&report, messages)
}

impl ReportArgs {
    /// Before the work is done: whether what comes of it can be written.
    fn check(&self) -> Result<(), Failure> {
        let for_programs = [&self.json, &self.csv].into_iter().flatten();
        if for_programs.clone().filter(|path| is_stdout(path)).count() > 1 {
            return Err(Failure::usage("--json - and --csv - both want stdout").help("write one of them to a file"));
        }
        let mut files = for_programs.filter(|path| !is_stdout(path)).chain(&self.output);
        files.try_for_each(|path| Ok(film::check_target(path)?))
    }

    fn tell(&self, report: &Report, messages: &Messages) -> Result<Exit, Failure> {
        if let Some(path) = &self.output {
            write(path, &report.html(), messages)?;
        }
        let json = |report: &Report| format!("{:#}\n", report.json());
        let mut instead = None;
        for (path, text) in [(&self.json, json as fn(&Report) -> String), (&self.csv, Report::csv)] {
            match path {
                Some(path) if is_stdout(path) => instead = Some(text(report)),
                Some(path) => write(path, &text(report), messages)?,
                None => {}
            }
        }
        output::print(instead.unwrap_or_else(|| report.text()).as_bytes())
    }
}

fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}

fn write(path: &Path, text: &str, messages: &Messages) -> Result<(), Failure> {
    let size = film::save(path, |out| out.write_all(text.as_bytes()))?;
    messages.line(&format!("wrote     {} ({})", path.display(), style::bytes(size)));
    Ok(())
}
