//! `--backend both`: everything is rendered twice and compared.

use super::exit::Failure;
use super::style::{grouped, seconds};
use super::target::{Output, Target};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tison::backend::BackendKind;
use tison::film;
use tison::metrics::Difference;

/// Who answers the rays of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backends {
    One(BackendKind),
    /// Embree, whose picture is the picture, and native.
    Both,
}

impl Backends {
    /// All names are known in every binary, so that one without Embree can say so.
    const ALL: [Self; 3] = [Self::One(BackendKind::Embree), Self::One(BackendKind::Native), Self::Both];

    pub fn name(self) -> &'static str {
        match self {
            Self::One(kind) => kind.name(),
            Self::Both => "both",
        }
    }

    /// The first makes the picture.
    pub fn kinds(self) -> &'static [BackendKind] {
        match self {
            Self::One(BackendKind::Embree) => &[BackendKind::Embree],
            Self::One(BackendKind::Native) => &[BackendKind::Native],
            Self::Both => &[BackendKind::Embree, BackendKind::Native],
        }
    }

    pub fn parser() -> impl TypedValueParser<Value = Self> {
        PossibleValuesParser::new(Self::ALL.map(Self::name))
            .map(|name| Self::ALL.into_iter().find(|b| b.name() == name).expect("only their names are possible"))
    }

    /// Where only one can answer.
    pub fn parser_of_one() -> impl TypedValueParser<Value = BackendKind> {
        const NAMES: [BackendKind; 2] = [BackendKind::Embree, BackendKind::Native];
        PossibleValuesParser::new(NAMES.map(BackendKind::name))
            .map(|name| NAMES.into_iter().find(|b| b.name() == name).expect("only their names are possible"))
    }

    /// The one that was asked for, if this binary has it.
    pub fn chosen_one(asked: Option<BackendKind>) -> Result<BackendKind, Failure> {
        Self::chosen(asked.map(Self::One)).map(|chosen| chosen.kinds()[0])
    }

    /// What was asked for, if this binary has it.
    pub fn chosen(asked: Option<Self>) -> Result<Self, Failure> {
        let chosen = asked.unwrap_or(Self::One(BackendKind::COMPILED[0]));
        match chosen.kinds().iter().find(|kind| !BackendKind::COMPILED.contains(kind)) {
            None => Ok(chosen),
            Some(kind) => Err(Failure::usage(format!("this tison was built without the backend {}", kind.name()))
                .help("use --backend native, or install Embree and build with default features")),
        }
    }

    /// Two pictures and their difference need names.
    pub fn check_outputs(self, outputs: &[Output], pixel: bool) -> Result<(), Failure> {
        if self != Self::Both {
            return Ok(());
        }
        if pixel {
            return Err(Failure::usage("--pixel tells about one backend, but --backend both asks two")
                .help("choose one of them"));
        }
        let nameless = |o: &&Output| match &o.target {
            Target::Stdout => true,
            Target::File(path) => film::is_special_file(path),
        };
        match outputs.iter().find(nameless) {
            Some(output) => {
                let what = format!("--backend both makes several files, which do not fit on {}", output.target.name());
                Err(Failure::usage(what).help("name a file with -o"))
            }
            None => Ok(()),
        }
    }

    /// Files that go with the image at `path`, by the part of their names that says what they are.
    pub fn parts(self) -> &'static [&'static str] {
        if self == Self::Both { &["", NATIVE, DIFF] } else { &[""] }
    }
}

/// In the name of the second picture.
pub const NATIVE: &str = "native";
/// In the name of the difference.
pub const DIFF: &str = "diff";

/// `a/b.png` and `native` give `a/b.native.png`; nothing gives the path as it is.
pub fn beside(path: &Path, part: &str) -> PathBuf {
    if part.is_empty() {
        return path.to_owned();
    }
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(".");
    name.push(part);
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// What came of rendering twice, all frames together.
#[derive(Clone, Copy, Debug, Default)]
pub struct Comparison {
    /// Seconds of building and rendering, by Embree and native.
    pub build: [f64; 2],
    pub render: [f64; 2],
    /// Pixels compared, and those that differ.
    pub pixels: u64,
    pub differing: u64,
    /// Of linear values.
    pub mean_square: f64,
    pub max: f64,
    /// What the difference of the last frame is multiplied by in 8-bit images.
    pub scale: f64,
}

impl Comparison {
    pub fn add(&mut self, d: &Difference, scale: f64) {
        let pixels = d.image.color.len() as u64;
        let before = self.mean_square * self.pixels as f64;
        self.pixels += pixels;
        self.differing += d.values.differing;
        self.mean_square = (before + d.values.rmse * d.values.rmse * pixels as f64) / self.pixels.max(1) as f64;
        self.max = self.max.max(d.values.max);
        self.scale = scale;
    }

    pub fn lines(&self) -> Vec<String> {
        let times = |of: &[f64; 2]| format!("Embree {}, native {}", seconds(of[0]), seconds(of[1]));
        let mut lines = vec![format!("both      build {}; render {}", times(&self.build), times(&self.render))];
        let difference = if self.pixels == 0 {
            "not compared: stopped before both were finished".into()
        } else {
            format!(
                "{} of {} pixels differ, RMSE {:.2e}, at most {:.2e}; 8-bit differences are shown {:.3e} times as large",
                grouped(self.differing),
                grouped(self.pixels),
                self.mean_square.sqrt(),
                self.max,
                self.scale
            )
        };
        lines.push(format!("compared  {difference}"));
        lines
    }

    pub fn json(&self) -> Value {
        json!({
            "seconds": {
                "embree": { "build": self.build[0], "render": self.render[0] },
                "native": { "build": self.build[1], "render": self.render[1] },
            },
            "pixels": self.pixels,
            "differing": self.differing,
            "rmse": self.mean_square.sqrt(),
            "max": self.max,
            "scale": self.scale,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_what_goes_with_an_image() {
        assert_eq!(beside(Path::new("a/b.c.png"), NATIVE), Path::new("a/b.c.native.png"));
        assert_eq!(beside(Path::new("b.exr"), DIFF), Path::new("b.diff.exr"));
        assert_eq!(beside(Path::new("b.exr"), ""), Path::new("b.exr"));
    }
}
