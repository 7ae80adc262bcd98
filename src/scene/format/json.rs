//! JSON (RFC 8259) into values with places.

use super::diagnostic::{Diagnostic, Source, floor_boundary};
use super::tree::{Context, Entry, Node, Span, Value};
use std::collections::HashMap;

/// Deeper arrays and objects are refused; a scene needs five levels.
const DEPTH: u32 = 64;

/// The members of the one object of a document; `None` if its grammar is wrong, which `ctx` is
/// told about.
pub(super) fn parse(ctx: &Context, source: &Source) -> Option<Vec<Entry>> {
    let mut parser = Parser { text: &source.text, at: 0, file: source.index, depth: 0 };
    match parser.document() {
        Ok(entries) => Some(entries),
        Err(Fault { start, end, what, expected, first }) => {
            let span = |start, end| Span { file: source.index, start, end };
            ctx.unreadable(span(start, end), |spot| {
                let d = Diagnostic::error(spot, format!("JSON: {what}")).expected(expected);
                match first {
                    Some(s) => d.related(ctx.spot(s), "first given here"),
                    None => d,
                }
            });
            None
        }
    }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    file: u32,
    depth: u32,
}

struct Fault {
    start: usize,
    end: usize,
    what: String,
    expected: String,
    first: Option<Span>,
}

