//! Compressed files, unpacked into memory.

use super::super::Error;
use super::Limits;
use flate2::bufread::MultiGzDecoder;
use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// A way to compress files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    /// RFC 1952.
    Gzip,
    /// RFC 8878.
    Zstd,
}

impl Packing {
    /// As the extension says.
    fn of_name(path: &Path) -> Option<Self> {
        let extension = path.extension()?;
        let known = [("gz", Self::Gzip), ("zst", Self::Zstd)];
        known.into_iter().find(|(name, _)| extension.eq_ignore_ascii_case(name)).map(|(_, packing)| packing)
    }

    /// As the first bytes say. No mesh begins like that.
    fn of_bytes(head: &[u8]) -> Option<Self> {
        match head {
            [0x1f, 0x8b, ..] => Some(Self::Gzip),
            // A frame of data, or one that is skipped.
            [0x28, 0xb5, 0x2f, 0xfd] | [0x50..=0x5f, 0x2a, 0x4d, 0x18] => Some(Self::Zstd),
            _ => None,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Gzip => "gzip",
            Self::Zstd => "zstd",
        }
    }
}

/// Bytes that tell how a file is compressed.
pub(super) const HEAD: usize = 4;

/// How a file is compressed that begins with `head`.
///
/// # Errors
/// [`Error::Broken`] if its name says that it is and it is not.
pub(super) fn packing(path: &Path, head: &[u8]) -> Result<Option<Packing>, Error> {
    match (Packing::of_bytes(head), Packing::of_name(path)) {
        (Some(packing), _) => Ok(Some(packing)),
        // No frame at all.
        (None, Some(Packing::Zstd) | None) if head.is_empty() => Ok(None),
        (None, None) => Ok(None),
        (None, Some(named)) => {
            let what = format!("it is not compressed by {}, as its name says", named.name());
            Err(Error::Broken { path: path.to_owned(), what })
        }
    }
}

/// The name of a file without the extension that says it is compressed.
#[must_use]
pub fn unpacked_name(path: &Path) -> PathBuf {
    match Packing::of_name(path) {
        Some(_) => path.with_extension(""),
        None => path.to_owned(),
    }
}

/// Whether the file at `path`, if it can be read again, is compressed.
#[must_use]
pub fn is_packed(path: &Path) -> bool {
    let mut head = [0; HEAD];
    let read = |mut file: std::fs::File| file.read_exact(&mut head);
    path.is_file() && std::fs::File::open(path).and_then(read).is_ok() && Packing::of_bytes(&head).is_some()
}

/// All that `source` gives, unpacked.
pub(super) fn unpack(source: impl Read, packing: Packing, path: &Path, limits: Limits<'_>) -> Result<Vec<u8>, Error> {
    let source = BufReader::with_capacity(1 << 18, source);
    let damaged = |e| {
        let what = format!("it cannot be unpacked: {e}; as a {} file it is damaged or cut off", packing.name());
        Error::Broken { path: path.to_owned(), what }
    };
    match packing {
        Packing::Gzip => collect(MultiGzDecoder::new(source), path, limits, damaged),
        Packing::Zstd => collect(Frames::new(source), path, limits, damaged),
    }
}

/// All that `source` gives.
pub(super) fn read_all(source: impl Read, path: &Path, limits: Limits<'_>) -> Result<Vec<u8>, Error> {
    collect(source, path, limits, |source| Error::Read { path: path.to_owned(), source })
}

/// All that `source` gives, if there is room for it; `failed` makes an error of what stops that.
fn collect(
    mut source: impl Read,
    path: &Path,
    limits: Limits<'_>,
    failed: impl Fn(io::Error) -> Error,
) -> Result<Vec<u8>, Error> {
    const STEP: usize = 1 << 20;
    let mut bytes = Vec::new();
    loop {
        if limits.cancel.load(Ordering::Relaxed) {
            return Err(Error::Cancelled);
        }
        if bytes.capacity() - bytes.len() < STEP {
            let more = bytes.len().max(STEP);
            let free = limits.free_memory.bytes();
            if free.is_some_and(|free| more as u64 > free) || bytes.try_reserve_exact(more).is_err() {
                return Err(Error::NoRoom { path: path.to_owned(), read: bytes.len() as u64 });
            }
        }
        if (&mut source).take(STEP as u64).read_to_end(&mut bytes).map_err(&failed)? == 0 {
            return Ok(bytes);
        }
    }
}

/// Frames of zstd, one behind the other.
struct Frames<R> {
    source: R,
    decoder: FrameDecoder,
    /// Whether a frame has begun.
    within: bool,
}

impl<R: BufRead> Frames<R> {
    fn new(source: R) -> Self {
        Self { source, decoder: FrameDecoder::new(), within: false }
    }

    /// Begins the next frame that holds something; false if there is none.
    fn begin(&mut self) -> io::Result<bool> {
        while !self.source.fill_buf()?.is_empty() {
            match self.decoder.init(&mut self.source) {
                Ok(()) => return Ok(true),
                Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame { length, .. })) => {
                    let length = u64::from(length);
                    if io::copy(&mut (&mut self.source).take(length), &mut io::sink())? < length {
                        return Err(io::ErrorKind::UnexpectedEof.into());
                    }
                }
                Err(e) => return Err(io::Error::other(e)),
            }
        }
        Ok(false)
    }

    fn check_sum(&self) -> io::Result<()> {
        let written = self.decoder.get_checksum_from_data();
        if written.is_none() || written == self.decoder.get_calculated_checksum() {
            return Ok(());
        }
        Err(io::Error::other("its checksum is wrong"))
    }
}

