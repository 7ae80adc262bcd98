//! The lines of a file as tobj gets them.
//!
//! | in the file | to tobj |
//! |---|---|
//! | a byte order mark | nothing: it would take the first statement for an unknown one |
//! | `v` with more than three numbers | three: it would divide by the fourth |
//! | `l`, `p` | a blank line: it would make faces of long ones |
//! | a corner with index 0, beyond 32 bits, or back before the first value | an error: it would take some for "none" |
//! | a face without corners | an error |
//!
//! Everything else goes as it is, continued lines and comments behind data too, which it refuses.

use super::super::pieces::Pieces;
use crate::scene::Error;
use std::io::{self, BufRead, Read};
use std::sync::atomic::Ordering;

/// Hands the file on line by line.
pub(super) struct Lines<'a> {
    pieces: &'a Pieces<'a>,
    /// The next piece to read.
    next: usize,
    text: Vec<u8>,
    /// Where the rest of `text` begins.
    rest: usize,
    line: Vec<u8>,
    /// How much of `line` is taken.
    taken: usize,
    /// The number of `line` in the file.
    number: u64,
    /// `v`, `vt` and `vn` lines so far.
    counts: [u64; 3],
    stopped: Option<Stopped>,
}

/// Why no further line is handed on.
enum Stopped {
    Odd(String),
    Failed(Error),
}

/// The line that is handed on first: it makes tobj ask for the names of materials.
const NAMES: &[u8] = b"mtllib names\n";

impl<'a> Lines<'a> {
    pub(super) fn new(pieces: &'a Pieces<'a>) -> Self {
        Self {
            pieces,
            next: 0,
            text: Vec::new(),
            rest: 0,
            line: NAMES.to_vec(),
            taken: 0,
            number: 0,
            counts: [0; 3],
            stopped: None,
        }
    }

    /// The error to report for that of tobj. Indices beyond the last value are found by it where an object ends.
    pub(super) fn failure(self, e: &tobj::LoadError) -> Error {
        use tobj::LoadError as E;
        let path = self.pieces.source.path.clone();
        let at = |what: String| Error::SecondReader { path: path.clone(), line: Some(self.number), what };
        let in_object = |kind: &str| Error::SecondReader {
            path: path.clone(),
            line: None,
            what: format!("a {kind} index does not exist, in a face before line {}", self.number + 1),
        };
        match (self.stopped, e) {
            (Some(Stopped::Failed(e)), _) => e,
            (Some(Stopped::Odd(what)), _) => at(what),
            (None, E::FaceVertexOutOfBounds) => in_object("vertex"),
            (None, E::FaceTexCoordOutOfBounds) => in_object("texture"),
            (None, E::FaceNormalOutOfBounds) => in_object("normal"),
            (None, E::ReadError) => at("it reads only text in UTF-8".into()),
            (None, e) => at(e.to_string()),
        }
    }

    /// Makes the next line the current one; false at the end.
    fn advance(&mut self) -> io::Result<bool> {
        self.taken = 0;
        self.line.clear();
        if self.rest == self.text.len() && !self.next_piece()? {
            return Ok(false);
        }
        let length = memchr::memchr(b'\n', &self.text[self.rest..]).map_or(self.text.len() - self.rest, |n| n + 1);
        let line = &self.text[self.rest..self.rest + length];
        self.rest += length;
        self.number += 1;
        if let Err(what) = hand_on(line, &mut self.counts, &mut self.line) {
            self.stopped = Some(Stopped::Odd(what));
            return Err(io::Error::other("stopped"));
        }
        Ok(true)
    }

    fn next_piece(&mut self) -> io::Result<bool> {
        let Some(range) = self.pieces.ranges.get(self.next) else { return Ok(false) };
        let read = if self.pieces.options.cancel.load(Ordering::Relaxed) {
            Err(Error::Cancelled)
        } else {
            self.pieces.source.text(range, &mut self.text)
        };
        if let Err(e) = read {
            self.stopped = Some(Stopped::Failed(e));
            return Err(io::Error::other("stopped"));
        }
        self.pieces.gone_over(range.end - range.start);
        (self.next, self.rest) = (self.next + 1, 0);
        Ok(true)
    }
}

/// Appends to `out` what tobj gets for `line`.
fn hand_on(line: &[u8], counts: &mut [u64; 3], out: &mut Vec<u8>) -> Result<(), String> {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
    match words.next() {
        Some(b"v") => {
            counts[0] += 1;
            out.push(b'v');
            for word in words.take(3) {
                out.push(b' ');
                out.extend_from_slice(word);
            }
            out.push(b'\n');
            return Ok(());
        }
        Some(b"vt") => counts[1] += 1,
        Some(b"vn") => counts[2] += 1,
        Some(b"l" | b"p") => {
            out.push(b'\n');
            return Ok(());
        }
        Some(b"f") => {
            let mut corners = 0;
            for word in words {
                corners += 1;
                check_corner(word, counts)?;
            }
            if corners == 0 {
                return Err("a face without corners".into());
            }
        }
        _ => {}
    }
    out.extend_from_slice(line);
    Ok(())
}

/// Refuses the indices that tobj would misread; what is no number is its own to refuse.
fn check_corner(word: &[u8], counts: &[u64; 3]) -> Result<(), String> {
    for (index, &count) in word.split(|&c| c == b'/').zip(counts) {
        let Some(index) = std::str::from_utf8(index).ok().and_then(|i| i.parse::<i64>().ok()) else { continue };
        let back_before_first = index < 0 && index.unsigned_abs() > count;
        if index == 0 || index > i64::from(u32::MAX) || back_before_first {
            return Err(format!("a corner has the index {index}, which it would misread"));
        }
    }
    Ok(())
}

impl BufRead for Lines<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.taken == self.line.len() {
            self.advance()?;
        }
        Ok(&self.line[self.taken..])
    }

    fn consume(&mut self, amount: usize) {
        self.taken += amount;
    }
}

impl Read for Lines<'_> {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        let n = self.fill_buf()?.read(buf)?;
        self.consume(n);
        Ok(n)
    }
}
