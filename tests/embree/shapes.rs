//! Every class of shapes against a loop over all of them, in every width.

use crate::{Numbers, blob, device, grid, rays};
use glam::{DAffine3, DMat3, DVec2, DVec3, Vec3};
use std::sync::Arc;
use tison::embree::{Device, DeviceConfig, Quality, Scene, SceneBuilder, SceneOptions, Width};
use tison::geom::{
    Affine, Coherence, Cube, Cylinder, Hit, PacketBatch, Plain, Quad, Ray, RayHitPacket, RayPacket, Shape, ShapeSet,
    Sphere,
};

fn scene<S: ShapeSet + 'static>(device: &Device, set: Arc<S>, quality: Quality) -> Scene {
    let mut builder = SceneBuilder::new(device, SceneOptions { quality, ..Default::default() }).unwrap();
    assert_eq!(builder.shapes(set).unwrap(), 0);
    builder.commit(None).unwrap()
}

const COUNT: u32 = 60;

fn plain<S: Shape>(count: u32, make: impl Fn(DVec3, f64) -> S) -> Plain<S> {
    let mut numbers = Numbers::new(11);
    let mut set = Plain::default();
    for _ in 0..count {
        set.push(make(numbers.point().as_dvec3(), 0.05 + 0.3 * f64::from(numbers.next())));
    }
    set
}

/// Turned, stretched, sheared, and about half of them mirrored.
fn placed<S: Shape>(shape: S) -> Affine<S> {
    let mut numbers = Numbers::new(12);
    let mut set = Affine::default();
    while ShapeSet::len(&set) < COUNT {
        let [x, y, z] = std::array::from_fn(|_| 0.3 * numbers.point().as_dvec3());
        let _ = set.push(shape, DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), numbers.point().as_dvec3()));
    }
    set
}

/// Nearest hit by trying every shape, in f64 up to the last step.
fn brute<S: ShapeSet>(set: &S, ray: &Ray) -> Option<Hit> {
    let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
    let hits = (0..set.len()).filter_map(|prim| {
        let t = set.hit(prim, o, d, f64::from(ray.t_near), f64::from(ray.t_far))?;
        Some((t, prim))
    });
    let (t, prim_id) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Hit { t: t as f32, u: 0.0, v: 0.0, ng: Vec3::ZERO, prim_id, geom_id: 0 })
}

fn check_packets<const N: usize>(scene: &Scene, rays: &[(Ray, Option<Hit>)], coherence: Coherence, what: &str)
where
    RayPacket<N>: Width<N>,
{
    for chunk in rays.chunks(N) {
        let mut packet = RayHitPacket::<N>::EMPTY;
        // What was in the packet before must not matter.
        packet.hit.geom_id = [3; N];
        packet.hit.ng_y = [9.0; N];
        packet.hit.u = [9.0; N];
        for lane in 0..N {
            packet.ray.set(lane, &chunk.get(lane).map_or(Ray::new(5.0 * Vec3::X, -Vec3::X), |r| r.0));
        }
        let mut shadow = packet.ray.clone();
        scene.intersect_packet(&mut packet, chunk.len(), coherence);
        scene.occluded_packet(&mut shadow, chunk.len(), coherence);
        for (lane, (ray, want)) in chunk.iter().enumerate() {
            assert_eq!(packet.hit(lane), *want, "{what}, width {N}, {coherence:?}, lane {lane}: {ray:?}");
            assert_eq!(shadow.is_occluded(lane), want.is_some(), "{what}, width {N}, {coherence:?}, lane {lane}");
        }
        for lane in chunk.len()..N {
            assert_eq!((packet.ray.t_far[lane], shadow.t_far[lane]), (f32::INFINITY, f32::INFINITY), "a dead lane");
        }
    }
}

fn check<S: ShapeSet + 'static>(what: &str, set: S) {
    let set = Arc::new(set);
    let mut numbers = Numbers::new(23);
    let limited = |(i, ray): (usize, Ray)| {
        let (near, far) = ([0.0, 0.4 * numbers.next()][i % 2], [f32::INFINITY, 2.0 * numbers.next()][i / 2 % 2]);
        Ray { t_near: near, t_far: far, ..ray }
    };
    let rays: Vec<_> = rays(403).into_iter().enumerate().map(limited).map(|ray| (ray, brute(&*set, &ray))).collect();
    let found = rays.iter().filter(|(_, hit)| hit.is_some()).count();
    assert!((60..360).contains(&found), "{what}: {found} of 403 hit: neither answer must be rare");
    for isa in [None, Some("avx2"), Some("sse4.2")] {
        let Ok(device) = Device::new(&DeviceConfig { threads: 2, isa, ..Default::default() }) else { continue };
        for quality in [Quality::Medium, Quality::Low] {
            let scene = scene(&device, set.clone(), quality);
            for (ray, want) in &rays {
                assert_eq!(scene.intersect(ray), *want, "{what}: {ray:?}");
                assert_eq!(scene.occluded(ray), want.is_some(), "{what}: {ray:?}");
            }
            for coherence in [Coherence::Coherent, Coherence::Incoherent] {
                check_packets::<4>(&scene, &rays, coherence, what);
                check_packets::<8>(&scene, &rays, coherence, what);
                check_packets::<16>(&scene, &rays, coherence, what);
                let mut batch = PacketBatch::<RayHitPacket>::default();
                let mut shadows = PacketBatch::<RayPacket>::default();
                rays.iter().for_each(|(ray, _)| (batch.push(ray), shadows.push(ray)).0);
                scene.intersect_batch(&mut batch, coherence);
                scene.occluded_batch(&mut shadows, coherence);
                for (i, (_, want)) in rays.iter().enumerate() {
                    assert_eq!(batch.packets()[i / 16].hit(i % 16), *want, "{what}, batch, {coherence:?}, ray {i}");
                    assert_eq!(shadows.packets()[i / 16].is_occluded(i % 16), want.is_some(), "{what}, ray {i}");
                }
            }
            scene.resume_panics();
        }
    }
}

