//! A triangle mesh as both backends read it: stored once, in f32, padded as Embree asks.

use super::{Bounds, LANES};
use crate::simd::{self, Kernel};
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

/// What the indices of a face hold that can never be hit. It keeps its place, so that
/// every other face keeps the number it has in the file.
pub const BAD_FACE: [u32; 3] = [u32::MAX; 3];

/// Largest coordinate that Embree takes; a triangle that goes beyond is dropped by it
/// without a word (`FLT_LARGE` in its sources).
const LARGEST: f32 = 1.844e18;

/// Triangles over shared vertices. Frozen once made.
#[derive(Debug)]
pub struct TriangleMesh {
    /// xyz per vertex and at least one float more: Embree reads 16 bytes at a time.
    points: Vec<f32>,
    /// What rounding to f32 took from each of them; empty where nobody wants to know.
    rests: Vec<f32>,
    faces: Vec<[u32; 3]>,
    faults: Faults,
    bounds: Bounds,
}

/// Triangles that can never be hit, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults {
    /// A vertex has a coordinate that is NaN, infinite or beyond 1.8e18.
    pub non_finite: usize,
    /// An index is past the last vertex.
    pub out_of_range: usize,
    /// No area: `|e1 x e2| == 0`, computed in f64.
    pub degenerate: usize,
}

impl Faults {
    /// All of them.
    #[must_use]
    pub fn total(&self) -> usize {
        self.non_finite + self.out_of_range + self.degenerate
    }

    fn plus(self, o: Self) -> Self {
        Self {
            non_finite: self.non_finite + o.non_finite,
            out_of_range: self.out_of_range + o.out_of_range,
            degenerate: self.degenerate + o.degenerate,
        }
    }
}

impl TriangleMesh {
    /// Takes `points` (xyz triples; what is left over counts as padding) and `faces`.
    ///
    /// Faces that can never be hit are counted in [`faults`](Self::faults) and their
    /// indices replaced by [`BAD_FACE`].
    #[must_use]
    pub fn new(mut points: Vec<f32>, mut faces: Vec<[u32; 3]>) -> Self {
        if points.len().is_multiple_of(3) {
            points.push(0.0);
        }
        let (faults, bounds) = inspect_all(&points, &mut faces);
        Self { points, rests: Vec::new(), faces, faults, bounds }
    }

    /// Keeps what rounding to f32 took from the points: xyz triples likewise, so that
    /// [`exact_triangle`](Self::exact_triangle) has the corners as they were.
    ///
    /// # Panics
    /// If there is not one for each coordinate.
    #[must_use]
    pub fn with_rests(self, rests: Vec<f32>) -> Self {
        assert_eq!(rests.len(), 3 * self.vertex_count(), "each coordinate has a rest");
        Self { rests, ..self }
    }

    /// The mesh with every vertex where `to` takes it, computed in f64 and rounded once. A triangle
    /// that can no longer be hit there counts with the others.
    #[must_use]
    pub fn moved(mut self, to: &DAffine3) -> Self {
        let points = self.points.len() - self.points.len() % 3;
        let points = self.points[..points].par_chunks_mut(3 * CHUNK);
        if self.rests.is_empty() {
            points.for_each(|chunk| {
                for p in chunk.chunks_exact_mut(3) {
                    let moved = to.transform_point3(Vec3::from_slice(p).as_dvec3());
                    p.copy_from_slice(&moved.as_vec3().to_array());
                }
            });
        } else {
            points.zip(self.rests.par_chunks_mut(3 * CHUNK)).for_each(|(points, rests)| {
                for (p, rest) in points.chunks_exact_mut(3).zip(rests.chunks_exact_mut(3)) {
                    let moved = to.transform_point3(whole(p, rest));
                    let rounded = moved.as_vec3();
                    p.copy_from_slice(&rounded.to_array());
                    rest.copy_from_slice(&(moved - rounded.as_dvec3()).as_vec3().to_array());
                }
            });
        }
        let (found, bounds) = inspect_all(&self.points, &mut self.faces);
        // What was bad before has lost its indices, and counts already.
        let faults = self.faults.plus(Faults { out_of_range: 0, ..found });
        Self { faults, bounds, ..self }
    }

    /// Box around where `to` takes every triangle that can be hit, in f64.
    #[must_use]
    pub fn bounds_under(&self, to: &DAffine3) -> Bounds {
        let corners = |chunk: &[[u32; 3]]| -> Bounds {
            let good = chunk.iter().filter(|&&face| face != BAD_FACE).flatten();
            good.map(|&i| to.transform_point3(self.point(i).as_dvec3())).collect()
        };
        self.faces.par_chunks(CHUNK).map(corners).reduce(|| Bounds::EMPTY, Bounds::union)
    }

