//! The scenes of `scenes/`, rendered small by every backend with a quarter of their samples, against
//! stored pictures.
//!
//! `TISON_BLESS=1 cargo test --test golden` accepts what is seen now; look at it first.

use image::{GrayImage, Rgb, RgbImage};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use tison::backend::{AnyBackend, BackendKind, BuildOptions};
use tison::film::Film;
use tison::math::colour::Srgb8;
use tison::render::{self, Control, Job};
use tison::scene::{self, CameraDesc, CameraOverrides, LoadOptions, Loaded, View};

/// How far a picture may be from the stored one.
#[derive(Clone, Copy, Debug)]
struct Limit {
    /// Largest difference of any channel, in steps of 255.
    worst: u8,
    /// Pixels with a channel that is off by more than one step.
    beyond_one: usize,
}

/// Where a ray grazes an edge, rounding may decide which side it is on: seldom, and then by much.
/// The two backends of one processor make all these pictures alike, to the byte; another processor may not.
const EDGES: Limit = Limit { worst: 80, beyond_one: 4 };
/// Paths through many curved mirrors and glasses make a rounding large.
const BOUNCES: Limit = Limit { worst: 80, beyond_one: 20 };

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
    error_edges: "error_edges.toml", EDGES;
    error_lens: "error_lens.toml", EDGES;
    error_shadow: "error_shadow.toml", EDGES;
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

fn load(file: &str) -> Loaded {
    let cancel = AtomicBool::new(false);
    let options = LoadOptions::new(&cancel);
    let loaded = scene::load(&Path::new("scenes").join(file), &options).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.diagnostics.is_empty() && loaded.warnings.is_empty(), "{file} has warnings: see tison check");
    loaded
}

/// What the scene asks for, but `width` pixels wide with `spp` samples.
fn job(loaded: &Loaded, width: u32, spp: u32) -> Job {
    let asked = &loaded.render;
    let (w, h) = asked.size.unwrap_or((4, 3));
    let size = (width, (width * h).div_ceil(w));
    Job {
        spp,
        seed: asked.seed.unwrap_or(0),
        k_max: asked.recursion.unwrap_or(8),
        min_weight: asked.min_weight.unwrap_or(1.0 / 1024.0),
        lens_sampler: asked.lens_sampler.unwrap_or_default(),
        jitter_radius: asked.jitter_radius.unwrap_or(0.5),
        light_samples: if asked.course_rules { spp } else { 1 },
        ..Job::whole(size)
    }
}

fn render(kind: BackendKind, loaded: &Loaded, camera: &CameraDesc, job: &Job) -> Film {
    let cancel = AtomicBool::new(false);
    let options = BuildOptions { rays_expected: 1 << 40, ..BuildOptions::new(&cancel) };
    let backend = AnyBackend::build(kind, &loaded.scene, &options).expect("a good scene");
    let outcome = render::run(&loaded.scene, camera, &backend, job, &Control::default()).expect("a good camera");
    assert_eq!(outcome.stats.non_finite_samples, 0, "{kind:?}");
    outcome.film
}

fn picture(film: &Film) -> RgbImage {
    let table = Srgb8::table();
    let bytes = film.color.iter().flat_map(|&c| table.rgb(c)).collect();
    RgbImage::from_raw(film.width, film.height, bytes).expect("three bytes a pixel")
}

fn stem(file: &str) -> &str {
    file.split_once('.').map_or(file, |(stem, _)| stem)
}

fn check(file: &str, limit: Limit) {
    let name = stem(file);
    let path = PathBuf::from(format!("tests/golden/{name}.png"));
    let loaded = load(file);
    let samples = loaded.render.samples.unwrap_or(1);
    let job = job(&loaded, 160, samples.div_ceil(4));
    for &kind in BackendKind::COMPILED {
        let actual = picture(&render(kind, &loaded, &loaded.cameras[0].camera, &job));
        if blessing() {
            return actual.save(path).expect("the folder can be written to");
        }
        let stored = image::open(&path).map(|i| i.to_rgb8());
        let stored = stored.unwrap_or_else(|e| panic!("{}: {e}{}", path.display(), accept(name)));
        compare(name, kind, &actual, &stored, limit);
    }
}

fn blessing() -> bool {
    std::env::var_os("TISON_BLESS").is_some()
}

fn accept(name: &str) -> String {
    format!("\n  accept with TISON_BLESS=1 cargo test --test golden {name}")
}

