//! Between a file's coordinates and the scene's own.

use glam::DVec3;

/// `world = origin + local * 2^exponent`: a shift and an exact scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// World position of the local origin.
    pub origin: DVec3,
    /// Binary logarithm of the world units per local unit.
    pub exponent: i32,
}

impl Frame {
    /// Local is world.
    pub const IDENTITY: Self = Self { origin: DVec3::ZERO, exponent: 0 };

    /// World units per local unit.
    #[must_use]
    pub fn world_per_local(&self) -> f64 {
        2f64.powi(self.exponent)
    }

    /// Local units per world unit.
    #[must_use]
    pub fn local_per_world(&self) -> f64 {
        2f64.powi(-self.exponent)
    }

    /// A point given in world coordinates.
    #[must_use]
    pub fn to_local(&self, p: DVec3) -> DVec3 {
        (p - self.origin) * self.local_per_world()
    }

    /// A point given in local coordinates.
    #[must_use]
    pub fn to_world(&self, p: DVec3) -> DVec3 {
        self.origin + p * self.world_per_local()
    }
}
