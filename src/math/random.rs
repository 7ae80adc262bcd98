//! Numbers that look random and depend on nothing but a seed and how many were drawn before.

use glam::{DVec3, Vec3};

/// Splitmix64: for choosing rays and shapes to try. Pictures have [`PixelSamples`](super::PixelSamples).
///
/// Source: G. L. Steele, D. Lea, C. H. Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014.
#[derive(Clone, Debug)]
pub struct Random(
    /// The seed, and what became of it.
    pub u64,
);

impl Random {
    /// The numbers of item `index` of a stream, so that items can be made in any order.
    #[must_use]
    pub fn of(seed: u32, stream: u32, index: u64) -> Self {
        let mut start = Self(u64::from(seed) << 32 | u64::from(stream));
        Self(start.bits() ^ index.wrapping_mul(0xd134_2543_de82_ef95))
    }

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

    /// In `[from, to)`.
    pub fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.unit()
    }

    /// In `[-1, 1)`.
    pub fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// Below `n`, which is above 0.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// Either.
    pub fn flip(&mut self) -> bool {
        self.bits() >> 63 == 1
    }

    /// In the cube from -1 to 1.
    pub fn point(&mut self) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| self.signed()))
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
