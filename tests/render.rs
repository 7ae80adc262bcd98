//! Pictures against what is known about them: by hand, by the other backend, by themselves.

use glam::{DVec3, Vec3};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use tison::backend::{AnyBackend, BackendKind, BuildOptions};
use tison::film::{Aov, Film};
use tison::geom::TriangleMesh;
use tison::math::Frame;
use tison::render::{self, Control, Crop, Job, Outcome};
use tison::scene::{CameraDesc, CameraOverrides, Light, Material, Mesh, Object, Projection, Reflect, Scene, View};

fn object(points: &[[f32; 3]], faces: Vec<[u32; 3]>) -> Object {
    let triangles = Arc::new(TriangleMesh::new(points.concat(), faces));
    Object::Mesh(Mesh::bare(triangles))
}

fn scene(objects: Vec<Object>, materials: Vec<Material>) -> Scene {
    let background = Vec3::new(0.1, 0.2, 0.3);
    Scene { materials, background, ..Scene::of(objects) }
}

/// A square of side 2 in the plane z = 0 that faces +z, at height `z`.
fn square(z: f32) -> Object {
    object(&[[-1., -1., z], [1., -1., z], [1., 1., z], [-1., 1., z]], vec![[0, 1, 2], [0, 2, 3]])
}

/// A closed lumpy ball of some thousand triangles.
fn ball() -> Object {
    let (rings, sectors) = (40u32, 60u32);
    let mut points = Vec::new();
    for i in 0..=rings {
        for j in 0..sectors {
            let (a, b) =
                (i as f32 / rings as f32 * std::f32::consts::PI, j as f32 / sectors as f32 * std::f32::consts::TAU);
            let r = 1.0 + 0.1 * (5.0 * a).sin() * (7.0 * b).cos();
            points.push([r * a.sin() * b.cos(), r * a.cos(), r * a.sin() * b.sin()]);
        }
    }
    let at = |i: u32, j: u32| i * sectors + j % sectors;
    let quads = (0..rings).flat_map(|i| (0..sectors).map(move |j| (i, j)));
    let faces = quads
        .flat_map(|(i, j)| [[at(i, j), at(i, j + 1), at(i + 1, j)], [at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]]);
    object(&points, faces.collect())
}

fn camera(eye: DVec3) -> CameraDesc {
    CameraDesc {
        eye,
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Perspective { fov_deg: 40.0 },
        aperture: 0.0,
        focus: None,
        aspect: None,
        clip: None,
    }
}

fn job(w: u32, h: u32) -> Job {
    Job::whole((w, h))
}

fn render(kind: BackendKind, scene: &Scene, camera: &CameraDesc, job: &Job) -> Outcome {
    let cancel = AtomicBool::new(false);
    let options = BuildOptions { rays_expected: 1 << 40, ..BuildOptions::new(&cancel) };
    let backend = AnyBackend::build(kind, scene, &options).expect("a good scene");
    render::run(scene, camera, &backend, job, &Control::default()).expect("a good camera")
}

fn lit_ball() -> (Scene, CameraDesc) {
    let mut scene = scene(vec![ball()], vec![Material::default()]);
    let camera = scene.auto_camera(View::ThreeQuarter, &CameraOverrides::default(), 1.5).expect("a camera");
    scene.light_from(&camera);
    (scene, camera)
}

#[test]
fn a_square_under_one_light_has_the_colours_of_the_formula() {
    let m = Material {
        ambient: Vec3::splat(0.5),
        diffuse: Vec3::new(0.6, 0.4, 0.2),
        specular: Vec3::splat(0.3),
        shininess: 10.0,
        ..Material::default()
    };
    let mut scene = scene(vec![square(0.0)], vec![m.clone()]);
    scene.ambient = Vec3::splat(0.1);
    let light = Light::constant(DVec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 0.9, 0.8));
    scene.lights = vec![light];
    let eye = DVec3::new(0.0, 0.0, 4.0);
    let (w, h) = (48, 32);
    for &kind in BackendKind::COMPILED {
        let outcome = render(kind, &scene, &camera(eye), &Job { centre: true, ..job(w, h) });
        assert_eq!(outcome.stats.rays.camera, u64::from(w * h));
        let mut on_square = 0;
        for y in 0..h {
            for x in 0..w {
                let k = 2.0 * 20f64.to_radians().tan() / f64::from(h);
                let d = DVec3::new((f64::from(x) + 0.5 - 24.0) * k, (16.0 - f64::from(y) - 0.5) * k, -1.0);
                let p = eye + d * 4.0;
                let want = if p.abs().max_element() > 1.0 {
                    scene.background
                } else {
                    on_square += 1;
                    let l = (light.position - p).normalize();
                    let half = (l - d.normalize()).normalize();
                    let spec = half.z.powi(10) as f32;
                    m.ambient * scene.ambient + light.color * (m.diffuse * l.z as f32 + m.specular * spec)
                };
                let got = Vec3::from(outcome.film.color[(y * w + x) as usize]);
                assert!((got - want).abs().max_element() < 2e-6, "{kind:?} {x},{y}: {got} instead of {want}");
            }
        }
        assert_eq!(outcome.stats.rays.shadow, on_square);
    }
}

