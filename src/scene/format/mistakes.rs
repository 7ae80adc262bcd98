//! Mistakes that turn up when the text has long been read: files that are not there, shapes that cannot be.

use super::diagnostic::Diagnostic;
use super::tree::Context;
use crate::scene::Error;
use crate::scene::desc::Place;

/// The files of a scene, and what else is found wrong with it.
#[derive(Debug)]
pub(in crate::scene) struct Mistakes(Context);

impl Mistakes {
    pub(super) fn new(ctx: Context) -> Self {
        Self(ctx)
    }

    /// Tells a mistake.
    pub(in crate::scene) fn add(&self, place: Place, what: impl Into<String>) {
        self.0.error(self.0.word_at(place), |s| Diagnostic::error(s, what));
    }

    /// Tells of a wrong name, and which of the valid ones is nearest.
    pub(in crate::scene) fn add_name(&self, place: Place, what: String, written: &str, valid: &[String]) {
        let valid = valid.iter().map(String::as_str);
        self.0.error(self.0.word_at(place), |s| Diagnostic::error(s, what).suggest(written, valid));
    }

    /// All mistakes so far, if there are any.
    pub(in crate::scene) fn check(&self) -> Result<(), Error> {
        self.0.finish().map(drop).map_err(Error::Scene)
    }
}
