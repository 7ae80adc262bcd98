//! A reader of one line of JSON (RFC 8259) that makes no tree and knows its columns.
//!
//! `Infinity` and `-Infinity` are read as well: Python writes them.

use std::borrow::Cow;

/// What is wrong, and at which byte of the line.
#[derive(Debug, PartialEq)]
pub struct Fault {
    pub at: usize,
    pub what: String,
}

pub type Read<T> = Result<T, Fault>;

impl Fault {
    pub fn new(at: usize, what: impl Into<String>) -> Self {
        Self { at, what: what.into() }
    }
}

/// A value and where it begins.
#[derive(Clone, Copy, Debug)]
pub struct At<T> {
    pub at: usize,
    pub value: T,
}

pub struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The next byte that is not white space, if there is one.
    pub fn peek(&mut self) -> Option<u8> {
        while let Some(b' ' | b'\t' | b'\r' | b'\n') = self.bytes.get(self.at) {
            self.at += 1;
        }
        self.bytes.get(self.at).copied()
    }

    /// Where the next value begins.
    pub fn place(&mut self) -> usize {
        self.peek();
        self.at
    }

    /// Nothing follows.
    pub fn end(&mut self) -> Read<()> {
        if self.peek().is_some() { Err(self.unexpected("one object a line")) } else { Ok(()) }
    }

    /// `read` is called for each key of an object, to read its value.
    pub fn object(&mut self, what: &str, mut read: impl FnMut(&mut Self, At<&'a [u8]>) -> Read<()>) -> Read<()> {
        if !self.eat(b'{') {
            return Err(self.unexpected(what));
        }
        if self.eat(b'}') {
            return Ok(());
        }
        loop {
            if self.peek() != Some(b'"') {
                return Err(self.unexpected("a key in double quotes"));
            }
            let key = self.text()?;
            if !self.eat(b':') {
                return Err(self.unexpected("`:` and a value"));
            }
            read(self, key)?;
            if self.eat(b'}') {
                return Ok(());
            }
            if !self.eat(b',') {
                return Err(self.unexpected("`,` or `}`"));
            }
        }
    }

    /// Exactly `N` values in brackets.
    pub fn list<T: Copy + Default, const N: usize>(
        &mut self,
        what: &str,
        read: impl FnMut(&mut Self) -> Read<T>,
    ) -> Read<[T; N]> {
        let start = self.place();
        let mut all = [T::default(); N];
        match self.values(what, &mut all, read)? {
            0 => Err(Fault::new(start, format!("no values; expected {what}"))),
            n if n < N => Err(Fault::new(start, format!("{n} values; expected {what}"))),
            _ => Ok(all),
        }
    }

    /// As many numbers in brackets as there are, up to the length of `all`; how many there are.
    pub fn up_to(&mut self, what: &str, all: &mut [f64]) -> Read<usize> {
        self.values(what, all, Self::number)
    }

    fn values<T>(&mut self, what: &str, all: &mut [T], mut read: impl FnMut(&mut Self) -> Read<T>) -> Read<usize> {
        let start = self.place();
        if !self.eat(b'[') {
            return Err(self.unexpected(what));
        }
        let mut count = 0;
        if self.eat(b']') {
            return Ok(count);
        }
        loop {
            match all.get_mut(count) {
                Some(slot) => *slot = read(self)?,
                None => return Err(Fault::new(start, format!("more than {count} values; expected {what}"))),
            }
            count += 1;
            if self.eat(b']') {
                return Ok(count);
            }
            if !self.eat(b',') {
                return Err(self.unexpected("`,` or `]`"));
            }
        }
    }

    /// A finite number.
    pub fn number(&mut self) -> Read<f64> {
        let start = self.place();
        let value = self.any_number()?;
        if value.is_finite() { Ok(value) } else { Err(self.bad(start, "expected a finite number")) }
    }

    /// A number, or infinity.
    pub fn any_number(&mut self) -> Read<f64> {
        let start = self.place();
        let rest = &self.bytes[start..];
        for (word, value) in [(&b"Infinity"[..], f64::INFINITY), (b"-Infinity", f64::NEG_INFINITY)] {
            if rest.starts_with(word) {
                self.at += word.len();
                return Ok(value);
            }
        }
        let length = number_length(rest);
        self.at += length;
        match fast_float2::parse::<f64, _>(&rest[..length]) {
            Ok(value) if length > 0 && !self.in_word() && value.is_finite() => Ok(value),
            Ok(value) if value.is_infinite() => Err(self.bad(start, "it is beyond the largest f64, 1.8e308")),
            _ => {
                self.at = start;
                Err(self.unexpected("a number"))
            }
        }
    }

    pub fn boolean(&mut self) -> Read<bool> {
        for (word, value) in [(&b"true"[..], true), (b"false", false)] {
            if self.word(word) {
                return Ok(value);
            }
        }
        Err(self.unexpected("true or false"))
    }

    /// Whether `null` is next; it is read then.
    pub fn null(&mut self) -> bool {
        self.word(b"null")
    }

    /// What is between double quotes, escapes as they are written: no key or name of ours has any.
    pub fn text(&mut self) -> Read<At<&'a [u8]>> {
        let at = self.place();
        if !self.eat(b'"') {
            return Err(self.unexpected("a word in double quotes"));
        }
        let start = self.at;
        loop {
            match self.bytes.get(self.at) {
                None => return Err(Fault::new(at, "a string that does not end; expected a closing `\"`")),
                Some(b'"') => break,
                Some(b'\\') => self.at += 2,
                Some(_) => self.at += 1,
            }
        }
        let value = &self.bytes[start..self.at];
        self.at += 1;
        Ok(At { at, value })
    }

    fn eat(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    fn word(&mut self, word: &[u8]) -> bool {
        let start = self.place();
        let found = self.bytes[start..].starts_with(word);
        self.at += if found { word.len() } else { 0 };
        found && !self.in_word()
    }

    /// Whether what was read goes on with a letter or digit.
    fn in_word(&self) -> bool {
        self.bytes.get(self.at).is_some_and(|b| b.is_ascii_alphanumeric() || matches!(b, b'.' | b'+' | b'-'))
    }

    /// What was read from `start` on is wrong.
    fn bad(&self, start: usize, expected: &str) -> Fault {
        Fault::new(start, format!("{} is no number here: {expected}", shown(&self.bytes[start..self.at])))
    }

    fn unexpected(&mut self, expected: &str) -> Fault {
        let at = self.place();
        let found = match self.bytes.get(at) {
            None => "the line ends too early".to_owned(),
            Some(b'"') => "unexpected string".to_owned(),
            Some(_) => {
                let rest = &self.bytes[at..];
                let word = rest.iter().take_while(|b| b.is_ascii_alphanumeric() || b"+-._".contains(b)).count();
                format!("unexpected {}", shown(&rest[..word.max(character_length(rest))]))
            }
        };
        Fault::new(at, format!("{found}; expected {expected}"))
    }
}

