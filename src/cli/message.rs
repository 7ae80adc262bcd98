//! Errors and warnings: what, where, what to do; the source line with a caret.

use super::VERSION;
use super::args::Cli;
use super::exit::{Exit, Failure, Place};
use super::notice::Notice;
use super::style::{Style, counted};
use clap::CommandFactory;
use std::error::Error;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use tison::scene::is_packed;

/// Warnings shown unless all are asked for.
const FEW: usize = 5;

/// Writes to stderr. A stderr that is closed is nobody's loss.
#[derive(Clone, Copy, Debug)]
pub struct Messages {
    style: Style,
}

impl Messages {
    /// For this process's stderr.
    pub fn new() -> Self {
        Self { style: Style::of_stderr() }
    }

    /// A line as it is.
    pub fn line(&self, text: &str) {
        let _ = writeln!(io::stderr().lock(), "{text}");
    }

    /// The first few notices as warnings, or all; `more` says how to see the others.
    pub fn warnings(&self, notices: &[Notice], all: bool, more: &str) {
        let (shown, hidden) = notices.split_at(if all { notices.len() } else { notices.len().min(FEW) });
        shown.iter().for_each(|n| self.line(&n.told(false, self.style)));
        if !hidden.is_empty() {
            self.warning(&format!("and {} more ({more})", hidden.len()));
        }
    }

    /// All notices, as the errors that `--strict` makes of them.
    pub fn strict(&self, notices: &[Notice]) -> Result<(), Failure> {
        notices.iter().for_each(|n| self.line(&n.told(true, self.style)));
        match notices.len() as u64 {
            0 => Ok(()),
            n => {
                let what = format!(
                    "{}, which --strict takes for {}",
                    counted(n, "warning"),
                    if n == 1 { "an error" } else { "errors" }
                );
                Err(Failure::new(Exit::Input, what))
            }
        }
    }

    /// One warning.
    pub fn warning(&self, text: &str) {
        self.line(&format!("{} {text}", self.style.warning("warning:")));
    }

    /// Why the run did not end well.
    pub fn failure(&self, failure: &Failure) {
        self.line(&describe(failure, self.style));
    }
}

fn describe(failure: &Failure, style: Style) -> String {
    let mut out = format!("{} {}", style.error("error:"), failure.what);
    match &failure.place {
        Place::Unknown => {}
        Place::Text(path, line, column) => {
            out.extend(source_line(path, *line).map(|text| excerpt(&text, *line, *column, style)));
        }
        Place::Line(text, line, column) => out += &excerpt(text, *line, *column, style),
        Place::Scene(list) => out = list.iter().map(|d| d.render(style.look())).collect::<Vec<_>>().join("\n\n"),
    }
    let mut cause = failure.cause.as_deref().map(|e| e as &dyn Error);
    while let Some(e) = cause {
        out += &format!("\n  caused by: {e}");
        cause = e.source();
    }
    if let Some(help) = &failure.help {
        out += &format!("\n  help: {help}");
    }
    out
}

/// Most characters of a source line that are shown.
const WIDTH: usize = 100;
/// Most bytes of a line that are looked at: a file without line ends is not read whole.
const LONGEST_LINE: u64 = 1 << 20;

/// ```text
///    |
/// 12 | f 1 2 9
///    |       ^
/// ```
fn excerpt(text: &str, line: u64, column: u64, style: Style) -> String {
    let at = usize::try_from(column.max(1) - 1).unwrap_or(usize::MAX);
    // Tabs and what cannot be shown count as one column each, so the caret stays in place.
    let shown: Vec<char> = text.chars().map(|c| if c == '\t' { ' ' } else { visible(c) }).collect();
    let at = at.min(shown.len());
    let first = if at < WIDTH - 20 { 0 } else { at - WIDTH / 2 };
    let window: String = shown[first..].iter().take(WIDTH).collect();
    let number = line.to_string();
    let pad = " ".repeat(number.len());
    let bar = style.margin("|");
    let caret = format!("{}{}", " ".repeat(at - first), style.error("^"));
    format!("\n{pad} {bar}\n{} {bar} {}\n{pad} {bar} {caret}", style.margin(&number), window.trim_end())
}

fn visible(c: char) -> char {
    if c.is_control() { '\u{b7}' } else { c }
}

/// Line `number` (from 1) of a file, as much of it as is sensible.
fn source_line(path: &Path, number: u64) -> Option<String> {
    if !path.is_file() || is_packed(path) {
        return None;
    }
    let mut reader = BufReader::with_capacity(1 << 16, File::open(path).ok()?);
    for _ in 1..number {
        if reader.skip_until(b'\n').ok()? == 0 {
            return None;
        }
    }
    let mut line = Vec::new();
    reader.take(LONGEST_LINE).read_until(b'\n', &mut line).ok()?;
    Some(String::from_utf8_lossy(&line).trim_end_matches(['\r', '\n']).to_owned())
}

