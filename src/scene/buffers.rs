//! What a scene takes in memory, by what it holds.

use super::{Object, Scene, Texture};
use crate::geom::ShapeSet;
use crate::with_shapes;
use std::collections::HashSet;
use std::iter::Sum;
use std::ops::Add;
use std::sync::Arc;

/// Bytes of buffers. What is shared counts once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Buffers {
    /// Corners of meshes: 12 for a vertex.
    pub positions: usize,
    /// Which corners a triangle has: 12 for each.
    pub indices: usize,
    /// Normals at corners, and 12 for a triangle where they have numbers of their own.
    pub normals: usize,
    /// Texture coordinates, likewise.
    pub uvs: usize,
    /// Material of each triangle, where a mesh has several: 4 for each.
    pub face_materials: usize,
    /// Analytic shapes and their materials.
    pub shapes: usize,
    /// Images.
    pub textures: usize,
}

impl Buffers {
    /// What belongs to triangles.
    #[must_use]
    pub fn of_meshes(&self) -> usize {
        self.positions + self.indices + self.normals + self.uvs + self.face_materials
    }

    /// All of it.
    #[must_use]
    pub fn total(&self) -> usize {
        self.of_meshes() + self.shapes + self.textures
    }
}

impl Add for Buffers {
    type Output = Self;

    fn add(self, o: Self) -> Self {
        Self {
            positions: self.positions + o.positions,
            indices: self.indices + o.indices,
            normals: self.normals + o.normals,
            uvs: self.uvs + o.uvs,
            face_materials: self.face_materials + o.face_materials,
            shapes: self.shapes + o.shapes,
            textures: self.textures + o.textures,
        }
    }
}

impl Sum for Buffers {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), Self::add)
    }
}

impl Scene {
    /// Bytes of geometry, normals, texture coordinates, material indices and textures.
    #[must_use]
    pub fn buffers(&self) -> Buffers {
        let shapes = |o: &Object| match o {
            Object::Shapes(s) => with_shapes!(&s.set, set => set.bytes()) + size_of_val(&s.materials[..]),
            _ => 0,
        };
        let others = Buffers {
            shapes: self.objects.iter().map(shapes).sum(),
            textures: self.textures.iter().map(Texture::bytes).sum(),
            ..Buffers::default()
        };
        let mut seen = HashSet::new();
        let meshes = self.meshes().map(|mesh| {
            let buffers = mesh.buffers();
            // Meshes that are smoothed in several ways share their triangles.
            let new = seen.insert(Arc::as_ptr(&mesh.triangles));
            if new { buffers } else { Buffers { positions: 0, indices: 0, ..buffers } }
        });
        others + meshes.sum()
    }

    /// All of [`buffers`](Self::buffers) together.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.buffers().total()
    }
}
