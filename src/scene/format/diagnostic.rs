//! Mistakes in a scene file, and how they are shown: place, source line, caret, what was
//! expected, and the nearest name that would have been right.

use crate::scene::desc::Place;
use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The scene cannot be used.
    Error,
    /// The scene can be used, but probably says what was not meant.
    Warning,
    /// More about the others.
    Note,
}

/// Whether to colour a message for a terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Text alone.
    Plain,
    /// With ANSI colours.
    Coloured,
}

/// One mistake, or something to know, at a place of a scene file.
///
/// `Display` gives one line, `FILE:LINE:COL: error: what`; [`Diagnostic::render`] shows the
/// source line as a compiler does.
#[derive(Clone, Debug)]
pub struct Diagnostic {
    /// How bad it is.
    pub severity: Severity,
    /// What is wrong.
    pub message: String,
    /// What would have been right, said beside the caret.
    pub expected: Option<String>,
    /// The valid name nearest to the one written.
    pub suggestion: Option<String>,
    /// What to do.
    pub help: Option<String>,
    spot: Spot,
    related: Option<(Spot, String)>,
}

impl Diagnostic {
    pub(super) fn new(severity: Severity, spot: Spot, message: impl Into<String>) -> Self {
        let message = message.into();
        Self { severity, message, expected: None, suggestion: None, help: None, spot, related: None }
    }

    pub(super) fn error(spot: Spot, message: impl Into<String>) -> Self {
        Self::new(Severity::Error, spot, message)
    }

    pub(super) fn warning(spot: Spot, message: impl Into<String>) -> Self {
        Self::new(Severity::Warning, spot, message)
    }

    pub(super) fn expected(mut self, what: impl Into<String>) -> Self {
        self.expected = Some(what.into());
        self
    }

    pub(super) fn help(mut self, what: impl Into<String>) -> Self {
        self.help = Some(what.into());
        self
    }

    pub(super) fn suggest<'a>(mut self, written: &str, valid: impl IntoIterator<Item = &'a str>) -> Self {
        self.suggestion = super::suggest::nearest(written, valid).map(str::to_owned);
        self
    }

    pub(super) fn related(mut self, spot: Spot, what: impl Into<String>) -> Self {
        self.related = Some((spot, what.into()));
        self
    }

    /// A remark at the same place.
    pub(super) fn into_note(self, message: String) -> Self {
        Self::new(Severity::Note, self.spot, message)
    }

    /// The file at fault, as it was given; an override on the command line shows as `-D`.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.spot.source.path
    }

    /// Where it starts.
    #[must_use]
    pub fn place(&self) -> Place {
        self.spot.source.place(self.spot.range.start)
    }

    /// Where it ends: the place of the first character that is no longer part of it.
    #[must_use]
    pub fn end(&self) -> Place {
        self.spot.source.place(self.spot.range.end)
    }

    /// What places are sorted by.
    pub(super) fn order(&self) -> (u32, usize) {
        (self.spot.source.index, self.spot.range.start)
    }

    /// The message with its source line, for people; ends without a line end.
    #[must_use]
    pub fn render(&self, look: Look) -> String {
        let renderer = match look {
            Look::Plain => Renderer::plain(),
            Look::Coloured => Renderer::styled(),
        };
        renderer.decor_style(DecorStyle::Ascii).render(&self.groups())
    }

    fn groups(&self) -> Vec<Group<'_>> {
        let level = match self.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
            Severity::Note => return vec![Group::with_title(Level::NOTE.primary_title(&*self.message))],
        };
        let title = Group::with_title(level.clone().primary_title(&*self.message));
        let mut groups = self.spot.show(title, level, self.expected.as_deref().unwrap_or_default());
        let main = groups.last_mut().expect("there is what shows the place");
        if let Some(name) = &self.suggestion {
            *main = main.clone().element(Level::HELP.message(format!("did you mean `{name}`?")));
        }
        if let Some(help) = &self.help {
            *main = main.clone().element(Level::HELP.message(&**help));
        }
        if let Some((spot, what)) = &self.related {
            let title = Group::with_title(Level::NOTE.secondary_title(&**what));
            groups.extend(spot.show(title, Level::NOTE, ""));
        }
        groups
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        let Place { line, column, .. } = self.place();
        write!(f, "{}:{line}:{column}: {severity}: {}", self.path().display(), self.message)?;
        if let Some(expected) = &self.expected {
            write!(f, "; {expected}")?;
        }
        if let Some(name) = &self.suggestion {
            write!(f, "; did you mean `{name}`?")?;
        }
        if let Some(help) = &self.help {
            write!(f, "; {help}")?;
        }
        Ok(())
    }
}

