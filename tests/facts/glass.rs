//! Refraction, total reflection, media in and beside each other, mirrors.

use crate::kit::{Told, build, job, load, looking, rays, render};
use glam::{DMat3, DVec3};
use tison::backend::BackendKind;
use tison::math::Random;
use tison::render::{self, Control, Job};

const WALLS: &str = "
[material.wall]
color = [1, 1, 1]
[material.glass]
diffuse = 0
refract = 1.0
ior = 1.5
[material.water]
diffuse = 0
refract = 1.0
ior = 1.33
[[object]]
name = 'a room around everything'
shape = 'sphere'
radius = 100
material = 'wall'
";

fn one(x: u32) -> Job {
    Job { centre: true, k_max: 20, ..job(x, x) }
}

/// Directions of the legs of the refracted path: from each end to the next.
fn legs(eye: DVec3, told: &[Told]) -> Vec<DVec3> {
    let ends: Vec<DVec3> = std::iter::once(eye).chain(told.iter().map(|t| t.at.expect("the room is closed"))).collect();
    ends.windows(2).map(|w| (w[1] - w[0]).normalize()).collect()
}

fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

#[test]
fn a_parallel_slab_leaves_rays_parallel() {
    let slab = "[[object]]\nshape = 'cube'\nhalf = [20, 0.25, 20]\nmaterial = 'glass'\n
        transform = [{ rotate = [1, 2, 3], degrees = 25 }]\n";
    let scene = load(&(WALLS.to_owned() + slab));
    for &kind in BackendKind::COMPILED {
        let backend = build(kind, &scene);
        let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 25f64.to_radians());
        let mut random = Random(3);
        let mut through = 0;
        for _ in 0..2000 {
            let eye = 5.0 * random.direction();
            let d = (random.direction() * 3.0 - eye).normalize();
            let (local, along) = (turn.inverse() * eye, turn.inverse() * d);
            // Not from inside, and not so flat that it leaves by an end.
            if local.y.abs() < 0.3 || along.y.abs() < 0.2 {
                continue;
            }
            let told = rays(&scene, &looking(eye, d), &backend, &one(1), (0, 0));
            let legs = legs(eye, &told);
            if legs.len() == 3 && told.iter().skip(1).all(|t| t.what == "refracted") {
                through += 1;
                assert!(angle(legs[0], legs[2]) < 1e-4, "{kind:?}: {} rad off", angle(legs[0], legs[2]));
            }
            assert!(told.iter().all(|t| t.what != "reflected"), "{kind:?}: nothing is mirrored inside of a slab");
        }
        assert!(through > 1000, "{kind:?}: only {through} rays went through");
    }
}

#[test]
fn total_reflection_begins_at_the_critical_angle() {
    // From the middle of a glass block up to its top, z = 1.
    let block = "[[object]]\nshape = 'cube'\nhalf = [5, 5, 1]\nmaterial = 'glass'\n";
    let scene = load(&(WALLS.to_owned() + block));
    let critical = (1.0f64 / 1.5).asin();
    assert!((critical.to_degrees() - 41.810_314_9).abs() < 1e-7);
    for &kind in BackendKind::COMPILED {
        let backend = build(kind, &scene);
        for turn in 0..24 {
            let around = DVec3::new((0.3 + f64::from(turn)).cos(), (0.3 + f64::from(turn)).sin(), 0.0);
            for (off, passes) in [(-1e-5, true), (1e-5, false), (-0.2, true), (0.2, false)] {
                let (sin, cos) = (critical + off).sin_cos();
                let told =
                    rays(&scene, &looking(DVec3::ZERO, around * sin + DVec3::Z * cos), &backend, &one(1), (0, 0));
                let what = if passes { "refracted" } else { "reflected" };
                assert_eq!(told[1].what, what, "{kind:?}: {off} rad from the critical angle");
            }
        }
    }
}

/// How often a path through `scene` bends, and where it ends.
fn end(kind: BackendKind, scene: &str, eye: DVec3, d: DVec3) -> DVec3 {
    let scene = load(&(WALLS.to_owned() + scene));
    let told = rays(&scene, &looking(eye, d), &build(kind, &scene), &one(1), (0, 0));
    assert!(told.iter().skip(1).all(|t| t.what == "refracted"), "{told:?}");
    told.last().expect("it ends at the wall").at.expect("the room is closed")
}

