//! A single ray and its answer, in f32 and in f64.

use glam::{DVec3, Vec3};

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

/// The part `(t_near, t_far)` of the half-line `o + t*d` in f64, for who wants to know exactly.
///
/// The interval is open. `d` need not be unit length: `t` counts in units of `|d|`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray64 {
    /// Origin.
    pub o: DVec3,
    /// Direction, any length but zero.
    pub d: DVec3,
    /// Start of the interval.
    pub t_near: f64,
    /// End of the interval; infinity for a ray without end.
    pub t_far: f64,
}

/// Answer of a backend to a [`Ray64`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit64 {
    /// Ray parameter, as exact as the backend has it.
    pub t: f64,
    /// First barycentric of a triangle, as in [`Hit`]; 0 for a shape.
    pub u: f64,
    /// Second barycentric.
    pub v: f64,
    /// Primitive within the geometry.
    pub prim_id: u32,
    /// Geometry within the scene.
    pub geom_id: u32,
}
