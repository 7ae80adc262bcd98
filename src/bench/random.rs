//! Numbers that look random and are the same on every run.

use glam::{DVec3, Vec3};

/// Splitmix64.
///
/// Source: G. L. Steele, D. Lea, C. H. Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014.
#[derive(Clone, Debug)]
pub struct Random(
    /// The seed, and what became of it.
    pub u64,
);

impl Random {
    /// 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Below `n`, which is above 0.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// In the cube from -1 to 1.
    pub fn point(&mut self) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| 2.0 * self.unit() - 1.0))
    }

    /// Unit, evenly over the sphere.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let p = self.point();
            if (1e-3..1.0).contains(&p.length_squared()) {
                return p.normalize();
            }
        }
    }

    /// Of a triangle's surface.
    pub fn inside(&mut self, [a, b, c]: [Vec3; 3]) -> DVec3 {
        let (u, v) = (self.unit(), self.unit());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let [a, b, c] = [a, b, c].map(Vec3::as_dvec3);
        a + u * (b - a) + v * (c - a)
    }
}