#[test]
fn a_roof_throws_a_shadow_and_light_from_behind_costs_no_ray() {
    let mut scene = scene(vec![square(0.0), square(1.0)], vec![Material::default()]);
    scene.lights = vec![
        Light::constant(DVec3::new(0.0, 0.0, 50.0), Vec3::ONE),
        Light::constant(DVec3::new(0.0, 0.0, -50.0), Vec3::ONE),
    ];
    for &kind in BackendKind::COMPILED {
        // From the side, below the roof: only the lower square's upper side is seen.
        let side = camera(DVec3::new(0.0, -6.0, 0.8));
        let outcome = render(kind, &scene, &side, &job(64, 64));
        let dark = outcome.film.color.iter().filter(|c| **c == [0.0; 3]).count();
        assert!(dark > 100, "{kind:?}: {dark} pixels in the roof's shadow");
        let hits = outcome.stats.rays.shadow + outcome.stats.shadow_rays_facing_away;
        assert!(outcome.stats.shadow_rays_facing_away >= hits / 2, "one of two lights is behind every surface");
    }
}

#[test]
fn facing_mirrors_go_on_to_the_depth_bound_and_the_rest_is_bounded() {
    let mirror = Material {
        ambient: Vec3::ONE,
        diffuse: Vec3::ZERO,
        specular: Vec3::ZERO,
        reflect: Reflect::Constant(Vec3::splat(0.5)),
        ..Material::default()
    };
    let mut scene = scene(vec![square(-1.0), square(1.0)], vec![mirror]);
    scene.ambient = Vec3::splat(1.0);
    let eye = DVec3::new(0.0, 0.0, 0.5);
    let look = CameraDesc {
        target: DVec3::new(1e-3, 0.0, -1.0),
        projection: Projection::Perspective { fov_deg: 1.0 },
        ..camera(eye)
    };
    let at = |k_max: u32, min_weight: f32| {
        render(BackendKind::COMPILED[0], &scene, &look, &Job { k_max, min_weight, ..job(4, 4) })
    };
    let full = at(64, 0.0);
    for c in &full.film.color {
        assert!((c[0] - 2.0).abs() < 1e-6, "1 + 1/2 + 1/4 + … = 2, not {}", c[0]);
    }
    assert_eq!(full.stats.rays.reflected, 64 * 16);
    for k_max in [0, 1, 5] {
        let short = at(k_max, 0.0);
        let missing = full.film.color[5][0] - short.film.color[5][0];
        assert!(missing > 0.0 && f64::from(missing) <= short.stats.cut_off_max * (1.0 + 1e-6));
        assert!(short.stats.cut_off_max < 2.1 * f64::from(missing), "the bound is near: {}", short.stats.cut_off_max);
    }
    let cut = at(64, 1.0 / 1024.0);
    assert_eq!((cut.stats.rays.reflected, cut.stats.branches_below_cut), (10 * 16, 16));
    let missing = f64::from(full.film.color[5][0] - cut.film.color[5][0]);
    assert!(missing <= cut.stats.cut_off_max && cut.stats.cut_off_max < 2e-3);
}

