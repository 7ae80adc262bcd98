//! Hit or miss, t and normals where they are hard to get right.
use super::kit::*;
use super::truth::Solid;
use glam::{DAffine3, DVec3};
use tison::geom::{ShapeSet, Sphere};

#[test]
fn from_near_and_far() {
    let mut random = Random(1);
    for s in all_plain() {
        for k in 0..=7 {
            // Not on the surface itself, where nothing is decidable.
            let distance = 1.001 * 10f64.powi(k);
            let (mut hits, mut misses) = (0, 0);
            // At 1e7 the normal of a grazing hit is only as good as the ray's own coordinates.
            let limits = if k < 7 { STRICT } else { Limits { radians: 2e-5, ..STRICT } };
            for _ in 0..10_000 {
                match check(&s, &towards(&mut random, &s, distance), &limits) {
                    Some(true) => hits += 1,
                    Some(false) => misses += 1,
                    None => {}
                }
            }
            assert!(hits > 300 && misses > 300, "{} from {distance}: {hits} hits, {misses} misses", s.name);
        }
    }
}

#[test]
fn a_sphere_as_ground() {
    let radius = 1e5;
    let ground = Sphere::new(DVec3::new(0.0, 0.0, -radius), radius).unwrap();
    let to_world =
        DAffine3::from_scale_rotation_translation(DVec3::splat(radius), glam::DQuat::IDENTITY, ground.center());
    let s = plain("ground", ground, Solid::Sphere, to_world);
    let mut random = Random(2);
    for height in [1e-2, 1e-1, 1.0, 10.0, 100.0] {
        let mut hits = 0;
        for _ in 0..2000 {
            let mut d = random.direction();
            d.z = -d.z.abs();
            let r = ray(DVec3::new(0.0, 0.0, height), d);
            let want = super::truth::truth(s.solid, &s.to_world, r.o, r.d, 0.0);
            let (Some((want, _)), true) = (want.hit, want.margin > 1e-12) else { continue };
            let t = s.set.hit(&r).expect("the ground is hit");
            assert!((t - want).abs() <= 1.5e-7 * want, "height {height}: {t} for {want}; {r:?}");
            hits += 1;
        }
        assert!(hits > 1900, "{hits}");
    }
}

#[test]
fn the_outline_of_round_shapes() {
    for s in all_plain().into_iter().filter(|s| !matches!(s.solid, Solid::Cube(_) | Solid::Quad(_))) {
        for distance in [1.5, 1e3, 1e5] {
            for (impact, hits) in [(1.0 - 1e-5, true), (1.0 + 1e-5, false)] {
                let r = ray(DVec3::new(impact, -distance, 0.1), DVec3::Y);
                // The sphere's own impact includes the height.
                let r = if matches!(s.solid, Solid::Sphere) { Ray64 { o: r.o.with_z(0.0), ..r } } else { r };
                assert_eq!(s.set.hit(&r).is_some(), hits, "{} from {distance} at {impact}", s.name);
            }
        }
    }
}

#[test]
fn the_length_of_the_direction_does_not_matter() {
    let mut random = Random(3);
    for s in all_plain().into_iter().chain(all_under("turned", transforms()[0].1)) {
        for _ in 0..300 {
            let r = towards(&mut random, &s, 3.0);
            let unit = Ray64 { d: r.d.normalize(), ..r };
            let want = s.set.hit(&unit);
            for length in [1e-25, 1e-10, 1e10, 1e20] {
                let got = s.set.hit(&Ray64 { d: unit.d * length, ..unit }).map(|t| t * length);
                match (want, got) {
                    (Some(a), Some(b)) => assert!((a - b).abs() <= 1e-12 * a.max(1e-2), "{}: {b} for {a}", s.name),
                    (a, b) => assert_eq!(a, b, "{} with |d| = {length}: {r:?}", s.name),
                }
            }
        }
    }
}

#[test]
fn from_inside_and_from_the_surface_of_a_sphere() {
    let mut set = tison::geom::Plain::default();
    set.push(Sphere::new(DVec3::new(3.0, -2.0, 5.0), 2.0).unwrap());
    let mut random = Random(4);
    let center = DVec3::new(3.0, -2.0, 5.0);
    for _ in 0..2000 {
        let d = random.direction();
        let t = set.hit(0, center, d, 0.0, f64::INFINITY).expect("from the centre");
        assert!((t - 2.0).abs() < 1e-14, "{t}");
        let on = center - 2.0 * d;
        let t = set.hit(0, on, d, 1e-4, f64::INFINITY).expect("going in meets the far side");
        assert!((t - 4.0).abs() < 1e-13, "{t}");
        assert_eq!(set.hit(0, on, -d, 1e-4, f64::INFINITY), None, "going out meets nothing");
        assert_eq!(set.hit(0, on, d, 1e-4, 3.999), None, "the interval ends before");
    }
}

