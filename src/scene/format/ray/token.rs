//! Words of the course's scene language: numbers, names, `"strings"`, `[` and `]`; `#` starts a
//! comment that goes to the end of the line.

/// A word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Token<'a> {
    Number(f64),
    Name(&'a str),
    String(&'a str),
    Open,
    Close,
    /// No word of the language, and why.
    Bad(&'static str),
    End,
}

/// A word and its bytes `start..end`; `leads` if it is the first of its line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Word<'a> {
    pub token: Token<'a>,
    pub start: usize,
    pub end: usize,
    pub leads: bool,
}

impl Token<'_> {
    /// What it is, in words.
    pub fn describe(&self) -> String {
        match self {
            Self::Number(x) => format!("number {x}"),
            Self::Name(name) => format!("name `{name}`"),
            Self::String(s) => format!("string \"{s}\""),
            Self::Open => "`[`".into(),
            Self::Close => "`]`".into(),
            Self::Bad(why) => (*why).into(),
            Self::End => "end of the file".into(),
        }
    }
}

/// Splits a text into words, one at a time.
pub(super) struct Lexer<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Lexer<'a> {
    pub fn new(text: &'a str) -> Self {
        Self { text, at: 0 }
    }

    /// The next word; [`Token::End`] for ever after the last.
    pub fn next(&mut self) -> Word<'a> {
        let leads = self.skip_blanks();
        let start = self.at;
        let rest = &self.text[start..];
        let token = match rest.as_bytes().first() {
            None => Token::End,
            Some(b'[') => self.take(1, Token::Open),
            Some(b']') => self.take(1, Token::Close),
            Some(b'"') => self.string(rest),
            Some(_) => self.bare(rest),
        };
        Word { token, start, end: self.at, leads: leads || start == 0 }
    }

    fn take(&mut self, len: usize, token: Token<'a>) -> Token<'a> {
        self.at += len;
        token
    }

    /// Whether a line end was among what was skipped.
    fn skip_blanks(&mut self) -> bool {
        let bytes = self.text.as_bytes();
        let mut crossed = false;
        while let Some(&b) = bytes.get(self.at) {
            match b {
                b'#' => self.at += memchr::memchr(b'\n', &bytes[self.at..]).unwrap_or(bytes.len() - self.at),
                b' ' | b'\t' | b'\r' | b'\n' | 0x0b | 0x0c => {
                    crossed |= b == b'\n';
                    self.at += 1;
                }
                _ => break,
            }
        }
        crossed
    }

    /// A string ends on its line: a missing quote must not swallow the rest of the scene.
    fn string(&mut self, rest: &'a str) -> Token<'a> {
        match memchr::memchr2(b'"', b'\n', &rest.as_bytes()[1..]).map(|i| i + 1) {
            Some(i) if rest.as_bytes()[i] == b'"' => self.take(i + 1, Token::String(&rest[1..i])),
            other => {
                let line = &rest[..other.unwrap_or(rest.len())];
                self.take(line.trim_end().len(), Token::Bad("a string that does not end"))
            }
        }
    }

    fn bare(&mut self, rest: &'a str) -> Token<'a> {
        let ends = |c: char| c.is_ascii_whitespace() || matches!(c, '\x0b' | '[' | ']' | '"' | '#');
        let word = &rest[..rest.find(ends).unwrap_or(rest.len())];
        self.take(word.len(), classify(word))
    }
}

fn classify(word: &str) -> Token<'_> {
    let numeric = word.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.'));
    if numeric {
        // Rust also reads `-inf` and `+nan`.
        let plain = word.bytes().all(|b| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.' | b'e' | b'E'));
        return match word.parse::<f64>() {
            Ok(x) if plain && x.is_finite() => Token::Number(x),
            Ok(_) if plain => Token::Bad("a number that is too large"),
            _ => Token::Bad("something that is no number"),
        };
    }
    if word.chars().all(|c| c.is_alphanumeric() || c == '_') {
        Token::Name(word)
    } else {
        Token::Bad("no word of a scene")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn words(text: &str) -> Vec<Token<'_>> {
        let mut lexer = Lexer::new(text);
        std::iter::from_fn(|| Some(lexer.next().token).filter(|t| *t != Token::End)).collect()
    }

    #[test]
    fn numbers_are_read_as_c_writes_them() {
        for (text, want) in [
            ("1e-3", 1e-3),
            (".5", 0.5),
            ("-.5", -0.5),
            ("5.", 5.0),
            ("+2", 2.0),
            ("1E+2", 100.0),
            ("-0", -0.0),
            ("007", 7.0),
        ] {
            assert_eq!(words(text), [Token::Number(want)], "{text}");
        }
        for text in ["1.2.3", "--1", "1e", "-", ".", "+inf", "-nan", "1e999", "0x10", "3,5", "1e5f"] {
            assert!(matches!(words(text)[..], [Token::Bad(_)]), "{text}: {:?}", words(text));
        }
        assert_eq!(words("nan"), [Token::Name("nan")]);
    }

    #[test]
    fn words_need_no_space_where_they_cannot_be_mistaken() {
        let want =
            [Token::Name("a"), Token::Open, Token::Number(1.0), Token::Close, Token::String("b # c"), Token::Name("d")];
        assert_eq!(words("a[1]\"b # c\"d# \"e\" [ é\r\n  "), want);
        assert_eq!(words("# only a comment"), []);
    }

    #[test]
    fn a_string_ends_on_its_line() {
        let found = words("Sphere 1 \"red  \nPopMatrix");
        assert_eq!(found.len(), 4);
        assert!(matches!(found[2], Token::Bad(_)) && found[3] == Token::Name("PopMatrix"));
    }

    proptest! {
        #[test]
        fn any_text_is_split_without_loss(text in r##"[-+.0-9eEa-zé\[\]"# \n\r\t€]{0,80}"##) {
            let mut lexer = Lexer::new(&text);
            let mut last = 0;
            loop {
                let w = lexer.next();
                prop_assert!(w.start >= last && w.end <= text.len() && text.get(w.start..w.end).is_some());
                last = w.end;
                if w.token == Token::End { break }
                prop_assert!(w.end > w.start);
            }
            prop_assert_eq!(last, text.len());
        }
    }
}
