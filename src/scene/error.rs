//! What can be wrong with a scene or a file it names, said so that a user can act on it.

use super::format::Diagnostic;
use std::path::{Path, PathBuf};
use std::{fmt, io};

/// A file that cannot be made into a scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused, or the file changed meanwhile.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: io::Error,
    },
    /// A directory where a file was expected.
    #[error("{} is a directory: name a file in it", path.display())]
    NotAFile {
        /// The directory.
        path: PathBuf,
    },
    /// Something in the text. Lines and columns count from 1, columns in characters.
    #[error("{}:{line}:{column}: {what}", path.display())]
    At {
        /// The file.
        path: PathBuf,
        /// Line.
        line: u64,
        /// Column of the offending word.
        column: u64,
        /// What is wrong, and what was expected.
        what: String,
    },
    /// Something in a file that is no text, or with the file as a whole.
    #[error("{}: {what}", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        what: String,
    },
    /// A mesh file with nothing to see in it.
    #[error("{}: no renderable faces: {why}", path.display())]
    NoFaces {
        /// The file.
        path: PathBuf,
        /// What it holds instead.
        why: String,
    },
    /// A file names another one outside the folders it may read from.
    #[error(
        "{}:{line}: {} is outside the folder of the mesh that needs it and is not read; \
         copy it into that folder and name it there, or allow its folder with --allow-path {}",
        path.display(), target.display(), target.parent().unwrap_or(target).display()
    )]
    Forbidden {
        /// The file that names it.
        path: PathBuf,
        /// Line of the statement.
        line: u64,
        /// What it names, links resolved.
        target: PathBuf,
    },
    /// Faces, but none that a ray could meet.
    #[error("{}: none of its {faces} triangles can be hit: they have no area or lie out of range", path.display())]
    NothingToHit {
        /// The file.
        path: PathBuf,
        /// Triangles in it.
        faces: usize,
    },
    /// The second OBJ reader does not read what the first one may well do.
    #[error("{}:{} tobj cannot read it: {what}", path.display(), line.map(|line| format!("{line}:")).unwrap_or_default())]
    SecondReader {
        /// The file.
        path: PathBuf,
        /// The line, from 1, where it is known.
        line: Option<u64>,
        /// What is wrong.
        what: String,
    },
    /// More of something than 32-bit numbers can index.
    #[error("{}: {count} {what}, but at most {limit} can be indexed: split the file", path.display())]
    TooMany {
        /// The file.
        path: PathBuf,
        /// What there is too much of.
        what: &'static str,
        /// How many.
        count: u64,
        /// How many would do.
        limit: u64,
    },
    /// More in a pipe or compressed file than there is memory for.
    #[error("{}: it does not fit into memory: more than {:.1} GB of it are read already", path.display(), *read as f64 / 1e9)]
    NoRoom {
        /// The file.
        path: PathBuf,
        /// Bytes that were read, unpacked.
        read: u64,
    },
    /// More than there is memory for, found out before it was stored.
    #[error(
        "{}: {what} takes at least {} of memory, but {} are free",
        path.display(), rounded(*needed), rounded(*free)
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// What of it.
        what: String,
        /// Bytes that it takes at least.
        needed: u64,
        /// Bytes that can be had.
        free: u64,
    },
    /// A scene file with mistakes in it, in the order of their places.
    #[error("{}", in_short(.0))]
    Scene(Vec<Diagnostic>),
    /// The caller asked to stop.
    #[error("stopped on request")]
    Cancelled,
}

/// Bytes as people read them.
fn rounded(bytes: u64) -> String {
    match bytes {
        0..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}

/// One line a mistake.
fn in_short(list: &[Diagnostic]) -> String {
    list.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// Something odd that did not stop the reading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The file.
    pub path: PathBuf,
    /// Line of the first occurrence, from 1; absent where the whole file is meant.
    pub line: Option<u64>,
    /// What was found and what was made of it; says how many more there are.
    pub what: String,
}

impl Warning {
    /// A warning about the whole of `path`.
    #[must_use]
    pub fn about(path: &Path, what: String) -> Self {
        Self { path: path.to_owned(), line: None, what }
    }

    /// A warning about something on `line` of `path`.
    #[must_use]
    pub fn at(path: &Path, line: u64, what: String) -> Self {
        Self { path: path.to_owned(), line: Some(line), what }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:", self.path.display())?;
        if let Some(line) = self.line {
            write!(f, "{line}:")?;
        }
        write!(f, " {}", self.what)
    }
}
