//! What the analytic shapes have in common. One formula each, in f64, shared by all backends.

use super::{Bounds, RayPacket};
use glam::{DAffine3, DVec2, DVec3};

/// A solid or surface given by a formula, in its own space.
///
/// Every answer about a ray `o + t*d` is computed in f64 from plain sums, products,
/// quotients and roots, and is right while `|d|`, sizes and coordinates stay within
/// `1e-70 ..= 1e70`. `d` need not be unit. A NaN in the ray is a miss, and -0.0 is +0.0.
pub trait Shape: Copy + std::fmt::Debug + Send + Sync + 'static {
    /// The tightest axis-aligned box around the shape after `to_world`, to f64 rounding.
    fn bounds(&self, to_world: &DAffine3) -> Bounds;

    /// Parameter of the nearest point of the surface in the open interval `(t_near, t_far)`.
    fn hit(&self, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> Option<f64>;

    /// [`hit`](Self::hit) for `N` rays, the same bits: infinity in the lanes that miss, `None`
    /// when all do. Meant to be inlined into a [`Kernel`](crate::simd::Kernel).
    fn hit_lanes<T: Copy + Into<f64>, const N: usize>(&self, rays: &Lanes<'_, T, N>) -> Option<[f64; N]>;

    /// Whether `p` lies inside; never for a surface that encloses nothing.
    fn contains(&self, p: DVec3) -> bool;

    /// The surface point of the nearest hit beyond `t_near`.
    ///
    /// `t` is what the backend reported. It decides only where this computation, asked about a
    /// slightly different ray, finds no hit: a reported hit stays one, and the answer is the
    /// point of the surface near `o + t*d`.
    fn refine(&self, o: DVec3, d: DVec3, t_near: f64, t: f64) -> ShapePoint {
        self.refine_for(o, d, t_near, t, true)
    }

    /// [`refine`](Self::refine) that may leave the texture coordinates out unless `uv` says that
    /// they are wanted: on round shapes they cost more than all the rest.
    fn refine_for(&self, o: DVec3, d: DVec3, t_near: f64, t: f64, uv: bool) -> ShapePoint;
}

/// A point of a shape's surface, in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapePoint {
    /// Ray parameter.
    pub t: f64,
    /// The point, projected onto the surface: no rounding of `t` is in it.
    pub p: DVec3,
    /// Unit geometric normal, outwards (a quad's is that of its +z side), whichever side the ray came from.
    pub ng: DVec3,
    /// Texture coordinates, u to the right and v downwards, each in `[0, 1]`.
    pub uv: DVec2,
    /// Size of the primitive, for [`offset_origin`](super::offset_origin): half the longest edge of its bounds.
    pub extent: f64,
    /// Which part of the surface; the shape says how they are numbered.
    pub part: u8,
}

impl ShapePoint {
    /// Whether a ray along `d` passes to the inner side here.
    #[inline]
    #[must_use]
    pub fn entering(&self, d: DVec3) -> bool {
        d.dot(self.ng) < 0.0
    }
}

/// `N` rays as a structure of arrays, wherever the arrays are kept, in f32 or f64.
#[derive(Clone, Copy, Debug)]
pub struct Lanes<'a, T, const N: usize> {
    /// Origins: x, y, z.
    pub o: [&'a [T; N]; 3],
    /// Directions: x, y, z.
    pub d: [&'a [T; N]; 3],
    /// Starts of the intervals.
    pub t_near: &'a [T; N],
    /// Ends of the intervals.
    pub t_far: &'a [T; N],
}

impl<T: Copy + Into<f64>, const N: usize> Lanes<'_, T, N> {
    #[inline(always)]
    pub(super) fn o(&self, lane: usize) -> DVec3 {
        DVec3::new(self.o[0][lane].into(), self.o[1][lane].into(), self.o[2][lane].into())
    }

    #[inline(always)]
    pub(super) fn d(&self, lane: usize) -> DVec3 {
        DVec3::new(self.d[0][lane].into(), self.d[1][lane].into(), self.d[2][lane].into())
    }

    #[inline(always)]
    pub(super) fn t_near(&self, lane: usize) -> f64 {
        self.t_near[lane].into()
    }

    #[inline(always)]
    pub(super) fn t_far(&self, lane: usize) -> f64 {
        self.t_far[lane].into()
    }
}

impl<'a, const N: usize> From<&'a RayPacket<N>> for Lanes<'a, f32, N> {
    fn from(r: &'a RayPacket<N>) -> Self {
        Self { o: [&r.o_x, &r.o_y, &r.o_z], d: [&r.d_x, &r.d_y, &r.d_z], t_near: &r.t_near, t_far: &r.t_far }
    }
}