impl Parser<'_> {
    fn document(&mut self) -> Result<Vec<Entry>, Fault> {
        let node = self.value()?;
        if self.peek().is_some() {
            return Err(self.unexpected("nothing after the scene's object"));
        }
        match node.value {
            Value::Table(entries) => Ok(entries),
            other => Err(self.fault(
                node.span.start..node.span.end,
                format!("the scene is {}", other.kind()),
                "expected an object: { \"tison\": 1, … }",
            )),
        }
    }

    /// The next byte that is not white space.
    fn peek(&mut self) -> Option<u8> {
        let rest = &self.text.as_bytes()[self.at..];
        self.at += rest.iter().take_while(|b| matches!(b, b' ' | b'\t' | b'\n' | b'\r')).count();
        self.text.as_bytes().get(self.at).copied()
    }

    fn value(&mut self) -> Result<Node, Fault> {
        let first = self.peek();
        let start = self.at;
        let value = match first {
            Some(b'{') => Value::Table(self.nested(Self::object)?),
            Some(b'[') => Value::Array(self.nested(Self::array)?),
            Some(b'"') => Value::String(self.string()?),
            Some(b'-' | b'0'..=b'9') => Value::Number(self.number()?),
            Some(b'a'..=b'z' | b'A'..=b'Z') => self.word()?,
            _ => return Err(self.unexpected("a value")),
        };
        Ok(Node { span: Span { file: self.file, start, end: self.at }, value })
    }

    fn nested<T>(&mut self, inner: fn(&mut Self) -> Result<T, Fault>) -> Result<T, Fault> {
        if self.depth == DEPTH {
            let what = format!("more than {DEPTH} levels of nesting");
            return Err(self.fault(self.at..self.at + 1, what, "expected a scene, which needs five"));
        }
        self.depth += 1;
        self.at += 1;
        let all = inner(self);
        self.depth -= 1;
        all
    }

    fn array(&mut self) -> Result<Vec<Node>, Fault> {
        let mut items = Vec::new();
        if self.eat(b']') {
            return Ok(items);
        }
        loop {
            items.push(self.value()?);
            if self.eat(b']') {
                return Ok(items);
            }
            self.comma(b']', "`,` or `]`")?;
        }
    }

    fn object(&mut self) -> Result<Vec<Entry>, Fault> {
        let mut entries = Vec::new();
        let mut seen = HashMap::new();
        if self.eat(b'}') {
            return Ok(entries);
        }
        loop {
            if self.peek() != Some(b'"') {
                return Err(self.unexpected("a key in double quotes"));
            }
            let start = self.at;
            let key = self.string()?;
            let key_span = Span { file: self.file, start, end: self.at };
            if let Some(first) = seen.insert(key.clone(), key_span) {
                let what = format!("the key `{key}` is given twice");
                return Err(Fault { first: Some(first), ..self.fault(start..self.at, what, "expected each key once") });
            }
            if !self.eat(b':') {
                return Err(self.unexpected("`:` and a value"));
            }
            entries.push(Entry { key, key_span, node: self.value()? });
            if self.eat(b'}') {
                return Ok(entries);
            }
            self.comma(b'}', "`,` or `}`")?;
        }
    }

    fn eat(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    /// A comma that is not the last before `close`.
    fn comma(&mut self, close: u8, expected: &str) -> Result<(), Fault> {
        let start = self.at;
        if !self.eat(b',') {
            return Err(self.unexpected(expected));
        }
        if self.peek() == Some(close) {
            let what = "a comma after the last element".into();
            return Err(self.fault(start..start + 1, what, "expected none before the closing bracket"));
        }
        Ok(())
    }

    fn word(&mut self) -> Result<Value, Fault> {
        let start = self.at;
        let rest = &self.text[start..];
        self.at += rest.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(rest.len());
        match &self.text[start..self.at] {
            "true" => Ok(Value::Bool(true)),
            "false" => Ok(Value::Bool(false)),
            "null" => Ok(Value::Other("null")),
            word => {
                let what = format!("`{word}` is no value");
                Err(self.fault(start..self.at, what, "expected a number, true, false or a string in double quotes"))
            }
        }
    }

    /// `-? (0 | [1-9][0-9]*) (. [0-9]+)? ([eE] [+-]? [0-9]+)?`
    fn number(&mut self) -> Result<f64, Fault> {
        let start = self.at;
        let rest = &self.text[start..];
        let len =
            rest.find(|c: char| !(c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.'))).unwrap_or(rest.len());
        self.at += len;
        let number = &rest[..len];
        if !is_number(number.as_bytes()) {
            let what = format!("`{number}` is no JSON number");
            return Err(self.fault(start..self.at, what, "expected a number like 0.5, -3 or 1e-3"));
        }
        Ok(number.parse().expect("the grammar of JSON numbers is part of Rust's"))
    }

    fn string(&mut self) -> Result<String, Fault> {
        let start = self.at;
        self.at += 1;
        let mut out = String::new();
        loop {
            let rest = &self.text[self.at..];
            let stop = rest.find(|c: char| matches!(c, '"' | '\\') || c < ' ').unwrap_or(rest.len());
            out.push_str(&rest[..stop]);
            self.at += stop;
            match rest.as_bytes().get(stop) {
                Some(b'"') => {
                    self.at += 1;
                    return Ok(out);
                }
                Some(b'\\') => out.push(self.escape()?),
                Some(b'\n' | b'\r') | None => {
                    let what = "a string that does not end".into();
                    return Err(self.fault(start..self.at, what, "expected a closing `\"` on the same line"));
                }
                Some(_) => {
                    let what = "a control character in a string".into();
                    return Err(self.fault(self.at..self.at + 1, what, "expected it written as \\u00XX"));
                }
            }
        }
    }

    fn escape(&mut self) -> Result<char, Fault> {
        let start = self.at;
        self.at += 2;
        let plain = match self.text.as_bytes().get(start + 1) {
            Some(b'u') => None,
            Some(b'n') => Some('\n'),
            Some(b't') => Some('\t'),
            Some(b'r') => Some('\r'),
            Some(b'b') => Some('\u{8}'),
            Some(b'f') => Some('\u{c}'),
            Some(&b @ (b'"' | b'\\' | b'/')) => Some(char::from(b)),
            _ => {
                self.at = start + 1;
                let what = "an unknown escape in a string".into();
                return Err(self.fault(start..self.at, what, "expected \\n, \\\\, \\\" or \\uXXXX"));
            }
        };
        let code = plain.or_else(|| {
            let high = self.hex()?;
            if !(0xd800..0xdc00).contains(&high) {
                return char::from_u32(high);
            }
            let low = self.text[self.at..].starts_with("\\u").then(|| {
                self.at += 2;
                self.hex()
            })??;
            let pair = low.checked_sub(0xdc00).filter(|&l| l < 0x400)?;
            char::from_u32(0x10000 + ((high - 0xd800) << 10) + pair)
        });
        code.ok_or_else(|| {
            let end = floor_boundary(self.text, start + 6);
            self.fault(start..end, "no character has this number".into(), "expected \\u and four hexadecimal digits")
        })
    }

    fn hex(&mut self) -> Option<u32> {
        let digits = self.text.get(self.at..self.at + 4)?;
        let code = u32::from_str_radix(digits, 16).ok().filter(|_| !digits.starts_with('+'))?;
        self.at += 4;
        Some(code)
    }

    fn unexpected(&mut self, expected: &str) -> Fault {
        let found = self.peek();
        let c = self.text[self.at..].chars().next();
        let what = match (c, found) {
            (None, _) => "the file ends too early".into(),
            (_, Some(b'/' | b'#')) => "a comment, which JSON does not have".into(),
            (Some(c), _) if c.is_control() => format!("unexpected `{}`", c.escape_unicode()),
            (Some(c), _) => format!("unexpected `{c}`"),
        };
        // At the end, where the last word ends: an empty line shows nothing.
        let start = self.at.min(self.text.trim_end().len());
        let end = start + c.map_or(0, char::len_utf8);
        self.fault(start..end, what, &format!("expected {expected}"))
    }

    fn fault(&self, range: std::ops::Range<usize>, what: String, expected: &str) -> Fault {
        Fault { start: range.start, end: range.end, what, expected: expected.into(), first: None }
    }
}

fn is_number(s: &[u8]) -> bool {
    let digits = |s: &[u8]| s.iter().take_while(|b| b.is_ascii_digit()).count();
    let s = s.strip_prefix(b"-").unwrap_or(s);
    let whole = digits(s);
    if whole == 0 || (whole > 1 && s[0] == b'0') {
        return false;
    }
    let mut s = &s[whole..];
    if let Some(rest) = s.strip_prefix(b".") {
        let fraction = digits(rest);
        if fraction == 0 {
            return false;
        }
        s = &rest[fraction..];
    }
    let Some((b'e' | b'E', rest)) = s.split_first() else { return s.is_empty() };
    let rest = rest.strip_prefix(b"+").or(rest.strip_prefix(b"-")).unwrap_or(rest);
    !rest.is_empty() && digits(rest) == rest.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parse_text(text: &str) -> Result<Vec<Entry>, String> {
        let mut ctx = Context::default();
        let source = ctx.add("scene.json".into(), text.into(), "".into());
        parse(&ctx, &source).ok_or_else(|| ctx.finish().expect_err("there is a mistake")[0].to_string())
    }

    /// What serde_json reads.
    fn plain(value: &Value) -> serde_json::Value {
        match value {
            Value::Bool(b) => (*b).into(),
            Value::Number(x) => (*x).into(),
            Value::String(s) => s.clone().into(),
            Value::Array(items) => items.iter().map(|n| plain(&n.value)).collect(),
            Value::Table(entries) => entries.iter().map(|e| (e.key.clone(), plain(&e.node.value))).collect(),
            Value::Other(_) => serde_json::Value::Null,
        }
    }

    fn as_floats(value: &serde_json::Value) -> serde_json::Value {
        use serde_json::Value as J;
        match value {
            J::Number(n) => n.as_f64().into(),
            J::Array(items) => items.iter().map(as_floats).collect(),
            J::Object(map) => map.iter().map(|(k, v)| (k.clone(), as_floats(v))).collect(),
            other => other.clone(),
        }
    }

    fn documents() -> impl Strategy<Value = serde_json::Value> {
        let leaf = prop_oneof![
            any::<bool>().prop_map(Into::into),
            any::<f64>().prop_filter("finite", |x| x.is_finite()).prop_map(Into::into),
            any::<i32>().prop_map(Into::into),
            ".*".prop_map(Into::into),
            Just(serde_json::Value::Null),
        ];
        let any = leaf.prop_recursive(4, 32, 6, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..6).prop_map(Into::into),
                prop::collection::btree_map(".*", inner, 0..6)
                    .prop_map(|m| serde_json::Value::Object(m.into_iter().collect())),
            ]
        });
        prop::collection::btree_map(".{0,8}", any, 0..6).prop_map(|m| m.into_iter().collect())
    }

    proptest! {
        #[test]
        fn agrees_with_serde_json(doc in documents(), pretty: bool) {
            let text = if pretty { serde_json::to_string_pretty(&doc) } else { serde_json::to_string(&doc) };
            let text = text.expect("it is a value");
            let ours = parse_text(&text).map_err(TestCaseError::fail)?;
            prop_assert_eq!(plain(&Value::Table(ours)), as_floats(&doc));
        }

        #[test]
        fn refuses_what_serde_json_refuses(text in r#"\{"a":[-+0-9.eE"\\uUdDcC\[\]{}:,a-f null]{0,12}\}"#) {
            let theirs = serde_json::from_str::<serde_json::Value>(&text);
            let ours = parse_text(&text);
            // Duplicate keys and numbers past f64 are where we differ, on purpose.
            let twice = ours.as_ref().is_err_and(|e| e.contains("twice"));
            let huge = theirs.as_ref().is_err_and(|e| e.to_string().contains("out of range"));
            prop_assert!(twice || huge || ours.is_ok() == theirs.is_ok(), "{:?} {:?} {}", ours, theirs, text);
        }
    }

    #[test]
    fn escapes_and_places() {
        let entries = parse_text("{ \"k\\u00e9\" : \"\\ud83d\\ude00\\n\\/\" }").expect("it is good");
        assert_eq!(entries[0].key, "ké");
        assert!(matches!(&entries[0].node.value, Value::String(s) if s == "\u{1F600}\n/"));
        assert_eq!((entries[0].key_span.start, entries[0].key_span.end), (2, 11));
    }

    #[test]
    fn deep_nesting_is_refused_without_a_stack() {
        let deep = format!("{{\"a\":{}", "[".repeat(1_000_000));
        assert!(parse_text(&deep).expect_err("too deep").contains("64 levels"));
    }
}
