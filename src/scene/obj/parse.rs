//! Second pass: parses a piece of the file straight into its place in the result.

use super::cursor::{Cursor, Statement};
use super::fans::Continues;
use super::notes::{Kind, Notes};
use super::points::PointWriter;
use super::survey::Tally;
use super::{CornerData, excerpt};
use crate::math::Frame;
use glam::DVec3;

/// Largest coordinate taken: differences of such numbers are still finite.
pub(in crate::scene) const LARGEST: f64 = 1e300;

/// Why a piece could not be parsed.
#[derive(Debug)]
pub(super) enum Trouble {
    /// What is wrong with byte `at` of the piece.
    Text { at: usize, what: String },
    /// The piece does not hold what the first pass found in it.
    Changed,
}

/// The parts of the result that belong to one piece. What is not wanted is empty.
#[derive(Debug)]
pub(super) struct Target<'a> {
    pub(super) points: &'a mut [f32],
    pub(super) normals: &'a mut [f32],
    pub(super) uvs: &'a mut [f32],
    pub(super) faces: &'a mut [[u32; 3]],
    /// Per corner its normal's index less its vertex's, modulo 2^32: zeroes need no
    /// memory until they are written, and in many files nothing else ever is.
    pub(super) normal_of: &'a mut [[u32; 3]],
    /// Likewise for texture coordinates.
    pub(super) uv_of: &'a mut [[u32; 3]],
}

/// What holds for all pieces.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    pub(super) frame: Frame,
    pub(super) total: Tally,
    pub(super) normals: bool,
    pub(super) uv: bool,
}

impl Plan {
    /// Bytes of what the second pass fills.
    pub(super) fn bytes(&self) -> u64 {
        const TRIPLE: u64 = size_of::<[u32; 3]>() as u64;
        let Tally { vertices, textures, normals, triangles, .. } = self.total;
        let pair = TRIPLE / 3 * 2;
        let of_normals = if self.normals { TRIPLE * (normals + triangles) } else { 0 };
        let of_uv = if self.uv { pair * textures + TRIPLE * triangles } else { 0 };
        TRIPLE * (vertices + triangles) + of_normals + of_uv
    }
}

/// Whether corners have a value of a kind, and whether its index is their vertex's.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Usage {
    pub(super) any: bool,
    pub(super) own_index: bool,
}

/// What the second pass finds besides numbers.
#[derive(Debug, Default)]
pub(super) struct Parsed {
    /// Largest stored coordinate, before it was rounded to f32.
    pub(super) reach: f64,
    pub(super) continues: Continues,
    pub(super) normals: Usage,
    pub(super) uvs: Usage,
    pub(super) notes: Notes,
}

/// Parses `text`; `before` is what comes before it, `start` its place in the file.
pub(super) fn parse(
    text: &[u8],
    start: u64,
    before: Tally,
    plan: &Plan,
    target: Target<'_>,
) -> Result<Parsed, Trouble> {
    let points = PointWriter::new(&plan.frame, target.points);
    let mut p = Parser {
        plan,
        before,
        points,
        normals: target.normals.chunks_exact_mut(3),
        uvs: target.uvs.chunks_exact_mut(2),
        faces: target.faces,
        normal_of: target.normal_of,
        uv_of: target.uv_of,
        triangles: 0,
        found: Parsed::default(),
    };
    let mut c = Cursor::new(text);
    while !c.at_end() {
        match c.statement() {
            Statement::Vertex => p.vertex(&mut c, start)?,
            Statement::Face => p.face(&mut c)?,
            Statement::Normal => p.normal(&mut c)?,
            Statement::Texture => p.texture(&mut c)?,
            Statement::Blank | Statement::Other => {}
        }
        c.next_line();
    }
    p.finish()
}

/// Writes the points of `text` anew, in another frame. Returns the largest coordinate.
pub(super) fn parse_points(text: &[u8], frame: &Frame, points: &mut [f32]) -> Result<f64, Trouble> {
    each_point(text, PointWriter::new(frame, points))
}

/// Writes what rounding takes from the points of `text` in their frame.
pub(super) fn parse_rests(text: &[u8], frame: &Frame, rests: &mut [f32]) -> Result<(), Trouble> {
    each_point(text, PointWriter::of_rests(frame, rests)).map(|_| ())
}

