//! Which format a mesh file has, and the reader for it.

use super::obj::{self, ObjFile, ReadOptions};
use super::source::{Source, unpacked_name};
use super::{Error, ply};
use std::path::Path;

/// A format of mesh files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// PLY, text or binary.
    Ply,
}

impl MeshFormat {
    /// By the file's extension, or the one before it if that says the file is compressed: `.gz` or `.zst`.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let path = unpacked_name(path);
        let extension = path.extension()?;
        let known = [("obj", Self::Obj), ("ply", Self::Ply)];
        known.into_iter().find(|(name, _)| extension.eq_ignore_ascii_case(name)).map(|(_, format)| format)
    }
}

/// Reads the mesh at `path`. Where its name does not tell the format, its first line does: anything but PLY is taken
/// for OBJ.
///
/// # Errors
/// As [`obj::read`] and [`ply::read`].
pub fn read_mesh(path: &Path, options: &ReadOptions<'_>) -> Result<ObjFile, Error> {
    let source = Source::open(path, options.limits())?;
    let format = match MeshFormat::of(path) {
        Some(format) => format,
        None if ply::is_ply(&source)? => MeshFormat::Ply,
        None => MeshFormat::Obj,
    };
    match format {
        MeshFormat::Obj => obj::read_source(&source, options),
        MeshFormat::Ply => ply::read_source(&source, options),
    }
}
