//! How much memory parsing a text takes.

use super::Format;

/// Bytes that parsing `text` holds at once, at least. Measured with 100 k spheres: 306 to 400 bytes for each mark in
/// TOML and 136 in JSON, the text included; what has none, long comments, takes the text twice.
pub fn memory_needed(format: Option<Format>, text: &[u8]) -> u64 {
    let each = match format {
        Some(Format::Toml) => 250,
        Some(Format::Json) => 100,
        Some(Format::Ray) | None => 0,
    };
    let marks = if each > 0 { marks(text) } else { 0 };
    2 * text.len() as u64 + each * marks
}

/// What separates keys and values, outside of strings and comments; a string of several lines is taken for several.
fn marks(text: &[u8]) -> u64 {
    let (mut count, mut quote, mut comment) = (0, None, false);
    let mut escaped = false;
    for &c in text {
        match (c, quote) {
            (b'\n', _) => (quote, comment) = (None, false),
            _ if comment => {}
            (b'#', None) => comment = true,
            (b'"' | b'\'', None) => quote = Some(c),
            (b'=' | b':' | b',' | b'[' | b'{', None) => count += 1,
            (_, Some(end)) if c == end && !escaped => quote = None,
            _ => {}
        }
        escaped = c == b'\\' && !escaped;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_counted_where_they_mean_something() {
        for (text, want) in [
            ("a = [1, 2]", 3),
            ("# a = [1, 2]\nb = 3", 1),
            (r#"{"a": ["x,y:\",", {"b": 1}]}"#, 6),
            (r#"a = "C:\\" # , = "#, 1),
            ("a = 'it\"s, # no'\nb = 1", 2),
            ("", 0),
        ] {
            assert_eq!(marks(text.as_bytes()), want, "{text}");
        }
        assert_eq!(memory_needed(Some(Format::Toml), b"a = [1, 2]"), 20 + 750);
        assert_eq!(memory_needed(Some(Format::Ray), b"Sphere 1 [1,2]"), 28);
    }
}
