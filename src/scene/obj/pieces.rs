//! Works on all pieces of a file at once.

use super::super::Error;
use super::super::parallel::in_order;
use super::super::source::Source;
use super::ReadOptions;
use super::parse::Trouble;
use super::survey::Survey;
use std::io;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// A file, cut.
pub(super) struct Pieces<'a> {
    pub(super) source: &'a Source,
    pub(super) options: &'a ReadOptions<'a>,
    pub(super) ranges: Vec<Range<u64>>,
    /// Bytes gone over so far.
    done: AtomicU64,
}

/// What stopped the work on a piece.
enum Stop {
    Error(Error),
    Trouble(Trouble),
}

impl<'a> Pieces<'a> {
    pub(super) fn cut(source: &'a Source, options: &'a ReadOptions<'a>, size: u64) -> Result<Self, Error> {
        Ok(Self { source, options, ranges: source.pieces(0..source.len, size)?, done: AtomicU64::new(0) })
    }

    /// Calls `work(piece, job, lines, joined)` for every piece: its number, its job, its
    /// text, and how many line ends are missing in that. Returns the results in order, or
    /// the error that comes first in the file. `surveys` serves to tell its line.
    pub(super) fn each<J, R, F>(&self, jobs: Vec<J>, surveys: &[Survey], work: F) -> Result<Vec<R>, Error>
    where
        J: Send,
        R: Send,
        F: Fn(usize, J, &[u8], u64) -> Result<R, Trouble> + Sync,
    {
        let work = |i, job, buf: &mut Vec<u8>| self.one(i, buf, |lines, joined| work(i, job, lines, joined));
        let numbered = |i, job, buf: &mut Vec<u8>| work(i, job, buf).map_err(|stop| (i, stop));
        in_order(jobs, numbered).map_err(|(i, stop)| match stop {
            Stop::Error(e) => e,
            Stop::Trouble(t) => self.located(i, t, surveys),
        })
    }

    fn one<R>(
        &self,
        i: usize,
        buf: &mut Vec<u8>,
        work: impl FnOnce(&[u8], u64) -> Result<R, Trouble>,
    ) -> Result<R, Stop> {
        if self.options.cancel.load(Ordering::Relaxed) {
            return Err(Stop::Error(Error::Cancelled));
        }
        let range = &self.ranges[i];
        let joined = self.source.lines(range, buf).map_err(Stop::Error)?;
        let result = work(buf, joined).map_err(Stop::Trouble)?;
        self.gone_over(range.end - range.start);
        Ok(result)
    }

    /// Notes that so many bytes more are done.
    pub(super) fn gone_over(&self, length: u64) {
        let done = self.done.fetch_add(length, Ordering::Relaxed) + length;
        if let Some(progress) = self.options.progress {
            let total = 2 * self.source.len;
            progress(done.min(total), total);
        }
    }

    fn located(&self, piece: usize, trouble: Trouble, surveys: &[Survey]) -> Error {
        let path = self.source.path.clone();
        match trouble {
            Trouble::Changed => Error::Read { path, source: io::Error::other("it changed while it was being read") },
            Trouble::Text { at, what } => match self.place(self.ranges[piece].start + at as u64, surveys) {
                Ok((line, column)) => Error::At { path, line, column, what },
                Err(e) => e,
            },
        }
    }

    /// Line and column of the byte at `offset` of the file.
    pub(super) fn place(&self, offset: u64, surveys: &[Survey]) -> Result<(u64, u64), Error> {
        let piece = self.ranges.partition_point(|r| r.end <= offset).min(self.ranges.len() - 1);
        let lines = surveys[..piece].iter().map(|s| s.tally.lines).sum();
        self.source.place(offset, &self.ranges[piece], lines)
    }
}
