//! The bytes of a file, read piece by piece, and the places where it can be cut.

mod packed;

pub use packed::{is_packed, unpacked_name};

use super::{Error, FreeMemory};
use memchr::memchr_iter;
use std::fs::File;
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// What reading files into memory must heed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits<'a> {
    /// Reading stops soon after this becomes true.
    pub(super) cancel: &'a AtomicBool,
    /// Asked again and again while a pipe or a compressed file is read into memory.
    pub(super) free_memory: FreeMemory<'a>,
}

/// A file that any thread may read a part of.
#[derive(Debug)]
pub(super) struct Source {
    pub(super) path: PathBuf,
    pub(super) len: u64,
    data: Data,
}

#[derive(Debug)]
enum Data {
    File(File),
    /// What a pipe gave, which cannot be read twice, or what a compressed file holds.
    Memory(Vec<u8>),
}

/// The byte order mark that some editors put before UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

impl Source {
    /// Opens a file. What is compressed is unpacked into memory.
    pub(super) fn open(path: &Path, limits: Limits<'_>) -> Result<Self, Error> {
        let failed = |source| Error::Read { path: path.to_owned(), source };
        let meta = std::fs::metadata(path).map_err(failed)?;
        if meta.is_dir() {
            return Err(Error::NotAFile { path: path.to_owned() });
        }
        let mut file = File::open(path).map_err(failed)?;
        let mut head = Vec::new();
        (&mut file).take(packed::HEAD as u64).read_to_end(&mut head).map_err(failed)?;
        let bytes = match packed::packing(path, &head)? {
            None if meta.is_file() => {
                return Ok(Self { path: path.to_owned(), len: meta.len(), data: Data::File(file) });
            }
            None => packed::read_all(head.as_slice().chain(file), path, limits)?,
            Some(packing) => packed::unpack(head.as_slice().chain(file), packing, path, limits)?,
        };
        Ok(Self { path: path.to_owned(), len: bytes.len() as u64, data: Data::Memory(bytes) })
    }

    #[cfg(test)]
    pub(super) fn memory(path: &Path, bytes: &[u8]) -> Self {
        Self { path: path.to_owned(), len: bytes.len() as u64, data: Data::Memory(bytes.to_vec()) }
    }

    /// Fills `buf` with the bytes of `range`.
    pub(super) fn bytes(&self, range: Range<u64>, buf: &mut Vec<u8>) -> Result<(), Error> {
        buf.resize((range.end - range.start) as usize, 0);
        match &self.data {
            Data::File(file) => {
                read_exact_at(file, buf, range.start).map_err(|source| Error::Read { path: self.path.clone(), source })
            }
            Data::Memory(bytes) => {
                buf.copy_from_slice(&bytes[range.start as usize..range.end as usize]);
                Ok(())
            }
        }
    }

    /// Fills `buf` with the lines of `range` as they are, but for a byte order mark, which is blanked.
    pub(super) fn text(&self, range: &Range<u64>, buf: &mut Vec<u8>) -> Result<(), Error> {
        self.bytes(range.clone(), buf)?;
        if range.start == 0 && buf.starts_with(BYTE_ORDER_MARK) {
            buf[..BYTE_ORDER_MARK.len()].fill(b' ');
        }
        Ok(())
    }

    /// Fills `buf` with the lines of `range`, one of [`pieces`](Self::pieces), ready to be
    /// parsed: continued lines are joined and a byte order mark is blanked, in place, so
    /// that offsets stay those of the file. Returns the number of line ends that are gone.
    pub(super) fn lines(&self, range: &Range<u64>, buf: &mut Vec<u8>) -> Result<u64, Error> {
        self.text(range, buf)?;
        Ok(if memchr::memchr(b'\\', buf).is_some() { join_lines(buf) } else { 0 })
    }

    /// Parts of `range`, which begins and ends at line ends, that do so too and have about `size` bytes.
    pub(super) fn pieces(&self, range: Range<u64>, size: u64) -> Result<Vec<Range<u64>>, Error> {
        let mut pieces = Vec::with_capacity(((range.end - range.start) / size + 1) as usize);
        let (mut start, mut buf) = (range.start, Vec::new());
        while start < range.end {
            let end = self.line_start(start.saturating_add(size), &mut buf)?;
            pieces.push(start..end);
            start = end;
        }
        Ok(pieces)
    }

    /// First place from `at` on where a line begins that does not continue another one.
    fn line_start(&self, at: u64, buf: &mut Vec<u8>) -> Result<u64, Error> {
        const WINDOW: u64 = 1 << 12;
        // Three bytes more, to see a whole `\` CR LF; they were judged before, or lie before `at`.
        const CONTEXT: u64 = 3;
        let mut from = at.min(self.len).saturating_sub(CONTEXT);
        loop {
            let to = (from + WINDOW).min(self.len);
            self.bytes(from..to, buf)?;
            for newline in memchr_iter(b'\n', buf) {
                let next = from + newline as u64 + 1;
                if next >= at && (newline as u64 + 1 >= CONTEXT || from == 0) && !continues(&buf[..newline]) {
                    return Ok(next);
                }
            }
            if to == self.len {
                return Ok(self.len);
            }
            from = to + 1 - CONTEXT;
        }
    }

