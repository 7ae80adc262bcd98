//! The rows of the table of stress tests that are about single rays.
use super::kit::*;
use glam::{DAffine3, DVec3};
use tison::bench::truth::Solid;
use tison::geom::{Cube, Cylinder, Sphere};
use tison::probe::{Answer, ProbeRay, Prober};
use tison::scene::{OneShape, Scene};

/// A line of the table: what each backend must say.
fn each(shape: OneShape, f: impl Fn(&dyn Fn(DVec3, DVec3) -> Option<Answer>, &Prober)) {
    for (_, prober) in probers(|| Scene::of_one(shape, &DAffine3::IDENTITY).expect("it stands at the origin")) {
        f(&|o, d| prober.probe(&ProbeRay::new(o, d)), &prober);
    }
}

fn near(got: Option<Answer>, t: f64, n: DVec3, entering: bool) {
    let got = got.expect("a hit");
    assert!((got.t - t).abs() <= 1e-12 * t.max(1.0), "{got:?} for {t}");
    assert!((got.n - n).length() < 1e-12, "{got:?} for {n}");
    assert_eq!(got.entering, entering, "{got:?}");
}

const Z: DVec3 = DVec3::Z;

fn at(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

#[test]
fn a_planet_underfoot() {
    let mut random = Random(2);
    let planet = DAffine3::from_scale(DVec3::splat(1e5));
    let s = placed("planet", Solid::Sphere, planet);
    // Four of the seven digits are the planet's; the others are enough.
    let limits = Limits { margin: 1e-12, t: 1.5e-7, radians: 1e-9 };
    for height in [1e-2, 1e-1, 1.0, 10.0, 100.0] {
        for _ in 0..1000 {
            let up = random.direction();
            let o = (1e5 + height) * up;
            let d = (random.direction() - up).normalize();
            // Grazing rays leave the digits that decide.
            if -d.dot(up) < 0.05 {
                continue;
            }
            let want = tison::bench::truth::truth(s.solid, &s.to_world, o, d, 0.0).hit.expect("downwards").0;
            for (kind, prober) in &s.probers {
                let got = prober.probe(&ProbeRay::new(o, d)).expect("downwards");
                let off = (got.t - want).abs() / want;
                assert!(off <= limits.t, "{} from {height}: {} for {want}, {off:e}", kind.name(), got.t);
            }
        }
    }
}

#[test]
fn beside_the_silhouette() {
    each(OneShape::Sphere(Sphere::new(DVec3::ZERO, 1.0).unwrap()), |probe, _| {
        for distance in [5.0, 1e3, 1e7] {
            assert!(probe(at(1.0 - 1e-5, 0.0, distance), -Z).is_some(), "{distance}");
            assert!(probe(at(1.0 + 1e-5, 0.0, distance), -Z).is_none(), "{distance}");
        }
    });
}

#[test]
fn from_inside_and_from_the_surface_of_a_sphere() {
    let center = at(3e5, -2.0, 5.0);
    let mut random = Random(4);
    let rays: Vec<_> = (0..500).map(|_| random.direction()).collect();
    each(OneShape::Sphere(Sphere::new(center, 2.0).unwrap()), |probe, prober| {
        for &d in &rays {
            let hit = probe(center, d).expect("from the centre");
            assert!((hit.t - 2.0).abs() < 1e-12 && !hit.entering && (hit.n + d).length() < 1e-9, "{hit:?}");
            // The coordinates of the point on the surface are rounded to 6e-11.
            let on = |d| ProbeRay { t_min: 1e-4, ..ProbeRay::new(center - 2.0 * d, d) };
            let hit = prober.probe(&on(d)).expect("going in meets the far side");
            assert!((hit.t - 4.0).abs() < 1e-9, "{hit:?}");
            let out = ProbeRay { d: -d, ..on(d) };
            assert_eq!(prober.probe(&out), None, "going out meets nothing");
            assert_eq!(prober.probe(&ProbeRay { t_max: 3.999, ..on(d) }), None, "it ends before");
        }
    });
}

#[test]
fn an_open_cylinder() {
    each(OneShape::Cylinder(Cylinder::new(1.0, 1.6, false).unwrap()), |probe, _| {
        assert_eq!(probe(at(0.2, 0.1, 0.0), Z), None, "along the axis inside");
        assert_eq!(probe(at(0.0, 0.0, 0.0), Z), None, "on the axis");
        assert_eq!(probe(at(0.2, 0.1, -5.0), Z), None, "through both ends");
        assert_eq!(probe(at(0.0, 0.0, -5.0), at(1e-6, 0.0, 1.0)), None, "through both ends, tilted");
        near(probe(at(-2.0, 0.0, 1.4), at(1.0, 0.0, -0.4)), 3.0, -DVec3::X, false);
        near(probe(at(-2.0, 0.0, 0.8 - 1e-5), DVec3::X), 1.0, -DVec3::X, true);
        assert_eq!(probe(at(-2.0, 0.0, 0.8 + 1e-5), DVec3::X), None, "over the rim");
        near(probe(at(-2.0, 0.0, 0.8), DVec3::X), 1.0, -DVec3::X, true);
    });
}

#[test]
fn a_capped_cylinder() {
    each(OneShape::Cylinder(Cylinder::new(1.0, 1.6, true).unwrap()), |probe, _| {
        near(probe(at(0.2, 0.1, 0.0), Z), 0.8, -Z, false);
        near(probe(at(0.2, 0.1, -5.0), Z), 4.2, -Z, true);
        near(probe(at(0.0, 0.0, -5.0), at(-0.0, -0.0, 1.0)), 4.2, -Z, true);
        near(probe(at(0.0, 0.0, -5.0), at(1e-6, 0.0, 1.0)), 4.2, -Z, true);
        near(probe(at(-2.0, 0.0, 1.4), at(1.0, 0.0, -0.4)), 1.5, Z, true);
        near(probe(at(-2.0, 0.0, 0.8 - 1e-5), DVec3::X), 1.0, -DVec3::X, true);
        assert_eq!(probe(at(-2.0, 0.0, 0.8 + 1e-5), DVec3::X), None, "over the rim");
        near(probe(at(-2.0, 0.0, 0.9 + 1e-5), at(1.0, 0.0, -0.1)), 1.0 + 1e-4, Z, true);
        assert_eq!(probe(at(1.0 + 1e-5, 0.0, -5.0), Z), None, "beside it");
        near(probe(at(1.0 - 1e-5, 0.0, -5.0), Z), 4.2, -Z, true);
    });
}

#[test]
fn a_cube() {
    each(OneShape::Cube(Cube::new(DVec3::ZERO, at(1.0, 0.7, 0.4)).unwrap()), |probe, prober| {
        for d in [at(0.0, 0.0, -1.0), at(-0.0, 0.0, -1.0), at(-0.0, -0.0, -1.0)] {
            for o in
                [at(0.1, 0.2, 5.0), at(1.0, 0.2, 5.0), at(-0.0, 0.7, 5.0), at(1.0, 0.7, 5.0), at(1.0 - 1e-5, 0.0, 5.0)]
            {
                let hit = probe(o, d).expect("on the face or its edge");
                assert_eq!((hit.t, hit.entering), (4.6, true), "{o} {d}");
            }
            assert_eq!(probe(at(1.0 + 1e-5, 0.0, 5.0), d), None);
        }
        // Towards the corner, from outside and from inside.
        let corner = at(1.0, 0.7, 0.4);
        assert!(probe(4.0 * corner, -corner).is_some_and(|h| (h.t - 3.0).abs() < 1e-12));
        assert!(probe(DVec3::ZERO, corner).is_some_and(|h| (h.t - 1.0).abs() < 1e-12));
        near(probe(at(0.3, 0.0, 0.0), DVec3::X), 0.7, -DVec3::X, false);
        let inwards = ProbeRay { t_min: 1e-4, ..ProbeRay::new(at(-1.0, 0.0, 0.0), DVec3::X) };
        near(prober.probe(&inwards), 2.0, -DVec3::X, false);
        // A chip off the edge between +x and +y.
        let o = at(3.0, 0.7 - 2.0 - 1e-4, 0.0);
        near(probe(o, at(-1.0, 1.0, 0.0)), 2.0, DVec3::X, true);
        assert_eq!(probe(o + at(0.0, 2e-4, 0.0), at(-1.0, 1.0, 0.0)), None);
    });
}

#[test]
fn a_thin_box_at_a_grazing_slope() {
    each(OneShape::Cube(Cube::new(DVec3::ZERO, at(1.0, 1.0, 0.5e-4)).unwrap()), |probe, _| {
        let slope = 4e-4;
        for i in 0..500 {
            let x = -0.999 + 1.998 * f64::from(i) / 499.0;
            // Meets the top at x, having come from the left.
            let hit = probe(at(x - 3.0, 0.1, 0.5e-4 + 3.0 * slope), at(1.0, 0.0, -slope)).expect("the top");
            assert!((hit.t - 3.0).abs() < 1e-11 && hit.n == Z, "{x}: {hit:?}");
        }
    });
}
