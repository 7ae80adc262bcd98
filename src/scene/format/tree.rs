//! Values with their places: what TOML and JSON have in common.

use super::diagnostic::{Diagnostic, Source, Spot};
use crate::scene::desc::Place;
use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Bytes `start..end` of one of the files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    pub file: u32,
    pub start: usize,
    pub end: usize,
}

/// A value and where it is written.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub span: Span,
    pub value: Value,
}

/// A value.
#[derive(Clone, Debug)]
pub(super) enum Value {
    Bool(bool),
    Number(f64),
    String(String),
    Array(Vec<Node>),
    Table(Vec<Entry>),
    /// What no key of a scene takes: its name.
    Other(&'static str),
}

/// A key of a table and its value.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub key: String,
    pub key_span: Span,
    pub node: Node,
}

impl Value {
    /// What it is, in words.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Bool(_) => "a boolean",
            Self::Number(_) => "a number",
            Self::String(_) => "a string",
            Self::Array(_) => "an array",
            Self::Table(_) => "a table",
            Self::Other(kind) => kind,
        }
    }
}

/// More mistakes than this are counted, not kept.
const KEPT: usize = 500;
/// More mistakes than this are not shown.
const SHOWN: usize = 20;

/// The files of one scene and what is wrong with them.
#[derive(Debug, Default)]
pub(super) struct Context {
    sources: Vec<Arc<Source>>,
    /// Folder of each file, to be put before the paths it names.
    folders: Vec<PathBuf>,
    reports: RefCell<Reports>,
    unreadable: Cell<bool>,
}

#[derive(Debug, Default)]
struct Reports {
    errors: Vec<Diagnostic>,
    dropped: usize,
    warnings: Vec<Diagnostic>,
}

impl Context {
    /// Takes a file in; `folder` is put before the paths it names.
    pub fn add(&mut self, path: PathBuf, text: String, folder: PathBuf) -> Arc<Source> {
        let index = u32::try_from(self.sources.len()).expect("fewer files than memory has bytes");
        let source = Arc::new(Source::new(path, text, index));
        self.sources.push(Arc::clone(&source));
        self.folders.push(folder);
        source
    }

    pub fn source(&self, file: u32) -> &Arc<Source> {
        &self.sources[file as usize]
    }

    pub fn folder(&self, file: u32) -> &Path {
        &self.folders[file as usize]
    }

    /// Names of the files, by their index.
    pub fn paths(&self) -> Vec<PathBuf> {
        self.sources.iter().map(|s| s.path.clone()).collect()
    }

    /// The word at a place that was told by one of the files.
    pub fn word_at(&self, place: Place) -> Span {
        let range = self.source(place.file).word_at(place.line, place.column);
        Span { file: place.file, start: range.start, end: range.end }
    }

    pub fn spot(&self, span: Span) -> Spot {
        self.source(span.file).spot(span.start..span.end)
    }

    /// Keeps a mistake, made only when there is room for it: finding the nearest name costs.
    pub fn error(&self, span: Span, make: impl FnOnce(Spot) -> Diagnostic) {
        let mut reports = self.reports.borrow_mut();
        if reports.errors.len() < KEPT {
            reports.errors.push(make(self.spot(span)));
        } else {
            reports.dropped += 1;
        }
    }

    /// Keeps a mistake that leaves a file, or a part of it, unread: what else would be said of the
    /// scene might be wrong.
    pub fn unreadable(&self, span: Span, make: impl FnOnce(Spot) -> Diagnostic) {
        self.unreadable.set(true);
        self.error(span, make);
    }

    pub fn is_unreadable(&self) -> bool {
        self.unreadable.get()
    }

    pub fn warn(&self, span: Span, make: impl FnOnce(Spot) -> Diagnostic) {
        let mut reports = self.reports.borrow_mut();
        if reports.warnings.len() < KEPT {
            reports.warnings.push(make(self.spot(span)));
        }
    }

    pub fn has_errors(&self) -> bool {
        !self.reports.borrow().errors.is_empty()
    }

    /// The warnings, or the first mistakes in the order of their places; none are kept.
    pub fn finish(&self) -> Result<Vec<Diagnostic>, Vec<Diagnostic>> {
        let Reports { mut errors, mut warnings, dropped } = self.reports.take();
        if errors.is_empty() {
            warnings.sort_by_key(Diagnostic::order);
            return Ok(warnings);
        }
        errors.sort_by_key(Diagnostic::order);
        let more = errors.len().saturating_sub(SHOWN) + dropped;
        errors.truncate(SHOWN);
        if more > 0 {
            let noun = if more == 1 { "mistake" } else { "mistakes" };
            let last = errors[SHOWN - 1].clone();
            errors.push(last.into_note(format!("and {more} more {noun}")));
        }
        Err(errors)
    }
}
