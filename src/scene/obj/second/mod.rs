//! The second opinion: vertices and faces as tobj reads them.
//!
//! The first pass is the one of our own reader. It chooses the frame and finds the names of materials and
//! libraries, which our MTL reader reads: tobj itself opens no file. Every number and every corner is
//! tobj's. What tobj refuses is refused; what it would take for something else without a word is kept
//! from it ([`lines`] says what).
//!
//! Only vertices that faces have are kept, numbered by first use and anew in each of tobj's meshes. Where
//! some corners of a mesh have a normal or a texture coordinate and some have none, tobj gives these
//! that of the corner before.

mod lines;

use super::parse::{LARGEST, unit};
use super::pieces::Pieces;
use super::points::fits;
use super::read::{Materials, check_size, counts, gather, warnings};
use super::survey::{Sampling, Survey, running_totals, survey};
use super::{CornerData, Counts, ObjFile, ReadOptions, polygon};
use crate::math::Frame;
use crate::scene::Error;
use crate::scene::source::Source;
use glam::{DVec3, Vec3};
use lines::Lines;
use std::collections::HashMap;

/// Polygons stay whole: ours are split by [`polygon`], and so are these.
const LOAD: tobj::LoadOptions =
    tobj::LoadOptions { single_index: false, triangulate: false, ignore_points: true, ignore_lines: true };

/// Reads `source` by tobj; `piece` is the size of the parts that the first pass takes.
pub(super) fn read(source: &Source, options: &ReadOptions<'_>, piece: u64) -> Result<ObjFile, Error> {
    let pieces = Pieces::cut(source, options, piece)?;
    let sampling = Sampling::of_file(source.len);
    let jobs = vec![(); pieces.ranges.len()];
    let mut surveys: Vec<Survey> =
        pieces.each(jobs, &[], |i, (), text, joined| Ok(survey(text, pieces.ranges[i].start, joined, sampling)))?;
    let (before, total) = running_totals(&surveys);
    check_size(&total, &pieces)?;
    let materials = Materials::of(&pieces, &surveys, &before, &total)?;
    let frame = Frame::fit(&sampling.merge(surveys.iter()));
    // Points as tobj has them, in f64, and indices as it has them and as they are stored.
    options.free_memory.check_mesh(&source.path, total.triangles, 24 * (total.vertices + total.triangles))?;

    let mut lines = Lines::new(&pieces);
    let models = tobj::load_obj_buf(&mut lines, &LOAD, |_| Ok(names(&materials.runs.names)));
    let models = match models {
        Ok((models, _)) => models,
        Err(e) => return Err(lines.failure(&e)),
    };
    let mut mesh = Joined::default();
    for model in &models {
        mesh.add(&model.mesh, source)?;
    }
    drop(models);
    if mesh.faces.is_empty() {
        return Err(Error::NoFaces { path: source.path.clone(), why: "tobj finds no face with three corners".into() });
    }
    let clipped = mesh.split_polygons();
    let frame = settled(frame, &mesh.points);
    let notes = gather(&mut surveys, &mut []);
    let counts = counts(&total, clipped, &notes);
    let mut warnings = warnings(&pieces, &surveys, notes)?;
    let nameless = materials.runs.names.iter().position(|n| n.is_empty());
    let Materials { described, .. } = materials;
    warnings.extend(described.warnings);
    let mut materials = described.materials;
    let face_materials = mesh.face_materials(nameless, &mut materials);
    let (uv_wanted, mesh) = (options.wants_uv(&materials), mesh);
    Ok(ObjFile {
        points: mesh.points_in(&frame),
        rests: options.rests.then(|| mesh.rests_in(&frame)),
        frame,
        normals: mesh.normals.finish().filter(|_| options.normals),
        uvs: mesh.uvs.finish().filter(|_| uv_wanted),
        faces: mesh.faces,
        face_materials: face_materials.filter(|_| options.materials),
        materials: if options.materials { materials } else { Vec::new() },
        counts: Counts {
            unused_materials: described.unused as u64,
            unused_images: described.unused_images as u64,
            ..counts
        },
        warnings,
    })
}

/// What tobj takes for a library: every name that a face has, with or without quotes, as its place in `names`.
fn names(names: &[Box<[u8]>]) -> (Vec<tobj::Material>, HashMap<String, usize>) {
    let mut map = HashMap::new();
    for (i, name) in names.iter().enumerate().filter(|(_, name)| !name.is_empty()) {
        let name = super::text(name);
        map.insert(format!("\"{name}\""), i);
        map.insert(name, i);
    }
    (Vec::new(), map)
}

/// `frame`, or one that suits the points where a sample of them did not.
fn settled(frame: Frame, points: &[DVec3]) -> Frame {
    let reach = points.iter().map(|&p| frame.to_local(p).abs().max_element()).fold(0.0, f64::max);
    if fits(reach) { frame } else { frame.rescaled(reach) }
}

/// The meshes that tobj makes of a file, one behind the other.
#[derive(Default)]
struct Joined {
    /// In the file's coordinates.
    points: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
    /// Triangles of each polygon that has more than one: the first, and how many.
    polygons: Vec<(usize, usize)>,
    normals: Values,
    uvs: Values,
    /// Triangles and the material of each of tobj's meshes.
    runs: Vec<(usize, Option<usize>)>,
}