#[test]
fn a_glass_slab_shows_what_is_behind_it_and_a_furnace_loses_nothing() {
    // Fresnel glass with index 1.5 in light of the same strength from everywhere.
    let glass = Material {
        ambient: Vec3::ZERO,
        diffuse: Vec3::ZERO,
        specular: Vec3::ZERO,
        reflect: Reflect::Fresnel,
        refract: Vec3::ONE,
        ior: 1.5,
        ..Material::default()
    };
    let mut scene = scene(vec![ball()], vec![glass]);
    scene.background = Vec3::ONE;
    for &kind in BackendKind::COMPILED {
        let outcome = render(
            kind,
            &scene,
            &camera(DVec3::new(0.0, 0.0, 5.0)),
            &Job { k_max: 1000, min_weight: 1e-9, ..job(24, 24) },
        );
        for c in &outcome.film.color {
            assert!(c.iter().all(|v| (v - 1.0).abs() < 2e-6), "{kind:?}: {c:?}");
        }
        assert!(outcome.stats.rays.refracted > 500 && outcome.stats.rays.reflected > 500);
        assert_eq!(outcome.stats.non_finite_samples, 0);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let (mut scene, camera) = lit_ball();
    scene.materials[0].reflect = Reflect::Constant(Vec3::splat(0.3));
    let job = Job { spp: 3, aovs: Aov::ALL.to_vec(), ..job(150, 100) };
    for &kind in BackendKind::COMPILED {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| render(kind, &scene, &camera, &job))
        };
        let (one, two, seven) = (with(1), with(2), with(7));
        for other in [&two, &seven] {
            assert_eq!(bits(&one.film), bits(&other.film), "{kind:?}");
            assert_eq!(one.stats.rays, other.stats.rays);
            assert_eq!(one.stats.cut_off_mean.to_bits(), other.stats.cut_off_mean.to_bits());
        }
    }
}

fn bits(film: &Film) -> Vec<u32> {
    let colors = film.color.iter().flatten();
    colors.chain(film.aovs.iter().flat_map(|a| &a.data)).map(|v| v.to_bits()).collect()
}

#[test]
fn a_crop_is_a_part_of_the_whole() {
    let (scene, camera) = lit_ball();
    let kind = BackendKind::COMPILED[0];
    let whole = render(kind, &scene, &camera, &Job { spp: 2, ..job(90, 60) });
    let crop = Crop { x0: 33, y0: 7, x1: 71, y1: 50 };
    let part = render(kind, &scene, &camera, &Job { spp: 2, crop, ..job(90, 60) });
    assert_eq!((part.film.width, part.film.height), (38, 43));
    for y in 0..43 {
        for x in 0..38 {
            let (a, b) = (part.film.color[y * 38 + x], whole.film.color[(y + 7) * 90 + x + 33]);
            assert_eq!(a, b, "{x},{y}");
        }
    }
}

#[cfg(feature = "embree")]
#[test]
fn both_backends_render_the_same_picture() {
    let (mut scene, camera) = lit_ball();
    scene.materials[0].reflect = Reflect::Constant(Vec3::splat(0.3));
    let job = Job { aovs: vec![Aov::Id], ..job(300, 200) };
    let [a, b] = [BackendKind::Embree, BackendKind::Native].map(|k| render(k, &scene, &camera, &job));
    let differs = |i: usize| {
        let (p, q) = (Vec3::from(a.film.color[i]), Vec3::from(b.film.color[i]));
        (p - q).abs().max_element() > 1e-5
    };
    let ids = |f: &Film, i: usize| [f.aovs[0].data[2 * i], f.aovs[0].data[2 * i + 1]];
    let (mut other_id, mut other_color) = (0, 0);
    for i in 0..a.film.color.len() {
        other_id += usize::from(ids(&a.film, i) != ids(&b.film, i));
        other_color += usize::from(differs(i));
    }
    // A ray within rounding of an edge may go to either neighbour.
    assert!(other_id <= 2, "{other_id} pixels show another triangle");
    assert!(other_color <= 20, "{other_color} pixels have another colour");
}