#[test]
fn spheres_answer_as_a_loop_over_all_of_them() {
    check("spheres", plain(COUNT, |c, r| Sphere::new(c, r).unwrap()));
}

/// So many that incoherent packets go ray by ray.
#[test]
fn a_crowd_of_spheres_answers_as_a_loop_over_all_of_them() {
    check("a crowd", plain(1000, |c, r| Sphere::new(c, 0.2 * r).unwrap()));
}

#[test]
fn cubes_answer_as_a_loop_over_all_of_them() {
    check("cubes", plain(COUNT, |c, r| Cube::new(c, DVec3::new(r, 0.5 * r, 0.8 * r)).unwrap()));
}

#[test]
fn placed_spheres_answer_as_a_loop_over_all_of_them() {
    check("placed spheres", placed(Sphere::new(DVec3::ZERO, 1.0).unwrap()));
}

#[test]
fn placed_cubes_answer_as_a_loop_over_all_of_them() {
    check("placed cubes", placed(Cube::new(DVec3::ZERO, DVec3::ONE).unwrap()));
}

#[test]
fn cylinders_answer_as_a_loop_over_all_of_them() {
    check("tubes", placed(Cylinder::new(1.0, 2.0, false).unwrap()));
    check("cans", placed(Cylinder::new(1.0, 2.0, true).unwrap()));
}

#[test]
fn quads_answer_as_a_loop_over_all_of_them() {
    check("quads", placed(Quad::new(DVec2::new(1.0, 1.5)).unwrap()));
}

/// Packets as cameras make them: most lanes meet the same shape.
#[test]
fn coherent_packets_answer_as_a_loop_over_all_of_them() {
    let set = Arc::new(plain(COUNT, |c, r| Sphere::new(c, r).unwrap()));
    let scene = scene(&device(), set.clone(), Quality::Medium);
    let mut hits = 0;
    for block in 0..400 {
        let corner = Vec3::new((block % 20) as f32, (block / 20) as f32, 0.0) * 0.1 - 1.0;
        let rays: Vec<_> = (0..16)
            .map(|i| Ray::new(5.0 * Vec3::Z, corner + 0.025 * Vec3::new((i % 4) as f32, (i / 4) as f32, -160.0)))
            .map(|ray| (ray, brute(&*set, &ray)))
            .collect();
        hits += rays.iter().filter(|(_, hit)| hit.is_some()).count();
        check_packets::<4>(&scene, &rays, Coherence::Coherent, "camera");
        check_packets::<8>(&scene, &rays, Coherence::Coherent, "camera");
        check_packets::<16>(&scene, &rays, Coherence::Coherent, "camera");
    }
    assert!((1000..6000).contains(&hits), "{hits} of 6400");
}

#[test]
fn shapes_and_meshes_live_in_one_scene() {
    let mut ball = Plain::default();
    ball.push(Sphere::new(3.0 * DVec3::X, 0.5).unwrap());
    let mut builder = SceneBuilder::new(&device(), SceneOptions::default()).unwrap();
    assert_eq!(builder.mesh(Arc::new(blob(20))).unwrap(), 0);
    assert_eq!(builder.shapes(Arc::new(ball)).unwrap(), 1);
    assert_eq!(builder.mesh(Arc::new(grid(2))).unwrap(), 2);
    let scene = builder.commit(None).unwrap();
    let hit = scene.intersect(&Ray::new(6.0 * Vec3::X, -Vec3::X)).unwrap();
    assert_eq!((hit.geom_id, hit.prim_id, hit.t, hit.u, hit.v, hit.ng), (1, 0, 2.5, 0.0, 0.0, Vec3::ZERO));
    let hit = scene.intersect(&Ray { t_near: 3.6, ..Ray::new(6.0 * Vec3::X, -Vec3::X) }).unwrap();
    assert_eq!(hit.geom_id, 0, "beyond the sphere");
    let hit = scene.intersect(&Ray::new(Vec3::new(1.9, 1.8, -4.0), Vec3::Z)).unwrap();
    assert_eq!(hit.geom_id, 2);
}

#[test]
fn no_shapes_are_a_geometry_that_is_never_hit() {
    let device = device();
    let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
    assert_eq!(builder.shapes(Arc::new(Plain::<Sphere>::default())).unwrap(), 0);
    assert_eq!(builder.shapes(Arc::new(Affine::<Quad>::default())).unwrap(), 1);
    let scene = builder.commit(None).unwrap();
    for ray in rays(20) {
        assert_eq!(scene.intersect(&ray), None);
        assert!(!scene.occluded(&ray));
    }
}

#[test]
fn a_direction_of_any_length_meets_a_shape() {
    let mut ball = Plain::default();
    ball.push(Sphere::new(DVec3::ZERO, 1.0).unwrap());
    let scene = scene(&device(), Arc::new(ball), Quality::Medium);
    for scale in [1e-30f32, 1e-19, 1e-5, 1.0, 1e7, 1e20] {
        let ray = Ray::new(4.0 * Vec3::X, -scale * Vec3::X);
        let hit = scene.intersect(&ray).unwrap();
        assert!((hit.t * scale - 3.0).abs() < 1e-5, "{scale:e}: {}", hit.t * scale);
        assert!(scene.occluded(&ray));
        assert!(!scene.occluded(&Ray { t_far: 2.9 / scale, ..ray }));
    }
}
