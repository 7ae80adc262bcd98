//! Many shapes of one class, as backends take them: a loop or callback per class, no dispatch per shape.

use super::transform::{invert, normal_matrix};
use super::{Bounds, Lanes, Shape, ShapeError, ShapePoint};
use crate::simd::{self, Kernel};
use glam::{DAffine3, DMat3, DVec3};

/// Primitives of one class in world space. Rays are given in world space, `d` of any length, and `t`
/// counts in units of it.
///
/// # Panics
/// The methods that take a `prim` panic if it is not below `len`.
pub trait ShapeSet: Send + Sync {
    /// Number of primitives.
    fn len(&self) -> u32;

    /// Whether there is none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The tightest box around primitive `prim`, to f64 rounding: round it outwards.
    fn bounds(&self, prim: u32) -> Bounds;

    /// Parameter of the nearest hit in the open interval `(t_near, t_far)`.
    fn hit(&self, prim: u32, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> Option<f64>;

    /// Whether anything of the primitive lies in the open interval.
    fn occludes(&self, prim: u32, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> bool {
        self.hit(prim, o, d, t_near, t_far).is_some()
    }

    /// [`hit`](Self::hit) for `N` rays, the same bits: infinity in the lanes that miss, `None` when all do.
    #[inline]
    fn hit_lanes<T: Copy + Into<f64>, const N: usize>(&self, prim: u32, rays: &Lanes<'_, T, N>) -> Option<[f64; N]>
    where
        Self: Sized,
    {
        if N == 1 { self.hit_lanes_here(prim, rays) } else { simd::run(HitLanes { set: self, prim, rays }) }
    }

    /// [`hit_lanes`](Self::hit_lanes) in the instructions of the caller: for a [`Kernel`] to inline.
    fn hit_lanes_here<T: Copy + Into<f64>, const N: usize>(
        &self,
        prim: u32,
        rays: &Lanes<'_, T, N>,
    ) -> Option<[f64; N]>
    where
        Self: Sized;

    /// Whether `p` lies inside of shape `prim`; see [`Shape::contains`].
    fn contains(&self, prim: u32, p: DVec3) -> bool;

    /// Bytes of the shapes.
    fn bytes(&self) -> usize;

    /// The surface point of a hit that a backend reported with parameter `t`, anew in f64 for the
    /// same ray; see [`Shape::refine`].
    fn refine(&self, prim: u32, o: DVec3, d: DVec3, t_near: f64, t: f64) -> ShapePoint {
        self.refine_for(prim, o, d, t_near, t, true)
    }

    /// [`refine`](Self::refine), with texture coordinates only if `uv` says so; see [`Shape::refine_for`].
    fn refine_for(&self, prim: u32, o: DVec3, d: DVec3, t_near: f64, t: f64, uv: bool) -> ShapePoint;
}

/// Number of a new primitive.
///
/// # Panics
/// When it does not fit the 32 bits of a primitive id, the last of which means "none".
fn next_id(len: usize) -> u32 {
    u32::try_from(len).ok().filter(|&id| id < super::INVALID_ID).expect("fewer than 2^32 - 1 shapes fit in memory")
}

struct HitLanes<'a, S, T, const N: usize> {
    set: &'a S,
    prim: u32,
    rays: &'a Lanes<'a, T, N>,
}

impl<S: ShapeSet, T: Copy + Into<f64>, const N: usize> Kernel for HitLanes<'_, S, T, N> {
    type Output = Option<[f64; N]>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        self.set.hit_lanes_here(self.prim, self.rays)
    }
}

/// A packet of one: the single test leaves early, which the loop over lanes cannot.
#[inline(always)]
fn one_lane<T: Copy + Into<f64>, const N: usize>(
    set: &impl ShapeSet,
    prim: u32,
    rays: &Lanes<'_, T, N>,
) -> Option<[f64; N]> {
    set.hit(prim, rays.o(0), rays.d(0), rays.t_near(0), rays.t_far(0)).map(|t| [t; N])
}

/// Shapes whose own space is the world: spheres and axis-aligned boxes without a transform.
#[derive(Clone, Debug)]
pub struct Plain<S> {
    shapes: Vec<S>,
}

impl<S> Default for Plain<S> {
    fn default() -> Self {
        Self { shapes: Vec::new() }
    }
}

impl<S: Shape> Plain<S> {
    /// Shape number `prim`.
    ///
    /// # Panics
    /// If there is none.
    #[inline]
    #[must_use]
    pub fn get(&self, prim: u32) -> &S {
        &self.shapes[prim as usize]
    }

    /// Adds a shape and tells its number.
    pub fn push(&mut self, shape: S) -> u32 {
        let id = next_id(self.shapes.len());
        self.shapes.push(shape);
        id
    }
}

