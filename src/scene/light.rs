//! Lights.

use glam::{DVec3, Vec3};

/// A light at a point, or a ball that shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Its middle.
    pub position: DVec3,
    /// Linear RGB; with a falloff, what arrives at a distance of 1 in world units.
    pub color: Vec3,
    /// Radius in scene units; 0 is a point, with hard shadows.
    pub radius: f64,
    /// Weakens with the square of the distance, in scene units: what arrives is `color / (f d^2)`.
    /// `None`: the same at every distance.
    pub falloff: Option<f64>,
}

impl Light {
    /// A point light of the same strength at every distance.
    #[must_use]
    pub fn constant(position: DVec3, color: Vec3) -> Self {
        Self { position, color, radius: 0.0, falloff: None }
    }
}
