//! Meshes placed by a transform against the same meshes with their corners moved.

use crate::{Numbers, blob, build, device, grid, rays};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use std::sync::Arc;
use tison::embree::{Device, Error, Scene, SceneBuilder, SceneOptions, Width};
use tison::geom::{Coherence, Hit, PacketBatch, Plain, Ray, RayHitPacket, RayPacket, Sphere, TriangleMesh};

fn transforms() -> Vec<(&'static str, DAffine3)> {
    let turn = DMat3::from_rotation_x(0.7) * DMat3::from_rotation_z(1.1);
    let sheared = DMat3::from_cols(DVec3::X, DVec3::new(0.8, 1.0, 0.0), DVec3::new(-0.5, 0.3, 0.9));
    let stretched = turn * DMat3::from_diagonal(DVec3::new(1000.0, 1.0, 1.0));
    let mirrored = turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
    let moved = |m: DMat3, by: DVec3| DAffine3::from_mat3_translation(m, by);
    vec![
        ("as it is", DAffine3::IDENTITY),
        ("turned and moved", moved(turn, DVec3::new(0.5, -2.0, 0.25))),
        ("mirrored", moved(mirrored, DVec3::new(0.1, 0.2, 0.3))),
        ("sheared", moved(sheared, DVec3::Y)),
        ("stretched 1000:1", moved(stretched, DVec3::ONE)),
        ("shrunk", moved(1e-3 * turn, DVec3::ZERO)),
        ("far away", moved(turn, DVec3::new(1e5, -1e5, 3e4))),
    ]
}

fn placed(device: &Device, mesh: &Arc<TriangleMesh>) -> Arc<Scene> {
    let mut builder = SceneBuilder::new(device, SceneOptions::default()).unwrap();
    builder.mesh(mesh.clone()).unwrap();
    Arc::new(builder.commit(None).unwrap())
}

fn baked(mesh: &TriangleMesh, to_scene: &DAffine3) -> TriangleMesh {
    let points = mesh.padded_points().chunks_exact(3).take(mesh.vertex_count()).flat_map(|p| {
        to_scene.transform_point3(DVec3::new(p[0].into(), p[1].into(), p[2].into())).as_vec3().to_array()
    });
    TriangleMesh::new(points.collect(), mesh.faces().to_vec())
}

/// `ray` as the transform takes it along, of about unit length again.
fn along(ray: &Ray, to_scene: &DAffine3) -> Ray {
    let d = to_scene.transform_vector3(ray.d.as_dvec3());
    Ray::new(to_scene.transform_point3(ray.o.as_dvec3()).as_vec3(), d.normalize().as_vec3())
}

/// One instance, number 0 in its scene.
fn instance_of(mesh: &Arc<TriangleMesh>, to_scene: &DAffine3) -> Scene {
    let device = device();
    let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
    assert_eq!(builder.instance(placed(&device, mesh), to_scene).unwrap(), 0);
    builder.commit(None).unwrap()
}

#[test]
fn an_instance_is_hit_where_the_moved_mesh_is() {
    // Triangles of about half the size of the whole, for which f32 has digits enough wherever they are.
    let mesh = Arc::new(blob(4));
    for (what, to_scene) in transforms() {
        let (ours, theirs) =
            (instance_of(&mesh, &to_scene), build(&device(), baked(&mesh, &to_scene), Default::default()));
        let extent = to_scene.matrix3.col(0).length().max(to_scene.matrix3.col(1).length());
        let least = to_scene.matrix3.col(1).length().min(to_scene.matrix3.col(2).length());
        let (mut both, mut differ) = (0, 0);
        for ray in rays(1000).iter().map(|ray| along(ray, &to_scene)) {
            let (a, b) = (ours.intersect(&ray), theirs.intersect(&ray));
            assert_eq!(ours.occluded(&ray), a.is_some(), "{what}");
            let (Some(a), Some(b)) = (a, b) else {
                differ += i32::from(a.is_some() != b.is_some());
                continue;
            };
            assert_eq!(a.geom_id, 0, "{what}");
            if a.prim_id != b.prim_id {
                differ += 1;
                continue;
            }
            both += 1;
            // Coordinates and the inverse are rounded to f32; the thinnest side sees the most of it.
            let ulp = f32::EPSILON * (ray.o.abs().max_element() + extent as f32);
            let cos = a.ng.normalize().dot(ray.d).abs().max(1e-3);
            assert!((a.t - b.t).abs() < 64.0 * ulp / cos, "{what}: t is {} and not {}", a.t, b.t);
            let blunt = 32.0 * ulp / least as f32;
            assert!(a.ng.normalize().distance(b.ng.normalize()) < blunt + 1e-5, "{what}: {} and {}", a.ng, b.ng);
            assert!((a.ng.length() / b.ng.length() - 1.0).abs() < blunt + 1e-5, "{what}: {} and {}", a.ng, b.ng);
            assert!(
                (a.u - b.u).abs() < (blunt / cos).max(1e-4) && (a.v - b.v).abs() < (blunt / cos).max(1e-4),
                "{what}"
            );
        }
        assert!(both > 300, "{what}: {both} hits of 1000");
        // Where f32 has few digits left for the triangles, rays near their edges meet the neighbour.
        let coarse = ["far away", "stretched 1000:1"].contains(&what);
        assert!(differ <= if coarse { 40 } else { 2 }, "{what}: {differ} of 1000");
    }
}

