//! Elements of binary files: where they are, and what is in them.
//!
//! An element without lists has its things at equal distances, and so have faces whose lists all have the lengths
//! that those of the first have: this is assumed, and found out while they are read ([`Even`]). Elsewhere one
//! thread goes from list to list first, to find places where the others can begin.

use super::super::Error;
use super::faces::{FaceWriter, Found, triangles};
use super::file::{File, Located, Part, Trouble};
use super::header::{Element, Kind};
use super::layout::{Layout, Role, Values};
use super::number::Type;

/// Where the things of an element are that begins at byte `start`.
pub(super) fn locate(file: &File<'_>, layout: &Layout<'_>, big: bool, start: u64) -> Result<Located, Error> {
    match layout.element.fixed_size() {
        Some(size) => Ok(spaced(file, layout.element, size, start, 0)),
        None => Walker { file, layout, big, window: Vec::new(), from: 0 }.walk(start),
    }
}

/// The parts of an element whose things have `size` bytes each, and make so many triangles.
fn spaced(file: &File<'_>, element: &Element, size: u64, start: u64, triangles: u64) -> Located {
    if size == 0 {
        return Located { parts: Vec::new(), end: start };
    }
    let (count, each) = (element.count, (file.piece / size).max(1));
    let part = |i: u64| {
        let items = i * each..((i + 1) * each).min(count);
        let bytes = start + items.start * size..start + items.end * size;
        Part { triangles: (items.end - items.start) * triangles, items, bytes }
    };
    Located { parts: (0..count.div_ceil(each)).map(part).collect(), end: start + count * size }
}

/// Goes from list to list.
struct Walker<'a, 'f> {
    file: &'a File<'f>,
    layout: &'a Layout<'a>,
    big: bool,
    /// Some bytes of the file.
    window: Vec<u8>,
    /// Where they begin.
    from: u64,
}

impl Walker<'_, '_> {
    fn walk(&mut self, start: u64) -> Result<Located, Error> {
        let (mut parts, mut at) = (Vec::new(), start);
        let mut part = Part { items: 0..0, bytes: start..start, triangles: 0 };
        for item in 0..self.layout.element.count {
            for (property, role) in self.layout.steps() {
                let here = at;
                at = match property.kind {
                    Kind::One(t) => Some(at + t.size() as u64),
                    Kind::List { length, item: of } => {
                        let count = self.list_length(at, length, item)?;
                        if role == Role::Corners {
                            part.triangles += triangles(count);
                        }
                        count
                            .checked_mul(of.size() as u64)
                            .and_then(|list| (at + length.size() as u64).checked_add(list))
                    }
                }
                .filter(|&end| end <= self.file.source.len)
                .ok_or_else(|| self.cut_off(item, here))?;
            }
            (part.items.end, part.bytes.end) = (item + 1, at);
            if at - part.bytes.start >= self.file.piece {
                let next = Part { items: item + 1..item + 1, bytes: at..at, triangles: 0 };
                parts.push(std::mem::replace(&mut part, next));
            }
        }
        if !part.items.is_empty() {
            parts.push(part);
        }
        Ok(Located { parts, end: at })
    }

    /// The length of a list of thing `item`, which is at byte `at` of the file.
    fn list_length(&mut self, at: u64, length: Type, item: u64) -> Result<u64, Error> {
        const WINDOW: u64 = 1 << 18;
        let (size, len) = (length.size() as u64, self.file.source.len);
        if at + size > len {
            return Err(self.cut_off(item, at));
        }
        if at < self.from || at + size > self.from + self.window.len() as u64 {
            self.file.check_cancelled()?;
            self.file.source.bytes(at..len.min(at + WINDOW), &mut self.window)?;
            self.from = at;
        }
        let count = length.whole(self.big, &self.window[(at - self.from) as usize..]);
        u64::try_from(count)
            .map_err(|_| self.file.wrong(self.layout.element, item, at, &format!("a list cannot have {count} numbers")))
    }

    fn cut_off(&self, item: u64, at: u64) -> Error {
        let what = format!(
            "the file ends within it, and there should be {}: it is cut off, or the length of a list is wrong",
            self.layout.element.count
        );
        self.file.wrong(self.layout.element, item, at, &what)
    }
}

/// Faces at equal distances: what the first one has all have.
#[derive(Debug)]
pub(super) struct Even {
    pub(super) located: Located,
    big: bool,
    /// Bytes of a face.
    size: usize,
    /// Lists: where the length is within the face, its type, and what it is.
    lists: Vec<(usize, Type, i64)>,
    /// Where the corners are, their type and their number.
    corners: (usize, Type, usize),
}

impl Even {
    /// Takes all faces to be like the first, if the file is long enough for that.
    pub(super) fn of(file: &File<'_>, layout: &Layout<'_>, big: bool, start: u64) -> Result<Option<Self>, Error> {
        let mut walker = Walker { file, layout, big, window: Vec::new(), from: 0 };
        let (mut at, mut lists, mut corners) = (start, Vec::new(), None);
        for (property, role) in layout.steps() {
            let Kind::List { length, item } = property.kind else {
                at += property.kind.least_size() as u64;
                continue;
            };
            let count = walker.list_length(at, length, 0)?;
            lists.push(((at - start) as usize, length, count as i64));
            at += length.size() as u64;
            if role == Role::Corners {
                corners = Some(((at - start) as usize, item, count as usize));
            }
            let end = count.checked_mul(item.size() as u64).and_then(|list| at.checked_add(list));
            match end.filter(|&end| end <= file.source.len) {
                Some(end) => at = end,
                None => return Ok(None),
            }
        }
        let (size, count) = (at - start, layout.element.count);
        let fits = size.checked_mul(count).is_some_and(|bytes| bytes <= file.source.len - start);
        let Some(corners) = corners.filter(|_| fits) else { return Ok(None) };
        let located = spaced(file, layout.element, size, start, triangles(corners.2 as u64));
        Ok(Some(Self { located, big, size: size as usize, lists, corners }))
    }

