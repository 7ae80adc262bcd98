//! Elements of text files: where they are, and what is in them. Each thing has a line of its own.

use super::super::Error;
use super::super::obj::cursor::Cursor;
use super::super::obj::excerpt;
use super::super::parallel::in_order;
use super::faces::{FaceWriter, Found, Tally, triangles};
use super::file::{File, Located, Part, Trouble};
use super::header::{Kind, Property};
use super::layout::{Layout, Role, Values};
use std::ops::Range;

/// The text behind the header: pieces that end at line ends, and how many rows come before each of them. A row is a
/// line that is not blank.
#[derive(Debug)]
pub(super) struct Rows {
    pieces: Vec<Range<u64>>,
    /// One more than there are pieces.
    before: Vec<u64>,
}

impl Rows {
    /// Finds them.
    pub(super) fn count(file: &File<'_>) -> Result<Self, Error> {
        let pieces = file.source.pieces(file.header.length..file.source.len, file.piece)?;
        let count = |_, piece: Range<u64>, buf: &mut Vec<u8>| {
            file.check_cancelled()?;
            file.source.bytes(piece.clone(), buf)?;
            file.gone_over(piece.end - piece.start);
            let (mut c, mut rows) = (Cursor::new(buf), 0);
            while !c.at_end() {
                rows += u64::from(c.more());
                c.next_line();
            }
            Ok::<u64, Error>(rows)
        };
        let counts = in_order(pieces.clone(), count)?;
        let mut before = vec![0];
        before.extend(counts.iter().scan(0, |sum, n| {
            *sum += n;
            Some(*sum)
        }));
        Ok(Self { pieces, before })
    }

    /// How many there are.
    fn all(&self) -> u64 {
        self.before.last().copied().unwrap_or(0)
    }

    /// Where element number `number` is.
    pub(super) fn locate(&self, file: &File<'_>, number: usize) -> Result<Located, Error> {
        let (before, element) = (&file.header.elements[..number], &file.header.elements[number]);
        // What has no properties has no lines.
        let rows = before.iter().filter(|e| !e.properties.is_empty()).map(|e| e.count).sum::<u64>();
        let rows = rows..rows + element.count;
        if rows.end > self.all() {
            let what = format!(
                "the file ends after {} of {} of element '{}', each of which needs a line of its own: is it cut off?",
                self.all().saturating_sub(rows.start),
                element.count,
                element.name
            );
            return Err(file.broken(what));
        }
        let bytes = self.offset(file, rows.start)?..self.offset(file, rows.end)?;
        let part = |(piece, before): (&Range<u64>, &[u64])| Part {
            items: before[0].max(rows.start)..before[1].min(rows.end),
            bytes: piece.start.max(bytes.start)..piece.end.min(bytes.end),
            triangles: 0,
        };
        let parts = self.pieces.iter().zip(self.before.windows(2)).map(part).filter(|p| !p.items.is_empty());
        let from_first = |p: Part| Part { items: p.items.start - rows.start..p.items.end - rows.start, ..p };
        Ok(Located { parts: parts.map(from_first).collect(), end: bytes.end })
    }

    /// The byte of the file where the line of row `row` begins, or blank lines before it.
    fn offset(&self, file: &File<'_>, row: u64) -> Result<u64, Error> {
        let piece = self.before.partition_point(|&before| before <= row) - 1;
        let Some(range) = self.pieces.get(piece) else { return Ok(file.source.len) };
        let mut text = Vec::new();
        file.source.bytes(range.clone(), &mut text)?;
        let (mut c, mut left) = (Cursor::new(&text), row - self.before[piece]);
        while left > 0 {
            left -= u64::from(c.more());
            c.next_line();
        }
        Ok(range.start + c.pos() as u64)
    }

    /// Rows behind the last element.
    pub(super) fn behind(&self, file: &File<'_>) -> u64 {
        let rows = file.header.elements.iter().filter(|e| !e.properties.is_empty()).map(|e| e.count).sum();
        self.all().saturating_sub(rows)
    }
}