/// Why a shape cannot be built. Who reads the scene adds the object's name and line.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// A radius, height or half size is not a positive number.
    #[error("{what} is {value}; it must be a finite number above 0")]
    Size {
        /// Which one.
        what: &'static str,
        /// As given.
        value: f64,
    },
    /// A position has a component that is NaN or infinite.
    #[error("center is ({}, {}, {}); its components must be finite numbers", center.x, center.y, center.z)]
    Center {
        /// As given.
        center: DVec3,
    },
    /// Coordinates in the world are beyond f64.
    #[error("it reaches further than numbers do")]
    TooFar,
    /// An entry of the object-to-world matrix is NaN or infinite.
    #[error("the transform has an entry that is not a finite number")]
    TransformNotFinite,
    /// The object-to-world matrix flattens space, so that no ray can be taken back.
    #[error(
        "the transform is singular: it flattens the object (its axes span {volume:e} of the volume of a box with edges \
         as long); give every axis a scale other than 0 and a direction of its own"
    )]
    Singular {
        /// `|det|` over the product of the columns' lengths.
        volume: f64,
    },
}

/// `value` if it is finite and positive.
pub(super) fn size(what: &'static str, value: f64) -> Result<f64, ShapeError> {
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err(ShapeError::Size { what, value }) }
}

/// The roots of `a t^2 - 2 b t + c`, smaller first, each as a quotient: who needs one divides once.
///
/// `q = b +- root` takes the sign that adds, so nothing cancels; one root is `q/a`, the other `c/q`.
/// Where `q` is 0, the ray touches the surface at `t = 0` and stays outside: whatever `c/q` is then, no
/// parameter above 0 comes of it but infinity, which is a miss.
/// Source: D. Goldberg, "What Every Computer Scientist Should Know About Floating-Point Arithmetic", 1991.
#[derive(Clone, Copy)]
pub(super) struct Roots {
    near: (f64, f64),
    far: (f64, f64),
}

impl Roots {
    /// `root` is the square root of `b^2 - a c`, and `b` not -0.0.
    #[inline(always)]
    pub(super) fn new(a: f64, b: f64, c: f64, root: f64) -> Self {
        let ahead = b >= 0.0;
        let q = if ahead { b + root } else { b - root };
        Self { near: if ahead { (c, q) } else { (q, a) }, far: if ahead { (q, a) } else { (c, q) } }
    }

    #[inline(always)]
    pub(super) fn near(&self) -> f64 {
        self.near.0 / self.near.1
    }

    #[inline(always)]
    pub(super) fn far(&self) -> f64 {
        self.far.0 / self.far.1
    }
}

/// `1 / sqrt(squared)`; where that is about `1 / expected`, one step of Newton's from there instead of the root.
///
/// The step leaves 3/8 of the square of what the argument was off, relatively: nothing below 1e-8.
#[inline(always)]
pub(super) fn inverse_length(squared: f64, expected: f64) -> f64 {
    let wanted = expected * expected;
    if (squared - wanted).abs() <= 1e-8 * wanted {
        (1.5 * wanted - 0.5 * squared) / (wanted * expected)
    } else {
        1.0 / squared.sqrt()
    }
}

/// The part of a ray between the planes `-half` and `half` of one axis; `near > far` when there is none,
/// and NaN when the ray has one.
///
/// By division: `h * (1/d) - o * (1/d)` is infinity minus infinity for every ray along an axis.
#[inline(always)]
pub(super) fn slab(half: f64, o: f64, d: f64) -> (f64, f64) {
    let side = half.copysign(d);
    let (near, far) = ((-side - o) / d, (side - o) / d);
    let everything = if o.abs() <= half { f64::INFINITY } else { f64::NEG_INFINITY };
    if d == 0.0 { (-everything, everything) } else { (near, far) }
}

/// The first of `near <= far` inside the open interval; infinity when there is none or not `ok`.
#[inline(always)]
pub(super) fn first_inside(near: f64, far: f64, t_near: f64, t_far: f64, ok: bool) -> f64 {
    let t = if near > t_near { near } else { far };
    if ok & (t > t_near) & (t < t_far) { t } else { f64::INFINITY }
}

/// `t` unless it is infinity, the miss of the kernels.
#[inline(always)]
pub(super) fn some_hit(t: f64) -> Option<f64> {
    (t < f64::INFINITY).then_some(t)
}

/// `t` unless all lanes miss.
#[inline(always)]
pub(super) fn some_lane<const N: usize>(t: [f64; N]) -> Option<[f64; N]> {
    let mut any = 0u64;
    for x in t {
        any |= u64::from(x < f64::INFINITY);
    }
    (any != 0).then_some(t)
}