    /// Vertices, used or not.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.points.len() / 3
    }

    /// Triangles as written, the ones that can never be hit included.
    #[must_use]
    pub fn face_count(&self) -> usize {
        self.faces.len()
    }

    /// Vertex indices of every triangle; [`BAD_FACE`] for one that can never be hit.
    #[must_use]
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// xyz of every vertex, followed by at least one float of padding.
    #[must_use]
    pub fn padded_points(&self) -> &[f32] {
        &self.points
    }

    /// Position of vertex `i`.
    ///
    /// # Panics
    /// If there is no such vertex.
    #[inline]
    #[must_use]
    pub fn point(&self, i: u32) -> Vec3 {
        let i = 3 * i as usize;
        let p = &self.points[i..i + 3];
        Vec3::new(p[0], p[1], p[2])
    }

    /// Corners of triangle `prim`, which must not be a [`BAD_FACE`].
    ///
    /// # Panics
    /// If there is no such triangle, or it is bad.
    #[inline]
    #[must_use]
    pub fn triangle(&self, prim: u32) -> [Vec3; 3] {
        self.faces[prim as usize].map(|i| self.point(i))
    }

    /// The same in f64: as they were before they were rounded to f32, to 48 bits, where that was
    /// [kept](Self::with_rests), and as they are stored where not.
    ///
    /// # Panics
    /// If there is no such triangle, or it is bad.
    #[must_use]
    pub fn exact_triangle(&self, prim: u32) -> [DVec3; 3] {
        self.faces[prim as usize].map(|i| match self.rests.get(3 * i as usize..) {
            Some(rest) if !rest.is_empty() => whole(&self.points[3 * i as usize..], rest),
            _ => self.point(i).as_dvec3(),
        })
    }

    /// Triangles that can never be hit.
    #[must_use]
    pub fn faults(&self) -> Faults {
        self.faults
    }

    /// Box around every triangle that can be hit.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Bytes of the buffers.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.points[..]) + size_of_val(&self.rests[..]) + size_of_val(&self.faces[..])
    }
}

/// A point and what rounding took from it.
fn whole(p: &[f32], rest: &[f32]) -> DVec3 {
    Vec3::from_slice(p).as_dvec3() + Vec3::from_slice(rest).as_dvec3()
}

/// Triangles or vertices in one unit of work.
const CHUNK: usize = 1 << 14;

fn inspect_all(points: &[f32], faces: &mut [[u32; 3]]) -> (Faults, Bounds) {
    let parts = faces.par_chunks_mut(CHUNK).map(|faces| simd::run(Inspect { points, faces }));
    parts.reduce(|| (Faults::default(), Bounds::EMPTY), |a, b| (a.0.plus(b.0), a.1.union(b.1)))
}

/// Finds the faces that can never be hit, and the box around the others.
struct Inspect<'a> {
    points: &'a [f32],
    faces: &'a mut [[u32; 3]],
}

impl Kernel for Inspect<'_> {
    type Output = (Faults, Bounds);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let mut faults = Faults::default();
        let (mut lo, mut hi) = ([[f32::INFINITY; LANES]; 3], [[f32::NEG_INFINITY; LANES]; 3]);
        let mut bounds = Bounds::EMPTY;
        let (many, rest) = self.faces.as_chunks_mut::<LANES>();
        for faces in many {
            let mut corners = [[[0f32; LANES]; 3]; 3];
            if gather(self.points, faces, &mut corners) && are_good(&corners) {
                widen(&corners, &mut lo, &mut hi);
            } else {
                inspect(self.points, faces, &mut faults, &mut bounds);
            }
        }
        inspect(self.points, rest, &mut faults, &mut bounds);
        let ends = |of: &[[f32; LANES]; 3], end: fn(f32, f32) -> f32| {
            DVec3::from_array([0, 1, 2].map(|k| of[k].into_iter().reduce(end).unwrap_or(0.0).into()))
        };
        (faults, bounds.union(Bounds { lo: ends(&lo, f32::min), hi: ends(&hi, f32::max) }))
    }
}

/// The corners of faces, if they have all of them.
#[inline(always)]
fn gather(points: &[f32], faces: &[[u32; 3]; LANES], corners: &mut [[[f32; LANES]; 3]; 3]) -> bool {
    for (lane, face) in faces.iter().enumerate() {
        for (corner, &i) in corners.iter_mut().zip(face) {
            let Some(p) = points.get(3 * i as usize..).and_then(|p| p.first_chunk::<3>()) else { return false };
            for k in 0..3 {
                corner[k][lane] = p[k];
            }
        }
    }
    true
}

