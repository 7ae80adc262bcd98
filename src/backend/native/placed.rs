//! Meshes in a space of their own.

use super::bvh::Bvh;
use super::ray::Line;
use super::traverse::{Space, Waiting, Walk};
use crate::geom::{ShapeError, cofactors, invert};
use glam::{DAffine3, DMat3, DVec3};

/// Where a mesh is placed, and which one.
#[derive(Debug)]
pub(super) struct Placed {
    /// Index of its hierarchy.
    pub(super) mesh: u32,
    /// Inverse of the linear part.
    inverse: DMat3,
    translation: DVec3,
    /// What takes normals to the scene.
    normals: DMat3,
}

impl Placed {
    pub(super) fn new(mesh: u32, to_scene: &DAffine3) -> Result<Self, ShapeError> {
        let normals = cofactors(&to_scene.matrix3);
        Ok(Self { mesh, inverse: invert(to_scene)?, translation: to_scene.translation, normals })
    }

    /// The ray in the mesh's own space, up to the best hit so far. Subtraction first, so that nothing
    /// cancels far from the origin; not normalised, so that `t` is the same number in both spaces.
    #[inline]
    pub(super) fn local(&self, walk: &Walk) -> Option<Walk> {
        let Line { o, d, .. } = walk.line;
        Walk::placed(&Line { o: self.inverse * (o - self.translation), d: self.inverse * d, ..walk.line })
    }

    /// A triangle's normal in scene space: that of its moved corners, as they are wound.
    pub(super) fn normal(&self, ng: DVec3) -> DVec3 {
        self.normals * ng
    }
}

impl Space for Bvh {
    const PLACED: bool = true;

    #[inline]
    fn bvh(&self) -> &Bvh {
        self
    }

    /// In a mesh there are only triangles.
    #[inline]
    fn apart<const ANY: bool>(&self, _: &mut Walk, _: usize, _: &mut [Waiting]) -> bool {
        false
    }
}
