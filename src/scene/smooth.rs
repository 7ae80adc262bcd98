//! Normals for meshes that come without, by crease angle.

use super::obj::CornerData;
use crate::geom::{BAD_FACE, TriangleMesh};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

/// Normals that are smooth where faces meet at no more than `angle_deg` degrees, and sharp
/// elsewhere.
///
/// The normal at a corner is the sum of the unit normals of the faces around its vertex
/// that differ from its own face's by at most the angle, each weighted by the angle that
/// the face has there (G. Thürmer, C. A. Wüthrich, "Computing Vertex Normals from
/// Polygonal Facets", JGT 3(1), 1998): it does not depend on how the surface is cut into
/// triangles. Vertices at the same position count as one. Sums are f64.
///
/// * `angle_deg`: 0 joins only faces in one plane, 180 joins all
/// * result: unit normals; none ([`CornerData::NONE`]) at the corners of faces that can
///   never be hit. Where each vertex has one normal its index is the vertex's
/// * around a vertex with more than 256 faces their normals are first put together in
///   cells of a thousandth, so that the angle is good to about a tenth of a degree there
///
/// The result does not depend on the number of threads.
#[must_use]
pub fn crease_normals(mesh: &TriangleMesh, angle_deg: f64) -> CornerData {
    let fans = Fans::around(mesh);
    let cos = angle_deg.clamp(0.0, 180.0).to_radians().cos() - ROUNDING;
    let parts: Vec<Part> = fans
        .parts()
        .into_par_iter()
        .map(|fans_of_part| {
            let mut part = Part::default();
            let mut scratch = Scratch::default();
            for fan in fans_of_part {
                scratch.add_normals(mesh, fans.corners(fan), cos, &mut part);
            }
            part
        })
        .collect();
    let sharp = parts.iter().any(|p| p.counts.iter().any(|&n| n > 1));
    if sharp { per_corner(mesh, &fans, &parts) } else { per_vertex(mesh, &fans, &parts) }
}

/// Faces in one plane differ by so much in the cosine, by rounding.
const ROUNDING: f64 = 1e-9;

/// Fans in one unit of work.
const FANS_PER_PART: usize = 1 << 12;

/// The corners at each position, as `3 * face + corner`.
struct Fans {
    /// Vertices by position, those at one position in order of their number.
    vertices: Vec<u32>,
    /// Where in `vertices` each position begins, and the end.
    starts: Vec<u32>,
    /// Corners by vertex.
    by_vertex: Vec<u32>,
    /// Where in `by_vertex` each vertex begins, and the end.
    vertex_starts: Vec<u32>,
}

impl Fans {
    fn around(mesh: &TriangleMesh) -> Self {
        let (by_vertex, vertex_starts) = corners_by_vertex(mesh);
        let mut keyed: Vec<([u32; 3], u32)> = (0..mesh.vertex_count() as u32)
            .into_par_iter()
            .filter(|&v| vertex_starts[v as usize] < vertex_starts[v as usize + 1])
            // Adding zero makes -0 the same place as 0.
            .map(|v| ((mesh.point(v) + Vec3::ZERO).to_array().map(f32::to_bits), v))
            .collect();
        keyed.par_sort_unstable();
        let mut starts: Vec<u32> = (0..keyed.len())
            .into_par_iter()
            .filter(|&i| i == 0 || keyed[i - 1].0 != keyed[i].0)
            .map(|i| i as u32)
            .collect();
        starts.push(keyed.len() as u32);
        let vertices = keyed.into_par_iter().map(|(_, v)| v).collect();
        Self { vertices, starts, by_vertex, vertex_starts }
    }

    fn count(&self) -> usize {
        self.starts.len() - 1
    }

    fn parts(&self) -> Vec<Range<usize>> {
        (0..self.count()).step_by(FANS_PER_PART).map(|i| i..(i + FANS_PER_PART).min(self.count())).collect()
    }

