//! Reads OBJ files and their material libraries.
//!
//! The file is cut into pieces at line ends and gone over twice, by all threads: first to
//! count, then to parse every number straight into its place. Nothing is joined, copied or
//! looked up; positions, normals and texture coordinates keep their own indices. The
//! result does not depend on the number of threads or the size of the pieces.
//!
//! Of the format it reads `v vt vn f usemtl mtllib o g`, with continued lines, comments
//! after data and negative indices. Weights and colours of vertices are passed over,
//! lines, points and free-form surfaces skipped with a warning. Polygons become triangles,
//! in the order of the file, with the winding of the file.

mod corners;
pub(super) mod cursor;
pub(super) mod fans;
mod materials;
mod mtl;
mod notes;
pub(super) mod parse;
mod pieces;
pub(super) mod points;
mod polygon;
mod read;
mod second;
mod survey;
#[cfg(test)]
mod tests;

pub use corners::CornerData;
pub use mtl::MtlMaterial;
pub(super) use notes::with_more;

use super::source::{Limits, Source};
use super::{Error, FreeMemory, Warning};
use crate::math::Frame;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Who reads the numbers and faces of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reader {
    /// Ours.
    #[default]
    Own,
    /// The crate tobj: one thread, most of the format, errors without columns.
    Tobj,
}

impl Reader {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Own, Self::Tobj];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Own => "own",
            Self::Tobj => "tobj",
        }
    }
}

/// What to read, and from where.
#[derive(Clone, Copy)]
pub struct ReadOptions<'a> {
    /// Who reads it.
    pub reader: Reader,
    /// Whether normals are wanted. What is not wanted is checked but not stored.
    pub normals: bool,
    /// Whether texture coordinates are wanted.
    pub uv: Uv,
    /// Whether the file's own materials are wanted. If not, no library is read and every face has none.
    pub materials: bool,
    /// Whether what rounding to f32 takes from the points is wanted: one more way through the file.
    pub rests: bool,
    /// Folders, besides the file's own, below which libraries and their images may be.
    pub allow: &'a [PathBuf],
    /// Reading stops soon after this becomes true.
    pub cancel: &'a AtomicBool,
    /// Asked while a pipe or a compressed file is read into memory, and before the mesh is stored.
    pub free_memory: FreeMemory<'a>,
    /// Told how many bytes are done, of how many, from any thread and not in order. As
    /// the file is gone over twice, that is twice its size.
    pub progress: Option<&'a (dyn Fn(u64, u64) + Sync)>,
}

/// When to keep the texture coordinates of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Uv {
    /// Never: nothing samples an image there.
    Never,
    /// If a material of its own, in use on it, has an image.
    IfTextured,
    /// Whenever the file has any.
    Always,
}

impl<'a> ReadOptions<'a> {
    /// All that a file has, by our own reader, whatever memory it takes.
    #[must_use]
    pub fn all(cancel: &'a AtomicBool) -> Self {
        Self {
            reader: Reader::default(),
            normals: true,
            uv: Uv::Always,
            materials: true,
            rests: false,
            allow: &[],
            cancel,
            free_memory: FreeMemory::UNKNOWN,
            progress: None,
        }
    }

    /// What holds for all that is read into memory.
    pub(super) fn limits(&self) -> Limits<'_> {
        Limits { cancel: self.cancel, free_memory: self.free_memory }
    }

    /// Whether texture coordinates are wanted on faces that have `materials`.
    pub(super) fn wants_uv(&self, materials: &[MtlMaterial]) -> bool {
        match self.uv {
            Uv::Never => false,
            Uv::IfTextured => materials.iter().any(|m| m.map_kd.is_some()),
            Uv::Always => true,
        }
    }
}

impl std::fmt::Debug for ReadOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut f = f.debug_struct("ReadOptions");
        f.field("reader", &self.reader);
        f.field("normals", &self.normals).field("uv", &self.uv).field("materials", &self.materials);
        f.field("rests", &self.rests).field("allow", &self.allow).finish_non_exhaustive()
    }
}