fn check_packets<const N: usize>(scene: &Scene, rays: &[Ray], coherence: Coherence)
where
    RayPacket<N>: Width<N>,
{
    for chunk in rays.chunks(N) {
        let mut packet = RayHitPacket::<N>::EMPTY;
        // What was in the packet before must not matter.
        (packet.hit.geom_id, packet.hit.inst_id) = ([3; N], [1; N]);
        chunk.iter().enumerate().for_each(|(lane, ray)| packet.ray.set(lane, ray));
        let mut shadow = packet.ray.clone();
        scene.intersect_packet(&mut packet, chunk.len(), coherence);
        scene.occluded_packet(&mut shadow, chunk.len(), coherence);
        for (lane, ray) in chunk.iter().enumerate() {
            same(packet.hit(lane), scene.intersect(ray), &format!("width {N}, {coherence:?}, lane {lane}"));
            assert_eq!(shadow.is_occluded(lane), packet.hit(lane).is_some());
        }
        assert!((chunk.len()..N).all(|lane| packet.hit(lane).is_none()), "a dead lane");
    }
}

fn same(a: Option<Hit>, b: Option<Hit>, what: &str) {
    assert_eq!(a.map(|h| (h.geom_id, h.prim_id)), b.map(|h| (h.geom_id, h.prim_id)), "{what}");
    let Some((a, b)) = a.zip(b) else { return };
    assert!((a.t - b.t).abs() <= 1e-5 * b.t && (a.u - b.u).abs() < 1e-3 && (a.v - b.v).abs() < 1e-3, "{what}");
    assert!(a.ng.distance(b.ng) <= 1e-5 * b.ng.length(), "{what}: {} and {}", a.ng, b.ng);
}

/// A mesh, an instance, shapes, and another instance, each in its place.
fn mixed(device: &Device) -> Scene {
    let mut ball = Plain::default();
    (0..3).for_each(|i| {
        ball.push(Sphere::new(DVec3::new(-0.8, 0.8 * f64::from(i) - 0.8, 0.0), 0.3).unwrap());
    });
    let child = placed(device, &Arc::new(blob(12)));
    let at = |x, y| {
        DAffine3::from_scale_rotation_translation(DVec3::splat(0.4), glam::DQuat::IDENTITY, DVec3::new(x, y, 0.0))
    };
    let mut builder = SceneBuilder::new(device, SceneOptions::default()).unwrap();
    assert_eq!(builder.mesh(Arc::new(baked(&blob(9), &at(0.0, -0.7)))).unwrap(), 0);
    assert_eq!(builder.instance(child.clone(), &at(0.8, 0.7)).unwrap(), 1);
    assert_eq!(builder.shapes(Arc::new(ball)).unwrap(), 2);
    assert_eq!(builder.instance(child, &at(0.8, -0.7)).unwrap(), 3);
    builder.commit(None).unwrap()
}

#[test]
fn hits_name_the_object_in_every_width() {
    let scene = mixed(&device());
    let seen = |x: f32, y: f32| scene.intersect(&Ray::new(Vec3::new(x, y, 4.0), -Vec3::Z)).map(|hit| hit.geom_id);
    assert_eq!([seen(0.0, -0.7), seen(0.8, 0.7), seen(-0.8, 0.0), seen(0.8, -0.7)], [0, 1, 2, 3].map(Some));
    assert_eq!(seen(0.0, 0.7), None);

    let rays = rays(403);
    for id in 0..4 {
        let hits = rays.iter().filter(|ray| scene.intersect(ray).is_some_and(|hit| hit.geom_id == id)).count();
        assert!(hits > 15, "{hits} rays for object {id}");
    }
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        check_packets::<4>(&scene, &rays, coherence);
        check_packets::<8>(&scene, &rays, coherence);
        check_packets::<16>(&scene, &rays, coherence);
        let mut batch = PacketBatch::<RayHitPacket>::default();
        rays.iter().for_each(|ray| batch.push(ray));
        scene.intersect_batch(&mut batch, coherence);
        for (i, ray) in rays.iter().enumerate() {
            same(batch.packets()[i / 16].hit(i % 16), scene.intersect(ray), &format!("batch, {coherence:?}, ray {i}"));
        }
    }
}

