//! A triangle as a shape keeps its f64 corners, wherever and however large it is.
use super::kit::*;
use glam::{DAffine3, DMat3, DVec3};
use tison::geom::ExactTriangle;
use tison::math::dd::{Dd, Dd3, dd};
use tison::probe::ProbeRay;
use tison::scene::{OneShape, Scene};

struct Truth {
    t: f64,
    n: DVec3,
    uv: [f64; 2],
    /// Least weight of a corner; negative for a miss.
    inside: f64,
}

/// Cramer's rule in long numbers (Möller & Trumbore 1997).
fn truth([a, b, c]: [Dd3; 3], o: DVec3, d: DVec3) -> Truth {
    let (o, d) = (Dd3::of(o), Dd3::of(d));
    let (e1, e2) = (b - a, c - a);
    let n = e1.cross(e2);
    let (s, det) = (o - a, dd(0.0) - d.dot(n));
    let q = s.cross(d);
    let (u, v, t): (Dd, Dd, Dd) = (e2.dot(q) / det, dd(0.0) - e1.dot(q) / det, s.dot(n) / det);
    let inside = u.to_f64().min(v.to_f64()).min((dd(1.0) - u - v).to_f64());
    Truth { t: t.to_f64(), n: n.scale(dd(1.0) / n.length()).to_f64(), uv: [u.to_f64(), v.to_f64()], inside }
}

fn moved(corners: [DVec3; 3], to: &DAffine3) -> [Dd3; 3] {
    let columns = [to.matrix3.x_axis, to.matrix3.y_axis, to.matrix3.z_axis].map(Dd3::of);
    corners.map(|p| {
        let terms = [0, 1, 2].map(|k| columns[k].scale(dd(p[k])));
        terms[0] + terms[1] + terms[2] + Dd3::of(to.translation)
    })
}

/// Aims at and beside the triangle from `distance` of its sizes away. All that is decidable by 1e-6 must be right.
fn check(what: &str, corners: [DVec3; 3], to: &DAffine3, distance: f64, random: &mut Random, limits: &Limits) {
    let shape = OneShape::Triangle(ExactTriangle::new(corners));
    let probers = probers(|| Scene::of_one(shape, to).expect("it can be placed"));
    let exact = moved(corners, to);
    let [a, b, c] = exact.map(Dd3::to_f64);
    let size = (b - a).length().max((c - a).length());
    let (mut hits, mut misses) = (0, 0);
    for _ in 0..100 {
        let (u, v) = (1.6 * random.unit() - 0.3, 1.6 * random.unit() - 0.3);
        let o = a + distance * size * random.direction();
        let d = a + u * (b - a) + v * (c - a) - o;
        let want = truth(exact, o, d);
        let steep = d.normalize().dot(want.n).abs();
        if want.inside.abs() < limits.margin / steep || want.t < 1e-3 || steep < 1e-3 {
            continue;
        }
        for (kind, prober) in &probers {
            let place = format!("{what} by {}: {o} {d}, {:e} inside", kind.name(), want.inside);
            let got = prober.probe(&ProbeRay::new(o, d));
            assert_eq!(got.is_some(), want.inside > 0.0, "{place}");
            let Some(got) = got else { continue };
            let off = (got.t / want.t - 1.0).abs();
            assert!(off <= limits.t, "{place}: t off by {off:e}");
            let turned = angle(got.ng, want.n);
            assert!(turned <= limits.radians, "{place}: normal off by {turned:e}");
            let away = (got.uv.x - want.uv[0]).abs().max((got.uv.y - want.uv[1]).abs());
            assert!(away <= limits.margin / steep, "{place}: weights off by {away:e}");
            assert_eq!(got.entering, d.dot(want.n) < 0.0, "{place}");
        }
        *(if want.inside > 0.0 { &mut hits } else { &mut misses }) += 1;
    }
    assert!(hits > 10 && misses > 10, "{what}: {hits} and {misses}");
}

fn random_triangle(random: &mut Random) -> [DVec3; 3] {
    loop {
        let [a, b, c] = [random.point(), random.point(), random.point()];
        if (b - a).cross(c - a).length() > 0.1 {
            return [a, b, c];
        }
    }
}

#[test]
fn near_and_far() {
    let mut random = Random(21);
    for k in 0..=7 {
        for _ in 0..5 {
            let corners = random_triangle(&mut random);
            check(&format!("1e{k} away"), corners, &DAffine3::IDENTITY, 1.5 * 10f64.powi(k), &mut random, &PROMISED);
        }
    }
}

#[test]
fn at_a_large_offset() {
    let mut random = Random(22);
    for offset in [1e3, 1e6, 1e9] {
        for _ in 0..5 {
            let at = offset * random.point();
            let corners = random_triangle(&mut random).map(|p| p + at);
            let limits = if offset > 1e6 { Limits { t: 1e-6, margin: 1e-5, radians: 1e-5 } } else { PROMISED };
            check(&format!("at {offset:e}"), corners, &DAffine3::IDENTITY, 4.0, &mut random, &limits);
        }
    }
}

#[test]
fn tiny_and_huge() {
    let mut random = Random(23);
    let limits = Limits { margin: 1e-6, t: 1e-12, radians: 1e-12 };
    for k in [-15, -8, 0, 8, 15, 60] {
        for _ in 0..5 {
            let corners = random_triangle(&mut random).map(|p| p * 10f64.powi(k));
            check(&format!("of size 1e{k}"), corners, &DAffine3::IDENTITY, 5.0, &mut random, &limits);
        }
    }
}

#[test]
fn under_every_transform() {
    let mut random = Random(24);
    for (what, to) in transforms() {
        for _ in 0..5 {
            let corners = random_triangle(&mut random);
            // Flat ones are seen edge-on from nearly everywhere.
            let mut placed = to;
            if what.contains("1000") {
                placed.matrix3 = to.matrix3 * DMat3::from_rotation_x(0.3);
            }
            check(what, corners, &placed, 4.0, &mut random, &PROMISED);
        }
    }
}

#[test]
fn one_without_area_is_never_met() {
    for corners in [
        [DVec3::ZERO, DVec3::X, 2.0 * DVec3::X],
        [DVec3::ONE; 3],
        [DVec3::ZERO, DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.1, 0.2, 0.3)],
    ] {
        let shape = OneShape::Triangle(ExactTriangle::new(corners));
        for (_, prober) in probers(|| Scene::of_one(shape, &DAffine3::IDENTITY).expect("it can be placed")) {
            for target in corners {
                assert_eq!(
                    prober.probe(&ProbeRay::new(DVec3::new(0.3, -2.0, 5.0), target - DVec3::new(0.3, -2.0, 5.0))),
                    None
                );
            }
        }
    }
}
