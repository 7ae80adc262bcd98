//! The command line: flags as typed ([`args`]) to what a run will do ([`plan`]), the run
//! itself ([`render`]) and what it tells ([`report`]).
//!
//! stdout carries only what was asked for; everything else is on stderr.

mod args;
mod bench;
mod both;
mod camera;
mod compare;
mod config;
mod cost;
mod example;
mod exit;
mod frame;
mod info;
mod limits;
mod memory;
mod message;
mod notice;
mod output;
mod parse;
mod plan;
mod probe;
mod progress;
mod render;
mod report;
mod settings;
mod signals;
mod skipped;
mod stats;
mod style;
mod system;
mod target;
mod turntable;
mod verify;

use args::{Cli, Command};
use clap::CommandFactory;
use exit::Exit;
use message::Messages;
use std::panic::{self, AssertUnwindSafe};
use std::process::ExitCode;
use std::sync::LazyLock;

/// Version of tison and of the Embree it was built with.
pub static VERSION: LazyLock<String> = LazyLock::new(|| {
    let embree = EMBREE.map_or("without Embree".into(), |v| format!("Embree {v}"));
    format!("{} ({embree})", env!("CARGO_PKG_VERSION"))
});

/// Release of Embree's headers; nothing where it is not compiled in.
pub const EMBREE: Option<&str> = {
    let embree = env!("TISON_EMBREE");
    if cfg!(feature = "embree") && !embree.is_empty() { Some(embree) } else { None }
};

/// Runs the command that the process was started with.
pub fn main() -> ExitCode {
    panic::set_hook(Box::new(|info| message::internal_error(&info.to_string())));
    guarded(|| match Cli::from_words(std::env::args_os()) {
        Ok(cli) => run(cli),
        Err(e) => {
            // Help asked for goes to stdout, mistakes to stderr; a pipe closed early is no news.
            let _ = e.print();
            if e.use_stderr() { Exit::Usage } else { Exit::Done }
        }
    })
    .into()
}

/// A panic has been reported by the hook when it arrives here.
fn guarded(f: impl FnOnce() -> Exit) -> Exit {
    panic::catch_unwind(AssertUnwindSafe(f)).unwrap_or(Exit::Internal)
}

fn run(cli: Cli) -> Exit {
    let messages = Messages::new();
    let result = match cli.command {
        None => plan::Plan::new(&cli.render).and_then(|plan| render::render(&plan, &messages)),
        Some(Command::Render(args)) => plan::Plan::new(&args).and_then(|plan| render::render(&plan, &messages)),
        Some(Command::Info(args)) => info::info(&args, &messages),
        Some(Command::Check(args)) => info::check(&args, &messages),
        Some(Command::Verify(args)) => verify::verify(&args, &messages),
        Some(Command::Compare(args)) => compare::compare(&args, &messages),
        Some(Command::Probe(args)) => probe::probe(&args, &messages),
        Some(Command::Example { name }) => example::example(name.as_ref(), &messages),
        Some(Command::Bench { what }) => bench::bench(&what, &messages),
        Some(Command::Completions { shell }) => output::print_with(|out| {
            clap_complete::generate(shell, &mut Cli::command(), "tison", out);
            Ok(())
        }),
        Some(Command::Man) => output::print_with(|out| clap_mangen::Man::new(Cli::command()).render(out)),
    };
    result.unwrap_or_else(|failure| {
        messages.failure(&failure);
        failure.exit
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flags_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_panic_is_an_internal_error() {
        assert_eq!(guarded(|| panic!("expected by this test")), Exit::Internal);
        assert_eq!(guarded(|| Exit::Done), Exit::Done);
    }

    #[test]
    fn the_version_names_embree_or_its_absence() {
        let want = if cfg!(feature = "embree") { "(Embree 4." } else { "(without Embree)" };
        assert!(VERSION.contains(want), "{}", *VERSION);
    }
}
