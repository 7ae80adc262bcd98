//! The flags as typed. What they mean together is `plan`'s to say.

use super::both::Backends;
use super::probe::ProbeArgs;
use super::{VERSION, parse};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};
use glam::DVec3;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;
use tison::film::{Aov, Tonemap};
use tison::math::{Filter, Sampler};
use tison::scene::desc::LensSampler;
use tison::scene::obj::Reader;
use tison::scene::{Skip, Skips};

/// What the whole help ends with.
const AFTER_HELP: &str = "\
A flag wins over the scene file, keys set by -D included, and the file over the default. Flags about the camera
change parts of the scene's own; its clipping distances stay, and so does the shape of a pixel when --size has
another shape than the scene's. --print-config shows what comes out.

Exit codes:
  0  done
  1  the render failed
  2  wrong usage
  3  the scene or a file it names is at fault
  4  the output could not be written
  5  a comparison found a difference (tison verify, tison compare)
  6  refused by a limit (memory, size)
  70 internal error
  130, 143  stopped by SIGINT or SIGTERM; what was rendered is saved";

/// Ray tracer for scenes and large meshes: Embree and a pure-Rust tracer answer the same rays
#[derive(Debug, Parser)]
#[command(
    name = "tison",
    version = VERSION.as_str(),
    after_long_help = AFTER_HELP,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    arg_required_else_help = true,
    disable_help_subcommand = true,
    max_term_width = 110
)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Option<Command>,
    #[command(flatten)]
    pub render: RenderArgs,
}

impl Cli {
    /// The command line of this process, or help, or what is wrong with it.
    pub fn from_words(words: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> Result<Self, clap::Error> {
        Self::try_parse_from(words).map_err(|e| match (e.kind(), e.get(ContextKind::InvalidSubcommand)) {
            // clap takes a second file for a subcommand in the wrong place.
            (ErrorKind::ArgumentConflict, Some(ContextValue::String(word))) => Self::command().error(
                ErrorKind::UnknownArgument,
                format!("unexpected argument '{word}': one file is rendered at a time, and commands come first"),
            ),
            _ => e,
        })
    }
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene or mesh to an image (the same as tison FILE)
    #[command(after_long_help = AFTER_HELP, arg_required_else_help = true)]
    Render(Box<RenderArgs>),
    /// Tell what is in a file: counts, bounds, materials, what rendering it takes
    Info(InfoArgs),
    /// Read and validate a file; render nothing
    Check(CheckArgs),
    /// Send the same rays through both backends and read meshes with both readers, and compare
    #[command(after_long_help = super::verify::AFTER_HELP)]
    Verify(super::verify::VerifyArgs),
    /// Tell how far two pictures are apart: RMSE, PSNR, SSIM, FLIP and more, and a picture of it
    #[command(after_long_help = super::compare::AFTER_HELP)]
    Compare(super::compare::CompareArgs),
    /// Answer single rays exactly: rays on stdin, hits on stdout
    Probe(ProbeArgs),
    /// Write an example; without a name, list them
    Example {
        #[command(subcommand)]
        name: Option<Example>,
    },
    /// Measure how right and how fast the tracer is
    Bench {
        #[command(subcommand)]
        what: super::bench::Bench,
    },
    /// Write completions for a shell to stdout
    Completions {
        /// Shell to write for
        shell: clap_complete::Shell,
    },
    /// Write the manual page to stdout
    Man,
}

#[derive(Debug, Subcommand)]
pub enum Example {
    /// A first scene file with comments: a ball, a box, a cylinder, a floor, a lens and lights
    Scene {
        /// Where to write it [default: stdout]
        #[arg(short, long, value_name = "FILE.toml")]
        output: Option<PathBuf>,
    },
    /// A closed, displaced sphere of radius about 1 with normals, as large as you like
    Mesh {
        /// Triangles; the nearest number that such a mesh can have is taken
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), allow_negative_numbers = true)]
        triangles: u64,
        /// Where to write it
        #[arg(short, long, value_name = "FILE.obj")]
        output: PathBuf,
    },
}

#[derive(Args, Debug)]
pub struct CheckArgs {
    /// Scene (.toml, .json, .ray) or mesh (.obj, .ply) to check
    pub file: PathBuf,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// Take warnings for errors
    #[arg(long)]
    pub strict: bool,
}

#[derive(Args, Debug)]
pub struct InfoArgs {
    /// Scene (.toml, .json, .ray) or mesh (.obj, .ply) to look at
    pub file: PathBuf,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// One JSON object on stdout
    #[arg(long)]
    pub json: bool,
}

