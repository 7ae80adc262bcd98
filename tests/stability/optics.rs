//! Glass and mirrors: what comes out of them against formulas in f64.

use crate::for_each_backend;
use glam::{DMat3, DVec2, DVec3};
use std::sync::Mutex;
use tison::backend::{Backend, BackendKind};
use tison::bench::leaving::{job, load, looking};
use tison::bench::setup::build;
use tison::geom::{Coherence, Hit, PacketBatch, Ray, RayHitPacket};
use tison::render::{self, Control, Job, Outcome};
use tison::scene::{CameraDesc, Loaded, Skip, Skips};

fn written(text: &str) -> Loaded {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, format!("tison = 1\n{text}")).expect("a file in it");
    load(&path).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Keeps every ray of a render that looks for the nearest hit, with whether it hit.
struct Watching<'a> {
    inner: &'a dyn Backend,
    rays: Mutex<Vec<(Ray, bool)>>,
}

impl Backend for Watching<'_> {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let hit = self.inner.intersect(ray);
        self.rays.lock().expect("nobody panics with it").push((*ray, hit.is_some()));
        hit
    }
    fn occluded(&self, ray: &Ray) -> bool {
        self.inner.occluded(ray)
    }
    fn intersect_many(&self, rays: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        self.inner.intersect_many(rays, coherence);
        let mut kept = self.rays.lock().expect("nobody panics with it");
        for (packet, live) in rays.packets_mut() {
            kept.extend((0..live).map(|lane| (packet.ray.get(lane), packet.hit(lane).is_some())));
        }
    }
}

fn watched(kind: BackendKind, loaded: &Loaded, camera: &CameraDesc, job: &Job) -> (Vec<(Ray, bool)>, Outcome) {
    let backend = build(kind, &loaded.scene).expect("a good scene");
    let watching = Watching { inner: backend.as_dyn(), rays: Mutex::default() };
    // All rays are to reach the backend.
    let job = Job { skips: Skips::ALL.without(Skip::Inside).without(Skip::Bounds), ..job.clone() };
    let outcome = render::run_with(&loaded.scene, camera, &watching, &job, &Control::default());
    (watching.rays.into_inner().expect("nobody panics with it"), outcome.expect("a good camera"))
}

fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