/// Whether all of them can be hit.
#[inline(always)]
fn are_good([a, b, c]: &[[[f32; LANES]; 3]; 3]) -> bool {
    let mut good = [true; LANES];
    for i in 0..LANES {
        let edge = |to: &[[f32; LANES]; 3], k: usize| f64::from(to[k][i]) - f64::from(a[k][i]);
        let (u, v) = ([0, 1, 2].map(|k| edge(b, k)), [0, 1, 2].map(|k| edge(c, k)));
        let flat = (u[1] * v[2] - v[1] * u[2] == 0.0)
            & (u[2] * v[0] - v[2] * u[0] == 0.0)
            & (u[0] * v[1] - v[0] * u[1] == 0.0);
        good[i] = !flat;
        for k in 0..3 {
            good[i] &= (a[k][i].abs() < LARGEST) & (b[k][i].abs() < LARGEST) & (c[k][i].abs() < LARGEST);
        }
    }
    good.iter().fold(true, |all, &one| all & one)
}

/// Makes a box in each lane large enough.
#[inline(always)]
fn widen([a, b, c]: &[[[f32; LANES]; 3]; 3], lo: &mut [[f32; LANES]; 3], hi: &mut [[f32; LANES]; 3]) {
    let (less, more) = (|a: f32, b: f32| if b < a { b } else { a }, |a: f32, b: f32| if b > a { b } else { a });
    for k in 0..3 {
        for i in 0..LANES {
            lo[k][i] = less(lo[k][i], less(a[k][i], less(b[k][i], c[k][i])));
            hi[k][i] = more(hi[k][i], more(a[k][i], more(b[k][i], c[k][i])));
        }
    }
}

/// One after the other.
fn inspect(points: &[f32], faces: &mut [[u32; 3]], faults: &mut Faults, bounds: &mut Bounds) {
    let count = points.len() / 3;
    for face in faces {
        if face.iter().any(|&i| i as usize >= count) {
            faults.out_of_range += 1;
            *face = BAD_FACE;
            continue;
        }
        let p = face.map(|i| Vec3::from_slice(&points[3 * i as usize..]));
        let fits = |q: Vec3| q.abs().cmplt(Vec3::splat(LARGEST)).all();
        if !p.iter().all(|&q| fits(q)) {
            faults.non_finite += 1;
            *face = BAD_FACE;
        } else if !has_area(p) {
            faults.degenerate += 1;
            *face = BAD_FACE;
        } else {
            *bounds = bounds.union(p.map(Vec3::as_dvec3).into_iter().collect());
        }
    }
}

