//! Rays exactly at the edges and corners of cubes do not slip through.

use crate::kit::{build, load};
use glam::{DVec3, Vec3};
use tison::backend::{AnyBackend, Backend, BackendKind};
use tison::geom::{Coherence, PacketBatch, Ray, RayHitPacket, RayPacket};

/// Rays that end in the middle of an edge, in a corner, or on an edge somewhere, of a cube of half
/// size 1 whose faces have f32 coordinates: straight on and at a slant, from outside.
fn rays_at_edges() -> Vec<Ray> {
    let mut rays = Vec::new();
    for corner in 0..8 {
        let sign = |bit: i32| if corner >> bit & 1 > 0 { 1.0f32 } else { -1.0 };
        let corner = Vec3::new(sign(0), sign(1), sign(2));
        for axis in 0..3 {
            for along in [0.0f32, 0.25, -0.5, 1.0] {
                let mut at = corner;
                at[axis] *= along;
                let directions = [corner, corner * Vec3::new(1.0, 0.5, 0.25), corner * Vec3::new(0.125, 1.0, 2.0)];
                for d in directions {
                    // Exact in f32, so that the ray does meet the edge.
                    rays.push(Ray::new(at + 4.0 * d, -d));
                }
                // In the plane of a face, along another axis.
                let mut d = Vec3::ZERO;
                d[(axis + 1) % 3] = corner[(axis + 1) % 3];
                rays.push(Ray::new(at + 3.0 * d, -d));
            }
        }
    }
    rays
}

fn all_hit<B: Backend>(backend: &B, rays: &[Ray], what: &str) {
    for ray in rays {
        assert!(backend.intersect(ray).is_some(), "{what}: {ray:?} slips through");
        assert!(backend.occluded(ray), "{what}: light along {ray:?} slips through");
    }
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        let (mut seen, mut shadows) = (PacketBatch::<RayHitPacket>::default(), PacketBatch::<RayPacket>::default());
        rays.iter().for_each(|ray| seen.push(ray));
        rays.iter().for_each(|ray| shadows.push(ray));
        backend.intersect_many(&mut seen, coherence);
        backend.occluded_many(&mut shadows, coherence);
        for (i, ray) in rays.iter().enumerate() {
            assert!(seen.packets()[i / 16].hit(i % 16).is_some(), "{what}: {ray:?} slips through a packet");
            assert!(
                shadows.packets()[i / 16].is_occluded(i % 16),
                "{what}: light along {ray:?} slips through a packet"
            );
        }
    }
}

#[test]
fn edges_and_corners_of_cubes_hold() {
    let rays = rays_at_edges();
    for (what, transform) in [
        ("plain", ""),
        ("scaled", "transform = [{ scale = [0.25, 2, 8] }]"),
        ("mirrored", "transform = [{ scale = [-1, 1, 1] }]"),
        ("turned by a quarter", "transform = [{ rotate = [0, 0, 1], degrees = 90 }]"),
    ] {
        let text = format!(
            "[[object]]\nshape = 'cube'\n{transform}\n[[object]]\nshape = 'cube'\nhalf = 0.01\ntransform = [{{ translate = [64, 0, 0] }}]"
        );
        let loaded = load(&text);
        let frame = loaded.scene.frame;
        let scale = if what == "scaled" { Vec3::new(0.25, 2.0, 8.0) } else { Vec3::ONE };
        let local = |v: DVec3| frame.to_local(v).as_vec3();
        let rays: Vec<Ray> = rays
            .iter()
            .map(|r| {
                let (o, d) = ((r.o * scale).as_dvec3(), (r.d * scale).as_dvec3());
                Ray::new(local(o), (d * frame.local_per_world()).as_vec3())
            })
            // Those that the frame's rounding moves off the edge are not meant.
            .filter(|r| {
                (frame.to_world(r.o.as_dvec3()).as_vec3().as_dvec3() - frame.to_world(r.o.as_dvec3())).length() == 0.0
            })
            .collect();
        assert!(rays.len() > 300, "{what}: {}", rays.len());
        for &kind in BackendKind::COMPILED {
            match build(kind, &loaded) {
                #[cfg(feature = "embree")]
                AnyBackend::Embree(b) => all_hit(&b, &rays, &format!("{what}, Embree")),
                AnyBackend::Native(b) => all_hit(&b, &rays, &format!("{what}, native")),
                _ => unreachable!("there are no others"),
            }
        }
    }
}
