//! Shapes written in Rust, met by rays of every width, and their panics.

use crate::{Spheres, blob, device, grid, panic_of, rays};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use tison::embree::{PrimHit, PrimHits, PrimSet, RayLanes, Scene, SceneBuilder, SceneOptions, Width};
use tison::geom::{Bounds, Coherence, Hit, PacketBatch, Ray, RayHitPacket, RayPacket};

fn scene<S: PrimSet>(set: S) -> Scene {
    let mut builder = SceneBuilder::new(&device(), SceneOptions::default()).unwrap();
    builder.shapes(Arc::new(set)).unwrap();
    builder.commit(None).unwrap()
}

fn balls() -> Spheres {
    let mut numbers = crate::Numbers(11);
    Spheres((0..60).map(|_| (numbers.point().as_dvec3(), 0.05 + 0.3 * f64::from(numbers.next()))).collect())
}

/// Nearest hit by trying every sphere.
fn brute(set: &Spheres, ray: &Ray) -> Option<(u32, PrimHit)> {
    let hits = (0..set.len()).filter_map(|prim| set.hit(prim, ray).map(|hit| (prim, hit)));
    hits.filter(|(_, hit)| hit.t < ray.t_far).min_by(|a, b| a.1.t.total_cmp(&b.1.t))
}

fn agrees(got: Option<Hit>, want: Option<(u32, PrimHit)>, geom_id: u32, what: &str) {
    let got = got.map(|hit| {
        assert_eq!(hit.geom_id, geom_id, "{what}");
        (hit.prim_id, PrimHit { t: hit.t, u: hit.u, v: hit.v, ng: hit.ng })
    });
    assert_eq!(got, want, "{what}");
}

fn check_packets<const N: usize>(scene: &Scene, set: &Spheres, rays: &[Ray], coherence: Coherence)
where
    RayPacket<N>: Width<N>,
{
    for chunk in rays.chunks(N) {
        let mut packet = RayHitPacket::<N>::EMPTY;
        for (lane, ray) in chunk.iter().enumerate() {
            packet.ray.set(lane, ray);
        }
        let mut shadow = packet.ray.clone();
        scene.intersect_packet(&mut packet, chunk.len(), coherence);
        scene.occluded_packet(&mut shadow, chunk.len(), coherence);
        for (lane, ray) in chunk.iter().enumerate() {
            let want = brute(set, ray);
            agrees(packet.hit(lane), want, 0, &format!("width {N}, {coherence:?}, lane {lane}"));
            assert_eq!(shadow.is_occluded(lane), want.is_some());
        }
    }
}

#[test]
fn spheres_are_hit_and_throw_shadows_in_every_width() {
    let (scene, set) = (scene(balls()), balls());
    let rays = rays(203);
    assert!(rays.iter().filter(|ray| brute(&set, ray).is_some()).count() > 60);
    for ray in &rays {
        let want = brute(&set, ray);
        agrees(scene.intersect(ray), want, 0, "single");
        assert_eq!(scene.occluded(ray), want.is_some());
    }
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        check_packets::<4>(&scene, &set, &rays, coherence);
        check_packets::<8>(&scene, &set, &rays, coherence);
        check_packets::<16>(&scene, &set, &rays, coherence);
        let mut batch = PacketBatch::<RayHitPacket>::default();
        rays.iter().for_each(|ray| batch.push(ray));
        let mut shadows = PacketBatch::<RayPacket>::default();
        rays.iter().for_each(|ray| shadows.push(ray));
        scene.intersect_batch(&mut batch, coherence);
        scene.occluded_batch(&mut shadows, coherence);
        for (i, ray) in rays.iter().enumerate() {
            let want = brute(&set, ray);
            agrees(batch.packets()[i / 16].hit(i % 16), want, 0, &format!("batch, {coherence:?}, ray {i}"));
            assert_eq!(shadows.packets()[i / 16].is_occluded(i % 16), want.is_some());
        }
    }
    scene.resume_panics();
}

#[test]
fn shapes_and_meshes_live_in_one_scene() {
    let mut builder = SceneBuilder::new(&device(), SceneOptions::default()).unwrap();
    assert_eq!(builder.mesh(Arc::new(blob(20))).unwrap(), 0);
    assert_eq!(builder.shapes(Arc::new(Spheres(vec![(3.0 * DVec3::X, 0.5)]))).unwrap(), 1);
    assert_eq!(builder.mesh(Arc::new(grid(2))).unwrap(), 2);
    let scene = builder.commit(None).unwrap();
    let hit = scene.intersect(&Ray::new(6.0 * Vec3::X, -Vec3::X)).unwrap();
    assert_eq!((hit.geom_id, hit.prim_id, hit.t, hit.u, hit.v, hit.ng), (1, 0, 2.5, 0.25, 0.5, Vec3::X));
    let hit = scene.intersect(&Ray { t_near: 3.6, ..Ray::new(6.0 * Vec3::X, -Vec3::X) }).unwrap();
    assert_eq!(hit.geom_id, 0, "beyond the sphere");
    let hit = scene.intersect(&Ray::new(Vec3::new(1.9, 1.8, -4.0), Vec3::Z)).unwrap();
    assert_eq!(hit.geom_id, 2);
}