    /// Whether there is a zero byte near the beginning, as text has none.
    pub(super) fn looks_binary(&self) -> Result<bool, Error> {
        let mut head = Vec::new();
        self.bytes(0..self.len.min(1 << 12), &mut head)?;
        Ok(memchr::memchr(0, &head).is_some())
    }

    /// Line and column, from 1, of the byte at `offset`, which is in `piece`; `lines` line
    /// ends come before that piece.
    pub(super) fn place(&self, offset: u64, piece: &Range<u64>, lines: u64) -> Result<(u64, u64), Error> {
        let mut buf = Vec::new();
        self.bytes(piece.start..offset, &mut buf)?;
        let line = lines + memchr_iter(b'\n', &buf).count() as u64 + 1;
        let row = memchr::memrchr(b'\n', &buf).map_or(0, |n| n + 1);
        let mut row = &buf[row..];
        if piece.start == 0 && line == 1 {
            row = row.strip_prefix(BYTE_ORDER_MARK).unwrap_or(row);
        }
        let column = row.iter().filter(|&&c| c & 0xc0 != 0x80).count() as u64 + 1;
        Ok((line, column))
    }
}

impl Source {
    /// Line and column, from 1, of the byte at `offset` of a text.
    pub(super) fn line_and_column(&self, offset: u64) -> Result<(u64, u64), Error> {
        const WINDOW: u64 = 1 << 20;
        let (mut lines, mut row, mut buf) = (0, 0, Vec::new());
        for start in (0..offset).step_by(WINDOW as usize) {
            self.bytes(start..offset.min(start + WINDOW), &mut buf)?;
            for newline in memchr_iter(b'\n', &buf) {
                (lines, row) = (lines + 1, start + newline as u64 + 1);
            }
        }
        self.place(offset, &(row..offset), lines)
    }
}

#[cfg(unix)]
fn read_exact_at(file: &File, buf: &mut [u8], at: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buf, at).map_err(shortened)
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut buf: &mut [u8], mut at: u64) -> io::Result<()> {
    while !buf.is_empty() {
        match std::os::windows::fs::FileExt::seek_read(file, buf, at)? {
            0 => return Err(shortened(io::ErrorKind::UnexpectedEof.into())),
            n => (buf, at) = (&mut buf[n..], at + n as u64),
        }
    }
    Ok(())
}

fn shortened(e: io::Error) -> io::Error {
    if e.kind() == io::ErrorKind::UnexpectedEof { io::Error::other("it became shorter meanwhile") } else { e }
}

/// Whether a line with these last bytes goes on in the next one.
fn continues(line: &[u8]) -> bool {
    line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\")
}

/// Puts spaces over every `\` that ends a line and over the line end. Not after a `#`: a
/// comment may well end with the name of a folder.
fn join_lines(text: &mut [u8]) -> u64 {
    let (mut start, mut comment, mut joined) = (0, false, 0);
    while let Some(length) = memchr::memchr(b'\n', &text[start..]) {
        let end = start + length;
        comment |= memchr::memchr(b'#', &text[start..end]).is_some();
        if continues(&text[start..end]) && !comment {
            let backslash = if text[end - 1] == b'\r' { end - 2 } else { end - 1 };
            text[backslash..=end].fill(b' ');
            joined += 1;
        } else {
            comment = false;
        }
        start = end + 1;
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joined(text: &str) -> String {
        let mut bytes = text.as_bytes().to_vec();
        join_lines(&mut bytes);
        String::from_utf8(bytes).expect("only ASCII is replaced")
    }

    #[test]
    fn continued_lines_are_joined_in_place() {
        assert_eq!(joined("a \\\nb\n"), "a   b\n");
        assert_eq!(joined("a\\\r\nb\\\nc\n"), "a   b  c\n");
        assert_eq!(joined("a \\ b\n"), "a \\ b\n");
        assert_eq!(joined("# C:\\new\\\nv\n"), "# C:\\new\\\nv\n");
        assert_eq!(joined("a \\\n1 # C:\\\nv\n"), "a   1 # C:\\\nv\n");
        assert_eq!(joined("a\\"), "a\\");
    }

    #[test]
    fn pieces_cover_the_file_and_end_at_lines_for_any_size() {
        let long = "x".repeat(10_000);
        let text = format!("v 1\nf 1 \\\n 2 \\\r\n 3\n\n{long}\nlast");
        let source = Source::memory(Path::new("t"), text.as_bytes());
        for size in 1..60 {
            let pieces = source.pieces(0..source.len, size).expect("it is in memory");
            assert_eq!(pieces.first().map(|p| p.start), Some(0));
            assert_eq!(pieces.last().map(|p| p.end), Some(text.len() as u64));
            for pair in pieces.windows(2) {
                assert_eq!(pair[0].end, pair[1].start);
                let before = &text[..pair[0].end as usize];
                assert!(before.ends_with('\n') && !before.ends_with("\\\n") && !before.ends_with("\\\r\n"));
            }
        }
    }
}
