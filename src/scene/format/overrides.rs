//! `-D path.to.key=value`: keys of a scene set from the command line.

use super::diagnostic::{Diagnostic, Source};
use super::include::GROUPS;
use super::toml;
use super::tree::{Context, Entry, Node, Span, Value};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

/// One key of the scene, set from outside: `render.samples=4`, `camera.main.fov=30`,
/// `material.red.diffuse=0.2`, `object.0.center=[0, 1, 0]`, `object.ball.material=gold`.
///
/// The path names tables and keys, array elements by index from 0, objects also by name. The
/// value is TOML; a word alone is taken as a string.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Override(String);

impl From<&str> for Override {
    fn from(text: &str) -> Self {
        Self(text.into())
    }
}

impl From<String> for Override {
    fn from(text: String) -> Self {
        Self(text)
    }
}

/// Paths have at most this many parts; those of a scene have seven.
const DEPTH: usize = 16;

/// Sets what `overrides` say in the groups of a scene.
pub(super) fn apply(ctx: &mut Context, root: &mut Vec<Entry>, overrides: &[Override]) {
    for Override(text) in overrides {
        let source = ctx.add("-D".into(), text.clone(), PathBuf::new());
        if let Some((path, value)) = parse(ctx, &source) {
            set(ctx, root, &path, value);
        }
    }
}

/// A part of a path, as named and where.
struct Part {
    name: String,
    span: Span,
}

fn parse(ctx: &Context, source: &Arc<Source>) -> Option<(Vec<Part>, Node)> {
    let text = &source.text;
    let report = |range: Range<usize>, what: &str, expected: &str| {
        let span = Span { file: source.index, start: range.start, end: range.end };
        ctx.error(span, |s| Diagnostic::error(s, what).expected(format!("expected {expected}")));
        None
    };
    let mut parts = Vec::new();
    let mut at = 0;
    loop {
        let rest = &text[at..];
        let quoted = rest.starts_with('"').then(|| rest[1..].find('"')).flatten();
        let len = quoted.map_or_else(|| rest.find(['.', '=']).unwrap_or(rest.len()), |n| n + 2);
        let name = quoted.map_or_else(|| rest[..len].trim(), |n| &rest[1..=n]);
        if parts.len() == DEPTH {
            return report(at..at + len, "the path of the key is too long", "a key of the scene");
        }
        if name.is_empty() {
            return report(at..at + len, "the path of the key is not complete", "path.to.key=value");
        }
        parts.push(Part { name: name.into(), span: Span { file: source.index, start: at, end: at + len } });
        at += len;
        match text.as_bytes().get(at) {
            Some(b'.') => at += 1,
            Some(b'=') => break,
            _ => return report(at..at, "there is no value", "path.to.key=value"),
        }
    }
    let value = text[at + 1..].trim();
    let start = at + 1 + (text[at + 1..].len() - text[at + 1..].trim_start().len());
    let word = value.starts_with(char::is_alphabetic) && !value.contains(['"', '\'', '[', '{', ' ']);
    let node = match toml::parse_value(source, start..start + value.len()) {
        Ok(node) => node,
        Err(_) if word => Node {
            span: Span { file: source.index, start, end: start + value.len() },
            value: Value::String(value.into()),
        },
        Err((range, what)) => return report(range, &what, "a value as TOML writes it: 0.5, true, \"word\", [1, 2, 3]"),
    };
    Some((parts, node))
}

/// Puts `value` at `path`, making tables on the way; names of cameras, lights and materials
/// must be there already.
fn set(ctx: &Context, root: &mut Vec<Entry>, path: &[Part], value: Node) {
    let unknown = |part: &Part, what: String, valid: Vec<&str>| {
        ctx.error(part.span, |s| {
            let list = if valid.len() <= 8 { valid.join(", ") } else { format!("{}, …", valid[..8].join(", ")) };
            let d = Diagnostic::error(s, what).suggest(&part.name, valid.iter().copied());
            if list.is_empty() { d } else { d.expected(format!("expected one of {list}")) }
        });
    };
    let mut entries = root;
    let mut depth = 0;
    loop {
        let part = &path[depth];
        let found = entries.iter().position(|e| e.key == part.name);
        let named = depth == 1 && matches!(path[0].name.as_str(), "camera" | "light" | "material");
        if found.is_none() && depth == 0 {
            return unknown(part, format!("a scene has no key `{}`", part.name), GROUPS.to_vec());
        }
        if found.is_none() && named {
            let names = entries.iter().map(|e| e.key.as_str()).collect();
            return unknown(part, format!("the scene has no {} `{}`", path[0].name, part.name), names);
        }
        let index = found.unwrap_or_else(|| {
            let node = Node { span: part.span, value: Value::Table(Vec::new()) };
            entries.push(Entry { key: part.name.clone(), key_span: part.span, node });
            entries.len() - 1
        });
        let mut node = &mut entries[index].node;
        depth += 1;
        // Down through arrays, which have no keys of their own.
        while depth < path.len() && matches!(node.value, Value::Array(_)) {
            let Value::Array(items) = &mut node.value else { unreachable!("looked at above") };
            let part = &path[depth];
            let Some(index) = element(items, &part.name) else {
                let what = format!("`{}` has no element `{}`", path[depth - 1].name, part.name);
                let mut valid: Vec<_> = items.iter().filter_map(name_of).collect();
                let range = format!("0 to {}", items.len().saturating_sub(1));
                if !items.is_empty() {
                    valid.insert(0, &range);
                }
                return unknown(part, what, valid);
            };
            node = &mut items[index];
            depth += 1;
        }
        if depth == path.len() {
            *node = value;
            return;
        }
        let part = &path[depth];
        let kind = node.value.kind();
        let Value::Table(below) = &mut node.value else {
            let what = format!("`{}` is {kind}: it has no key `{}`", path[depth - 1].name, part.name);
            return unknown(part, what, Vec::new());
        };
        entries = below;
    }
}

fn element(items: &[Node], name: &str) -> Option<usize> {
    let index = name.parse().ok().filter(|&i: &usize| i < items.len());
    index.or_else(|| items.iter().position(|n| name_of(n) == Some(name)))
}

fn name_of(node: &Node) -> Option<&str> {
    let Value::Table(entries) = &node.value else { return None };
    entries.iter().find(|e| e.key == "name").and_then(|e| match &e.node.value {
        Value::String(s) => Some(s.as_str()),
        _ => None,
    })
}
