//! What a run will do: the flags, checked together. All that can be refused without
//! reading the scene is refused here.

use super::args::{ProgressMode, RenderArgs};
use super::exit::{Exit, Failure};
use super::limits::MAX_SIDE;
use super::message::nearest;
use super::parse::Region;
use super::turntable;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use tison::backend::BackendKind;
use tison::film::{self, Format};
use tison::render::{Crop, Job};
use tison::scene::desc::LensSampler;
use tison::scene::{CameraOverrides, Projection, View};

/// A render, as it will be done.
#[derive(Debug)]
pub struct Plan {
    /// The mesh.
    pub input: PathBuf,
    /// Crease angle in degrees.
    pub smooth: Option<f64>,
    /// The image.
    pub job: Job,
    /// Where to look from when no eye is given.
    pub view: View,
    /// What of the camera is given.
    pub camera: CameraOverrides,
    /// Images once around; none: a single image with its name as it is.
    pub turntable: Option<u32>,
    /// Who answers the rays.
    pub backend: BackendKind,
    /// Threads to work with.
    pub threads: usize,
    /// Tell about this pixel only.
    pub pixel: Option<(u32, u32)>,
    /// Where the image goes.
    pub outputs: Vec<Output>,
    /// Where the figures go.
    pub stats: Option<Target>,
    /// How progress is shown.
    pub progress: ProgressMode,
    /// Neither summary nor warnings.
    pub quiet: bool,
    /// More of both.
    pub verbose: bool,
}

/// A file or stdout.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    Stdout,
    File(PathBuf),
}

/// An image file of the run.
#[derive(Clone, Debug)]
pub struct Output {
    pub target: Target,
    pub format: Format,
}

/// Names of the views of a mesh.
const VIEWS: [(&str, View); 7] = [
    ("three-quarter", View::ThreeQuarter),
    ("front", View::Front),
    ("back", View::Back),
    ("left", View::Left),
    ("right", View::Right),
    ("top", View::Top),
    ("bottom", View::Bottom),
];

impl Plan {
    /// Checks the flags together.
    pub fn new(args: &RenderArgs) -> Result<Self, Failure> {
        let input = args.input.clone().ok_or_else(|| Failure::usage("no file to render was given"))?;
        let backend = backend(args.backend)?;
        let job = job(args)?;
        let outputs = outputs(args, &input)?;
        let stats = args.stats.clone().map(Target::of);
        if stats == Some(Target::Stdout) && outputs.iter().any(|o| o.target == Target::Stdout) {
            return Err(Failure::usage("the image and the figures cannot both go to stdout")
                .help("name a file for one of them: -o IMAGE.png or --stats FILE.json"));
        }
        let pixel = args.pixel.map(|p| inside(p, job.size)).transpose()?;
        let plan = Self {
            smooth: args.smooth,
            view: view(args.camera.as_deref())?,
            camera: camera(args),
            turntable: args.turntable,
            threads: args.threads.map_or_else(all_threads, usize::from),
            progress: if args.quiet { ProgressMode::None } else { args.progress },
            quiet: args.quiet,
            verbose: args.verbose,
            input,
            backend,
            job,
            outputs,
            stats,
            pixel,
        };
        plan.refuse_overwriting()?;
        Ok(plan)
    }

    /// Every file that the run will write, of the first frame at least.
    pub fn files(&self) -> Vec<PathBuf> {
        let images = self.outputs.iter().filter_map(|o| match &o.target {
            Target::File(path) => {
                let path = self.turntable.map_or_else(|| path.clone(), |_| turntable::frame_path(path, 0));
                Some(film::files(&path, o.format, &self.job.aovs))
            }
            Target::Stdout => None,
        });
        let stats = self.stats.iter().filter_map(|t| match t {
            Target::File(path) => Some(vec![path.clone()]),
            Target::Stdout => None,
        });
        images.chain(stats).flatten().collect()
    }

    /// Checks that every file can be written, before anything costly is done.
    pub fn check_targets(&self) -> Result<(), Failure> {
        for path in self.files() {
            film::check_target(&path)?;
        }
        Ok(())
    }

