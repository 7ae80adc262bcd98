//! Directions of a length at which Embree would lose hits, and rays that cannot hit at all.
//!
//! Embree 4.3 loses 14 % of the hits at `|d| = 1e-17` and all of them below `1e-18`. A direction times a power of two
//! and `t` divided by it is the same ray, and both are exact.

use crate::geom::{Ray, RayPacket};
use glam::{Vec3, Vec4};

/// `|x| + |y| + |z|` of a direction that Embree gets as it is.
const PLAIN: std::ops::RangeInclusive<f32> = 1.0 / 1_048_576.0..=1_048_576.0;

/// Whether Embree can take the ray as it is: finite origin, length of direction far from its limits.
#[inline]
pub(super) fn is_plain(o: Vec3, d: Vec3) -> bool {
    let (o, d) = (o.abs(), d.abs());
    // Sums keep NaN, and comparisons turn it away.
    let (o, d) = (o.x + o.y + o.z, d.x + d.y + d.z);
    (d >= *PLAIN.start()) & (d <= *PLAIN.end()) & (o <= f32::MAX)
}

/// [`is_plain`] for every lane, dead ones included. Four lanes a step, in types that are vector registers: left to
/// the compiler it becomes scalar code that costs 5 % of a coherent packet.
#[inline]
pub(super) fn all_plain<const N: usize>(rays: &RayPacket<N>) -> bool {
    let mut plain = Vec4::ZERO.cmpeq(Vec4::ZERO);
    for lane in (0..N).step_by(4) {
        let sum = |axes: [&[f32; N]; 3]| {
            let [x, y, z] = axes.map(|axis| Vec4::from_slice(&axis[lane..]).abs());
            x + y + z
        };
        let o = sum([&rays.o_x, &rays.o_y, &rays.o_z]);
        let d = sum([&rays.d_x, &rays.d_y, &rays.d_z]);
        plain &= d.cmpge(Vec4::splat(*PLAIN.start())) & d.cmple(Vec4::splat(*PLAIN.end()));
        plain &= o.cmple(Vec4::splat(f32::MAX));
    }
    plain.all()
}

/// A ray whose direction has its largest component in `[1, 2)`, and the way back.
pub(super) struct Rescaled {
    pub ray: Ray,
    factor: f64,
}

impl Rescaled {
    /// `None` when no hit is possible: a direction of length zero, or a number that is not finite.
    ///
    /// Components a factor `2^126` below the largest become zero, and ends of the interval that leave f32's range
    /// become zero or infinity.
    #[cold]
    pub fn new(ray: &Ray) -> Option<Self> {
        let largest = f64::from(ray.d.abs().max_element());
        if !(ray.o.is_finite() && ray.d.is_finite() && largest > 0.0) {
            return None;
        }
        // Every f32 is a normal f64, so that the exponent can be read off: `largest / power` is in [1, 2).
        let power = f64::from_bits(largest.to_bits() & !((1 << 52) - 1));
        let scaled = |x: f32| {
            let x = (f64::from(x) / power) as f32;
            if x.is_normal() { x } else { 0.0 }
        };
        let shrunk = |t: f32| (f64::from(t) * power) as f32;
        let d = Vec3::new(scaled(ray.d.x), scaled(ray.d.y), scaled(ray.d.z));
        let ray = Ray { o: ray.o, d, t_near: shrunk(ray.t_near), t_far: shrunk(ray.t_far) };
        Some(Self { ray, factor: 1.0 / power })
    }

    /// `t` of a hit in units of the given direction; beyond f32's range the largest float.
    pub fn t(&self, t: f32) -> f32 {
        ((f64::from(t) * self.factor) as f32).min(f32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_that_need_no_care_and_rays_that_do() {
        let cases = [
            ("unit", Vec3::ZERO, Vec3::X, true),
            ("short", Vec3::ZERO, Vec3::splat(4e-7), true),
            ("too short", Vec3::ZERO, Vec3::splat(3e-7), false),
            ("long", Vec3::ZERO, Vec3::new(0.0, -1_048_576.0, 0.0), true),
            ("too long", Vec3::ZERO, Vec3::new(0.0, -1_048_577.0, 0.0), false),
            ("zero", Vec3::ZERO, Vec3::ZERO, false),
            ("NaN in d", Vec3::ZERO, Vec3::new(1.0, f32::NAN, 0.0), false),
            ("NaN in o", Vec3::new(0.0, 0.0, f32::NAN), Vec3::X, false),
            ("infinite o", Vec3::new(f32::NEG_INFINITY, 0.0, 0.0), Vec3::X, false),
            ("far o", Vec3::new(1e30, 0.0, 0.0), Vec3::X, true),
        ];
        for (name, o, d, want) in cases {
            assert_eq!(is_plain(o, d), want, "{name}");
            let mut packet = RayPacket::<8>::EMPTY;
            assert!(all_plain(&packet));
            packet.set(5, &Ray { o, d, t_near: 0.0, t_far: 1.0 });
            assert_eq!(all_plain(&packet), want, "{name}");
        }
    }

    #[test]
    fn rescaling_is_exact_both_ways() {
        for scale in [1e-44f32, 1.2e-38, 1e-30, 3e-17, 0.7, 1e9, 1e20, 1e38] {
            let d = Vec3::new(scale, -0.25 * scale, 0.0);
            let ray = Ray { o: Vec3::ONE, d, t_near: 0.0, t_far: f32::INFINITY };
            let r = Rescaled::new(&ray).expect("finite and not zero");
            assert!((1.0..2.0).contains(&r.ray.d.x), "{scale:e}: {}", r.ray.d.x);
            assert_eq!(f64::from(r.ray.d.x) / r.factor, f64::from(d.x));
            assert_eq!(f64::from(r.ray.d.y) / r.factor, f64::from(d.y));
            assert_eq!((r.ray.o, r.ray.t_near, r.ray.t_far), (ray.o, 0.0, f32::INFINITY));
            assert_eq!(r.factor.log2().fract(), 0.0);
        }
    }

    #[test]
    fn intervals_go_along_and_saturate() {
        let ray = |d: f32, t_far| Ray { o: Vec3::ZERO, d: Vec3::new(0.0, 0.0, d), t_near: 0.5, t_far };
        let r = Rescaled::new(&ray(2f32.powi(-40), 3.0)).expect("an honest ray");
        assert_eq!((r.ray.t_near, r.ray.t_far), (0.5 * 2f32.powi(-40), 3.0 * 2f32.powi(-40)));
        assert_eq!(r.t(2f32.powi(-39)), 2.0);
        let r = Rescaled::new(&ray(1e30, 1e30)).expect("an honest ray");
        assert_eq!(r.ray.t_far, f32::INFINITY);
        let r = Rescaled::new(&ray(1.2e-38, 1e30)).expect("an honest ray");
        assert_eq!(r.t(100.0), f32::MAX);
    }

    #[test]
    fn what_cannot_hit_is_no_ray() {
        for d in [Vec3::ZERO, Vec3::new(f32::NAN, 1.0, 0.0), Vec3::new(f32::INFINITY, 1.0, 0.0)] {
            assert!(Rescaled::new(&Ray { o: Vec3::ZERO, d, t_near: 0.0, t_far: 1.0 }).is_none(), "{d}");
        }
        assert!(Rescaled::new(&Ray::new(Vec3::NAN, Vec3::X)).is_none());
    }
}
