//! First pass: counts what a piece of the file holds, so that the second pass can parse
//! straight into place.

use super::cursor::{Cursor, Statement};
use super::notes::{Kind, Notes};
use super::{trimmed, unquoted};
use glam::DVec3;
use std::collections::BTreeMap;

/// What is in a piece, or in the pieces before one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tally {
    pub(super) lines: u64,
    pub(super) vertices: u64,
    pub(super) textures: u64,
    pub(super) normals: u64,
    pub(super) polygons: u64,
    pub(super) triangles: u64,
    pub(super) objects: u64,
    pub(super) groups: u64,
}

impl Tally {
    pub(super) fn plus(self, o: &Self) -> Self {
        Self {
            lines: self.lines + o.lines,
            vertices: self.vertices + o.vertices,
            textures: self.textures + o.textures,
            normals: self.normals + o.normals,
            polygons: self.polygons + o.polygons,
            triangles: self.triangles + o.triangles,
            objects: self.objects + o.objects,
            groups: self.groups + o.groups,
        }
    }
}

/// What the first pass finds in one piece.
#[derive(Debug, Default)]
pub(super) struct Survey {
    pub(super) tally: Tally,
    /// `usemtl`: the triangles of this piece before it, and its name in `names`.
    pub(super) uses: Vec<(u32, u32)>,
    pub(super) names: Vec<Box<[u8]>>,
    /// `mtllib`: where its argument is, and the argument. Repetitions are left out.
    pub(super) libraries: Vec<(u64, Box<[u8]>)>,
    /// Some vertices and where they stand: see [`Sampling`].
    pub(super) sample: Vec<(u64, DVec3)>,
    pub(super) notes: Notes,
}

/// Picks the first vertex of each of `BUCKETS` equal parts of the file, whatever the pieces.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampling {
    bucket: u64,
}

impl Sampling {
    const BUCKETS: u64 = 4096;

    pub(super) fn of_file(len: u64) -> Self {
        Self { bucket: (len / Self::BUCKETS).max(1) }
    }

    /// The vertices picked: a piece offers the first one of every bucket that it reaches.
    pub(super) fn merge<'a>(self, pieces: impl Iterator<Item = &'a Survey>) -> Vec<DVec3> {
        let mut last = None;
        let mut picked = Vec::new();
        for &(offset, point) in pieces.flat_map(|s| &s.sample) {
            if last.replace(offset / self.bucket) != Some(offset / self.bucket) {
                picked.push(point);
            }
        }
        picked
    }
}

/// Surveys `text`, which begins at byte `start` of the file and had `joined` more lines
/// before continued ones were joined.
pub(super) fn survey(text: &[u8], start: u64, joined: u64, sampling: Sampling) -> Survey {
    let mut out = Survey { tally: Tally { lines: joined, ..Tally::default() }, ..Survey::default() };
    let mut interned = BTreeMap::new();
    let mut c = Cursor::new(text);
    let mut next_sample = start;
    while !c.at_end() {
        let offset = start + c.pos() as u64;
        out.tally.lines += 1;
        match c.statement() {
            Statement::Vertex => {
                out.tally.vertices += 1;
                if offset >= next_sample {
                    next_sample = (offset / sampling.bucket + 1) * sampling.bucket;
                    out.sample.extend(point(c).map(|p| (offset, p)));
                }
            }
            Statement::Texture => out.tally.textures += 1,
            Statement::Normal => out.tally.normals += 1,
            Statement::Face => {
                let corners = c.count_words();
                out.tally.polygons += 1;
                out.tally.triangles += corners.saturating_sub(2);
                if matches!(corners, 1 | 2) {
                    out.notes.add(Kind::ShortFace, offset, b"f");
                }
            }
            Statement::Blank => {}
            Statement::Other => other(&c, start, &mut out, &mut interned),
        }
        c.next_line();
    }
    out
}

/// The point of a `v` line, if it is well formed.
fn point(mut c: Cursor<'_>) -> Option<DVec3> {
    let mut p = [0.0; 3];
    for x in &mut p {
        c.more();
        *x = c.number().filter(|x| x.abs() <= super::parse::LARGEST)?;
    }
    Some(p.into())
}

fn other(c: &Cursor<'_>, start: u64, out: &mut Survey, interned: &mut BTreeMap<Box<[u8]>, u32>) {
    let offset = start + c.pos() as u64;
    let word = c.word();
    let rest = &c.line()[word.len()..];
    let name = unquoted(trimmed(rest));
    match word {
        b"o" => out.tally.objects += 1,
        b"g" => out.tally.groups += 1,
        b"l" => out.notes.add(Kind::Polyline, offset, word),
        b"p" => out.notes.add(Kind::PointElement, offset, word),
        b"usemtl" => {
            if name.is_empty() {
                out.notes.add(Kind::NamelessMaterial, offset, word);
            }
            let id = interned.get(name).copied().unwrap_or_else(|| {
                let id = out.names.len() as u32;
                out.names.push(name.into());
                interned.insert(name.into(), id);
                id
            });
            out.uses.push((out.tally.triangles as u32, id));
        }
        b"mtllib" => {
            let argument = trimmed(rest);
            if argument.is_empty() {
                out.notes.add(Kind::NamelessLibrary, offset, word);
            } else if !out.libraries.iter().any(|(_, known)| **known == *argument) {
                let blanks = rest.len() - rest.trim_ascii_start().len();
                out.libraries.push((offset + (word.len() + blanks) as u64, argument.into()));
            }
        }
        _ => out.notes.add_keyword(offset, word),
    }
}

/// Where each piece begins, in counts of what comes before it, and the counts of the whole.
pub(super) fn running_totals(surveys: &[Survey]) -> (Vec<Tally>, Tally) {
    let mut total = Tally::default();
    let before = surveys
        .iter()
        .map(|s| {
            let before = total;
            total = total.plus(&s.tally);
            before
        })
        .collect();
    (before, total)
}

/// The byte of the file at which the face begins that triangle `wanted` of this piece is made of.
pub(super) fn place_of_triangle(text: &[u8], start: u64, wanted: u64) -> Option<u64> {
    let mut c = Cursor::new(text);
    let mut triangles = 0;
    while !c.at_end() {
        let offset = start + c.pos() as u64;
        if c.statement() == Statement::Face {
            triangles += c.count_words().saturating_sub(2);
            if triangles > wanted {
                return Some(offset);
            }
        }
        c.next_line();
    }
    None
}