/// A set written for all lanes at once: planes `z = prim`, as large as their box.
struct Planes {
    widths: [AtomicU32; 17],
}

impl PrimSet for Planes {
    fn len(&self) -> u32 {
        3
    }
    fn bounds(&self, prim: u32) -> Bounds {
        let z = f64::from(prim);
        Bounds { lo: DVec3::new(-2.0, -2.0, z), hi: DVec3::new(2.0, 2.0, z) }
    }
    fn hit(&self, _: u32, _: &Ray) -> Option<PrimHit> {
        unreachable!("the form for many lanes is there")
    }
    fn hit_lanes<const N: usize>(&self, prim: u32, rays: &RayLanes<N>, _: &[i32; N], hits: &mut PrimHits<N>) {
        self.widths[N].fetch_add(1, Relaxed);
        for i in 0..N {
            // Also for lanes that are not active, or whose hit is behind them: the wrapper drops those.
            hits.t[i] = (prim as f32 - rays.o_z[i]) / rays.d_z[i];
            hits.u[i] = rays.o_x[i] + hits.t[i] * rays.d_x[i];
            hits.ng_z[i] = 1.0;
        }
    }
}

#[test]
fn a_set_may_answer_for_all_lanes_at_once() {
    let set = Arc::new(Planes { widths: [const { AtomicU32::new(0) }; 17] });
    let mut builder = SceneBuilder::new(&device(), SceneOptions::default()).unwrap();
    builder.shapes(set.clone()).unwrap();
    let scene = builder.commit(None).unwrap();
    let mut batch = PacketBatch::<RayHitPacket>::default();
    let mut shadows = PacketBatch::<RayPacket>::default();
    for lane in 0..13 {
        let z = if lane % 2 == 0 { 5.0 } else { 0.5 };
        let t_far = if lane == 2 { 2.5 } else { f32::INFINITY };
        let ray = Ray { t_far, ..Ray::new(Vec3::new(0.1 * lane as f32, 0.3, z), -Vec3::Z) };
        batch.push(&ray);
        shadows.push(&ray);
    }
    // In as many packets as the processor takes, so that some lanes of the last one are not active.
    scene.intersect_batch(&mut batch, Coherence::Coherent);
    scene.occluded_batch(&mut shadows, Coherence::Coherent);
    let (packet, shadow) = (&batch.packets()[0], &shadows.packets()[0]);
    for lane in 0..16 {
        let want = match lane {
            2 | 13.. => None,
            _ if lane % 2 == 0 => Some((2, 3.0)),
            _ => Some((0, 0.5)),
        };
        assert_eq!(packet.hit(lane).map(|hit| (hit.prim_id, hit.t)), want, "lane {lane}");
        assert_eq!(shadow.t_far[lane] == f32::NEG_INFINITY, want.is_some() || lane >= 13, "lane {lane}");
        if want.is_some() {
            assert_eq!((packet.hit.u[lane], packet.hit.ng_z[lane]), (0.1 * lane as f32, 1.0));
        }
    }
    let mut packet = packet.clone();
    packet.ray.t_far = [f32::INFINITY; 16];
    scene.intersect_packet(&mut packet, 7, Coherence::Coherent);
    assert!((0..13).all(|lane| packet.hit(lane).is_some() == (lane < 7)), "only live lanes are answered");
    assert!(packet.ray.t_far[7..].iter().all(|&t| t == f32::INFINITY), "only live lanes are written");
    assert_eq!(scene.intersect(&Ray::new(Vec3::splat(9.0), -Vec3::Z)), None, "past the box");
    assert!(scene.intersect(&Ray::new(Vec3::Z * 1.5, -Vec3::Z)).is_some());
    assert!(set.widths[1].load(Relaxed) > 0);
    assert!(set.widths[2..].iter().any(|n| n.load(Relaxed) > 0), "packets came as packets");
    scene.resume_panics();
}

/// Boxes that are none next to one that is.
struct Ghosts;

impl PrimSet for Ghosts {
    fn len(&self) -> u32 {
        4
    }
    fn bounds(&self, prim: u32) -> Bounds {
        let lo = DVec3::new([f64::NAN, 2.0, -1.0, f64::INFINITY][prim as usize], -1.0, -1.0);
        Bounds { lo, hi: DVec3::ONE }
    }
    fn hit(&self, prim: u32, ray: &Ray) -> Option<PrimHit> {
        assert_eq!(prim, 2, "a ghost was asked");
        Some(PrimHit { t: if ray.o.y == 0.0 { 1.0 } else { f32::NAN }, u: 0.0, v: 0.0, ng: Vec3::X })
    }
}

