//! Rays from inside closed meshes: each must hit.

use crate::geom::{Ray, TriangleMesh};
use crate::math::Random;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// What rays are aimed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    /// Nothing.
    Anywhere,
    /// A vertex, exactly where the ray starts at the origin.
    Vertex,
    /// A point of an edge.
    Edge,
    /// A point inside a triangle.
    Interior,
}

impl Aim {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Anywhere, Self::Vertex, Self::Edge, Self::Interior];

    /// Name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Anywhere => "random",
            Self::Vertex => "at vertices",
            Self::Edge => "at edges",
            Self::Interior => "at interiors",
        }
    }
}

/// Rays that are made and traced together.
const CHUNK: u64 = 4096;

/// Of `rays` rays from inside of `mesh`, which is closed and holds the ball of radius `room` around `center`, those
/// that `hits` says hit nothing. Traced on the current rayon pool; the same rays for any number of threads.
pub fn leaks(
    mesh: &TriangleMesh,
    (center, room): (Vec3, f32),
    aim: Aim,
    rays: u64,
    hits: impl Fn(&Ray) -> bool + Sync,
) -> u64 {
    let chunk = |chunk: u64| {
        let mut random = Random(0x5eed ^ (chunk << 8));
        let of_chunk = CHUNK.min(rays - chunk * CHUNK);
        let mut ray = || aimed(mesh, (center, room), aim, &mut random);
        (0..of_chunk).filter(|_| !hits(&ray())).count() as u64
    };
    (0..rays.div_ceil(CHUNK)).into_par_iter().map(chunk).sum()
}

fn aimed(mesh: &TriangleMesh, (center, room): (Vec3, f32), aim: Aim, random: &mut Random) -> Ray {
    // From the middle the direction to a vertex is the vertex, exactly, where the middle is zero.
    let from_middle = random.bits().is_multiple_of(2);
    let o = if from_middle { center } else { center + room * (random.unit().cbrt() * random.direction()).as_vec3() };
    if aim == Aim::Anywhere {
        return Ray::new(o, random.direction().as_vec3());
    }
    let corners = mesh.triangle(random.below(mesh.face_count()) as u32);
    let target = match aim {
        Aim::Vertex => corners[0],
        Aim::Edge => corners[0].lerp(corners[1], random.unit() as f32),
        _ => random.inside(corners).as_vec3(),
    };
    Ray::new(o, target - o)
}

/// The box from `-half` to `half`, every face cut into `2 n^2` triangles, with a block of a quarter of its size
/// that stands on its floor, not touching: a room as E. Cornell's renderings have it, closed.
#[must_use]
pub fn room(n: u32, half: f32) -> TriangleMesh {
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    add_box(n, DVec3::ZERO, f64::from(half), &mut points, &mut faces);
    let block = 0.25 * f64::from(half);
    add_box(1, DVec3::new(0.4, -0.6, -0.3) * f64::from(half), block, &mut points, &mut faces);
    TriangleMesh::new(points, faces)
}

/// Six faces whose edges share their points' coordinates, bit for bit.
fn add_box(n: u32, center: DVec3, half: f64, points: &mut Vec<f32>, faces: &mut Vec<[u32; 3]>) {
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let first = points.len() as u32 / 3;
            let step = |i: u32| 2.0 * f64::from(i) / f64::from(n) - 1.0;
            for (i, j) in (0..=n).flat_map(|i| (0..=n).map(move |j| (i, j))) {
                let mut p = DVec3::ZERO;
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, step(i), step(j));
                points.extend((center + half * p).as_vec3().to_array());
            }
            let at = |i: u32, j: u32| first + i * (n + 1) + j;
            let cells = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
            faces.extend(cells.flat_map(|(i, j)| {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                [[a, b, c], [a, c, d]]
            }));
        }
    }
}
