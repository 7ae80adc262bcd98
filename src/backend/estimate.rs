//! What a hierarchy is going to take in memory, before it is built.

use super::{BackendKind, BuildOptions};
use crate::scene::{Object, Scene};

/// Bytes of a hierarchy that is not built yet, without the buffers of the scene.
///
/// Measured with Embree 4.3 and AVX-512 over balls of 10 k to 10 M triangles, smooth and rough, a terrain of 2.9 M and a
/// kitchen of 1.0 M (`cargo bench --bench memory`), bytes per triangle, and the largest error of the estimate:
///
/// | hierarchy | measured | estimate | error | while it is built |
/// |---|---|---|---|---|
/// | Embree, low quality | 90.4 to 95.8 | 93 | 3 % | 98.4 to 103.8 |
/// | Embree, medium | 61.3 to 69.2 | 65 | 7 % | 93.3 to 101.2 |
/// | native, fast | 57.7 to 72.9 | 67 | 16 % | 91.8 to 107.5 |
/// | native, good | 57.3 to 62.5 | 60 | 5 % | 91.3 to 96.7 |
///
/// Of a million spheres one takes 91.9, 88.5, 67.5 and 62.7 bytes (99.9, 120.5, 167.0 and 157.5 while they are built).
/// Embree takes memory by the piece: of 10 k to 30 k spheres one takes 81 to 117 bytes in low quality.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Estimate {
    /// Bytes when it is built.
    pub bytes: u64,
    /// Most bytes while it is built.
    pub peak_bytes: u64,
    /// What `peak_bytes` was never less than where it was measured.
    pub at_least: u64,
}

/// Bytes of one thing in a hierarchy.
#[derive(Clone, Copy)]
struct Rate {
    built: f64,
    peak: f64,
    at_least: f64,
}

impl Rate {
    fn of_triangles(kind: BackendKind, quick: bool) -> Self {
        match (kind, quick) {
            (BackendKind::Embree, true) => Self { built: 93.0, peak: 101.0, at_least: 90.0 },
            (BackendKind::Embree, false) => Self { built: 65.0, peak: 97.0, at_least: 85.0 },
            (BackendKind::Native, true) => Self { built: 67.0, peak: 101.0, at_least: 85.0 },
            (BackendKind::Native, false) => Self { built: 60.0, peak: 95.0, at_least: 85.0 },
        }
    }

    /// Spheres at random places; other shapes as these.
    fn of_shapes(kind: BackendKind, quick: bool) -> Self {
        match (kind, quick) {
            (BackendKind::Embree, true) => Self { built: 92.0, peak: 100.0, at_least: 75.0 },
            (BackendKind::Embree, false) => Self { built: 89.0, peak: 121.0, at_least: 95.0 },
            (BackendKind::Native, true) => Self { built: 68.0, peak: 168.0, at_least: 150.0 },
            (BackendKind::Native, false) => Self { built: 64.0, peak: 159.0, at_least: 140.0 },
        }
    }
}

impl Estimate {
    /// For a hierarchy over `scene`, as these options would have it built.
    #[must_use]
    pub fn of(kind: BackendKind, scene: &Scene, options: &BuildOptions<'_>) -> Self {
        let quick = options.prefers_quick_build(scene);
        let (triangles, shapes) = (Rate::of_triangles(kind, quick), Rate::of_shapes(kind, quick));
        // An instance is a thing with a box, like a shape.
        let instances = scene.objects.iter().filter(|o| matches!(o, Object::Instance(_))).count();
        let (t, s) = (scene.stored_triangles() as f64, (scene.shapes() + instances) as f64);
        let sum = |of: fn(&Rate) -> f64| (t * of(&triangles) + s * of(&shapes)) as u64;
        Self { bytes: sum(|r| r.built), peak_bytes: sum(|r| r.peak), at_least: sum(|r| r.at_least) }
    }

    /// Bytes that each triangle takes at least while a hierarchy of either quality is built.
    #[must_use]
    pub fn at_least_for_each_triangle(kind: BackendKind) -> u64 {
        let of = |quick| Rate::of_triangles(kind, quick).at_least as u64;
        of(true).min(of(false))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::AnyBackend;
    use crate::bench::setup::plain;
    use crate::geom::Sphere;
    use crate::math::Random;
    use crate::scene::example::{self, Surface};
    use crate::scene::{AnyShapes, Mesh, Shapes};
    use std::sync::atomic::AtomicBool;

    static GO_ON: AtomicBool = AtomicBool::new(false);

    /// The estimate and what it came to, of every kind and quality.
    fn check(scene: &Scene, error: f64) {
        for &kind in BackendKind::COMPILED {
            for rays_expected in [0, u64::MAX] {
                let options = BuildOptions { rays_expected, ..BuildOptions::new(&GO_ON) };
                let estimate = Estimate::of(kind, scene, &options);
                let built = AnyBackend::build(kind, scene, &options).expect("it is small");
                let off = |is: u64, said: u64| (is as f64 / said as f64 - 1.0).abs();
                let at = format!("{kind:?}, {rays_expected} rays: {built:?} of {estimate:?}");
                assert!(off(built.bytes(), estimate.bytes) < error, "{at}");
                assert!(off(built.peak_bytes(), estimate.peak_bytes) < error, "{at}");
                assert!(estimate.at_least <= built.peak_bytes(), "{at}");
            }
        }
    }

    #[test]
    fn meshes_take_what_was_said() {
        for surface in [Surface::Round, Surface::Rock] {
            check(&Scene::of(vec![Object::Mesh(Mesh::bare(example::mesh(30_000, surface)))]), 0.16);
        }
    }

    #[test]
    fn shapes_take_about_what_was_said() {
        let mut random = Random(7);
        let spheres = (0..30_000).map(|_| Sphere::new(random.point(), 0.007).expect("a size above 0"));
        check(&Scene::of(vec![Object::Shapes(Shapes::bare(AnyShapes::Spheres(plain(spheres))))]), 0.34);
    }

    #[test]
    fn a_build_may_take_its_peak_and_not_a_byte_less() {
        let scene = Scene::of(vec![Object::Mesh(Mesh::bare(example::mesh(30_000, Surface::Rock)))]);
        let build = |kind, memory_limit| {
            // One thread: what several hold at once differs from run to run.
            let options = BuildOptions { threads: 1, memory_limit, ..BuildOptions::new(&GO_ON) };
            AnyBackend::build(kind, &scene, &options)
        };
        for &kind in BackendKind::COMPILED {
            let peak = build(kind, None).expect("no limit").peak_bytes();
            assert!(build(kind, Some(peak)).is_ok(), "{kind:?}");
            let told = build(kind, Some(peak - 1)).expect_err("one byte too few").to_string();
            assert!(told.contains(&format!("only {}", peak - 1)), "{told}");
        }
    }
}
