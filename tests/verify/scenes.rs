//! Embree and native over every scene of the project.

use super::{GO_ON, assert_explained, few, load};
use std::path::{Path, PathBuf};
use tison::backend::{AnyBackend, BackendKind, BuildOptions};
use tison::verify::run;

/// Files with one of these extensions, largest scenes left out: tests of a scene take a second at most.
fn files(folder: &str, extensions: &[&str]) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let entries = std::fs::read_dir(folder).expect("a folder of the project");
    let mut files: Vec<_> = entries.map(|e| e.expect("it can be listed").path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| extensions.iter().any(|x| e == *x)));
    files.sort();
    files
}

fn agree(path: &Path, quick: bool) {
    let (scene, camera) = load(path);
    let build = |kind| {
        let rays_expected = if quick { 0 } else { u64::MAX };
        let options = BuildOptions { threads: 1, rays_expected, ..BuildOptions::new(&GO_ON) };
        AnyBackend::build(kind, &scene, &options).expect("a good scene")
    };
    let (AnyBackend::Embree(embree), AnyBackend::Native(native)) =
        (build(BackendKind::Embree), build(BackendKind::Native))
    else {
        unreachable!("they are of the kinds that were asked for")
    };
    let report = run(&scene, &camera, (&embree, &native), &few(11)).expect("a good camera");
    assert_explained(&report, &scene, &path.display().to_string());
    assert!(report.total().hits > 1000, "{}: hardly anything is hit", path.display());
}

#[test]
fn backends_agree_over_every_scene() {
    let scenes = files("scenes", &["toml", "json", "ray", "obj"]);
    assert!(scenes.len() > 30, "{} scenes", scenes.len());
    scenes.iter().for_each(|path| agree(path, false));
}

#[test]
fn backends_agree_over_every_model_and_with_quick_hierarchies() {
    let models = files("scenes/models", &["obj"]);
    assert!(models.len() > 5, "{} models", models.len());
    models.iter().for_each(|path| agree(path, true));
}
