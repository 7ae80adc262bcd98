//! What a build holds in memory, counted as it grows.

use super::BuildError;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Bytes that all parts of a build hold together; more than the limit ends it.
#[derive(Debug)]
pub(super) struct Held {
    limit: u64,
    now: AtomicU64,
    peak: AtomicU64,
}

impl Held {
    pub(super) fn new(limit: Option<u64>) -> Self {
        Self { limit: limit.unwrap_or(u64::MAX), now: 0.into(), peak: 0.into() }
    }

    /// Counts `bytes` before they are taken.
    pub(super) fn take(&self, bytes: usize) -> Result<(), BuildError> {
        let bytes = bytes as u64;
        let now = self.now.fetch_add(bytes, Relaxed) + bytes;
        if now > self.limit {
            return Err(BuildError::OverBudget { needed: now, limit: self.limit });
        }
        self.peak.fetch_max(now, Relaxed);
        Ok(())
    }

    /// Counts `bytes` that are given back.
    pub(super) fn give(&self, bytes: usize) {
        self.now.fetch_sub(bytes as u64, Relaxed);
    }

    /// Bytes that are held.
    #[cfg(test)]
    pub(super) fn now(&self) -> u64 {
        self.now.load(Relaxed)
    }

    /// Most bytes that were held at once.
    pub(super) fn peak(&self) -> u64 {
        self.peak.load(Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_the_last_byte_that_may_be_held() {
        let held = Held::new(Some(100));
        assert_eq!(held.take(60), Ok(()));
        held.give(20);
        assert_eq!(held.take(60), Ok(()));
        assert_eq!(held.peak(), 100);
        assert_eq!(held.take(1), Err(BuildError::OverBudget { needed: 101, limit: 100 }));
        assert_eq!(held.peak(), 100);
        let free = Held::new(None);
        assert_eq!((free.take(usize::MAX >> 1), free.peak()), (Ok(()), u64::MAX >> 1));
    }
}
