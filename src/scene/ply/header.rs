//! The header: what elements there are, how many, and what each of them has.

use super::super::Error;
use super::super::obj::excerpt;
use super::super::source::Source;
use super::number::Type;

/// How the numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    /// Least significant byte first.
    Little,
    Big,
}

/// What is at the beginning of a file.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    /// In the order of the file.
    pub(super) elements: Vec<Element>,
    /// Bytes of the header.
    pub(super) length: u64,
}

/// A kind of things.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    /// The line of the header, from 1.
    pub(super) line: u64,
}

/// What each thing of an element has.
#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// The line of the header, from 1.
    pub(super) line: u64,
}

/// One number, or a list of them with its length before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    One(Type),
    List { length: Type, item: Type },
}

impl Kind {
    /// Bytes of what is there in any case, in a binary file: the number, or the length of the list.
    pub(super) fn least_size(self) -> usize {
        match self {
            Self::One(t) | Self::List { length: t, .. } => t.size(),
        }
    }
}

impl Element {
    /// Bytes of each of them, if they have no lists.
    pub(super) fn fixed_size(&self) -> Option<u64> {
        let lists = self.properties.iter().any(|p| matches!(p.kind, Kind::List { .. }));
        (!lists).then(|| self.least_size(Encoding::Little))
    }

    /// Bytes that each of them takes at least.
    fn least_size(&self, encoding: Encoding) -> u64 {
        match encoding {
            // A digit and a blank or line end for each.
            Encoding::Ascii => 2 * self.properties.len() as u64,
            _ => self.properties.iter().map(|p| p.kind.least_size() as u64).sum(),
        }
    }

    /// The error that something is wrong with it.
    pub(super) fn wrong(&self, source: &Source, what: String) -> Error {
        Error::At { path: source.path.clone(), line: self.line, column: 1, what }
    }
}

/// Longest header that is taken for one.
const LONGEST: u64 = 1 << 20;

impl Header {
    /// Reads it and makes sure that the file is long enough for all that it promises.
    pub(super) fn read(source: &Source) -> Result<Self, Error> {
        let at = |fault: Fault| {
            let Fault { line, column, what } = fault;
            Error::At { path: source.path.clone(), line, column, what }
        };
        let (mut size, mut head) = (1 << 12, Vec::new());
        let header = loop {
            let known = source.len.min(size);
            source.bytes(0..known, &mut head)?;
            match Parser::new(&head).header().map_err(at)? {
                Ok(header) => break header,
                Err(line) if known == source.len || known == LONGEST => {
                    let why = if known < source.len { "the header is longer than 1 MiB" } else { "the file ends" };
                    return Err(at(Fault { line, column: 1, what: format!("{why} without a line 'end_header'") }));
                }
                Err(_) => size = (8 * size).min(LONGEST),
            }
        };
        header.check_length(source)?;
        Ok(header)
    }

    /// The element with this name.
    pub(super) fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }

    fn check_length(&self, source: &Source) -> Result<(), Error> {
        // The last line of a text need not end.
        let mut left = source.len - self.length + u64::from(self.encoding == Encoding::Ascii);
        for e in &self.elements {
            let least = u128::from(e.count) * u128::from(e.least_size(self.encoding));
            match u64::try_from(least).ok().and_then(|least| left.checked_sub(least)) {
                Some(rest) => left = rest,
                None => {
                    let what = format!(
                        "the file is too short for {} of element '{}', which take at least {least} bytes: \
                         {left} are left",
                        e.count, e.name
                    );
                    return Err(e.wrong(source, what));
                }
            }
        }
        Ok(())
    }
}

/// What is wrong with a line of the header.
struct Fault {
    line: u64,
    column: u64,
    what: String,
}

struct Parser<'a> {
    head: &'a [u8],
    /// Where the next line begins.
    next: usize,
    /// What ends lines: `\n`, before which there may be a `\r`; or `\r` alone, as of old.
    line_end: u8,
    line: u64,
    encoding: Option<Encoding>,
    elements: Vec<Element>,
}

impl<'a> Parser<'a> {
    fn new(head: &'a [u8]) -> Self {
        let ends = head.iter().position(|c| matches!(c, b'\r' | b'\n'));
        let old = ends.is_some_and(|at| head[at] == b'\r' && head.get(at + 1).is_some_and(|&c| c != b'\n'));
        let line_end = if old { b'\r' } else { b'\n' };
        Self { head, next: 0, line_end, line: 0, encoding: None, elements: Vec::new() }
    }

    /// The header, or the number of the line that is not all there.
    fn header(mut self) -> Result<Result<Header, u64>, Fault> {
        let magic = self.head.get(..3).is_some_and(|m| m == b"ply") && self.head.get(3).is_none_or(|&c| c <= b' ');
        if !magic {
            let first = self.head.split(|c| matches!(c, b'\r' | b'\n')).next().unwrap_or_default();
            let what = if self.head.is_empty() {
                "the file is empty".into()
            } else {
                format!("a PLY file begins with a line 'ply', not with '{}'", excerpt(first))
            };
            return Err(Fault { line: 1, column: 1, what });
        }
        loop {
            self.line += 1;
            let rest = &self.head[self.next..];
            let Some(length) = memchr::memchr(self.line_end, rest) else { return Ok(Err(self.line)) };
            self.next += length + 1;
            let words = Words { line: &rest[..length], last: 0..0, number: self.line };
            if self.statement(words)? {
                return self.finish().map(Ok);
            }
        }
    }

