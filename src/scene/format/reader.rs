//! Reading tables by hand: keys asked for by name, values checked, what nobody asked for
//! reported. A mistake is told to the context and gives `None`, so that reading goes on.

use super::diagnostic::Diagnostic;
use super::tree::{Context, Entry, Node, Span, Value};
use glam::DVec3;
use std::ops::RangeInclusive;

/// A table being read.
pub(super) struct Table<'a> {
    ctx: &'a Context,
    entries: &'a [Entry],
    /// What a missing key is reported at.
    name: Span,
    /// What it is, in words: "camera `main`".
    what: String,
    asked: Vec<&'static str>,
}

/// The value of a key.
#[derive(Clone, Copy)]
pub(super) struct Field<'a> {
    ctx: &'a Context,
    pub key: &'a str,
    pub node: &'a Node,
}

impl<'a> Table<'a> {
    /// Reads `node`, whose name stands at `name`.
    pub fn open(ctx: &'a Context, node: &'a Node, name: Span, what: String) -> Option<Self> {
        let Value::Table(entries) = &node.value else {
            ctx.error(node.span, |s| {
                Diagnostic::error(s, format!("{what} is {}", node.value.kind())).expected("expected a table of keys")
            });
            return None;
        };
        Some(Self { ctx, entries, name, what, asked: Vec::new() })
    }

    /// The value of `key`, if it is there.
    pub fn opt(&mut self, key: &'static str) -> Option<Field<'a>> {
        self.asked.push(key);
        let entry = self.entries.iter().find(|e| e.key == key)?;
        Some(Field { ctx: self.ctx, key: &entry.key, node: &entry.node })
    }

    /// The value of `key`; if it is missing, `expected` says what should be there.
    pub fn req(&mut self, key: &'static str, expected: &str) -> Option<Field<'a>> {
        let field = self.opt(key);
        if field.is_none() {
            // The name may have been mistyped: then the unknown key is reported, once.
            let typed = self.entries.iter().any(|e| super::suggest::nearest(&e.key, [key]).is_some());
            if !typed {
                self.ctx.error(self.name, |s| {
                    Diagnostic::error(s, format!("{} has no `{key}`", self.what))
                        .expected(format!("expected {expected}"))
                });
            }
        }
        field
    }

    /// Whether `key` is there; does not count as asking for it.
    pub fn has(&self, key: &str) -> bool {
        self.entries.iter().any(|e| e.key == key)
    }

    /// Reports the keys that were not asked for.
    pub fn finish(self) {
        for entry in self.entries.iter().filter(|e| !self.asked.contains(&e.key.as_str())) {
            self.ctx.error(entry.key_span, |s| {
                let mut known = self.asked.clone();
                known.sort_unstable();
                let d = Diagnostic::error(s, format!("{} has no key `{}`", self.what, entry.key))
                    .suggest(&entry.key, known.iter().copied());
                d.expected(format!("expected one of {}", known.join(", ")))
            });
        }
    }
}

impl<'a> Field<'a> {
    /// A field that is `node` and goes by the name `key`.
    pub fn of(ctx: &'a Context, key: &'a str, node: &'a Node) -> Self {
        Self { ctx, key, node }
    }

    /// Reports this value, saying what was expected.
    pub fn wrong<T>(&self, expected: &str) -> Option<T> {
        self.wrong_at(self.node, expected)
    }

    fn wrong_at<T>(&self, node: &Node, expected: &str) -> Option<T> {
        let subject = if std::ptr::eq(node, self.node) { "is" } else { "holds" };
        let found = match &node.value {
            Value::Number(x) if x.is_finite() => x.to_string(),
            Value::Number(_) => "no finite number".into(),
            Value::String(s) => format!("the string \"{}\"", s.escape_debug()),
            Value::Array(items) => {
                self.written(node.span).map_or_else(|| format!("an array of {} values", items.len()), str::to_owned)
            }
            other => other.kind().into(),
        };
        self.ctx.error(node.span, |s| {
            Diagnostic::error(s, format!("`{}` {subject} {found}", self.key)).expected(format!("expected {expected}"))
        });
        None
    }

    /// The text of a short value.
    fn written(&self, span: Span) -> Option<&'a str> {
        let text = &self.ctx.source(span.file).text[span.start..span.end];
        (text.len() <= 40 && !text.contains(['\n', '\r'])).then_some(text)
    }

    fn finite_at(&self, node: &Node, expected: &str) -> Option<f64> {
        match node.value {
            Value::Number(x) if x.is_finite() => Some(x),
            _ => self.wrong_at(node, expected),
        }
    }

    /// A finite number for which `good` holds; `expected` says which those are.
    pub fn number(&self, expected: &str, good: impl Fn(f64) -> bool) -> Option<f64> {
        let x = self.finite_at(self.node, expected)?;
        if good(x) { Some(x) } else { self.wrong(expected) }
    }

    /// A finite number above 0.
    pub fn positive(&self) -> Option<f64> {
        self.number("a number above 0", |x| x > 0.0)
    }

    /// A finite number, at least 0.
    pub fn not_negative(&self) -> Option<f64> {
        self.number("a number that is not negative", |x| x >= 0.0)
    }

    /// A whole number.
    pub fn whole(&self, range: RangeInclusive<u32>) -> Option<u32> {
        let expected = format!("a whole number from {} to {}", range.start(), range.end());
        self.whole_at(self.node, &range, &expected)
    }

    fn whole_at(&self, node: &Node, range: &RangeInclusive<u32>, expected: &str) -> Option<u32> {
        let x = self.finite_at(node, expected)?;
        let bounds = f64::from(*range.start())..=f64::from(*range.end());
        if x.fract() == 0.0 && bounds.contains(&x) { Some(x as u32) } else { self.wrong_at(node, expected) }
    }

    /// `true` or `false`.
    pub fn bool(&self) -> Option<bool> {
        match self.node.value {
            Value::Bool(b) => Some(b),
            _ => self.wrong("true or false"),
        }
    }

    /// A string.
    pub fn string(&self, expected: &str) -> Option<&'a str> {
        match &self.node.value {
            Value::String(s) => Some(s),
            _ => self.wrong(expected),
        }
    }

