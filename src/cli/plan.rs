//! What a run will do: the flags, checked together. All that can be refused without
//! reading the scene is refused here; what the scene file may say is settled by `settings`.

use super::args::{CameraArgs, PictureArgs, ProgressMode, ReadingArgs, RenderArgs};
use super::both::{self, Backends};
use super::exit::Failure;
use super::frame::Frame;
use super::settings::{SIZE, Setting, Settings};
use super::target::{Output, Target, outputs};
use super::{camera, config, turntable};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use tison::film::{self, Aov};
use tison::scene::Skips;
use tison::scene::desc::RenderDesc;
use tison::scene::format;
use tison::scene::obj::Reader;

/// A render, as it will be done.
#[derive(Debug)]
pub struct Plan {
    /// The scene or mesh.
    pub input: PathBuf,
    /// Which of the two it is.
    pub kind: Input,
    /// Crease angle in degrees.
    pub smooth: Option<f64>,
    /// Keys of the scene file set by `-D`.
    pub defines: Vec<String>,
    /// Folders that the file may name others in.
    pub allow: Vec<PathBuf>,
    /// What of the picture is given.
    pub picture: PictureArgs,
    /// What of the camera is given.
    pub camera: CameraArgs,
    /// Auxiliary images, each once.
    pub aovs: Vec<Aov>,
    /// What is left out where nothing needs it.
    pub skips: Skips,
    /// Who reads meshes.
    pub reader: Reader,
    /// Who answers the rays.
    pub backend: Backends,
    /// Threads to work with.
    pub threads: usize,
    /// Bytes that the process may hold.
    pub max_memory: Option<u64>,
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
    /// A warning is an error.
    pub strict: bool,
    /// Print the settings, render nothing.
    pub print_config: bool,
    /// The flags above, with who says so.
    pub list: Vec<Setting>,
}

/// What kind of file is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// A bare mesh, to be framed and lit.
    Mesh,
    /// A scene file, which says all that itself.
    Scene,
}

impl Input {
    /// By the end of the file's name.
    pub fn of(path: &Path) -> Self {
        if format::Format::of(path).is_some() { Self::Scene } else { Self::Mesh }
    }

    /// Refuses to set keys of a mesh, and to allow what is no folder.
    pub fn check_reading(self, reading: &ReadingArgs, path: &Path) -> Result<(), Failure> {
        if self == Self::Mesh && !reading.define.is_empty() {
            let what = format!("-D sets keys of a scene file, and {} is none", path.display());
            return Err(Failure::usage(what).help("use the flags of tison render --help for a mesh"));
        }
        match reading.allow_path.iter().find(|dir| !dir.is_dir()) {
            Some(dir) => Err(Failure::usage(format!("--allow-path {}: there is no such folder", dir.display()))),
            None => Ok(()),
        }
    }
}

const ANOTHER_NAME: &str = "name another file with -o, or with --stats";

impl Plan {
    /// Checks the flags together.
    pub fn new(args: &RenderArgs) -> Result<Self, Failure> {
        let input = args.input.clone().ok_or_else(|| Failure::usage("no file to render was given"))?;
        let kind = Input::of(&input);
        kind.check_reading(&args.reading, &input)?;
        let outputs = outputs(args, &input)?;
        let stats = args.stats.clone().map(Target::of);
        if stats == Some(Target::Stdout) && outputs.iter().any(|o| o.target == Target::Stdout) {
            return Err(Failure::usage("the image and the figures cannot both go to stdout")
                .help("name a file for one of them: -o IMAGE.png or --stats FILE.json"));
        }
        let mut plan = Self {
            kind,
            smooth: args.smooth,
            defines: args.reading.define.clone(),
            allow: args.reading.allow_path.clone(),
            reader: args.reading.obj_reader,
            picture: args.picture.clone(),
            camera: args.camera.clone(),
            aovs: each_once(&args.aov),
            skips: args.no_skip.iter().fold(Skips::ALL, |all, &one| all.and(one)),
            threads: args.threads.map_or_else(all_threads, usize::from),
            max_memory: args.max_memory,
            progress: if args.quiet { ProgressMode::None } else { args.progress },
            quiet: args.quiet,
            verbose: args.verbose,
            strict: args.strict,
            print_config: args.print_config,
            backend: Backends::chosen(args.backend)?,
            input,
            outputs,
            stats,
            list: Vec::new(),
        };
        plan.list = config::of_run(args, &plan);
        plan.backend.check_outputs(&plan.outputs, plan.picture.pixel.is_some())?;
        plan.refuse_overwriting()?;
        plan.refuse_what_no_scene_can_mend()?;
        Ok(plan)
    }

    /// The image, if its size is known before the file is read.
    pub fn known_frame(&self) -> Result<Option<Frame>, Failure> {
        let size = match self.kind {
            Input::Mesh => Some(self.picture.size.unwrap_or(SIZE)),
            Input::Scene => self.picture.size,
        };
        size.map(|size| Frame::new(&self.picture, size)).transpose()
    }

    fn refuse_what_no_scene_can_mend(&self) -> Result<(), Failure> {
        self.known_frame()?;
        if self.kind == Input::Mesh {
            Settings::new(self, &RenderDesc::default())?;
            camera::view(&self.camera)?;
            camera::check_focus(&self.camera, 0.0)?;
        }
        Ok(())
    }

    /// Every file that the run will write, of the first frame at least.
    pub fn files(&self) -> Vec<PathBuf> {
        let images = self.outputs.iter().filter_map(|o| match &o.target {
            Target::File(path) => {
                let path = self.camera.turntable.map_or_else(|| path.clone(), |_| turntable::frame_path(path, 0));
                let parts = self.backend.parts().iter().flat_map(move |&part| {
                    let aovs = if part == both::DIFF { &[] } else { &self.aovs[..] };
                    film::files(&both::beside(&path, part), o.format, aovs)
                });
                Some(parts.collect::<Vec<_>>())
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

    /// What was read for the scene stays as it is too.
    pub fn check_read(&self, read: &[PathBuf]) -> Result<(), Failure> {
        let written = self.files();
        match written.iter().find(|file| read.iter().any(|r| same_file(file, r))) {
            Some(file) => {
                let what = format!("{} is read for the scene: it would be overwritten", file.display());
                Err(Failure::usage(what).help(ANOTHER_NAME))
            }
            None => Ok(()),
        }
    }

    /// The input stays as it is, and no file is written twice.
    fn refuse_overwriting(&self) -> Result<(), Failure> {
        let files = self.files();
        for (i, file) in files.iter().enumerate() {
            if same_file(file, &self.input) {
                let what = format!("{} is the input: it would be overwritten", file.display());
                return Err(Failure::usage(what).help(ANOTHER_NAME));
            }
            if files[..i].iter().any(|f| f == file || (same_file(f, file) && !film::is_special_file(f))) {
                return Err(Failure::usage(format!("{} would be written twice", file.display())));
            }
        }
        Ok(())
    }
}

pub fn all_threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn each_once(aovs: &[Aov]) -> Vec<Aov> {
    let mut once = Vec::new();
    for aov in aovs {
        if !once.contains(aov) {
            once.push(*aov);
        }
    }
    once
}

/// Whether both names lead to one file that exists.
pub fn same_file(a: &Path, b: &Path) -> bool {
    match (fs::metadata(a), fs::metadata(b)) {
        (Ok(a), Ok(b)) => a.dev() == b.dev() && a.ino() == b.ino(),
        _ => false,
    }
}

#[cfg(test)]
pub mod tests;
