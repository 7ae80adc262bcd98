//! What Embree answers by itself, without our care: to compare with.

use super::scene::Geometry;
use super::{Error, Scene, SceneBuilder};
use crate::geom::{Hit, Ray};
use embree4_sys as sys;

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
