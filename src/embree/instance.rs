//! A scene placed in another: its tree is built once, however often it is shown.

use super::scene::Geometry;
use super::{Error, Scene, SceneBuilder};
use crate::geom::{Hit, HitLanes, INVALID_ID, cofactors};
use embree4_sys as sys;
use glam::{Affine3A, DAffine3, DMat3, Mat3, Vec3};
use std::sync::Arc;

impl SceneBuilder {
    /// Adds `child` as `to_scene` places it and returns its `geom_id`. The child is shared, not copied.
    ///
    /// A hit has the instance's `geom_id`, the triangle's `prim_id`, and `ng` in the space of this scene, as the moved
    /// corners are wound. Embree takes rays to the child's space in f32, so that hits are about as exact as those of
    /// a mesh whose corners were moved and rounded.
    ///
    /// # Errors
    /// [`Error::NotOneMesh`] when the child is anything but one mesh, [`Error::OtherDevice`] when it was built on another
    /// device, [`Error::Transform`] when f32 cannot undo `to_scene`, [`Error::OverBudget`], [`Error::OutOfMemory`], or
    /// [`Error::Call`].
    pub fn instance(&mut self, child: Arc<Scene>, to_scene: &DAffine3) -> Result<u32, Error> {
        if !child.is_one_mesh() {
            return Err(Error::NotOneMesh);
        }
        // Embree would take it, and leave its memory to a device that may be gone.
        if !child.device().is_same(self.device()) {
            return Err(Error::OtherDevice);
        }
        let matrix = in_f32(to_scene).ok_or(Error::Transform)?;
        let geometry = Geometry::new(self.device(), sys::RTCGeometryType::RTC_GEOMETRY_TYPE_INSTANCE)?;
        // SAFETY: both are live and the child is built. What the child's tree points at is in `keep` until this
        // scene is released.
        unsafe { sys::rtcSetGeometryInstancedScene(geometry.raw(), child.raw()) };
        self.keep(child);
        let columns = matrix.to_cols_array();
        let format = sys::RTCFormat::RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR;
        // SAFETY: the geometry is live; Embree copies the twelve floats.
        unsafe { sys::rtcSetGeometryTransform(geometry.raw(), 0, format, columns.as_ptr().cast()) };
        self.contents.unsplit += 1;
        let id = self.attach(&geometry, "place a scene in another")?;
        self.placed.set(id, cofactors(&matrix.matrix3.as_dmat3()).as_mat3());
        Ok(id)
    }
}

/// `to_scene` in f32, if Embree's way of inverting it there ends where it began, to a thousandth.
fn in_f32(to_scene: &DAffine3) -> Option<Affine3A> {
    let matrix = to_scene.as_affine3a();
    // By cofactors over the determinant, as Embree does; of a large, small or flat one it may overflow or be noise.
    let inverse = matrix.inverse();
    let back = inverse.matrix3.as_dmat3() * matrix.matrix3.as_dmat3() - DMat3::IDENTITY;
    let off = back.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
    // The sum keeps a NaN, `max` does not.
    let honest = back.to_cols_array().into_iter().sum::<f64>().is_finite() && off < 1e-3;
    (honest && matrix.is_finite() && inverse.is_finite()).then_some(matrix)
}

/// The instances of a scene: how Embree's answers become ours.
#[derive(Default)]
pub(super) struct Placed {
    /// What takes `e1 x e2` to the cross product of the moved edges, by `geom_id`; empty when the scene has no instance.
    normals: Vec<Mat3>,
}

impl Placed {
    fn set(&mut self, id: u32, normals: Mat3) {
        let id = id as usize;
        self.normals.resize(self.normals.len().max(id + 1), Mat3::IDENTITY);
        self.normals[id] = normals;
    }

    #[inline]
    pub fn is_empty(&self) -> bool {
        self.normals.is_empty()
    }

    /// `hit` with the id and in the space of the scene; `instance` is no id unless the hit is inside of one.
    #[inline]
    pub fn resolve(&self, hit: Hit, instance: u32) -> Hit {
        match self.normals.get(instance as usize) {
            Some(normals) => Hit { geom_id: instance, ng: *normals * hit.ng, ..hit },
            None => hit,
        }
    }

    /// [`resolve`](Self::resolve) for each lane that hit.
    pub fn resolve_lanes<const N: usize>(&self, hit: &mut HitLanes<N>) {
        for lane in 0..N {
            let instance = if hit.geom_id[lane] == INVALID_ID { INVALID_ID } else { hit.inst_id[lane] };
            if let Some(normals) = self.normals.get(instance as usize) {
                let ng = *normals * Vec3::new(hit.ng_x[lane], hit.ng_y[lane], hit.ng_z[lane]);
                (hit.ng_x[lane], hit.ng_y[lane], hit.ng_z[lane]) = ng.into();
                hit.geom_id[lane] = instance;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn transforms_that_f32_can_undo_and_others() {
        let scaled = |x: f64, y: f64, z: f64| DAffine3::from_scale(DVec3::new(x, y, z));
        let turn = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.8);
        let leaning = |by: f64| turn * DAffine3::from_scale(DVec3::new(1.0, 1.0, by)) * turn.inverse();
        let far = |x: f64| DAffine3::from_translation(DVec3::new(x, 0.0, 0.0));
        let cases = [
            ("nothing", DAffine3::IDENTITY, true),
            ("a mirror", scaled(-1.0, 1.0, 1.0), true),
            ("a needle", scaled(1000.0, 1.0, 1.0), true),
            ("tiny", scaled(1e-12, 1e-12, 1e-12), true),
            ("too tiny: the determinant underflows", scaled(1e-15, 1e-15, 1e-15), false),
            ("huge", scaled(1e12, 1e12, 1e12), true),
            ("too huge: the determinant overflows", scaled(1e13, 1e13, 1e13), false),
            ("flat", scaled(1.0, 0.0, 1.0), false),
            ("nearly flat", leaning(1e-3), true),
            ("flat to f32", leaning(1e-8), false),
            ("beyond f32", scaled(1e39, 1.0, 1.0), false),
            ("far away", far(1e30), true),
            ("too far away", far(1e39), false),
            ("not a number", scaled(f64::NAN, 1.0, 1.0), false),
            ("nowhere", far(f64::NAN), false),
        ];
        for (name, to_scene, want) in cases {
            assert_eq!(in_f32(&to_scene).is_some(), want, "{name}");
        }
    }

    #[test]
    fn hits_outside_of_instances_stay_as_they_are() {
        let mut placed = Placed::default();
        assert!(placed.is_empty());
        placed.set(2, Mat3::from_diagonal(Vec3::splat(4.0)));
        let hit = Hit { t: 1.0, u: 0.0, v: 0.0, ng: Vec3::X, prim_id: 7, geom_id: 0 };
        assert_eq!(placed.resolve(hit, INVALID_ID), hit);
        assert_eq!(placed.resolve(hit, 2), Hit { ng: 4.0 * Vec3::X, geom_id: 2, ..hit });
        assert!(!placed.is_empty());
    }
}
