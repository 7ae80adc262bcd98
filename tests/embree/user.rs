//! The seam for shapes written in Rust: every width, bad answers, panics.

use crate::{OneByOne, Set, device, panic_of};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use tison::embree::{PrimSet, Scene, SceneBuilder, SceneOptions};
use tison::geom::{Bounds, Coherence, Lanes, PacketBatch, Ray, RayHitPacket, RayPacket};

fn scene<S: OneByOne>(set: S) -> Scene {
    let mut builder = SceneBuilder::new(&device(), SceneOptions::default()).unwrap();
    builder.shapes(Arc::new(Set(set))).unwrap();
    builder.commit(None).unwrap()
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
    fn hit_lanes<const N: usize>(&self, prim: u32, rays: &Lanes<'_, f32, N>) -> Option<[f64; N]> {
        self.widths[N].fetch_add(1, Relaxed);
        let mut t = [0.0; N];
        for (i, t) in t.iter_mut().enumerate() {
            // Also for lanes that are not active: the wrapper drops those.
            *t = f64::from((prim as f32 - rays.o[2][i]) / rays.d[2][i]);
            if !(*t > f64::from(rays.t_near[i]) && *t < f64::from(rays.t_far[i])) {
                *t = f64::INFINITY;
            }
        }
        Some(t)
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

impl OneByOne for Ghosts {
    fn len(&self) -> u32 {
        4
    }
    fn bounds(&self, prim: u32) -> Bounds {
        let lo = DVec3::new([f64::NAN, 2.0, -1.0, f64::INFINITY][prim as usize], -1.0, -1.0);
        Bounds { lo, hi: DVec3::ONE }
    }
    fn hit(&self, prim: u32, ray: &Ray) -> Option<f64> {
        assert_eq!(prim, 2, "a ghost was asked");
        Some(if ray.o.y == 0.0 { 1.0 } else { f64::NAN })
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
    impl OneByOne for Floor {
        fn len(&self) -> u32 {
            1
        }
        fn bounds(&self, _: u32) -> Bounds {
            let endless = DVec3::new(f64::INFINITY, f64::INFINITY, 0.0);
            Bounds { lo: -endless, hi: endless }
        }
        fn hit(&self, _: u32, ray: &Ray) -> Option<f64> {
            Some(f64::from(-ray.o.z / ray.d.z))
        }
    }
    let scene = scene(Floor);
    let hit = scene.intersect(&Ray::new(Vec3::new(1e6, -1e5, 3.0), Vec3::new(0.5, 0.2, -1.0))).unwrap();
    assert_eq!(hit.t, 3.0);
}

/// Panics where it is told to.
struct Bomb {
    in_bounds: bool,
    asked: Arc<AtomicU32>,
}

impl OneByOne for Bomb {
    fn len(&self) -> u32 {
        2
    }
    fn bounds(&self, prim: u32) -> Bounds {
        assert!(!self.in_bounds, "no box");
        Bounds { lo: DVec3::splat(-1.0 - f64::from(prim)), hi: DVec3::ONE }
    }
    fn hit(&self, _: u32, _: &Ray) -> Option<f64> {
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
    builder.shapes(Arc::new(Set(Bomb { in_bounds: true, asked: Arc::default() }))).unwrap();
    assert_eq!(panic_of(|| drop(builder.commit(None))), "no box");
    assert_eq!(device.memory_live(), 0);
    let mut builder = SceneBuilder::new(&device, SceneOptions::default()).unwrap();
    builder.shapes(Arc::new(Set(Ghosts))).unwrap();
    builder.commit(None).expect("the device is as it was");
}
