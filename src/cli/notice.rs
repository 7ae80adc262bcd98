//! What is odd about a scene or about how it is to be rendered, and does not stop the run.

use super::style::Style;
use std::fmt;
use tison::scene::format::{Diagnostic, Severity};
use tison::scene::{CameraDesc, Loaded, Warning};
use tison::{render::Job, scene::desc::LensSampler};

/// One warning.
#[derive(Clone, Debug)]
pub enum Notice {
    /// About a place in the scene file.
    Scene(Diagnostic),
    /// About a file that it names, or about a bare mesh.
    File(Warning),
    /// About what is asked for.
    Run(&'static str),
}

impl Notice {
    /// What reading brought up.
    pub fn about(loaded: &Loaded) -> Vec<Self> {
        let scene = loaded.diagnostics.iter().cloned().map(Self::Scene);
        scene.chain(loaded.warnings.iter().cloned().map(Self::File)).collect()
    }

    /// What is odd about a picture of this kind.
    pub fn about_picture(job: &Job, camera: &CameraDesc) -> Option<Self> {
        let biased = job.lens_sampler == LensSampler::PolarUniformRadius && camera.aperture > 0.0;
        biased.then_some(Self::Run(
            "the picture is biased: the lens sampler polar-uniform-radius takes too many points in the middle \
             of the lens, so what is out of focus looks sharper than it is",
        ))
    }

    /// As a warning, or as the error that `--strict` makes of it.
    pub fn told(&self, strict: bool, style: Style) -> String {
        match self {
            Self::Scene(d) if strict && d.severity == Severity::Warning => {
                let mut error = d.clone();
                error.severity = Severity::Error;
                block(&error, style)
            }
            Self::Scene(d) => block(d, style),
            other if strict => format!("{} {other}", style.error("error:")),
            other => format!("{} {other}", style.warning("warning:")),
        }
    }
}

/// Several lines, set off from what comes next.
fn block(d: &Diagnostic, style: Style) -> String {
    d.render(style.look()) + "\n"
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scene(d) => d.fmt(f),
            Self::File(w) => w.fmt(f),
            Self::Run(what) => f.write_str(what),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use tison::scene::format::{self, ReadOptions};

    /// The warning about a scene without an object.
    fn empty_scene() -> Diagnostic {
        let parsed = format::parse(Path::new("a.toml"), b"tison = 1\n", &ReadOptions::default());
        parsed.unwrap().1.remove(0)
    }

    #[test]
    fn each_kind_is_a_warning_or_an_error() {
        let file = Warning::about(Path::new("a.obj"), "odd".into());
        for (notice, want) in [
            (Notice::Scene(empty_scene()), "the scene has no object\n --> a.toml:1:1"),
            (Notice::File(file), "a.obj: odd"),
            (Notice::Run("too dark"), "too dark"),
        ] {
            for (strict, severity) in [(false, "warning: "), (true, "error: ")] {
                let told = notice.told(strict, Style::of_stderr());
                assert!(told.starts_with(&format!("{severity}{want}")), "{told}");
            }
        }
    }
}