/// A part of a text.
#[derive(Clone, Debug)]
pub(super) struct Spot {
    source: Arc<Source>,
    range: Range<usize>,
}

/// The last place between two characters up to `at`. (The standard library's came with Rust 1.91.)
pub(super) fn floor_boundary(text: &str, at: usize) -> usize {
    let at = at.min(text.len());
    (0..=at).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0)
}

/// Lines longer than this are shown in part.
const LONG_LINE: usize = 400;

impl Spot {
    fn origin(&self) -> Origin<'_> {
        let place = self.source.place(self.range.start);
        Origin::path(self.source.path.to_string_lossy()).line(place.line as usize).char_column(place.column as usize)
    }

    /// Adds the line to `group`, with a caret below the part; a part that goes on over the line's
    /// end is cut there.
    fn show<'a>(&'a self, group: Group<'a>, level: Level<'a>, label: &'a str) -> Vec<Group<'a>> {
        let text = &self.source.text;
        if text.is_empty() {
            let group = group.element(self.origin());
            return vec![if label.is_empty() { group } else { group.element(Level::NOTE.message(label)) }];
        }
        let (number, line) = self.source.line(self.range.start);
        let (from, to) = if line.len() <= LONG_LINE { (line.start, line.end) } else { self.window(&line) };
        let start = self.range.start.min(to) - from;
        let end = self.range.end.clamp(from + start, to) - from;
        let label = (!label.is_empty()).then_some(label);
        let snippet = Snippet::source(&text[from..to])
            .line_start(number)
            .annotation(AnnotationKind::Primary.span(start..end).label(label));
        if from == line.start {
            return vec![group.element(snippet.path(self.source.path.to_string_lossy()))];
        }
        // The column would be counted from where the line was cut.
        vec![group.element(self.origin()), Group::with_level(level).element(snippet)]
    }

    /// Part of a long line around this part.
    fn window(&self, line: &Range<usize>) -> (usize, usize) {
        let text = &self.source.text;
        let from = floor_boundary(text, self.range.start.saturating_sub(60)).max(line.start);
        (from, floor_boundary(text, self.range.start + 60).min(line.end))
    }
}

/// Every so many bytes the characters up to there are known.
const STEP: usize = 1024;

/// A text with a name, and where its lines start.
pub(super) struct Source {
    /// Shown in messages.
    pub path: PathBuf,
    /// The text, without a byte order mark.
    pub text: String,
    /// Which of the scene's files this is.
    pub index: u32,
    lines: Vec<usize>,
    /// Characters before each multiple of [`STEP`] bytes; empty when all are one byte.
    chars: Vec<usize>,
}

impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Source").field("path", &self.path).field("bytes", &self.text.len()).finish_non_exhaustive()
    }
}

impl Source {
    pub fn new(path: PathBuf, mut text: String, index: u32) -> Self {
        if text.starts_with('\u{feff}') {
            text.drain(..'\u{feff}'.len_utf8());
        }
        let lines = std::iter::once(0).chain(memchr::memchr_iter(b'\n', text.as_bytes()).map(|i| i + 1)).collect();
        let chars = if text.is_ascii() { Vec::new() } else { count_chars(&text) };
        Self { path, text, index, lines, chars }
    }

    pub fn spot(self: &Arc<Self>, range: Range<usize>) -> Spot {
        Spot { source: Arc::clone(self), range }
    }

    /// Line number, from 1, and the bytes of the line around `at`, its end left out.
    fn line(&self, at: usize) -> (usize, Range<usize>) {
        let number = self.lines.partition_point(|&start| start <= at);
        let start = self.lines[number - 1];
        let end = self.lines.get(number).map_or(self.text.len(), |next| next - 1);
        let body = self.text[start..end].trim_end_matches('\r');
        (number, start..start + body.len())
    }

    /// Where byte `at` is.
    pub fn place(&self, at: usize) -> Place {
        let at = at.min(self.text.len());
        let number = self.lines.partition_point(|&start| start <= at);
        let column = self.chars_before(at) - self.chars_before(self.lines[number - 1]) + 1;
        let clip = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        Place { file: self.index, line: clip(number), column: clip(column) }
    }

