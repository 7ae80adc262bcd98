//! The geodesic grid: an icosahedron whose faces are cut into `f²` triangles each.
//!
//! Vertices are numbered without a table: 12 corners, then 30 edges of `f - 1` points, then 20 faces of
//! `(f - 1)(f - 2) / 2` inner points. A point on an edge has one number whichever face asks, so the grid
//! is welded by arithmetic, and any vertex or triangle can be had by its number alone.

use glam::DVec3;

use super::MeshCounts;

/// A grid of frequency `f`: each edge of the icosahedron is cut into `f` parts.
#[derive(Debug)]
pub(super) struct Geodesic {
    frequency: u64,
    corners: [DVec3; 12],
    /// The corners that each edge joins, lower one first.
    edges: Vec<[usize; 2]>,
    faces: Vec<Face>,
}

/// One of the 20 faces, counterclockwise seen from outside.
#[derive(Debug)]
struct Face {
    corners: [usize; 3],
    /// The edges between corners 0 and 1, 0 and 2, 1 and 2.
    sides: [Side; 3],
}

/// An edge as a face walks it.
#[derive(Debug)]
struct Side {
    edge: usize,
    /// Whether the face walks it from its higher corner to its lower one.
    reversed: bool,
}

/// A point of a face's triangular grid: row `i` counted from corner 0, `j`-th of the `i + 1` points in it.
#[derive(Clone, Copy)]
struct Spot {
    i: u64,
    j: u64,
}

impl Geodesic {
    /// The largest frequency whose vertex numbers, counted from 1, fit 32 bits: `10 f² + 2 < 2³²`.
    pub(super) const MAX_FREQUENCY: u64 = 20_724;

    /// The grid of this frequency, at least 1.
    pub(super) fn new(frequency: u64) -> Geodesic {
        let corners = icosahedron();
        let near = |a: usize, b: usize| corners[a].distance_squared(corners[b]) < 1.2;
        let edges: Vec<_> = pairs().filter(|&[a, b]| near(a, b)).collect();
        let side = |from: usize, to: usize| Side {
            edge: edges.iter().position(|e| *e == [from.min(to), from.max(to)]).expect("corners of a face are joined"),
            reversed: from > to,
        };
        let mut faces = Vec::with_capacity(20);
        for &[a, b] in &edges {
            for c in (b + 1..12).filter(|&c| near(a, c) && near(b, c)) {
                let outward = corners[a].dot(corners[b].cross(corners[c])) > 0.0;
                let (b, c) = if outward { (b, c) } else { (c, b) };
                faces.push(Face { corners: [a, b, c], sides: [side(a, b), side(a, c), side(b, c)] });
            }
        }
        Geodesic { frequency, corners, edges, faces }
    }

    /// The grid whose count of triangles is nearest to `triangles`, the smaller of two equally near;
    /// `None` above [`Geodesic::MAX_FREQUENCY`].
    pub(super) fn nearest(triangles: u64) -> Option<Geodesic> {
        let below = (triangles / 20).isqrt().max(1);
        if below > Self::MAX_FREQUENCY {
            return None;
        }
        let off = |f: u64| (20 * f * f).abs_diff(triangles);
        let f = if off(below + 1) < off(below) { below + 1 } else { below };
        (f <= Self::MAX_FREQUENCY).then(|| Geodesic::new(f))
    }

    pub(super) fn frequency(&self) -> u64 {
        self.frequency
    }

    /// Vertices and triangles of the whole grid.
    pub(super) fn counts(&self) -> MeshCounts {
        let square = self.frequency * self.frequency;
        MeshCounts { vertices: 10 * square + 2, triangles: 20 * square }
    }

    /// The unit vector to vertex `id`, in `0..vertices`.
    pub(super) fn direction(&self, id: u64) -> DVec3 {
        let f = self.frequency;
        let Some(on_edges) = id.checked_sub(12) else { return self.corners[id as usize] };
        if on_edges < 30 * (f - 1) {
            let [a, b] = self.edges[(on_edges / (f - 1)) as usize];
            let step = on_edges % (f - 1) + 1;
            return (self.corners[a] * (f - step) as f64 + self.corners[b] * step as f64).normalize();
        }
        let inside = on_edges - 30 * (f - 1);
        let [a, b, c] = self.faces[(inside / self.inner_points()) as usize].corners;
        let k = inside % self.inner_points();
        let row = ((8 * k + 1).isqrt() - 1) / 2;
        let (i, j) = (row + 2, k - row * (row + 1) / 2 + 1);
        let [a, b, c] = [a, b, c].map(|corner| self.corners[corner]);
        (a * (f - i) as f64 + b * (i - j) as f64 + c * j as f64).normalize()
    }

    /// The vertices of triangle `t`, in `0..triangles`, counterclockwise seen from outside.
    pub(super) fn triangle(&self, t: u64) -> [u64; 3] {
        let square = self.frequency * self.frequency;
        let (face, k) = ((t / square) as usize, t % square);
        // Row i of a face is a strip of 2i + 1 triangles, so i² come before it.
        let i = k.isqrt();
        let at = k - i * i;
        let j = at / 2;
        let (upper, lower) = (Spot { i, j }, Spot { i: i + 1, j });
        let spots = if at % 2 == 0 {
            [upper, lower, Spot { j: j + 1, ..lower }]
        } else {
            [upper, Spot { j: j + 1, ..lower }, Spot { j: j + 1, ..upper }]
        };
        spots.map(|spot| self.vertex(face, spot))
    }

    /// The number of a point of a face.
    fn vertex(&self, face: usize, Spot { i, j }: Spot) -> u64 {
        let f = self.frequency;
        let Face { corners, sides } = &self.faces[face];
        match (i, j) {
            (0, _) => corners[0] as u64,
            (_, 0) if i == f => corners[1] as u64,
            _ if j == f => corners[2] as u64,
            (_, 0) => self.on_side(&sides[0], i),
            _ if j == i => self.on_side(&sides[1], i),
            _ if i == f => self.on_side(&sides[2], j),
            _ => 12 + 30 * (f - 1) + face as u64 * self.inner_points() + (i - 1) * (i - 2) / 2 + j - 1,
        }
    }

    /// The number of the point `step` parts along a side, in `1..f`.
    fn on_side(&self, side: &Side, step: u64) -> u64 {
        let f = self.frequency;
        let step = if side.reversed { f - step } else { step };
        12 + side.edge as u64 * (f - 1) + step - 1
    }

    /// Points inside one face.
    fn inner_points(&self) -> u64 {
        let f = self.frequency;
        (f - 1) * f.saturating_sub(2) / 2
    }
}

/// The corners of the icosahedron, unit: cyclic shifts of `(0, ±1, ±golden ratio)`.
fn icosahedron() -> [DVec3; 12] {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    std::array::from_fn(|n| {
        let y = if n & 1 == 0 { 1.0 } else { -1.0 };
        let z = if n & 2 == 0 { golden } else { -golden };
        let corner = match n / 4 {
            0 => DVec3::new(0.0, y, z),
            1 => DVec3::new(z, 0.0, y),
            _ => DVec3::new(y, z, 0.0),
        };
        corner.normalize()
    })
}

/// All pairs of corners, lower one first.
fn pairs() -> impl Iterator<Item = [usize; 2]> {
    (0..12).flat_map(|a| (a + 1..12).map(move |b| [a, b]))
}
