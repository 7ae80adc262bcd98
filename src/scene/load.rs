//! From a file on disk to a frozen scene.

use super::desc::{NamedCamera, RenderDesc};
use super::format::{Diagnostic, Override};
use super::{Error, Material, Mesh, MeshData, MeshPaint, Object, Scene, Warning, obj, smooth};
use crate::geom::TriangleMesh;
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// How to read a scene.
#[derive(Clone)]
pub struct LoadOptions<'a> {
    /// Crease angle in degrees for computing normals where the file has none; `None`: flat.
    pub smooth: Option<f64>,
    /// Folders besides the file's own that it may name files in.
    pub allow: Vec<PathBuf>,
    /// Keys of a scene file set from outside, in this order.
    pub overrides: Vec<Override>,
    /// Set by another thread to give up.
    pub cancel: &'a AtomicBool,
    /// Told bytes read and bytes in all, from any thread.
    pub progress: Option<&'a (dyn Fn(u64, u64) + Sync)>,
}

impl std::fmt::Debug for LoadOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LoadOptions").field("smooth", &self.smooth).field("allow", &self.allow).finish_non_exhaustive()
    }
}

/// A scene and what was odd about its file.
#[derive(Debug)]
pub struct Loaded {
    /// The scene, without lights if the file has none.
    pub scene: Scene,
    /// What a scene file says about the picture; nothing for a bare mesh.
    pub render: RenderDesc,
    /// The cameras of a scene file in its order, the first is the default; none for a bare mesh.
    pub cameras: Vec<NamedCamera>,
    /// What was odd about the scene file itself, with its places.
    pub diagnostics: Vec<Diagnostic>,
    /// What was odd about files that it names, one per kind and file.
    pub warnings: Vec<Warning>,
    /// Seconds spent on reading textures.
    pub texture_seconds: f64,
}

/// Colour seen where nothing is hit, for a mesh that says nothing about it.
const BACKGROUND: Vec3 = Vec3::new(0.055, 0.065, 0.08);

/// Reads the mesh in `path`.
///
/// # Errors
/// Whatever stops the scene from being rendered, with the place in the file.
pub fn load(path: &Path, options: &LoadOptions<'_>) -> Result<Loaded, Error> {
    let read = obj::ReadOptions {
        normals: true,
        uv: obj::Uv::Never,
        materials: true,
        allow: &options.allow,
        cancel: options.cancel,
        progress: options.progress,
    };
    let file = obj::read(path, &read)?;
    let mut warnings = file.warnings;
    let textured = file.materials.iter().filter(|m| m.map_kd.is_some()).count();
    if textured > 0 {
        let what =
            format!("{textured} of its materials name a texture (map_Kd); textures are not read, Kd is used alone");
        warnings.push(Warning::about(path, what));
    }
    let mesh = Arc::new(TriangleMesh::new(file.points, file.faces));
    if mesh.bounds().is_empty() {
        return Err(Error::NothingToHit { path: path.to_owned(), faces: mesh.face_count() });
    }
    let mut normals = file.normals;
    if let Some(angle) = options.smooth {
        if normals.is_some() {
            warnings.push(Warning::about(path, "the file has normals of its own: --smooth changes nothing".into()));
        } else {
            normals = Some(smooth::crease_normals(&mesh, angle));
        }
    }
    let data = MeshData { triangles: mesh, normals, uvs: file.uvs, face_materials: file.face_materials };
    let scene = Scene {
        frame: file.frame,
        objects: vec![Object::Mesh(Mesh { data: Arc::new(data), paint: MeshPaint::PerFace(0), mirrored: false })],
        materials: file.materials.iter().map(Material::from).collect(),
        lights: Vec::new(),
        ambient: Vec3::ZERO,
        background: BACKGROUND,
        textures: Vec::new(),
        course_rules: false,
    };
    Ok(Loaded {
        scene,
        render: RenderDesc::default(),
        cameras: Vec::new(),
        diagnostics: Vec::new(),
        warnings,
        texture_seconds: 0.0,
    })
}
