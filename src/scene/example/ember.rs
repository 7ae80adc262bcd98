//! The first scene: an ember on a slab of stone, with two glossy balls beside it.

use std::io::{self, Write};

use glam::DVec3;

use super::geodesic::Geodesic;
use super::rock::Rock;
use super::text;
use super::write_lines;

/// Frequency of the ember's grid: 13,520 triangles.
const EMBER: u64 = 26;
/// Frequency of the grid that the ember's detail is made for: sharper than its own can follow, for a broken crust.
const DETAIL: u64 = 44;
/// How deep the ember sits in its slab, so that it rests on more than a point.
const SUNK: f64 = 0.02;
/// Height of the slab.
const THICK: f64 = 0.22;

/// The ember's materials, and the crack depth from which each is used.
const BANDS: [(&str, f64); 3] = [("crust", 0.0), ("hot", 0.76), ("glow", 0.93)];

/// A ball beside the ember.
struct Ball {
    name: &'static str,
    /// Where it stands on the slab, x and z.
    at: [f64; 2],
    radius: f64,
    frequency: u64,
}

const BALLS: [Ball; 2] = [
    Ball { name: "copper", at: [0.92, 1.02], radius: 0.3, frequency: 10 },
    Ball { name: "glaze", at: [0.12, 1.3], radius: 0.17, frequency: 8 },
];

/// The slab's outline seen from above, x and z: a square with one corner cut.
const OUTLINE: [[f64; 2]; 5] = [[-1.6, -1.5], [-1.6, 1.3], [-1.1, 1.8], [1.7, 1.8], [1.7, -1.5]];

/// Writes the ember scene as OBJ text; its colours are in `ember.mtl`, see [`write_ember_materials`].
///
/// The y axis points up and the ember is the ball of [`super::write_mesh`] with 13,520 triangles, split by depth into
/// groups of three materials. The slab has no normals, polygons of four and five corners and indices counted
/// from the end. Other indices are counted from 1.
///
/// # Errors
///
/// Whatever `out` answers.
pub fn write_ember_scene(out: &mut dyn Write) -> io::Result<()> {
    let (grid, rock) = (Geodesic::new(EMBER), Rock::new(DETAIL));
    let points: Vec<_> = (0..grid.counts().vertices).map(|id| rock.point(grid.direction(id))).collect();
    let ground = points.iter().fold(0.0, |low, p| p.y.min(low)) + SUNK;
    writeln!(out, "# tison example ember: a cooling ember on a slab of stone")?;
    writeln!(out, "mtllib ember.mtl")?;
    write_ember(&grid, &rock, &points, out)?;
    let mut first = grid.counts().vertices + 1;
    for ball in &BALLS {
        first += write_ball(ball, ground, first, out)?;
    }
    write_slab(ground, out)
}

/// Writes `ember.mtl`, the materials of [`write_ember_scene`]. Colours are linear.
///
/// # Errors
///
/// Whatever `out` answers.
pub fn write_ember_materials(out: &mut dyn Write) -> io::Result<()> {
    out.write_all(include_bytes!("../../../scenes/ember.mtl"))
}

/// The ball of rock, its triangles grouped by how deep in a crack they lie.
fn write_ember(grid: &Geodesic, rock: &Rock, points: &[DVec3], out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "o ember")?;
    let vertices = grid.counts().vertices;
    write_lines(vertices, out, |id, line| text::push_vector(line, "v", points[id as usize]))?;
    write_lines(vertices, out, |id, line| text::push_vector(line, "vn", rock.normal(grid.direction(id))))?;
    writeln!(out, "s 1")?;
    let depth: Vec<_> = (0..vertices).map(|id| rock.crack(grid.direction(id))).collect();
    let band = |t: u64| {
        let mean = grid.triangle(t).iter().map(|&id| depth[id as usize]).sum::<f64>() / 3.0;
        BANDS.iter().rposition(|(_, from)| mean >= *from).unwrap_or(0)
    };
    for (b, (material, _)) in BANDS.iter().enumerate() {
        writeln!(out, "g {material}\nusemtl {material}")?;
        let mut lines = Vec::new();
        for t in (0..grid.counts().triangles).filter(|&t| band(t) == b) {
            text::push_face(&mut lines, grid.triangle(t), 1);
        }
        out.write_all(&lines)?;
    }
    Ok(())
}

/// A ball on the ground whose first vertex gets the number `first`; answers how many vertices it took.
fn write_ball(ball: &Ball, ground: f64, first: u64, out: &mut dyn Write) -> io::Result<u64> {
    let &Ball { name, at: [x, z], radius, frequency } = ball;
    let grid = Geodesic::new(frequency);
    let counts = grid.counts();
    let centre = DVec3::new(x, ground + radius, z);
    writeln!(out, "o {name}\ng {name}\nusemtl {name}")?;
    write_lines(counts.vertices, out, |id, line| text::push_vector(line, "v", centre + grid.direction(id) * radius))?;
    write_lines(counts.vertices, out, |id, line| text::push_vector(line, "vn", grid.direction(id)))?;
    write_lines(counts.triangles, out, |t, line| text::push_face(line, grid.triangle(t), first))?;
    Ok(counts.vertices)
}

/// The slab: its outline on the ground and `THICK` below, flat, with indices counted from the end.
fn write_slab(ground: f64, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "o slab\ng slab\nusemtl stone\ns off")?;
    let mut lines = Vec::new();
    for y in [ground, ground - THICK] {
        for [x, z] in OUTLINE {
            text::push_vector(&mut lines, "v", DVec3::new(x, y, z));
        }
    }
    out.write_all(&lines)?;
    // -2n..-n is the top, counterclockwise seen from above; -n.. is the bottom.
    let n = OUTLINE.len() as i64;
    let polygon = |corners: &mut dyn Iterator<Item = i64>| corners.fold("f".to_owned(), |f, c| format!("{f} {c}"));
    writeln!(out, "{}", polygon(&mut (-2 * n..-n)))?;
    writeln!(out, "{}", polygon(&mut (-n..0).rev()))?;
    for k in 0..n {
        let next = (k + 1) % n;
        writeln!(out, "{}", polygon(&mut [k - 2 * n, k - n, next - n, next - 2 * n].into_iter()))?;
    }
    Ok(())
}