/// How a file is read.
#[derive(Args, Clone, Debug, Default)]
pub struct ReadingArgs {
    /// Set a key of the scene file, like render.samples=4 or object.ball.radius=2; may be repeated
    #[arg(short = 'D', long = "define", value_name = "KEY=VALUE", value_parser = parse::define, help_heading = "Scene")]
    pub define: Vec<String>,
    /// A folder that the scene may name files in, besides its own; may be repeated
    #[arg(long, value_name = "DIR", help_heading = "Scene")]
    pub allow_path: Vec<PathBuf>,
    /// Who reads OBJ meshes: tison's own reader, or the crate tobj as a second opinion
    #[arg(
        long, value_name = "NAME", value_parser = obj_reader(), default_value = Reader::Own.name(),
        help_heading = "Scene"
    )]
    pub obj_reader: Reader,
}

#[derive(Args, Debug, Default)]
pub struct RenderArgs {
    /// Scene (.toml, .json, .ray) or mesh (.obj, .ply, also .gz or .zst of these) to render; a mesh is framed and lit
    /// unless told otherwise
    #[arg(value_name = "FILE", required = true)]
    pub input: Option<PathBuf>,

    /// Image to write, by extension: png, exr, hdr, pfm, ppm, jpg, bmp; `-` is PNG to stdout; may be repeated
    /// [default: FILE's name with .png, in the current folder]
    #[arg(short, long, value_name = "IMAGE", help_heading = "Output")]
    pub output: Vec<PathBuf>,
    /// Auxiliary images beside the image (NAME.depth.png …), or in it for .exr
    #[arg(long, value_name = "KIND,…", value_delimiter = ',', value_parser = aov(), help_heading = "Output")]
    pub aov: Vec<Aov>,

    #[command(flatten)]
    pub picture: PictureArgs,
    #[command(flatten)]
    pub camera: CameraArgs,

    #[command(flatten)]
    pub reading: ReadingArgs,
    /// Smooth a mesh without normals where its faces meet at less than this angle, in degrees
    #[arg(
        long, value_name = "ANGLE", value_parser = parse::angle, allow_negative_numbers = true,
        help_heading = "Scene"
    )]
    pub smooth: Option<f64>,

    /// Who answers the rays; `both` renders twice and writes IMAGE.native and IMAGE.diff too, the absolute
    /// difference (in 8-bit formats as bright as it can be)
    #[arg(long, value_name = "NAME", value_parser = Backends::parser(), help_heading = "Running")]
    pub backend: Option<Backends>,
    /// Threads to work with [default: all]
    #[arg(
        short = 'j', long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024),
        allow_negative_numbers = true, help_heading = "Running"
    )]
    pub threads: Option<u16>,
    /// Memory that the process may hold (RSS: program, scene, hierarchy, image), like 512M, 1.5GiB, 800MB; what needs
    /// more is refused before it starts, or stopped, with exit code 6 and nothing written
    #[arg(long, value_name = "SIZE", value_parser = parse::memory, allow_hyphen_values = true, help_heading = "Running")]
    pub max_memory: Option<u64>,
    /// How to show progress, on stderr
    #[arg(long, value_enum, value_name = "HOW", default_value = "auto", help_heading = "Running")]
    pub progress: ProgressMode,
    /// No summary, warnings or progress
    #[arg(short, long, conflicts_with_all = ["verbose", "progress"], help_heading = "Running")]
    pub quiet: bool,
    /// All warnings, and more in the summary
    #[arg(short, long, help_heading = "Running")]
    pub verbose: bool,
    /// Take warnings for errors: after one nothing is rendered
    #[arg(long, help_heading = "Running")]
    pub strict: bool,
    /// Write the summary as JSON; `-` is stdout
    #[arg(long, value_name = "FILE.json", help_heading = "Running")]
    pub stats: Option<PathBuf>,
    /// Print what decides the picture, and whether a flag, the scene file or a default says so; render nothing
    #[arg(long, conflicts_with_all = ["pixel", "stats"], help_heading = "Running")]
    pub print_config: bool,
    /// Do what the scene does not need too, to see what leaving it out changes and saves; may be repeated
    #[arg(long, value_name = "NAME", value_parser = skip(), hide = true, help_heading = "Running")]
    pub no_skip: Vec<Skips>,
}