/// Normals or texture coordinates.
#[derive(Default)]
struct Values {
    values: Vec<f32>,
    /// For each triangle.
    indices: Vec<[u32; 3]>,
    any: bool,
}

impl Values {
    fn finish(self) -> Option<CornerData> {
        self.any.then_some(CornerData { values: self.values, indices: Some(self.indices) })
    }

    /// Adds the triangles of a mesh, whose corners have `indices`; none has any if those are empty.
    fn add(&mut self, indices: &[u32], triangles: &[[usize; 3]], first: u32) {
        self.any |= !indices.is_empty();
        let index = |&corner: &usize| indices.get(corner).map_or(CornerData::NONE, |i| first + i);
        self.indices.extend(triangles.iter().map(|t| t.each_ref().map(index)));
    }
}

impl Joined {
    fn add(&mut self, mesh: &tobj::Mesh, source: &Source) -> Result<(), Error> {
        let good = |x: &f64| x.abs() <= LARGEST;
        if ![&mesh.positions, &mesh.normals, &mesh.texcoords].into_iter().flatten().all(good) {
            let what = "it reads a number that is not finite or beyond 1e300; our own reader tells where".into();
            return Err(Error::SecondReader { path: source.path.clone(), line: None, what });
        }
        let base = self.points.len() as u32;
        self.points.extend(mesh.positions.chunks_exact(3).map(DVec3::from_slice));
        let triangles = self.triangles(mesh);
        self.faces.extend(triangles.iter().map(|t| t.map(|corner| base + mesh.indices[corner])));
        let first = (self.normals.values.len() / 3) as u32;
        self.normals.add(&mesh.normal_indices, &triangles, first);
        let units = mesh.normals.chunks_exact(3).flat_map(|n| unit(DVec3::from_slice(n)).as_vec3().to_array());
        self.normals.values.extend(units);
        let first = (self.uvs.values.len() / 2) as u32;
        self.uvs.add(&mesh.texcoord_indices, &triangles, first);
        self.uvs.values.extend(mesh.texcoords.iter().map(|&x| x as f32));
        self.runs.push((triangles.len(), mesh.material_id));
        Ok(())
    }

    /// The corners of each triangle, as their places in the mesh's lists: fans of its polygons.
    fn triangles(&mut self, mesh: &tobj::Mesh) -> Vec<[usize; 3]> {
        let first = self.faces.len();
        if mesh.face_arities.is_empty() {
            return (0..mesh.indices.len() / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        }
        let (mut triangles, mut corner) = (Vec::new(), 0);
        for &arity in &mesh.face_arities {
            let arity = arity as usize;
            if arity > 3 {
                self.polygons.push((first + triangles.len(), arity - 2));
            }
            triangles.extend((2..arity).map(|k| [corner, corner + k - 1, corner + k]));
            corner += arity;
        }
        triangles
    }

    /// Splits the polygons anew that a fan does not cover. Returns how many those are.
    fn split_polygons(&mut self) -> u64 {
        let (mut clipped, mut corners) = (0, Vec::new());
        let frame = Frame::fit(&self.points);
        for &(first, count) in &self.polygons {
            let fan = first..first + count;
            corners.clear();
            let of = super::fans::fan_corners(&self.faces[fan.clone()]);
            corners.extend(of.map(|i| frame.to_local(self.points[i as usize]).as_vec3()));
            let Some(triangles) = polygon::split(&corners) else { continue };
            clipped += 1;
            for all in [&mut self.faces, &mut self.normals.indices, &mut self.uvs.indices] {
                super::fans::rewrite(&mut all[fan.clone()], &triangles);
            }
        }
        clipped
    }

    /// The material of each triangle; nothing if one serves all. A face without one has number `nameless`,
    /// or a material that is added for it.
    fn face_materials(&self, nameless: Option<usize>, materials: &mut Vec<super::MtlMaterial>) -> Option<Vec<u32>> {
        let mut nameless = nameless;
        let mut number = |material: Option<usize>| {
            let number = material.or(nameless).unwrap_or_else(|| {
                materials.push(super::MtlMaterial::default());
                materials.len() - 1
            });
            nameless = if material.is_none() { Some(number) } else { nameless };
            number as u32
        };
        let runs = self.runs.iter().filter(|(triangles, _)| *triangles > 0);
        let runs: Vec<(usize, u32)> = runs.map(|&(triangles, material)| (triangles, number(material))).collect();
        let of_triangles = runs.iter().flat_map(|&(triangles, material)| std::iter::repeat_n(material, triangles));
        (materials.len() > 1).then(|| of_triangles.collect())
    }

    fn rests_in(&self, frame: &Frame) -> Vec<f32> {
        let rest = |&p: &DVec3| {
            let local = frame.to_local(p);
            (local - local.as_vec3().as_dvec3()).as_vec3().to_array()
        };
        self.points.iter().flat_map(rest).collect()
    }

    fn points_in(&self, frame: &Frame) -> Vec<f32> {
        let local = |&p: &DVec3| frame.to_local(p).as_vec3().clamp(Vec3::MIN, Vec3::MAX).to_array();
        self.points.iter().flat_map(local).chain([0.0]).collect()
    }
}
