//! One answer per ray, whatever the width, the flags, the options, the threads or the length of its direction.

use crate::{Numbers, blob, build, device, rays};
use glam::Vec3;
use rayon::prelude::*;
use tison::embree::{Device, DeviceConfig, Quality, Scene, SceneOptions, Width};
use tison::geom::{Coherence, Hit, INVALID_ID, PacketBatch, Ray, RayHitPacket, RayPacket};

pub const QUALITIES: [Quality; 3] = [Quality::Low, Quality::Medium, Quality::High];
const BOTH: [Coherence; 2] = [Coherence::Coherent, Coherence::Incoherent];

/// The same primitive, and `t` equal but for rounding.
fn same(a: Option<Hit>, b: Option<Hit>, what: &str) {
    match (a, b) {
        (None, None) => {}
        (Some(a), Some(b)) => {
            assert_eq!((a.geom_id, a.prim_id), (b.geom_id, b.prim_id), "{what}");
            assert!((a.t - b.t).abs() <= 1e-6 * b.t, "{what}: {} and {}", a.t, b.t);
            assert!((a.u - b.u).abs() <= 1e-4 && (a.v - b.v).abs() <= 1e-4, "{what}: {a:?} and {b:?}");
            assert_eq!(a.ng, b.ng, "{what}");
        }
        _ => panic!("{what}: {a:?} and {b:?}"),
    }
}

/// Packets of `N`, the last one partly filled and its dead lanes nasty, against single rays.
fn check_packets<const N: usize>(scene: &Scene, rays: &[Ray], coherence: Coherence)
where
    RayPacket<N>: Width<N>,
{
    for chunk in rays.chunks(N) {
        let mut packet = RayHitPacket::<N>::EMPTY;
        // What was in the packet before must not matter.
        packet.hit.geom_id = [3; N];
        for (lane, ray) in chunk.iter().enumerate() {
            packet.ray.set(lane, ray);
        }
        for lane in chunk.len()..N {
            packet.ray.set(lane, &Ray::new(5.0 * Vec3::X, -Vec3::X));
        }
        let mut shadow = packet.ray.clone();
        scene.intersect_packet(&mut packet, chunk.len(), coherence);
        scene.occluded_packet(&mut shadow, chunk.len(), coherence);
        for (lane, ray) in chunk.iter().enumerate() {
            let want = scene.intersect(ray);
            same(packet.hit(lane), want, &format!("width {N}, {coherence:?}, lane {lane}"));
            assert_eq!(shadow.is_occluded(lane), want.is_some());
            assert_eq!(packet.hit(lane).is_none(), packet.ray.t_far[lane] == ray.t_far);
        }
        for lane in chunk.len()..N {
            assert_eq!(packet.ray.t_far[lane], f32::INFINITY, "a dead lane was traced");
            assert_eq!(shadow.t_far[lane], f32::INFINITY, "a dead lane was traced");
        }
    }
}

fn check_batches(scene: &Scene, rays: &[Ray], coherence: Coherence) {
    for len in [rays.len(), 33, 17, 16, 15, 1, 0] {
        let mut hits = PacketBatch::<RayHitPacket>::default();
        let mut shadows = PacketBatch::<RayPacket>::default();
        for ray in &rays[..len] {
            hits.push(ray);
            shadows.push(ray);
        }
        scene.intersect_batch(&mut hits, coherence);
        scene.occluded_batch(&mut shadows, coherence);
        for (i, ray) in rays[..len].iter().enumerate() {
            let want = scene.intersect(ray);
            same(hits.packets()[i / 16].hit(i % 16), want, &format!("batch of {len}, {coherence:?}, ray {i}"));
            assert_eq!(shadows.packets()[i / 16].is_occluded(i % 16), want.is_some());
        }
    }
}

#[test]
fn every_width_and_instruction_set_answers_as_single_rays_do() {
    let rays = rays(203);
    let mut widths = Vec::new();
    for isa in [None, Some("avx2"), Some("avx"), Some("sse4.2"), Some("sse2")] {
        // A processor without it gives an error, which the first test row cannot.
        let Ok(device) = Device::new(&DeviceConfig { threads: 1, isa, ..Default::default() }) else {
            assert!(isa.is_some_and(|isa| isa.starts_with("avx")), "{isa:?}");
            continue;
        };
        widths.push(device.packet_width());
        let scene = build(&device, blob(24), SceneOptions::default());
        let found = rays.iter().filter(|ray| scene.intersect(ray).is_some()).count();
        assert!((60..190).contains(&found), "{found} of 203 hit: neither answer must be rare");
        for coherence in BOTH {
            check_packets::<4>(&scene, &rays, coherence);
            check_packets::<8>(&scene, &rays, coherence);
            check_packets::<16>(&scene, &rays, coherence);
            check_batches(&scene, &rays, coherence);
        }
    }
    assert_eq!(widths.last(), Some(&4), "the narrow way of a batch was taken too: {widths:?}");
}