impl<S: Shape> ShapeSet for Plain<S> {
    fn len(&self) -> u32 {
        self.shapes.len() as u32
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.shapes[..])
    }

    fn contains(&self, prim: u32, p: DVec3) -> bool {
        self.shapes[prim as usize].contains(p)
    }

    fn bounds(&self, prim: u32) -> Bounds {
        self.shapes[prim as usize].bounds(&DAffine3::IDENTITY)
    }

    #[inline]
    fn hit(&self, prim: u32, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> Option<f64> {
        self.shapes[prim as usize].hit(o, d, t_near, t_far)
    }

    #[inline(always)]
    fn hit_lanes_here<T: Copy + Into<f64>, const N: usize>(
        &self,
        prim: u32,
        rays: &Lanes<'_, T, N>,
    ) -> Option<[f64; N]> {
        if N == 1 { one_lane(self, prim, rays) } else { self.shapes[prim as usize].hit_lanes(rays) }
    }

    #[inline]
    fn refine_for(&self, prim: u32, o: DVec3, d: DVec3, t_near: f64, t: f64, uv: bool) -> ShapePoint {
        self.shapes[prim as usize].refine_for(o, d, t_near, t, uv)
    }
}

/// Shapes under an affine transform each: rotated, stretched, sheared, mirrored, moved.
#[derive(Clone, Debug)]
pub struct Affine<S> {
    placed: Vec<Placed<S>>,
    to_world: Vec<DAffine3>,
}

/// All that a test of one shape reads.
#[derive(Clone, Copy, Debug)]
struct Placed<S> {
    shape: S,
    /// Inverse of the linear part.
    inverse: DMat3,
    translation: DVec3,
}

impl<S> Default for Affine<S> {
    fn default() -> Self {
        Self { placed: Vec::new(), to_world: Vec::new() }
    }
}

impl<S: Shape> Affine<S> {
    /// Adds `shape` as `to_world` places it and tells its number.
    ///
    /// # Errors
    /// [`ShapeError::TransformNotFinite`], or [`ShapeError::Singular`] when the axes span less than 4e-15 of the
    /// volume that they would at right angles, which rounding cannot tell from nothing.
    pub fn push(&mut self, shape: S, to_world: DAffine3) -> Result<u32, ShapeError> {
        let inverse = invert(&to_world)?;
        let id = next_id(self.placed.len());
        self.placed.push(Placed { shape, inverse, translation: to_world.translation });
        self.to_world.push(to_world);
        Ok(id)
    }
}

impl<S: Shape> Placed<S> {
    /// Subtraction first: an inverse with the translation folded in cancels for what is far from the origin.
    /// `d` is not normalised, so that `t` is the same number in both spaces.
    #[inline(always)]
    fn local_ray(&self, o: DVec3, d: DVec3) -> (DVec3, DVec3) {
        (self.inverse * (o - self.translation), self.inverse * d)
    }
}

impl<S: Shape> ShapeSet for Affine<S> {
    fn len(&self) -> u32 {
        self.placed.len() as u32
    }

    fn contains(&self, prim: u32, p: DVec3) -> bool {
        let placed = &self.placed[prim as usize];
        placed.shape.contains(placed.inverse * (p - placed.translation))
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.placed[..]) + size_of_val(&self.to_world[..])
    }

    fn bounds(&self, prim: u32) -> Bounds {
        self.placed[prim as usize].shape.bounds(&self.to_world[prim as usize])
    }

    #[inline]
    fn hit(&self, prim: u32, o: DVec3, d: DVec3, t_near: f64, t_far: f64) -> Option<f64> {
        let placed = &self.placed[prim as usize];
        let (o, d) = placed.local_ray(o, d);
        placed.shape.hit(o, d, t_near, t_far)
    }

    #[inline(always)]
    fn hit_lanes_here<T: Copy + Into<f64>, const N: usize>(
        &self,
        prim: u32,
        rays: &Lanes<'_, T, N>,
    ) -> Option<[f64; N]> {
        if N == 1 {
            return one_lane(self, prim, rays);
        }
        let placed = &self.placed[prim as usize];
        let (mut o, mut d) = ([[0.0; N]; 3], [[0.0; N]; 3]);
        let (mut t_near, mut t_far) = ([0.0; N], [0.0; N]);
        for i in 0..N {
            let (o_i, d_i) = placed.local_ray(rays.o(i), rays.d(i));
            (o[0][i], o[1][i], o[2][i]) = o_i.into();
            (d[0][i], d[1][i], d[2][i]) = d_i.into();
            (t_near[i], t_far[i]) = (rays.t_near(i), rays.t_far(i));
        }
        placed.shape.hit_lanes(&Lanes { o: o.each_ref(), d: d.each_ref(), t_near: &t_near, t_far: &t_far })
    }

    fn refine_for(&self, prim: u32, o: DVec3, d: DVec3, t_near: f64, t: f64, uv: bool) -> ShapePoint {
        let placed = &self.placed[prim as usize];
        let to_world = &self.to_world[prim as usize];
        let (o, d) = placed.local_ray(o, d);
        let local = placed.shape.refine_for(o, d, t_near, t, uv);
        let ng = normal_matrix(&to_world.matrix3) * local.ng;
        ShapePoint {
            p: to_world.matrix3 * local.p + to_world.translation,
            ng: ng.normalize(),
            extent: 0.5 * self.bounds(prim).size().max_element(),
            ..local
        }
    }
}
