//! Scenes made in memory, and backends for them.

use crate::backend::{AnyBackend, BackendKind, BuildOptions, Error};
use crate::geom::{Affine, Plain, Shape, TriangleMesh};
use crate::scene::Scene;
use glam::{DAffine3, Vec3};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Three points per triangle, nothing shared.
#[must_use]
pub fn soup(triangles: &[[Vec3; 3]]) -> TriangleMesh {
    let points = triangles.as_flattened().iter().flat_map(|p| p.to_array()).collect();
    let faces = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    TriangleMesh::new(points, faces)
}

/// A set of shapes that need no transform.
#[must_use]
pub fn plain<S: Shape>(of: impl IntoIterator<Item = S>) -> Arc<Plain<S>> {
    let mut set = Plain::default();
    for shape in of {
        set.push(shape);
    }
    Arc::new(set)
}

/// A shape as `to_world` places it.
///
/// # Panics
/// If `to_world` flattens space.
#[must_use]
pub fn placed<S: Shape>(shape: S, to_world: DAffine3) -> Arc<Affine<S>> {
    let mut set = Affine::default();
    set.push(shape, to_world).expect("the caller's transform can be undone");
    Arc::new(set)
}

/// The hierarchy of `scene` in good quality.
///
/// # Errors
/// As [`AnyBackend::build`].
pub fn build(kind: BackendKind, scene: &Scene) -> Result<AnyBackend, Error> {
    build_on(kind, scene, 0)
}

/// The same with so many threads; 0 is all. The native tracer builds on the current rayon pool whatever is said.
///
/// # Errors
/// As [`AnyBackend::build`].
pub fn build_on(kind: BackendKind, scene: &Scene, threads: usize) -> Result<AnyBackend, Error> {
    let cancel = AtomicBool::new(false);
    AnyBackend::build(kind, scene, &BuildOptions { threads, ..BuildOptions::new(&cancel) })
}
