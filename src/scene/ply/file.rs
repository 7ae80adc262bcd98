//! A file that is being read: its parts, by all threads, and where in it something is wrong.

use super::super::Error;
use super::super::obj::ReadOptions;
use super::super::parallel::in_order;
use super::super::source::Source;
use super::header::{Element, Encoding, Header};
use std::io;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// A file and its header.
pub(super) struct File<'a> {
    pub(super) source: &'a Source,
    pub(super) options: &'a ReadOptions<'a>,
    pub(super) header: &'a Header,
    /// About how many bytes a part should have.
    pub(super) piece: u64,
    /// Bytes gone over so far, of twice the file's.
    done: AtomicU64,
}

/// Some things of one element, one behind the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Part {
    /// Their numbers, from 0.
    pub(super) items: Range<u64>,
    /// Where they are in the file.
    pub(super) bytes: Range<u64>,
    /// Triangles that they make, if they are faces and that is known.
    pub(super) triangles: u64,
}

/// Where an element is.
#[derive(Debug)]
pub(super) struct Located {
    pub(super) parts: Vec<Part>,
    /// The byte behind the last of its things.
    pub(super) end: u64,
}

/// Why a part could not be read.
#[derive(Debug)]
pub(super) enum Trouble {
    /// What is wrong with thing `item` of the element, at byte `at` of the part.
    Item { item: u64, at: usize, what: String },
    /// It does not hold what was found in it before.
    Changed,
    /// Not every list has the length that it was taken to have.
    Uneven,
}

/// Why the parts of an element could not be read.
#[derive(Debug)]
pub(super) enum Stop {
    Error(Error),
    /// See [`Trouble::Uneven`]; everything before was as expected.
    Uneven,
}

impl<'a> File<'a> {
    pub(super) fn new(source: &'a Source, options: &'a ReadOptions<'a>, header: &'a Header, piece: u64) -> Self {
        Self { source, options, header, piece, done: AtomicU64::new(0) }
    }

    /// Calls `work(part, job, bytes)` for every part of `element`. Returns the results in order, or the error
    /// that comes first in the file.
    pub(super) fn each<J, R, F>(&self, element: &Element, parts: &[Part], jobs: Vec<J>, work: F) -> Result<Vec<R>, Stop>
    where
        J: Send,
        R: Send,
        F: Fn(&Part, J, &[u8]) -> Result<R, Trouble> + Sync,
    {
        let one = |i: usize, job, buf: &mut Vec<u8>| {
            let part = &parts[i];
            let error = |e| (i, Err(e));
            self.check_cancelled().map_err(error)?;
            self.source.bytes(part.bytes.clone(), buf).map_err(error)?;
            work(part, job, buf).map_err(|trouble| (i, Ok(trouble)))
        };
        in_order(jobs, one).map_err(|(i, stop)| match stop {
            Ok(Trouble::Uneven) => Stop::Uneven,
            Ok(Trouble::Changed) => Stop::Error(self.changed()),
            Ok(Trouble::Item { item, at, what }) => {
                Stop::Error(self.wrong(element, item, parts[i].bytes.start + at as u64, &what))
            }
            Err(e) => Stop::Error(e),
        })
    }

    /// [`each`](Self::each) where no list is taken to have any length.
    pub(super) fn each_as_found<J, R, F>(
        &self,
        element: &Element,
        parts: &[Part],
        jobs: Vec<J>,
        work: F,
    ) -> Result<Vec<R>, Error>
    where
        J: Send,
        R: Send,
        F: Fn(&Part, J, &[u8]) -> Result<R, Trouble> + Sync,
    {
        self.each(element, parts, jobs, work).map_err(|stop| self.stopped(stop))
    }

    /// The error to report where lists are as they were found.
    pub(super) fn stopped(&self, stop: Stop) -> Error {
        match stop {
            Stop::Error(e) => e,
            Stop::Uneven => self.changed(),
        }
    }

    pub(super) fn check_cancelled(&self) -> Result<(), Error> {
        if self.options.cancel.load(Ordering::Relaxed) { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// Notes that so many bytes more are done.
    pub(super) fn gone_over(&self, length: u64) {
        // Text is gone over twice, to find the lines and to read them.
        let length = if self.header.encoding == Encoding::Ascii { length } else { 2 * length };
        let done = self.done.fetch_add(length, Ordering::Relaxed) + length;
        if let Some(progress) = self.options.progress {
            let total = 2 * self.source.len;
            progress(done.min(total), total);
        }
    }

    fn changed(&self) -> Error {
        let source = io::Error::other("it changed while it was being read");
        Error::Read { path: self.source.path.clone(), source }
    }

    /// The error that something is wrong with thing `item` of `element`, at byte `offset` of the file.
    pub(super) fn wrong(&self, element: &Element, item: u64, offset: u64, what: &str) -> Error {
        let name = &element.name;
        if self.header.encoding != Encoding::Ascii {
            return self.broken(format!("{name} {item} (byte {offset}): {what}"));
        }
        match self.source.line_and_column(offset) {
            Ok((line, column)) => {
                Error::At { path: self.source.path.clone(), line, column, what: format!("{name} {item}: {what}") }
            }
            Err(e) => e,
        }
    }

    /// The error that something is wrong with the file as a whole.
    pub(super) fn broken(&self, what: String) -> Error {
        Error::Broken { path: self.source.path.clone(), what }
    }
}
