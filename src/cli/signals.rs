//! SIGINT and SIGTERM: the first asks the run to stop, the second leaves.

use super::exit::Exit;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals as Incoming;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering::SeqCst};
use tison::film;
use tison::render::Control;

/// What has been caught so far.
#[derive(Debug)]
pub struct Signals {
    first: Arc<AtomicI32>,
}

impl Signals {
    /// Listens from now on; the first signal sets `control.cancel`.
    pub fn install(control: &Arc<Control>) -> io::Result<Self> {
        let first = Arc::new(AtomicI32::new(0));
        let mut incoming = Incoming::new([SIGINT, SIGTERM])?;
        let (seen, control) = (Arc::clone(&first), Arc::clone(control));
        std::thread::Builder::new().name("signals".into()).spawn(move || {
            for signal in incoming.forever() {
                if seen.swap(signal, SeqCst) != 0 {
                    film::abandon();
                    // Not `process::exit`: handlers of C libraries would run under threads that use them.
                    signal_hook::low_level::exit(exit_of(signal) as i32);
                }
                control.cancel.store(true, SeqCst);
            }
        })?;
        Ok(Self { first })
    }

    /// The code to leave with, if a signal has come.
    pub fn caught(&self) -> Option<Exit> {
        match self.first.load(SeqCst) {
            0 => None,
            signal => Some(exit_of(signal)),
        }
    }
}

fn exit_of(signal: i32) -> Exit {
    if signal == SIGTERM { Exit::Terminated } else { Exit::Interrupted }
}