/// What decides the pixels, but for the camera. What is not given here the scene file may say;
/// what neither says has a default.
#[derive(Args, Clone, Debug, Default)]
pub struct PictureArgs {
    /// Curve from light to the bytes of 8-bit images; `stretch` is the range of the image onto 0 to 255,
    /// without sRGB [default: none; stretch for .ray]
    #[arg(long, value_name = "CURVE", value_parser = tonemap(), help_heading = "Output")]
    pub tonemap: Option<Tonemap>,
    /// Multiply the light in 8-bit images by two to this power
    #[arg(
        long, value_name = "EV", value_parser = parse::exposure, allow_negative_numbers = true,
        help_heading = "Output"
    )]
    pub exposure: Option<f32>,

    /// Pixels of the image [default: 1280x720]
    #[arg(long, value_name = "WxH", value_parser = parse::size, help_heading = "Image")]
    pub size: Option<(u64, u64)>,
    /// Enlarge or shrink the size
    #[arg(long, value_name = "P%", value_parser = parse::scale, allow_hyphen_values = true, help_heading = "Image")]
    pub scale: Option<f64>,
    /// Render this part only: pixels, or shares from 0 to 1 if there is a dot
    #[arg(
        long, value_name = "x0,y0,x1,y1", value_parser = parse::region, allow_hyphen_values = true,
        help_heading = "Image"
    )]
    pub crop: Option<parse::Region>,
    /// Trace one pixel and print its ray tree; no image
    #[arg(
        long, value_name = "x,y", value_parser = parse::pixel, allow_hyphen_values = true, help_heading = "Image",
        conflicts_with_all = ["output", "aov", "crop", "turntable", "stats", "tonemap", "exposure"]
    )]
    pub pixel: Option<(u64, u64)>,

    /// Most reflections and refractions in a row, up to 100000 [default: 8]
    #[arg(
        short, long, value_name = "N", value_parser = clap::value_parser!(u32).range(..=100_000),
        allow_negative_numbers = true, help_heading = "Quality"
    )]
    pub recursion: Option<u32>,
    /// Samples per pixel; the most that a pixel gets with --adaptive, --target-error or --time-limit
    /// [default: 1 for a mesh, 16 for a scene; with the latter two as many as it takes]
    #[arg(
        long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true,
        help_heading = "Quality"
    )]
    pub spp: Option<u32>,
    /// Stop sampling pixels whose standard error is below this share of the root of their light, each at its time
    /// [0.01 if no share is given]
    #[arg(
        long, value_name = "SHARE", value_parser = parse::share, num_args = 0..=1, require_equals = true,
        default_missing_value = "0.01", conflicts_with = "target_error", help_heading = "Quality"
    )]
    pub adaptive: Option<f64>,
    /// Sample until the image's root mean square error is estimated to be below this, in linear light, where it pays
    /// most
    #[arg(long, value_name = "RMSE", value_parser = parse::error, allow_negative_numbers = true, help_heading = "Quality")]
    pub target_error: Option<f64>,
    /// Stop rendering after this time, once every pixel has a sample; until then sample where it pays most
    #[arg(long, value_name = "SECONDS", value_parser = parse::seconds, allow_negative_numbers = true, help_heading = "Quality")]
    pub time_limit: Option<Duration>,
    /// Do not estimate the error of sampling, which takes up to 1/4 more samples in small images and 1/64 in large ones
    #[arg(long, conflicts_with_all = ["adaptive", "target_error", "time_limit"], help_heading = "Quality")]
    pub no_error_estimate: bool,
    /// Chooses the samples: the same seed gives the same bytes [default: 0]
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Quality")]
    pub seed: Option<u32>,
    /// Do not trace branches that weigh less, nor, after a bounce, shadows of lights that add less than a sixteenth of it; 0
    /// traces the whole tree [default: 1/1024; 0 for .ray]
    #[arg(
        long, value_name = "W", value_parser = parse::weight, allow_negative_numbers = true,
        help_heading = "Quality"
    )]
    pub min_weight: Option<f32>,
    /// Shadow rays for each hit and each light that has a radius [default: 1; the scene's samples for .ray]
    #[arg(
        long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65_536),
        allow_negative_numbers = true, help_heading = "Quality"
    )]
    pub light_samples: Option<u32>,
    /// Where the samples of a pixel lie and what they count; mitchell has negative lobes, which sharpen and add noise
    /// [default: blackman-harris; box for .ray and for scenes that set jitter_radius]
    #[arg(long, value_name = "NAME", value_parser = filter(), help_heading = "Quality")]
    pub filter: Option<Filter>,
    /// How samples are drawn: sobol spreads pixel, lens and lights together; random takes each by chance; stratified
    /// takes one from each of as many cells [default: sobol]
    #[arg(long, value_name = "NAME", value_parser = sampler(), help_heading = "Quality")]
    pub sampler: Option<Sampler>,
    /// How points of the lens are drawn; polar-uniform-radius is the biased sampler of the 2011 report, which
    /// takes too many in the middle [default: concentric]
    #[arg(long, value_name = "NAME", value_parser = lens_sampler(), help_heading = "Quality")]
    pub lens_sampler: Option<LensSampler>,
    /// With one sample, take the exact centre of each pixel, not a point beside it
    #[arg(long, help_heading = "Quality")]
    pub centre: bool,
}

impl PictureArgs {
    /// Whether pixels may get different numbers of samples.
    pub fn is_adaptive(&self) -> bool {
        self.adaptive.is_some() || self.stops_by_itself()
    }

