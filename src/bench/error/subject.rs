//! A scene, ready to be rendered by everybody.

use super::{Error, Options};
use crate::backend::{AnyBackend, BackendKind};
use crate::bench::leaving;
use crate::bench::setup;
use crate::render::Job;
use crate::scene::format::Format;
use crate::scene::{self, CameraDesc, CameraOverrides, LoadOptions, Loaded, Scene, View};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Names of the scenes that come with the program, and their texts.
pub const OWN: [(&str, &str); 3] = [
    ("lens", include_str!("../../../scenes/error_lens.toml")),
    ("shadow", include_str!("../../../scenes/error_shadow.toml")),
    ("edges", include_str!("../../../scenes/error_edges.toml")),
];

/// Pixels across, where nobody says how many.
const WIDTH: u32 = 96;
/// Width and height of a picture of a scene that does not say.
const SHAPE: (u32, u32) = (16, 9);

/// A scene with its camera and its backends.
#[derive(Debug)]
pub struct Subject {
    /// Own name or file, as given.
    pub name: String,
    pub scene: Scene,
    pub camera: CameraDesc,
    /// As the command renders it but for the number of samples and the filter, a box unless the scene says otherwise:
    /// with its depth and its weight cut, one ray at each light that has a size.
    pub job: Job,
    backends: Vec<Built>,
}

/// A hierarchy and the seconds that it took.
#[derive(Debug)]
struct Built {
    kind: BackendKind,
    backend: AnyBackend,
    seconds: f64,
}

impl Subject {
    /// All that are asked for.
    pub fn all(options: &Options) -> Result<Vec<Self>, Error> {
        let own = || OWN.map(|(name, _)| PathBuf::from(name)).to_vec();
        let names = if options.scenes.is_empty() { own() } else { options.scenes.clone() };
        names.iter().map(|name| Self::new(name, options)).collect()
    }

    fn new(path: &Path, options: &Options) -> Result<Self, Error> {
        let name = path.display().to_string();
        let failed = |why| Error::Camera { name: name.clone(), why };
        let mut loaded = load(path)?;
        let size = options.size.unwrap_or_else(|| small(loaded.render.size.unwrap_or(SHAPE)));
        let camera = camera(&loaded, size).map_err(failed)?;
        camera.prepare(&loaded.scene.frame, size).map_err(failed)?;
        if own(path).is_none() && Format::of(path).is_none() {
            // A bare mesh is lit from where it is looked at.
            loaded.scene.light_from(&camera);
        }
        let said = &loaded.render;
        let whole = Job::whole(size);
        let job = Job {
            k_max: said.recursion.unwrap_or(whole.k_max),
            min_weight: said.min_weight.unwrap_or(MIN_WEIGHT),
            filter: said.filter.unwrap_or(whole.filter),
            jitter_radius: said.jitter_radius.unwrap_or(whole.jitter_radius),
            ..whole
        };
        let mut backends = Vec::new();
        for &kind in BackendKind::COMPILED {
            let start = Instant::now();
            let backend = setup::build(kind, &loaded.scene);
            let backend = backend.map_err(|source| Error::Build { name: name.clone(), source })?;
            backends.push(Built { kind, backend, seconds: start.elapsed().as_secs_f64() });
        }
        Ok(Self { name, scene: loaded.scene, camera, job, backends })
    }

    /// Pixels of a picture.
    pub fn pixels(&self) -> u64 {
        u64::from(self.job.size.0) * u64::from(self.job.size.1)
    }

    /// The backend of that kind.
    pub fn backend(&self, kind: BackendKind) -> &AnyBackend {
        &self.backends.iter().find(|b| b.kind == kind).expect("all that are compiled in were built").backend
    }

    /// Seconds that each hierarchy took, in words.
    pub fn build_seconds(&self) -> String {
        let words = |b: &Built| format!("{} {:.1} ms", b.kind.name(), 1e3 * b.seconds);
        self.backends.iter().map(words).collect::<Vec<_>>().join(", ")
    }
}

/// What the command takes where neither flags nor scene say.
const MIN_WEIGHT: f32 = 1.0 / 1024.0;

fn load(path: &Path) -> Result<Loaded, scene::Error> {
    let Some(text) = own(path) else { return leaving::load(path) };
    let cancel = AtomicBool::new(false);
    scene::load_text(&path.with_extension("toml"), text, &LoadOptions::new(&cancel))
}

/// The text of a scene that comes with the program.
fn own(name: &Path) -> Option<&'static str> {
    OWN.iter().find(|(own, _)| name.as_os_str() == *own).map(|(_, text)| *text)
}

/// A small picture of the shape of a larger one.
fn small((width, height): (u32, u32)) -> (u32, u32) {
    let rows = (f64::from(WIDTH) * f64::from(height) / f64::from(width)).round();
    (WIDTH, (rows as u32).max(1))
}

/// The scene's first, or one that frames it.
fn camera(loaded: &Loaded, size: (u32, u32)) -> Result<CameraDesc, String> {
    let shape = f64::from(size.0) / f64::from(size.1);
    let camera = match loaded.cameras.first() {
        Some(named) => {
            let camera = named.camera;
            // A pixel keeps its shape, as on the command line.
            let (w, h) = loaded.render.size.unwrap_or(size);
            let stretch = shape / (f64::from(w) / f64::from(h));
            CameraDesc { aspect: camera.aspect.map(|aspect| aspect * stretch), ..camera }
        }
        None => loaded.scene.auto_camera(View::default(), &CameraOverrides::default(), shape)?,
    };
    Ok(camera)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_scenes_are_small_and_plain_and_isolate_what_they_are_for() {
        let subjects = Subject::all(&Options::quick(vec![])).expect("they are good");
        let lens = |s: &Subject| s.camera.aperture > 0.0;
        let area = |s: &Subject| s.scene.needs().area_lights;
        let want = [("lens", true, false), ("shadow", false, true), ("edges", false, false)];
        for (s, want) in subjects.iter().zip(want) {
            assert_eq!((s.name.as_str(), lens(s), area(s)), want);
            assert_eq!(s.job.size, (96, 54));
            assert!(!s.scene.needs().secondary_rays() && s.scene.textures.is_empty(), "{}", s.name);
        }
        assert_eq!(subjects.len(), 3);
    }

    #[test]
    fn a_small_picture_has_the_shape_of_the_large_one() {
        assert_eq!(small((1280, 720)), (96, 54));
        assert_eq!(small((400, 800)), (96, 192));
        assert_eq!(small((100_000, 1)), (96, 1));
    }
}
