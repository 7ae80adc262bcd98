//! `bench skip`: what is left out, what that saves, and the proof that it may be.

use super::ReportArgs;
use crate::cli::exit::{Exit, Failure};
use crate::cli::message::Messages;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::path::PathBuf;
use tison::backend::BackendKind;
use tison::bench::skip::{self, Error, Options, Scale};
use tison::scene::Skip;

/// What the help ends with.
pub const AFTER_HELP: &str = "\
A skip that changes what it must not, or more than its bound, makes the exit code 5. docs/skips.md says what each is.";

#[derive(Args, Debug)]
pub struct SkipArgs {
    /// Scenes or meshes to measure with, instead of a scene for each skip
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Skips to measure [default: all]
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', value_parser = skip())]
    only: Vec<Skip>,
    /// Who answers the rays
    #[arg(long, value_name = "NAME", value_parser = backend(), default_value = BackendKind::COMPILED[0].name())]
    backend: BackendKind,
    /// Rounds, of which the medians count
    #[arg(
        long, value_name = "N", default_value = "5", allow_negative_numbers = true,
        value_parser = clap::value_parser!(u16).range(1..)
    )]
    rounds: u16,
    #[command(flatten)]
    report: ReportArgs,
}

fn skip() -> impl TypedValueParser<Value = Skip> {
    PossibleValuesParser::new(Skip::ALL.iter().map(|skip| skip.name()))
        .map(|name| Skip::parse(&name).expect("only their names are possible"))
}

fn backend() -> impl TypedValueParser<Value = BackendKind> {
    PossibleValuesParser::new(BackendKind::COMPILED.iter().map(|kind| kind.name())).map(|name| {
        let kind = BackendKind::COMPILED.iter().find(|kind| kind.name() == name);
        *kind.expect("only their names are possible")
    })
}

/// Measures, tells, and complains about what changed that must not.
pub fn run(args: &SkipArgs, messages: &Messages) -> Result<Exit, Failure> {
    args.report.check()?;
    let options = Options {
        files: args.files.clone(),
        skips: if args.only.is_empty() { Skip::ALL.to_vec() } else { args.only.clone() },
        backend: args.backend,
        rounds: usize::from(args.rounds),
        scale: Scale::Full,
    };
    let measured = skip::run(&options, &|skip| messages.line(&format!("measuring {skip}")));
    let measured = measured.map_err(|e| match e {
        Error::Load(e) => e.into(),
        Error::Camera(_) => Failure::new(Exit::Input, e.to_string()),
        e => Failure::new(Exit::Render, "cannot measure").because(e),
    })?;
    let told = args.report.tell(&measured.report, messages)?;
    match measured.broken.as_slice() {
        [] => Ok(told),
        broken => Err(Failure::new(Exit::Differs, format!("a skip changes the picture: {}", broken.join("; ")))),
    }
}
