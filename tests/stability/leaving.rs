//! Rays of the renderer leave every surface for good, at every size and place; what is really in the way,
//! however close, stays there.

use crate::for_each_backend;
use glam::DVec3;
use tison::backend::{Backend, BackendKind};
use tison::bench::leaving::{self, Body, Place, leave, looking};
use tison::bench::setup;
use tison::geom::{Coherence, Hit, PacketBatch, Ray, RayHitPacket, RayPacket};
use tison::render::{self, Control};
use tison::scene::Light;

/// Rays per case; `tison bench stability` takes more.
const RAYS: u64 = 10_000;

for_each_backend! {
    fn no_false_shadow_at_sizes_from_1e_3_to_1e6(kind: BackendKind) {
        for body in Body::ALL {
            for power in [-3, 0, 3, 6] {
                let found = leave(kind, body, 10f64.powi(power), Place::Moved(0.0), RAYS).expect("a scene");
                assert!(found.rays >= RAYS);
                assert_eq!(found.hits, 0, "{}, size 1e{power}", body.name());
                assert!(found.moved < 4e-6, "{}, size 1e{power}: {:e} sizes off", body.name(), found.moved);
            }
        }
    }

    fn no_false_shadow_with_the_scene_moved_by_1e2_to_1e6_sizes(kind: BackendKind) {
        for body in Body::ALL {
            for (size, moved) in [(1.0, 1e2), (1e-3, 1e4), (1.0, 1e6), (1e3, 1e6)] {
                let found = leave(kind, body, size, Place::Moved(moved), RAYS).expect("a scene");
                assert_eq!(found.hits, 0, "{}, size {size}, moved by {moved}", body.name());
                // As near as at the origin.
                assert!(found.moved < 4e-6, "{}, moved by {moved}: {:e} sizes off", body.name(), found.moved);
            }
        }
    }

    fn no_false_shadow_1e4_sizes_from_the_middle_of_the_scene(kind: BackendKind) {
        for body in Body::ALL {
            let found = leave(kind, body, 1.0, Place::Apart(1e4), RAYS).expect("a scene");
            assert_eq!(found.hits, 0, "{}", body.name());
            // Coordinates in f32 are that coarse there.
            assert!(found.moved < 3e-2, "{}: {:e} sizes off", body.name(), found.moved);
        }
    }

    /// Two planes that meet at a tenth of a degree: between them there is no light.
    fn a_wedge_of_a_tenth_of_a_degree_shadows_itself(kind: BackendKind) {
        for (size, at) in [(1.0, 0.0), (1e-3, 1.0), (1e3, 1e6)] {
            let at = size * at * DVec3::new(1.0, -0.6, 0.4);
            let rise = 0.1f64.to_radians().tan();
            let corners = [
                [0.0, -1.0, 0.0],
                [2.0, -1.0, 0.0],
                [2.0, 1.0, 0.0],
                [0.0, 1.0, 0.0],
                [2.0, -1.0, 2.0 * rise],
                [2.0, 1.0, 2.0 * rise],
            ];
            let point = |p: [f64; 3]| {
                let p = at + size * DVec3::from(p);
                format!("v {:?} {:?} {:?}\n", p.x, p.y, p.z)
            };
            let folder = tempfile::tempdir().expect("a folder");
            let path = folder.path().join("wedge.obj");
            let text = format!("{}f 1 2 3 4\nf 1 5 6 4\n", corners.map(point).concat());
            std::fs::write(&path, text).expect("a file in it");
            let mut scene = leaving::load(&path).expect("a mesh").scene;
            let lamp = at + size * DVec3::new(1.0, 0.3, 5.0);
            scene.lights = vec![Light::constant(scene.frame.to_local(lamp), glam::Vec3::ONE)];
            let backend = setup::build(kind, &scene).expect("a good scene");
            let shadows = Shadows { inner: backend.as_dyn(), sent: 0.into(), dark: 0.into() };
            // From between the planes at the lower one.
            let eye = at + size * DVec3::new(1.8, 0.1, 1.6 * rise);
            let camera = looking(eye, at + size * DVec3::new(0.5, 0.0, 0.0), 30.0);
            let outcome = render::run_with(&scene, &camera, &shadows, &leaving::job(128), &Control::default());
            outcome.expect("a good camera");
            let (sent, dark) = (shadows.sent.into_inner(), shadows.dark.into_inner());
            assert!(sent > 4000, "size {size}: {sent} shadow rays");
            // But for the last thousandth before the planes meet.
            assert!(dark as f64 > 0.999 * sent as f64, "size {size}: {dark} of {sent} in the dark");
        }
    }
}

/// Counts shadow rays.
struct Shadows<'a> {
    inner: &'a dyn Backend,
    sent: std::sync::atomic::AtomicU64,
    dark: std::sync::atomic::AtomicU64,
}

impl Backend for Shadows<'_> {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.inner.intersect(ray)
    }
    fn occluded(&self, ray: &Ray) -> bool {
        self.inner.occluded(ray)
    }
    fn intersect_many(&self, rays: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        self.inner.intersect_many(rays, coherence);
    }
    fn occluded_many(&self, rays: &mut PacketBatch<RayPacket>, coherence: Coherence) {
        let count = |rays: &PacketBatch<RayPacket>, is: fn(f32) -> bool| {
            rays.packets().iter().flat_map(|p| p.t_far).filter(|&t| is(t)).count() as u64
        };
        let idle = count(rays, |t| t == f32::NEG_INFINITY);
        let sent = count(rays, |t| t > 0.0);
        self.inner.occluded_many(rays, coherence);
        let dark = count(rays, |t| t == f32::NEG_INFINITY) - idle;
        self.sent.fetch_add(sent, std::sync::atomic::Ordering::Relaxed);
        self.dark.fetch_add(dark, std::sync::atomic::Ordering::Relaxed);
    }
}