#[test]
fn options_change_how_fast_but_not_what_is_hit() {
    let device = device();
    let rays = rays(500);
    let reference = build(&device, blob(40), SceneOptions::default());
    for quality in QUALITIES {
        for robust in [false, true] {
            for compact in [false, true] {
                let options = SceneOptions { quality, robust, compact };
                let scene = build(&device, blob(40), options);
                for ray in &rays {
                    let (a, b) = (scene.intersect(ray), reference.intersect(ray));
                    assert_eq!(a.map(|h| h.prim_id), b.map(|h| h.prim_id), "{options:?}");
                    assert_eq!(scene.occluded(ray), b.is_some());
                    let dt = a.zip(b).map_or(0.0, |(a, b)| (a.t - b.t).abs() / b.t);
                    assert!(dt < 1e-5, "{options:?}: t is off by {dt:e}");
                }
            }
        }
    }
}

#[test]
fn quality_and_compactness_show_in_the_size_of_the_tree() {
    let size = |options| {
        let device = device();
        let scene = build(&device, blob(60), options);
        let size = scene.device().memory_live() as f64;
        drop(scene);
        size
    };
    let medium = size(SceneOptions::default());
    let low = size(SceneOptions { quality: Quality::Low, ..Default::default() });
    // Set on the scene alone, low quality would build the very tree that medium quality does.
    assert!(low > 1.2 * medium, "{low} and {medium}");
    let compact = size(SceneOptions { compact: true, ..Default::default() });
    assert!(compact < 0.7 * medium, "{compact} and {medium}");
}

#[test]
fn a_robust_scene_lets_no_ray_through_at_an_edge() {
    let (mesh, device) = (blob(40), device());
    let mut numbers = Numbers::new(5);
    let edge_rays: Vec<_> = (0..3000)
        .map(|i| {
            let [a, b, _] = mesh.triangle((i * 7919 % mesh.face_count()) as u32);
            Ray::new(Vec3::ZERO, a.lerp(b, 0.1 + 0.8 * numbers.next()))
        })
        .collect();
    let misses = |robust| {
        let scene = build(&device, blob(40), SceneOptions { robust, ..Default::default() });
        edge_rays.iter().filter(|ray| scene.intersect(ray).is_none()).count()
    };
    assert_eq!(misses(true), 0);
    assert!(misses(false) > 0, "the rays do not tell one from the other");
}

#[test]
fn a_scaled_direction_gives_the_same_hit_with_t_scaled_back() {
    let scene = build(&device(), blob(24), SceneOptions::default());
    let rays = rays(64);
    for power in (-120..=66).step_by(3) {
        let scale = 2f32.powi(power);
        let mut packet = RayHitPacket::<16>::EMPTY;
        for (i, ray) in rays.iter().enumerate() {
            let scaled = Ray { d: scale * ray.d, ..*ray };
            let (want, got) = (scene.intersect(ray), scene.intersect(&scaled));
            // Some are scaled and some are not, so that the last bit of `t` may differ.
            let in_units = |h: Hit| Hit { t: (f64::from(h.t) * 2f64.powi(power)) as f32, ..h };
            same(got.map(in_units), want, &format!("2^{power}"));
            assert_eq!(scene.occluded(&scaled), want.is_some(), "2^{power}");

            packet.ray.set(i % 16, &scaled);
            if i % 16 == 15 {
                let mut shadow = packet.ray.clone();
                scene.intersect_packet(&mut packet, 16, Coherence::Coherent);
                scene.occluded_packet(&mut shadow, 16, Coherence::Coherent);
                for lane in 0..16 {
                    let want = scene.intersect(&rays[i - 15 + lane]);
                    same(packet.hit(lane).map(in_units), want, &format!("2^{power}, lane {lane}"));
                    assert_eq!(shadow.is_occluded(lane), want.is_some());
                    assert_eq!(packet.ray.d_x[lane], scale * rays[i - 15 + lane].d.x, "the question is kept");
                }
            }
        }
    }
}

#[test]
fn lengths_that_are_no_power_of_two_and_intervals_scale_too() {
    let scene = build(&device(), blob(24), SceneOptions::default());
    for scale in [1e-30f32, 1e-25, 1e-19, 3e-17, 1e-12, 1e-7, 1.0, 1e6, 1e13, 1e20] {
        for ray in rays(64) {
            let want = scene.intersect(&ray);
            let d = scale * ray.d;
            let got = scene.intersect(&Ray { d, ..ray });
            assert_eq!(got.map(|h| h.prim_id), want.map(|h| h.prim_id), "{scale:e}");
            let Some((got, want)) = got.zip(want) else { continue };
            assert!((got.t * scale / want.t - 1.0).abs() < 1e-5, "{scale:e}: {} and {}", got.t * scale, want.t);
            let (before, after) = (0.999 * got.t, 1.001 * got.t);
            assert!(!scene.occluded(&Ray { d, t_far: before, ..ray }), "{scale:e}: ends before the hit");
            assert!(scene.occluded(&Ray { d, t_far: after, ..ray }), "{scale:e}: ends after it");
            let next = scene.intersect(&Ray { d, t_near: after, ..ray });
            assert!(next.is_none_or(|next| next.t > after), "{scale:e}: starts after it");
        }
    }
}

