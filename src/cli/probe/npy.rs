//! The header of NumPy's `.npy` files.
//!
//! Source: NumPy, "NEP 1: A Simple File Format for NumPy Arrays".

use std::fmt::Write;

const MAGIC: &[u8; 6] = b"\x93NUMPY";
/// More than any header of two numbers has.
const LONGEST: usize = 1 << 16;

/// Numbers of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Float {
    F4,
    F8,
}

/// What a header says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Bytes of the header itself.
    pub bytes: usize,
    pub float: Float,
    pub rows: u64,
    pub columns: usize,
}

impl Float {
    pub fn size(self) -> usize {
        match self {
            Self::F4 => 4,
            Self::F8 => 8,
        }
    }
}

/// The header that `bytes` begin with; nothing while it is not there as a whole. Errors say what was expected.
pub fn header(bytes: &[u8]) -> Result<Option<Header>, String> {
    let start = bytes.len().min(MAGIC.len());
    if bytes[..start] != MAGIC[..start] {
        return Err("these are not the bytes of a .npy file; expected what numpy.save writes".into());
    }
    let Some(&major) = bytes.get(6) else { return Ok(None) };
    let (length, at) = match (major, bytes.get(8..10), bytes.get(8..12)) {
        (1, Some(&[a, b]), _) => (usize::from(u16::from_le_bytes([a, b])), 10),
        (2 | 3, _, Some(&[a, b, c, d])) => (u32::from_le_bytes([a, b, c, d]) as usize, 12),
        (1..=3, ..) => return Ok(None),
        _ => return Err(format!("version {major} of .npy is not known; expected 1, 2 or 3")),
    };
    if length > LONGEST {
        return Err("the header has no end; expected a few words about the array".into());
    }
    let Some(text) = bytes.get(at..at + length) else { return Ok(None) };
    let text = std::str::from_utf8(text).map_err(|_| "the header is no text; expected that of an array of floats")?;
    let (rows, columns) = shape(value(text, "shape")?)?;
    let float = match quoted(value(text, "descr")?) {
        Some("<f4") => Float::F4,
        Some("<f8") => Float::F8,
        _ => return Err("the numbers are not little-endian float32 or float64 ('<f4' or '<f8')".into()),
    };
    if value(text, "fortran_order")?.starts_with("True") {
        return Err("the array is in Fortran order; expected C order: numpy.ascontiguousarray(rays)".into());
    }
    Ok(Some(Header { bytes: at + length, float, rows, columns }))
}

/// What follows `'key':`.
fn value<'a>(text: &'a str, key: &str) -> Result<&'a str, String> {
    let found = ["'", "\""].iter().find_map(|quote| text.split_once(&format!("{quote}{key}{quote}")));
    let after = found.and_then(|(_, after)| after.trim_start().strip_prefix(':'));
    after.map(str::trim_start).ok_or_else(|| format!("the header of the array says nothing about its {key}"))
}

fn quoted(text: &str) -> Option<&str> {
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    text[1..].split_once(quote).map(|(word, _)| word)
}

fn shape(text: &str) -> Result<(u64, usize), String> {
    let inner = text.strip_prefix('(').and_then(|t| t.split_once(')')).map(|(inner, _)| inner);
    let sizes = inner.map(|t| t.split(',').map(str::trim).filter(|s| !s.is_empty()).map(str::parse::<u64>));
    match sizes.map(Iterator::collect::<Result<Vec<_>, _>>) {
        Some(Ok(sizes)) => match *sizes {
            [rows, columns @ 6..=8] => Ok((rows, columns as usize)),
            _ => Err(format!(
                "the array has the shape {sizes:?}; expected rows of 6, 7 or 8: ox oy oz dx dy dz [tmin [tmax]]"
            )),
        },
        _ => Err("the header of the array has a shape that cannot be read".into()),
    }
}

/// A header of `rows` records of this kind, a list as NumPy writes it.
pub fn written(descr: &str, rows: u64) -> Vec<u8> {
    let mut text = String::new();
    write!(text, "{{'descr': {descr}, 'fortran_order': False, 'shape': ({rows},), }}")
        .expect("a string takes everything");
    // Magic, version, length and text together fill whole units, the last byte being the end of the line.
    const UNIT: usize = 64;
    let length = (10 + text.len() + 1).next_multiple_of(UNIT) - 10;
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend(u16::try_from(length).expect("a header of a few hundred bytes").to_le_bytes());
    bytes.extend(format!("{text:<0$}\n", length - 1).bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(version: u8, text: &str) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([version, 0]);
        match version {
            1 => bytes.extend((text.len() as u16).to_le_bytes()),
            _ => bytes.extend((text.len() as u32).to_le_bytes()),
        }
        bytes.extend(text.bytes());
        bytes
    }

    #[test]
    fn headers_are_read_once_they_are_whole() {
        let text = "{'descr': '<f8', 'fortran_order': False, 'shape': (12, 6), }   \n";
        for version in 1..=3 {
            let bytes = file(version, text);
            for cut in 0..bytes.len() {
                assert_eq!(header(&bytes[..cut]), Ok(None), "{cut}");
            }
            let want = Header { bytes: bytes.len(), float: Float::F8, rows: 12, columns: 6 };
            assert_eq!(header(&[&bytes[..], b"rest"].concat()), Ok(Some(want)));
        }
    }

    #[test]
    fn others_are_refused_in_words() {
        let of = |descr: &str, order: &str, shape: &str| {
            file(1, &format!("{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}\n"))
        };
        for (bytes, says) in [
            (b"{\"o\": 1}".to_vec(), "numpy.save"),
            (of("'>f8'", "False", "(1, 6)"), "little-endian"),
            (of("'<i8'", "False", "(1, 6)"), "float32 or float64"),
            (of("[('o', '<f8')]", "False", "(1, 6)"), "float32 or float64"),
            (of("'<f4'", "True", "(1, 6)"), "ascontiguousarray"),
            (of("'<f4'", "False", "(6,)"), "[6]; expected rows of 6, 7 or 8"),
            (of("'<f4'", "False", "(3, 9)"), "[3, 9]"),
            (of("'<f4'", "False", "(x, 9)"), "cannot be read"),
            (file(1, "{}"), "nothing about its shape"),
            (file(7, ""), "version 7"),
        ] {
            let error = header(&bytes).expect_err(says);
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn written_headers_fill_whole_units() {
        for rows in [0, 1, 10_000_000_000] {
            let bytes = written("[('t', '<f8')]", rows);
            assert_eq!(bytes.len() % 64, 0);
            let text = String::from_utf8_lossy(&bytes[10..]).into_owned();
            assert!(text.contains(&format!("'shape': ({rows},)")) && text.ends_with('\n'), "{text}");
        }
    }
}