#[test]
fn auxiliary_images_tell_what_was_hit() {
    let mut scene =
        scene(vec![square(0.0)], vec![Material { diffuse: Vec3::new(0.7, 0.5, 0.3), ..Material::default() }]);
    scene.frame = Frame { origin: DVec3::new(0.0, 0.0, 100.0), exponent: 3 };
    let eye = DVec3::new(0.0, 0.0, 140.0);
    let look = CameraDesc { target: DVec3::new(0.0, 0.0, 100.0), ..camera(eye) };
    let aovs = Aov::ALL.to_vec();
    for &kind in BackendKind::COMPILED {
        let outcome = render(kind, &scene, &look, &Job { centre: true, aovs: aovs.clone(), ..job(31, 31) });
        let get = |kind: Aov, i: usize| {
            let image = outcome.film.aovs.iter().find(|a| a.kind == kind).expect("it was asked for");
            image.data[i * kind.channels()..(i + 1) * kind.channels()].to_vec()
        };
        let (middle, corner) = (15 * 31 + 15, 0);
        assert_eq!(get(Aov::Depth, middle), [40.0]);
        assert_eq!(get(Aov::Depth, corner), [f32::INFINITY]);
        assert_eq!(get(Aov::Normal, middle), [0.0, 0.0, 1.0]);
        assert_eq!(get(Aov::Normal, corner), [0.0; 3]);
        assert_eq!(get(Aov::Albedo, middle), [0.7, 0.5, 0.3]);
        assert_eq!(get(Aov::Hits, middle), [1.0]);
        assert_eq!(get(Aov::Cost, middle), [1.0]);
        assert_eq!(get(Aov::Id, middle)[0].to_bits(), 1);
        assert!((1..=2).contains(&get(Aov::Id, middle)[1].to_bits()));
        assert_eq!(get(Aov::Id, corner), [0.0, 0.0]);
    }
}

#[test]
fn a_cancelled_render_keeps_what_is_done() {
    let (scene, camera) = lit_ball();
    let cancel = AtomicBool::new(false);
    let options = BuildOptions { rays_expected: 0, ..BuildOptions::new(&cancel) };
    let backend = AnyBackend::build(BackendKind::COMPILED[0], &scene, &options).expect("a good scene");
    let control = Control::default();
    let big = Job { spp: 4096, ..job(640, 480) };
    let outcome = std::thread::scope(|s| {
        s.spawn(|| {
            while control.pixels.load(Relaxed) == 0 {
                std::thread::yield_now();
            }
            control.cancel.store(true, Relaxed);
        });
        render::run(&scene, &camera, &backend, &big, &control).expect("a good camera")
    });
    assert!(!outcome.film.is_complete() && outcome.film.finished >= 1024);
    assert_eq!(outcome.film.finished as u64, control.pixels.load(Relaxed));
    let lit = outcome.film.color.iter().filter(|c| **c != [0.0; 3]).count();
    assert_eq!(lit, outcome.film.finished);
}

#[test]
fn more_samples_come_nearer_to_the_truth() {
    let (scene, camera) = lit_ball();
    let kind = BackendKind::COMPILED[0];
    let at = |spp: u32, seed: u32| render(kind, &scene, &camera, &Job { spp, seed, ..job(60, 40) }).film;
    let truth = at(1024, 99);
    let rmse = |f: &Film| {
        let sum: f64 =
            f.color.iter().flatten().zip(truth.color.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        (sum / (3 * f.color.len()) as f64).sqrt()
    };
    let (few, many) = (rmse(&at(4, 1)), rmse(&at(64, 1)));
    assert!(many < 0.3 * few, "RMSE {few} with 4 samples, {many} with 64");
    assert_eq!(bits(&at(4, 1)), bits(&at(4, 1)));
    assert_ne!(bits(&at(4, 1)), bits(&at(4, 2)));
}

#[test]
fn a_lens_leaves_a_constant_plane_constant_and_blurs_what_is_out_of_focus() {
    let flat = Material {
        emission: Vec3::new(0.3, 0.5, 0.7),
        ambient: Vec3::ZERO,
        diffuse: Vec3::ZERO,
        specular: Vec3::ZERO,
        ..Material::default()
    };
    let scene = scene(vec![square(0.0)], vec![flat]);
    let kind = BackendKind::COMPILED[0];
    let close = CameraDesc { aperture: 0.2, focus: Some(1.0), ..camera(DVec3::new(0.0, 0.0, 1.5)) };
    for spp in [1, 7, 64] {
        let film = render(kind, &scene, &close, &Job { spp, ..job(16, 16) }).film;
        assert!(film.color.iter().all(|c| *c == [0.3, 0.5, 0.7]), "{spp} samples");
    }
    let far = |focus: f64| CameraDesc { aperture: 0.3, focus: Some(focus), ..camera(DVec3::new(0.0, 0.0, 5.0)) };
    let mixed = |focus: f64| {
        let film = render(kind, &scene, &far(focus), &Job { spp: 64, ..job(64, 64) }).film;
        film.color.iter().filter(|c| **c != [0.3, 0.5, 0.7] && **c != [0.1, 0.2, 0.3]).count()
    };
    assert!(mixed(2.0) > 4 * mixed(5.0), "{} against {}", mixed(2.0), mixed(5.0));
}
