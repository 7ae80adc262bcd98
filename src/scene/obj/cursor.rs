//! Reads words, numbers and indices from a piece of text, byte by byte.

/// What a line says, by its first word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::scene) enum Statement {
    Vertex,
    Texture,
    Normal,
    Face,
    /// Nothing, or a comment.
    Blank,
    /// Anything else; the cursor stands before the word.
    Other,
}

/// A place in `text`. Reading never goes past the end of the line.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Cursor<'a> {
    text: &'a [u8],
    pos: usize,
}

const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

impl<'a> Cursor<'a> {
    pub(in crate::scene) fn new(text: &'a [u8]) -> Self {
        Self { text, pos: 0 }
    }

    /// Bytes before the cursor.
    #[inline]
    pub(in crate::scene) fn pos(&self) -> usize {
        self.pos
    }

    #[inline]
    pub(in crate::scene) fn at_end(&self) -> bool {
        self.pos >= self.text.len()
    }

    /// The next byte; a line end after the last.
    #[inline]
    fn peek(&self) -> u8 {
        self.text.get(self.pos).copied().unwrap_or(b'\n')
    }

    #[inline]
    fn peek_at(&self, ahead: usize) -> u8 {
        self.text.get(self.pos + ahead).copied().unwrap_or(b'\n')
    }

    /// Skips what separates words within a line.
    #[inline]
    fn skip_blanks(&mut self) {
        while is_blank(self.peek()) {
            self.pos += 1;
        }
    }

    /// Goes behind the first word of a line if it is one that carries geometry.
    #[inline]
    pub(in crate::scene) fn statement(&mut self) -> Statement {
        self.skip_blanks();
        let (first, second) = (self.peek(), self.peek_at(1));
        let (statement, length) = match first {
            b'v' if second <= b' ' => (Statement::Vertex, 1),
            b'f' if second <= b' ' => (Statement::Face, 1),
            b'v' if second == b't' && self.peek_at(2) <= b' ' => (Statement::Texture, 2),
            b'v' if second == b'n' && self.peek_at(2) <= b' ' => (Statement::Normal, 2),
            b'\n' | b'#' => (Statement::Blank, 0),
            _ => (Statement::Other, 0),
        };
        self.pos += length;
        statement
    }

    /// Goes to the next word of the line; `false` if there is none before the line ends or
    /// a comment begins.
    #[inline]
    pub(in crate::scene) fn more(&mut self) -> bool {
        self.skip_blanks();
        !matches!(self.peek(), b'\n' | b'#')
    }

    /// Whether a word could end here.
    #[inline]
    pub(in crate::scene) fn word_ends(&self) -> bool {
        let c = self.peek();
        c <= b' ' || c == b'#'
    }

    /// Goes behind the word under the cursor.
    #[inline]
    pub(in crate::scene) fn skip_word(&mut self) {
        while !self.word_ends() {
            self.pos += 1;
        }
    }

    /// Goes to the start of the next line.
    #[inline]
    pub(in crate::scene) fn next_line(&mut self) {
        if self.peek() == b'\n' {
            self.pos += 1;
            return;
        }
        let rest = &self.text[self.pos..];
        self.pos += memchr::memchr(b'\n', rest).map_or(rest.len(), |n| n + 1);
    }

    /// What is left of the line, the line end left out.
    pub(in crate::scene) fn line(&self) -> &'a [u8] {
        let rest = &self.text[self.pos.min(self.text.len())..];
        &rest[..memchr::memchr(b'\n', rest).unwrap_or(rest.len())]
    }

    /// The word under the cursor.
    pub(in crate::scene) fn word(&self) -> &'a [u8] {
        let line = self.line();
        &line[..line.iter().position(|&c| c <= b' ').unwrap_or(line.len())]
    }

    /// Reads a decimal number, correctly rounded. `None` if there is none; the cursor then
    /// stays somewhere in the word. What follows the number is for the caller to judge.
    #[inline]
    pub(in crate::scene) fn number(&mut self) -> Option<f64> {
        let negative = self.sign();
        let start = self.pos;
        let mut digits = 0u64;
        self.digits(&mut digits);
        let mut length = self.pos - start;
        let mut fraction = 0;
        if self.peek() == b'.' {
            self.pos += 1;
            let point = self.pos;
            self.digits(&mut digits);
            fraction = self.pos - point;
            length += fraction;
        }
        // Up to 19 digits fit 64 bits; a whole number below 2^53 and a power of ten up to
        // 10^22 are exact, so their quotient is rounded once (Clinger, PLDI 1990).
        let plain = (1..=19).contains(&length) && digits <= 1 << 53 && fraction < POWERS.len();
        let magnitude = if plain && (self.peek() | 0x20) != b'e' {
            digits as f64 / POWERS[fraction]
        } else {
            self.pos = start;
            self.any_number()?
        };
        Some(if negative { -magnitude } else { magnitude })
    }

    #[inline]
    fn sign(&mut self) -> bool {
        let c = self.peek();
        if matches!(c, b'-' | b'+') {
            self.pos += 1;
        }
        c == b'-'
    }

    #[inline]
    fn digits(&mut self, value: &mut u64) {
        while let d @ 0..=9 = self.peek().wrapping_sub(b'0') {
            *value = value.wrapping_mul(10).wrapping_add(u64::from(d));
            self.pos += 1;
        }
    }

    #[cold]
    fn any_number(&mut self) -> Option<f64> {
        // A second sign would be read as part of the number.
        if matches!(self.peek(), b'-' | b'+') {
            return None;
        }
        let (value, length) = fast_float2::parse_partial::<f64, _>(self.word()).ok()?;
        self.pos += length;
        Some(value)
    }

    /// Reads a whole number. `None` if there is none; saturates far beyond any index.
    #[inline]
    pub(in crate::scene) fn integer(&mut self) -> Option<i64> {
        let negative = self.sign();
        let start = self.pos;
        let mut value = 0;
        self.digits(&mut value);
        let value = match self.pos - start {
            0 => return None,
            1..=18 => value as i64,
            _ => i64::MAX,
        };
        Some(if negative { -value } else { value })
    }

    /// Whether the next byte is `c`, which is then skipped.
    #[inline]
    pub(in crate::scene) fn take(&mut self, c: u8) -> bool {
        let found = self.peek() == c;
        self.pos += usize::from(found);
        found
    }

    /// Whether the next byte is the slash between the indices of a corner.
    #[inline]
    pub(in crate::scene) fn at_slash(&self) -> bool {
        self.peek() == b'/'
    }

    /// How many words there are before the line ends or a comment begins. The cursor goes
    /// to the end of the line, or somewhere in the comment.
    #[inline]
    pub(in crate::scene) fn count_words(&mut self) -> u64 {
        const LINE_END: u64 = ONES * b'\n' as u64;
        let (mut count, mut before) = (0, 0);
        loop {
            let rest = &self.text[self.pos..];
            let x = match rest.first_chunk::<8>() {
                Some(bytes) => u64::from_le_bytes(*bytes),
                None => rest.iter().rev().fold(LINE_END, |x, &c| x << 8 | u64::from(c)),
            };
            let end = first_zero_byte(x ^ LINE_END) | first_zero_byte(x ^ (ONES * u64::from(b'#')));
            // Everything below the first line end or comment.
            let within = (end & end.wrapping_neg()).wrapping_sub(1);
            // The high bit of each byte above a space; a word starts where the one before has none.
            let solid = ((x & !HIGH).wrapping_add(ONES * (0x7f - u64::from(b' '))) | x) & HIGH & within;
            let starts = solid & !(solid << 8 | before);
            count += (starts >> 7).wrapping_mul(ONES) >> 56;
            if end != 0 {
                self.pos += end.trailing_zeros() as usize / 8;
                return count;
            }
            before = solid >> 56;
            self.pos += 8;
        }
    }
}

