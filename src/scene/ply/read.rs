//! Puts the elements together.

use super::super::obj::points::{PointWriter, settle_frame};
use super::super::obj::{self, CornerData, Counts, MtlMaterial, ObjFile, ReadOptions, fans};
use super::super::parallel::cut;
use super::super::source::Source;
use super::super::{Error, Warning};
use super::ascii::{self, Rows};
use super::binary::{self, Even};
use super::faces::{FaceWriter, Found, Tally};
use super::file::{File, Located, Part, Stop, Trouble};
use super::header::{Element, Encoding, Header};
use super::layout::{self, Layout, NORMAL, UV, Values};
use super::vertices::{self, Target, VertexWriter};
use crate::math::Frame;
use glam::DVec3;
use rayon::prelude::*;
use tison_pages::zeroes;

/// Reads `source` in parts of about `piece` bytes.
pub(super) fn read(source: &Source, options: &ReadOptions<'_>, piece: u64) -> Result<ObjFile, Error> {
    let header = Header::read(source)?;
    let (vertex, face) = elements(&header, source)?;
    let vertex = Layout::of_vertices(vertex, source, options)?;
    let face = Layout::of_faces(face, source)?;
    let file = File::new(source, options, &header, piece);
    let mut reader = Reader { body: Body::of(&file)?, file: &file, vertices: &vertex, faces: &face };

    let (mut points, mut polygons) = (None, None);
    let mut at = header.length;
    for (number, element) in header.elements.iter().enumerate() {
        if element.name == vertex.element.name {
            let located = reader.body.locate(&file, &vertex, number, at)?;
            at = located.end;
            points = Some(reader.read_vertices(located.parts)?);
        } else if element.name == face.element.name {
            let read = reader.read_faces(number, at)?;
            at = read.end;
            polygons = Some(read);
        } else if points.is_none() || polygons.is_none() {
            at = reader.body.skip(&file, element, at)?;
        }
    }
    let both = "the header has both elements";
    reader.finish(points.expect(both), polygons.expect(both), at)
}

/// The elements that are read; an error if there is nothing to see in them.
fn elements<'a>(header: &'a Header, source: &Source) -> Result<(&'a Element, &'a Element), Error> {
    let path = || source.path.clone();
    let nothing = |why: String| Err(Error::NoFaces { path: path(), why });
    let Some(vertex) = header.element("vertex") else {
        return nothing("it has no element 'vertex'".into());
    };
    let face = header.element("face").filter(|face| face.count > 0);
    let Some(face) = face else {
        return nothing(if header.element("tristrips").is_some() {
            "it has triangle strips ('tristrips') only, which are not read: convert it to faces".into()
        } else {
            format!("it has {} vertices and no face: it is a cloud of points, which are not rendered", vertex.count)
        });
    };
    obj::check_count(source, "vertices", vertex.count)?;
    Ok((vertex, face))
}

/// How things are found and read.
enum Body {
    Text(Rows),
    Binary { big: bool },
}

impl Body {
    fn of(file: &File<'_>) -> Result<Self, Error> {
        Ok(match file.header.encoding {
            Encoding::Ascii => Self::Text(Rows::count(file)?),
            encoding => Self::Binary { big: encoding == Encoding::Big },
        })
    }

    /// Where element `number`, which begins at byte `start` of a binary file, is.
    fn locate(&self, file: &File<'_>, layout: &Layout<'_>, number: usize, start: u64) -> Result<Located, Error> {
        match *self {
            Self::Text(ref rows) => rows.locate(file, number),
            Self::Binary { big } => binary::locate(file, layout, big, start),
        }
    }

    /// The byte behind an element that begins at `start`; rows of text are counted already.
    fn skip(&self, file: &File<'_>, element: &Element, start: u64) -> Result<u64, Error> {
        match *self {
            Self::Text(_) => Ok(start),
            Self::Binary { big } => Ok(binary::locate(file, &Layout::passed(element), big, start)?.end),
        }
    }

    /// Hands every vertex of a part to `take` whose number is a multiple of `every`.
    fn vertices(
        &self,
        layout: &Layout<'_>,
        part: &Part,
        bytes: &[u8],
        every: u64,
        take: impl FnMut(u64, usize, &Values) -> Result<(), Trouble>,
    ) -> Result<Tally, Trouble> {
        match *self {
            Self::Text(_) => ascii::vertices(layout, part, bytes, every, take),
            Self::Binary { big } => binary::vertices(layout, big, part, bytes, every, take).map(|()| Tally::default()),
        }
    }
}

