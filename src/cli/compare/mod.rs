//! `compare`: two pictures, in figures and as a picture.

mod json;
mod text;

use super::exit::{Exit, Failure};
use super::message::{Messages, nearest_input};
use super::plan::same_file;
use super::signals::Signals;
use super::style::{bytes, counted, figure, grouped};
use super::target::{self, Output, Target};
use super::{frame, output, parse};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tison::film::{self, Display, Encoding, Notes, Picture, ReadError};
use tison::metrics::{self, Map, PIXELS_PER_DEGREE, Report};
use tison::render::Control;

/// What the help ends with.
pub const AFTER_HELP: &str = "\
EXR, HDR and PFM are compared as linear light; PNG, JPEG, BMP and PPM as sRGB from 0 to 255; one of each as sRGB.
docs/compare.md has the formulas.

Exit codes: 0 done, 3 a picture cannot be read or the sizes differ, 5 farther apart than --max-rmse or --max-flip
allows; the others as for tison render.";

#[derive(Args, Debug)]
pub struct CompareArgs {
    /// Picture to judge: png, jpg, bmp, ppm, exr, hdr or pfm, known by its content
    #[arg(value_name = "A")]
    pub a: PathBuf,
    /// Picture to judge it by
    #[arg(value_name = "B")]
    pub b: PathBuf,
    /// Compare this part only: pixels, or shares from 0 to 1 if there is a dot
    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = parse::region, allow_hyphen_values = true)]
    pub crop: Option<parse::Region>,
    /// Layer of EXR files, like albedo or normal [default: the colours]
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
    /// Pixels to a degree of the eye's field, for FLIP
    #[arg(
        long, value_name = "N", default_value_t = PIXELS_PER_DEGREE, value_parser = parse::pixels_per_degree,
        allow_negative_numbers = true
    )]
    pub ppd: f64,
    /// Write a picture of the difference; .exr, .hdr and .pfm get the numbers themselves
    #[arg(long, value_name = "OUT.png")]
    pub diff: Option<PathBuf>,
    /// What that picture shows
    #[arg(long, value_enum, value_name = "WHAT", default_value = "flip", requires = "diff")]
    pub diff_of: DiffOf,
    /// Exit with 5 if the RMSE is more than this: of linear light, or of 255
    #[arg(long, value_name = "X", value_parser = parse::bound, allow_negative_numbers = true)]
    pub max_rmse: Option<f64>,
    /// Exit with 5 if the mean FLIP is more than this
    #[arg(long, value_name = "X", value_parser = parse::bound, allow_negative_numbers = true)]
    pub max_flip: Option<f64>,
    /// Threads to work with [default: all]
    #[arg(
        short = 'j', long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024),
        allow_negative_numbers = true
    )]
    pub threads: Option<u16>,
    /// One JSON object on stdout instead of the table, or in FILE beside it
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true, default_missing_value = "-")]
    pub json: Option<PathBuf>,
}

/// What a difference image shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DiffOf {
    /// FLIP at each pixel, from 0 to 1
    Flip,
    /// Largest difference of each pixel's channels, from 0 to the largest of all
    Abs,
}

/// What came of it.
struct Story<'a> {
    args: &'a CompareArgs,
    size: (u32, u32),
    report: Report,
    /// What is to be known about the figures.
    notes: Vec<String>,
    /// The difference image: its file and what it shows.
    diff: Option<(PathBuf, String)>,
}

/// Compares, tells, and leaves with 5 if the pictures are too far apart.
pub fn compare(args: &CompareArgs, messages: &Messages) -> Result<Exit, Failure> {
    let diff = args.diff.clone().map(target::output).transpose()?;
    let json = args.json.clone().map(Target::of);
    check_targets(args, diff.as_ref(), json.as_ref())?;
    let control = Arc::new(Control::default());
    let signals =
        Signals::install(&control).map_err(|e| Failure::new(Exit::Internal, "cannot listen for signals").because(e))?;
    let stopped = || match signals.caught() {
        Some(exit) => Err(Failure::new(exit, "stopped")),
        None => Ok(()),
    };
    let threads = args.threads.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Failure::new(Exit::Render, format!("cannot start {threads} threads")).because(e))?;
    let mut story = pool.install(|| story(args, &stopped))?;
    stopped()?;
    if let Some(output) = &diff {
        story.diff = Some(save(output, &story, messages)?);
    }
    match &json {
        Some(Target::Stdout) => output::print(json::text(&story).as_bytes())?,
        Some(Target::File(path)) => {
            film::save(path, |out| out.write_all(json::text(&story).as_bytes()))?;
            output::print(text::of(&story).as_bytes())?
        }
        None => output::print(text::of(&story).as_bytes())?,
    };
    judge(&story)
}

fn story<'a>(args: &'a CompareArgs, stopped: &dyn Fn() -> Result<(), Failure>) -> Result<Story<'a>, Failure> {
    let [a, b] = read(args)?;
    stopped()?;
    let report = metrics::compare(&a, &b, args.ppd).map_err(|e| Failure::new(Exit::Input, e.to_string()))?;
    let notes = notes(args, [&a, &b], &report);
    Ok(Story { args, size: (a.width, a.height), report, notes, diff: None })
}

