//! The backend: scenes of all kinds of objects, whose places are their ids.

use crate::{blob, rays};
use glam::{DAffine3, DQuat, DVec2, DVec3, Vec3};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use tison::backend::embree::EmbreeBackend;
use tison::backend::{Backend, BuildOptions, Error};
use tison::geom::{Affine, Coherence, Cube, Cylinder, PacketBatch, Plain, Quad, Ray, RayHitPacket, Sphere};
use tison::scene::{AnyShapes, Instance, Mesh, MeshData, MeshPaint, Object, Scene, Shapes};

fn data(n: u32) -> Arc<MeshData> {
    Arc::new(MeshData { triangles: Arc::new(blob(n)), normals: None, uvs: None, face_materials: None })
}

fn mesh(data: &Arc<MeshData>) -> Mesh {
    Mesh { data: data.clone(), paint: MeshPaint::One(0), mirrored: false }
}

fn at(x: f64, y: f64) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(DVec3::splat(0.5), DQuat::IDENTITY, DVec3::new(x, y, 0.0))
}

fn instance(data: &Arc<MeshData>, to_scene: DAffine3) -> Object {
    Object::Instance(Instance::new(mesh(data), to_scene))
}

fn shapes(set: AnyShapes) -> Object {
    let materials = vec![0; set.len() as usize];
    Object::Shapes(Shapes { set, materials })
}

/// Two of it: one far behind, and one at `place`.
fn two<S: tison::geom::Shape>(shape: S, place: DAffine3) -> Arc<Affine<S>> {
    let mut set = Affine::default();
    set.push(shape, DAffine3::from_translation(DVec3::new(0.0, 0.0, -50.0)) * place).unwrap();
    set.push(shape, place).unwrap();
    Arc::new(set)
}

/// One object of each kind, three units apart along x.
fn one_of_each() -> Scene {
    let (shared, own) = (data(12), data(10));
    let (mut spheres, mut cubes) = (Plain::default(), Plain::default());
    for z in [-50.0, 0.0] {
        spheres.push(Sphere::new(DVec3::new(9.0, 0.0, z), 0.5).unwrap());
        cubes.push(Cube::new(DVec3::new(12.0, 0.0, z), DVec3::splat(0.5)).unwrap());
    }
    Scene::of(vec![
        Object::Mesh(mesh(&own)),
        instance(&shared, at(3.0, 0.0)),
        instance(&shared, at(6.0, 0.0)),
        shapes(AnyShapes::Spheres(Arc::new(spheres))),
        shapes(AnyShapes::Cubes(Arc::new(cubes))),
        shapes(AnyShapes::PlacedSpheres(two(Sphere::new(DVec3::ZERO, 1.0).unwrap(), at(15.0, 0.0)))),
        shapes(AnyShapes::PlacedCubes(two(Cube::new(DVec3::ZERO, DVec3::ONE).unwrap(), at(18.0, 0.0)))),
        shapes(AnyShapes::Cylinders(two(Cylinder::new(1.0, 2.0, true).unwrap(), at(21.0, 0.0)))),
        shapes(AnyShapes::Quads(two(Quad::new(DVec2::ONE).unwrap(), at(24.0, 0.0)))),
        Object::Mesh(mesh(&data(0))),
        instance(&shared, at(30.0, 0.0)),
    ])
}

fn options(cancel: &AtomicBool) -> BuildOptions<'_> {
    BuildOptions { threads: 2, rays_expected: 1_000_000, ..BuildOptions::new(cancel) }
}

#[test]
fn an_objects_place_is_its_id() {
    let scene = one_of_each();
    let backend = EmbreeBackend::build(&scene, &options(&AtomicBool::new(false))).unwrap();
    let mut batch = PacketBatch::<RayHitPacket>::default();
    for id in 0..scene.objects.len() as u32 {
        let ray = Ray::new(Vec3::new(3.0 * id as f32 + 0.01, 0.02, 20.0), -Vec3::Z);
        batch.push(&ray);
        let hit = backend.intersect(&ray);
        assert_eq!(hit.map(|hit| hit.geom_id), (id != 9).then_some(id), "object 9 has no triangles");
        assert_eq!(backend.occluded(&ray), id != 9);
        if let (Some(hit), Object::Shapes(_)) = (hit, &scene.objects[id as usize]) {
            assert_eq!((hit.prim_id, hit.ng, hit.u, hit.v), (1, Vec3::ZERO, 0.0, 0.0), "object {id}");
        }
    }
    backend.intersect_many(&mut batch, Coherence::Coherent);
    for id in 0..batch.len() {
        let hit = batch.packets()[id / 16].hit(id % 16);
        assert_eq!(hit.map(|hit| hit.geom_id), (id != 9).then_some(id as u32));
    }
}

