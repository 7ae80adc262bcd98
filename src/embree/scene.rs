//! From geometry to a scene that answers rays.

use super::fault::Fault;
use super::instance::Placed;
use super::user::{self, PrimSet, UserSet};
use super::{Device, Error};
use crate::geom::TriangleMesh;
use embree4_sys as sys;
use std::any::Any;
use std::ffi::c_void;
use std::fmt;
use std::ptr::{self, NonNull};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// How much work the build puts into the tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// Four times as fast to build as `Medium`; rays take a seventh longer. Pays below about ten rays per triangle.
    Low,
    /// The surface area heuristic.
    #[default]
    Medium,
    /// With spatial splits: several times the build, for up to 6 % on rays. Together with
    /// [`SceneOptions::robust`] Embree builds the medium tree.
    High,
}

/// How a scene is built.
#[derive(Clone, Copy, Debug)]
pub struct SceneOptions {
    /// Work put into the tree.
    pub quality: Quality,
    /// Lets no ray slip through between two triangles that share an edge; costs 10 to 17 % on rays. On by default.
    pub robust: bool,
    /// Half the memory, for a third on rays.
    pub compact: bool,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self { quality: Quality::default(), robust: true, compact: false }
    }
}

/// A scene that takes geometry. [`commit`](Self::commit) turns it into a [`Scene`].
pub struct SceneBuilder {
    owner: Owner,
    quality: sys::RTCBuildQuality,
    pub(super) contents: Contents,
    pub(super) placed: Placed,
}

/// A built scene: it answers rays, on any number of threads, and never changes.
pub struct Scene {
    owner: Owner,
    pub(super) contents: Contents,
    pub(super) placed: Placed,
    pub(super) width: usize,
}

/// What a scene is made of.
#[derive(Clone, Copy, Default)]
pub(super) struct Contents {
    pub geometries: u32,
    pub meshes: u32,
    /// Shapes and instances, against which Embree never splits a packet.
    pub unsplit: u64,
}

/// Fields are dropped in order: the C scene goes first, then what it points at, then the device.
struct Owner {
    raw: RawScene,
    keep: Vec<Arc<dyn Any + Send + Sync>>,
    fault: Arc<Fault>,
    device: Device,
}

struct RawScene(NonNull<sys::RTCSceneTy>);

// SAFETY: the handle belongs to one owned `SceneBuilder` while it changes, and Embree binds it to no thread.
unsafe impl Send for RawScene {}
// SAFETY: a `Scene` is only queried, which Embree allows from many threads; a `SceneBuilder` does nothing on `&self`.
unsafe impl Sync for RawScene {}

impl Drop for RawScene {
    fn drop(&mut self) {
        // SAFETY: gives back the one reference that `rtcNewScene` gave us.
        unsafe { sys::rtcReleaseScene(self.0.as_ptr()) };
    }
}

impl SceneBuilder {
    /// An empty scene.
    ///
    /// # Errors
    /// [`Error::OverBudget`], [`Error::OutOfMemory`], or [`Error::Call`].
    pub fn new(device: &Device, options: SceneOptions) -> Result<Self, Error> {
        // SAFETY: the device is live.
        let raw = unsafe { sys::rtcNewScene(device.raw()) };
        let raw = created(raw, device, "create a scene")?;
        let keep = Vec::new();
        let owner = Owner { raw: RawScene(raw), keep, fault: Arc::default(), device: device.clone() };

        let mut flags = sys::RTCSceneFlags::RTC_SCENE_FLAG_NONE;
        if options.robust {
            flags |= sys::RTCSceneFlags::RTC_SCENE_FLAG_ROBUST;
        }
        if options.compact {
            flags |= sys::RTCSceneFlags::RTC_SCENE_FLAG_COMPACT;
        }
        let quality = match options.quality {
            Quality::Low => sys::RTCBuildQuality::RTC_BUILD_QUALITY_LOW,
            Quality::Medium => sys::RTCBuildQuality::RTC_BUILD_QUALITY_MEDIUM,
            Quality::High => sys::RTCBuildQuality::RTC_BUILD_QUALITY_HIGH,
        };
        // SAFETY: the scene is live and ours alone.
        unsafe { sys::rtcSetSceneFlags(raw.as_ptr(), flags) };
        // SAFETY: as above.
        unsafe { sys::rtcSetSceneBuildQuality(raw.as_ptr(), quality) };
        device.check("set the options of a scene")?;
        Ok(Self { owner, quality, contents: Contents::default(), placed: Placed::default() })
    }