    /// Reads a part.
    pub(super) fn read(&self, part: &Part, bytes: &[u8], mut writer: FaceWriter<'_>) -> Result<Found, Trouble> {
        let (first, of, corners) = self.corners;
        let step = of.size();
        for ((item, face), at) in part.items.clone().zip(bytes.chunks_exact(self.size)).zip((0..).step_by(self.size)) {
            if self.lists.iter().any(|&(at, length, count)| length.whole(self.big, &face[at..]) != count) {
                return Err(Trouble::Uneven);
            }
            let index = |k: usize| (first + k * step, of.whole(self.big, &face[first + k * step..]));
            if corners == 3 {
                let corner = |k| {
                    let (offset, index) = index(k);
                    writer.vertex(index, item, at + offset)
                };
                let face = [corner(0)?, corner(1)?, corner(2)?];
                writer.triangle(face)?;
                continue;
            }
            for k in 0..corners {
                let (offset, index) = index(k);
                writer.corner(writer.vertex(index, item, at + offset)?)?;
            }
            writer.end(item, at);
        }
        writer.finish()
    }
}

/// Reads faces with lists of any lengths.
pub(super) fn faces(
    layout: &Layout<'_>,
    big: bool,
    part: &Part,
    bytes: &[u8],
    mut writer: FaceWriter<'_>,
) -> Result<Found, Trouble> {
    let mut at = 0;
    for item in part.items.clone() {
        let start = at;
        for (property, role) in layout.steps() {
            let Kind::List { length, item: of } = property.kind else {
                at += property.kind.least_size();
                continue;
            };
            let (from, to) = list(bytes, at, big, length, of)?;
            at = to;
            if role == Role::Corners {
                for k in (from..to).step_by(of.size()) {
                    let vertex = writer.vertex(of.whole(big, &bytes[k..]), item, k)?;
                    writer.corner(vertex)?;
                }
            }
        }
        writer.end(item, start);
    }
    if at == bytes.len() { writer.finish() } else { Err(Trouble::Changed) }
}

/// Where the numbers of a list begin and end whose length is at `at`.
fn list(bytes: &[u8], at: usize, big: bool, length: Type, of: Type) -> Result<(usize, usize), Trouble> {
    let from = at + length.size();
    let count = bytes.get(at..from).map(|bytes| length.whole(big, bytes)).ok_or(Trouble::Changed)?;
    let size = usize::try_from(count).ok().and_then(|count| count.checked_mul(of.size()));
    let to = size.and_then(|size| from.checked_add(size)).filter(|&to| to <= bytes.len());
    Ok((from, to.ok_or(Trouble::Changed)?))
}

/// Hands every vertex of a part to `take` whose number is a multiple of `every`: number, byte of the part, values.
pub(super) fn vertices(
    layout: &Layout<'_>,
    big: bool,
    part: &Part,
    bytes: &[u8],
    every: u64,
    mut take: impl FnMut(u64, usize, &Values) -> Result<(), Trouble>,
) -> Result<(), Trouble> {
    let Some(size) = layout.element.fixed_size() else {
        return vertices_with_lists(layout, big, part, bytes, every, take);
    };
    let (mut fields, mut at) = (Vec::new(), 0);
    for (property, role) in layout.steps() {
        if let (Kind::One(t), Role::Value(slot)) = (property.kind, role) {
            fields.push((at, t, slot));
        }
        at += property.kind.least_size();
    }
    let mut values = Values::default();
    for ((item, row), at) in part.items.clone().zip(bytes.chunks_exact(at)).zip((0..).step_by(size as usize)) {
        if item % every == 0 {
            for &(at, t, slot) in &fields {
                values[slot] = t.number(big, &row[at..]);
            }
            take(item, at, &values)?;
        }
    }
    Ok(())
}

fn vertices_with_lists(
    layout: &Layout<'_>,
    big: bool,
    part: &Part,
    bytes: &[u8],
    every: u64,
    mut take: impl FnMut(u64, usize, &Values) -> Result<(), Trouble>,
) -> Result<(), Trouble> {
    let (mut at, mut values) = (0, Values::default());
    for item in part.items.clone() {
        let start = at;
        for (property, role) in layout.steps() {
            match property.kind {
                Kind::One(t) => {
                    if let Role::Value(slot) = role {
                        values[slot] = t.number(big, bytes.get(at..at + t.size()).ok_or(Trouble::Changed)?);
                    }
                    at += t.size();
                }
                Kind::List { length, item: of } => (_, at) = list(bytes, at, big, length, of)?,
            }
        }
        if item % every == 0 {
            take(item, start, &values)?;
        }
    }
    Ok(())
}