/// Bytes of a message that are quoted.
const LONGEST: usize = 40;

/// Bytes of the input as part of a message.
pub fn shown(bytes: &[u8]) -> String {
    let text: Cow<'_, str> = String::from_utf8_lossy(&bytes[..bytes.len().min(LONGEST)]);
    let text: String = text.chars().map(|c| if c.is_control() { '\u{b7}' } else { c }).collect();
    format!("`{text}{}`", if bytes.len() > LONGEST { "…" } else { "" })
}

/// Bytes of the first character.
fn character_length(bytes: &[u8]) -> usize {
    1 + bytes.iter().skip(1).take(3).take_while(|&&b| b & 0xc0 == 0x80).count()
}

/// Bytes of the number that `bytes` begin with: `-? (0 | [1-9][0-9]*) (. [0-9]+)? ([eE] [+-]? [0-9]+)?`
fn number_length(bytes: &[u8]) -> usize {
    let digits = |from: usize| bytes[from.min(bytes.len())..].iter().take_while(|b| b.is_ascii_digit()).count();
    let start = usize::from(bytes.first() == Some(&b'-'));
    let mut at = match digits(start) {
        0 => return 0,
        // What follows a leading zero is no longer part of it.
        _ if bytes[start] == b'0' => start + 1,
        n => start + n,
    };
    if bytes.get(at) == Some(&b'.') {
        match digits(at + 1) {
            0 => return 0,
            n => at += 1 + n,
        }
    }
    if let Some(b'e' | b'E') = bytes.get(at) {
        let sign = usize::from(matches!(bytes.get(at + 1), Some(b'+' | b'-')));
        match digits(at + 1 + sign) {
            0 => return 0,
            n => at += 1 + sign + n,
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn number(text: &str) -> Read<f64> {
        let mut reader = Reader::new(text.as_bytes());
        let value = reader.number()?;
        reader.end().map(|()| value)
    }

    proptest! {
        #[test]
        fn numbers_are_read_to_the_last_bit(bits: u64) {
            let x = f64::from_bits(bits);
            prop_assume!(x.is_finite());
            for text in [format!("{x:e}"), format!("{x:?}"), format!("{x:.17e}")] {
                prop_assert_eq!(number(&text).map(f64::to_bits), Ok(bits), "{}", text);
            }
        }

        #[test]
        fn agrees_with_serde_json(text in r"[-+0-9.eE]{0,8}") {
            let theirs = serde_json::from_str::<f64>(&text);
            prop_assert_eq!(number(&text).ok(), theirs.ok().filter(|x| x.is_finite()), "{}", text);
        }

        #[test]
        fn no_bytes_are_too_much(bytes in prop::collection::vec(any::<u8>(), 0..60)) {
            let mut reader = Reader::new(&bytes);
            let read = reader.object("an object", |reader, _| reader.list::<_, 2>("two", Reader::any_number).map(drop));
            prop_assert!(read.is_ok() || read.is_err_and(|fault| fault.at <= bytes.len()));
        }
    }

    #[test]
    fn places_are_those_of_what_is_wrong() {
        let fault = |text: &str| {
            let mut reader = Reader::new(text.as_bytes());
            let read = reader.object("an object", |r, _| r.list::<_, 3>("[x, y, z]", Reader::number).map(drop));
            read.and_then(|()| reader.end()).map_err(|f| (f.at, f.what)).expect_err("it is wrong")
        };
        for (text, at, says) in [
            ("[1]", 0, "unexpected `[`; expected an object"),
            ("{\"o\": [1, 2]}", 6, "2 values; expected [x, y, z]"),
            ("{\"o\": []}", 6, "no values; expected [x, y, z]"),
            ("{\"o\": [1, 2, 3, 4]}", 6, "more than 3 values"),
            ("{\"o\": [1, NaN, 3]}", 10, "unexpected `NaN`; expected a number"),
            ("{\"o\": [1, Infinity, 3]}", 10, "`Infinity` is no number here: expected a finite number"),
            ("{\"o\": [1, 1e999, 3]}", 10, "`1e999` is no number here: it is beyond"),
            ("{\"o\": [1, 01, 3]}", 10, "unexpected `01`"),
            ("{\"o\": [1, 2, 3]", 15, "the line ends too early; expected `,` or `}`"),
            ("{\"o\": [1, 2, 3]} {", 17, "expected one object a line"),
            ("{\"o: [1, 2, 3]}", 1, "a string that does not end"),
            ("{o: 1}", 1, "unexpected `o`; expected a key in double quotes"),
            ("{\"é\" 1}", 6, "expected `:` and a value"),
        ] {
            let (found, what) = fault(text);
            assert!(found == at && what.contains(says), "{text}: {found} {what}");
        }
    }
}