#[test]
fn rays_that_cannot_hit_miss_and_leave_their_neighbours_alone() {
    let scene = build(&device(), blob(24), SceneOptions::default());
    let ray = |o, d| Ray { o, d, t_near: 0.0, t_far: f32::INFINITY };
    let nasty = [
        ray(5.0 * Vec3::X, Vec3::ZERO),
        ray(5.0 * Vec3::X, Vec3::new(-1.0, f32::NAN, 0.0)),
        ray(5.0 * Vec3::X, Vec3::new(f32::NEG_INFINITY, 0.0, 0.0)),
        ray(Vec3::new(f32::NAN, 0.0, 0.0), -Vec3::X),
        ray(Vec3::new(f32::INFINITY, 0.0, 0.0), -Vec3::X),
        Ray { t_near: 9.0, t_far: 1.0, ..ray(5.0 * Vec3::X, -Vec3::X) },
        Ray { t_near: f32::NAN, ..ray(5.0 * Vec3::X, -Vec3::X) },
        Ray { t_far: f32::NAN, ..ray(5.0 * Vec3::X, -Vec3::X) },
    ];
    let honest = ray(Vec3::new(5.0, 0.1, 0.2), -Vec3::X);
    let want = scene.intersect(&honest);
    assert!(want.is_some());
    for (i, bad) in nasty.iter().enumerate() {
        assert_eq!(scene.intersect(bad), None, "case {i}");
        assert!(!scene.occluded(bad), "case {i}");
        for coherence in BOTH {
            let mut packet = RayHitPacket::<16>::EMPTY;
            for lane in 0..16 {
                packet.ray.set(lane, if lane == 6 { bad } else { &honest });
            }
            let mut shadow = packet.ray.clone();
            scene.intersect_packet(&mut packet, 16, coherence);
            scene.occluded_packet(&mut shadow, 16, coherence);
            for lane in 0..16 {
                same(packet.hit(lane), want.filter(|_| lane != 6), &format!("case {i}, lane {lane}"));
                assert_eq!(shadow.is_occluded(lane), lane != 6, "case {i}, lane {lane}");
            }
            assert_eq!(packet.hit.geom_id[6], INVALID_ID);
        }
    }
}

#[test]
fn a_lane_that_asks_nothing_gets_no_answer() {
    let scene = build(&device(), blob(24), SceneOptions::default());
    let honest = Ray::new(Vec3::new(5.0, 0.1, 0.2), -Vec3::X);
    for silent in
        [Ray { t_far: f32::NEG_INFINITY, ..honest }, Ray { d: Vec3::ZERO, t_far: f32::NEG_INFINITY, ..honest }]
    {
        assert_eq!(scene.intersect(&silent), None);
        assert!(!scene.occluded(&silent));
        let mut packet = RayHitPacket::<16>::EMPTY;
        (0..16).for_each(|lane| packet.ray.set(lane, if lane % 3 == 0 { &silent } else { &honest }));
        let mut shadow = packet.ray.clone();
        scene.intersect_packet(&mut packet, 16, Coherence::Coherent);
        scene.occluded_packet(&mut shadow, 16, Coherence::Coherent);
        for lane in 0..16 {
            assert_eq!(packet.hit(lane).is_some(), lane % 3 != 0);
            assert_eq!(packet.ray.t_far[lane] == f32::NEG_INFINITY, lane % 3 == 0);
            assert_eq!(shadow.t_far[lane], f32::NEG_INFINITY);
        }
    }
}

#[test]
fn many_threads_may_ask_one_scene() {
    let scene = build(&device(), blob(60), SceneOptions::default());
    let rays = rays(4000);
    let alone: Vec<_> = rays.iter().map(|ray| scene.intersect(ray)).collect();
    let together: Vec<_> = rays.par_iter().map(|ray| scene.intersect(ray)).collect();
    assert_eq!(alone, together);
    let batches: Vec<_> = rays
        .par_chunks(100)
        .flat_map_iter(|rays| {
            let mut batch = PacketBatch::<RayHitPacket>::default();
            rays.iter().for_each(|ray| batch.push(ray));
            scene.intersect_batch(&mut batch, Coherence::Coherent);
            (0..rays.len()).map(|i| batch.packets()[i / 16].hit(i % 16)).collect::<Vec<_>>()
        })
        .collect();
    for (a, b) in alone.into_iter().zip(batches) {
        same(b, a, "in batches on many threads");
    }
}

#[test]
fn nothing_is_hit_outside_of_the_interval() {
    let scene = build(&device(), blob(24), SceneOptions::default());
    let mut numbers = Numbers::new(3);
    for ray in rays(200) {
        let Some(hit) = scene.intersect(&ray) else { continue };
        let t_far = hit.t * (0.1 + 0.8 * numbers.next());
        assert_eq!(scene.intersect(&Ray { t_far, ..ray }), None);
        let beyond = scene.intersect(&Ray { t_near: hit.t * 1.001, ..ray });
        assert!(beyond.is_none_or(|b| b.t > hit.t));
    }
}