    /// One of some words.
    pub fn choice<T: Copy>(&self, words: &[(&str, T)]) -> Option<T> {
        let list = || words.iter().map(|(w, _)| format!("\"{w}\"")).collect::<Vec<_>>().join(" or ");
        let word = self.string(&list())?;
        let found = words.iter().find(|(w, _)| *w == word).map(|&(_, value)| value);
        if found.is_none() {
            self.ctx.error(self.node.span, |s| {
                Diagnostic::error(s, format!("`{}` cannot be \"{}\"", self.key, word.escape_debug()))
                    .expected(format!("expected {}", list()))
                    .suggest(word, words.iter().map(|(w, _)| *w))
            });
        }
        found
    }

    /// Exactly `N` finite numbers.
    pub fn numbers<const N: usize>(&self, expected: &str) -> Option<[f64; N]> {
        let items = match &self.node.value {
            Value::Array(items) if items.len() == N => items,
            _ => return self.wrong(expected),
        };
        let mut out = [0.0; N];
        let mut good = true;
        for (x, item) in out.iter_mut().zip(items) {
            match self.finite_at(item, "a finite number") {
                Some(found) => *x = found,
                None => good = false,
            }
        }
        good.then_some(out)
    }

    /// A point or direction.
    pub fn vec3(&self) -> Option<DVec3> {
        self.numbers("3 numbers: [x, y, z]").map(DVec3::from_array)
    }

    /// Linear RGB, one number being grey; nothing negative.
    pub fn color(&self) -> Option<[f64; 3]> {
        const EXPECTED: &str = "a colour: [red, green, blue], or one number for grey";
        if let Value::Number(_) = self.node.value {
            return self.number(EXPECTED, |x| x >= 0.0).map(|x| [x; 3]);
        }
        let rgb = self.numbers(EXPECTED)?;
        if rgb.iter().all(|&x| x >= 0.0) { Some(rgb) } else { self.wrong("a colour without negative parts") }
    }

    /// Width and height, each at most `most`.
    pub fn size(&self, most: u32) -> Option<(u32, u32)> {
        let items = match &self.node.value {
            Value::Array(items) if items.len() == 2 => items,
            _ => return self.wrong("2 whole numbers: [width, height]"),
        };
        let expected = format!("a whole number of pixels from 1 to {most}");
        let side = |i: usize| self.whole_at(&items[i], &(1..=most), &expected);
        let (width, height) = (side(0), side(1));
        Some((width?, height?))
    }
}