/// Calls `row` for every row of a part, with its number and the cursor at its first word.
fn each_row(
    part: &Part,
    text: &[u8],
    mut row: impl FnMut(u64, &mut Cursor<'_>) -> Result<(), Trouble>,
) -> Result<(), Trouble> {
    let (mut c, mut items) = (Cursor::new(text), part.items.clone());
    while !c.at_end() {
        if c.more() {
            row(items.next().ok_or(Trouble::Changed)?, &mut c)?;
        }
        c.next_line();
    }
    if items.is_empty() { Ok(()) } else { Err(Trouble::Changed) }
}

/// Hands every vertex of a part to `take` whose number is a multiple of `every`: number, byte of the part, values.
/// Returns how many have more on their line than there should be.
pub(super) fn vertices(
    layout: &Layout<'_>,
    part: &Part,
    text: &[u8],
    every: u64,
    mut take: impl FnMut(u64, usize, &Values) -> Result<(), Trouble>,
) -> Result<Tally, Trouble> {
    let (mut values, mut long) = (Values::default(), Tally::default());
    each_row(part, text, |item, c| {
        if item % every != 0 {
            return Ok(());
        }
        let start = c.pos();
        for (property, role) in layout.steps() {
            match role {
                Role::Value(slot) => values[slot] = number(c, item, property)?,
                _ => pass(c, item, property)?,
            }
        }
        if c.more() {
            long.add(item, start);
        }
        take(item, start, &values)
    })?;
    Ok(long)
}

/// How many triangles the faces of a part make; those of a wrong line do not count.
pub(super) fn count_triangles(layout: &Layout<'_>, part: &Part, text: &[u8]) -> Result<u64, Trouble> {
    let mut sum = 0;
    each_row(part, text, |item, c| {
        for (property, role) in layout.steps() {
            if role == Role::Corners {
                sum += list_length(c, item, property).map_or(0, triangles);
                break;
            }
            if pass(c, item, property).is_err() {
                break;
            }
        }
        Ok(())
    })?;
    Ok(sum)
}

/// Reads the faces of a part.
pub(super) fn faces(
    layout: &Layout<'_>,
    part: &Part,
    text: &[u8],
    mut writer: FaceWriter<'_>,
) -> Result<Found, Trouble> {
    each_row(part, text, |item, c| {
        let start = c.pos();
        for (property, role) in layout.steps() {
            if role != Role::Corners {
                pass(c, item, property)?;
                continue;
            }
            for _ in 0..list_length(c, item, property)? {
                let at = word(c, item, property)?;
                let index = whole(c, item)?;
                let vertex = writer.vertex(index, item, at)?;
                writer.corner(vertex)?;
            }
        }
        writer.end(item, start);
        if c.more() {
            writer.too_long(item, start);
        }
        Ok(())
    })?;
    writer.finish()
}

/// Goes to the next word and returns its place.
#[inline]
fn word(c: &mut Cursor<'_>, item: u64, property: &Property) -> Result<usize, Trouble> {
    if c.more() {
        return Ok(c.pos());
    }
    let what = format!("the line ends where '{}' should be", property.name);
    Err(Trouble::Item { item, at: c.pos(), what })
}

#[inline]
fn number(c: &mut Cursor<'_>, item: u64, property: &Property) -> Result<f64, Trouble> {
    word(c, item, property)?;
    let before = *c;
    match c.number() {
        Some(x) if c.word_ends() => Ok(x),
        _ => Err(no_number(&before, item, "a number")),
    }
}

#[inline]
fn whole(c: &mut Cursor<'_>, item: u64) -> Result<i64, Trouble> {
    let before = *c;
    match c.integer() {
        Some(n) if c.word_ends() => Ok(n),
        _ => Err(no_number(&before, item, "a whole number")),
    }
}

#[cold]
fn no_number(before: &Cursor<'_>, item: u64, wanted: &str) -> Trouble {
    Trouble::Item { item, at: before.pos(), what: format!("'{}' is not {wanted}", excerpt(before.word())) }
}

/// Reads the length of a list, which the line must have room for.
#[inline]
fn list_length(c: &mut Cursor<'_>, item: u64, property: &Property) -> Result<u64, Trouble> {
    let at = word(c, item, property)?;
    let length = whole(c, item)?;
    let what = match u64::try_from(length) {
        Ok(length) if length <= c.line().len() as u64 => return Ok(length),
        Ok(_) => format!("'{}' should have {length} numbers, but the line ends before", property.name),
        Err(_) => format!("a list cannot have {length} numbers"),
    };
    Err(Trouble::Item { item, at, what })
}

/// Passes over a property.
#[inline]
fn pass(c: &mut Cursor<'_>, item: u64, property: &Property) -> Result<(), Trouble> {
    let words = match property.kind {
        Kind::One(_) => 1,
        Kind::List { .. } => list_length(c, item, property)?,
    };
    for _ in 0..words {
        word(c, item, property)?;
        c.skip_word();
    }
    Ok(())
}
