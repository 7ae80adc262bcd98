//! The parts of a file, worked on by all threads.

use rayon::prelude::*;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Calls `work(i, job, buf)` for every job, on all threads and about in order; `buf` is for its own use and is
/// kept from job to job. Returns the results in order, or the error of the first job that has one, however many
/// threads there are.
pub(super) fn in_order<J, R, E, F>(jobs: Vec<J>, work: F) -> Result<Vec<R>, E>
where
    J: Send,
    R: Send,
    E: Send,
    F: Fn(usize, J, &mut Vec<u8>) -> Result<R, E> + Sync,
{
    let workers = rayon::current_num_threads().min(jobs.len());
    let first_bad = AtomicUsize::new(usize::MAX);
    let queue = Mutex::new(jobs.into_iter().enumerate());
    let next = || queue.lock().expect("nothing panics while it holds the lock").next();
    let worker = |_| {
        let (mut buf, mut out) = (Vec::new(), Vec::new());
        while let Some((i, job)) = next() {
            if i > first_bad.load(Ordering::Relaxed) {
                break;
            }
            let result = work(i, job, &mut buf);
            if result.is_err() {
                first_bad.fetch_min(i, Ordering::Relaxed);
            }
            out.push((i, result));
        }
        out
    };
    let mut results: Vec<_> = (0..workers).into_par_iter().with_max_len(1).flat_map_iter(worker).collect();
    results.sort_unstable_by_key(|&(i, _)| i);
    results.into_iter().map(|(_, result)| result).collect()
}

/// Cuts `all` into consecutive parts of the given lengths.
///
/// # Panics
/// If the lengths add up to more than there is.
pub(super) fn cut<T>(mut all: &mut [T], lengths: impl Iterator<Item = usize>) -> Vec<&mut [T]> {
    lengths
        .map(|n| {
            let (part, rest) = std::mem::take(&mut all).split_at_mut(n);
            all = rest;
            part
        })
        .collect()
}
