//! Pictures compared: figures against those of other programs, and reading files.

mod figures;
mod files;
mod kit;
