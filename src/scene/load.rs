//! From a file on disk to a frozen scene.

use super::desc::{NamedCamera, RenderDesc};
use super::format::{Diagnostic, Override};
use super::freeze::{self, Assets, MeshFile, Wanted};
use super::obj::{Reader, Uv};
use super::texture::Encoding;
use super::{Error, FreeMemory, MeshFormat, MeshPaint, Object, Scene, Skips, Warning};
use glam::{DAffine3, Vec3};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// How to read a scene.
#[derive(Clone)]
pub struct LoadOptions<'a> {
    /// Who reads OBJ meshes.
    pub reader: Reader,
    /// Crease angle in degrees for computing normals where the file has none; `None`: flat.
    pub smooth: Option<f64>,
    /// For who asks about single points: meshes keep what rounding to f32 takes from their corners
    /// ([`TriangleMesh::exact_triangle`](crate::geom::TriangleMesh::exact_triangle)), and texture coordinates
    /// that no image needs.
    pub exact: bool,
    /// What is not read or not kept where nothing needs it.
    pub skips: Skips,
    /// Folders besides the file's own that it may name files in.
    pub allow: Vec<PathBuf>,
    /// Keys of a scene file set from outside, in this order.
    pub overrides: Vec<Override>,
    /// Set by another thread to give up.
    pub cancel: &'a AtomicBool,
    /// Asked before anything large is stored, and while a pipe or a compressed mesh is read into memory.
    pub free_memory: FreeMemory<'a>,
    /// Told bytes read and bytes in all, from any thread.
    pub progress: Option<&'a (dyn Fn(u64, u64) + Sync)>,
}

impl<'a> LoadOptions<'a> {
    /// The file as it is, by our own reader, for rendering.
    #[must_use]
    pub fn new(cancel: &'a AtomicBool) -> Self {
        Self {
            reader: Reader::default(),
            smooth: None,
            exact: false,
            skips: Skips::ALL,
            allow: Vec::new(),
            overrides: Vec::new(),
            cancel,
            free_memory: FreeMemory::UNKNOWN,
            progress: None,
        }
    }
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
    /// What was not read because nothing uses it.
    pub unused: Unused,
    /// The scene or mesh file and all that it led to, but for the material libraries of meshes.
    pub files: Vec<PathBuf>,
    /// Seconds spent on reading textures.
    pub texture_seconds: f64,
}

/// What a scene and the libraries of its meshes describe or name, but no picture of it needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unused {
    /// Materials that no object has.
    pub materials: usize,
    /// Images that nothing samples.
    pub textures: usize,
    /// Lights that give no light.
    pub lights: usize,
}

/// Colour seen where nothing is hit, for a mesh that says nothing about it.
const BACKGROUND: Vec3 = Vec3::new(0.055, 0.065, 0.08);

/// Reads the scene in `path`: a `.toml`, `.json` or `.ray` scene file, or a mesh ([`MeshFormat`]) by itself.
/// What is no plain file and has no extension, a pipe, is taken for a mesh.
///
/// A scene file that says nothing about them has a black background and no ambient light.
///
/// # Errors
/// Whatever stops the scene from being rendered, with the place in the file.
pub fn load(path: &Path, options: &LoadOptions<'_>) -> Result<Loaded, Error> {
    let meta = std::fs::metadata(path).map_err(|source| Error::Read { path: path.to_owned(), source })?;
    if meta.is_dir() {
        return Err(Error::NotAFile { path: path.to_owned() });
    }
    let bare = MeshFormat::of(path).is_some() || (path.extension().is_none() && !meta.is_file());
    if bare { load_mesh(path, options) } else { freeze::load(path, options) }
}

/// Reads a scene that is in memory: `text` is what a file at `path` would hold. What it names is looked for as if it
/// were there.
///
/// # Errors
/// As [`load`].
pub fn load_text(path: &Path, text: &str, options: &LoadOptions<'_>) -> Result<Loaded, Error> {
    freeze::load_text(path, text.into(), options)
}

fn load_mesh(path: &Path, options: &LoadOptions<'_>) -> Result<Loaded, Error> {
    let mut assets = Assets::new(options, Encoding::Srgb);
    let wanted = Wanted { uv: Uv::IfTextured, materials: true, v_down: false };
    let file = MeshFile::read(path, wanted, &mut assets, options.progress)?;
    assets.read_images_of_meshes(0)?;
    let files = assets.files(Vec::new());
    if options.smooth.is_some() && file.has_normals() {
        let what = "the file has normals of its own: --smooth changes nothing";
        assets.warnings.push(Warning::about(path, what.into()));
    }
    let Assets { images, warnings, unused, .. } = assets;
    let (textures, numbers, texture_seconds) = images.finish();
    let scene = Scene {
        frame: file.frame,
        materials: file.materials(&numbers).collect(),
        objects: vec![Object::Mesh(file.into_mesh(&DAffine3::IDENTITY, options.smooth, MeshPaint::PerFace(0)))],
        lights: Vec::new(),
        ambient: Vec3::ZERO,
        background: BACKGROUND,
        textures,
        course_rules: false,
    };
    Ok(Loaded {
        scene,
        render: RenderDesc::default(),
        cameras: Vec::new(),
        diagnostics: Vec::new(),
        warnings,
        unused,
        files,
        texture_seconds,
    })
}
