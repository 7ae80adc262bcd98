//! Lights.

use glam::{DVec3, Vec3};

/// A point light of constant strength over distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Where it is.
    pub position: DVec3,
    /// Linear RGB.
    pub color: Vec3,
}
