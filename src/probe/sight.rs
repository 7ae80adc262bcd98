//! A ray in the scene's own space, moved to where the scene begins.
//!
//! Its `t` counts there in scene units times a power of two, from the new origin on. What rounding moves it by is then
//! relative to the scene, however far away and however long it is given.

use super::ProbeRay;
use crate::geom::{Bounds, Ray64};
use crate::math::Frame;
use glam::DVec3;

#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// In scene space; the largest component of its direction is in `[1, 2)`.
    pub ray: Ray64,
    /// Its origin, as the ray that was given counts, times `2^exponent`.
    start: f64,
    exponent: i32,
}

impl Sight {
    /// `None` for a ray that meets nothing inside of `clip`.
    pub fn new(given: &ProbeRay, frame: &Frame, clip: &Bounds) -> Option<Self> {
        let largest = given.d.abs().max_element();
        if !(given.o.is_finite() && given.d.is_finite() && largest > 0.0 && given.t_min < given.t_max) {
            return None;
        }
        let length = exponent_of(largest);
        let d = given.d.map(|x| times_power(x, -length));
        let exponent = length.saturating_sub(frame.exponent);
        let (near, far) = (times_power(given.t_min, exponent), times_power(given.t_max, exponent));

        let unit = frame.local_per_world();
        let (o, rest) = difference(given.o, frame.origin);
        let (o, rest) = (o * unit, rest * unit);
        let (enter, leave) = inside(clip, o, d)?;
        if !(enter <= leave && near < leave && far > enter) {
            return None;
        }
        // An origin inside stays, so that nothing is rounded.
        let start = if enter <= 0.0 && near >= 0.0 { 0.0 } else { enter.max(near) };
        let o =
            if start == 0.0 { o } else { DVec3::from_array([0, 1, 2].map(|k| start.mul_add(d[k], o[k]) + rest[k])) };
        // The answer is compared with what was given once more, so that the end may err to the far side.
        let ray = Ray64 { o, d, t_near: (near - start).max(0.0), t_far: (far - start).next_up() };
        o.is_finite().then_some(Self { ray, start, exponent })
    }

    /// Parameter of the ray that was given, for one of `ray`.
    pub fn t(&self, t: f64) -> f64 {
        times_power(self.start + t, -self.exponent)
    }
}

/// `a - b` and what rounding took from it (Knuth's two-sum).
fn difference(a: DVec3, b: DVec3) -> (DVec3, DVec3) {
    let sum = a - b;
    let part = sum - a;
    (sum, (a - (sum - part)) - (b + part))
}

/// Where the line is inside of the box; `None` if nowhere.
fn inside(clip: &Bounds, o: DVec3, d: DVec3) -> Option<(f64, f64)> {
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        if d[k] == 0.0 {
            if !(clip.lo[k] <= o[k] && o[k] <= clip.hi[k]) {
                return None;
            }
            continue;
        }
        let (a, b) = ((clip.lo[k] - o[k]) / d[k], (clip.hi[k] - o[k]) / d[k]);
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    Some((enter, leave))
}

/// `floor(log2 x)` of a positive number.
fn exponent_of(x: f64) -> i32 {
    /// Makes every subnormal number a normal one.
    const UP: i32 = 100;
    if x < f64::MIN_POSITIVE { exponent_of(times_power(x, UP)) - UP } else { (x.to_bits() >> 52) as i32 - 1023 }
}