#[test]
fn blocks_of_one_glass_that_touch_are_one_block() {
    let whole = "[[object]]\nshape = 'cube'\nhalf = [2, 1, 1]\nmaterial = 'glass'\n";
    let halves = "[[object]]\nshape = 'cube'\nmaterial = 'glass'\ntransform = [{ translate = [-1, 0, 0] }]\n
        [[object]]\nshape = 'cube'\nmaterial = 'glass'\ntransform = [{ translate = [1, 0, 0] }]\n";
    let mut random = Random(9);
    for &kind in BackendKind::COMPILED {
        for _ in 0..20 {
            let eye = DVec3::new(-6.0, 0.2 * random.signed(), 0.2 * random.signed());
            let d = DVec3::new(1.0, 0.05 * random.signed(), 0.05 * random.signed()).normalize();
            let (a, b) = (end(kind, whole, eye, d), end(kind, halves, eye, d));
            assert!((a - b).length() < 1e-4, "{kind:?}: {a} and {b}");
        }
    }
}

#[test]
fn touching_media_bend_by_what_is_on_both_sides() {
    // Glass below z = 0, water above, seen from below: only the outer faces and Snell count.
    let layers =
        "[[object]]\nshape = 'cube'\nhalf = [9, 9, 1]\nmaterial = 'glass'\ntransform = [{ translate = [0, 0, -1] }]\n
        [[object]]\nshape = 'cube'\nhalf = [9, 9, 1]\nmaterial = 'water'\ntransform = [{ translate = [0, 0, 1] }]\n";
    for &kind in BackendKind::COMPILED {
        let scene = load(&(WALLS.to_owned() + layers));
        let backend = build(kind, &scene);
        for i in 1..40 {
            let (sin, cos) = (0.02 * f64::from(i)).sin_cos();
            let (eye, d) = (DVec3::new(-sin, 0.01, -3.0), DVec3::new(sin, 0.0, cos));
            let legs = legs(eye, &rays(&scene, &looking(eye, d), &backend, &one(1), (0, 0)));
            assert_eq!(legs.len(), 4, "{kind:?}: in, over, out, and on to the wall");
            for (leg, ior) in legs.iter().zip([1.0, 1.5, 1.33, 1.0]) {
                assert!((leg.x * ior - sin).abs() < 2e-6, "{kind:?}: sine {} in {ior}, not {}", leg.x, sin / ior);
            }
        }
    }
}

#[test]
fn nested_media_are_told_apart() {
    for (inside, ior) in [("water", 1.33), ("air", 1.0)] {
        ball_in_a_ball(inside, ior);
    }
}

/// A ball of something in a ball of glass.
fn ball_in_a_ball(inside: &str, ior_inside: f64) {
    let balls = "[material.air]\ndiffuse = 0\nrefract = 1.0\nior = 1.0\n
        [[object]]\nshape = 'sphere'\nradius = 3\nmaterial = 'glass'\n
        [[object]]\nshape = 'sphere'\nradius = 2\n";
    let scene = load(&format!("{WALLS}{balls}material = '{inside}'\n"));
    for &kind in BackendKind::COMPILED {
        let backend = build(kind, &scene);
        for i in 0..30 {
            // For spheres around one centre ior * (distance of the ray from the centre) is kept.
            let off = 0.05 * f64::from(i);
            let eye = DVec3::new(off, 0.0, -10.0);
            let told = rays(&scene, &looking(eye, DVec3::Z), &backend, &one(1), (0, 0));
            let legs = legs(eye, &told);
            assert_eq!(legs.len(), 5, "{kind:?}: {told:?}");
            for ((leg, ray), ior) in legs.iter().zip(&told).zip([1.0, 1.5, ior_inside, 1.5, 1.0]) {
                let from_centre = ray.at.expect("the room is closed").cross(*leg).length();
                assert!((ior * from_centre - off).abs() < 2e-5, "{kind:?}: {} in {ior}, not {off}", ior * from_centre);
            }
        }
    }
}

#[test]
fn sixty_four_facing_mirrors_keep_their_direction() {
    let mirrors = "[material.mirror]\ndiffuse = 0\nreflect = 1.0\n
        [[object]]\nshape = 'cube'\nhalf = [50, 50, 0.1]\nmaterial = 'mirror'\ntransform = [{ translate = [0, 0, 1.1] }]\n
        [[object]]\nshape = 'cube'\nhalf = [50, 50, 0.1]\nmaterial = 'mirror'\ntransform = [{ translate = [0, 0, -1.1] }]\n";
    let scene = load(&(WALLS.to_owned() + mirrors));
    for &kind in BackendKind::COMPILED {
        let backend = build(kind, &scene);
        let d = DVec3::new(0.3, 0.1, 1.0).normalize();
        let told = rays(&scene, &looking(DVec3::ZERO, d), &backend, &Job { k_max: 64, ..one(1) }, (0, 0));
        assert_eq!(told.iter().filter(|t| t.what == "reflected").count(), 64);
        for (i, leg) in legs(DVec3::ZERO, &told).iter().enumerate() {
            let want = DVec3::new(d.x, d.y, if i % 2 == 0 { d.z } else { -d.z });
            // A leg starts off the mirror by four roundings of its size, 50.
            assert!(angle(*leg, want) < 5e-6, "{kind:?}, mirror {i}: {} rad off", angle(*leg, want));
        }
    }
}