    /// Whether the number of samples is to be found, not given.
    pub fn stops_by_itself(&self) -> bool {
        self.target_error.is_some() || self.time_limit.is_some()
    }
}

/// What of the camera is given. The rest is as the scene file has it, or chosen.
#[derive(Args, Clone, Debug, Default)]
pub struct CameraArgs {
    /// Camera of the scene file [default: its first]; without one, or for a mesh, a view: three-quarter,
    /// front, back, left, right, top, bottom [default: three-quarter]
    #[arg(long = "camera", value_name = "NAME", help_heading = "Camera")]
    pub name: Option<String>,
    /// Where the camera is
    #[arg(
        long, value_name = "x,y,z", value_parser = parse::vector, allow_hyphen_values = true,
        help_heading = "Camera"
    )]
    pub eye: Option<DVec3>,
    /// What it looks at [default: the middle of the scene, if no camera says]
    #[arg(
        long, value_name = "x,y,z", value_parser = parse::vector, allow_hyphen_values = true,
        help_heading = "Camera"
    )]
    pub target: Option<DVec3>,
    /// Which way is up [default: 0,1,0]
    #[arg(
        long, value_name = "x,y,z", value_parser = parse::direction, allow_hyphen_values = true,
        help_heading = "Camera"
    )]
    pub up: Option<DVec3>,
    /// Perspective with this vertical field of view in degrees [default: 40]
    #[arg(
        long, value_name = "DEGREES", value_parser = parse::fov, allow_negative_numbers = true,
        conflicts_with = "ortho", help_heading = "Camera"
    )]
    pub fov: Option<f64>,
    /// Parallel projection of this height in the scene's units
    #[arg(
        long, value_name = "HEIGHT", value_parser = parse::length, allow_negative_numbers = true,
        help_heading = "Camera"
    )]
    pub ortho: Option<f64>,
    /// Radius of the lens in the scene's units; 0 is a pinhole
    #[arg(
        long, value_name = "RADIUS", value_parser = parse::radius, allow_negative_numbers = true,
        help_heading = "Camera"
    )]
    pub aperture: Option<f64>,
    /// Distance to what is sharp [default: that of the target]
    #[arg(
        long, value_name = "DISTANCE", value_parser = parse::length, allow_negative_numbers = true,
        help_heading = "Camera"
    )]
    pub focus: Option<f64>,
    /// Render N images from once around, named IMAGE-0001 and so on
    #[arg(
        long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000),
        allow_negative_numbers = true, help_heading = "Camera"
    )]
    pub turntable: Option<u32>,
}

/// How progress is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ProgressMode {
    /// A bar on a terminal, else plain
    #[default]
    Auto,
    /// One line that is drawn over
    Bar,
    /// A line every 10 seconds
    Plain,
    /// A JSON object per line, twice a second
    Json,
    /// Nothing
    None,
}

/// What remains switched on.
fn skip() -> impl TypedValueParser<Value = Skips> {
    PossibleValuesParser::new(Skip::ALL.iter().map(|skip| skip.name()).chain(["all"]))
        .map(|name| Skip::parse(&name).map_or(Skips::NONE, |skip| Skips::ALL.without(skip)))
}

fn aov() -> impl TypedValueParser<Value = Aov> {
    PossibleValuesParser::new(Aov::ALL.map(Aov::name))
        .map(|name| Aov::ALL.into_iter().find(|a| a.name() == name).expect("only their names are possible"))
}

fn tonemap() -> impl TypedValueParser<Value = Tonemap> {
    PossibleValuesParser::new(Tonemap::ALL.map(Tonemap::name))
        .map(|name| Tonemap::ALL.into_iter().find(|t| t.name() == name).expect("only their names are possible"))
}

fn obj_reader() -> impl TypedValueParser<Value = Reader> {
    PossibleValuesParser::new(Reader::ALL.map(Reader::name))
        .map(|name| Reader::ALL.into_iter().find(|r| r.name() == name).expect("only their names are possible"))
}

fn filter() -> impl TypedValueParser<Value = Filter> {
    PossibleValuesParser::new(Filter::ALL.map(Filter::name))
        .map(|name| Filter::ALL.into_iter().find(|f| f.name() == name).expect("only their names are possible"))
}

fn sampler() -> impl TypedValueParser<Value = Sampler> {
    PossibleValuesParser::new(Sampler::ALL.map(Sampler::name))
        .map(|name| Sampler::ALL.into_iter().find(|s| s.name() == name).expect("only their names are possible"))
}

fn lens_sampler() -> impl TypedValueParser<Value = LensSampler> {
    PossibleValuesParser::new(LensSampler::ALL.map(LensSampler::name))
        .map(|name| LensSampler::ALL.into_iter().find(|s| s.name() == name).expect("only their names are possible"))
}
