//! Both OBJ readers on the same file.
//!
//! Both read in f64 and round once, in the same frame, so that everything must be the same to the last bit.
//! Polygons are split by the same code from the corners that each of them read: equal triangles are equal
//! polygons.

use crate::scene::obj::{self, CornerData, ObjFile, ReadOptions, Reader};
use crate::scene::{Error, FreeMemory};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// What came of comparing the readers of one file.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// The file.
    pub path: PathBuf,
    /// Triangles that both read.
    pub triangles: usize,
    /// Corners without a normal or texture coordinate, for which tobj makes one up: not compared.
    pub made_up: u64,
    /// What tobj says of a file that it cannot read; that is no disagreement.
    pub refused: Option<String>,
    /// The first difference of each kind.
    pub differences: Vec<Difference>,
}

/// Where the readers differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The kind: positions, normals, texture coordinates, materials, or the count of triangles.
    pub what: &'static str,
    /// Corners, or triangles where the kind is one of those.
    pub count: u64,
    /// Line of the first face with such a corner.
    pub line: Option<u64>,
    /// What each of them reads there.
    pub read: [String; 2],
}

/// Reads the OBJ file at `path` with both readers and compares what they make of it. `allow` has the folders, besides
/// the file's own, that its libraries may be in; `free_memory` is
/// asked if it is compressed.
///
/// # Errors
/// What our own reader says of a file that it cannot read; what stops both.
pub fn compare(
    path: &Path,
    allow: &[PathBuf],
    cancel: &AtomicBool,
    free_memory: FreeMemory<'_>,
) -> Result<Compared, Error> {
    let options = |reader| ReadOptions { reader, allow, free_memory, ..ReadOptions::all(cancel) };
    let own = obj::read(path, &options(Reader::Own))?;
    let mut compared = Compared {
        path: path.to_owned(),
        triangles: own.faces.len(),
        made_up: 0,
        refused: None,
        differences: Vec::new(),
    };
    match obj::read(path, &options(Reader::Tobj)) {
        Ok(other) => {
            (compared.made_up, compared.differences) = differences(&own, &other);
            for difference in &mut compared.differences {
                // The number of the triangle, until here.
                let triangle = difference.line.take();
                difference.line = match triangle {
                    Some(triangle) => obj::line_of_triangle(path, triangle, &options(Reader::Own))?,
                    None => None,
                };
            }
        }
        Err(Error::SecondReader { line, what, .. }) => {
            compared.refused = Some(line.map_or(what.clone(), |line| format!("line {line}: {what}")));
        }
        Err(Error::NoFaces { why, .. }) => compared.refused = Some(why),
        Err(e) => return Err(e),
    }
    Ok(compared)
}

/// How many of a kind, and the triangle and corner of the first.
#[derive(Clone, Copy, Default)]
struct Found {
    count: u64,
    first: Option<(usize, usize)>,
}

impl Found {
    fn at(&mut self, triangle: usize, corner: usize) {
        self.count += 1;
        self.first.get_or_insert((triangle, corner));
    }

    fn with(self, later: Self) -> Self {
        Self { count: self.count + later.count, first: self.first.or(later.first) }
    }
}

/// Corners that were made up; positions, normals, texture coordinates, materials.
type Sums = (u64, [Found; 4]);

fn differences(own: &ObjFile, other: &ObjFile) -> (u64, Vec<Difference>) {
    const PART: usize = 1 << 14;
    let triangles = own.faces.len();
    if other.faces.len() != triangles {
        let read = [triangles, other.faces.len()].map(|n| format!("{n} triangles"));
        return (0, vec![Difference { what: "the count of triangles", count: 1, line: None, read }]);
    }
    let parts: Vec<Sums> = (0..triangles.div_ceil(PART))
        .into_par_iter()
        .map(|part| compare_part(own, other, part * PART..((part + 1) * PART).min(triangles)))
        .collect();
    let (made_up, found) = parts.into_iter().fold(Sums::default(), |(sum, all), (made_up, found)| {
        (sum + made_up, std::array::from_fn(|kind| all[kind].with(found[kind])))
    });
    let kinds = ["positions", "normals", "texture coordinates", "materials"];
    let shown: [fn(&ObjFile, usize, usize) -> String; 4] = [
        |f, t, c| format!("{:?}", position(f, t, c).to_array()),
        |f, t, c| format!("{:?}", value::<3>(f, f.normals.as_ref(), t, c)),
        |f, t, c| format!("{:?}", value::<2>(f, f.uvs.as_ref(), t, c)),
        |f, t, _| format!("'{}'", material(f, t)),
    ];
    let told = (0..4).filter_map(|kind| {
        let Found { count, first } = found[kind];
        let (triangle, corner) = first?;
        let read = [own, other].map(|file| shown[kind](file, triangle, corner));
        Some(Difference { what: kinds[kind], count, line: Some(triangle as u64), read })
    });
    (made_up, told.collect())
}

fn compare_part(own: &ObjFile, other: &ObjFile, part: std::ops::Range<usize>) -> Sums {
    let mut sums = Sums::default();
    let (made_up, found) = &mut sums;
    for t in part {
        for c in 0..3 {
            if !same_position(own, other, t, c) {
                found[0].at(t, c);
            }
            let normals = [own, other].map(|f| value::<3>(f, f.normals.as_ref(), t, c));
            let uvs = [own, other].map(|f| value::<2>(f, f.uvs.as_ref(), t, c));
            for (kind, same, none) in
                [(1, normals[0] == normals[1], normals[0].is_none()), (2, uvs[0] == uvs[1], uvs[0].is_none())]
            {
                if !same && none {
                    *made_up += 1;
                } else if !same {
                    found[kind].at(t, c);
                }
            }
        }
        if material(own, t) != material(other, t) {
            found[3].at(t, 0);
        }
    }
    sums
}

/// In the same frame every bit counts; else what the coarser of the two rounds.
fn same_position(own: &ObjFile, other: &ObjFile, t: usize, c: usize) -> bool {
    if own.frame == other.frame {
        return stored(own, t, c) == stored(other, t, c);
    }
    let (a, b) = (position(own, t, c), position(other, t, c));
    let rounding = |f: &ObjFile| f64::from(f32::EPSILON) * stored(f, t, c).abs().max_element() as f64;
    let slack = (rounding(own) * own.frame.world_per_local()).max(rounding(other) * other.frame.world_per_local());
    (a - b).abs().max_element() <= slack
}

fn stored(file: &ObjFile, t: usize, c: usize) -> Vec3 {
    Vec3::from_slice(&file.points[3 * file.faces[t][c] as usize..])
}

/// In the file's coordinates, but for the rounding to f32.
fn position(file: &ObjFile, t: usize, c: usize) -> DVec3 {
    file.frame.to_world(stored(file, t, c).as_dvec3())
}

fn value<const N: usize>(file: &ObjFile, of: Option<&CornerData>, t: usize, c: usize) -> Option<[f32; N]> {
    of.and_then(|data| data.get::<N>(data.of(&file.faces, t)[c]))
}

fn material(file: &ObjFile, t: usize) -> &str {
    let number = file.face_materials.as_ref().map_or(0, |all| all[t] as usize);
    file.materials.get(number).map_or("", |m| &m.name)
}