for_each_backend! {
    /// 102,400 rays through a pane that stands at a slant.
    fn a_pane_of_glass_leaves_rays_parallel(kind: BackendKind) {
        let pane = written(
            "[material.glass]\ndiffuse = 0\nrefract = 1\nior = 1.5\n
            [[object]]\nshape = 'cube'\nhalf = [30, 30, 0.25]\nmaterial = 'glass'\n
            transform = [{ rotate = [1, 2, 3], degrees = 25 }]\n",
        );
        let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 25f64.to_radians());
        let eye = turn * DVec3::new(0.3, -0.2, 5.0);
        let camera = looking(eye, DVec3::ZERO, 60.0);
        let n = 320;
        let job = Job { centre: true, k_max: 8, ..job(n) };
        let (rays, outcome) = watched(kind, &pane, &camera, &job);
        assert_eq!(outcome.stats.rays.reflected, 0, "no total reflection in a pane");
        let through: Vec<_> = rays.iter().filter(|(_, hit)| !hit).collect();
        assert_eq!(through.len(), (n * n) as usize, "each ray comes out, once");
        let prepared = camera.prepare(&pane.scene.frame, (n, n)).expect("a good camera");
        let [middle, right, down] = [(160.0, 160.0), (161.0, 160.0), (160.0, 161.0)]
            .map(|(x, y)| prepared.ray(x, y, DVec2::ZERO).1);
        let (right, down) = (right - middle, down - middle);
        for (ray, _) in through {
            // Pixels are 3e-3 rad apart: the nearest one is where the ray came from.
            let d = ray.d.as_dvec3();
            let on_film = d * (middle.length_squared() / d.dot(middle)) - middle;
            let [x, y] = [right, down].map(|axis| 160.0 + on_film.dot(axis) / axis.length_squared());
            let from = prepared.ray(x.floor() + 0.5, y.floor() + 0.5, DVec2::ZERO).1;
            assert!(angle(d, from) < 1e-4, "{} rad off at {x}, {y}", angle(d, from));
        }
    }

    /// From inside a block of glass at its top, around the critical angle: the decision is that of f64 for the
    /// very ray, and what passes goes to zero without a step.
    fn at_the_critical_angle(kind: BackendKind) {
        let block = written(
            "[render]\nbackground = [1, 1, 1]\n
            [material.glass]\nambient = 0\ndiffuse = 0\nreflect = 'fresnel'\nrefract = 1\nior = 1.5\n
            [[object]]\nshape = 'cube'\nhalf = [50, 50, 1]\nmaterial = 'glass'\n",
        );
        let critical = (1.0f64 / 1.5).asin();
        let mut least_passed = 1.0f64;
        for turn in 0..40 {
            let around = DVec3::new((0.3 + f64::from(turn)).cos(), (0.3 + f64::from(turn)).sin(), 0.0);
            let mut before = 2.0;
            for off in [-0.2, -1e-2, -1e-3, -1e-4, -1e-5, -1e-6, 1e-6, 1e-5, 1e-4, 0.2] {
                let (sin, cos) = f64::sin_cos(critical + off);
                let camera = looking(DVec3::ZERO, around * sin + DVec3::Z * cos, 1.0);
                let job = Job { centre: true, k_max: 1, ..job(1) };
                let (rays, outcome) = watched(kind, &block, &camera, &job);
                let d = rays[0].0.d.as_dvec3().normalize();
                let k = 1.0 - 2.25 * (1.0 - d.z * d.z);
                assert!(k.abs() < 1e-13 || (k > 0.0) == (outcome.stats.rays.refracted == 1), "{off:e}: k = {k:e}");
                let want = if k > 0.0 {
                    let (c, q) = (d.z, k.sqrt());
                    let (rs, rp) = ((1.5 * c - q) / (1.5 * c + q), (c - 1.5 * q) / (c + 1.5 * q));
                    1.0 - 0.5 * (rs * rs + rp * rp)
                } else {
                    0.0
                };
                let passed = f64::from(outcome.film.color[0][0]);
                assert!((passed - want).abs() < 1e-6, "{off:e}: {passed} passes, not {want}");
                assert!(passed <= before, "{off:e}: {passed} after {before}");
                before = passed;
                if passed > 0.0 {
                    least_passed = least_passed.min(passed);
                }
            }
        }
        assert!(least_passed < 0.02, "from 96 % to nothing there is no step: {least_passed}");
    }

    fn sixty_four_facing_mirrors_keep_the_length_of_the_direction(kind: BackendKind) {
        let mirrors = written(
            "[material.mirror]\ndiffuse = 0\nreflect = 1\n
            [[object]]\nshape = 'quad'\nhalf = 40\nmaterial = 'mirror'\ntransform = [{ translate = [0, 0, 1] }]\n
            [[object]]\nshape = 'quad'\nhalf = 40\nmaterial = 'mirror'\ntransform = [{ translate = [0, 0, -1] }]\n",
        );
        let d = DVec3::new(0.2, 0.1, 1.0).normalize();
        let job = Job { centre: true, k_max: 64, ..job(1) };
        let (rays, outcome) = watched(kind, &mirrors, &looking(DVec3::ZERO, d, 1.0), &job);
        assert_eq!((rays.len(), outcome.stats.rays.reflected), (65, 64));
        let first = rays[0].0.d.as_dvec3().normalize();
        for (i, (ray, hit)) in rays.iter().enumerate().skip(1) {
            let length = ray.d.as_dvec3().length();
            assert!(*hit && (length - 1.0).abs() < 2e-7, "mirror {i}: |d| = {length}");
            let want = DVec3::new(first.x, first.y, if i % 2 == 0 { first.z } else { -first.z });
            // One rounding of the direction to f32 each.
            assert!(angle(ray.d.as_dvec3(), want) < 64.0 * 6e-8, "mirror {i}: {:e} rad", angle(ray.d.as_dvec3(), want));
        }
    }

    /// 10,000 bounces in a mirrored ball: no stack to overflow, and the bound on what is left out holds.
    fn ten_thousand_bounces_are_bounded_by_the_certificate(kind: BackendKind) {
        let share = 0.999f64;
        let ball = written(&format!(
            "[render]\nambient = [1, 1, 1]\n[material.mirror]\nambient = 1\ncolor = [1, 1, 1]\ndiffuse = 0\nreflect = {share}\n
            [[object]]\nshape = 'sphere'\nradius = 5\nmaterial = 'mirror'\n",
        ));
        let camera = looking(DVec3::new(0.5, 0.2, 0.1), DVec3::Z, 40.0);
        let share = f64::from(share as f32);
        for k_max in [10, 10_000] {
            let (_, outcome) = watched(kind, &ball, &camera, &Job { k_max, ..job(1) });
            assert_eq!(outcome.stats.rays.reflected, u64::from(k_max));
            let missing = share.powi(k_max as i32 + 1) / (1.0 - share);
            let seen = f64::from(outcome.film.color[0][0]);
            assert!((seen + missing - 1.0 / (1.0 - share)).abs() < 0.05, "{seen} and {missing}");
            let bound = outcome.stats.cut_off_max;
            assert!(bound >= missing * 0.999 && bound < 2.0 * missing, "{bound} for {missing}");
        }
    }

    /// F + (1 - F) = 1 at every bounce, and none is cut.
    fn a_white_furnace_without_a_cut(kind: BackendKind) {
        let furnace = written(
            "[render]\nbackground = [1, 1, 1]\nambient = [1, 1, 1]\n
            [material.glass]\nambient = 0\ndiffuse = 0\nreflect = 'fresnel'\nrefract = 1\nior = 1.5\n
            [material.white]\ncolor = [1, 1, 1]\nambient = 1\ndiffuse = 0\n
            [[object]]\nshape = 'sphere'\nmaterial = 'glass'\n
            [[object]]\nshape = 'sphere'\nradius = 0.5\ncenter = [0.9, 0.9, -1]\nmaterial = 'white'\n",
        );
        let camera = looking(DVec3::new(0.0, 1.0, 6.0), DVec3::ZERO, 30.0);
        let (_, outcome) = watched(kind, &furnace, &camera, &Job { k_max: 1000, min_weight: 0.0, ..job(32) });
        for (i, pixel) in outcome.film.color.iter().enumerate() {
            assert!(pixel.iter().all(|c| (c - 1.0).abs() < 1e-6), "pixel {i}: {pixel:?}");
        }
        assert!(outcome.stats.rays.refracted > 2000 && outcome.stats.rays.reflected > 2000);
        assert_eq!(outcome.stats.non_finite_samples, 0);
    }
}