    /// The input stays as it is, and no file is written twice.
    fn refuse_overwriting(&self) -> Result<(), Failure> {
        let files = self.files();
        for (i, file) in files.iter().enumerate() {
            if same_file(file, &self.input) {
                let what = format!("{} is the input: it would be overwritten", file.display());
                return Err(Failure::usage(what).help("name another file with -o"));
            }
            if files[..i].iter().any(|f| f == file || (same_file(f, file) && !film::is_special_file(f))) {
                return Err(Failure::usage(format!("{} would be written twice", file.display())));
            }
        }
        Ok(())
    }
}

impl Target {
    fn of(path: PathBuf) -> Self {
        if path.as_os_str() == "-" { Self::Stdout } else { Self::File(path) }
    }
}

fn backend(asked: Option<BackendKind>) -> Result<BackendKind, Failure> {
    match asked {
        None => Ok(BackendKind::COMPILED[0]),
        Some(kind) if BackendKind::COMPILED.contains(&kind) => Ok(kind),
        Some(kind) => Err(Failure::usage(format!("this tison was built without the backend {}", kind.name()))
            .help("use --backend native, or install Embree and build with default features")),
    }
}

fn all_threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn job(args: &RenderArgs) -> Result<Job, Failure> {
    if args.centre && args.spp > 1 {
        return Err(Failure::usage(format!("--centre is for one sample a pixel, not for --spp {}", args.spp))
            .help("several samples are spread over the pixel in any case"));
    }
    let size = size(args)?;
    let mut aovs = args.aov.clone();
    let mut seen = Vec::new();
    aovs.retain(|a| {
        !seen.contains(a) && {
            seen.push(*a);
            true
        }
    });
    Ok(Job {
        size,
        crop: crop(args.crop, size)?,
        spp: args.spp,
        seed: args.seed,
        k_max: args.recursion,
        min_weight: args.min_weight,
        centre: args.centre,
        lens_sampler: LensSampler::default(),
        jitter_radius: 0.5,
        light_samples: 1,
        aovs,
    })
}

/// Sides beyond what any image may have are refused here, because they may not even fit a `u32`.
fn size(args: &RenderArgs) -> Result<(u32, u32), Failure> {
    /// Largest whole image, of which parts may be rendered.
    const MAX_WHOLE: f64 = 1e9;
    let scale = args.scale.unwrap_or(1.0);
    let scaled = |side: u64| (side as f64 * scale).round().max(1.0);
    let (w, h) = (scaled(args.size.0), scaled(args.size.1));
    if w > MAX_WHOLE || h > MAX_WHOLE {
        let what = format!("an image of {w}x{h} pixels is larger than tison can count");
        return Err(
            Failure::new(Exit::Limit, what).help(format!("choose a --size of at most {MAX_SIDE} pixels a side"))
        );
    }
    Ok((w as u32, h as u32))
}

fn crop(region: Option<Region>, (width, height): (u32, u32)) -> Result<Crop, Failure> {
    let whole = Crop { x0: 0, y0: 0, x1: width, y1: height };
    let sides = [width, height, width, height];
    let edges = match region {
        None => return Ok(whole),
        Some(Region::Pixels(edges)) => edges,
        // Rounded the same way on both sides, so that neighbouring parts meet without gap or overlap.
        Some(Region::Shares(shares)) => std::array::from_fn(|i| (shares[i] * f64::from(sides[i])).round() as u64),
    };
    if edges[2] > u64::from(width) || edges[3] > u64::from(height) {
        return Err(Failure::usage(format!("--crop reaches beyond the image, which has {width}x{height} pixels")));
    }
    let [x0, y0, x1, y1] = edges.map(|e| e as u32);
    if x0 >= x1 || y0 >= y1 {
        return Err(Failure::usage(format!("--crop holds no pixel of an image of {width}x{height}")));
    }
    Ok(Crop { x0, y0, x1, y1 })
}

