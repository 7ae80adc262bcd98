//! Faces on their way into a mesh: polygons become fans of triangles.

use super::super::obj::fans::Continues;
use super::file::Trouble;

/// What is found in the faces of a part besides corners.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub(super) continues: Continues,
    /// Faces with fewer than three corners.
    pub(super) short: Tally,
    /// Lines with more on them than the header says.
    pub(super) long: Tally,
}

/// How often something was found.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    pub(super) count: u64,
    /// The first of them: its number and the byte of its part, or later of the file, where it is.
    pub(super) first: Option<(u64, u64)>,
}

impl Tally {
    #[cold]
    pub(super) fn add(&mut self, item: u64, at: usize) {
        self.count += 1;
        self.first.get_or_insert((item, at as u64));
    }

    /// With those of a later part, which begins at byte `start`.
    pub(super) fn and(self, later: Self, start: u64) -> Self {
        let first = later.first.map(|(item, at)| (item, start + at));
        Self { count: self.count + later.count, first: self.first.or(first) }
    }
}

/// Checks faces and writes their triangles.
pub(super) struct FaceWriter<'a> {
    faces: &'a mut [[u32; 3]],
    /// Vertices that there are.
    vertices: u64,
    triangles: usize,
    found: Found,
    /// The corners of the face so far, the first and the last of them.
    corners: usize,
    first: u32,
    last: u32,
}

impl<'a> FaceWriter<'a> {
    /// Writes to `faces`, which have room for exactly what comes.
    pub(super) fn new(faces: &'a mut [[u32; 3]], vertices: u64) -> Self {
        Self { faces, vertices, triangles: 0, found: Found::default(), corners: 0, first: 0, last: 0 }
    }

    /// The vertex that `index` means; where it is, for the error that there is none.
    #[inline]
    pub(super) fn vertex(&self, index: i64, item: u64, at: usize) -> Result<u32, Trouble> {
        // A negative one becomes larger than any count.
        if (index as u64) < self.vertices { Ok(index as u32) } else { Err(self.no_such(index, item, at)) }
    }

    #[cold]
    fn no_such(&self, index: i64, item: u64, at: usize) -> Trouble {
        let what = match index {
            ..0 => format!("vertex index {index}: indices count from 0"),
            _ => format!("vertex index {index} does not exist: the file has {} vertices", self.vertices),
        };
        Trouble::Item { item, at, what }
    }

    /// Writes a face that is a triangle.
    #[inline]
    pub(super) fn triangle(&mut self, corners: [u32; 3]) -> Result<(), Trouble> {
        *self.faces.get_mut(self.triangles).ok_or(Trouble::Changed)? = corners;
        self.triangles += 1;
        Ok(())
    }

    /// Takes the next corner of a face.
    #[inline]
    pub(super) fn corner(&mut self, vertex: u32) -> Result<(), Trouble> {
        match self.corners {
            0 => self.first = vertex,
            1 => {}
            more => {
                self.triangle([self.first, self.last, vertex])?;
                if more > 2 {
                    self.found.continues.set(self.triangles - 1, self.faces.len());
                }
            }
        }
        self.last = vertex;
        self.corners += 1;
        Ok(())
    }

    /// Ends the face: number `item`, at byte `at` of its part.
    #[inline]
    pub(super) fn end(&mut self, item: u64, at: usize) {
        if self.corners < 3 {
            self.found.short.add(item, at);
        }
        self.corners = 0;
    }

    /// Notes that there is more on the line of a face than there should be.
    pub(super) fn too_long(&mut self, item: u64, at: usize) {
        self.found.long.add(item, at);
    }

    pub(super) fn finish(self) -> Result<Found, Trouble> {
        if self.triangles == self.faces.len() { Ok(self.found) } else { Err(Trouble::Changed) }
    }
}

/// Triangles that a polygon with so many corners makes.
#[inline]
pub(super) fn triangles(corners: u64) -> u64 {
    corners.saturating_sub(2)
}
