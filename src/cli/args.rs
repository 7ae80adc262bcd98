//! The flags as typed. What they mean together is `plan`'s to say.

use super::{VERSION, parse};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};
use glam::DVec3;
use std::ffi::OsString;
use std::path::PathBuf;
use tison::backend::BackendKind;
use tison::film::Aov;

const EXIT_CODES: &str = "\
Exit codes:
  0  done
  1  the render failed
  2  wrong usage
  3  the scene or a file it names is at fault
  4  the output could not be written
  6  refused by a limit (memory, size)
  70 internal error
  130, 143  stopped by SIGINT or SIGTERM; what was rendered is saved";

/// Ray tracer for large meshes: Embree and a pure-Rust tracer answer the same rays
#[derive(Debug, Parser)]
#[command(
    name = "tison",
    version = VERSION.as_str(),
    after_long_help = EXIT_CODES,
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
    /// Render a mesh to an image (the same as tison FILE)
    #[command(after_long_help = EXIT_CODES, arg_required_else_help = true)]
    Render(Box<RenderArgs>),
    /// Tell what is in a file: counts, bounds, materials, what rendering it takes
    Info(InfoArgs),
    /// Read and validate a file; render nothing
    Check {
        /// Mesh (.obj) to check
        file: PathBuf,
    },
    /// Write an example; without a name, list them
    Example {
        #[command(subcommand)]
        name: Option<Example>,
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
pub struct InfoArgs {
    /// Mesh (.obj) to look at
    pub file: PathBuf,
    /// One JSON object on stdout
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub struct RenderArgs {
    /// Mesh (.obj) to render; it is framed and lit unless told otherwise
    #[arg(value_name = "FILE", required = true)]
    pub input: Option<PathBuf>,

    /// Image to write, by extension: png, exr, hdr, pfm, ppm, jpg, bmp; `-` is PNG to stdout; may be repeated
    /// [default: FILE's name with .png, in the current folder]
    #[arg(short, long, value_name = "IMAGE", help_heading = "Output")]
    pub output: Vec<PathBuf>,
    /// Auxiliary images beside the image (NAME.depth.png …), or in it for .exr
    #[arg(long, value_name = "KIND,…", value_delimiter = ',', value_parser = aov(), help_heading = "Output")]
    pub aov: Vec<Aov>,

    /// Pixels of the image
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = parse::size, help_heading = "Image")]
    pub size: (u64, u64),
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
        conflicts_with_all = ["output", "aov", "crop", "turntable", "stats"]
    )]
    pub pixel: Option<(u64, u64)>,

    /// Most reflections and refractions in a row
    #[arg(short, long, value_name = "N", default_value_t = 8, allow_negative_numbers = true, help_heading = "Quality")]
    pub recursion: u32,
    /// Samples per pixel
    #[arg(
        long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..),
        allow_negative_numbers = true, help_heading = "Quality"
    )]
    pub spp: u32,
    /// Chooses the samples: the same seed gives the same bytes
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true, help_heading = "Quality")]
    pub seed: u32,
    /// Do not trace branches that weigh less; 0 traces the whole tree
    #[arg(
        long, value_name = "W", default_value = "0.0009765625", value_parser = parse::weight,
        allow_negative_numbers = true, help_heading = "Quality"
    )]
    pub min_weight: f32,
    /// With one sample, take the exact centre of each pixel, not a point beside it
    #[arg(long, help_heading = "Quality")]
    pub centre: bool,
    /// Smooth a mesh without normals where its faces meet at less than this angle, in degrees
    #[arg(
        long, value_name = "ANGLE", value_parser = parse::angle, allow_negative_numbers = true,
        help_heading = "Quality"
    )]
    pub smooth: Option<f64>,

    /// View of a bare mesh: three-quarter, front, back, left, right, top, bottom [default: three-quarter]
    #[arg(long, value_name = "NAME", conflicts_with = "eye", help_heading = "Camera")]
    pub camera: Option<String>,
    /// Where the camera is
    #[arg(
        long, value_name = "x,y,z", value_parser = parse::vector, allow_hyphen_values = true,
        help_heading = "Camera"
    )]
    pub eye: Option<DVec3>,
    /// What it looks at [default: the middle of the mesh]
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
    /// Vertical field of view in degrees [default: 40]
    #[arg(
        long, value_name = "DEGREES", value_parser = parse::fov, allow_negative_numbers = true,
        conflicts_with = "ortho", help_heading = "Camera"
    )]
    pub fov: Option<f64>,
    /// Parallel projection of this height in the mesh's units
    #[arg(
        long, value_name = "HEIGHT", value_parser = parse::length, allow_negative_numbers = true,
        help_heading = "Camera"
    )]
    pub ortho: Option<f64>,
    /// Radius of the lens in the mesh's units; 0 is a pinhole
    #[arg(
        long, value_name = "RADIUS", value_parser = parse::radius, allow_negative_numbers = true,
        help_heading = "Camera"
    )]
    pub aperture: Option<f64>,
    /// Distance to what is sharp [default: that of the target]
    #[arg(
        long, value_name = "DISTANCE", value_parser = parse::length, allow_negative_numbers = true,
        requires = "aperture", help_heading = "Camera"
    )]
    pub focus: Option<f64>,
    /// Render N images from once around, named IMAGE-0001 and so on
    #[arg(
        long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000),
        allow_negative_numbers = true, help_heading = "Camera"
    )]
    pub turntable: Option<u32>,

    /// Who answers the rays
    #[arg(long, value_name = "NAME", value_parser = backend(), help_heading = "Running")]
    pub backend: Option<BackendKind>,
    /// Threads to work with [default: all]
    #[arg(
        short = 'j', long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024),
        allow_negative_numbers = true, help_heading = "Running"
    )]
    pub threads: Option<u16>,
    /// How to show progress, on stderr
    #[arg(long, value_enum, value_name = "HOW", default_value = "auto", help_heading = "Running")]
    pub progress: ProgressMode,
    /// No summary, warnings or progress
    #[arg(short, long, conflicts_with_all = ["verbose", "progress"], help_heading = "Running")]
    pub quiet: bool,
    /// All warnings, and more in the summary
    #[arg(short, long, help_heading = "Running")]
    pub verbose: bool,
    /// Write the summary as JSON; `-` is stdout
    #[arg(long, value_name = "FILE.json", help_heading = "Running")]
    pub stats: Option<PathBuf>,
}

/// How progress is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ProgressMode {
    /// A bar on a terminal, else plain
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

fn aov() -> impl TypedValueParser<Value = Aov> {
    PossibleValuesParser::new(Aov::ALL.map(Aov::name))
        .map(|name| Aov::ALL.into_iter().find(|a| a.name() == name).expect("only their names are possible"))
}

/// Both names are known in every binary, so that one without Embree can say so.
const BACKENDS: [BackendKind; 2] = [BackendKind::Embree, BackendKind::Native];

fn backend() -> impl TypedValueParser<Value = BackendKind> {
    PossibleValuesParser::new(BACKENDS.map(BackendKind::name))
        .map(|name| BACKENDS.into_iter().find(|b| b.name() == name).expect("only their names are possible"))
}