fn each_point(text: &[u8], mut writer: PointWriter<'_>) -> Result<f64, Trouble> {
    let mut c = Cursor::new(text);
    while !c.at_end() {
        if c.statement() == Statement::Vertex {
            put_point(&mut writer, &mut c)?;
        }
        c.next_line();
    }
    writer.finish().ok_or(Trouble::Changed)
}

/// Reads a point and writes it.
#[inline]
fn put_point(writer: &mut PointWriter<'_>, c: &mut Cursor<'_>) -> Result<(), Trouble> {
    let world = DVec3::new(coordinate(c)?, coordinate(c)?, coordinate(c)?);
    writer.put(world).ok_or(Trouble::Changed)
}

struct Parser<'a> {
    plan: &'a Plan,
    /// What comes before the current line.
    before: Tally,
    points: PointWriter<'a>,
    normals: std::slice::ChunksExactMut<'a, f32>,
    uvs: std::slice::ChunksExactMut<'a, f32>,
    faces: &'a mut [[u32; 3]],
    normal_of: &'a mut [[u32; 3]],
    uv_of: &'a mut [[u32; 3]],
    /// Written so far.
    triangles: usize,
    found: Parsed,
}

/// Indices of a corner: its vertex's, and the others as differences to it.
#[derive(Clone, Copy, Debug, Default)]
struct Corner {
    vertex: u32,
    normal: u32,
    uv: u32,
}

impl Parser<'_> {
    #[inline]
    fn vertex(&mut self, c: &mut Cursor<'_>, start: u64) -> Result<(), Trouble> {
        put_point(&mut self.points, c)?;
        self.before.vertices += 1;
        if c.more() {
            // One more number is a weight, three are a colour.
            let offset = start + c.pos() as u64;
            if c.count_words() >= 3 {
                self.found.notes.add(Kind::VertexColor, offset, b"v");
            }
        }
        Ok(())
    }

    fn normal(&mut self, c: &mut Cursor<'_>) -> Result<(), Trouble> {
        self.before.normals += 1;
        if self.plan.normals {
            let n = unit(DVec3::new(coordinate(c)?, coordinate(c)?, coordinate(c)?));
            self.normals.next().ok_or(Trouble::Changed)?.copy_from_slice(&n.as_vec3().to_array());
        }
        Ok(())
    }

    fn texture(&mut self, c: &mut Cursor<'_>) -> Result<(), Trouble> {
        self.before.textures += 1;
        if self.plan.uv {
            let u = texture_coordinate(c)?;
            let v = if c.more() { texture_coordinate(c)? } else { 0.0 };
            self.uvs.next().ok_or(Trouble::Changed)?.copy_from_slice(&[u, v]);
        }
        Ok(())
    }

    /// A polygon becomes a fan around its first corner; the concave ones are split anew
    /// when all points are known.
    #[inline]
    fn face(&mut self, c: &mut Cursor<'_>) -> Result<(), Trouble> {
        let at = c.pos() - 1;
        let (mut first, mut last, mut corners) = (Corner::default(), Corner::default(), 0);
        while c.more() {
            let corner = self.corner(c)?;
            match corners {
                0 => first = corner,
                1 => {}
                _ => self.triangle([first, last, corner], corners > 2)?,
            }
            last = corner;
            corners += 1;
        }
        if corners == 0 {
            return Err(Trouble::Text { at, what: "a face without corners: three or more are needed".into() });
        }
        Ok(())
    }

    #[inline]
    fn triangle(&mut self, [a, b, c]: [Corner; 3], continues: bool) -> Result<(), Trouble> {
        let t = self.triangles;
        *self.faces.get_mut(t).ok_or(Trouble::Changed)? = [a.vertex, b.vertex, c.vertex];
        write_unless_zero(self.normal_of, t, [a.normal, b.normal, c.normal]);
        write_unless_zero(self.uv_of, t, [a.uv, b.uv, c.uv]);
        if continues {
            self.found.continues.set(t, self.faces.len());
        }
        self.triangles += 1;
        Ok(())
    }

    #[inline]
    fn corner(&mut self, c: &mut Cursor<'_>) -> Result<Corner, Trouble> {
        let at = c.pos();
        let vertex = index(c, "vertex", "v", self.before.vertices, self.plan.total.vertices)?;
        let (mut uv, mut normal) = (CornerData::NONE, CornerData::NONE);
        if c.take(b'/') {
            if !c.at_slash() && !c.word_ends() {
                uv = index(c, "texture", "vt", self.before.textures, self.plan.total.textures)?;
            }
            if c.take(b'/') && !c.word_ends() {
                normal = index(c, "normal", "vn", self.before.normals, self.plan.total.normals)?;
            }
        }
        if !c.word_ends() {
            return Err(not_a_corner(c, at));
        }
        let against_vertex = |index: u32, usage: &mut Usage| {
            let difference = index.wrapping_sub(vertex);
            usage.any |= index != CornerData::NONE;
            usage.own_index |= difference != 0;
            difference
        };
        let normal = against_vertex(normal, &mut self.found.normals);
        let uv = against_vertex(uv, &mut self.found.uvs);
        Ok(Corner { vertex, normal, uv })
    }

    fn finish(mut self) -> Result<Parsed, Trouble> {
        self.found.reach = self.points.finish().ok_or(Trouble::Changed)?;
        let complete = self.triangles == self.faces.len() && self.normals.len() == 0 && self.uvs.len() == 0;
        if complete { Ok(self.found) } else { Err(Trouble::Changed) }
    }
}

