//! TOML into values with places.

use super::diagnostic::{Diagnostic, Source, Spot};
use super::tree::{Context, Entry, Node, Span, Value};
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The tables of a document, in the order of the file; `None` if its grammar is wrong, which
/// `ctx` is told about.
pub(super) fn parse(ctx: &Context, source: &Source) -> Option<Vec<Entry>> {
    let (table, mut errors) = DeTable::parse_recoverable(&source.text);
    errors.sort_by_key(|e| e.span().map_or(0, |range| range.start));
    let mut last_line = 0;
    for e in &errors {
        let range = e.span().unwrap_or(0..0);
        let start = range.start.min(source.text.trim_end().len());
        // What follows on the same line is mostly the same mistake again.
        let line = source.place(start).line;
        if std::mem::replace(&mut last_line, line) == line {
            continue;
        }
        let span = Span { file: source.index, start, end: range.end.max(start) };
        ctx.unreadable(span, |spot| report(spot, e.message()));
    }
    errors.is_empty().then(|| entries(table.into_inner(), source.index, 0))
}

fn report(spot: Spot, message: &str) -> Diagnostic {
    let (what, expected) = message.split_once(", expected ").unwrap_or((message, ""));
    let d = Diagnostic::error(spot, format!("TOML: {what}"));
    match (what, expected) {
        ("string values must be quoted", _) => d.expected("expected double quotes around it"),
        ("duplicate key", _) => d.expected("expected each key once"),
        (_, "" | "nothing") => d,
        _ => d.expected(format!("expected {expected}")),
    }
}

/// The value of these bytes of the source, as it would stand after a key; else what is wrong there.
pub(super) fn parse_value(source: &Source, range: Range<usize>) -> Result<Node, (Range<usize>, String)> {
    let start = range.start;
    match DeValue::parse(&source.text[range]) {
        Ok(value) => Ok(node(value, source.index, start)),
        Err(e) => {
            let range = e.span().unwrap_or(0..0);
            Err((range.start + start..range.end + start, format!("TOML: {}", e.message())))
        }
    }
}

fn entries(table: DeTable<'_>, file: u32, shift: usize) -> Vec<Entry> {
    let mut list: Vec<Entry> = table
        .into_iter()
        .map(|(key, value)| Entry {
            key_span: Span { file, start: key.span().start + shift, end: key.span().end + shift },
            key: key.into_inner().into_owned(),
            node: node(value, file, shift),
        })
        .collect();
    // The table sorts by name.
    list.sort_by_key(|e| e.key_span.start);
    list
}

fn node(value: Spanned<DeValue<'_>>, file: u32, shift: usize) -> Node {
    let span = Span { file, start: value.span().start + shift, end: value.span().end + shift };
    let value = match value.into_inner() {
        DeValue::String(s) => Value::String(s.into_owned()),
        DeValue::Boolean(b) => Value::Bool(b),
        DeValue::Integer(i) => i128::from_str_radix(i.as_str(), i.radix())
            .map_or(Value::Other("a number that is too large"), |i| Value::Number(i as f64)),
        // Both spell infinity and NaN alike; who reads a number refuses them.
        DeValue::Float(f) => f.as_str().parse().map_or(Value::Other("no number"), Value::Number),
        DeValue::Datetime(_) => Value::Other("a date"),
        DeValue::Array(a) => Value::Array(a.into_iter().map(|v| node(v, file, shift)).collect()),
        DeValue::Table(t) => Value::Table(entries(t, file, shift)),
    };
    Node { span, value }
}