    /// Takes a line in; true at the end.
    fn statement(&mut self, mut words: Words<'_>) -> Result<bool, Fault> {
        match words.next() {
            None | Some(b"ply") if self.line == 1 => {}
            None | Some(b"comment" | b"obj_info") => {}
            Some(b"format") => self.format(&mut words)?,
            Some(b"element") => self.element(&mut words)?,
            Some(b"property") => self.property(&mut words)?,
            Some(b"end_header") => return Ok(true),
            Some(word) => {
                let known = "format, comment, obj_info, element, property, end_header";
                return Err(words.fault(format!("'{}' is no keyword of a PLY header: {known}", excerpt(word))));
            }
        }
        Ok(false)
    }

    fn format(&mut self, words: &mut Words<'_>) -> Result<(), Fault> {
        let encoding = match words.need("the format")? {
            b"ascii" => Encoding::Ascii,
            b"binary_little_endian" => Encoding::Little,
            b"binary_big_endian" => Encoding::Big,
            other => {
                let known = "ascii, binary_little_endian or binary_big_endian";
                return Err(words.fault(format!("'{}' is no format of a PLY file: {known}", excerpt(other))));
            }
        };
        let version = words.need("the version, 1.0,")?;
        if version != b"1.0" {
            return Err(words.fault(format!("version '{}' is not known: there is 1.0", excerpt(version))));
        }
        if self.encoding.replace(encoding).is_some() {
            return Err(words.fault("a second line 'format'".into()));
        }
        Ok(())
    }

    fn element(&mut self, words: &mut Words<'_>) -> Result<(), Fault> {
        let name = words.need("the name of the element")?;
        if self.elements.iter().any(|e| e.name.as_bytes() == name) {
            return Err(words.fault(format!("a second element '{}'", excerpt(name))));
        }
        let name = excerpt(name);
        let count = words.need("the number of them")?;
        let number = std::str::from_utf8(count).ok().and_then(|c| c.parse().ok());
        let Some(count) = number else {
            return Err(words.fault(format!("'{}' is no number of things: 0 or more are needed", excerpt(count))));
        };
        self.elements.push(Element { name, count, properties: Vec::new(), line: self.line });
        Ok(())
    }

    fn property(&mut self, words: &mut Words<'_>) -> Result<(), Fault> {
        let kind = match words.need("a type")? {
            b"list" => {
                let word = words.need("the type of its length")?;
                let length = words.number_type(word)?;
                if !length.is_whole() {
                    return Err(words.fault("the length of a list must be a whole number".into()));
                }
                let word = words.need("the type of what it lists")?;
                Kind::List { length, item: words.number_type(word)? }
            }
            word => Kind::One(words.number_type(word)?),
        };
        let name = words.need("the name of the property")?;
        let Some(element) = self.elements.last_mut() else {
            return Err(words.fault("a property before the first element".into()));
        };
        if element.properties.iter().any(|p| p.name.as_bytes() == name) {
            return Err(words.fault(format!("element '{}' has a property '{}' already", element.name, excerpt(name))));
        }
        element.properties.push(Property { name: excerpt(name), kind, line: self.line });
        Ok(())
    }

    fn finish(self) -> Result<Header, Fault> {
        let wrong = |what: &str| Fault { line: self.line, column: 1, what: what.into() };
        let encoding = self.encoding.ok_or_else(|| wrong("the header has no line 'format'"))?;
        if encoding == Encoding::Ascii && self.line_end == b'\r' {
            return Err(wrong("lines end with CR alone, as on an old Macintosh: convert them to LF"));
        }
        Ok(Header { encoding, elements: self.elements, length: self.next as u64 })
    }
}

/// The words of a line.
struct Words<'a> {
    line: &'a [u8],
    /// Where the last word is; behind the line if there was none.
    last: std::ops::Range<usize>,
    number: u64,
}

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let line = self.line;
        let rest = &line[self.last.end..];
        let start = self.last.end + rest.iter().position(|&c| c > b' ').unwrap_or(rest.len());
        let length = line[start..].iter().position(|&c| c <= b' ').unwrap_or(line.len() - start);
        self.last = start..start + length;
        (length > 0).then(|| &line[self.last.clone()])
    }

    fn need(&mut self, what: &str) -> Result<&'a [u8], Fault> {
        self.next().ok_or_else(|| self.fault(format!("the line ends where {what} should be")))
    }

    /// The type that a word names.
    fn number_type(&self, word: &[u8]) -> Result<Type, Fault> {
        Type::of(word).ok_or_else(|| self.fault(format!("'{}' is no type of numbers: {}", excerpt(word), Type::NAMES)))
    }

    /// The error that the last word is wrong.
    fn fault(&self, what: String) -> Fault {
        let before = &self.line[..self.last.start];
        let column = before.iter().filter(|&&c| c & 0xc0 != 0x80).count() as u64 + 1;
        Fault { line: self.number, column, what }
    }
}