#[test]
fn a_mesh_with_many_instances_is_built_once() {
    let build = |objects| EmbreeBackend::build(&Scene::of(objects), &options(&AtomicBool::new(false))).unwrap();
    let shared = data(60);
    let place = |i: u32| at(f64::from(i % 10), f64::from(i / 10));
    let (one, many) =
        (build(vec![instance(&shared, place(0))]), build((0..100).map(|i| instance(&shared, place(i))).collect()));
    assert!(many.bytes() < 2 * one.bytes(), "{} and {} bytes", many.bytes(), one.bytes());
    let two = build(vec![instance(&shared, place(0)), instance(&data(60), place(1))]);
    assert!(10 * two.bytes() > 19 * one.bytes(), "two meshes are two trees");
    let seen: std::collections::HashSet<_> =
        rays(4000).iter().filter_map(|ray| Some(many.intersect(&Ray { o: 5.0 * ray.o, ..*ray })?.geom_id)).collect();
    assert!(seen.len() > 20, "{} of them were hit", seen.len());
}

#[test]
fn few_rays_for_what_is_stored_get_a_quick_build() {
    let cancel = AtomicBool::new(false);
    let shared = data(20);
    let mut balls = Plain::default();
    (0..500).for_each(|i| {
        balls.push(Sphere::new(DVec3::X * f64::from(i), 0.1).unwrap());
    });
    let mut objects: Vec<_> = (0..100).map(|i| instance(&shared, at(f64::from(i), 0.0))).collect();
    objects.push(shapes(AnyShapes::Spheres(Arc::new(balls))));
    let scene = Scene::of(objects);
    // 1520 triangles, stored once, and 500 spheres.
    for (rays_expected, quick) in [(20_199, true), (20_200, false)] {
        let options = BuildOptions { rays_expected, ..options(&cancel) };
        assert_eq!(options.prefers_quick_build(&scene), quick, "{rays_expected} rays");
        let backend = EmbreeBackend::build(&scene, &options).unwrap();
        assert_eq!(backend.details().contains("low"), quick, "{}", backend.details());
        let hit = backend.intersect(&Ray::new(Vec3::new(7.0, 0.0, 9.0), -Vec3::Z)).unwrap();
        assert_eq!(hit.geom_id, 7);
    }
}

#[test]
fn the_progress_of_all_trees_is_one() {
    let scene = Scene::of(vec![
        instance(&data(70), at(0.0, 0.0)),
        instance(&data(90), at(2.0, 0.0)),
        Object::Mesh(mesh(&data(50))),
    ]);
    let (cancel, shares) = (AtomicBool::new(false), Mutex::new(vec![]));
    let note = |share| shares.lock().unwrap().push(share);
    EmbreeBackend::build(&scene, &BuildOptions { progress: Some(&note), ..options(&cancel) }).unwrap();
    let shares = shares.into_inner().unwrap();
    assert!(shares.iter().all(|share| (0.0..=1.0).contains(share)), "{shares:?}");
    let first = *shares.first().unwrap();
    assert!(first < 0.5 && shares.iter().any(|&share| share > 0.85), "{shares:?}");

    // While the second of three trees is built.
    let calls = AtomicU32::new(0);
    let stop = |share| {
        calls.fetch_add(1, Relaxed);
        cancel.store(share > 0.4, Relaxed);
    };
    let stopped = EmbreeBackend::build(&scene, &BuildOptions { progress: Some(&stop), ..options(&cancel) });
    assert!(matches!(stopped, Err(Error::Cancelled)), "{stopped:?}");
    assert!(calls.into_inner() > 0);
}

#[test]
fn a_transform_that_cannot_be_undone_is_an_error() {
    let flat = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0));
    let scene = Scene::of(vec![Object::Mesh(mesh(&data(4))), instance(&data(4), flat)]);
    let error = EmbreeBackend::build(&scene, &options(&AtomicBool::new(false))).unwrap_err();
    assert!(error.to_string().contains("cannot be undone"), "{error}");
}
