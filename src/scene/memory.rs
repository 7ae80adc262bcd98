//! How much memory reading may take.

use super::Error;
use std::fmt;
use std::path::Path;

/// How many bytes of memory can still be had. Asked before anything large is taken, which ends in an error when they
/// are too few.
#[derive(Clone, Copy)]
pub struct FreeMemory<'a> {
    ask: Option<&'a (dyn Fn() -> Option<u64> + Sync)>,
    for_each_triangle: u64,
}

impl<'a> FreeMemory<'a> {
    /// Nobody knows: whatever is asked for is tried.
    pub const UNKNOWN: FreeMemory<'static> = FreeMemory { ask: None, for_each_triangle: 0 };

    /// As `ask` says, or nothing where it does not know.
    #[must_use]
    pub fn new(ask: &'a (dyn Fn() -> Option<u64> + Sync)) -> Self {
        Self { ask: Some(ask), for_each_triangle: 0 }
    }

    /// The same, where each triangle is going to take `bytes` more when the file has been read, for a hierarchy.
    #[must_use]
    pub fn with_triangles_of(self, bytes: u64) -> Self {
        Self { for_each_triangle: bytes, ..self }
    }

    /// Bytes that can be had.
    pub(super) fn bytes(&self) -> Option<u64> {
        self.ask.and_then(|ask| ask())
    }

    /// Refuses `what` of the file at `path`, which takes `needed` bytes, if there are not so many.
    pub(super) fn check(&self, path: &Path, what: impl FnOnce() -> String, needed: u64) -> Result<(), Error> {
        match self.bytes() {
            Some(free) if needed > free => Err(Error::TooLarge { path: path.to_owned(), what: what(), needed, free }),
            _ => Ok(()),
        }
    }

    /// The same for the mesh in a file: `buffers` bytes, and what its triangles take later.
    pub(super) fn check_mesh(&self, path: &Path, triangles: u64, buffers: u64) -> Result<(), Error> {
        let hierarchy = if self.for_each_triangle > 0 { ", and the hierarchy over them," } else { "" };
        let needed = buffers.saturating_add(triangles.saturating_mul(self.for_each_triangle));
        self.check(path, || format!("a mesh of {triangles} triangles{hierarchy}"), needed)
    }
}

impl fmt::Debug for FreeMemory<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FreeMemory").field("bytes", &self.bytes()).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_byte_that_is_free_can_be_had() {
        let (path, free) = (Path::new("a.obj"), || Some(1000));
        let free = FreeMemory::new(&free);
        assert!(free.check_mesh(path, 10, 1000).is_ok() && free.check_mesh(path, 10, 1001).is_err());
        let later = free.with_triangles_of(60);
        assert!(later.check_mesh(path, 10, 400).is_ok());
        let told = later.check_mesh(path, 10, 401).expect_err("one byte too many").to_string();
        assert!(told.starts_with("a.obj: a mesh of 10 triangles, and the hierarchy over them,"), "{told}");
        assert!(later.check_mesh(path, u64::MAX, 0).is_err());
        assert!(FreeMemory::UNKNOWN.check_mesh(path, u64::MAX, 0).is_ok());
    }
}
