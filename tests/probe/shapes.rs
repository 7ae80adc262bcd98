//! Every shape, from near and far, under every transform, with directions of every length.
use super::kit::*;
use glam::DVec3;
use tison::probe::ProbeRay;

#[test]
fn under_every_transform() {
    let mut random = Random(5);
    for (what, to_world) in transforms() {
        for s in all_under(what, to_world) {
            let mut hits = 0;
            for _ in 0..1000 {
                let distance = 0.3 + 6.0 * random.unit();
                hits += u32::from(check(&s, &towards(&mut random, &s, distance), &PROMISED) == Some(true));
            }
            assert!(hits > 100, "{}: {hits}", s.name);
        }
    }
}

/// Nothing about shapes is decided in f32.
#[test]
fn far_better_than_promised() {
    let limits = Limits { margin: 1e-6, t: 1e-12, radians: 1e-9 };
    let mut random = Random(6);
    for (what, to_world) in transforms() {
        // Stretching by a thousand takes three digits, and a unit shape has no 12 digits 1e6 away.
        let fewer = what.contains("away") || what.contains("1000") || what.contains("stretched");
        let limits = if fewer { Limits { t: 1e-9, ..limits } } else { limits };
        for s in all_under(what, to_world) {
            for _ in 0..500 {
                check(&s, &towards(&mut random, &s, 3.0), &limits);
            }
        }
    }
}

#[test]
fn from_near_and_far() {
    let mut random = Random(1);
    for s in all_under("as it is", glam::DAffine3::IDENTITY) {
        for k in 0..=12 {
            let distance = 1.001 * 10f64.powi(k);
            let (mut hits, mut misses) = (0, 0);
            for _ in 0..800 {
                // Beyond 1e7 the ray's own digits decide less and less.
                let margin = 1e-6f64.max(1e-13 * distance);
                match check(&s, &towards(&mut random, &s, distance), &Limits { margin, ..PROMISED }) {
                    Some(true) => hits += 1,
                    Some(false) => misses += 1,
                    None => {}
                }
            }
            assert!(hits > 80 && misses > 20, "{} from {distance:e}: {hits} and {misses}", s.name);
        }
    }
}

#[test]
fn the_length_of_the_direction_does_not_matter() {
    let mut random = Random(3);
    for (what, to_world) in [transforms()[0], transforms()[5], transforms()[9], transforms()[10]] {
        for s in all_under(what, to_world) {
            for _ in 0..100 {
                let r = towards(&mut random, &s, 3.0);
                for exponent in [-25, -10, 10, 20, 25] {
                    check(&s, &ProbeRay { d: r.d * 10f64.powi(exponent), ..r }, &PROMISED);
                }
                // A power of two changes no bit but those of the exponent.
                for (_, prober) in &s.probers {
                    let power = 2f64.powi(-77);
                    let (a, b) = (prober.probe(&r), prober.probe(&ProbeRay { d: r.d * power, ..r }));
                    assert_eq!(a.map(|a| (a.t, a.p)), b.map(|b| (b.t * power, b.p)), "{}: {r:?}", s.name);
                }
            }
        }
    }
}

#[test]
fn intervals_are_open_to_the_last_bit() {
    let mut random = Random(8);
    for (what, to_world) in transforms() {
        for s in all_under(what, to_world) {
            for i in 0..100 {
                let r = towards(&mut random, &s, [3.0, 1e5][i % 2]);
                for (kind, prober) in &s.probers {
                    let place = format!("{} by {}: {r:?}", s.name, kind.name());
                    let Some(hit) = prober.probe(&r) else { continue };
                    let within = |t_min, t_max| prober.probe(&ProbeRay { t_min, t_max, ..r });
                    let wide = 1.0 + 1e-9;
                    assert!(
                        within(hit.t / wide, hit.t * wide).is_some_and(|h| (h.t / hit.t - 1.0).abs() < 1e-11),
                        "{place}"
                    );
                    assert_eq!(within(0.0, hit.t), None, "{place}");
                    assert_eq!(within(0.0, hit.t / wide), None, "{place}");
                    let next = within(hit.t * wide, f64::INFINITY);
                    assert!(next.is_none_or(|next| next.t > hit.t * wide), "{place}");
                    // The line goes on behind the origin.
                    let turned = ProbeRay { d: -r.d, t_min: f64::NEG_INFINITY, ..r };
                    let back = prober.probe(&turned).expect("the line is the same");
                    let last = next.filter(|n| n.t > hit.t).unwrap_or(hit);
                    assert!((back.t + last.t).abs() <= 1e-9 * last.t, "{place}: {back:?} for {last:?}");
                }
            }
        }
    }
}

#[test]
fn rays_that_are_none_meet_nothing() {
    let s = placed("sphere", tison::bench::truth::Solid::Sphere, glam::DAffine3::IDENTITY);
    let good = ProbeRay::new(DVec3::new(0.0, 0.0, 5.0), -DVec3::Z);
    for (_, prober) in &s.probers {
        assert!(prober.probe(&good).is_some());
        for bad in [
            ProbeRay { d: DVec3::ZERO, ..good },
            ProbeRay { d: DVec3::new(f64::NAN, 0.0, -1.0), ..good },
            ProbeRay { o: DVec3::new(0.0, f64::INFINITY, 5.0), ..good },
            ProbeRay { t_min: 5.0, t_max: 4.0, ..good },
            ProbeRay { t_min: f64::NAN, ..good },
        ] {
            assert_eq!(prober.probe(&bad), None, "{bad:?}");
        }
    }
}