#[test]
fn shapes_without_a_box_and_answers_that_are_no_numbers_are_misses() {
    let scene = scene(Ghosts);
    let hit = scene.intersect(&Ray::new(3.0 * Vec3::X, -Vec3::X)).unwrap();
    assert_eq!((hit.prim_id, hit.t), (2, 1.0));
    assert_eq!(scene.intersect(&Ray::new(Vec3::new(3.0, 0.5, 0.0), -Vec3::X)), None);
    assert!(!scene.occluded(&Ray::new(Vec3::new(3.0, 0.5, 0.0), -Vec3::X)));
    scene.resume_panics();
}

#[test]
fn an_endless_box_is_traced_too() {
    struct Floor;
    impl PrimSet for Floor {
        fn len(&self) -> u32 {
            1
        }
        fn bounds(&self, _: u32) -> Bounds {
            let endless = DVec3::new(f64::INFINITY, f64::INFINITY, 0.0);
            Bounds { lo: -endless, hi: endless }
        }
        fn hit(&self, _: u32, ray: &Ray) -> Option<PrimHit> {
            Some(PrimHit { t: -ray.o.z / ray.d.z, u: 0.0, v: 0.0, ng: Vec3::Z })
        }
    }
    let scene = scene(Floor);
    let hit = scene.intersect(&Ray::new(Vec3::new(1e6, -1e5, 3.0), Vec3::new(0.5, 0.2, -1.0))).unwrap();
    assert_eq!(hit.t, 3.0);
}

#[test]
fn a_direction_of_any_length_meets_a_shape() {
    let scene = scene(Spheres(vec![(DVec3::ZERO, 1.0)]));
    for scale in [1e-30f32, 1e-19, 1e-5, 1.0, 1e7, 1e20] {
        let ray = Ray::new(4.0 * Vec3::X, -scale * Vec3::X);
        let hit = scene.intersect(&ray).unwrap();
        assert!((hit.t * scale - 3.0).abs() < 1e-5, "{scale:e}: {}", hit.t * scale);
        assert!(scene.occluded(&ray));
        assert!(!scene.occluded(&Ray { t_far: 2.9 / scale, ..ray }));
    }
}

/// Panics where it is told to.
struct Bomb {
    in_bounds: bool,
    asked: Arc<AtomicU32>,
}

impl PrimSet for Bomb {
    fn len(&self) -> u32 {
        2
    }
    fn bounds(&self, prim: u32) -> Bounds {
        assert!(!self.in_bounds, "no box");
        Bounds { lo: DVec3::splat(-1.0 - f64::from(prim)), hi: DVec3::ONE }
    }
    fn hit(&self, _: u32, _: &Ray) -> Option<PrimHit> {
        self.asked.fetch_add(1, Relaxed);
        panic!("broken shape")
    }
}

#[test]
fn a_panic_in_hit_is_a_miss_and_is_raised_again() {
    let asked = Arc::new(AtomicU32::new(0));
    let scene = scene(Bomb { in_bounds: false, asked: asked.clone() });
    scene.resume_panics();
    let ray = Ray::new(5.0 * Vec3::X, -Vec3::X);
    assert_eq!(scene.intersect(&ray), None);
    assert!(!scene.occluded(&ray));
    let mut packet = RayPacket::<16>::EMPTY;
    (0..16).for_each(|lane| packet.set(lane, &ray));
    scene.occluded_packet(&mut packet, 16, Coherence::Coherent);
    assert_eq!(asked.load(Relaxed), 1, "after the first panic no shape is asked");
    assert_eq!(panic_of(|| scene.resume_panics()), "broken shape");
    assert!(panic_of(|| scene.resume_panics()).contains("has panicked before"));
}

#[test]
fn of_panics_on_many_threads_one_is_kept() {
    let scene = scene(Bomb { in_bounds: false, asked: Arc::default() });
    let found = (0..200).into_par_iter().filter(|_| scene.occluded(&Ray::new(5.0 * Vec3::X, -Vec3::X))).count();
    assert_eq!(found, 0);
    assert_eq!(panic_of(|| scene.resume_panics()), "broken shape");
}

#[test]
fn a_panic_in_bounds_comes_out_of_commit() {
    let device = device();
    let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
    builder.shapes(Arc::new(Bomb { in_bounds: true, asked: Arc::default() })).unwrap();
    assert_eq!(panic_of(|| drop(builder.commit(None))), "no box");
    assert_eq!(device.memory_live(), 0);
    let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
    builder.shapes(Arc::new(balls())).unwrap();
    builder.commit(None).expect("the device is as it was");
}