    /// Adds a mesh and returns its `geom_id`; ids count up from 0. The mesh is shared, not copied.
    ///
    /// A hit's `prim_id` is the place of the triangle in [`TriangleMesh::faces`]; the bad ones are never hit.
    ///
    /// # Errors
    /// [`Error::TooMany`] vertices or triangles, [`Error::OverBudget`], [`Error::OutOfMemory`], or [`Error::Call`].
    pub fn mesh(&mut self, mesh: Arc<TriangleMesh>) -> Result<u32, Error> {
        let vertices = countable("vertices", mesh.vertex_count())?;
        let faces = countable("triangles", mesh.face_count())?;
        let geometry = Geometry::new(&self.owner.device, sys::RTCGeometryType::RTC_GEOMETRY_TYPE_TRIANGLE)?;
        let share = |slot, format, data: *const c_void, count: u32| {
            const STRIDE: usize = 12;
            // SAFETY: `data` are `count` items of three 4-byte numbers, the vertices followed by the float of
            // padding that Embree's 16-byte reads touch; `keep` holds them, unchanged, until the scene is released.
            unsafe {
                sys::rtcSetSharedGeometryBuffer(geometry.raw(), slot, 0, format, data, 0, STRIDE, count as usize);
            }
        };
        let (points, indices) = (mesh.padded_points().as_ptr().cast(), mesh.faces().as_ptr().cast());
        self.keep(mesh);
        share(sys::RTCBufferType::RTC_BUFFER_TYPE_VERTEX, sys::RTCFormat::RTC_FORMAT_FLOAT3, points, vertices);
        share(sys::RTCBufferType::RTC_BUFFER_TYPE_INDEX, sys::RTCFormat::RTC_FORMAT_UINT3, indices, faces);
        self.contents.meshes += 1;
        self.attach(&geometry, "add a mesh")
    }

    /// Adds all shapes of `set` as one geometry and returns its `geom_id`; a hit's `prim_id` is the shape's number.
    ///
    /// A hit's `t` is the set's answer rounded once; its `ng`, `u` and `v` are zero: who wants to know more asks the
    /// set, once for the hit that counts.
    ///
    /// # Errors
    /// [`Error::TooMany`] shapes, [`Error::OverBudget`], [`Error::OutOfMemory`], or [`Error::Call`].
    pub fn shapes<S: PrimSet>(&mut self, set: Arc<S>) -> Result<u32, Error> {
        let count = countable("shapes", set.len() as usize)?;
        let geometry = Geometry::new(&self.owner.device, sys::RTCGeometryType::RTC_GEOMETRY_TYPE_USER)?;
        let set = Arc::new(UserSet { prims: set, fault: self.owner.fault.clone() });
        let user = Arc::as_ptr(&set).cast_mut().cast::<c_void>();
        self.keep(set);
        // SAFETY: the geometry is live and ours alone.
        unsafe { sys::rtcSetGeometryUserPrimitiveCount(geometry.raw(), count) };
        // SAFETY: `keep` holds the set until the scene is released; callbacks only read it.
        unsafe { sys::rtcSetGeometryUserData(geometry.raw(), user) };
        // SAFETY: this callback and those below are made for the `UserSet<S>` that the user data points at.
        unsafe { sys::rtcSetGeometryBoundsFunction(geometry.raw(), Some(user::bounds::<S>), ptr::null_mut()) };
        // SAFETY: as above.
        unsafe { sys::rtcSetGeometryIntersectFunction(geometry.raw(), Some(user::intersect::<S>)) };
        // SAFETY: as above. Without this one no shape would throw a shadow.
        unsafe { sys::rtcSetGeometryOccludedFunction(geometry.raw(), Some(user::occluded::<S>)) };
        self.contents.unsplit += u64::from(count);
        self.attach(&geometry, "add shapes")
    }

    pub(super) fn attach(&mut self, geometry: &Geometry, doing: &'static str) -> Result<u32, Error> {
        // SAFETY: the geometry is live. On the scene alone, low quality would still build the medium tree.
        unsafe { sys::rtcSetGeometryBuildQuality(geometry.raw(), self.quality) };
        // SAFETY: the geometry is live.
        unsafe { sys::rtcCommitGeometry(geometry.raw()) };
        self.owner.device.check(doing)?;
        // SAFETY: scene and geometry are live; the scene takes a reference of its own.
        let id = unsafe { sys::rtcAttachGeometry(self.owner.raw.0.as_ptr(), geometry.raw()) };
        self.owner.device.check(doing)?;
        self.contents.geometries += 1;
        Ok(id)
    }

    pub(super) fn device(&self) -> &Device {
        &self.owner.device
    }

    /// Where panics of callbacks are kept.
    pub(super) fn fault(&self) -> Arc<Fault> {
        Arc::clone(&self.owner.fault)
    }

    /// Keeps `data` until the scene has been released.
    pub(super) fn keep(&mut self, data: Arc<dyn Any + Send + Sync>) {
        self.owner.keep.push(data);
    }