#[test]
fn a_white_furnace_stays_white() {
    // F + (1 - F) = 1, whatever the shape, for as long as the path may go on.
    let glass = "[render]\nbackground = [1, 1, 1]\nambient = [1, 1, 1]\n[camera.main]\neye = [0, 1, 9]\ntarget = [0, 0, 0]\n
        [material.glass]\nambient = 0\ndiffuse = 0\nreflect = 'fresnel'\nrefract = 1.0\nior = 1.5\n
        [material.white]\ncolor = [1, 1, 1]\ndiffuse = 0\n
        [[object]]\nshape = 'sphere'\nmaterial = 'glass'\ntransform = [{ scale = [1, 0.7, 1] }]\n
        [[object]]\nshape = 'cube'\nhalf = 0.5\nmaterial = 'glass'\ntransform = [{ rotate = [1, 1, 0], degrees = 40 }, { translate = [2, 0, 0] }]\n
        [[object]]\nshape = 'cylinder'\nradius = 0.5\ncapped = true\nmaterial = 'glass'\ntransform = [{ translate = [-2, 0, 0] }]\n
        [[object]]\nshape = 'sphere'\nradius = 0.4\nmaterial = 'white'\ntransform = [{ translate = [0, -1.3, 1] }]\n";
    let scene = load(glass);
    for &kind in BackendKind::COMPILED {
        let outcome = render(kind, &scene, &Job { k_max: 1000, min_weight: 1e-9, ..job(48, 32) });
        for (i, pixel) in outcome.film.color.iter().enumerate() {
            let off = pixel.iter().map(|c| (c - 1.0).abs()).fold(0.0, f32::max);
            assert!(off < 1e-6, "{kind:?}, pixel {i}: {pixel:?}");
        }
        assert!(outcome.stats.rays.refracted > 1000, "{kind:?}");
    }
}

#[test]
fn light_is_absorbed_along_the_way_through() {
    let block = "[render]\nbackground = [1, 1, 1]\n[camera.main]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\nfov = 1\n
        [material.tinted]\nambient = 0\ndiffuse = 0\nrefract = 1.0\nior = 1.0\nabsorption = [0.5, 0.1, 0.0]\n
        [[object]]\nshape = 'cube'\nhalf = [1, 1, 1.5]\nmaterial = 'tinted'\n";
    let scene = load(block);
    for &kind in BackendKind::COMPILED {
        let outcome = render(kind, &scene, &job(4, 4));
        for pixel in &outcome.film.color {
            for (got, sigma) in pixel.iter().zip([0.5f32, 0.1, 0.0]) {
                assert!((got - (-3.0 * sigma).exp()).abs() < 1e-4, "{kind:?}: {pixel:?}");
            }
        }
    }
}

#[test]
fn depth_is_no_matter_of_memory() {
    let scene = load(
        "[render]\nambient = [1, 1, 1]\n[camera.main]\neye = [0, 0, 0]\ntarget = [0, 0, 1]\n
        [material.mirror]\nambient = 0\ndiffuse = 0\nreflect = 1.0\n
        [[object]]\nshape = 'sphere'\nradius = 5\nmaterial = 'mirror'\n",
    );
    for &kind in BackendKind::COMPILED {
        for k_max in [0, 1, 100_000] {
            let outcome = render(kind, &scene, &Job { k_max, ..job(1, 1) });
            assert_eq!(outcome.stats.rays.reflected, u64::from(k_max), "{kind:?}");
            assert_eq!(outcome.stats.non_finite_samples, 0);
        }
    }
}

#[test]
fn a_surface_of_index_one_mirrors_in_water_and_not_in_air() {
    let coat = "[material.coat]\ncolor = 0.5\nreflect = 'fresnel'\nior = 1\n
        [[object]]\nshape = 'sphere'\nradius = 1\nmaterial = 'coat'\n";
    let water = "[[object]]\nshape = 'sphere'\nradius = 3\nmaterial = 'water'\n";
    let (eye, d) = (DVec3::new(10.0, 0.2, 0.1), DVec3::NEG_X);
    for (around, mirrored) in [(water, true), ("", false)] {
        let scene = load(&(WALLS.to_owned() + coat + around));
        for &kind in BackendKind::COMPILED {
            let backend = build(kind, &scene);
            let told = rays(&scene, &looking(eye, d), &backend, &one(1), (0, 0));
            let control = Control::default();
            let outcome =
                render::run(&scene.scene, &looking(eye, d), &backend, &one(1), &control).expect("a good camera");
            let reflected = told.iter().filter(|t| t.what == "reflected").count();
            assert_eq!(reflected > 0, mirrored, "{kind:?}: {told:?}");
            assert_eq!(outcome.stats.rays.reflected, reflected as u64, "{kind:?}: {told:?}");
        }
    }
}