#[test]
fn cylinder_rows() {
    let [.., tube, can, _] = &all_plain()[..] else { unreachable!("five of them") };
    let z = DVec3::Z;
    let hit = |s: &Specimen, r: Ray64| {
        let t = s.set.hit(&r)?;
        let p = s.set.refine(&r, t);
        Some((t, p.ng, p.part, p.entering(r.d)))
    };
    let near = |got: Option<(f64, DVec3, u8, bool)>, t: f64, n: DVec3, part: u8, entering: bool| {
        let got = got.expect("a hit");
        assert!((got.0 - t).abs() < 1e-12 && (got.1 - n).length() < 1e-12, "{got:?} for {t}, {n}");
        assert_eq!((got.2, got.3), (part, entering));
    };
    // Along the axis inside.
    let r = ray(DVec3::new(0.2, 0.1, 0.0), z);
    assert_eq!(hit(tube, r), None);
    near(hit(can, r), 0.8, z, 2, false);
    // Through both ends, straight and tilted.
    let r = ray(DVec3::new(0.2, 0.1, -5.0), z);
    assert_eq!(hit(tube, r), None);
    near(hit(can, r), 4.2, -z, 1, true);
    let r = ray(DVec3::new(0.0, 0.0, -5.0), DVec3::new(1e-6, 0.0, 1.0));
    assert_eq!(hit(tube, r), None);
    near(hit(can, r), 4.2, -z, 1, true);
    // Over the near rim: from above, down to the inner wall.
    let r = ray(DVec3::new(-2.0, 0.0, 1.4), DVec3::new(1.0, 0.0, -0.4));
    near(hit(tube, r), 3.0, DVec3::X, 0, false);
    near(hit(can, r), 1.5, z, 2, true);
    // At the rim's height, just under and just over.
    for (dz, in_tube, in_can) in [(-1e-5, true, true), (1e-5, false, false)] {
        let r = ray(DVec3::new(-2.0, 0.0, 0.8 + dz), DVec3::X);
        assert_eq!(hit(tube, r).is_some(), in_tube);
        assert_eq!(hit(can, r).is_some(), in_can);
    }
    // Just over the rim but coming down: the cap, where there is one.
    let r = ray(DVec3::new(-2.0, 0.0, 0.8 + 1e-5 + 0.1), DVec3::new(1.0, 0.0, -0.1));
    assert_eq!(hit(can, r).map(|h| h.2), Some(2));
    assert_eq!(hit(tube, r).map(|h| h.3), Some(false));
    // Across the outside, along the axis beside it.
    assert_eq!(hit(can, ray(DVec3::new(1.0 + 1e-5, 0.0, -5.0), z)), None);
    assert_eq!(hit(tube, ray(DVec3::new(1.0 - 1e-5, 0.0, -5.0), z)), None);
    near(hit(can, ray(DVec3::new(1.0 - 1e-5, 0.0, -5.0), z)), 4.2, -z, 1, true);
}

#[test]
fn cube_rows() {
    let s = &all_plain()[1];
    for d in [DVec3::new(0.0, 0.0, -1.0), DVec3::new(-0.0, 0.0, -1.0), DVec3::new(-0.0, -0.0, -1.0)] {
        for (o, part) in [
            (DVec3::new(0.1, 0.2, 5.0), 5),
            (DVec3::new(1.0, 0.2, 5.0), 5),
            (DVec3::new(-0.0, 0.7, 5.0), 5),
            (DVec3::new(1.0, 0.7, 5.0), 5),
            (DVec3::new(1.0 - 1e-5, 0.0, 5.0), 5),
        ] {
            let r = ray(o, d);
            assert_eq!(s.set.hit(&r), Some(4.6), "{r:?}");
            assert_eq!(s.set.refine(&r, 4.6).part, part, "{r:?}");
        }
        assert_eq!(s.set.hit(&ray(DVec3::new(1.0 + 1e-5, 0.0, 5.0), d)), None);
    }
    // From inside, and from a face inwards.
    let r = ray(DVec3::new(0.3, 0.0, 0.0), DVec3::X);
    assert_eq!(s.set.hit(&r), Some(0.7));
    let p = s.set.refine(&r, 0.7);
    assert_eq!((p.part, p.ng, p.entering(r.d)), (1, DVec3::X, false));
    assert_eq!(s.set.hit(&Ray64 { t_near: 1e-4, ..ray(DVec3::new(-1.0, 0.0, 0.0), DVec3::X) }), Some(2.0));
    // A chip off the edge between +x and +y.
    let o = DVec3::new(3.0, 0.7 - 2.0 - 1e-4, 0.0);
    let r = ray(o, DVec3::new(-1.0, 1.0, 0.0));
    let t = s.set.hit(&r).expect("the chip");
    assert!((t - 2.0).abs() < 1e-12 && s.set.refine(&r, t).part == 1);
    assert_eq!(s.set.hit(&ray(o + DVec3::new(0.0, 2e-4, 0.0), DVec3::new(-1.0, 1.0, 0.0))), None);
}

#[test]
fn a_thin_box_at_a_grazing_slope() {
    let thin = tison::geom::Cube::new(DVec3::ZERO, DVec3::new(1.0, 1.0, 0.5e-4)).unwrap();
    let s = plain("thin", thin, Solid::Cube([1.0, 1.0, 0.5e-4]), DAffine3::IDENTITY);
    let slope = 4e-4;
    for i in 0..1000 {
        let x = -0.999 + 1.998 * f64::from(i) / 999.0;
        // Meets the top at x, having come from the left.
        let r = ray(DVec3::new(x - 3.0, 0.1, 0.5e-4 + 3.0 * slope), DVec3::new(1.0, 0.0, -slope));
        let t = s.set.hit(&r).expect("the top");
        let p = s.set.refine(&r, t);
        assert_eq!((p.part, p.ng), (5, DVec3::Z), "{x}");
        assert!((t - 3.0).abs() < 1e-11, "{x}: {t}");
    }
}

#[test]
fn under_every_transform() {
    let mut random = Random(5);
    for (what, to_world) in transforms() {
        for s in all_under(what, to_world) {
            let mut hits = 0;
            for _ in 0..4000 {
                let distance = 0.3 + 6.0 * random.unit();
                hits += u32::from(check(&s, &towards(&mut random, &s, distance), &STRICT) == Some(true));
            }
            assert!(hits > 400, "{}: {hits}", s.name);
        }
    }
}
