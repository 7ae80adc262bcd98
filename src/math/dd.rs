//! Numbers of twice the digits of f64: an unevaluated sum of two, good to about 2^-104.
//!
//! Source: T. J. Dekker, "A Floating-Point Technique for Extending the Available Precision",
//! Numer. Math. 18, 1971; Y. Hida, X. S. Li, D. H. Bailey, "Library for Double-Double and
//! Quad-Double Arithmetic", 2000.

use glam::DVec3;
use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Such a number. What is not finite stays so, but not exactly as in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dd {
    hi: f64,
    lo: f64,
}

/// `x`, exactly.
#[must_use]
pub fn dd(x: f64) -> Dd {
    Dd { hi: x, lo: 0.0 }
}

fn two_sum(a: f64, b: f64) -> Dd {
    let hi = a + b;
    let b_part = hi - a;
    Dd { hi, lo: (a - (hi - b_part)) + (b - b_part) }
}

fn renormalised(hi: f64, lo: f64) -> Dd {
    let sum = hi + lo;
    Dd { hi: sum, lo: lo - (sum - hi) }
}

impl Dd {
    /// The nearest f64.
    #[must_use]
    pub fn to_f64(self) -> f64 {
        self.hi
    }

    /// Without its sign.
    #[must_use]
    pub fn abs(self) -> Self {
        if self.hi < 0.0 { -self } else { self }
    }

    /// Root of what is not negative: one Newton step from f64's.
    #[must_use]
    pub fn sqrt(self) -> Self {
        if self.hi == 0.0 {
            return dd(0.0);
        }
        let x = dd(self.hi.sqrt());
        x + (self - x * x) / (x + x)
    }
}

impl Add for Dd {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        let (s, t) = (two_sum(self.hi, o.hi), two_sum(self.lo, o.lo));
        let s = renormalised(s.hi, s.lo + t.hi);
        renormalised(s.hi, s.lo + t.lo)
    }
}

impl Neg for Dd {
    type Output = Self;
    fn neg(self) -> Self {
        Self { hi: -self.hi, lo: -self.lo }
    }
}

impl Sub for Dd {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + -o
    }
}

impl Mul for Dd {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let hi = self.hi * o.hi;
        let lo = self.hi.mul_add(o.hi, -hi);
        renormalised(hi, lo + (self.hi * o.lo + self.lo * o.hi))
    }
}

impl Div for Dd {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let q1 = self.hi / o.hi;
        let r = self - dd(q1) * o;
        let q2 = r.hi / o.hi;
        let r = r - dd(q2) * o;
        renormalised(q1, q2) + dd(r.hi / o.hi)
    }
}

impl PartialOrd for Dd {
    fn partial_cmp(&self, o: &Self) -> Option<Ordering> {
        match self.hi.partial_cmp(&o.hi) {
            Some(Ordering::Equal) => self.lo.partial_cmp(&o.lo),
            other => other,
        }
    }
}

/// A vector of them.
#[derive(Clone, Copy, Debug)]
pub struct Dd3(
    /// Its components.
    pub [Dd; 3],
);

impl Dd3 {
    /// `v`, exactly.
    #[must_use]
    pub fn of(v: DVec3) -> Self {
        Self(v.to_array().map(dd))
    }

    /// The nearest in f64.
    #[must_use]
    pub fn to_f64(self) -> DVec3 {
        self.0.map(Dd::to_f64).into()
    }

    fn map2(self, o: Self, f: impl Fn(Dd, Dd) -> Dd) -> Self {
        Self([f(self.0[0], o.0[0]), f(self.0[1], o.0[1]), f(self.0[2], o.0[2])])
    }

    /// Every component times `s`.
    #[must_use]
    pub fn scale(self, s: Dd) -> Self {
        Self(self.0.map(|x| x * s))
    }

    /// Scalar product.
    #[must_use]
    pub fn dot(self, o: Self) -> Dd {
        let p = self.map2(o, Mul::mul).0;
        p[0] + p[1] + p[2]
    }

    /// Vector product.
    #[must_use]
    pub fn cross(self, o: Self) -> Self {
        let (a, b) = (self.0, o.0);
        Self([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
    }

    /// Euclidean length.
    #[must_use]
    pub fn length(self) -> Dd {
        self.dot(self).sqrt()
    }
}

impl Add for Dd3 {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        self.map2(o, Add::add)
    }
}

impl Sub for Dd3 {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self.map2(o, Sub::sub)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirty_digits_are_right() {
        let third = dd(1.0) / dd(3.0);
        let back = (third + third + third - dd(1.0)).to_f64();
        assert!(back.abs() < 1e-31, "{back:e}");
        let two = dd(2.0).sqrt();
        let back = (two * two - dd(2.0)).to_f64();
        assert!(back.abs() < 1e-30 && (two.lo != 0.0), "{back:e}");
        // 1 + 1e-25 is told from 1.
        let small = (dd(1.0) + dd(1e-25)) * (dd(1.0) - dd(1e-25)) - dd(1.0);
        assert!(small.to_f64().abs() < 1e-31);
        assert!(dd(1.0) + dd(1e-25) > dd(1.0));
    }
}