/// A mesh as its file, OBJ or [PLY](super::ply), has it.
#[derive(Debug)]
pub struct ObjFile {
    /// Where the stored points lie in the file's coordinates.
    pub frame: Frame,
    /// xyz of every vertex, then one float of padding. Each is the file's number, less the
    /// frame's origin and scaled in f64, rounded to f32 once; all are finite.
    pub points: Vec<f32>,
    /// What rounding took from each of them, if it is wanted.
    pub rests: Option<Vec<f32>>,
    /// Vertices of every triangle, in range.
    pub faces: Vec<[u32; 3]>,
    /// Normals, of unit length or zero; absent where no face has any or none are wanted.
    pub normals: Option<CornerData>,
    /// Texture coordinates as written, v upwards, likewise.
    pub uvs: Option<CornerData>,
    /// Material of each triangle, an index into `materials`; absent if one serves all.
    pub face_materials: Option<Vec<u32>>,
    /// The materials that faces have, in order of first use; at least one if they are wanted.
    pub materials: Vec<MtlMaterial>,
    /// What was in the file.
    pub counts: Counts,
    /// What was odd, once a kind and file.
    pub warnings: Vec<Warning>,
}

/// How much of everything a file holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// `v` lines.
    pub vertices: u64,
    /// `vt` lines.
    pub textures: u64,
    /// `vn` lines.
    pub normals: u64,
    /// `f` lines, as written.
    pub polygons: u64,
    /// Triangles that they were split into.
    pub triangles: u64,
    /// Polygons that ear clipping had to split.
    pub clipped: u64,
    /// `f` lines with one or two corners, skipped.
    pub short_faces: u64,
    /// `o` lines.
    pub objects: u64,
    /// `g` lines.
    pub groups: u64,
    /// `l` lines, skipped.
    pub polylines: u64,
    /// `p` lines, skipped.
    pub points: u64,
    /// Materials that the libraries describe and no face has.
    pub unused_materials: u64,
    /// Images that only those name.
    pub unused_images: u64,
}

/// Reads the OBJ file at `path` and the libraries it names.
///
/// # Errors
/// [`Error::Read`] and [`Error::NotAFile`] for what is no readable file, [`Error::At`] for
/// the first line that cannot be understood, [`Error::NoFaces`] for a file with nothing to
/// render, [`Error::Forbidden`] for a library or image outside the allowed folders,
/// [`Error::TooMany`] beyond what 32-bit indices can count, [`Error::Broken`] and [`Error::NoRoom`] for what
/// cannot be unpacked, [`Error::TooLarge`] for what does not fit into memory, [`Error::Cancelled`];
/// [`Error::SecondReader`] for what tobj cannot read, if it is asked.
pub fn read(path: &Path, options: &ReadOptions<'_>) -> Result<ObjFile, Error> {
    read_source(&Source::open(path, options.limits())?, options)
}

/// The same for a file that is open.
pub(super) fn read_source(source: &Source, options: &ReadOptions<'_>) -> Result<ObjFile, Error> {
    match options.reader {
        Reader::Own => read::read(source, options, PIECE),
        Reader::Tobj => second::read(source, options, PIECE),
    }
}

/// The line of the face that triangle number `triangle` is made of, as our own reader counts them; none if there are
/// fewer.
///
/// # Errors
/// As [`read`].
pub fn line_of_triangle(path: &Path, triangle: u64, options: &ReadOptions<'_>) -> Result<Option<u64>, Error> {
    read::line_of_triangle(&Source::open(path, options.limits())?, triangle, options, PIECE)
}

/// Bytes of a piece: small enough for a second-level cache, large enough to make each piece's own cost vanish.
const PIECE: u64 = 1 << 18;

/// Things must be countable by 32 bits, with one number to spare for "none".
pub(super) fn check_count(source: &Source, what: &'static str, count: u64) -> Result<(), Error> {
    const LIMIT: u64 = u32::MAX as u64 - 1;
    if count <= LIMIT {
        return Ok(());
    }
    Err(Error::TooMany { path: source.path.clone(), what, count, limit: LIMIT })
}

/// Bytes as text, whatever they are.
fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Bytes as they may appear in a message: not long, and nothing a terminal obeys.
pub(super) fn excerpt(bytes: &[u8]) -> String {
    const MOST: usize = 40;
    let whole = String::from_utf8_lossy(&bytes[..bytes.len().min(4 * MOST)]);
    let shown: String = whole.chars().take(MOST).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if shown.len() < bytes.len() && whole.chars().count() > MOST { format!("{shown}…") } else { shown }
}

/// Without blanks at either end.
fn trimmed(bytes: &[u8]) -> &[u8] {
    let start = bytes.iter().position(|&c| c > b' ').unwrap_or(bytes.len());
    let end = bytes.iter().rposition(|&c| c > b' ').map_or(start, |n| n + 1);
    &bytes[start..end]
}

/// Without quotes around all of it.
fn unquoted(bytes: &[u8]) -> &[u8] {
    match bytes {
        [b'"', inner @ .., b'"'] => trimmed(inner),
        _ => bytes,
    }
}
