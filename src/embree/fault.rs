//! Panics must not unwind through C: the first one is kept here until Rust code can raise it again.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// The first panic of the callbacks of one scene. Like a poisoned lock it stays raised.
#[derive(Default)]
pub(super) struct Fault {
    raised: AtomicBool,
    payload: Mutex<Option<Box<dyn Any + Send>>>,
}

impl Fault {
    /// What `f` answers, or `otherwise` when it panics or another call has: one panic is reported, not thousands.
    #[inline]
    pub fn guard<T>(&self, otherwise: T, f: impl FnOnce() -> T) -> T {
        if self.is_raised() {
            return otherwise;
        }
        // `AssertUnwindSafe`: callbacks only read what they share, and after a panic nothing reads it any more.
        match catch_unwind(AssertUnwindSafe(f)) {
            Ok(answer) => answer,
            Err(payload) => {
                self.raise(payload);
                otherwise
            }
        }
    }

    #[inline]
    pub fn is_raised(&self) -> bool {
        self.raised.load(Ordering::Relaxed)
    }

    #[cold]
    pub fn raise(&self, payload: Box<dyn Any + Send>) {
        let mut slot = self.payload.lock().unwrap_or_else(PoisonError::into_inner);
        if !self.is_raised() {
            *slot = Some(payload);
        } else {
            // The destructor of a payload may panic too, and this must not.
            let _ = catch_unwind(AssertUnwindSafe(|| drop(payload))).map_err(std::mem::forget);
        }
        self.raised.store(true, Ordering::Release);
    }

    /// Raises the panic again, if there was one.
    #[inline]
    pub fn resume(&self) {
        if self.raised.load(Ordering::Acquire) {
            self.resume_first();
        }
    }

    #[cold]
    fn resume_first(&self) {
        let payload = self.payload.lock().unwrap_or_else(PoisonError::into_inner).take();
        match payload {
            Some(payload) => resume_unwind(payload),
            None => panic!("a shape of this scene has panicked before: its answers since then are not to be used"),
        }
    }
}
