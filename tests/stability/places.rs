//! The same picture wherever a scene is and however large, through loader and renderer.

use crate::for_each_backend;
use crate::kit::rmse;
use glam::{DVec3, Vec3};
use tison::backend::BackendKind;
use tison::bench::leaving::{job, load, looking, obj};
use tison::bench::setup::build;
use tison::render::{self, Control, Job};
use tison::scene::example::{self, Surface};
use tison::scene::{CameraDesc, CameraOverrides, Loaded, View};

/// Scale of the scene, and how many of its sizes it is away from the origin of its file.
const PLACES: [(f64, f64); 9] =
    [(1.0, 0.0), (1.0, 1e4), (1.0, 1e6), (1e-6, 0.0), (1e-6, 1e4), (1e-6, 1e6), (1e6, 0.0), (1e6, 1e4), (1e6, 1e6)];

const ALONG: DVec3 = DVec3::new(1.0, -0.7, 0.3);

type Picture = Vec<[f32; 3]>;

fn picture(kind: BackendKind, loaded: &Loaded, camera: &CameraDesc) -> Picture {
    let backend = build(kind, &loaded.scene).expect("a good scene");
    let job = Job { spp: 16, k_max: 4, ..job(96) };
    render::run(&loaded.scene, camera, &backend, &job, &Control::default()).expect("a good camera").film.color
}

fn written(name: &str, text: &str) -> Loaded {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, text).expect("a file in it");
    load(&path).unwrap_or_else(|e| panic!("{e}\n{text:.500}"))
}

fn all_alike(what: &str, picture: impl Fn(f64, DVec3) -> Picture) {
    let want = picture(1.0, DVec3::ZERO);
    let mean = want.iter().map(|c| c[0]).sum::<f32>() / want.len() as f32;
    assert!(mean > 0.05 && want.iter().any(|c| c[0] > 0.5), "{what} is dark");
    for (scale, sizes) in PLACES {
        let off = rmse(&picture(scale, sizes * scale * ALONG), &want);
        assert!(off < 1e-3, "{what}, scale {scale:e}, {sizes:e} sizes away: RMSE {off:e}");
    }
}

/// A list of numbers with all their digits.
fn list(v: DVec3) -> String {
    format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z)
}

/// Every shape, with a floor, shadows, a mirror and glass.
fn shapes(scale: f64, at: DVec3) -> String {
    let point = |x: f64, y: f64, z: f64| list(at + scale * DVec3::new(x, y, z));
    let size = |x: f64| format!("{:?}", scale * x);
    format!(
        "tison = 1
        [render]
        background = [0.2, 0.3, 0.4]
        ambient = [0.2, 0.2, 0.2]
        [camera.main]
        eye = {}
        target = {}
        fov = 30
        [light.key]
        position = {}
        falloff = 'none'
        [material.floor]
        color = [0.7, 0.7, 0.6]
        reflect = 0.2
        [material.red]
        color = [0.8, 0.2, 0.1]
        specular = 0.4
        [material.glass]
        diffuse = 0
        reflect = 'fresnel'
        refract = 1
        ior = 1.5
        [[object]]
        shape = 'quad'
        half = {}
        material = 'floor'
        transform = [{{ rotate = [1, 0, 0], degrees = -90 }}, {{ translate = {} }}]
        [[object]]
        shape = 'sphere'
        radius = {}
        center = {}
        material = 'glass'
        [[object]]
        shape = 'cube'
        half = {}
        material = 'red'
        transform = [{{ rotate = [1, 2, 3], degrees = 40 }}, {{ translate = {} }}]
        [[object]]
        shape = 'cylinder'
        radius = {}
        height = {}
        capped = true
        material = 'red'
        transform = [{{ rotate = [1, 0.2, 0], degrees = 70 }}, {{ translate = {} }}]
        ",
        point(0.3, 1.2, 3.6),
        point(0.0, 0.0, 0.0),
        point(2.0, 4.0, 3.0),
        size(3.0),
        point(0.0, -0.5, 0.0),
        size(0.5),
        point(-0.1, 0.02, 0.3),
        size(0.3),
        point(0.8, 0.0, -0.4),
        size(0.25),
        size(0.9),
        point(-0.8, 0.1, -0.4),
    )
}

for_each_backend! {
    fn a_mesh_file_gives_the_same_picture_anywhere_and_at_any_size(kind: BackendKind) {
        let rock = example::mesh(5_000, Surface::Rock);
        all_alike("a mesh", |scale, at| {
            let mut loaded = written("rock.obj", &obj(&rock, scale, at));
            let camera = loaded.scene.auto_camera(View::ThreeQuarter, &CameraOverrides::default(), 1.0);
            let camera = camera.expect("there is something to see");
            loaded.scene.light_from(&camera);
            picture(kind, &loaded, &camera)
        });
    }

    fn a_scene_file_gives_the_same_picture_anywhere_and_at_any_size(kind: BackendKind) {
        all_alike("a scene", |scale, at| {
            let loaded = written("scene.toml", &shapes(scale, at));
            picture(kind, &loaded, &loaded.cameras[0].camera)
        });
    }

    /// Not recentred: the rest of the scene holds the middle. Coordinates are then as coarse as f32 is there,
    /// 6e-4 sizes, and no more than that is lost.
    fn a_small_mesh_1e4_sizes_from_the_middle_of_its_scene(kind: BackendKind) {
        let rock = example::mesh(2_000, Surface::Rock);
        let picture = |at: DVec3| {
            let folder = tempfile::tempdir().expect("a folder");
            std::fs::write(folder.path().join("rock.obj"), obj(&rock, 1.0, DVec3::ZERO)).expect("a file in it");
            let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
            let rest = rest.map(|p| format!("[[object]]\nshape = 'sphere'\ncenter = {}\n", list(3e4 * ALONG + 4.0 * p)));
            let rest = if at == DVec3::ZERO { String::new() } else { rest.concat() };
            let text = format!(
                "tison = 1\n{rest}[[object]]\nmesh = 'rock.obj'\ntransform = [{{ translate = {} }}]\n",
                list(3e4 * ALONG - at)
            );
            let path = folder.path().join("scene.toml");
            std::fs::write(&path, text).expect("a file in it");
            let mut loaded = load(&path).expect("a scene");
            let center = 3e4 * ALONG - at;
            let camera = looking(center + DVec3::new(1.0, 0.8, 3.0), center, 40.0);
            let lamp = center + DVec3::new(3.0, 6.0, 5.0);
            loaded.scene.lights = vec![tison::scene::Light::constant(loaded.scene.frame.to_local(lamp), Vec3::ONE)];
            picture(kind, &loaded, &camera)
        };
        let off = rmse(&picture(1e4 * ALONG), &picture(DVec3::ZERO));
        assert!(off > 1e-4, "it was recentred: {off:e}");
        assert!(off < 2e-2, "RMSE {off:e}");
    }
}