/// Writes to slot `t` of an index array, which has none if it is not wanted.
#[inline]
fn write_unless_zero(slots: &mut [[u32; 3]], t: usize, value: [u32; 3]) {
    if value != [0; 3]
        && let Some(slot) = slots.get_mut(t)
    {
        *slot = value;
    }
}

/// `n` with length one; zero stays zero.
pub(in crate::scene) fn unit(n: DVec3) -> DVec3 {
    let squared = n.length_squared();
    if (1e-200..1e200).contains(&squared) {
        return n / squared.sqrt();
    }
    let largest = n.abs().max_element();
    if largest == 0.0 { DVec3::ZERO } else { (n / largest).normalize() }
}

#[inline]
fn coordinate(c: &mut Cursor<'_>) -> Result<f64, Trouble> {
    c.more();
    let before = *c;
    match c.number() {
        Some(x) if x.abs() <= LARGEST && c.word_ends() => Ok(x),
        _ => Err(not_a_number(&before)),
    }
}

fn texture_coordinate(c: &mut Cursor<'_>) -> Result<f32, Trouble> {
    c.more();
    let before = *c;
    let x = coordinate(c)? as f32;
    if x.is_finite() { Ok(x) } else { Err(not_a_number(&before)) }
}

/// Reads an index and resolves it: `seen` of `total` come before it.
#[inline]
fn index(c: &mut Cursor<'_>, what: &str, keyword: &str, seen: u64, total: u64) -> Result<u32, Trouble> {
    let before = *c;
    let Some(i) = c.integer() else { return Err(not_a_corner(&before, before.pos())) };
    let resolved = if i > 0 { i - 1 } else { seen as i64 + i };
    if i != 0 && (0..total as i64).contains(&resolved) {
        return Ok(resolved as u32);
    }
    Err(bad_index(&before, i, what, keyword, seen, total))
}

#[cold]
fn bad_index(before: &Cursor<'_>, i: i64, what: &str, keyword: &str, seen: u64, total: u64) -> Trouble {
    let written = before.word();
    let written = excerpt(&written[..written.iter().position(|&c| c == b'/').unwrap_or(written.len())]);
    let what = match i {
        0 => format!("{what} index 0: indices count from 1, or back from -1"),
        1.. => format!("{what} index {written} does not exist: the file has {total} '{keyword}' lines"),
        _ => format!("{what} index {written} does not exist: {seen} '{keyword}' lines come before this one"),
    };
    Trouble::Text { at: before.pos(), what }
}

#[cold]
fn not_a_corner(c: &Cursor<'_>, at: usize) -> Trouble {
    let rest = excerpt(c.word());
    let what = format!("cannot read a corner at '{rest}': expected v, v/vt, v//vn or v/vt/vn");
    Trouble::Text { at, what }
}

#[cold]
fn not_a_number(before: &Cursor<'_>) -> Trouble {
    let (mut c, word) = (*before, excerpt(before.word()));
    let ended = !before.clone().more();
    let what = match c.number() {
        _ if ended => "the line ends where a number should be".into(),
        Some(x) if x.is_finite() && x.abs() > LARGEST => format!("'{word}' is beyond the largest coordinate, 1e300"),
        Some(x) if !x.is_finite() && c.word_ends() => format!("'{word}' is not a finite number"),
        Some(x) if x.is_finite() && c.word_ends() => format!("'{word}' is too large for a texture coordinate"),
        _ => format!("'{word}' is not a number"),
    };
    Trouble::Text { at: before.pos(), what }
}
