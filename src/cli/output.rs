//! stdout: only what was asked for.

use super::exit::{Exit, Failure};
use std::io::{self, Write};

/// Writes text or an image to stdout. A reader that has had enough is no error.
pub fn print(bytes: &[u8]) -> Result<Exit, Failure> {
    print_with(|out| out.write_all(bytes))
}

/// The same for what writes itself.
pub fn print_with(write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<Exit, Failure> {
    // Made in memory first: some writers panic when a pipe breaks under them.
    let mut bytes = Vec::new();
    let mut stdout = io::stdout().lock();
    let done = write(&mut bytes).and_then(|()| stdout.write_all(&bytes)).and_then(|()| stdout.flush());
    match done {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::new(Exit::Output, "cannot write to stdout").because(e))
        }
        _ => Ok(Exit::Done),
    }
}