    fn vertices(&self, fan: usize) -> &[u32] {
        &self.vertices[self.starts[fan] as usize..self.starts[fan + 1] as usize]
    }

    fn corners(&self, fan: usize) -> impl Iterator<Item = u32> {
        self.vertices(fan).iter().flat_map(|&v| {
            let range = self.vertex_starts[v as usize] as usize..self.vertex_starts[v as usize + 1] as usize;
            self.by_vertex[range].iter().copied()
        })
    }
}

/// Corners of good faces in order of their vertex, and where each vertex's begin.
fn corners_by_vertex(mesh: &TriangleMesh) -> (Vec<u32>, Vec<u32>) {
    let good = || mesh.faces().iter().enumerate().filter(|&(_, &f)| f != BAD_FACE);
    let mut starts = vec![0u32; mesh.vertex_count() + 1];
    for (_, face) in good() {
        for &v in face {
            starts[v as usize] += 1;
        }
    }
    let mut sum = 0;
    for s in &mut starts {
        sum += *s;
        *s = sum;
    }
    // Filled from the back, each start ends up where its vertex begins.
    let mut corners = vec![0; sum as usize];
    for (t, face) in good().rev() {
        for k in (0..3).rev() {
            let at = &mut starts[face[k] as usize];
            *at -= 1;
            corners[*at as usize] = (3 * t + k) as u32;
        }
    }
    (corners, starts)
}

/// Normals of some consecutive fans.
#[derive(Default)]
struct Part {
    values: Vec<[f32; 3]>,
    /// How many of `values` each fan has.
    counts: Vec<u32>,
    /// For each corner of each fan, which of the fan's values it has. Empty as long as
    /// every fan has one.
    which: Vec<u32>,
    /// Corners so far.
    corners: usize,
}

impl Part {
    /// Adds a fan with `values`, of which its corners have `which`.
    fn add_fan(&mut self, values: &[[f32; 3]], which: impl ExactSizeIterator<Item = u32>) {
        self.values.extend_from_slice(values);
        self.counts.push(values.len() as u32);
        let corners = self.corners + which.len();
        if values.len() > 1 || !self.which.is_empty() {
            self.which.resize(self.corners, 0);
            self.which.extend(which);
        }
        self.corners = corners;
    }
}

/// Buffers for one fan at a time.
#[derive(Default)]
struct Scratch {
    /// Per corner, the unit normal of its face and the angle there.
    weighted: Vec<(DVec3, f64)>,
    /// What is summed: `weighted`, or cells of it.
    cells: Vec<(DVec3, f64)>,
}

impl Scratch {
    fn add_normals(&mut self, mesh: &TriangleMesh, corners: impl Iterator<Item = u32>, cos: f64, out: &mut Part) {
        const MANY: usize = 256;
        self.weighted.clear();
        self.weighted.extend(corners.map(|c| weighted_normal(mesh, c)));
        if let Some(normal) = one_normal(&self.weighted, cos) {
            out.add_fan(&[normal], self.weighted.iter().map(|_| 0));
            return;
        }
        self.cells.clear();
        self.cells.extend_from_slice(&self.weighted);
        let cell_of = if self.weighted.len() > MANY { Some(gather_cells(&mut self.cells)) } else { None };

        let (mut values, mut which_of_cell) = (Vec::new(), Vec::new());
        for &(own, _) in &self.cells {
            let normal = sum_within(&self.cells, own, cos);
            which_of_cell.push(values.iter().position(|&v| v == normal).unwrap_or(values.len()) as u32);
            if which_of_cell.last() == Some(&(values.len() as u32)) {
                values.push(normal);
            }
        }
        match cell_of {
            Some(cell_of) => out.add_fan(&values, cell_of.into_iter().map(|c| which_of_cell[c as usize])),
            None => out.add_fan(&values, which_of_cell.into_iter()),
        }
    }
}

