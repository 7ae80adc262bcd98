//! Cameras: as a user gives them, in world space.

use glam::DVec3;

/// A camera as given: world space, f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraDesc {
    /// Where it is.
    pub eye: DVec3,
    /// What it looks at.
    pub target: DVec3,
    /// Which way is up in the picture; need not be orthogonal to the view.
    pub up: DVec3,
    /// What lines it projects along.
    pub projection: Projection,
    /// Radius of the thin lens in world units; 0 is a pinhole.
    pub aperture: f64,
    /// Distance from the eye to the plane in focus, along the view; the target's unless given.
    pub focus: Option<f64>,
}

/// Kinds of projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// All rays meet in the eye; the full vertical angle of view in degrees, in (0, 180).
    Perspective {
        /// Vertical field of view in degrees.
        fov_deg: f64,
    },
    /// All rays are parallel.
    Orthographic {
        /// Height of the view in world units.
        height: f64,
    },
}
