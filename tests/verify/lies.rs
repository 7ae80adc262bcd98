//! Backends that lie, a little and a lot.

use super::{assert_explained, few, native, of_project};
use glam::{Quat, Vec3};
use std::sync::Arc;
use tison::backend::Backend;
use tison::backend::native::Native;
use tison::geom::{Hit, Ray};
use tison::verify::{Class, Group, Report, run};

/// What a backend gets wrong. All but the first few ulps must be found out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lie {
    /// `t` by so much of itself.
    T(f32),
    /// The normal by so many radians.
    Normal(f32),
    /// The primitive next in number, at the right place.
    Prim,
    /// An object that there is not.
    Object,
    /// Misses one hit in so many.
    Miss(u32),
    /// Hits what is not there, once in so many misses.
    Phantom(u32),
    /// Says once in so many that something is in the way, and once that nothing is, when that is wrong.
    Occlusion(u32),
    /// Takes the second hit for the first.
    Second,
    /// Sees nothing at all.
    Blind,
}

/// One that answers as `honest` does, but for its lie.
#[derive(Debug)]
pub struct Liar {
    pub honest: Arc<Native>,
    pub lie: Lie,
}

/// The same number for the same ray, and often another one for others.
fn number(ray: &Ray) -> u32 {
    let bits = ray.d.to_array().into_iter().chain(ray.o.to_array()).map(f32::to_bits);
    bits.fold(17, |sum: u32, bits| (sum ^ bits).wrapping_mul(0x9e37_79b1).rotate_left(13))
}

impl Backend for Liar {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let hit = self.honest.intersect(ray);
        let one_in = |n: u32| number(ray).is_multiple_of(n);
        match (self.lie, hit) {
            (Lie::Blind, _) => None,
            (Lie::Miss(n), Some(_)) if one_in(n) => None,
            (Lie::Phantom(n), None) if one_in(n) => {
                let t = if ray.t_far.is_finite() { 0.5 * ray.t_far } else { 1.0 };
                (t > ray.t_near).then_some(Hit { t, u: 0.3, v: 0.3, ng: Vec3::X, prim_id: 0, geom_id: 0 })
            }
            (Lie::Second, Some(first)) => self.honest.intersect(&Ray { t_near: first.t.next_up(), ..*ray }).or(hit),
            (Lie::T(by), Some(hit)) => Some(Hit { t: hit.t * (1.0 + by), ..hit }),
            (Lie::Normal(by), Some(hit)) => {
                let axis = hit.ng.any_orthogonal_vector().normalize_or(Vec3::Y);
                Some(Hit { ng: Quat::from_axis_angle(axis, by) * hit.ng, ..hit })
            }
            (Lie::Prim, Some(hit)) => Some(Hit { prim_id: hit.prim_id + 1, ..hit }),
            (Lie::Object, Some(hit)) => Some(Hit { geom_id: hit.geom_id + 1000, ..hit }),
            _ => hit,
        }
    }

    fn occluded(&self, ray: &Ray) -> bool {
        match self.lie {
            Lie::Occlusion(n) if number(ray).is_multiple_of(n) => !self.honest.occluded(ray),
            Lie::Blind => false,
            _ => self.honest.occluded(ray),
        }
    }
}

fn found(scene: &str, lie: Lie) -> Report {
    let (scene, camera) = of_project(scene);
    let honest = native(&scene);
    let liar = Liar { honest: Arc::clone(&honest), lie };
    run(&scene, &camera, (&liar, &*honest), &few(3)).expect("a good camera")
}

/// Meshes, instances, shapes.
const SCENES: [&str; 3] = ["mesh.toml", "instances.toml", "transform.toml"];

#[test]
fn an_honest_backend_agrees_with_itself() {
    for name in SCENES {
        let (scene, camera) = of_project(name);
        let honest = native(&scene);
        let report = run(&scene, &camera, (&*honest, &*honest), &few(1)).expect("a good camera");
        assert_explained(&report, &scene, name);
        let total = report.total();
        assert_eq!(total.rays, total.agreeing(), "{name}");
        for group in Group::ALL {
            assert!(report.of(group).rays > 500, "{name}: only {} rays {}", report.of(group).rays, group.name());
        }
    }
}

