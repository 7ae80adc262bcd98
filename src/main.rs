//! The command `tison`: parse, run, say what went wrong, leave with the exit code.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
