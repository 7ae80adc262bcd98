//! Pictures compared: figures against those of other programs, and reading files.

#![expect(clippy::excessive_precision, reason = "figures as the other programs print them")]

mod figures;
mod files;
mod kit;
