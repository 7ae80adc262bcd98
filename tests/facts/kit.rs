//! Scenes from text, rendered by every backend.

use glam::DVec3;
use std::sync::atomic::AtomicBool;
use tison::backend::{AnyBackend, BackendKind, BuildOptions};
use tison::film::Aov;
use tison::render::{self, Control, Job, Outcome};
use tison::scene::{self, CameraDesc, LoadOptions, Loaded};

pub fn load(toml: &str) -> Loaded {
    let dir = tempfile::tempdir().expect("a folder for the scene");
    let path = dir.path().join("scene.toml");
    std::fs::write(&path, format!("tison = 1\n{toml}")).expect("a file in it");
    let cancel = AtomicBool::new(false);
    let options = LoadOptions::new(&cancel);
    scene::load(&path, &options).unwrap_or_else(|e| panic!("{e}\n{toml}"))
}

pub fn build(kind: BackendKind, loaded: &Loaded) -> AnyBackend {
    let cancel = AtomicBool::new(false);
    let options = BuildOptions { rays_expected: 1 << 40, ..BuildOptions::new(&cancel) };
    AnyBackend::build(kind, &loaded.scene, &options).expect("a good scene")
}

pub fn job(w: u32, h: u32) -> Job {
    Job::whole((w, h))
}

/// The scene's first camera renders it.
pub fn render(kind: BackendKind, loaded: &Loaded, job: &Job) -> Outcome {
    let camera = &loaded.cameras[0].camera;
    render::run(&loaded.scene, camera, &build(kind, loaded), job, &Control::default()).expect("a good camera")
}

pub fn normals(outcome: &Outcome) -> &[f32] {
    &outcome.film.aovs.iter().find(|a| a.kind == Aov::Normal).expect("it was asked for").data
}

/// A ray of a pixel as `explain_pixel` tells it.
#[derive(Clone, Debug)]
pub struct Told {
    pub what: String,
    /// Where it ends; nothing for a miss.
    pub at: Option<DVec3>,
}

/// The rays of one pixel, in the order they are told.
pub fn rays(loaded: &Loaded, camera: &CameraDesc, backend: &AnyBackend, job: &Job, pixel: (u32, u32)) -> Vec<Told> {
    let text = render::explain_pixel(&loaded.scene, camera, backend, job, pixel.0, pixel.1).expect("a good camera");
    let ray = |line: &str| {
        let (head, rest) = line.split_once(" weight ")?;
        if rest.contains(": cut") {
            return None;
        }
        let at = rest.split_once(" at ").map(|(_, rest)| {
            let numbers = rest.split_once(", distance").expect("it is told").0.split(' ');
            DVec3::from_slice(&numbers.map(|n| n.parse().expect("a number")).collect::<Vec<f64>>())
        });
        Some(Told { what: head.trim().into(), at })
    };
    text.lines().filter_map(ray).collect()
}

/// A camera at `eye` that looks along `d`.
pub fn looking(eye: DVec3, d: DVec3) -> CameraDesc {
    CameraDesc {
        eye,
        target: eye + d,
        up: d.any_orthonormal_vector(),
        projection: scene::Projection::Perspective { fov_deg: 1.0 },
        aperture: 0.0,
        focus: None,
        aspect: None,
        clip: None,
    }
}