/// The panic hook's text: what a report needs.
pub fn internal_error(panic: &str) {
    let command: Vec<_> = std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect();
    let _ = writeln!(
        io::stderr().lock(),
        "error: internal error: {panic}\n  version: tison {}\n  command: {}\n  \
         help: this is a bug in tison, not in your file. Please report it with these lines and, \
         if you can, the input; RUST_BACKTRACE=1 in the environment adds where it came from.\n{}",
        *VERSION,
        command.join(" "),
        std::backtrace::Backtrace::capture(),
    );
}

/// The candidate nearest to `name`, if it is near enough to be a slip.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let allowed = 1 + name.chars().count() / 3;
    let scored = candidates.into_iter().map(|c| (edits(name, c), c));
    scored.filter(|&(d, _)| d <= allowed).min_by_key(|&(d, _)| d).map(|(_, c)| c)
}

/// A hint at the file or command that was meant, if `missing` is not there.
pub fn nearest_input(missing: &Path) -> Option<String> {
    if missing.exists() {
        return None;
    }
    let file = nearest_file(missing).map(|file| file.display().to_string());
    let command = || {
        let cli = Cli::command();
        let commands = cli.get_subcommands().map(clap::Command::get_name);
        nearest(missing.to_str()?, commands).map(|c| format!("tison {c}"))
    };
    file.or_else(command).map(|near| format!("did you mean {near}?"))
}

/// The file whose name is nearest to that of `missing`, in the same folder.
fn nearest_file(missing: &Path) -> Option<PathBuf> {
    let folder = missing.parent().filter(|p| !p.as_os_str().is_empty());
    let name = missing.file_name()?.to_str()?;
    let entries = std::fs::read_dir(folder.unwrap_or(Path::new("."))).ok()?;
    let names: Vec<String> = entries.filter_map(|e| e.ok()?.file_name().into_string().ok()).collect();
    let near = nearest(name, names.iter().map(String::as_str))?;
    Some(folder.map_or_else(|| PathBuf::from(near), |f| f.join(near)))
}

/// Insertions, deletions and replacements between two words (Wagner & Fischer 1974).
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, cb) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_names() {
        let views = ["front", "back", "left", "right", "three-quarter"];
        assert_eq!(nearest("frnt", views), Some("front"));
        assert_eq!(nearest("threequarter", views), Some("three-quarter"));
        assert_eq!(nearest("elephant", views), None);
        assert_eq!(edits("kitten", "sitting"), 3);
        assert_eq!(edits("", "abc"), 3);
    }

    #[test]
    fn a_place_is_shown_with_a_caret() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.obj");
        std::fs::write(&path, "v 0 0 0\nf\t1 2 x9\r\n").unwrap();
        let failure = Failure {
            place: Place::Text(path, 2, 7),
            ..Failure::new(Exit::Input, "a.obj:2:7: not an index").help("fix it")
        };
        let text = describe(&failure, Style::of_stderr());
        assert!(text.ends_with("a.obj:2:7: not an index\n  |\n2 | f 1 2 x9\n  |       ^\n  help: fix it"), "{text}");
    }

    #[test]
    fn a_place_that_is_not_there_is_left_out() {
        for (path, line) in [("/no/such/file", 1), ("/dev/zero", 3)] {
            let failure = Failure { place: Place::Text(path.into(), line, 1), ..Failure::new(Exit::Input, "gone") };
            assert_eq!(describe(&failure, Style::of_stderr()), "error: gone");
        }
    }

    #[test]
    fn a_long_line_is_cut_around_the_caret() {
        let line = "x".repeat(500) + "y" + &"z".repeat(500);
        let shown = excerpt(&line, 7, 501, Style::of_stderr());
        let lines: Vec<&str> = shown.lines().collect();
        assert!(lines[2].len() <= WIDTH + 4);
        let caret = lines[3].find('^').unwrap();
        assert_eq!(lines[2].as_bytes()[caret], b'y');
    }

    #[test]
    fn every_cause_is_told() {
        let inner = io::Error::other(io::Error::new(io::ErrorKind::NotFound, "the disk left"));
        let text = describe(&Failure::new(Exit::Output, "cannot write").because(inner), Style::of_stderr());
        assert_eq!(text, "error: cannot write\n  caused by: the disk left");
    }
}