    /// The bytes of the word at a line and column: what is in quotes or brackets there as far as the line
    /// goes, or up to the next blank.
    pub fn word_at(&self, line: u32, column: u32) -> Range<usize> {
        let line = (line as usize).clamp(1, self.lines.len());
        let (_, body) = self.line(self.lines[line - 1]);
        let rest = &self.text[body.clone()];
        let skipped = (column as usize).saturating_sub(1);
        let start = rest.char_indices().nth(skipped).map_or(rest.len(), |(i, _)| i);
        let word = &rest[start..];
        let length = match word.chars().next() {
            Some(quote @ ('"' | '\'')) => word[1..].find(quote).map(|i| i + 2),
            Some('[') => word.rfind(']').map(|i| i + 1),
            Some('{') => word.rfind('}').map(|i| i + 1),
            _ => word.find(char::is_whitespace),
        };
        let start = body.start + start;
        start..start + length.unwrap_or(word.len())
    }

    fn chars_before(&self, at: usize) -> usize {
        let Some(known) = self.chars.get(at / STEP) else { return at };
        known + starts(&self.text.as_bytes()[at / STEP * STEP..at])
    }
}

/// Bytes that start a character.
fn starts(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&b| b & 0xc0 != 0x80).count()
}

fn count_chars(text: &str) -> Vec<usize> {
    let mut sum = 0;
    let mut before = vec![0];
    before.extend(text.as_bytes().chunks(STEP).map(|chunk| {
        sum += starts(chunk);
        sum
    }));
    before
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn source(text: &str) -> Arc<Source> {
        Arc::new(Source::new("scene.toml".into(), text.into(), 0))
    }

    #[test]
    fn a_message_looks_like_a_compilers() {
        let text = "a = 1\r\nmatérial = \"gld\"  \r\nb = 2";
        let start = text.find("\"gld").expect("it is there");
        let d = Diagnostic::error(source(text).spot(start..start + 5), "no material is called `gld`")
            .expected("expected the name of a material")
            .suggest("gld", ["gold", "glass"]);
        let want = "\
error: no material is called `gld`
 --> scene.toml:2:12
  |
2 | matérial = \"gld\"  
  |            ^^^^^ expected the name of a material
  |
  = help: did you mean `gold`?";
        assert_eq!(d.render(Look::Plain), want);
        assert_eq!(
            d.to_string(),
            "scene.toml:2:12: error: no material is called `gld`; expected the name of a material; did you mean `gold`?"
        );
        assert!(d.render(Look::Coloured).contains("\x1b["));
        assert_eq!((d.end().line, d.end().column), (2, 17));
    }

    #[test]
    fn a_long_line_is_shown_in_part_with_its_true_column() {
        let text = format!("{}é{} bad {}", "x".repeat(100_000), "y".repeat(2000), "z".repeat(100_000));
        let start = text.find("bad").expect("it is there");
        let shown = Diagnostic::error(source(&text).spot(start..start + 3), "wrong").render(Look::Plain);
        assert!(shown.contains("scene.toml:1:102003"), "{shown}");
        assert!(shown.contains("^^^") && shown.len() < 600, "{shown}");
    }

    #[test]
    fn the_word_at_a_place() {
        let s = source("a = 1\né [[object]] \"a b.obj\" x\n\tMesh 'c' {a = {}} # }\n\"open");
        let word = |line, column| &s.text[s.word_at(line, column)];
        for (line, column, want) in [
            (2, 3, "[[object]]"),
            (2, 14, "\"a b.obj\""),
            (2, 24, "x"),
            (3, 2, "Mesh"),
            (3, 7, "'c'"),
            (3, 11, "{a = {}} # }"),
            (4, 1, "\"open"),
            (2, 99, ""),
            (99, 1, "\"open"),
            (0, 0, "a"),
        ] {
            assert_eq!(word(line, column), want, "{line}:{column}");
        }
    }

    #[test]
    fn both_places_of_a_clash_are_shown() {
        let s = source("red = 1\nred = 2");
        let d = Diagnostic::error(s.spot(8..11), "`red` twice").related(s.spot(0..3), "first defined here");
        let shown = d.render(Look::Plain);
        assert!(shown.contains("scene.toml:2:1") && shown.contains("scene.toml:1:1"), "{shown}");
    }

    proptest! {
        #[test]
        fn places_count_characters(text in "[aé€\u{1F600}\r\n ]{0,40}", repeat in 1..60_usize, cut in 0.0..1.0_f64) {
            let text = text.repeat(repeat);
            let at = floor_boundary(&text, (cut * text.len() as f64) as usize);
            let line = text[..at].matches('\n').count() + 1;
            let column = text[..at].chars().rev().take_while(|&c| c != '\n').count() + 1;
            let place = source(&text).place(at);
            prop_assert_eq!((place.line as usize, place.column as usize), (line, column));
            let end = floor_boundary(&text, at + 2);
            prop_assert!(!Diagnostic::error(source(&text).spot(at..end), "x").render(Look::Plain).is_empty());
        }
    }
}
