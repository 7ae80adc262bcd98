//! From files to one frozen scene. Knows `geom`, `math` and how `film` decodes
//! images; never which backend runs.
//!
//! The scene lives in its own space: the file's coordinates less an f64 origin, scaled by a
//! power of two to a size of about 1, so that f32 spends its digits on the shape and not on
//! where it stands. [`Frame`] leads there and back.

mod buffers;
mod camera;
pub mod desc;
mod error;
pub mod example;
pub mod format;
mod framing;
mod freeze;
mod light;
mod load;
mod material;
mod memory;
mod mesh_format;
mod needs;
pub mod obj;
mod object;
mod parallel;
pub mod ply;
mod skip;
pub mod smooth;
mod source;
mod texture;

pub use buffers::Buffers;
pub use camera::{Camera, CameraDesc, CameraRays, Projection};
pub use error::{Error, Warning};
pub use framing::{CameraOverrides, View};
pub use freeze::OneShape;
pub use light::Light;
pub use load::{LoadOptions, Loaded, Unused, load, load_text};
pub use material::{Material, Reflect, Textured};
pub use memory::FreeMemory;
pub use mesh_format::{MeshFormat, read_mesh};
pub use needs::Needs;
pub use object::{AnyShapes, Instance, Mesh, MeshData, MeshPaint, Object, Shapes};
pub use skip::{Skip, Skips};
pub use source::{is_packed, unpacked_name};
pub use texture::{Encoding, Texture};

use crate::geom::Bounds;
use crate::math::Frame;
use glam::Vec3;
use std::collections::HashMap;
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
    /// Images that materials sample, by index.
    pub textures: Vec<Texture>,
    /// Lights, in scene space.
    pub lights: Vec<Light>,
    /// Ambient light, linear RGB.
    pub ambient: Vec3,
    /// What a ray sees that hits nothing, linear RGB.
    pub background: Vec3,
    /// Whether it is shaded by the rules of the course scenes: highlights towards the camera's
    /// position at every depth, one index of refraction at every surface, entering or leaving.
    pub course_rules: bool,
}

/// How much of everything there is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(missing_docs, reason = "the things counted")]
pub struct SceneCounts {
    pub objects: usize,
    /// Objects that share a mesh with others.
    pub instances: usize,
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
    pub quads: usize,
    pub lights: usize,
    pub materials: usize,
    pub textures: usize,
}

impl Scene {
    /// `objects` as they are, of one default material, in the dark.
    #[must_use]
    pub fn of(objects: Vec<Object>) -> Self {
        Self {
            frame: Frame::IDENTITY,
            objects,
            materials: vec![Material::default()],
            textures: Vec::new(),
            lights: Vec::new(),
            ambient: Vec3::ZERO,
            background: Vec3::ZERO,
            course_rules: false,
        }
    }

    /// Box around all that can be hit, in scene space.
    #[must_use]
    pub fn local_bounds(&self) -> Bounds {
        self.objects.iter().map(Object::bounds).fold(Bounds::EMPTY, Bounds::union)
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

    /// How much of everything there is. A mesh counts as often as it is placed.
    #[must_use]
    pub fn counts(&self) -> SceneCounts {
        let mut c = SceneCounts {
            objects: self.objects.len(),
            lights: self.lights.len(),
            materials: self.materials.len(),
            textures: self.textures.len(),
            ..SceneCounts::default()
        };
        for object in &self.objects {
            if let Some(mesh) = object.mesh() {
                let triangles = &mesh.data.triangles;
                c.vertices += triangles.vertex_count();
                c.triangles += triangles.face_count();
                c.degenerate += triangles.faults().degenerate;
                c.non_finite += triangles.faults().non_finite;
            }
            match object {
                Object::Mesh(_) => {}
                Object::Instance(_) => c.instances += 1,
                Object::Shapes(shapes) => {
                    let count = match shapes.set {
                        AnyShapes::Spheres(_) | AnyShapes::PlacedSpheres(_) => &mut c.spheres,
                        AnyShapes::Cubes(_) | AnyShapes::PlacedCubes(_) => &mut c.cubes,
                        AnyShapes::Cylinders(_) => &mut c.cylinders,
                        AnyShapes::Quads(_) => &mut c.quads,
                        AnyShapes::Triangles(_) => &mut c.triangles,
                    };
                    *count += shapes.set.len() as usize;
                }
            }
        }
        c
    }

    /// Triangles that are stored: those of a mesh that is placed many times count once.
    #[must_use]
    pub fn stored_triangles(&self) -> usize {
        self.meshes().map(|m| m.triangles.face_count()).sum()
    }

    /// Analytic shapes of all classes.
    #[must_use]
    pub fn shapes(&self) -> usize {
        let count = |o: &Object| if let Object::Shapes(s) = o { s.set.len() as usize } else { 0 };
        self.objects.iter().map(count).sum()
    }

    /// Every mesh once, however often it is placed.
    fn meshes(&self) -> impl Iterator<Item = &MeshData> {
        let distinct: HashMap<_, _> =
            self.objects.iter().filter_map(Object::mesh).map(|m| (Arc::as_ptr(&m.data), &*m.data)).collect();
        distinct.into_values()
    }

    /// What rendering it takes.
    #[must_use]
    pub fn needs(&self) -> Needs {
        Needs::of(self, Skips::ALL)
    }
}