fn compare(name: &str, kind: BackendKind, actual: &RgbImage, stored: &RgbImage, limit: Limit) {
    assert_eq!(actual.dimensions(), stored.dimensions(), "{name}: another size{}", accept(name));
    let off = |(a, b): (&Rgb<u8>, &Rgb<u8>)| [0, 1, 2].map(|k| a.0[k].abs_diff(b.0[k])).into_iter().max().unwrap_or(0);
    let offs: Vec<u8> = actual.pixels().zip(stored.pixels()).map(off).collect();
    let worst = offs.iter().copied().max().unwrap_or(0);
    let beyond_one = offs.iter().filter(|&&o| o > 1).count();
    if worst <= limit.worst && beyond_one <= limit.beyond_one {
        return;
    }
    let folder = Path::new("target/golden");
    fs::create_dir_all(folder).expect("target can be written to");
    actual.save(folder.join(format!("{name}.actual.png"))).expect("target can be written to");
    let shown = offs.iter().map(|&o| o.saturating_mul(8)).collect();
    let diff = GrayImage::from_raw(actual.width(), actual.height(), shown).expect("one byte a pixel");
    diff.save(folder.join(format!("{name}.diff.png"))).expect("target can be written to");
    panic!(
        "{name}, {kind:?}: worst channel {worst} (allowed {}), {beyond_one} pixels off by more than one step (allowed {})\n  \
         see {}/{name}.{{actual,diff}}.png{}",
        limit.worst,
        limit.beyond_one,
        folder.display(),
        accept(name)
    );
}

/// Names of the files in `folder`.
fn files(folder: &str) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).expect("it is part of the project").map(|e| e.expect("it can be listed"));
    let files = entries.filter(|e| e.path().is_file()).map(|e| e.file_name().into_string().expect("names are UTF-8"));
    files.collect()
}

#[test]
fn every_scene_has_a_picture_or_is_large() {
    let known = PICTURES.iter().chain(LARGE).map(ToString::to_string).collect();
    let mut scenes = files("scenes");
    scenes.retain(|f| !f.ends_with(".mtl"));
    assert_eq!(scenes, known, "in the folder, and in this file");
    let pictures: BTreeSet<_> = PICTURES.iter().map(|f| format!("{}.png", stem(f))).collect();
    assert!(blessing() || files("tests/golden") == pictures, "what is stored in tests/golden is what is compared");
}

#[test]
fn everything_beside_the_scenes_is_used() {
    let folders = ["scenes", "scenes/library", "scenes/models"];
    let texts = folders.iter().flat_map(|folder| files(folder).into_iter().map(move |f| format!("{folder}/{f}")));
    let texts: String = texts.map(|f| fs::read_to_string(f).expect("it is text")).collect();
    for folder in ["library", "models", "textures"] {
        for file in files(&format!("scenes/{folder}")) {
            assert!(texts.contains(&file), "no scene uses {folder}/{file}");
        }
    }
}

#[test]
fn large_scenes_load_and_render() {
    for file in LARGE {
        let mut loaded = load(file);
        let camera = loaded.cameras.first().map(|c| c.camera).unwrap_or_else(|| {
            let camera = loaded.scene.auto_camera(View::ThreeQuarter, &CameraOverrides::default(), 1.5);
            let camera = camera.expect("there is something to see");
            loaded.scene.light_from(&camera);
            camera
        });
        let job = job(&loaded, 48, 1);
        let films = BackendKind::COMPILED.iter().map(|&kind| render(kind, &loaded, &camera, &job));
        for film in films {
            let lit = film.color.iter().filter(|c| c.iter().any(|&x| x > 0.1)).count();
            assert!(film.is_complete() && 20 * lit > film.color.len(), "{file}: only {lit} pixels are lit");
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    for file in ["lens_rejection.toml", "soft_shadow.toml", "course.ray", "refraction.toml", "still_life.toml"] {
        let loaded = load(file);
        let job = job(&loaded, 72, 3);
        for &kind in BackendKind::COMPILED {
            let bits = |threads: usize| -> Vec<[u32; 3]> {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("so many can be had");
                let film = pool.install(|| render(kind, &loaded, &loaded.cameras[0].camera, &job));
                film.color.iter().map(|c| c.map(f32::to_bits)).collect()
            };
            let one = bits(1);
            for threads in [2, 7] {
                assert!(bits(threads) == one, "{file}, {kind:?}: {threads} threads give another picture than one");
            }
        }
    }
}
