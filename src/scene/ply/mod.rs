//! Reads PLY files: text, and binary of both byte orders.
//!
//! Of the header it wants an element `vertex` with `x y z`, perhaps with `nx ny nz` and texture coordinates, and an
//! element `face` with a list `vertex_indices`. Everything else is passed over, by its size. All threads read: binary
//! files in one pass where things are at equal distances, text after its lines were counted. Positions are parsed
//! in f64 and stored as those of OBJ files are, and polygons split by the same code; the result is of the same type.
//!
//! Vertices and faces are counted from 0 in messages, as in the files. The format: Greg Turk, "The PLY Polygon File
//! Format" (1994).

mod ascii;
mod binary;
mod faces;
mod file;
mod header;
mod layout;
mod number;
mod read;
#[cfg(test)]
mod tests;
mod vertices;

use super::Error;
use super::obj::{ObjFile, ReadOptions};
use super::source::Source;
use std::path::Path;

/// Bytes of a part that one thread reads at once.
const PIECE: u64 = 1 << 18;

/// Reads the PLY file at `path`. [`ReadOptions::reader`] is for OBJ files and has no effect.
///
/// # Errors
/// [`Error::Read`] and [`Error::NotAFile`] for what is no readable file, [`Error::At`] for the first line of text that
/// cannot be understood, [`Error::Broken`] for such a thing in a binary file or one that is too short,
/// [`Error::NoFaces`] for a file with nothing to render, [`Error::TooMany`] beyond what 32-bit indices can count,
/// [`Error::NoRoom`] for what is larger than memory when unpacked, [`Error::TooLarge`] for a mesh that is,
/// [`Error::Cancelled`].
pub fn read(path: &Path, options: &ReadOptions<'_>) -> Result<ObjFile, Error> {
    read_source(&Source::open(path, options.limits())?, options)
}

/// The same for a file that is open.
pub(super) fn read_source(source: &Source, options: &ReadOptions<'_>) -> Result<ObjFile, Error> {
    read::read(source, options, PIECE)
}

/// Whether a file begins as PLY files do.
pub(super) fn is_ply(source: &Source) -> Result<bool, Error> {
    let mut head = Vec::new();
    source.bytes(0..source.len.min(4), &mut head)?;
    Ok(matches!(head[..], [b'p', b'l', b'y', b'\n' | b'\r']))
}