/// The sum of all normals, of unit length, if no two of them differ by more than the angle
/// because none differs from it by more than half of that.
fn one_normal(normals: &[(DVec3, f64)], cos: f64) -> Option<[f32; 3]> {
    let sum = normals.iter().fold(DVec3::ZERO, |sum, &(n, weight)| sum + weight * n);
    let unit = sum.try_normalize()?;
    // cos(a/2)^2 = (1 + cos a) / 2
    let cos_half = (0.5 + 0.5 * (cos + ROUNDING)).max(0.0).sqrt();
    let all_near = sum.length_squared() > CANCELLED && normals.iter().all(|(n, _)| n.dot(unit) >= cos_half);
    all_near.then(|| unit.as_vec3().to_array())
}

/// A sum of normals with a smaller squared length is rounding.
const CANCELLED: f64 = 1e-24;

/// Sum of the normals within the angle of `own`, of unit length.
fn sum_within(normals: &[(DVec3, f64)], own: DVec3, cos: f64) -> [f32; 3] {
    let near = normals.iter().filter(|(n, _)| n.dot(own) >= cos);
    let sum = near.fold(DVec3::ZERO, |sum, &(n, weight)| sum + weight * n);
    // Opposite faces may cancel.
    let unit = if sum.length_squared() > CANCELLED { sum.normalize() } else { own };
    unit.as_vec3().to_array()
}

/// Puts together normals that differ by about a thousandth; returns the cell of each.
fn gather_cells(normals: &mut Vec<(DVec3, f64)>) -> Vec<u32> {
    let key = |n: DVec3| (n * 1024.0).round().to_array().map(|x| x as i32);
    let mut order: Vec<u32> = (0..normals.len() as u32).collect();
    order.sort_by_key(|&i| key(normals[i as usize].0));
    let mut cell_of = vec![0; normals.len()];
    let mut cells: Vec<(DVec3, f64)> = Vec::new();
    let mut last = None;
    for i in order {
        let (n, weight) = normals[i as usize];
        if last.replace(key(n)) != Some(key(n)) {
            cells.push((DVec3::ZERO, 0.0));
        }
        let cell = cells.last_mut().expect("one was pushed for the first normal");
        *cell = (cell.0 + weight * n, cell.1 + weight);
        cell_of[i as usize] = cells.len() as u32 - 1;
    }
    for cell in &mut cells {
        // Normals of one cell nearly agree, so their sum has about the length of the weights.
        cell.0 = cell.0.normalize_or_zero();
    }
    *normals = cells;
    cell_of
}

/// Unit normal of a corner's face and the angle between its edges, in radians.
fn weighted_normal(mesh: &TriangleMesh, corner: u32) -> (DVec3, f64) {
    let (t, k) = (corner / 3, corner as usize % 3);
    let p = mesh.triangle(t).map(Vec3::as_dvec3);
    let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
    // The same product at all three corners: one face has one normal, to the last bit.
    let ng = (p[1] - p[0]).cross(p[2] - p[0]);
    let length = ng.length();
    (ng / length, length.atan2(a.dot(b)))
}

/// One normal a vertex.
fn per_vertex(mesh: &TriangleMesh, fans: &Fans, parts: &[Part]) -> CornerData {
    let mut values = vec![0.0; 3 * mesh.vertex_count()];
    let normals = parts.iter().flat_map(|p| &p.values);
    for (fan, normal) in normals.enumerate() {
        for &v in fans.vertices(fan) {
            values[3 * v as usize..][..3].copy_from_slice(normal);
        }
    }
    CornerData { values, indices: None }
}