impl<R: BufRead> Read for Frames<R> {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        if buf.is_empty() {
            return Ok(0);
        }
        loop {
            if self.within && self.decoder.can_collect() > 0 {
                return self.decoder.read(buf);
            }
            if !self.within {
                self.within = self.begin()?;
                if !self.within {
                    return Ok(0);
                }
            } else if self.decoder.is_finished() {
                self.check_sum()?;
                self.within = false;
            } else {
                let some = BlockDecodingStrategy::UptoBytes(1 << 18);
                self.decoder.decode_blocks(&mut self.source, some).map_err(io::Error::other)?;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{FreeMemory, Source};
    use super::*;
    use flate2::Compression;
    use flate2::write::GzEncoder;
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};
    use std::io::Write;
    use std::sync::atomic::AtomicBool;

    static GO_ON: AtomicBool = AtomicBool::new(false);
    const LIMITS: Limits<'static> = Limits { cancel: &GO_ON, free_memory: FreeMemory::UNKNOWN };

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(bytes).expect("memory takes all");
        encoder.finish().expect("memory takes all")
    }

    fn zstd(bytes: &[u8]) -> Vec<u8> {
        compress_to_vec(bytes, CompressionLevel::Fastest)
    }

    /// More than a step, a block and a window, and no two parts alike.
    fn numbers() -> Vec<u8> {
        (0..300_000u32).flat_map(|i| format!("v {} {}\n", i, i.wrapping_mul(2_654_435_761)).into_bytes()).collect()
    }

    fn open(name: &str, bytes: &[u8], limits: Limits<'_>) -> Result<Vec<u8>, Error> {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).expect("it can be written");
        let source = Source::open(&path, limits)?;
        let mut read = Vec::new();
        source.bytes(0..source.len, &mut read)?;
        Ok(read)
    }

    #[test]
    fn whatever_was_packed_comes_out() {
        let all = numbers();
        let (head, tail) = all.split_at(1_000_001);
        let skipped = b"\x53\x2a\x4d\x18\x05\0\0\0other";
        for (name, bytes) in [
            ("a.obj", all.clone()),
            ("a.obj.gz", gzip(&all)),
            ("a.obj.GZ", [gzip(head), gzip(tail)].concat()),
            ("a.obj.zst", zstd(&all)),
            ("a.obj.zst", [&zstd(head)[..], skipped, &zstd(b""), &zstd(tail), skipped].concat()),
            ("a.obj.zst", [skipped, &zstd(&all)[..]].concat()),
            // The bytes decide where the name says nothing, or something else.
            ("a.obj", zstd(&all)),
            ("a.zst", gzip(&all)),
        ] {
            assert!(open(name, &bytes, LIMITS).expect("it is whole") == all, "{name}");
        }
        assert_eq!(open("a.ply.zst", b"", LIMITS).expect("there are no frames"), b"");
        assert_eq!(open("a.ply", b"pl", LIMITS).expect("it is short"), b"pl");
    }

    #[test]
    fn damage_is_told_wherever_it_is() {
        let all = &numbers()[..300_000];
        for (kind, whole) in [("gzip", gzip(all)), ("zstd", zstd(all))] {
            let broken = |bytes: &[u8]| match open("a.obj", bytes, LIMITS) {
                Err(e @ Error::Broken { .. }) => assert!(e.to_string().contains(&format!("as a {kind} file")), "{e}"),
                other => panic!("{kind}: {:?}", other.map(|read| read.len())),
            };
            for end in (8..whole.len()).step_by(997).chain([whole.len() - 1]) {
                broken(&whole[..end]);
            }
            // The last bytes are a checksum or a length.
            let mut other = whole.clone();
            other[whole.len() - 1] ^= 0x40;
            broken(&other);
            broken(&[&whole[..], b"more"].concat());
        }
        for (name, kind) in [("a.obj.gz", "gzip"), ("a.obj.zst", "zstd")] {
            let told = open(name, b"v 0 0 0\n", LIMITS).expect_err("it is not packed").to_string();
            assert!(told.ends_with(&format!("it is not compressed by {kind}, as its name says")), "{told}");
        }
        assert!(open("a.obj.gz", b"", LIMITS).is_err());
    }

    #[test]
    fn flipped_bytes_never_panic() {
        let all = &numbers()[..20_000];
        for whole in [gzip(all), zstd(all)] {
            for at in (0..whole.len()).step_by(7) {
                let mut other = whole.clone();
                other[at] ^= 0x11;
                if let Ok(read) = open("a.obj", &other, LIMITS) {
                    // What names and times a header has is nobody's business.
                    assert!(read == all || read == other, "byte {at}");
                }
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_and_reading_can_be_stopped() {
        let bomb = gzip(&vec![0; 64 << 20]);
        assert!(bomb.len() < 1 << 20);
        let ten = || Some(10 << 20);
        let free = Limits { free_memory: FreeMemory::new(&ten), ..LIMITS };
        assert!(matches!(open("a.obj", &bomb, free), Err(Error::NoRoom { read, .. }) if read <= 32 << 20));
        assert_eq!(open("a.obj", &gzip(&vec![b' '; 9 << 20]), free).expect("it fits").len(), 9 << 20);
        let stop = AtomicBool::new(true);
        assert!(matches!(open("a.obj", &bomb, Limits { cancel: &stop, ..LIMITS }), Err(Error::Cancelled)));
    }

    #[test]
    fn names_without_what_was_packed() {
        for (name, want) in [("d/a.obj.gz", "d/a.obj"), ("a.ply.ZST", "a.ply"), ("a.obj", "a.obj"), ("gz", "gz")] {
            assert_eq!(unpacked_name(Path::new(name)), Path::new(want));
        }
    }
}
