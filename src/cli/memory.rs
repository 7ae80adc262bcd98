//! `--max-memory`: what the process may hold, and what comes of wanting more.
//!
//! What counts is the process's resident memory as the system states it: the program, the scene, the hierarchies, the
//! image, and what was given back but is still kept for later. What is known before it is taken is refused before; a
//! thread watches the rest.

use super::exit::{Exit, Failure};
use super::style::bytes;
use super::system;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;
use tison::render::Control;

/// Between two looks: memory grows by some ten megabytes at most meanwhile.
const TICK: Duration = Duration::from_millis(5);

/// What may be held.
#[derive(Debug)]
pub struct Memory {
    limit: Option<u64>,
    /// Kept free for the image.
    reserved: AtomicU64,
    watch: Option<(Arc<Watch>, JoinHandle<()>)>,
}

/// What a thread looks after.
#[derive(Debug)]
struct Watch {
    limit: u64,
    control: Arc<Control>,
    /// Bytes that were held when that was too much; 0 until then.
    held: AtomicU64,
    over: Mutex<bool>,
    wake: Condvar,
}

impl Memory {
    /// Watches from now on, if there is a limit; `control.cancel` is set when more is held.
    pub fn watch(limit: Option<u64>, control: &Arc<Control>) -> Result<Self, Failure> {
        let mut memory = Self { limit, reserved: 0.into(), watch: None };
        let Some(limit) = limit else { return Ok(memory) };
        let Some(held) = system::resident_memory() else {
            return Err(Failure::usage("--max-memory: this system does not say what a process holds")
                .help("leave it out, and limit the process by other means, like ulimit -v"));
        };
        if held > limit {
            let what = format!("the program itself holds {}, more than --max-memory {}", bytes(held), bytes(limit));
            return Err(Failure::new(Exit::Limit, what).help("allow it 100M or more"));
        }
        let watch = Watch {
            limit,
            control: Arc::clone(control),
            held: 0.into(),
            over: Mutex::new(false),
            wake: Condvar::new(),
        };
        let watch = Arc::new(watch);
        let own = Arc::clone(&watch);
        let thread = std::thread::Builder::new().name("memory".into()).spawn(move || own.run());
        let thread = thread.map_err(|e| Failure::new(Exit::Render, "cannot start a thread").because(e))?;
        memory.watch = Some((watch, thread));
        Ok(memory)
    }

    /// Whether there is a limit.
    pub fn is_limited(&self) -> bool {
        self.limit.is_some()
    }

    /// Keeps `bytes` free for the image.
    pub fn reserve(&self, bytes: u64) {
        self.reserved.store(bytes, Relaxed);
    }

    /// Bytes that can still be had, by the limit and by the machine, without what is kept free.
    pub fn free(&self) -> Option<u64> {
        let left = self.limit.map(|limit| limit.saturating_sub(system::resident_memory().unwrap_or(0)));
        let free = left.into_iter().chain(system::available_memory()).min()?;
        Some(free.saturating_sub(self.reserved.load(Relaxed)))
    }

    /// An error if more was held than may be.
    pub fn check(&self) -> Result<(), Failure> {
        let held = self.watch.as_ref().map_or(0, |(watch, _)| watch.held.load(Relaxed));
        if held == 0 {
            return Ok(());
        }
        let what = format!("stopped: memory grew to {}, and nothing is written", bytes(held));
        let limit = bytes(self.limit.unwrap_or(u64::MAX));
        let help = format!("--max-memory lets the process hold {limit}: raise it, or render a smaller mesh or image");
        Err(Failure::new(Exit::Limit, what).help(help))
    }

    /// `failure` with the limit and what to do about it, if that is why.
    pub fn explained(&self, failure: Failure) -> Failure {
        let Some(limit) = self.limit.filter(|_| failure.exit == Exit::Limit) else { return failure };
        let held =
            system::resident_memory().map_or(String::new(), |held| format!(", of which {} are taken", bytes(held)));
        let kept = match self.reserved.load(Relaxed) {
            0 => String::new(),
            reserved => format!(" and {} kept for the image", bytes(reserved)),
        };
        let limit = bytes(limit);
        failure.help(format!(
            "--max-memory lets the process hold {limit}{held}{kept}: raise it, or render a smaller mesh or image"
        ))
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        if let Some((watch, thread)) = self.watch.take() {
            *watch.over.lock().unwrap_or_else(PoisonError::into_inner) = true;
            watch.wake.notify_one();
            // It does nothing that could fail.
            let _ = thread.join();
        }
    }
}

impl Watch {
    fn run(&self) {
        let mut over = self.over.lock().unwrap_or_else(PoisonError::into_inner);
        while !*over {
            if let Some(held) = system::resident_memory().filter(|&held| held > self.limit) {
                self.held.store(held, Relaxed);
                self.control.cancel.store(true, Relaxed);
                break;
            }
            over = self.wake.wait_timeout(over, TICK).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn growing_past_the_limit_stops_the_run() {
        let control = Arc::new(Control::default());
        let held = system::resident_memory().expect("Linux says it");
        let limit = held + (128 << 20);
        let memory = Memory::watch(Some(limit), &control).expect("it fits");
        assert!(memory.check().is_ok());
        // Other tests of this process come and go: what is held may have become less.
        assert!(memory.free().expect("known") <= limit);
        let ballast = vec![1u8; 384 << 20];
        while !control.is_cancelled() {
            std::thread::sleep(TICK);
        }
        assert!(ballast.iter().all(|&b| b == 1));
        let failure = memory.check().expect_err("it is too much");
        assert_eq!(failure.exit, Exit::Limit);
        assert!(failure.help.expect("what to do").contains("--max-memory"));
    }

    #[test]
    fn without_a_limit_nothing_is_watched() {
        let control = Arc::new(Control::default());
        let memory = Memory::watch(None, &control).expect("nothing to watch");
        assert!(memory.check().is_ok() && !memory.is_limited());
        let plain = memory.explained(Failure::new(Exit::Limit, "too large"));
        assert_eq!(plain.help, None);
    }
}