#[test]
fn many_instances_share_one_tree() {
    let (device, mesh) = (device(), Arc::new(blob(60)));
    let child = placed(&device, &mesh);
    let tree = device.memory_live();
    let mut numbers = Numbers::new(3);
    let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
    for id in 0..1000 {
        let to_scene = DAffine3::from_scale_rotation_translation(
            DVec3::splat(0.02),
            glam::DQuat::from_rotation_y(f64::from(id)),
            numbers.point().as_dvec3(),
        );
        assert_eq!(builder.instance(child.clone(), &to_scene).unwrap(), id);
    }
    let scene = builder.commit(None).unwrap();
    let instances = device.memory_live() - tree;
    assert!(instances < tree, "a thousand instances of {tree} bytes take {instances} more");
    assert_eq!(Arc::strong_count(&mesh), 2, "stored once");
    let seen: std::collections::HashSet<_> =
        rays(2000).iter().filter_map(|r| Some(scene.intersect(r)?.geom_id)).collect();
    assert!(seen.len() > 100, "{} were seen", seen.len());
}

#[test]
fn a_child_lives_as_long_as_the_scenes_that_show_it() {
    let (device, mesh) = (device(), Arc::new(blob(12)));
    let child = placed(&device, &mesh);
    let show = |child: &Arc<Scene>| {
        let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
        builder.instance(child.clone(), &DAffine3::from_translation(DVec3::X)).unwrap();
        builder
    };
    let (first, second, never_built) =
        (show(&child).commit(None).unwrap(), show(&child).commit(None).unwrap(), show(&child));
    drop(child);
    drop(never_built);
    drop(first);
    assert_eq!(Arc::strong_count(&mesh), 2);
    let memory = device.clone();
    drop(device);
    assert!(second.intersect(&Ray::new(Vec3::new(1.0, 0.0, 5.0), -Vec3::Z)).is_some());
    drop(second);
    assert_eq!((Arc::strong_count(&mesh), memory.memory_live()), (1, 0));
}

#[test]
fn an_instance_of_nothing_is_never_hit() {
    let device = device();
    let hollow = placed(&device, &Arc::new(TriangleMesh::new(vec![], vec![])));
    let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
    builder.instance(hollow, &DAffine3::IDENTITY).unwrap();
    assert_eq!(builder.mesh(Arc::new(grid(2))).unwrap(), 1);
    let scene = builder.commit(None).unwrap();
    let hit = scene.intersect(&Ray::new(Vec3::new(0.3, 0.2, 5.0), -Vec3::Z)).unwrap();
    assert_eq!((hit.geom_id, hit.ng), (1, Vec3::Z), "and what is no instance stays as it is");
}

#[test]
fn what_cannot_be_placed_is_refused() {
    let device = device();
    let child = placed(&device, &Arc::new(blob(4)));
    let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let error = builder.instance(child.clone(), &flat).unwrap_err();
    assert!(matches!(error, Error::Transform) && error.to_string().contains("scale"), "{error}");
    let huge = DAffine3::from_translation(DVec3::new(1e39, 0.0, 0.0));
    assert!(matches!(builder.instance(child.clone(), &huge), Err(Error::Transform)));

    let empty = SceneBuilder::new(&device, SceneOptions::default()).unwrap().commit(None).unwrap();
    let mut nested = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
    nested.instance(child.clone(), &DAffine3::IDENTITY).unwrap();
    for (what, scene) in
        [("an empty scene", empty), ("a scene of an instance", nested.commit(None).unwrap()), ("all", mixed(&device))]
    {
        assert!(matches!(builder.instance(Arc::new(scene), &DAffine3::IDENTITY), Err(Error::NotOneMesh)), "{what}");
    }
    let foreign = placed(&crate::device(), &Arc::new(blob(4)));
    assert!(matches!(builder.instance(foreign, &DAffine3::IDENTITY), Err(Error::OtherDevice)));

    assert_eq!(builder.instance(child, &DAffine3::IDENTITY).unwrap(), 0, "nothing of that was added");
    assert!(builder.commit(None).unwrap().occluded(&Ray::new(5.0 * Vec3::X, -Vec3::X)));
}
