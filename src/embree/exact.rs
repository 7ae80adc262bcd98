//! Scenes for rays in f64. Shapes are asked about the very ray; boxes and triangles see it rounded to f32.
//!
//! A scene of its own kind: only here are shapes given callbacks that look for an f64 ray behind Embree's context,
//! and only here is a ray sent, always with one. Neither can be mixed with the f32 kind.

use super::fault::Fault;
use super::query::{c_query, intersect_args};
use super::scene::Geometry;
use super::user::{NOTHING, Packet, T_FAR, WITH_HITS, outward, unknown_width, write_box};
use super::{Device, Error, Scene, SceneBuilder, SceneOptions};
use crate::geom::{Bounds, Coherence, Hit, Hit64, Ray, Ray64, ShapeSet, TriangleMesh};
use embree4_sys as sys;
use glam::{DAffine3, DVec3};
use std::cell::Cell;
use std::mem::MaybeUninit;
use std::sync::Arc;

/// An [`ExactScene`] that takes geometry. Ids count up from 0 as it is added.
#[derive(Debug)]
pub struct ExactBuilder {
    inner: SceneBuilder,
    reach: f64,
    pad: f64,
}

/// A built scene that answers rays in f64, on any number of threads.
#[derive(Debug)]
pub struct ExactScene {
    inner: Scene,
    reach: f64,
}

impl ExactBuilder {
    /// An empty scene for rays that start no further than `reach` from the origin along any axis; so far at most may
    /// what is added to it reach as well.
    ///
    /// # Errors
    /// As [`SceneBuilder::new`].
    pub fn new(device: &Device, options: SceneOptions, reach: f64) -> Result<Self, Error> {
        // Half an ulp of the origin and, from one end of the scene to the other, of a direction whose largest
        // component is in [1, 2): 3 * 2^-24 of the reach.
        let pad = reach * f64::from(f32::EPSILON);
        Ok(Self { inner: SceneBuilder::new(device, options)?, reach, pad: 2.0 * pad })
    }

    /// As [`SceneBuilder::mesh`].
    ///
    /// # Errors
    /// As there.
    pub fn mesh(&mut self, mesh: Arc<TriangleMesh>) -> Result<u32, Error> {
        self.inner.mesh(mesh)
    }

    /// As [`SceneBuilder::instance`]: the mesh in `child` sees the ray rounded once more.
    ///
    /// # Errors
    /// As there.
    pub fn instance(&mut self, child: Arc<Scene>, to_scene: &DAffine3) -> Result<u32, Error> {
        self.inner.instance(child, to_scene)
    }

    /// Adds all shapes of `set` as one geometry and returns its id. What they answer about the f64 ray is what a hit says.
    ///
    /// # Errors
    /// As [`SceneBuilder::shapes`].
    pub fn shapes<S: ShapeSet + 'static>(&mut self, set: Arc<S>) -> Result<u32, Error> {
        let count = set.len();
        let geometry = Geometry::new(self.inner.device(), sys::RTCGeometryType::RTC_GEOMETRY_TYPE_USER)?;
        let set = Arc::new(ExactSet { shapes: set, pad: self.pad, fault: self.inner.fault() });
        let user = Arc::as_ptr(&set).cast_mut().cast();
        self.inner.keep(set);
        // SAFETY: the geometry is live and ours alone.
        unsafe { sys::rtcSetGeometryUserPrimitiveCount(geometry.raw(), count) };
        // SAFETY: `keep` holds the set until the scene is released; callbacks only read it.
        unsafe { sys::rtcSetGeometryUserData(geometry.raw(), user) };
        // SAFETY: this callback and the next are made for the `ExactSet<S>` that the user data points at.
        unsafe { sys::rtcSetGeometryBoundsFunction(geometry.raw(), Some(bounds::<S>), std::ptr::null_mut()) };
        // SAFETY: as above. Nobody asks such a scene whether anything is in the way.
        unsafe { sys::rtcSetGeometryIntersectFunction(geometry.raw(), Some(intersect::<S>)) };
        self.inner.contents.unsplit += u64::from(count);
        self.inner.attach(&geometry, "add shapes")
    }

    /// As [`SceneBuilder::commit`].
    ///
    /// # Errors
    /// As there.
    ///
    /// # Panics
    /// As there.
    pub fn commit(self, progress: Option<&(dyn Fn(f64) -> bool + Sync)>) -> Result<ExactScene, Error> {
        Ok(ExactScene { inner: self.inner.commit(progress)?, reach: self.reach })
    }
}

