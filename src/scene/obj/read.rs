//! Puts the passes together.

use super::super::parallel::cut;
use super::super::source::Source;
use super::super::{Error, Warning};
use super::fans;
use super::materials::{Described, LibraryStatement, Runs, describe};
use super::notes::{Kind, Notes};
use super::parse::{self, Parsed, Plan, Target, Usage};
use super::pieces::Pieces;
use super::points;
use super::survey::{self, Sampling, Survey, Tally, running_totals};
use super::{CornerData, Counts, ObjFile, ReadOptions};
use crate::math::Frame;
use rayon::prelude::*;
use tison_pages::zeroes;

/// Reads `source` in pieces of about `piece` bytes.
pub(super) fn read(source: &Source, options: &ReadOptions<'_>, piece: u64) -> Result<ObjFile, Error> {
    let pieces = Pieces::cut(source, options, piece)?;
    let sampling = Sampling::of_file(source.len);
    let jobs = vec![(); pieces.ranges.len()];
    let mut surveys: Vec<Survey> = pieces
        .each(jobs, &[], |i, (), text, joined| Ok(survey::survey(text, pieces.ranges[i].start, joined, sampling)))?;
    let (before, total) = running_totals(&surveys);
    check_size(&total, &pieces)?;
    // Before anything is parsed: whether an image is sampled decides what is stored.
    let materials = Materials::of(&pieces, &surveys, &before, &total)?;
    let uv_wanted = options.wants_uv(&materials.described.materials);
    let plan = Plan {
        frame: Frame::fit(&sampling.merge(surveys.iter())),
        total,
        normals: options.normals && total.normals > 0,
        uv: uv_wanted && total.textures > 0,
    };

    let bytes = plan.bytes() + if options.rests { 12 * total.vertices } else { 0 };
    options.free_memory.check_mesh(&source.path, total.triangles, bytes)?;
    let mut arrays = Arrays::new(&plan);
    let mut parsed = pieces.each(arrays.targets(&surveys), &surveys, |i, target, text, _| {
        parse::parse(text, pieces.ranges[i].start, before[i], &plan, target)
    })?;
    if total.triangles == 0 {
        return Err(no_faces(&pieces, &surveys, &total)?);
    }
    let frame = settle_frame(&pieces, &surveys, &mut arrays, plan.frame, &parsed)?;
    let rests = if options.rests { Some(rests(&pieces, &surveys, &arrays.points, &frame)?) } else { None };
    arrays.settle_indices(&parsed);
    let clipped = split_polygons(&mut arrays, &surveys, &parsed);

    let notes = gather(&mut surveys, &mut parsed);
    let counts = counts(&total, clipped, &notes);
    let mut warnings = warnings(&pieces, &surveys, notes)?;
    let Materials { runs, described } = materials;
    warnings.extend(described.warnings);
    Ok(ObjFile {
        frame,
        face_materials: runs.per_triangle(arrays.faces.len()),
        normals: arrays.normal_of.map(|indices| CornerData { values: arrays.normals, indices }),
        uvs: arrays.uv_of.map(|indices| CornerData { values: arrays.uvs, indices }),
        points: arrays.points,
        rests,
        faces: arrays.faces,
        materials: described.materials,
        counts: Counts {
            unused_materials: described.unused as u64,
            unused_images: described.unused_images as u64,
            ..counts
        },
        warnings,
    })
}

/// The line of the face that triangle number `triangle` is made of.
pub(super) fn line_of_triangle(
    source: &Source,
    triangle: u64,
    options: &ReadOptions<'_>,
    piece: u64,
) -> Result<Option<u64>, Error> {
    let pieces = Pieces::cut(source, options, piece)?;
    let sampling = Sampling::of_file(source.len);
    let jobs = || vec![(); pieces.ranges.len()];
    let start = |i: usize| pieces.ranges[i].start;
    let surveys =
        pieces.each(jobs(), &[], |i, (), text, joined| Ok(survey::survey(text, start(i), joined, sampling)))?;
    let (before, _) = running_totals(&surveys);
    let places = pieces.each(jobs(), &surveys, |i, (), text, _| {
        let here = before[i].triangles..before[i].triangles + surveys[i].tally.triangles;
        let wanted = here.contains(&triangle).then(|| triangle - before[i].triangles);
        Ok(wanted.and_then(|wanted| survey::place_of_triangle(text, start(i), wanted)))
    })?;
    let offset = places.into_iter().flatten().next();
    offset.map(|offset| Ok(pieces.place(offset, &surveys)?.0)).transpose()
}

/// What was odd, in the order of the file.
pub(super) fn warnings(pieces: &Pieces<'_>, surveys: &[Survey], notes: Notes) -> Result<Vec<Warning>, Error> {
    let told = notes.sorted().into_iter().map(|note| {
        let (line, _) = pieces.place(note.offset, surveys)?;
        Ok(Warning::at(&pieces.source.path, line, note.message()))
    });
    told.collect()
}

