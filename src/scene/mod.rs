//! From files to one frozen scene. Knows `geom` and `math`; never which backend runs.
//!
//! The scene lives in its own space: the file's coordinates less an f64 origin, scaled by a
//! power of two to a size of about 1, so that f32 spends its digits on the shape and not on
//! where it stands. [`Frame`] leads there and back.

mod camera;
pub mod desc;
mod error;
pub mod example;
pub mod format;
mod framing;
mod light;
mod load;
mod material;
mod needs;
pub mod obj;
pub mod smooth;

pub use camera::{Camera, CameraDesc, CameraRays, Projection};
pub use error::{Error, Warning};
pub use framing::{CameraOverrides, View};
pub use light::Light;
pub use load::{LoadOptions, Loaded, load};
pub use material::{Material, Reflect};
pub use needs::Needs;

use crate::geom::{Bounds, TriangleMesh};
use crate::math::Frame;
use glam::Vec3;
use obj::CornerData;
use std::sync::Arc;

/// Everything a render reads. Frozen: made by [`load`], then only lit and looked at.
#[derive(Debug)]
pub struct Scene {
    /// Between the file's coordinates and the scene's own.
    pub frame: Frame,
    /// What there is to hit; an object's index is its geometry id in every backend.
    pub objects: Vec<Object>,
    /// Materials by index, at least one.
    pub materials: Vec<Material>,
    /// Lights, in scene space.
    pub lights: Vec<Light>,
    /// Ambient light, linear RGB.
    pub ambient: Vec3,
    /// What a ray sees that hits nothing, linear RGB.
    pub background: Vec3,
}

/// A mesh and what is known at its corners.
#[derive(Debug)]
pub struct Object {
    /// The triangles, in scene space.
    pub mesh: Arc<TriangleMesh>,
    /// Normals at the corners; absent where the mesh is flat.
    pub normals: Option<CornerData>,
    /// Material of each triangle; absent where one serves all.
    pub face_materials: Option<Vec<u32>>,
}

/// How much of everything there is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(missing_docs, reason = "the things counted")]
pub struct SceneCounts {
    pub objects: usize,
    pub vertices: usize,
    /// As written, the bad ones included.
    pub triangles: usize,
    /// Without area: kept in their place, never hit.
    pub degenerate: usize,
    /// With a coordinate that is no finite number: kept in their place, never hit.
    pub non_finite: usize,
    pub spheres: usize,
    pub cubes: usize,
    pub cylinders: usize,
    pub lights: usize,
    pub materials: usize,
}

impl Object {
    /// The three normals with these numbers; `None` unless there are all three.
    #[inline]
    #[must_use]
    pub fn normals_at(&self, numbers: [u32; 3]) -> Option<[Vec3; 3]> {
        let normals = self.normals.as_ref()?;
        let [a, b, c] = numbers.map(|i| normals.get::<3>(i).map(Vec3::from));
        Some([a?, b?, c?])
    }

    /// Index of the material of triangle `prim`.
    #[inline]
    #[must_use]
    pub fn material(&self, prim: u32) -> usize {
        self.face_materials.as_ref().map_or(0, |m| m[prim as usize] as usize)
    }
}

impl Scene {
    /// Box around all that can be hit, in scene space.
    #[must_use]
    pub fn local_bounds(&self) -> Bounds {
        self.objects.iter().map(|o| o.mesh.bounds()).fold(Bounds::EMPTY, Bounds::union)
    }

    /// Box around all that can be hit, in the file's coordinates.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let local = self.local_bounds();
        if local.is_empty() {
            return local;
        }
        Bounds { lo: self.frame.to_world(local.lo), hi: self.frame.to_world(local.hi) }
    }

    /// How much of everything there is.
    #[must_use]
    pub fn counts(&self) -> SceneCounts {
        let sum = |f: fn(&TriangleMesh) -> usize| self.objects.iter().map(|o| f(&o.mesh)).sum();
        SceneCounts {
            objects: self.objects.len(),
            vertices: sum(TriangleMesh::vertex_count),
            triangles: sum(TriangleMesh::face_count),
            degenerate: sum(|m| m.faults().degenerate),
            non_finite: sum(|m| m.faults().non_finite),
            lights: self.lights.len(),
            materials: self.materials.len(),
            ..SceneCounts::default()
        }
    }

    /// Bytes of geometry, normals and material indices.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let of = |o: &Object| {
            o.mesh.bytes()
                + o.normals.as_ref().map_or(0, CornerData::bytes)
                + o.face_materials.as_ref().map_or(0, |m| size_of_val(&m[..]))
        };
        self.objects.iter().map(of).sum()
    }

    /// What rendering it takes.
    #[must_use]
    pub fn needs(&self) -> Needs {
        Needs::of(self)
    }
}