fn has_area(p: [Vec3; 3]) -> bool {
    let [a, b, c] = p.map(Vec3::as_dvec3);
    (b - a).cross(c - a) != DVec3::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_triangles_are_counted_by_reason_and_keep_their_place() {
        let points = vec![
            0.0,
            0.0,
            0.0,
            1.0,
            0.0,
            0.0,
            0.0,
            1.0,
            0.0,
            2.0,
            0.0,
            0.0,
            f32::NAN,
            0.0,
            0.0,
            f32::INFINITY,
            0.0,
            0.0,
            2e18,
            0.0,
            0.0,
        ];
        let faces = vec![[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 5, 2], [0, 1, 7], [6, 1, 2], [1, 1, 2], [0, 2, 3]];
        let mesh = TriangleMesh::new(points, faces);
        assert_eq!(mesh.faults(), Faults { non_finite: 3, out_of_range: 1, degenerate: 2 });
        assert_eq!(mesh.faults().total(), 6);
        assert_eq!((mesh.vertex_count(), mesh.face_count()), (7, 8));
        assert_eq!(mesh.faces()[0], [0, 1, 2]);
        assert_eq!(mesh.faces()[7], [0, 2, 3]);
        assert!(mesh.faces()[1..7].iter().all(|&f| f == BAD_FACE));
        assert_eq!(mesh.bounds(), Bounds { lo: DVec3::ZERO, hi: DVec3::new(2.0, 1.0, 0.0) });
        assert!(mesh.padded_points().len() > 3 * mesh.vertex_count());
    }

    #[test]
    fn a_mesh_is_moved_in_f64_and_counts_what_vanishes() {
        let points =
            vec![0., 0., 0., 1., 0., 0., 0., 1., 0., 1e-30, 0., 0., 0., 1e-30, 0., f32::NAN, 0., 0., 9., 9., 9.];
        let mesh = TriangleMesh::new(points, vec![[0, 1, 2], [0, 1, 1], [0, 1, 5], [0, 3, 4], [0, 1, 9]]);
        assert_eq!(mesh.faults(), Faults { non_finite: 1, out_of_range: 1, degenerate: 1 });
        let to = DAffine3::from_mat3_translation(
            glam::DMat3::from_diagonal(DVec3::new(2.0, 1.0, -1.0)),
            DVec3::new(1.0, 16_777_217.0 * 2f64.powi(-24), 3.0),
        );
        let under = mesh.bounds_under(&to);
        let moved = mesh.moved(&to);
        // The tiny one has shrunk to a point; vertex 6 is no triangle's.
        assert_eq!(moved.faults(), Faults { non_finite: 1, out_of_range: 1, degenerate: 2 });
        assert_eq!(moved.faces()[0], [0, 1, 2]);
        assert_eq!(moved.point(1).to_array(), [3.0, 1.0, 3.0]);
        assert_eq!((moved.face_count(), moved.vertex_count()), (5, 7));
        assert_eq!(moved.bounds(), Bounds { lo: DVec3::new(1.0, 1.0, 3.0), hi: DVec3::new(3.0, 2.0, 3.0) });
        assert_eq!(under.lo.y, 16_777_217.0 * 2f64.powi(-24), "not rounded");
        assert_eq!((under.lo.x, under.hi.x), (1.0, 3.0));
    }

    #[test]
    fn what_f32_loses_of_a_corner_can_be_kept() {
        let exact = [0.1f64, 0.2, 0.3, 1.1, 0.7, -0.4, 0.123_456_789_012, 1.3, 2.2];
        let points: Vec<f32> = exact.iter().map(|&x| x as f32).collect();
        let rests = exact.iter().map(|&x| (x - f64::from(x as f32)) as f32).collect();
        let near = |got: [DVec3; 3], want: [DVec3; 3]| {
            got.into_iter().zip(want).all(|(a, b)| (a - b).abs().max_element() < 1e-14)
        };
        let want = [0, 3, 6].map(|i| DVec3::from_slice(&exact[i..]));
        let plain = TriangleMesh::new(points.clone(), vec![[0, 1, 2]]);
        assert_eq!(plain.exact_triangle(0), plain.triangle(0).map(Vec3::as_dvec3));
        let mesh = TriangleMesh::new(points, vec![[0, 1, 2]]).with_rests(rests);
        assert!(near(mesh.exact_triangle(0), want));
        let to = DAffine3::from_scale_rotation_translation(
            DVec3::new(2.0, 0.3, 1.7),
            glam::DQuat::from_rotation_y(0.7),
            DVec3::new(0.3, -0.7, 0.1),
        );
        let moved = mesh.moved(&to);
        assert!(near(moved.exact_triangle(0), want.map(|p| to.transform_point3(p))));
        assert_eq!(moved.triangle(0), moved.exact_triangle(0).map(DVec3::as_vec3));
    }

    #[test]
    fn sixteen_at_a_time_are_inspected_as_one_is() {
        let mut points: Vec<f32> = (0..90).map(|i| (i * i % 23) as f32 - 0.25 * (i % 7) as f32).collect();
        (points[30], points[64]) = (f32::NAN, -3e18);
        for count in [0, 15, 16, 17, 200] {
            let index = |n: usize| (n * 7919 % 97 % 32) as u32;
            let faces: Vec<[u32; 3]> = (0..count).map(|i| [index(i), index(7 * i + 3), index(5 * i + 1)]).collect();
            let mut alone = faces.clone();
            let (mut faults, mut bounds) = (Faults::default(), Bounds::EMPTY);
            inspect(&points, &mut alone, &mut faults, &mut bounds);
            assert!(count < 200 || (faults.non_finite > 0 && faults.out_of_range > 0 && faults.degenerate > 0));
            for level in simd::Level::ALL {
                let mut many = faces.clone();
                let got = simd::run_at(level, Inspect { points: &points, faces: &mut many });
                assert_eq!((got, &many), ((faults, bounds), &alone));
            }
            let good: Vec<_> = alone.iter().copied().filter(|&face| face != BAD_FACE).collect();
            assert_eq!(inspect_all(&points, &mut good.clone()), (Faults::default(), bounds), "all of them good");
        }
    }

    #[test]
    fn an_empty_mesh_is_a_mesh() {
        let mesh = TriangleMesh::new(vec![], vec![]);
        assert_eq!((mesh.vertex_count(), mesh.face_count()), (0, 0));
        assert!(mesh.bounds().is_empty());
    }
}