/// Which triangles have which materials, and what is said about those.
#[derive(Default)]
pub(super) struct Materials {
    pub(super) runs: Runs,
    pub(super) described: Described,
}

impl Materials {
    pub(super) fn of(pieces: &Pieces<'_>, surveys: &[Survey], before: &[Tally], total: &Tally) -> Result<Self, Error> {
        if !pieces.options.materials {
            return Ok(Self::default());
        }
        let runs = Runs::join(surveys, before, total.triangles);
        let statements = statements(pieces, surveys)?;
        let described = describe(&runs.names, &statements, &pieces.source.path, pieces.options.allow)?;
        Ok(Self { runs, described })
    }
}

/// The arrays that the second pass fills.
struct Arrays {
    points: Vec<f32>,
    faces: Vec<[u32; 3]>,
    normals: Vec<f32>,
    uvs: Vec<f32>,
    /// Absent where not wanted or where no corner has any; `Some(None)` where the indices
    /// of `faces` serve.
    normal_of: Option<Option<Vec<[u32; 3]>>>,
    uv_of: Option<Option<Vec<[u32; 3]>>>,
}

impl Arrays {
    fn new(plan: &Plan) -> Self {
        let triangles = plan.total.triangles as usize;
        let values = |wanted: bool, components: u64| zeroes(if wanted { components as usize } else { 0 });
        Self {
            points: zeroes(3 * plan.total.vertices as usize + 1),
            faces: zeroes(triangles),
            normals: values(plan.normals, 3 * plan.total.normals),
            uvs: values(plan.uv, 2 * plan.total.textures),
            normal_of: plan.normals.then(|| Some(vec![[0; 3]; triangles])),
            uv_of: plan.uv.then(|| Some(vec![[0; 3]; triangles])),
        }
    }

    /// Each piece's part of everything.
    fn targets(&mut self, surveys: &[Survey]) -> Vec<Target<'_>> {
        fn parts<'a, T>(
            all: &'a mut [T],
            surveys: &[Survey],
            length: impl Fn(&Tally) -> u64,
        ) -> std::vec::IntoIter<&'a mut [T]> {
            let wanted = !all.is_empty();
            cut(all, surveys.iter().map(|s| if wanted { length(&s.tally) as usize } else { 0 })).into_iter()
        }
        let mut points = parts(&mut self.points, surveys, |t| 3 * t.vertices);
        let mut normals = parts(&mut self.normals, surveys, |t| 3 * t.normals);
        let mut uvs = parts(&mut self.uvs, surveys, |t| 2 * t.textures);
        let mut faces = parts(&mut self.faces, surveys, |t| t.triangles);
        let mut normal_of = parts(slots(&mut self.normal_of), surveys, |t| t.triangles);
        let mut uv_of = parts(slots(&mut self.uv_of), surveys, |t| t.triangles);
        let each = "there is a part for every piece";
        (0..surveys.len())
            .map(|_| Target {
                points: points.next().expect(each),
                normals: normals.next().expect(each),
                uvs: uvs.next().expect(each),
                faces: faces.next().expect(each),
                normal_of: normal_of.next().expect(each),
                uv_of: uv_of.next().expect(each),
            })
            .collect()
    }

    /// Turns the differences to vertex indices that were parsed into indices, where they
    /// are needed at all.
    fn settle_indices(&mut self, parsed: &[Parsed]) {
        let used = |usage: fn(&Parsed) -> Usage| {
            let all = parsed.iter().map(usage);
            all.fold(Usage::default(), |a, b| Usage { any: a.any || b.any, own_index: a.own_index || b.own_index })
        };
        settle(&mut self.normal_of, &mut self.normals, used(|p| p.normals), &self.faces);
        settle(&mut self.uv_of, &mut self.uvs, used(|p| p.uvs), &self.faces);
    }
}

fn slots(of: &mut Option<Option<Vec<[u32; 3]>>>) -> &mut [[u32; 3]] {
    of.as_mut().and_then(Option::as_deref_mut).unwrap_or_default()
}

fn settle(of: &mut Option<Option<Vec<[u32; 3]>>>, values: &mut Vec<f32>, usage: Usage, faces: &[[u32; 3]]) {
    if !usage.any {
        *of = None;
        *values = Vec::new();
    } else if !usage.own_index {
        *of = of.is_some().then_some(None);
    }
    slots(of).par_iter_mut().zip(faces).for_each(|(differences, face)| {
        for (d, v) in differences.iter_mut().zip(face) {
            *d = d.wrapping_add(*v);
        }
    });
}