    /// Builds the tree, on the device's threads.
    ///
    /// `progress` is called from several of them with about the share that is done; when it says `false`, the
    /// build stops.
    ///
    /// # Errors
    /// [`Error::Cancelled`] when `progress` said `false`, [`Error::OverBudget`], [`Error::OutOfMemory`], or
    /// [`Error::Call`].
    ///
    /// # Panics
    /// With the panic of `progress` or of a [`PrimSet::bounds`], if there was one.
    pub fn commit(self, progress: Option<&(dyn Fn(f64) -> bool + Sync)>) -> Result<Scene, Error> {
        let Self { owner, contents, placed, .. } = self;
        let watch = Watch { progress, fault: &owner.fault, cancelled: AtomicBool::new(false) };
        let raw = owner.raw.0.as_ptr();
        let user = (&raw const watch).cast_mut().cast::<c_void>();
        // SAFETY: the scene is live; `watch` outlives the build, after which the callback is unhooked.
        unsafe { sys::rtcSetSceneProgressMonitorFunction(raw, Some(on_progress), user) };
        // SAFETY: the scene is live and ours alone: nobody queries it.
        unsafe { sys::rtcCommitScene(raw) };
        // SAFETY: the scene is live.
        unsafe { sys::rtcSetSceneProgressMonitorFunction(raw, None, ptr::null_mut()) };
        let built = owner.device.check("build the scene");
        owner.fault.resume();
        if watch.cancelled.into_inner() {
            return Err(Error::Cancelled);
        }
        built?;
        let width = owner.device.packet_width();
        Ok(Scene { owner, contents, placed, width })
    }
}

impl Scene {
    /// Raises the first panic of a [`PrimSet`] again, if there was one; to be called after each tile. From that
    /// panic on shapes are missed by every ray, so that no answer since the last call must be used.
    ///
    /// # Panics
    /// As said; on every call once there was one.
    #[inline]
    pub fn resume_panics(&self) {
        self.owner.fault.resume();
    }

    /// The device it was built on.
    #[must_use]
    pub fn device(&self) -> &Device {
        &self.owner.device
    }

    pub(super) fn is_one_mesh(&self) -> bool {
        (self.contents.geometries, self.contents.meshes) == (1, 1)
    }

    #[inline]
    pub(super) fn raw(&self) -> sys::RTCScene {
        self.owner.raw.0.as_ptr()
    }
}

impl fmt::Debug for SceneBuilder {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("SceneBuilder").field("geometries", &self.contents.geometries).finish_non_exhaustive()
    }
}

impl fmt::Debug for Scene {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("Scene").field("geometries", &self.contents.geometries).finish_non_exhaustive()
    }
}

/// Our own reference to a geometry; a scene that it is attached to has another.
pub(super) struct Geometry(NonNull<sys::RTCGeometryTy>);

impl Geometry {
    pub fn new(device: &Device, kind: sys::RTCGeometryType) -> Result<Self, Error> {
        // SAFETY: the device is live.
        let raw = unsafe { sys::rtcNewGeometry(device.raw(), kind) };
        created(raw, device, "create a geometry").map(Self)
    }

    pub fn raw(&self) -> sys::RTCGeometry {
        self.0.as_ptr()
    }
}

impl Drop for Geometry {
    fn drop(&mut self) {
        // SAFETY: gives back the one reference that `rtcNewGeometry` gave us.
        unsafe { sys::rtcReleaseGeometry(self.raw()) };
    }
}

fn created<T>(raw: *mut T, device: &Device, doing: &'static str) -> Result<NonNull<T>, Error> {
    device.check(doing)?;
    NonNull::new(raw).ok_or(Error::Call { doing, code: "unknown error", message: String::new() })
}

/// `count` as Embree counts; the last number is its "none".
fn countable(what: &'static str, count: usize) -> Result<u32, Error> {
    u32::try_from(count).ok().filter(|&n| n < u32::MAX).ok_or(Error::TooMany { what, count })
}

/// What the progress callback asks.
struct Watch<'a> {
    progress: Option<&'a (dyn Fn(f64) -> bool + Sync)>,
    fault: &'a Fault,
    cancelled: AtomicBool,
}

/// `false` stops the build.
unsafe extern "C" fn on_progress(user: *mut c_void, done: f64) -> bool {
    // SAFETY: the `Watch` given with this callback; `commit` keeps it for as long as the build runs.
    let watch = unsafe { &*user.cast::<Watch>() };
    if watch.fault.is_raised() || watch.cancelled.load(Relaxed) {
        return false;
    }
    let go_on = watch.fault.guard(true, || watch.progress.is_none_or(|ask| ask(done)));
    if !go_on {
        watch.cancelled.store(true, Relaxed);
    }
    go_on && !watch.fault.is_raised()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_end_before_the_number_that_means_none() {
        assert_eq!(countable("shapes", 4_294_967_294).unwrap(), 4_294_967_294);
        for count in [4_294_967_295, 4_294_967_296, usize::MAX] {
            let error = countable("shapes", count).unwrap_err().to_string();
            assert!(error.starts_with(&format!("{count} shapes are more")), "{error}");
        }
    }
}