impl ExactScene {
    /// The hits of `ray` one after the other, each found when it is asked for. The largest component of its direction
    /// must be in `[1, 2)`, and its start and end within reach, where it has one.
    ///
    /// Shapes come with their exact `t`, inside the open interval. Triangles are met by the rounded ray, from `slack`
    /// before the interval to as much behind it, so that none is left out for its rounding; who asks computes their `t`
    /// anew. With `aside` that ray is off by two ulps more, across its main axis: exactly at a vertex, where the
    /// triangles around it can leave a gap, it then meets one of them.
    #[must_use]
    pub fn hits_along(&self, ray: &Ray64, slack: f64, aside: bool) -> HitsAlong<'_> {
        let base = ray.t_near - slack;
        let mut o = DVec3::from_array([0, 1, 2].map(|k| base.mul_add(ray.d[k], ray.o[k])));
        let small = ray.d.abs().cmplt(DVec3::splat(f32::MIN_POSITIVE.into()));
        // -0.0 becomes +0.0 as well.
        let mut d = DVec3::select(small, DVec3::ZERO, ray.d);
        if aside {
            let across = DVec3::select(ray.d.abs().cmpge(DVec3::ONE), DVec3::ZERO, DVec3::splat(f32::EPSILON.into()));
            (o, d) = (o + self.reach * across, d + across);
        }
        let (o, d) = (o.as_vec3(), d.as_vec3());
        let mut query = MaybeUninit::uninit();
        // SAFETY: fills the context that it is given.
        unsafe { sys::rtcInitRayQueryContext(query.as_mut_ptr()) };
        // SAFETY: filled by the call above.
        let query = unsafe { query.assume_init() };
        let context = Context { query, ray: *ray, base, nearest: Cell::new(None) };
        let t_far = ((ray.t_far - base + slack) as f32).next_up();
        HitsAlong { scene: &self.inner, context, ray: Ray { o, d, t_near: 0.0, t_far } }
    }

    /// The device it was built on.
    #[must_use]
    pub fn device(&self) -> &Device {
        self.inner.device()
    }
}

/// The hits of one ray; see [`ExactScene::hits_along`].
pub struct HitsAlong<'a> {
    scene: &'a Scene,
    context: Context,
    /// As boxes and triangles see it.
    ray: Ray,
}

impl std::fmt::Debug for HitsAlong<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("HitsAlong").field("ray", &self.context.ray).finish_non_exhaustive()
    }
}

impl Iterator for HitsAlong<'_> {
    type Item = Hit64;

    /// # Panics
    /// With the panic of a shape, if there was one.
    fn next(&mut self) -> Option<Hit64> {
        let hit = self.nearest();
        self.scene.resume_panics();
        let hit = hit?;
        match self.context.nearest.get() {
            Some(shape) if (shape.geom_id, shape.prim_id) == (hit.geom_id, hit.prim_id) => {
                self.context.ray.t_near = shape.t;
                Some(shape)
            }
            _ => {
                self.ray.t_near = hit.t.next_up();
                let t = self.context.base + f64::from(hit.t);
                let (u, v) = (f64::from(hit.u), f64::from(hit.v));
                Some(Hit64 { t, u, v, prim_id: hit.prim_id, geom_id: hit.geom_id })
            }
        }
    }
}

