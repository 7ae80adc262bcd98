//! The scenes of `scenes/`, rendered small by every backend, against stored pictures.
//!
//! `TISON_BLESS=1 cargo test --test golden` accepts what is seen now; look at it first.

use image::{RgbImage, imageops};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use tison::backend::{AnyBackend, BackendKind, BuildOptions};
use tison::film::Film;
use tison::math::colour::Srgb8;
use tison::render::{self, Control, Crop, Job};
use tison::scene::{self, LoadOptions, Loaded};

/// How far a picture may be from the stored one.
#[derive(Clone, Copy, Debug)]
struct Limit {
    /// Largest difference of any channel, in steps of 255.
    worst: u8,
    /// Pixels with a channel that is off by more than one step.
    beyond_one: usize,
}

/// Another processor or backend rounds otherwise: at an edge a sample may fall on its other side.
const EDGES: Limit = Limit { worst: 64, beyond_one: 40 };
/// Paths through many curved mirrors and glasses carry a rounding far.
const BOUNCES: Limit = Limit { worst: 96, beyond_one: 200 };

macro_rules! pictures {
    ($($name:ident: $file:literal, $limit:expr;)*) => {
        $(#[test]
        fn $name() {
            check($file, $limit);
        })*

        /// Scenes that have a picture.
        const PICTURES: &[&str] = &[$($file),*];
    };
}

pictures! {
    absorption: "absorption.toml", BOUNCES;
    ambient: "ambient.toml", EDGES;
    course: "course.ray", BOUNCES;
    cube: "cube.toml", EDGES;
    cylinder: "cylinder.toml", EDGES;
    diffuse: "diffuse.toml", EDGES;
    falloff: "falloff.toml", EDGES;
    fresnel: "fresnel.toml", EDGES;
    instances: "instances.toml", EDGES;
    lens_concentric: "lens_concentric.toml", EDGES;
    lens_polar: "lens_polar.toml", EDGES;
    lens_polar_uniform_radius: "lens_polar_uniform_radius.toml", EDGES;
    lens_rejection: "lens_rejection.toml", EDGES;
    mesh: "mesh.toml", BOUNCES;
    metallic: "metallic.toml", EDGES;
    nested_media: "nested_media.toml", BOUNCES;
    orthographic: "orthographic.toml", EDGES;
    perspective: "perspective.toml", EDGES;
    plastic: "plastic.toml", EDGES;
    quad: "quad.toml", EDGES;
    recursion_50: "recursion_50.toml", BOUNCES;
    reflection: "reflection.toml", BOUNCES;
    refraction: "refraction.toml", BOUNCES;
    shadow: "shadow.toml", EDGES;
    smooth_normals: "smooth_normals.toml", EDGES;
    soft_shadow: "soft_shadow.toml", EDGES;
    specular: "specular.toml", EDGES;
    sphere: "sphere.toml", EDGES;
    spiral: "spiral.json", EDGES;
    texture_bilinear: "texture_bilinear.toml", EDGES;
    texture_nearest: "texture_nearest.toml", EDGES;
    total_reflection: "total_reflection.toml", BOUNCES;
    transform: "transform.toml", EDGES;
}

/// Scenes too large for a stored picture: they are loaded, and rendered tiny.
const LARGE: &[&str] =
    &["ember.obj", "mesh_on_floor.toml", "report_bench.toml", "still_life.toml", "thousand_spheres.toml"];

fn path(file: &str) -> PathBuf {
    Path::new("scenes").join(file)
}

fn load(file: &str) -> Loaded {
    let cancel = AtomicBool::new(false);
    let options = LoadOptions { smooth: None, allow: vec![], overrides: vec![], cancel: &cancel, progress: None };
    let loaded = scene::load(&path(file), &options).unwrap_or_else(|e| panic!("{file}: {e}"));
    let odd: Vec<_> = loaded.diagnostics.iter().map(ToString::to_string).collect();
    assert!(odd.is_empty() && loaded.warnings.is_empty(), "{file}: {odd:?} {:?}", loaded.warnings);
    loaded
}