/// Normals of their own for some corners.
fn per_corner(mesh: &TriangleMesh, fans: &Fans, parts: &[Part]) -> CornerData {
    let slots: Vec<AtomicU32> =
        (0..3 * mesh.face_count()).into_par_iter().map(|_| AtomicU32::new(CornerData::NONE)).collect();
    let bases: Vec<usize> =
        parts.iter().scan(0, |sum, p| Some(std::mem::replace(sum, *sum + p.values.len()))).collect();
    parts.par_iter().zip(bases).zip(fans.parts()).for_each(|((part, base), fans_of_part)| {
        let (mut first, mut which) = (base as u32, part.which.iter());
        for (fan, &count) in fans_of_part.zip(&part.counts) {
            for corner in fans.corners(fan) {
                let index = first + which.next().copied().unwrap_or(0);
                slots[corner as usize].store(index, Ordering::Relaxed);
            }
            first += count;
        }
    });
    let load = |i: usize| slots[i].load(Ordering::Relaxed);
    let indices =
        (0..mesh.face_count()).into_par_iter().map(|t| [load(3 * t), load(3 * t + 1), load(3 * t + 2)]).collect();
    let values = parts.iter().flat_map(|p| &p.values).flatten().copied().collect();
    CornerData { values, indices: Some(indices) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A cube over `apart` or shared vertices, two triangles a side, wound outwards.
    fn cube(apart: bool) -> TriangleMesh {
        let corner = |i: u32| [i & 1, i >> 1 & 1, i >> 2].map(|b| if b == 1 { 1.0 } else { -0.0 });
        let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let mut points: Vec<f32> = (0..8).flat_map(corner).collect();
        let mut faces = Vec::new();
        for side in sides {
            let s = if apart {
                let base = points.len() as u32 / 3;
                points.extend(side.into_iter().flat_map(corner));
                [base, base + 1, base + 2, base + 3]
            } else {
                side
            };
            faces.extend([[s[0], s[1], s[2]], [s[0], s[2], s[3]]]);
        }
        TriangleMesh::new(points, faces)
    }

    fn normals(mesh: &TriangleMesh, data: &CornerData, t: usize) -> [Vec3; 3] {
        data.of(mesh.faces(), t).map(|i| Vec3::from(data.get::<3>(i).expect("the corner has one")))
    }

    #[test]
    fn a_cube_is_sharp_below_90_degrees_and_smooth_above() {
        for apart in [false, true] {
            let mesh = cube(apart);
            let sharp = crease_normals(&mesh, 89.0);
            assert_eq!(sharp.values.len(), 3 * 24, "each corner of a side has one normal");
            let smooth = crease_normals(&mesh, 91.0);
            assert_eq!(smooth.indices, None);
            for t in 0..mesh.face_count() {
                let p = mesh.triangle(t as u32);
                let ng = (p[1] - p[0]).cross(p[2] - p[0]).normalize();
                for (k, n) in normals(&mesh, &sharp, t).into_iter().enumerate() {
                    assert!((n - ng).length() < 1e-6, "side {t}, corner {k}: {n}");
                }
                for (k, n) in normals(&mesh, &smooth, t).into_iter().enumerate() {
                    // Weights by angle: each side counts once, however it is cut.
                    let diagonal = (p[k] - Vec3::splat(0.5)).normalize();
                    assert!((n - diagonal).length() < 1e-6, "side {t}, corner {k}: {n}");
                }
            }
        }
    }

    #[test]
    fn a_flat_sheet_has_one_normal_at_angle_zero() {
        let n = 5u32;
        let points = (0..n * n).flat_map(|i| [(i % n) as f32 * 0.3, (i / n) as f32 * 0.7, 0.25]).collect();
        let cell = |i: u32| [[i, i + 1, i + n], [i + 1, i + n + 1, i + n]];
        let faces = (0..n * (n - 1)).filter(|i| i % n < n - 1).flat_map(cell).collect();
        let data = crease_normals(&TriangleMesh::new(points, faces), 0.0);
        assert_eq!(data.indices, None);
        assert!(data.values.chunks(3).all(|v| v == [0.0, 0.0, 1.0]));
    }

    #[test]
    fn bad_faces_count_for_nothing() {
        let points = vec![0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1., f32::NAN, 0., 0.];
        let faces = vec![[0, 1, 1], [0, 1, 2], [0, 1, 9], [0, 4, 1], [0, 1, 3]];
        let mesh = TriangleMesh::new(points, faces);
        let data = crease_normals(&mesh, 30.0);
        for t in [0, 2, 3] {
            assert_eq!(data.of(mesh.faces(), t), BAD_FACE);
        }
        assert_eq!(normals(&mesh, &data, 1), [Vec3::Z; 3]);
        assert_eq!(normals(&mesh, &data, 4), [-Vec3::Y; 3]);
        assert!(crease_normals(&TriangleMesh::new(vec![], vec![]), 30.0).values.is_empty());
    }

    #[test]
    fn opposite_faces_do_not_cancel() {
        let mesh = TriangleMesh::new(vec![0., 0., 0., 1., 0., 0., 0., 1., 0.], vec![[0, 1, 2], [0, 2, 1]]);
        let data = crease_normals(&mesh, 180.0);
        assert_eq!(normals(&mesh, &data, 0), [Vec3::Z; 3]);
        assert_eq!(normals(&mesh, &data, 1), [-Vec3::Z; 3]);
    }

    #[test]
    fn a_vertex_with_very_many_faces() {
        // A cone with a flat base around its foot's centre.
        let n = 100_000u32;
        let mut points = vec![0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        for i in 0..n {
            let a = f64::from(i) / f64::from(n) * std::f64::consts::TAU;
            points.extend([a.cos() as f32, a.sin() as f32, 0.0]);
        }
        let faces = (0..n).flat_map(|i| {
            let (a, b) = (2 + i, 2 + (i + 1) % n);
            [[0, a, b], [1, b, a]]
        });
        let mesh = TriangleMesh::new(points, faces.collect());
        for (angle, tip_along_axis) in [(180.0, true), (60.0, false)] {
            let data = crease_normals(&mesh, angle);
            let tip = normals(&mesh, &data, 0)[0];
            assert_eq!((tip - Vec3::Z).length() < 1e-3, tip_along_axis, "{tip} at {angle}");
            assert!((normals(&mesh, &data, 1)[0] + Vec3::Z).length() < 1e-6);
        }
    }

    proptest! {
        #[test]
        fn every_normal_is_the_sum_that_it_should_be(
            points in proptest::collection::vec([0i8..3, 0i8..3, 0i8..3], 3..12),
            faces in proptest::collection::vec([0u32..12, 0u32..12, 0u32..12], 1..20),
            angle in 0.0..180.0f64,
        ) {
            let mesh = TriangleMesh::new(points.iter().flatten().map(|&x| f32::from(x)).collect(), faces);
            let data = crease_normals(&mesh, angle);
            let cos = angle.to_radians().cos() - ROUNDING;
            let good: Vec<u32> = (0..mesh.face_count() as u32).filter(|&t| mesh.faces()[t as usize] != BAD_FACE).collect();
            for &t in &good {
                for (k, got) in normals(&mesh, &data, t as usize).into_iter().enumerate() {
                    let here = mesh.triangle(t)[k];
                    let own = weighted_normal(&mesh, 3 * t).0;
                    let around: Vec<_> = good.iter().flat_map(|&s| (0..3).map(move |j| (s, j)))
                        .filter(|&(s, j)| mesh.triangle(s)[j] == here)
                        .map(|(s, j)| weighted_normal(&mesh, 3 * s + j as u32))
                        .filter(|(n, _)| n.dot(own) >= cos)
                        .collect();
                    let sum = around.iter().fold(DVec3::ZERO, |sum, &(n, w)| sum + w * n);
                    let want = if sum.length() > 1e-9 { sum.normalize() } else { own };
                    prop_assert!((got.as_dvec3() - want).length() < 1e-6, "{got} for {want}");
                }
            }
        }
    }
}