/// `x * 2^k`, exactly unless it leaves the normal numbers.
fn times_power(x: f64, k: i32) -> f64 {
    let power = |k: i32| f64::from_bits(((k + 1023) as u64) << 52);
    match k {
        -1022..=1023 => x * power(k),
        // Further than from the least number to the largest.
        _ if k.abs() > 2200 => times_power(times_power(x, k.signum() * 1000), k.signum() * 1200),
        _ => times_power(x * power(k.signum() * 1000), k - k.signum() * 1000),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Points of the moved ray are points of the given one.
        #[test]
        fn points_stay_where_they_are(
            o in [-1.0..1.0f64, -1.0..1.0, -1.0..1.0], at in [-1.0..1.0f64, -1.0..1.0, -1.0..1.0], far in -2..9i32,
            length in -25..25i32, size in -15..15i32, s in 0.0..1.0f64,
        ) {
            let scale = 10f64.powi(size);
            let frame = Frame { origin: DVec3::new(1e6, -3.0, 0.5) * scale, exponent: exponent_of(scale) + 1 };
            let clip = Bounds { lo: -DVec3::ONE, hi: DVec3::ONE };
            let target = frame.to_world(DVec3::from(at));
            let o = frame.to_world(DVec3::from(o) * 10f64.powi(far));
            let d = (target - o) * 10f64.powi(length);
            prop_assume!(d != DVec3::ZERO);
            let sight = Sight::new(&ProbeRay::new(o, d), &frame, &clip).expect("aimed at the middle");
            prop_assert!((1.0..2.0).contains(&sight.ray.d.abs().max_element()));
            prop_assert!(sight.ray.o.abs().max_element() <= 1.0 + 1e-15 * 10f64.powi(far.max(0)));
            let t = sight.t(s);
            let (given, moved) = (o + t * d, frame.to_world(sight.ray.o + s * sight.ray.d));
            let coarse = o.abs().max_element() + t * d.abs().max_element();
            prop_assert!((given - moved).abs().max_element() <= 1e-15 * coarse, "{given} {moved}");
        }
    }

    #[test]
    fn powers_reach_from_end_to_end() {
        for (x, k, want) in [
            (1.0, 1023, 2f64.powi(1023)),
            (1.0, -1022, f64::MIN_POSITIVE),
            (f64::MIN_POSITIVE, 2045, 2f64.powi(1023)),
            (3.0, 1500, f64::INFINITY),
            (3.0, -1500, 0.0),
            (f64::INFINITY, -3000, f64::INFINITY),
            (f64::from_bits(1), 1074, 1.0),
            (1.0, i32::MAX, f64::INFINITY),
            (0.0, i32::MAX, 0.0),
        ] {
            assert_eq!(times_power(x, k), want, "{x:e} * 2^{k}");
        }
        for (x, want) in [(1.0, 0), (1.99, 0), (0.5, -1), (f64::from_bits(1), -1074), (f64::MAX, 1023)] {
            assert_eq!(exponent_of(x), want, "{x:e}");
        }
    }

    #[test]
    fn rays_that_cannot_meet_anything_are_none() {
        let (frame, clip) = (Frame::IDENTITY, Bounds { lo: -DVec3::ONE, hi: DVec3::ONE });
        let o = DVec3::new(0.0, 0.0, 5.0);
        let down = ProbeRay::new(o, -DVec3::Z);
        assert!(Sight::new(&down, &frame, &clip).is_some());
        for (name, ray) in [
            ("away", ProbeRay { d: DVec3::Z, ..down }),
            ("beside", ProbeRay { o: DVec3::new(1.5, 0.0, 5.0), ..down }),
            ("no direction", ProbeRay { d: DVec3::ZERO, ..down }),
            ("NaN", ProbeRay { d: DVec3::new(0.0, f64::NAN, 1.0), ..down }),
            ("ends before", ProbeRay { t_max: 3.9, ..down }),
            ("begins behind", ProbeRay { t_min: 6.1, ..down }),
            ("empty", ProbeRay { t_min: 5.0, t_max: 5.0, ..down }),
            ("no interval", ProbeRay { t_min: f64::NAN, ..down }),
        ] {
            assert!(Sight::new(&ray, &frame, &clip).is_none(), "{name}");
        }
        let back = ProbeRay { d: DVec3::Z, t_min: -100.0, ..down };
        assert!(Sight::new(&back, &frame, &clip).is_some(), "the interval may lie behind the origin");
    }
}