#[test]
fn the_report_is_the_same_for_any_number_of_threads() {
    let (scene, camera) = of_project("instances.toml");
    let honest = native(&scene);
    let liar = Liar { honest: Arc::clone(&honest), lie: Lie::Miss(50) };
    let with = |threads: usize, seed: u32| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| run(&scene, &camera, (&liar, &*honest), &few(seed))).expect("a good camera")
    };
    let one = with(1, 7);
    assert_eq!(format!("{one:?}"), format!("{:?}", with(3, 7)));
    assert_ne!(format!("{one:?}"), format!("{:?}", with(1, 8)), "the seed chooses the rays");
}

#[test]
fn a_little_rounding_is_no_lie() {
    for name in SCENES {
        let report = found(name, Lie::T(1.5 * f32::EPSILON * 0.5));
        assert_eq!(report.unexplained(), 0, "{name}: {:?}", report.worst);
    }
}

#[test]
fn wrong_distances_are_found() {
    for name in SCENES {
        for by in [1e-3, -1e-2, 0.5, -0.5] {
            let total = found(name, Lie::T(by)).total();
            let wrong = total.of(Class::T) + total.of(Class::Real);
            // What is seen along its surface may be anywhere.
            assert!(wrong * 10 > total.hits * 7, "{name}, t off by {by}: {wrong} of {}", total.hits);
        }
    }
    // A millionth is more than shapes may be off, if less than f32 knows about far triangles.
    let total = found("sphere.toml", Lie::T(2e-6)).total();
    assert!(total.of(Class::T) * 10 > total.hits * 4, "{total:?}");
}

#[test]
fn wrong_normals_are_found() {
    for by in [0.01, 0.5, 3.0] {
        let total = found("mesh.toml", Lie::Normal(by)).total();
        // Neither a floor that is a shape nor a shadow ray has one.
        assert!(total.of(Class::Normal) * 10 > total.hits * 4, "off by {by}: {total:?}");
        assert_eq!(total.of(Class::Real) + total.of(Class::T), 0);
    }
}

#[test]
fn wrong_primitives_are_real() {
    for name in SCENES {
        for lie in [Lie::Prim, Lie::Object] {
            let total = found(name, lie).total();
            assert!(total.of(Class::Real) * 10 > total.hits * 6, "{name}, {lie:?}: {total:?}");
        }
    }
}

#[test]
fn what_is_missed_or_made_up_is_real() {
    for name in SCENES {
        for lie in [Lie::Miss(20), Lie::Second, Lie::Blind] {
            let report = found(name, lie);
            let total = report.total();
            let expected = if let Lie::Miss(n) = lie { total.hits / u64::from(n) / 2 } else { total.hits / 4 };
            assert!(total.of(Class::Real) > expected, "{name}, {lie:?}: {total:?}");
        }
        let total = found(name, Lie::Phantom(20)).total();
        let misses = total.rays - total.hits;
        assert!((total.of(Class::Real) + total.of(Class::T)) * 80 > misses, "{name}: {total:?}");
    }
}

#[test]
fn wrong_shadows_are_real() {
    for name in SCENES {
        let report = found(name, Lie::Occlusion(10));
        let shadow = report.of(Group::Shadow);
        assert!(shadow.of(Class::Real) * 20 > shadow.rays, "{name}: {shadow:?}");
        let camera = report.of(Group::Camera);
        assert!(camera.of(Class::Real) * 20 > camera.rays, "rays that look for the nearest ask that too: {camera:?}");
        assert_eq!(report.of(Group::CameraPackets).of(Class::Real), 0, "nearest hits were right");
    }
}

#[test]
fn one_wrong_answer_in_ten_thousand_is_found() {
    let report = found("instances.toml", Lie::Miss(10_000));
    assert!((1..40).contains(&report.unexplained()), "{:?}", report.total());
}
