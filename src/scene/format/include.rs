//! The files of one scene, joined: `include`, the format's version, and the five groups that
//! every file may add to.

use super::assets::resolve_asset;
use super::diagnostic::{Diagnostic, Source};
use super::reader::Field;
use super::tree::{Context, Entry, Node, Span, Value};
use super::{json, toml};
use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What every scene file is made of, by key; what is written below each.
pub(super) const GROUPS: [&str; 5] = ["render", "camera", "light", "material", "object"];
const KEYS: [&str; 7] = ["tison", "include", "render", "camera", "light", "material", "object"];

/// An included file is at most this long.
const MOST_BYTES: u64 = 1 << 28;
/// Includes go at most this deep.
const DEPTH: usize = 32;

/// Reads what `main` includes and joins it: the groups in the order of [`GROUPS`], in each what
/// `main` says first.
pub(super) fn join(ctx: &mut Context, main: &Arc<Source>, allow: &[PathBuf]) -> Vec<Entry> {
    let group = |key: &&str| {
        let span = Span { file: main.index, start: 0, end: 0 };
        let value = if *key == "object" { Value::Array(Vec::new()) } else { Value::Table(Vec::new()) };
        Entry { key: (*key).into(), key_span: span, node: Node { span, value } }
    };
    let mut joiner = Joiner {
        ctx,
        main: main.path.clone(),
        allow,
        root: GROUPS.iter().map(group).collect(),
        names: HashMap::new(),
        open: Vec::new(),
        seen: Vec::new(),
    };
    let real = main.path.canonicalize().unwrap_or_else(|_| main.path.clone());
    joiner.file(main, real);
    joiner.root
}

/// A file read, and its real path.
type Opened = (Arc<Source>, PathBuf);

struct Joiner<'a> {
    ctx: &'a mut Context,
    main: PathBuf,
    allow: &'a [PathBuf],
    root: Vec<Entry>,
    /// Where each name of each group was first given.
    names: HashMap<(usize, String), Span>,
    /// The files being read, each included by the one before.
    open: Vec<PathBuf>,
    seen: Vec<PathBuf>,
}

impl Joiner<'_> {
    fn file(&mut self, source: &Arc<Source>, real: PathBuf) {
        let json = source.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        let parsed = if json { json::parse(self.ctx, source) } else { toml::parse(self.ctx, source) };
        self.seen.push(real.clone());
        let Some(entries) = parsed else { return };
        check_version(self.ctx, source, &entries);
        let mut includes = None;
        for entry in entries {
            match entry.key.as_str() {
                "tison" => {}
                "include" => includes = Some(entry.node),
                key => match GROUPS.iter().position(|g| *g == key) {
                    Some(group) => self.merge(group, entry),
                    None => self.ctx.error(entry.key_span, |s| {
                        Diagnostic::error(s, format!("a scene has no key `{}`", entry.key))
                            .expected(format!("expected one of {}", KEYS.join(", ")))
                            .suggest(&entry.key, KEYS)
                    }),
                },
            }
        }
        self.open.push(real);
        if let Some(node) = includes {
            self.includes(&node);
        }
        self.open.pop();
    }

    fn merge(&mut self, group: usize, entry: Entry) {
        match (&mut self.root[group].node.value, entry.node.value) {
            (Value::Array(all), Value::Array(more)) => all.extend(more),
            (Value::Table(all), Value::Table(more)) => {
                all.reserve(more.len());
                for item in more {
                    if let Some(&first) = self.names.get(&(group, item.key.clone())) {
                        let ctx = &*self.ctx;
                        ctx.error(item.key_span, |s| {
                            let what = format!("the {} `{}` is given twice", GROUPS[group], item.key);
                            Diagnostic::error(s, what)
                                .expected("expected a name of its own")
                                .related(ctx.spot(first), "first given here")
                        });
                        continue;
                    }
                    self.names.insert((group, item.key.clone()), item.key_span);
                    all.push(item);
                }
            }
            (_, other) => self.ctx.error(entry.key_span, |s| {
                let (key, expected) = match GROUPS[group] {
                    "object" => ("object", "expected an array of tables: [[object]]".into()),
                    "render" => ("render", "expected a table: [render]".into()),
                    key => (key, format!("expected a table for each name: [{key}.NAME]")),
                };
                Diagnostic::error(s, format!("`{key}` is {}", other.kind())).expected(expected)
            }),
        }
    }

    fn includes(&mut self, node: &Node) {
        const EXPECTED: &str = "an array of file names: [\"library/metals.toml\"]";
        let Value::Array(items) = &node.value else {
            let _: Option<()> = Field::of(self.ctx, "include", node).wrong(EXPECTED);
            return;
        };
        for item in items {
            match &item.value {
                Value::String(name) => self.include(item.span, name),
                _ => drop(Field::of(self.ctx, "include", item).string("the name of a file")),
            }
        }
    }

    fn include(&mut self, span: Span, name: &str) {
        match self.open_include(span, name) {
            Ok(Some((source, real))) => self.file(&source, real),
            Ok(None) => {}
            Err((what, help)) => self.ctx.unreadable(span, |s| {
                let d = Diagnostic::error(s, what);
                if help.is_empty() { d } else { d.help(help) }
            }),
        }
    }

    /// The file `name` and its real path; `None` if it is in already. Mistakes: what, and what to do.
    fn open_include(&mut self, span: Span, name: &str) -> Result<Option<Opened>, (String, String)> {
        let written = self.ctx.folder(span.file).join(name);
        let known =
            written.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml") || e.eq_ignore_ascii_case("json"));
        if !known {
            return Err((format!("`{name}` cannot be included"), "only .toml and .json files can".into()));
        }
        let real = resolve_asset(&self.main, &written, self.allow).map_err(|e| (e.to_string(), String::new()))?;
        if let Some(from) = self.open.iter().position(|p| *p == real) {
            let chain: Vec<_> = self.open[from..].iter().chain([&real]).map(|p| short(p)).collect();
            return Err((format!("`{name}` includes itself: {}", chain.join(" -> ")), "remove one of them".into()));
        }
        if self.seen.contains(&real) {
            return Ok(None);
        }
        if self.open.len() == DEPTH {
            return Err((format!("files include each other more than {DEPTH} levels deep"), String::new()));
        }
        let text = read(&real).map_err(|e| (format!("cannot read `{name}`: {e}"), String::new()))?;
        let shown = self.main.parent().unwrap_or(Path::new("")).join(&written);
        let folder = written.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Some((self.ctx.add(shown, text, folder), real)))
    }
}

fn short(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

fn read(path: &Path) -> Result<String, String> {
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|e| e.to_string())?;
    file.take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(format!("it is longer than {} MiB", MOST_BYTES >> 20));
    }
    String::from_utf8(bytes).map_err(|e| {
        let line = 1 + memchr::memchr_iter(b'\n', &e.as_bytes()[..e.utf8_error().valid_up_to()]).count();
        format!("line {line} is not UTF-8 text")
    })
}

fn check_version(ctx: &Context, source: &Source, entries: &[Entry]) {
    const EXPECTED: &str = "expected `tison = 1`, the version of the format";
    let Some(entry) = entries.iter().find(|e| e.key == "tison") else {
        ctx.error(Span { file: source.index, start: 0, end: 0 }, |s| {
            Diagnostic::error(s, "the version of the scene format is missing").expected(EXPECTED)
        });
        return;
    };
    if !matches!(entry.node.value, Value::Number(1.0)) {
        ctx.error(entry.node.span, |s| {
            Diagnostic::error(s, "this is not version 1 of the scene format").expected(EXPECTED)
        });
    }
}