/// That all files can be written, and that none of them is one that is read.
fn check_targets(args: &CompareArgs, diff: Option<&Output>, json: Option<&Target>) -> Result<(), Failure> {
    const ANOTHER_NAME: &str = "name another file";
    let diff = diff.map(|output| &output.target);
    if diff == Some(&Target::Stdout) {
        let what = "the figures and the picture of the difference cannot both go to stdout";
        return Err(Failure::usage(what).help("name a file, like --diff difference.png"));
    }
    let file = |target: Option<&Target>| match target {
        Some(Target::File(path)) => Some(path.clone()),
        _ => None,
    };
    let files: Vec<PathBuf> = [file(diff), file(json)].into_iter().flatten().collect();
    for path in &files {
        if [&args.a, &args.b].into_iter().any(|input| same_file(path, input)) {
            let what = format!("{} is compared: it would be overwritten", path.display());
            return Err(Failure::usage(what).help(ANOTHER_NAME));
        }
    }
    if let [first, second] = &files[..]
        && (first == second || (same_file(first, second) && !film::is_special_file(first)))
    {
        return Err(Failure::usage(format!("{} would be written twice", first.display())).help(ANOTHER_NAME));
    }
    files.iter().try_for_each(|path| Ok(film::check_target(path)?))
}

/// Both pictures, or the part of them that is compared.
fn read(args: &CompareArgs) -> Result<[Picture; 2], Failure> {
    let one = |path: &Path| film::read(path, args.layer.as_deref());
    let (a, b) = rayon::join(|| one(&args.a), || one(&args.b));
    let (a, b) = (a?, b?);
    let size = |p: &Picture| (p.width, p.height);
    if size(&a) != size(&b) {
        let what = format!(
            "{} has {}x{} pixels and {} has {}x{}: only pictures of the same size can be compared",
            args.a.display(),
            a.width,
            a.height,
            args.b.display(),
            b.width,
            b.height
        );
        return Err(Failure::new(Exit::Input, what));
    }
    if args.crop.is_none() {
        return Ok([a, b]);
    }
    let part = frame::crop(args.crop, size(&a))?;
    Ok([a, b].map(|picture| picture.crop((part.x0, part.y0), (part.x1, part.y1))))
}

impl From<ReadError> for Failure {
    fn from(e: ReadError) -> Self {
        let failure = Self::new(Exit::Input, e.to_string());
        match e {
            ReadError::Open { path, source } => Self { help: nearest_input(&path), ..failure.because(source) },
            _ => failure,
        }
    }
}

fn notes(args: &CompareArgs, pictures: [&Picture; 2], report: &Report) -> Vec<String> {
    let files = [&args.a, &args.b].map(|path| path.display());
    let mut notes = Vec::new();
    for (file, picture) in files.iter().zip(pictures) {
        if report.mixed && picture.encoding == Encoding::Linear {
            notes.push(format!("{file} is linear light: compared as the 8-bit sRGB picture that tison writes of it"));
        }
        if picture.transparent {
            notes.push(format!("{file} is transparent in places: compared as seen over black"));
        }
    }
    for (file, odd) in files.iter().zip(&report.values.non_finite_in) {
        if let Some((x, y)) = odd.first {
            notes.push(format!(
                "{file} is not finite in {} (NaN {}, infinite {}), first at {x},{y}: left out, but for SSIM and FLIP, \
                 which see NaN as black and infinity as white",
                counted(odd.pixels(), "pixel"),
                grouped(odd.nan),
                grouped(odd.infinite)
            ));
        }
    }
    notes
}

/// Writes the picture of the difference; returns its file and what it shows.
fn save(output: &Output, story: &Story<'_>, messages: &Messages) -> Result<(PathBuf, String), Failure> {
    let Target::File(path) = &output.target else { unreachable!("stdout was refused") };
    let (map, name): (&Map, _) = match story.args.diff_of {
        DiffOf::Flip => (&story.report.flip.map, "FLIP"),
        DiffOf::Abs => (&story.report.largest, "largest difference of a channel"),
    };
    let (film, shows) = if output.format.is_linear() {
        (map.plain(), format!("{name}, the numbers themselves"))
    } else {
        let most = figure(map.brightest);
        let scale = if map.brightest > 0.0 { figure(1.0 / map.brightest) } else { figure(1.0) };
        (map.coloured(), format!("{name}, from black at 0 to light yellow at {most} (times {scale}; colours of magma)"))
    };
    let notes = Notes {
        software: format!("tison {}", *super::VERSION),
        title: "difference".into(),
        comment: format!("{} against {}: {shows}", story.args.a.display(), story.args.b.display()),
        error: String::new(),
    };
    let size = film::save(path, |out| film::encode(&film, output.format, &Display::default(), &notes, out))?;
    messages.line(&format!("wrote     {} ({}): {shows}", path.display(), bytes(size)));
    Ok((path.clone(), shows))
}

/// Whether the pictures are as near as was asked for.
fn judge(story: &Story<'_>) -> Result<Exit, Failure> {
    let (args, report) = (story.args, &story.report);
    let bounds = [
        ("RMSE", report.values.rmse, "--max-rmse", args.max_rmse),
        ("FLIP", report.flip.mean, "--max-flip", args.max_flip),
    ];
    let mut past = Vec::new();
    for (name, value, flag, most) in bounds {
        if let Some(most) = most
            // No figure, as of no finite pixel, is past it too.
            && (value > most || value.is_nan())
        {
            past.push(format!("{name} {} is more than {flag} {}", figure(value), figure(most)));
        }
    }
    let odd = report.values.non_finite_differing;
    if odd > 0 && bounds.iter().any(|bound| bound.3.is_some()) {
        past.push(format!("NaN or infinity differs in {}, which no figure holds", counted(odd, "pixel")));
    }
    if past.is_empty() {
        return Ok(Exit::Done);
    }
    let files = [&args.a, &args.b].map(|path| path.display());
    Err(Failure::new(Exit::Differs, format!("{} is too far from {}: {}", files[0], files[1], past.join("; "))))
}
