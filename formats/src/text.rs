//! Shared by the text readers: detection of other file types, lines, fields, numbers.

use engine::geometry::Name;

use crate::{FilePosition, Format, FormatError};

/// First bytes of other file types that often have a wrong extension, their names, and hints.
const FOREIGN: [(&[u8], &str, &str); 17] = [
    (b"\xff\xfe", UTF_16, AS_UTF_8),
    (b"\xfe\xff", UTF_16, AS_UTF_8),
    (b"\x1f\x8b", "gzip data", UNPACK),
    (b"PK\x03\x04", "a zip archive", UNPACK),
    (b"BZh", "bzip2 data", UNPACK),
    (b"\xfd7zXZ\0", "xz data", UNPACK),
    (b"\x28\xb5\x2f\xfd", "zstd data", UNPACK),
    (b"PXR-USDC", "a USD file", CONVERT),
    (b"#usda", "a USD file", CONVERT),
    (b"Ogawa", "an Alembic file", CONVERT),
    (b"\x89HDF", "an HDF5 or Alembic file", CONVERT),
    (b"glTF", "a glTF file", CONVERT),
    (b"Kaydara FBX", "an FBX file", CONVERT),
    (b"\x7fNSJ", "a bgeo file", CONVERT),
    (b"BLENDER", "a Blender file", CONVERT),
    (b"<!DOCTYPE", "a web page", "download the file itself, not the page about it"),
    (b"<html", "a web page", "download the file itself, not the page about it"),
];
const UTF_16: &str = "UTF-16 text";
const AS_UTF_8: &str = "save it as UTF-8";
const UNPACK: &str = "decompress it first";
const CONVERT: &str = "convert it to obj, ply or json first";

/// The bytes of a file of `format`, without a UTF-8 byte order mark.
///
/// # Errors
/// If the file is empty or its first bytes are those of another file type.
pub(crate) fn opened(format: Format, bytes: &[u8]) -> Result<&[u8], FormatError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let fact = |what: &str| format!("this is {what}, expected {format}");
    if bytes.is_empty() {
        return Err(FormatError::with_hint(FilePosition::File, "the file is empty", "write the file again"));
    }
    if let Some((_, what, hint)) = FOREIGN.iter().find(|(magic, ..)| bytes.starts_with(magic)) {
        return Err(FormatError::with_hint(FilePosition::File, fact(what), hint));
    }
    // Without a mark, every other byte of the first characters is zero.
    if let [0, 1..=127, 0, 1..=127, ..] | [1..=127, 0, 1..=127, 0, ..] = bytes {
        return Err(FormatError::with_hint(FilePosition::File, fact(UTF_16), AS_UTF_8));
    }
    let other = match bytes {
        [b'p', b'l', b'y', b'\n' | b'\r', ..] => Format::Ply,
        [b'{', ..] => Format::Json,
        _ => format,
    };
    if other != format {
        let hint = "rename the file with the extension of its format";
        return Err(FormatError::with_hint(FilePosition::File, fact(&format!("a {other} file")), hint));
    }
    Ok(bytes)
}

/// The byte that ends lines: a line feed, or a carriage return if the text contains no line feed.
pub(crate) fn line_end(text: &[u8]) -> u8 {
    if text.contains(&b'\n') { b'\n' } else { b'\r' }
}

/// The lines of a text with their numbers; a carriage return before a line feed counts as space at its end.
pub(crate) struct Lines<'a> {
    rest: &'a [u8],
    end: u8,
    number: usize,
}

impl<'a> Lines<'a> {
    /// Lines of `text`, numbered from `first`.
    pub(crate) fn new(text: &'a [u8], first: usize, end: u8) -> Self {
        Self { rest: text, end, number: first - 1 }
    }

    /// Number of the last line returned.
    pub(crate) fn number(&self) -> usize {
        self.number
    }

    /// The bytes not read yet.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.number += 1;
        let length = self.rest.iter().position(|byte| *byte == self.end).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(length);
        self.rest = rest.get(1..).unwrap_or(&[]);
        Some(line)
    }
}

/// The fields of a line, separated by white space.
#[derive(Clone)]
pub(crate) struct Fields<'a>(pub(crate) &'a [u8]);

impl<'a> Iterator for Fields<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let start = self.0.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let text = &self.0[start..];
        let length = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
        let (field, rest) = text.split_at(length);
        self.0 = rest;
        Some(field)
    }
}

/// The nearest f32 of a decimal number; infinite if it is too large, NaN for `nan`; `None` if it is not a number.
pub(crate) fn float(field: &[u8]) -> Option<f32> {
    std::str::from_utf8(field).ok()?.parse().ok()
}

/// A field as messages show it: shortened, with control characters escaped.
pub(crate) fn shown(field: &[u8]) -> String {
    const LONGEST: usize = 40;
    let cut = &field[..field.len().min(LONGEST)];
    let dots = if cut.len() < field.len() { "…" } else { "" };
    format!("`{}{dots}`", String::from_utf8_lossy(cut).escape_debug())
}

/// `1 row`, `2 rows`.
pub(crate) fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// `name`, with underscores appended until `taken` is false.
pub(crate) fn free_name(name: &str, taken: impl Fn(&str) -> bool) -> Name {
    let mut name = name.to_owned();
    while taken(&name) {
        name.push('_');
    }
    name.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn line_endings_are_detected() {
        let lines = |text: &'static [u8]| Lines::new(text, 1, line_end(text)).collect::<Vec<_>>();
        assert_eq!(lines(b"a\nb"), [&b"a"[..], b"b"]);
        assert_eq!(lines(b"a\r\n\r\nb\r\n"), [&b"a\r"[..], b"\r", b"b\r"]);
        assert_eq!(lines(b"a\rb\r"), [&b"a"[..], b"b"]);
        assert!(lines(b"").is_empty());
    }

    #[test]
    fn any_white_space_separates_fields() {
        assert_eq!(Fields(b"  v\t1  2\r").collect::<Vec<_>>(), [&b"v"[..], b"1", b"2"]);
        assert_eq!(Fields(b" \t\r").next(), None);
    }

    #[test]
    fn a_shown_field_is_short_and_printable() {
        assert_eq!(shown(b"1,5"), "`1,5`");
        assert_eq!(shown(b"a\0\xff"), "`a\\0\u{fffd}`");
        assert_eq!(shown(&[b'7'; 50]), format!("`{}…`", "7".repeat(40)));
    }
}
