//! Axis-aligned boxes.

use glam::{DAffine3, DVec3};

/// An axis-aligned box; empty when `lo > hi` in any axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least corner.
    pub lo: DVec3,
    /// Greatest corner.
    pub hi: DVec3,
}

impl Bounds {
    /// The box that holds nothing: it grows to whatever is added.
    pub const EMPTY: Self = Self { lo: DVec3::INFINITY, hi: DVec3::NEG_INFINITY };

    /// Whether it holds no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.lo.cmple(self.hi).all()
    }

    /// Whether they have a point in common.
    #[inline]
    #[must_use]
    pub fn meets(&self, other: &Self) -> bool {
        self.lo.cmple(other.hi).all() && other.lo.cmple(self.hi).all()
    }

    /// The smallest box that holds this one and `p`.
    #[must_use]
    pub fn with(self, p: DVec3) -> Self {
        Self { lo: self.lo.min(p), hi: self.hi.max(p) }
    }

    /// The smallest box that holds both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    /// Box around the box that `to` makes of this one.
    #[must_use]
    pub fn under(&self, to: &DAffine3) -> Self {
        if self.is_empty() {
            return *self;
        }
        let (m, half) = (to.matrix3, 0.5 * self.hi - 0.5 * self.lo);
        let half = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        let center = to.transform_point3(self.center());
        Self { lo: center - half, hi: center + half }
    }

    /// Middle of the box; zero for an empty one.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { 0.5 * self.lo + 0.5 * self.hi }
    }

    /// Edge lengths; zero for an empty one.
    #[must_use]
    pub fn size(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.hi - self.lo }
    }
}

impl FromIterator<DVec3> for Bounds {
    fn from_iter<I: IntoIterator<Item = DVec3>>(points: I) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::with)
    }
}
