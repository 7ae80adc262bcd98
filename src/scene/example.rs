//! Things to start from: a ball of lava rock with as many triangles as asked for, and first scenes.
//!
//! Everything here is a pure function of its arguments, down to the byte: only operations that IEEE 754
//! defines exactly are used (no `sin`, no `exp`), so no libm and no machine can change the text.

mod ember;
mod geodesic;
mod rock;
mod text;

pub use ember::{write_ember_materials, write_ember_scene};

use std::io::{self, Write};

use crate::geom::TriangleMesh;
use geodesic::Geodesic;
use rayon::prelude::*;
use rock::Rock;

/// Lines that one task formats at a time: about half a megabyte of text.
const CHUNK: u64 = 8192;

/// A scene file with comments that has one of each: ball, box, cylinder, floor, lens, light. TOML.
pub const FIRST_SCENE: &str = include_str!("example/first.toml");

/// What a generated mesh holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshCounts {
    /// Vertices, each with one normal.
    pub vertices: u64,
    /// Triangles.
    pub triangles: u64,
}

/// Writes a closed ball of lava rock as OBJ text: `v`, `vn` and `f a//a b//b c//c`, six decimals.
///
/// * The surface is a sphere around the origin, cut into `20 f²` triangles (a geodesic grid of frequency `f`)
///   and displaced to radii between 0.6 and 1.3, mean about 1. `f` is the one whose count is nearest to
///   `triangles`, never below 20 triangles. The comment at the head of the text says what it became.
/// * Vertices are welded: each edge is shared by exactly two triangles. All triangles run
///   counterclockwise seen from outside. Normals are unit and come from the gradient of the displacement.
/// * The more triangles, the finer the detail: octaves are added as soon as the grid can carry them.
/// * The same `triangles` gives the same bytes, for any number of threads. Memory stays at a few megabytes a thread.
///
/// # Errors
///
/// [`io::ErrorKind::InvalidInput`] when a vertex number would not fit 32 bits (more than 8,589,683,520
/// triangles), before anything is written, and whatever `out` answers.
pub fn write_mesh(triangles: u64, out: &mut dyn Write) -> io::Result<MeshCounts> {
    let grid = Geodesic::nearest(triangles).ok_or_else(|| {
        let most = Geodesic::new(Geodesic::MAX_FREQUENCY).counts().triangles;
        let what = format!(
            "{triangles} triangles need vertex numbers above {}, which OBJ readers do not take; \
             ask for at most {most}",
            u32::MAX
        );
        io::Error::new(io::ErrorKind::InvalidInput, what)
    })?;
    let (counts, rock) = (grid.counts(), Rock::new(grid.frequency()));
    let MeshCounts { vertices, triangles: became } = counts;
    writeln!(out, "# tison example mesh: a geodesic ball of lava rock, frequency {}", grid.frequency())?;
    writeln!(out, "# {became} triangles (asked for {triangles}), {vertices} vertices with normals")?;
    writeln!(out, "# radius about 1 around the origin, counterclockwise seen from outside")?;
    writeln!(out, "o rock")?;
    write_lines(vertices, out, |id, line| text::push_vector(line, "v", rock.point(grid.direction(id))))?;
    write_lines(vertices, out, |id, line| text::push_vector(line, "vn", rock.normal(grid.direction(id))))?;
    writeln!(out, "s 1")?;
    write_lines(became, out, |t, line| text::push_face(line, grid.triangle(t), 1))?;
    out.flush()?;
    Ok(counts)
}

/// Surface of a ball of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    /// The unit sphere.
    Round,
    /// The lava rock of [`write_mesh`].
    Rock,
}

/// The ball of [`write_mesh`] as a mesh, or a smooth one of as many triangles; closed, every edge shared by two.
///
/// At most 2^31 triangles are made, whatever is asked for.
#[must_use]
pub fn mesh(triangles: u64, surface: Surface) -> TriangleMesh {
    let grid = Geodesic::nearest(triangles.min(1 << 31)).expect("that few can be numbered");
    let (MeshCounts { vertices, triangles }, rock) = (grid.counts(), Rock::new(grid.frequency()));
    let point = |id| match surface {
        Surface::Round => grid.direction(id),
        Surface::Rock => rock.point(grid.direction(id)),
    };
    let points: Vec<[f32; 3]> = (0..vertices).into_par_iter().map(|id| point(id).as_vec3().to_array()).collect();
    let faces = (0..triangles).into_par_iter().map(|t| grid.triangle(t).map(|id| id as u32)).collect();
    TriangleMesh::new(points.into_flattened(), faces)
}

/// Writes the lines `0..count` in order; `push` appends one line, on any thread.
///
/// While one batch of chunks is written, the next is formatted.
fn write_lines(count: u64, out: &mut dyn Write, push: impl Fn(u64, &mut Vec<u8>) + Sync) -> io::Result<()> {
    let chunks = (4 * rayon::current_num_threads()).min(count.div_ceil(CHUNK) as usize);
    let batch = chunks as u64 * CHUNK;
    let fill = |buffers: &mut Vec<Vec<u8>>, start: u64| {
        buffers.par_iter_mut().enumerate().for_each(|(chunk, buffer)| {
            buffer.clear();
            let first = start + chunk as u64 * CHUNK;
            (first..count.min(first + CHUNK)).for_each(|i| push(i, buffer));
        });
    };
    let (mut full, mut spare) = (vec![Vec::new(); chunks], vec![Vec::new(); chunks]);
    fill(&mut full, 0);
    let mut next = batch;
    while next < count {
        rayon::in_place_scope(|scope| {
            scope.spawn(|_| fill(&mut spare, next));
            full.iter().try_for_each(|buffer| out.write_all(buffer))
        })?;
        std::mem::swap(&mut full, &mut spare);
        next += batch;
    }
    full.iter().try_for_each(|buffer| out.write_all(buffer))
}

#[cfg(test)]
mod tests;
