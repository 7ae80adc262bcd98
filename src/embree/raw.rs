//! What Embree answers by itself, without our care: to compare with.

use super::packet::{Calls, Valid};
use super::query::{c_query, intersect_args, occluded_args};
use super::scene::Geometry;
use super::{Error, Scene, SceneBuilder};
use crate::geom::{Coherence, Hit, INVALID_ID, LANES, PacketBatch, Ray, RayHitPacket, RayPacket};
use embree4_sys as sys;
use glam::Vec3;
use std::ptr;

impl SceneBuilder {
    /// Adds Embree's own spheres, `[x, y, z, radius]` each, and returns their `geom_id`; the numbers are copied.
    /// Embree decides about them in f32, while [`shapes`](Self::shapes) are decided about in f64.
    ///
    /// # Errors
    /// [`Error::OverBudget`], [`Error::OutOfMemory`], or [`Error::Call`].
    pub fn own_spheres(&mut self, spheres: &[[f32; 4]]) -> Result<u32, Error> {
        let geometry = Geometry::new(self.device(), sys::RTCGeometryType::RTC_GEOMETRY_TYPE_SPHERE_POINT)?;
        let (slot, format) = (sys::RTCBufferType::RTC_BUFFER_TYPE_VERTEX, sys::RTCFormat::RTC_FORMAT_FLOAT4);
        // SAFETY: the geometry is live and ours alone.
        let to = unsafe { sys::rtcSetNewGeometryBuffer(geometry.raw(), slot, 0, format, 16, spheres.len()) };
        self.device().check("make room for spheres")?;
        // SAFETY: the call did not fail, so that the buffer has room for as many items of four floats, which nobody
        // else reads or writes before the geometry is committed.
        unsafe { to.cast::<[f32; 4]>().copy_from_nonoverlapping(spheres.as_ptr(), spheres.len()) };
        self.attach(&geometry, "add spheres")
    }
}

impl Scene {
    /// [`intersect`](Self::intersect), but the direction goes to Embree as it is, however long.
    #[must_use]
    pub fn intersect_raw(&self, ray: &Ray) -> Option<Hit> {
        self.intersect_plain(ray)
    }
}

/// A scene that is asked by Embree's calls and nothing else: packets always go out whole and coherent, directions as
/// they are, and ids come back as Embree has them. To measure what care costs.
#[derive(Clone, Copy, Debug)]
pub struct Bare<'a>(&'a Scene);

impl Scene {
    /// Without care.
    #[must_use]
    pub fn bare(&self) -> Bare<'_> {
        Bare(self)
    }
}

impl Bare<'_> {
    /// Nearest hit.
    #[inline]
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut query = c_query(ray);
        // SAFETY: the scene is committed; `query` is ours alone, initialised, and aligned by its type.
        unsafe { sys::rtcIntersect1(self.0.raw(), &mut query, ptr::null_mut()) };
        let hit = &query.hit;
        (hit.geomID != INVALID_ID).then(|| Hit {
            t: query.ray.tfar,
            u: hit.u,
            v: hit.v,
            ng: Vec3::new(hit.Ng_x, hit.Ng_y, hit.Ng_z),
            prim_id: hit.primID,
            geom_id: hit.geomID,
        })
    }

    /// Nearest hits; the hit lanes' ids must say that there is none yet.
    pub fn intersect_batch(&self, batch: &mut PacketBatch<RayHitPacket>) {
        let mut args = intersect_args(Coherence::Coherent);
        for (packet, live) in batch.packets_mut() {
            // SAFETY: the scene is committed, and `args` were filled by Embree.
            unsafe { RayPacket::<LANES>::intersect(&Valid::first(live), self.0.raw(), packet, &mut args) };
        }
    }

    /// Whether each ray meets anything: its `t_far` becomes minus infinity then.
    pub fn occluded_batch(&self, batch: &mut PacketBatch<RayPacket>) {
        let mut args = occluded_args(Coherence::Coherent);
        for (packet, live) in batch.packets_mut() {
            // SAFETY: as above.
            unsafe { RayPacket::<LANES>::occluded(&Valid::first(live), self.0.raw(), packet, &mut args) };
        }
    }
}