/// What the scene asks for, `width` pixels wide with `spp` samples.
fn job(loaded: &Loaded, width: u32, spp: u32) -> Job {
    let asked = &loaded.render;
    let (w, h) = asked.size.unwrap_or((4, 3));
    let size = (width, (width * h).div_ceil(w));
    Job {
        size,
        crop: Crop { x0: 0, y0: 0, x1: size.0, y1: size.1 },
        spp,
        seed: asked.seed.unwrap_or(0),
        k_max: asked.recursion.unwrap_or(8),
        min_weight: asked.min_weight.unwrap_or(1.0 / 1024.0),
        centre: false,
        lens_sampler: asked.lens_sampler.unwrap_or_default(),
        jitter_radius: asked.jitter_radius.unwrap_or(0.5),
        light_samples: 1,
        aovs: vec![],
    }
}

fn render(kind: BackendKind, loaded: &Loaded, job: &Job) -> Film {
    let options = BuildOptions { threads: 0, rays_expected: 1 << 40, cancel: &AtomicBool::new(false), progress: None };
    let backend = AnyBackend::build(kind, &loaded.scene, &options).expect("a good scene");
    let camera = &loaded.cameras.first().expect("a scene of the folder has a camera").camera;
    let outcome = render::run(&loaded.scene, camera, &backend, job, &Control::default()).expect("a good camera");
    assert_eq!(outcome.stats.non_finite_samples, 0, "{kind:?}");
    outcome.film
}

fn picture(film: &Film) -> RgbImage {
    let table = Srgb8::table();
    let bytes = film.color.iter().flat_map(|&c| table.rgb(c)).collect();
    RgbImage::from_raw(film.width, film.height, bytes).expect("three bytes a pixel")
}

fn check(file: &str, limit: Limit) {
    let name = file.split('.').next().expect("a file has a name");
    let stored = PathBuf::from(format!("tests/golden/{name}.png"));
    let loaded = load(file);
    let job = job(&loaded, 160, 4);
    for &kind in BackendKind::COMPILED {
        let actual = picture(&render(kind, &loaded, &job));
        if std::env::var_os("TISON_BLESS").is_some() {
            actual.save(&stored).expect("the folder can be written to");
            return;
        }
        let stored = image::open(&stored).unwrap_or_else(|e| panic!("{}: {e}{ACCEPT}{name}", stored.display()));
        compare(&format!("{name}, {kind:?}"), name, &actual, &stored.to_rgb8(), limit);
    }
}

const ACCEPT: &str = "\n  accept with TISON_BLESS=1 cargo test --test golden ";

fn compare(what: &str, name: &str, actual: &RgbImage, stored: &RgbImage, limit: Limit) {
    assert_eq!(actual.dimensions(), stored.dimensions(), "{what}: another size{ACCEPT}{name}");
    let off = |a: &image::Rgb<u8>, b: &image::Rgb<u8>| -> u8 {
        a.0.iter().zip(b.0).map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0)
    };
    let offs: Vec<u8> = actual.pixels().zip(stored.pixels()).map(|(a, b)| off(a, b)).collect();
    let worst = offs.iter().copied().max().unwrap_or(0);
    let beyond_one = offs.iter().filter(|&&o| o > 1).count();
    if worst <= limit.worst && beyond_one <= limit.beyond_one {
        return;
    }
    let folder = Path::new("target/golden");
    std::fs::create_dir_all(folder).expect("target can be written to");
    let diff = image::GrayImage::from_raw(actual.width(), actual.height(), offs.iter().map(|o| o.saturating_mul(8)).collect());
    let diff = diff.expect("one byte a pixel");
    actual.save(folder.join(format!("{name}.actual.png"))).expect("target can be written to");
    diff.save(folder.join(format!("{name}.diff.png"))).expect("target can be written to");
    panic!(
        "{what}: worst channel {worst} (allowed {}), {beyond_one} pixels off by more than one step (allowed {})\n  \
         see {}/{name}.{{actual,diff}}.png{ACCEPT}{name}",
        limit.worst,
        limit.beyond_one,
        folder.display()
    );
}
