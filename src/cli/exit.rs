//! How a run ends.

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use tison::film::SaveError;
use tison::scene;
use tison::scene::format::Diagnostic;

/// Exit codes. Scripts rely on them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// All done.
    Done = 0,
    /// The render failed.
    Render = 1,
    /// Wrong usage.
    Usage = 2,
    /// A scene or asset is at fault.
    Input = 3,
    /// Output could not be written.
    Output = 4,
    /// A comparison found a difference.
    Differs = 5,
    /// Refused by a limit.
    Limit = 6,
    /// A bug of ours.
    Internal = 70,
    /// Stopped by SIGINT; a partial result is saved.
    Interrupted = 130,
    /// The same by SIGTERM.
    Terminated = 143,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// What to do where memory is short and no limit was given.
pub const MORE_MEMORY: &str = "render it where there is more memory, or a smaller mesh or image";

/// Why a run did not end well, said to the user by `message`.
#[derive(Debug)]
pub struct Failure {
    /// The code to leave with.
    pub exit: Exit,
    /// What and where.
    pub what: String,
    /// What to do.
    pub help: Option<String>,
    /// Where in a file.
    pub place: Place,
    /// The error behind it, which may have others behind it.
    pub cause: Option<Box<dyn Error + Send + Sync>>,
}

/// Where in a file something is wrong.
#[derive(Debug)]
pub enum Place {
    /// In none, or nobody knows.
    Unknown,
    /// A path, and line and column from 1.
    Text(PathBuf, u64, u64),
    /// A line of a stream, its number and the column, both from 1.
    Line(String, u64, u64),
    /// Mistakes in a scene file, which say themselves what and where.
    Scene(Vec<Diagnostic>),
}

impl Failure {
    /// A failure that says `what`.
    pub fn new(exit: Exit, what: impl Into<String>) -> Self {
        Self { exit, what: what.into(), help: None, place: Place::Unknown, cause: None }
    }

    /// Wrong usage.
    pub fn usage(what: impl Into<String>) -> Self {
        Self::new(Exit::Usage, what)
    }

    /// The same with a hint.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// The same, brought about by `cause`.
    #[must_use]
    pub fn because(mut self, cause: impl Error + Send + Sync + 'static) -> Self {
        self.cause = Some(Box::new(cause));
        self
    }
}

impl From<SaveError> for Failure {
    fn from(e: SaveError) -> Self {
        let failure = Self::new(Exit::Output, e.to_string());
        match e {
            SaveError::Write { source, .. } => failure.because(source),
            _ => failure,
        }
    }
}

impl From<scene::Error> for Failure {
    fn from(e: scene::Error) -> Self {
        let failure = Self::new(Exit::Input, e.to_string());
        match e {
            scene::Error::Read { path, source } => {
                Self { help: super::message::nearest_input(&path), ..failure.because(source) }
            }
            scene::Error::Scene(list) => Self { place: Place::Scene(list), ..failure },
            scene::Error::NoRoom { .. } => {
                Self { exit: Exit::Limit, ..failure }.help("unpack it into a file: such files are read piece by piece")
            }
            scene::Error::TooLarge { .. } => Self { exit: Exit::Limit, ..failure }.help(MORE_MEMORY),
            scene::Error::At { path, line, column, .. } => Self { place: Place::Text(path, line, column), ..failure },
            _ => failure,
        }
    }
}
