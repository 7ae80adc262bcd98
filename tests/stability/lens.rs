//! Depth of field: what is constant stays so, and what is blurred comes nearer to the truth as fast as it should.

use crate::for_each_backend;
use tison::backend::{AnyBackend, BackendKind};
use tison::bench::leaving::{job, load};
use tison::bench::setup::build;
use tison::render::{self, Control, Crop, Job};
use tison::scene::Loaded;

fn written(text: &str) -> Loaded {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, format!("tison = 1\n{text}")).expect("a file in it");
    load(&path).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn picture(loaded: &Loaded, backend: &AnyBackend, job: &Job) -> Vec<f32> {
    let camera = &loaded.cameras[0].camera;
    let film = render::run(&loaded.scene, camera, backend, job, &Control::default()).expect("a good camera").film;
    film.color.iter().map(|c| c[0]).collect()
}

for_each_backend! {
    fn a_constant_plane_stays_constant(kind: BackendKind) {
        let plane = written(
            "[render]\nambient = [0.3, 0.7, 0.11]\n
            [camera.main]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\nfov = 20\nlens = { radius = 0.4, focus = 3 }\n
            [material.m]\ncolor = [0.3, 0.9, 0.7]\n[[object]]\nshape = 'quad'\nhalf = 50\nmaterial = 'm'\n",
        );
        let backend = build(kind, &plane.scene).expect("a good scene");
        let want = picture(&plane, &backend, &job(1))[0];
        for spp in [1, 3, 16, 100, 1024] {
            let seen = picture(&plane, &backend, &Job { spp, ..job(12) });
            assert!(seen.iter().all(|&c| c == want), "{spp} samples");
        }
    }

    /// A half plane out of focus, lit evenly: the error falls faster than spp^-0.6.
    fn the_error_of_a_blurred_edge_falls(kind: BackendKind) {
        let edge = written(
            "[render]\nambient = [1, 1, 1]\nbackground = [0, 0, 0]\n
            [camera.main]\neye = [0, 0, 5]\ntarget = [0.04, 0.03, 0]\nfov = 1\nlens = { radius = 0.2, focus = 2 }\n
            [material.m]\ncolor = [1, 1, 1]\nambient = 1\ndiffuse = 0\n
            [[object]]\nshape = 'quad'\nhalf = 50\nmaterial = 'm'\ntransform = [{ translate = [50, 0, 0] }, { rotate = [0, 0, 1], degrees = 17 }]\n",
        );
        let backend = build(kind, &edge.scene).expect("a good scene");
        let crop = Crop { x0: 0, y0: 0, x1: 16, y1: 8 };
        let film = |spp: u32, seed: u32| picture(&edge, &backend, &Job { spp, seed, crop, ..job(16) });
        let truth = film(32_768, 1000);
        let rmse = |spp: u32| {
            let squares = (0..4).flat_map(|seed| film(spp, seed)).zip(truth.iter().cycle());
            let squares: Vec<f64> = squares.map(|(a, b)| f64::from(a - b).powi(2)).collect();
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
        };
        assert!(truth.iter().all(|&c| c > 0.02 && c < 0.98), "all pixels are blurred");
        // Least squares of log error over log samples.
        let points = [16, 32, 64, 128, 256, 512].map(|spp| (f64::from(spp).ln(), rmse(spp).ln()));
        let n = points.len() as f64;
        let (x, y) = points.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0 / n, s.1 + p.1 / n));
        let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>()
            / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>();
        assert!(slope <= -0.6, "slope {slope:.3}: {points:?}");
    }
}
