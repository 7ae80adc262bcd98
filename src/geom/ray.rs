//! A single ray and its answer.

use glam::Vec3;

/// "No geometry": what the id of a miss holds, here and in Embree.
pub const INVALID_ID: u32 = u32::MAX;

/// The part `(t_near, t_far)` of the half-line `o + t*d`.
///
/// `d` need not be unit length: `t` counts in units of `|d|`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Origin.
    pub o: Vec3,
    /// Direction, any length but zero.
    pub d: Vec3,
    /// Start of the interval, `>= 0`.
    pub t_near: f32,
    /// End of the interval; infinity for a ray without end.
    pub t_far: f32,
}

impl Ray {
    /// A ray from `o` along `d` without end. Direction components too small to be
    /// normal floats become zero: they cannot move a hit, and they slow traversal.
    #[must_use]
    pub fn new(o: Vec3, d: Vec3) -> Self {
        Self::segment(o, d, f32::INFINITY)
    }

    /// As [`Ray::new`], ending at `t_far`.
    #[must_use]
    pub fn segment(o: Vec3, d: Vec3, t_far: f32) -> Self {
        Self { o, d: flush_subnormal(d), t_near: 0.0, t_far }
    }
}

/// Zeroes components below the smallest normal float.
#[must_use]
fn flush_subnormal(d: Vec3) -> Vec3 {
    Vec3::select(d.abs().cmplt(Vec3::splat(f32::MIN_POSITIVE)), Vec3::ZERO, d)
}

/// Nearest answer of a scene to a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter of the hit.
    pub t: f32,
    /// First barycentric: the point is `(1-u-v) p0 + u p1 + v p2`.
    pub u: f32,
    /// Second barycentric.
    pub v: f32,
    /// Geometric normal as wound, not unit length.
    pub ng: Vec3,
    /// Primitive within the geometry: for a mesh the face as it stands in the file.
    pub prim_id: u32,
    /// Geometry within the scene.
    pub geom_id: u32,
}
