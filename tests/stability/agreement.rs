//! Both backends over the scenes of `scenes/`, 512 x 512 camera rays each.

use glam::DVec2;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use tison::backend::{AnyBackend, Backend, BackendKind};
use tison::bench::leaving::load;
use tison::bench::setup::build;
use tison::geom::{Hit, Ray, ShapeSet, triangle};
use tison::scene::{CameraDesc, CameraOverrides, Object, Scene, View};
use tison::with_shapes;

const SIDE: u32 = 512;
/// Rays that may see another thing, of 512 x 512: 1e-5 of them, and no fewer than one can tell.
const DIFFERENT: usize = 3;

fn scenes() -> Vec<PathBuf> {
    let files = std::fs::read_dir("scenes").expect("it is part of the project");
    let mut files: Vec<_> = files.map(|f| f.expect("it can be listed").path()).collect();
    files.retain(|f| f.is_file() && f.extension().is_some_and(|e| e != "mtl"));
    files.sort();
    files
}

fn view(path: &Path) -> (Scene, CameraDesc) {
    let loaded = load(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let camera = loaded.cameras.first().map(|c| c.camera).unwrap_or_else(|| {
        let camera = loaded.scene.auto_camera(View::ThreeQuarter, &CameraOverrides::default(), 1.0);
        camera.expect("there is something to see")
    });
    (loaded.scene, camera)
}

fn ids(hit: Option<&Hit>) -> Option<(u32, u32)> {
    hit.map(|h| (h.geom_id, h.prim_id))
}

/// Parameter of the hit after its refinement.
fn refined(scene: &Scene, ray: &Ray, hit: &Hit) -> f64 {
    let corners = |mesh: &tison::scene::Mesh| mesh.data.triangles.triangle(hit.prim_id);
    match &scene.objects[hit.geom_id as usize] {
        Object::Mesh(mesh) => triangle::refine(ray.o, ray.d, corners(mesh), (hit.u, hit.v)).t,
        Object::Instance(i) => {
            let placed = corners(&i.mesh).map(|p| i.to_scene.transform_point3(p.as_dvec3()).as_vec3());
            triangle::refine(ray.o, ray.d, placed, (hit.u, hit.v)).t
        }
        Object::Shapes(shapes) => with_shapes!(&shapes.set, set => {
            set.refine(hit.prim_id, ray.o.as_dvec3(), ray.d.as_dvec3(), f64::from(ray.t_near), f64::from(hit.t)).t
        }),
    }
}

/// Whether rays that pass two roundings of the coordinates beside this one see different things.
fn at_an_edge(backend: &dyn Backend, scene: &Scene, ray: &Ray) -> bool {
    let what = ids(backend.intersect(ray).as_ref());
    let reach = scene.local_bounds().size().length().max(ray.o.as_dvec3().length()) as f32;
    let x = ray.d.normalize().any_orthonormal_vector();
    let y = ray.d.normalize().cross(x);
    let beside = 4.0 * f32::EPSILON * reach;
    (0..16).map(|i| i as f32 * std::f32::consts::FRAC_PI_8).any(|a| {
        let moved = Ray { o: ray.o + beside * (a.cos() * x + a.sin() * y), ..*ray };
        ids(backend.intersect(&moved).as_ref()) != what
    })
}

/// Cosine of the angle between the ray and the surface's normal, as Embree has it.
fn cosine(scene: &Scene, ray: &Ray, hit: &Hit) -> f64 {
    let d = ray.d.as_dvec3().normalize();
    match &scene.objects[hit.geom_id as usize] {
        Object::Shapes(_) => 1.0,
        _ => d.dot(hit.ng.as_dvec3().normalize()).abs(),
    }
}

fn compare(path: &Path) -> usize {
    let (scene, camera) = view(path);
    let camera = camera.prepare(&scene.frame, (SIDE, SIDE)).expect("a good camera");
    let [embree, native] = [BackendKind::Embree, BackendKind::Native].map(|k| build(k, &scene).expect("a good scene"));
    let (embree, native): (&AnyBackend, &AnyBackend) = (&embree, &native);
    let row = |y: u32| {
        let (embree, native) = (embree.as_dyn(), native.as_dyn());
        let mut different = 0;
        for x in 0..SIDE {
            let (o, d) = camera.ray(f64::from(x) + 0.500_37, f64::from(y) + 0.500_61, DVec2::ZERO);
            let ray = Ray::new(o.as_vec3(), d.as_vec3());
            let (a, b) = (embree.intersect(&ray), native.intersect(&ray));
            let what = format!("{}, pixel {x},{y}: {a:?} and {b:?}; {ray:?}", path.display());
            let same = ids(a.as_ref()) == ids(b.as_ref());
            let fine = a.zip(b).map(|(a, b)| refined(&scene, &ray, &a) / refined(&scene, &ray, &b) - 1.0);
            // Surfaces that lie in each other are met at once.
            if !same && fine.is_none_or(|off| off.abs() > 1e-7) {
                assert!(at_an_edge(native, &scene, &ray), "{what}");
                different += 1;
            }
            let (true, Some(a), Some(b), Some(fine)) = (same, a, b, fine) else { continue };
            // t of a triangle loses digits as the ray grazes it.
            let raw = (f64::from(a.t) / f64::from(b.t) - 1.0).abs() * cosine(&scene, &ray, &a);
            assert!(raw < 4e-6, "raw t off by {raw:e}: {what}");
            assert!(fine.abs() < 1e-7, "refined t off by {fine:e}: {what}");
        }
        different
    };
    (0..SIDE).into_par_iter().map(row).sum()
}

/// Every fourth scene from `first` on.
fn quarter(first: usize) {
    for path in scenes().iter().skip(first).step_by(4) {
        let different = compare(path);
        assert!(different <= DIFFERENT, "{}: {different} pixels see another thing", path.display());
    }
}

#[test]
fn both_backends_see_the_same_in_every_scene_1_of_4() {
    quarter(0);
}

#[test]
fn both_backends_see_the_same_in_every_scene_2_of_4() {
    quarter(1);
}

#[test]
fn both_backends_see_the_same_in_every_scene_3_of_4() {
    quarter(2);
}

#[test]
fn both_backends_see_the_same_in_every_scene_4_of_4() {
    quarter(3);
}