fn inside((x, y): (u64, u64), (width, height): (u32, u32)) -> Result<(u32, u32), Failure> {
    if x < u64::from(width) && y < u64::from(height) {
        Ok((x as u32, y as u32))
    } else {
        let what = format!("pixel {x},{y} is outside the image, which has {width}x{height} pixels counted from 0");
        Err(Failure::usage(what))
    }
}

fn view(name: Option<&str>) -> Result<View, Failure> {
    let Some(name) = name else { return Ok(View::ThreeQuarter) };
    if let Some((_, view)) = VIEWS.iter().find(|(n, _)| *n == name) {
        return Ok(*view);
    }
    let names = VIEWS.map(|(n, _)| n);
    let failure = Failure::usage(format!("no camera is called '{name}': a mesh has the views {}", names.join(", ")));
    Err(match nearest(name, names) {
        Some(near) => failure.help(format!("did you mean '{near}'?")),
        None => failure,
    })
}

fn camera(args: &RenderArgs) -> CameraOverrides {
    let perspective = args.fov.map(|fov_deg| Projection::Perspective { fov_deg });
    let parallel = args.ortho.map(|height| Projection::Orthographic { height });
    CameraOverrides {
        eye: args.eye,
        target: args.target,
        up: args.up,
        projection: perspective.or(parallel),
        aperture: args.aperture,
        focus: args.focus,
    }
}

fn outputs(args: &RenderArgs, input: &Path) -> Result<Vec<Output>, Failure> {
    if args.pixel.is_some() {
        return Ok(Vec::new());
    }
    let named: Vec<PathBuf> = if args.output.is_empty() {
        let stem = input.file_stem().ok_or_else(|| {
            Failure::usage(format!("{} names no file", input.display())).help("name a mesh like model.obj")
        })?;
        let mut name = stem.to_owned();
        name.push(".png");
        vec![name.into()]
    } else {
        args.output.clone()
    };
    let outputs: Vec<Output> = named.into_iter().map(output).collect::<Result<_, _>>()?;
    for output in &outputs {
        check_output(output, args)?;
    }
    if outputs.iter().filter(|o| o.target == Target::Stdout).count() > 1 {
        return Err(Failure::usage("-o - is given twice, but there is one stdout"));
    }
    Ok(outputs)
}

fn output(path: PathBuf) -> Result<Output, Failure> {
    let format = match Format::of(&path) {
        Some(format) => format,
        // A pipe or device has no use for an extension.
        None if path.as_os_str() == "-" || film::is_special_file(&path) => Format::Png,
        // Whatever else is wrong with its name.
        None if path.is_dir() => return Err(film::SaveError::IsFolder { path }.into()),
        None => return Err(unknown_format(&path)),
    };
    Ok(Output { target: Target::of(path), format })
}

fn unknown_format(path: &Path) -> Failure {
    let known = Format::EXTENSIONS;
    let extension = path.extension().map(|e| e.to_string_lossy().into_owned());
    let what = match &extension {
        Some(e) => format!("{}: '.{e}' is no image format that tison writes", path.display()),
        None => format!("{} has no extension to tell the image format by", path.display()),
    };
    let near = extension.and_then(|e| nearest(&e, known.split(", ")).map(str::to_owned));
    Failure::usage(what).help(match near {
        Some(near) => format!("did you mean .{near}? There are {known}"),
        None => format!("use one of {known}"),
    })
}

/// What one output cannot be, given the rest.
fn check_output(output: &Output, args: &RenderArgs) -> Result<(), Failure> {
    if output.target == Target::Stdout {
        let several = if args.turntable.is_some() { "--turntable" } else { "--aov" };
        if args.turntable.is_some() || !args.aov.is_empty() {
            return Err(Failure::usage(format!("{several} makes several files, which do not fit on stdout"))
                .help("name a file with -o"));
        }
    }
    Ok(())
}

/// Whether both names lead to one file that exists.
fn same_file(a: &Path, b: &Path) -> bool {
    match (fs::metadata(a), fs::metadata(b)) {
        (Ok(a), Ok(b)) => a.dev() == b.dev() && a.ino() == b.ino(),
        _ => false,
    }
}

#[cfg(test)]
mod tests;
