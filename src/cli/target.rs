//! Where the image goes, and in which format.

use super::args::RenderArgs;
use super::exit::Failure;
use super::message::nearest;
use std::path::{Path, PathBuf};
use tison::film::{self, Format};
use tison::scene::unpacked_name;

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

impl Target {
    pub fn of(path: PathBuf) -> Self {
        if path.as_os_str() == "-" { Self::Stdout } else { Self::File(path) }
    }

    pub fn name(&self) -> String {
        match self {
            Self::Stdout => "stdout".into(),
            Self::File(path) => path.display().to_string(),
        }
    }
}

/// The images that the flags ask for; one named after the input if they name none.
pub fn outputs(args: &RenderArgs, input: &Path) -> Result<Vec<Output>, Failure> {
    if args.picture.pixel.is_some() {
        return Ok(Vec::new());
    }
    let named: Vec<PathBuf> = if args.output.is_empty() {
        let unpacked = unpacked_name(input);
        let stem = unpacked.file_stem().ok_or_else(|| {
            Failure::usage(format!("{} names no file", input.display()))
                .help("name a scene like scene.toml or a mesh like model.obj or model.ply")
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
    let curve = if args.picture.tonemap.is_some() { "--tonemap" } else { "--exposure" };
    let shown = args.picture.tonemap.is_some() || args.picture.exposure.is_some();
    if shown && outputs.iter().all(|o| o.format.is_linear()) {
        let what = format!("{curve} is for 8-bit formats, but {} holds light as it is", outputs[0].target.name());
        return Err(Failure::usage(what).help("leave it out, or write a .png too with another -o"));
    }
    Ok(outputs)
}

/// A file or stdout, with the format that its extension stands for.
pub fn output(path: PathBuf) -> Result<Output, Failure> {
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
        let turntable = args.camera.turntable.is_some();
        let several = if turntable { "--turntable" } else { "--aov" };
        if turntable || !args.aov.is_empty() {
            return Err(Failure::usage(format!("{several} makes several files, which do not fit on stdout"))
                .help("name a file with -o"));
        }
    }
    Ok(())
}