/// Everything must be countable.
pub(super) fn check_size(total: &Tally, pieces: &Pieces<'_>) -> Result<(), Error> {
    let all = [
        ("vertices", total.vertices),
        ("texture coordinates", total.textures),
        ("normals", total.normals),
        ("triangles", total.triangles),
    ];
    all.into_iter().try_for_each(|(what, count)| super::check_count(pieces.source, what, count))
}

/// [`points::settle_frame`] for a file that was parsed.
fn settle_frame(
    pieces: &Pieces<'_>,
    surveys: &[Survey],
    arrays: &mut Arrays,
    frame: Frame,
    parsed: &[Parsed],
) -> Result<Frame, Error> {
    let reach = parsed.iter().map(|p| p.reach).fold(0.0, f64::max);
    points::settle_frame(&mut arrays.points, &arrays.faces, frame, reach, |frame, points| {
        let parts = cut(points, surveys.iter().map(|s| 3 * s.tally.vertices as usize));
        let all = pieces.each(parts, surveys, |_, points, text, _| parse::parse_points(text, frame, points))?;
        Ok(all.into_iter().fold(0.0, f64::max))
    })
}

/// What rounding took from `points`, which are in `frame`.
fn rests(pieces: &Pieces<'_>, surveys: &[Survey], points: &[f32], frame: &Frame) -> Result<Vec<f32>, Error> {
    let mut rests = vec![0.0; points.len() - points.len() % 3];
    let parts = cut(&mut rests, surveys.iter().map(|s| 3 * s.tally.vertices as usize));
    pieces.each(parts, surveys, |_, rests, text, _| parse::parse_rests(text, frame, rests))?;
    Ok(rests)
}

/// Splits the polygons anew that a fan does not cover. Returns how many those are.
fn split_polygons(arrays: &mut Arrays, surveys: &[Survey], parsed: &[Parsed]) -> u64 {
    if parsed.iter().all(|p| p.continues.is_empty()) {
        return 0;
    }
    let points = std::mem::take(&mut arrays.points);
    let targets = arrays.targets(surveys).into_par_iter().zip(parsed);
    let clipped =
        targets.map(|(t, found)| fans::split(&points, t.faces, [t.normal_of, t.uv_of], &found.continues)).sum();
    arrays.points = points;
    clipped
}

pub(super) fn gather(surveys: &mut [Survey], parsed: &mut [Parsed]) -> Notes {
    let mut notes = Notes::default();
    for s in surveys {
        notes.append(std::mem::take(&mut s.notes));
    }
    for p in parsed {
        notes.append(std::mem::take(&mut p.notes));
    }
    notes
}

pub(super) fn counts(total: &Tally, clipped: u64, notes: &Notes) -> Counts {
    Counts {
        vertices: total.vertices,
        textures: total.textures,
        normals: total.normals,
        polygons: total.polygons,
        triangles: total.triangles,
        clipped,
        short_faces: notes.count(Kind::ShortFace),
        objects: total.objects,
        groups: total.groups,
        polylines: notes.count(Kind::Polyline),
        points: notes.count(Kind::PointElement),
        unused_materials: 0,
        unused_images: 0,
    }
}

/// `mtllib` statements, each argument once.
fn statements(pieces: &Pieces<'_>, surveys: &[Survey]) -> Result<Vec<LibraryStatement>, Error> {
    let mut known = std::collections::BTreeSet::new();
    surveys
        .iter()
        .flat_map(|s| &s.libraries)
        .filter(|(_, argument)| known.insert(&**argument))
        .map(|(offset, argument)| {
            let (line, _) = pieces.place(*offset, surveys)?;
            Ok(LibraryStatement { line, argument: argument.clone() })
        })
        .collect()
}

/// Says what there is instead of faces.
fn no_faces(pieces: &Pieces<'_>, surveys: &[Survey], total: &Tally) -> Result<Error, Error> {
    let source = pieces.source;
    let count = |kind| surveys.iter().map(|s| s.notes.count(kind)).sum::<u64>();
    let (lines, points) = (count(Kind::Polyline), count(Kind::PointElement));
    let why = if source.len == 0 {
        "the file is empty".into()
    } else if total.polygons > 0 {
        "no face has three corners".into()
    } else if lines + points > 0 {
        format!("it has {lines} lines and {points} points, which are not rendered")
    } else if total.vertices > 0 {
        format!("it has {} vertices and no 'f' line", total.vertices)
    } else if count(Kind::WrongCase) > 0 {
        "keywords must be written in lower case, 'v' and 'f'".into()
    } else if source.looks_binary()? {
        "it looks like a binary file, not like OBJ text".into()
    } else {
        "it has no 'v' and no 'f' line; is it an OBJ file?".into()
    };
    Ok(Error::NoFaces { path: source.path.clone(), why })
}
