//! Hit or miss, t and normals of single shapes where they are hard to get right, for rays in f32.

use crate::for_each_backend;
use crate::kit::*;
use glam::{DAffine3, DVec3, Vec3};
use tison::backend::BackendKind;
use tison::bench::setup::{self, plain};
use tison::bench::truth::Solid;
use tison::geom::{Ray, ShapePoint, Sphere};
use tison::math::Random;
use tison::scene::{AnyShapes, Mesh, Object, Scene};

for_each_backend! {
    fn every_shape_from_near_and_far(kind: BackendKind) {
        let mut random = Random(1);
        for s in all_plain(kind) {
            // From 1e7 the normal of a grazing hit is only as good as the numbers that the ray is given in.
            for (k, radians) in (0..=7).map(|k| (k, if k < 7 { 1e-6 } else { 2e-5 })) {
                // Not on the surface itself, where nothing is decidable.
                let distance = 1.5 * 10f64.powi(k);
                let (mut hits, mut misses) = (0, 0);
                let rays = if matches!(s.solid, Solid::Sphere) { 10_000 } else { 2_000 };
                for _ in 0..rays {
                    match s.check(&s.ray(&mut random, distance), &Limits { radians, ..LIMITS }) {
                        Some(true) => hits += 1,
                        Some(false) => misses += 1,
                        None => {}
                    }
                }
                assert!(hits > rays / 30 && misses > rays / 30, "{} from {distance}: {hits}, {misses}", s.name);
            }
        }
    }

    fn a_sphere_of_radius_1e5_under_the_eye(kind: BackendKind) {
        let (radius, center) = (1e5, DVec3::new(0.0, 0.0, -1e5));
        let set = plain([Sphere::new(center, radius).expect("a sphere")]);
        let to_world = DAffine3::from_scale_rotation_translation(DVec3::splat(radius), glam::DQuat::IDENTITY, center);
        let s = Specimen::new(kind, "ground", Solid::Sphere, to_world, AnyShapes::Spheres(set));
        let mut random = Random(2);
        for height in [1e-2, 1e-1, 1.0, 10.0, 100.0] {
            let mut hits = 0;
            for _ in 0..2000 {
                let mut d = random.direction();
                d.z = -d.z.abs();
                // In sizes of the ground the eye is nearly on it, where the truth calls little decidable.
                let limits = Limits { margin: 1e-12, ..LIMITS };
                hits += u32::from(s.check(&ray([0.0, 0.0, height], d.into()), &limits) == Some(true));
            }
            assert!(hits > 1900, "from {height}: {hits}");
        }
    }

    fn the_outline_of_round_shapes(kind: BackendKind) {
        let shapes = [sphere(kind), cylinder(kind, false, DAffine3::IDENTITY), cylinder(kind, true, DAffine3::IDENTITY)];
        for s in shapes {
            for distance in [1.5, 1e3, 1e5] {
                for (impact, hits) in [(1.0 - 1e-5, true), (1.0 + 1e-5, false)] {
                    for impact in [impact, -impact] {
                        let hit = s.hit(&ray([impact, -distance, 0.0], [0.0, 1.0, 0.0]));
                        assert_eq!(hit.is_some(), hits, "{} from {distance} at {impact}", s.name);
                    }
                }
            }
        }
    }

    fn the_length_of_the_direction(kind: BackendKind) {
        let mut random = Random(3);
        for s in all_plain(kind) {
            for i in 0..400 {
                let r = s.ray(&mut random, 3.0);
                for length in [1e-25f32, 1e-10, 1e10, 1e20] {
                    // The direction as it is rounded, and the same with a power of two near its inverse.
                    let d = length * r.d.normalize();
                    let scaled = Ray { d, ..r };
                    let power = 2f32.powi(-length.log2().round() as i32);
                    let near_one = Ray { d: power * d, ..r };
                    let (got, want) = (s.hit(&scaled), s.hit(&near_one));
                    assert_eq!(got.is_some(), want.is_some(), "{}, |d| = {length:e}, ray {i}: {r:?}", s.name);
                    if let (Some(got), Some(want)) = (got, want) {
                        let off = (got.t / (want.t * f64::from(power)) - 1.0).abs();
                        assert!(off < 1e-7, "{}, |d| = {length:e}: t off by {off:e}", s.name);
                    }
                    s.check(&scaled, &Limits { margin: 1e-6, ..LIMITS });
                }
            }
        }
    }

    fn the_length_of_the_direction_at_a_mesh(kind: BackendKind) {
        let mesh = tison::scene::example::mesh(2_000, tison::scene::example::Surface::Rock);
        let scene = Scene::of(vec![Object::Mesh(Mesh::bare(mesh))]);
        let backend = setup::build(kind, &scene).expect("a good scene");
        let mut random = Random(4);
        for _ in 0..1000 {
            let (o, d) = (0.2 * random.point().as_vec3(), random.direction().as_vec3());
            let near = backend.as_dyn().intersect(&Ray::new(o, d)).expect("from inside");
            for power in [-83, -33, 33, 66] {
                let hit = backend.as_dyn().intersect(&Ray::new(o, 2f32.powi(power) * d)).expect("from inside");
                assert_eq!((hit.prim_id, hit.u, hit.v), (near.prim_id, near.u, near.v), "2^{power}");
                assert!((f64::from(hit.t) * 2f64.powi(power) / f64::from(near.t) - 1.0).abs() < 1e-7, "2^{power}");
            }
        }
    }

    fn the_eye_in_a_sphere_and_on_it(kind: BackendKind) {
        let s = sphere(kind);
        let mut random = Random(5);
        for _ in 0..2000 {
            let d = random.direction().as_vec3();
            let from = |o: Vec3, d: Vec3| s.hit(&Ray { t_near: 1e-4, ..Ray::new(o, d) });
            let center = from(Vec3::ZERO, d).expect("from the centre");
            assert!((center.t * d.as_dvec3().length() - 1.0).abs() < 1e-7 && !center.entering(d.as_dvec3()));
            let in_ = from(-d, d).expect("going in meets the far side");
            assert!((in_.t - 2.0).abs() < 1e-6, "{}", in_.t);
            assert_eq!(from(d, d), None, "going out meets nothing");
            assert_eq!(s.hit(&Ray { t_near: 1e-4, t_far: 1.999, ..Ray::new(-d, d) }), None, "it ends before");
        }
    }

    fn an_open_cylinder(kind: BackendKind) {
        let s = cylinder(kind, false, DAffine3::IDENTITY);
        let up = [0.0, 0.0, 1.0];
        assert_eq!(s.hit(&ray([0.2, 0.1, 0.0], up)), None, "along the axis, inside");
        assert_eq!(s.hit(&ray([0.2, 0.1, -5.0], up)), None, "through both ends");
        assert_eq!(s.hit(&ray([0.0, 0.0, -5.0], [1e-6, 0.0, 1.0])), None, "tilted a little");
        let d = [1.0, 0.0, -0.4];
        is(s.hit(&ray([-2.0, 0.0, 1.4], d)), 3.0, DVec3::X, 0, false, d, "over the near rim to the inner wall");
        for (dz, hits) in [(-1e-5, true), (1e-5, false)] {
            let hit = s.hit(&ray([-2.0, 0.0, 0.8 + dz], [1.0, 0.0, 0.0]));
            assert_eq!(hit.is_some(), hits, "{dz:e} from the rim");
        }
        assert_eq!(s.hit(&ray([1.0 - 1e-5, 0.0, -5.0], up)), None, "beside the wall, inside");
    }

    fn a_capped_cylinder(kind: BackendKind) {
        let s = cylinder(kind, true, DAffine3::IDENTITY);
        let up = [0.0, 0.0, 1.0];
        is(s.hit(&ray([0.2, 0.1, 0.0], up)), 0.8, DVec3::Z, 2, false, up, "along the axis, inside");
        is(s.hit(&ray([0.2, 0.1, -5.0], up)), 4.2, -DVec3::Z, 1, true, up, "through both ends");
        let d = [1e-6, 0.0, 1.0];
        is(s.hit(&ray([0.0, 0.0, -5.0], d)), 4.2, -DVec3::Z, 1, true, d, "tilted a little");
        let d = [1.0, 0.0, -0.4];
        is(s.hit(&ray([-2.0, 0.0, 1.4], d)), 1.5, DVec3::Z, 2, true, d, "over the near rim: the nearest of four");
        for (dz, hits) in [(-1e-5, true), (1e-5, false)] {
            let hit = s.hit(&ray([-2.0, 0.0, 0.8 + dz], [1.0, 0.0, 0.0]));
            assert_eq!(hit.map(|h| h.part), hits.then_some(0), "{dz:e} from the rim");
        }
        let d = [1.0, 0.0, -0.1];
        assert_eq!(s.hit(&ray([-2.0, 0.0, 0.90001], d)).map(|h| h.part), Some(2), "over the rim, coming down");
        assert_eq!(s.hit(&ray([1.0 + 1e-5, 0.0, -5.0], up)), None, "beside it");
        is(s.hit(&ray([1.0 - 1e-5, 0.0, -5.0], up)), 4.2, -DVec3::Z, 1, true, up, "at the border of the cap");
    }

    fn a_cube(kind: BackendKind) {
        let half = DVec3::new(1.0, 0.75, 0.5);
        let s = cube(kind, half);
        for d in [[0.0, 0.0, -1.0], [-0.0, 0.0, -1.0], [0.0, -0.0, -1.0], [-0.0, -0.0, -1.0]] {
            for o in [[0.1, 0.2], [1.0, 0.2], [-0.0, 0.75], [1.0, 0.75], [1.0 - 1e-5, 0.0], [0.0, 0.0]] {
                is(s.hit(&ray([o[0], o[1], 5.0], d)), 4.5, DVec3::Z, 5, true, d, "two components are zero");
            }
            assert_eq!(s.hit(&ray([1.0 + 1e-5, 0.0, 5.0], d)), None, "parallel, outside");
        }
        // A chip of 1e-4 off the edge between +x and +y, and just past it.
        for (y, hits) in [(0.75 - 2.0 - 1e-4, true), (0.75 - 2.0 + 1e-4, false)] {
            let hit = s.hit(&ray([3.0, y, 0.0], [-1.0, 1.0, 0.0]));
            assert_eq!(hit.map(|h| h.part), hits.then_some(1), "{y}");
        }
        is(s.hit(&ray([0.25, 0.0, 0.0], [1.0, 0.0, 0.0])), 0.75, DVec3::X, 1, false, [1.0, 0.0, 0.0], "from inside");
    }

    fn a_thin_box_at_a_grazing_slope(kind: BackendKind) {
        let thin = 0.5e-4;
        let s = cube(kind, DVec3::new(1.0, 1.0, thin));
        let slope = 4e-4;
        for i in 0..2000 {
            let x = -0.999 + 1.998 * f64::from(i) / 1999.0;
            // Meets the top at x, having come from the left.
            let r = ray([x - 3.0, 0.1, thin + 3.0 * slope], [1.0, 0.0, -slope]);
            let hit = s.hit(&r).expect("the top");
            assert_eq!((hit.part, hit.ng), (5, DVec3::Z), "{x}");
            s.check(&r, &LIMITS);
        }
    }

    fn under_every_transform(kind: BackendKind) {
        let mut random = Random(6);
        for (what, to_world) in transforms() {
            for s in all_under(kind, to_world) {
                let mut hits = 0;
                for i in 0..3000 {
                    let distance = 0.3 + 6.0 * random.unit();
                    let r = s.ray(&mut random, distance);
                    // Origins close to the surface: t is only as good as the difference.
                    let limits = if i % 2 == 0 { LIMITS } else { Limits { margin: 1e-3, ..LIMITS } };
                    hits += u32::from(s.check(&r, &limits) == Some(true));
                }
                assert!(hits > 300, "{}, {what}: {hits}", s.name);
            }
        }
    }
}

/// One hit at `t` with normal `n` on `part`.
fn is(got: Option<ShapePoint>, t: f64, n: DVec3, part: u8, entering: bool, d: [f64; 3], what: &str) {
    let got = got.unwrap_or_else(|| panic!("{what}: a miss"));
    assert!((got.t - t).abs() <= 1.5e-7 * t && (got.ng - n).length() < 1e-6, "{what}: {got:?} for {t}, {n}");
    assert_eq!((got.part, got.entering(d.into())), (part, entering), "{what}");
}