struct Reader<'a> {
    file: &'a File<'a>,
    body: Body,
    vertices: &'a Layout<'a>,
    faces: &'a Layout<'a>,
}

/// The vertices of a file.
struct Vertices {
    parts: Vec<Part>,
    /// What a sample of them led to.
    frame: Frame,
    points: Vec<f32>,
    normals: Vec<f32>,
    uvs: Vec<f32>,
    /// The largest coordinate.
    reach: f64,
    long: Tally,
}

/// The faces of a file.
struct Faces {
    parts: Vec<Part>,
    /// The byte behind them.
    end: u64,
    faces: Vec<[u32; 3]>,
    found: Vec<Found>,
}

impl Reader<'_> {
    fn read_vertices(&self, parts: Vec<Part>) -> Result<Vertices, Error> {
        let layout = self.vertices;
        let frame = Frame::fit(&self.sample(&parts)?);
        let count = layout.element.count as usize;
        self.check_memory(layout)?;
        let room = |first, components| zeroes(if layout.has(first) { components * count } else { 0 });
        let (mut points, mut normals, mut uvs) = (zeroes(3 * count + 1), room(NORMAL, 3), room(UV, 2));
        let targets = targets(&parts, &mut points, &mut normals, &mut uvs);
        let read = self.file.each_as_found(layout.element, &parts, targets, |part, target, bytes| {
            let mut writer = VertexWriter::new(layout, &frame, target);
            let long = self.body.vertices(layout, part, bytes, 1, |item, at, values| writer.put(item, at, values))?;
            self.file.gone_over(part.bytes.end - part.bytes.start);
            Ok((writer.finish()?, long))
        })?;
        let reach = read.iter().map(|r| r.0).fold(0.0, f64::max);
        let tallies = parts.iter().zip(read).map(|(part, (_, long))| (part, long));
        let long = sum(tallies);
        Ok(Vertices { frame, points, normals, uvs, reach, long, parts })
    }

    /// Refuses a file whose vertices and faces do not fit into memory.
    fn check_memory(&self, layout: &Layout<'_>) -> Result<(), Error> {
        /// A count of one byte and three numbers of one byte: a header cannot promise more faces than that.
        const SMALLEST_FACE: u64 = 4;
        let File { source, options, .. } = self.file;
        let numbers = 3 + [(NORMAL, 3), (UV, 2)].iter().map(|&(v, n)| if layout.has(v) { n } else { 0 }).sum::<u64>();
        let rests = if options.rests { 3 } else { 0 };
        let of_vertices = layout.element.count * 4 * (numbers + rests);
        // Most files have no polygons with less than three corners.
        let faces = self.faces.element.count.min(source.len / SMALLEST_FACE);
        options.free_memory.check_mesh(&source.path, faces, of_vertices + 12 * faces)
    }

    /// Some vertices, evenly spread over all.
    fn sample(&self, parts: &[Part]) -> Result<Vec<DVec3>, Error> {
        const MOST: u64 = 4096;
        let layout = self.vertices;
        let every = layout.element.count.div_ceil(MOST).max(1);
        let few = self.few(parts, every);
        let parts = few.as_deref().unwrap_or(parts);
        let found = self.file.each_as_found(layout.element, parts, vec![(); parts.len()], |part, (), bytes| {
            let mut places = Vec::new();
            let take = |_, _, values: &Values| {
                places.extend(vertices::place(values));
                Ok(())
            };
            // What is wrong is told when all are read.
            match self.body.vertices(layout, part, bytes, every, take) {
                Err(Trouble::Item { .. }) | Ok(_) => Ok(places),
                Err(other) => Err(other),
            }
        })?;
        Ok(found.into_iter().flatten().collect())
    }

    /// Parts with nothing in them but every so many vertices, where those are far apart and can be found.
    fn few(&self, parts: &[Part], every: u64) -> Option<Vec<Part>> {
        const FAR: u64 = 1 << 9;
        let element = self.vertices.element;
        let size =
            element.fixed_size().filter(|size| size * every >= FAR && matches!(self.body, Body::Binary { .. }))?;
        let start = parts.first()?.bytes.start;
        let one = |i: u64| Part { items: i..i + 1, bytes: start + i * size..start + (i + 1) * size, triangles: 0 };
        Some((0..element.count).step_by(every as usize).map(one).collect())
    }

    fn read_faces(&mut self, number: usize, start: u64) -> Result<Faces, Error> {
        let (file, layout) = (self.file, self.faces);
        if let Body::Binary { big } = self.body
            && let Some(even) = Even::of(file, layout, big, start)?
        {
            let read = self.fill_faces(&even.located.parts, |part, bytes, writer| even.read(part, bytes, writer));
            match read {
                Ok((faces, found)) => {
                    return Ok(Faces { parts: even.located.parts, end: even.located.end, faces, found });
                }
                Err(Stop::Error(e)) => return Err(e),
                Err(Stop::Uneven) => {}
            }
        }
        let Located { mut parts, end } = self.body.locate(file, layout, number, start)?;
        if let Body::Text(_) = self.body {
            let count = |part: &Part, (), text: &[u8]| ascii::count_triangles(layout, part, text);
            let counts = file.each_as_found(layout.element, &parts, vec![(); parts.len()], count)?;
            parts.iter_mut().zip(counts).for_each(|(part, count)| part.triangles = count);
        }
        let read = self.fill_faces(&parts, |part, bytes, writer| match self.body {
            Body::Text(_) => ascii::faces(layout, part, bytes, writer),
            Body::Binary { big } => binary::faces(layout, big, part, bytes, writer),
        });
        let (faces, found) = read.map_err(|stop| file.stopped(stop))?;
        Ok(Faces { parts, end, faces, found })
    }

    /// The triangles of all parts, read by `read`.
    fn fill_faces(
        &self,
        parts: &[Part],
        read: impl Fn(&Part, &[u8], FaceWriter<'_>) -> Result<Found, Trouble> + Sync,
    ) -> Result<(Vec<[u32; 3]>, Vec<Found>), Stop> {
        let count = parts.iter().map(|p| p.triangles).sum();
        obj::check_count(self.file.source, "triangles", count).map_err(Stop::Error)?;
        let File { source, options, .. } = self.file;
        options.free_memory.check_mesh(&source.path, count, 12 * count).map_err(Stop::Error)?;
        let mut faces = zeroes(count as usize);
        let targets = cut(&mut faces, parts.iter().map(|p| p.triangles as usize));
        let vertices = self.vertices.element.count;
        let found = self.file.each(self.faces.element, parts, targets, |part, faces, bytes| {
            let found = read(part, bytes, FaceWriter::new(faces, vertices))?;
            self.file.gone_over(part.bytes.end - part.bytes.start);
            Ok(found)
        })?;
        Ok((faces, found))
    }

    fn finish(&self, mut v: Vertices, mut f: Faces, end: u64) -> Result<ObjFile, Error> {
        let options = self.file.options;
        if f.faces.is_empty() {
            let why = "no face has three corners".into();
            return Err(Error::NoFaces { path: self.file.source.path.clone(), why });
        }
        let frame = settle_frame(&mut v.points, &f.faces, v.frame, v.reach, |frame, points| {
            let targets = targets(&v.parts, points, &mut [], &mut []);
            self.rewrite(&v.parts, targets, |target| VertexWriter::new(self.vertices, frame, target))
        })?;
        let rests = if options.rests { Some(self.rests(&v, &frame)?) } else { None };
        let parts = cut(&mut f.faces, f.parts.iter().map(|p| p.triangles as usize));
        let split = |(part, found): (&mut [[u32; 3]], &Found)| {
            fans::split(&v.points, part, [&mut [], &mut []], &found.continues)
        };
        let clipped = parts.into_par_iter().zip(&f.found).map(split).sum();
        let short = sum(f.parts.iter().zip(&f.found).map(|(part, found)| (part, found.short)));
        let long = sum(f.parts.iter().zip(&f.found).map(|(part, found)| (part, found.long)));
        let counts = Counts {
            vertices: self.vertices.element.count,
            textures: v.uvs.len() as u64 / 2,
            normals: v.normals.len() as u64 / 3,
            polygons: self.faces.element.count,
            triangles: f.faces.len() as u64,
            clipped,
            short_faces: short.count,
            ..Counts::default()
        };
        let of_corners = |values: Vec<f32>| (!values.is_empty()).then_some(CornerData { values, indices: None });
        Ok(ObjFile {
            warnings: self.warnings(short, v.long, long, end)?,
            frame,
            points: v.points,
            rests,
            faces: f.faces,
            normals: of_corners(v.normals),
            uvs: of_corners(v.uvs),
            face_materials: None,
            materials: if options.materials { vec![MtlMaterial::default()] } else { Vec::new() },
            counts,
        })
    }

    /// Reads the places of all vertices again, for something else; returns the largest coordinate.
    fn rewrite<'t, T: Send>(
        &self,
        parts: &[Part],
        targets: Vec<T>,
        writer: impl Fn(T) -> VertexWriter<'t> + Sync,
    ) -> Result<f64, Error> {
        let layout = self.vertices;
        let all = self.file.each_as_found(layout.element, parts, targets, |part, target, bytes| {
            let mut writer = writer(target);
            self.body.vertices(layout, part, bytes, 1, |item, at, values| writer.put(item, at, values))?;
            writer.finish()
        })?;
        Ok(all.into_iter().fold(0.0, f64::max))
    }

    /// What rounding took from the points.
    fn rests(&self, v: &Vertices, frame: &Frame) -> Result<Vec<f32>, Error> {
        let mut rests = vec![0.0; v.points.len() - 1];
        let targets = targets(&v.parts, &mut rests, &mut [], &mut []);
        self.rewrite(&v.parts, targets, |t| VertexWriter::of(self.vertices, PointWriter::of_rests(frame, t.points)))?;
        Ok(rests)
    }

    fn warnings(&self, short: Tally, vertices: Tally, faces: Tally, end: u64) -> Result<Vec<Warning>, Error> {
        let source = self.file.source;
        let mut warnings = Vec::new();
        if let Some(line) = layout::colour_line(self.file.header) {
            warnings.push(Warning::at(&source.path, line, "colours of vertices are not used".into()));
        }
        for (element, tally, what) in [
            (self.vertices.element, vertices, "there is more on its line than the header says: passed over"),
            (self.faces.element, faces, "there is more on its line than the header says: passed over"),
            (self.faces.element, short, "a face needs at least three corners: skipped"),
        ] {
            let Some((item, offset)) = tally.first else { continue };
            let what = obj::with_more(format!("{} {item}: {what}", element.name), tally.count);
            let text = self.file.header.encoding == Encoding::Ascii;
            let line = if text { Some(source.line_and_column(offset)?.0) } else { None };
            warnings.push(Warning { path: source.path.clone(), line, what });
        }
        let last = |e: &&Element| ["vertex", "face"].contains(&&*e.name);
        let behind = match &self.body {
            Body::Text(rows) => (rows.behind(self.file), "lines"),
            // What comes behind the last element that is read was not looked for.
            Body::Binary { .. } if self.file.header.elements.last().filter(last).is_none() => (0, ""),
            Body::Binary { .. } => (source.len - end, "bytes"),
        };
        if let (more @ 1.., what) = behind {
            warnings.push(Warning::about(&source.path, format!("{more} {what} behind the last element are not read")));
        }
        Ok(warnings)
    }
}

/// Each part's share of everything; what is empty is not wanted.
fn targets<'a>(parts: &[Part], points: &'a mut [f32], normals: &'a mut [f32], uvs: &'a mut [f32]) -> Vec<Target<'a>> {
    fn shares<'a>(all: &'a mut [f32], parts: &[Part], components: u64) -> std::vec::IntoIter<&'a mut [f32]> {
        let wanted = !all.is_empty();
        let length = |p: &Part| if wanted { components * (p.items.end - p.items.start) } else { 0 };
        cut(all, parts.iter().map(|p| length(p) as usize)).into_iter()
    }
    let shares = shares(points, parts, 3).zip(shares(normals, parts, 3)).zip(shares(uvs, parts, 2));
    shares.map(|((points, normals), uvs)| Target { points, normals, uvs }).collect()
}

/// What all parts found.
fn sum<'a>(tallies: impl Iterator<Item = (&'a Part, Tally)>) -> Tally {
    tallies.fold(Tally::default(), |sum, (part, tally)| sum.and(tally, part.bytes.start))
}
