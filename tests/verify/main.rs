//! The comparison of backends: what it finds in backends that lie, and that it finds nothing where there is nothing.

#[cfg(feature = "embree")]
mod isa;
mod lies;
mod readers;
#[cfg(feature = "embree")]
mod scenes;

use glam::DVec3;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tison::backend::native::{BuildOptions, Native, Quality};
use tison::scene::{self, CameraDesc, CameraOverrides, LoadOptions, Scene, View};
use tison::verify::Options;

static GO_ON: AtomicBool = AtomicBool::new(false);

/// A scene of the project, and what looks at it.
fn load(path: &Path) -> (Scene, CameraDesc) {
    let options = LoadOptions::new(&GO_ON);
    let mut loaded = scene::load(path, &options).unwrap_or_else(|e| panic!("{e}"));
    let framed =
        || loaded.scene.auto_camera(View::default(), &CameraOverrides::default(), 1.5).expect("there is a view");
    let camera = loaded.cameras.first().map_or_else(framed, |named| named.camera);
    if loaded.scene.lights.is_empty() {
        loaded.scene.light_from(&camera);
    }
    (loaded.scene, camera)
}

fn of_project(name: &str) -> (Scene, CameraDesc) {
    load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name))
}

fn native(scene: &Scene) -> Arc<Native> {
    let options = BuildOptions { quality: Quality::Good, cancel: &GO_ON, memory_limit: None };
    Arc::new(Native::build(&scene.objects, &options).expect("a good scene"))
}

fn few(seed: u32) -> Options<'static> {
    Options { size: (48, 32), aimed: 1500, seed, cancel: &GO_ON, progress: None }
}

/// Rays of every kind through both; nothing but what rounding explains.
#[track_caller]
fn assert_explained(report: &tison::verify::Report, scene: &Scene, name: &str) {
    let unexplained = report.unexplained();
    let worst: Vec<_> =
        report.worst[3..].iter().flatten().map(|c| format!("{c:?}\n{}", c.probe_line(&scene.frame))).collect();
    assert_eq!(unexplained, 0, "{name}: {}", worst.join("\n"));
}

#[test]
fn probe_lines_are_in_the_coordinates_of_the_file() {
    let (scene, camera) = of_project("instances.toml");
    let backend = native(&scene);
    let blind = lies::Liar { honest: Arc::clone(&backend), lie: lies::Lie::Blind };
    let report = tison::verify::run(&scene, &camera, (&blind, &*backend), &few(1)).expect("a good camera");
    let case = report.worst[5].first().expect("it misses everything");
    let line: serde_json::Value = serde_json::from_str(&case.probe_line(&scene.frame)).expect("a line of JSON");
    let vector = |key: &str| DVec3::from_array(std::array::from_fn(|i| line[key][i].as_f64().expect("a number")));
    assert_eq!(scene.frame.to_local(vector("o")).as_vec3(), case.ray.o);
    assert_eq!((vector("d") * scene.frame.local_per_world()).as_vec3(), case.ray.d);
    assert_eq!(line["tmin"].as_f64(), Some(f64::from(case.ray.t_near)));
    assert_eq!(line.get("tmax").is_some(), case.ray.t_far.is_finite());
}