impl HitsAlong<'_> {
    fn nearest(&mut self) -> Option<Hit> {
        self.context.nearest.set(None);
        let mut args = intersect_args(Coherence::Incoherent);
        args.context = (&raw mut self.context).cast();
        let mut query = c_query(&self.ray);
        // SAFETY: the scene is committed; `query` and `args` are ours alone and initialised, and the context in `args`
        // is the first field of a `Context` that lives on in `self`.
        unsafe { sys::rtcIntersect1(self.scene.raw(), &mut query, &mut args) };
        self.scene.answer(&query)
    }
}

/// What Embree hands through to callbacks: its own context, and behind it the ray as it is.
#[repr(C)]
struct Context {
    query: sys::RTCRayQueryContext,
    ray: Ray64,
    /// The `t` at which the rounded ray starts.
    base: f64,
    /// The nearest shape so far.
    nearest: Cell<Option<Hit64>>,
}

/// What the user pointer of a geometry points at.
struct ExactSet<S> {
    shapes: Arc<S>,
    /// How far the rounded ray may be from the exact one.
    pad: f64,
    fault: Arc<Fault>,
}

/// Writes the box of one shape. Called on Embree's threads while it builds.
unsafe extern "C" fn bounds<S: ShapeSet>(args: *const sys::RTCBoundsFunctionArguments) {
    // SAFETY: Embree passes arguments that are valid for this call.
    let args = unsafe { &*args };
    // SAFETY: the `ExactSet<S>` given with this callback, kept by the scene until after its release.
    let set = unsafe { &*args.geometryUserPtr.cast::<ExactSet<S>>() };
    let padded = |b: Bounds| Bounds { lo: b.lo - set.pad, hi: b.hi + set.pad };
    // SAFETY: Embree's arguments, as above.
    unsafe { write_box(args, set.fault.guard(NOTHING, || outward(padded(set.shapes.bounds(args.primID))))) };
}

/// Keeps the hit of the exact ray with one shape, if it is the nearest.
unsafe extern "C" fn intersect<S: ShapeSet>(args: *const sys::RTCIntersectFunctionNArguments) {
    // SAFETY: Embree passes arguments that are valid for this call.
    let args = unsafe { &*args };
    // SAFETY: as in `bounds`.
    let set = unsafe { &*args.geometryUserPtr.cast::<ExactSet<S>>() };
    if args.N != 1 {
        return set.fault.raise(unknown_width(args.N));
    }
    // SAFETY: this callback is only in scenes inside of an `ExactScene`, which sends no ray without such a context.
    // Nothing else uses it while Embree waits for this call.
    let context = unsafe { &*args.context.cast::<Context>() };
    // SAFETY: one ray and its hit, as `N` says; Embree leaves them to this call.
    let packet = unsafe { Packet::<1, WITH_HITS>::new(args.valid, args.rayhit.cast()) };
    set.fault.guard((), || keep_nearest(&*set.shapes, args, context, packet));
}

fn keep_nearest(
    shapes: &impl ShapeSet,
    args: &sys::RTCIntersectFunctionNArguments,
    context: &Context,
    mut packet: Packet<1, WITH_HITS>,
) {
    let Ray64 { o, d, t_near, t_far } = context.ray;
    let nearest = context.nearest.get().map_or(t_far, |hit| hit.t);
    let t_far = nearest.min(context.base + f64::from(packet.floats(T_FAR)[0]));
    let Some(t) = shapes.hit(args.primID, o, d, t_near, t_far) else { return };
    let Some(found) = packet.found(&[t]) else { return };
    let ids = [args.primID, args.geomID, context.query.instID[0], context.query.instPrimID[0]];
    packet.put_hit((t - context.base) as f32, ids, &found);
    context.nearest.set(Some(Hit64 { t, u: 0.0, v: 0.0, prim_id: args.primID, geom_id: args.geomID }));
}