const ONES: u64 = 0x0101_0101_0101_0101;
const HIGH: u64 = 0x8080_8080_8080_8080;

/// Bits of which the lowest is the high bit of the first byte of `x` that is zero; none if
/// no byte is.
#[inline]
fn first_zero_byte(x: u64) -> u64 {
    x.wrapping_sub(ONES) & !x & HIGH
}

/// What separates words: everything up to a space, line ends apart.
#[inline]
fn is_blank(c: u8) -> bool {
    c <= b' ' && c != b'\n'
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn number(s: &str) -> Option<(f64, usize)> {
        let mut c = Cursor::new(s.as_bytes());
        c.number().map(|x| (x, c.pos()))
    }

    #[test]
    fn numbers_in_every_spelling() {
        for (text, want, length) in [
            ("0", 0.0, 1),
            ("-1.5 2", -1.5, 4),
            ("+2.", 2.0, 3),
            (".25\n", 0.25, 3),
            ("1e3", 1e3, 3),
            ("1E-3#", 1e-3, 4),
            ("123456789012345678901234567890", 123456789012345678901234567890.0, 30),
            ("0.1234567890123456789012", 0.123_456_789_012_345_68, 24),
            ("9007199254740993", 9007199254740992.0, 16),
            ("1,5", 1.0, 1),
            ("1x", 1.0, 1),
        ] {
            assert_eq!(number(text), Some((want, length)), "{text}");
        }
        assert!(number("-0").is_some_and(|(x, _)| x == 0.0 && x.is_sign_negative()));
        for text in ["", "-", ".", "+-1", "--1", "e5", "x", "\n1", "/"] {
            assert_eq!(number(text), None, "{text}");
        }
        assert!(number("1e400").is_some_and(|(x, _)| x == f64::INFINITY));
    }

    #[test]
    fn integers_and_words() {
        let mut c = Cursor::new(b"12/-3//99999999999999999999999");
        assert_eq!(c.integer(), Some(12));
        assert!(c.take(b'/'));
        assert_eq!(c.integer(), Some(-3));
        assert!(c.take(b'/') && c.take(b'/') && !c.take(b'/'));
        assert_eq!(c.integer(), Some(i64::MAX));
        assert_eq!(c.integer(), None);
        for (text, want) in [("", 0), (" a\tbb\rc ", 3), ("1 2 3#4 5", 3), ("#", 0), ("123456789 1\n2", 2)] {
            let mut c = Cursor::new(text.as_bytes());
            assert_eq!(c.count_words(), want, "{text:?}");
        }
    }

    proptest! {
        #[test]
        fn any_decimal_is_rounded_as_the_standard_library_does(
            text in "[+-]?[0-9]{1,20}(\\.[0-9]{0,24})?([eE][+-]?[0-9]{1,3})?"
        ) {
            let (got, length) = number(&text).expect("it is a number");
            prop_assert_eq!(length, text.len());
            prop_assert_eq!(got.to_bits(), text.parse::<f64>().expect("it is a number").to_bits());
        }

        #[test]
        fn words_are_counted_as_split_does(text in "[ \t\r0-9/#é-]{0,40}", more in "[ -~\n]{0,12}") {
            let cut = text.split('#').next().unwrap_or_default();
            let want = cut.split_whitespace().count() as u64;
            let whole = format!("{text}\n{more}");
            prop_assert_eq!(Cursor::new(whole.as_bytes()).count_words(), want);
            prop_assert_eq!(Cursor::new(text.as_bytes()).count_words(), want);
        }
    }
}
