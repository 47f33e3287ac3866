//! Source texts of JSON, and the conversion of byte offsets to lines and columns.
//!
//! Promise: finding a position takes about the same time anywhere in a file, also if it is one long line. Lines end
//! at `\n`, `\r\n` or `\r`.

use super::fault::{Fault, FaultClass, code};

/// A position in a text: line, and column in characters, both from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Position {
    pub(super) line: u32,
    pub(super) column: u32,
}

/// A text that JSON is read from: a graph file, or the value of a `--set`.
pub(super) struct Text<'a> {
    pub(super) content: &'a str,
    /// The key of the `--set`.
    pub(super) set: Option<&'a str>,
    /// Byte offsets about [`STRIDE`] apart with their positions, ascending.
    marks: Vec<(usize, Position)>,
}

/// Bytes between marks: few enough to scan quickly, many enough to keep the table small.
const STRIDE: usize = 512;

impl<'a> Text<'a> {
    pub(super) fn new(content: &'a str, set: Option<&'a str>) -> Self {
        let mut marks = Vec::with_capacity(content.len() / STRIDE + 1);
        let mut next = 0;
        for (offset, position) in positions(content, Position { line: 1, column: 1 }) {
            if offset >= next {
                marks.push((offset, position));
                next = offset + STRIDE;
            }
        }
        Self { content, set, marks }
    }

    /// The position of the character that starts at byte `offset`, or of the end of the text.
    pub(super) fn position(&self, offset: usize) -> Position {
        let mark = self.marks.partition_point(|(at, _)| *at <= offset).saturating_sub(1);
        self.walk(self.marks[mark], offset)
    }

    /// The position of `offset`, given one before it.
    fn walk(&self, (start, position): (usize, Position), offset: usize) -> Position {
        let walked = positions(&self.content[start..], position);
        walked.take_while(|(at, _)| start + at <= offset).last().map_or(position, |(_, position)| position)
    }

    /// [`Text::position`] of an offset that is likely to be soon after another.
    pub(super) fn position_after(&self, before: (usize, Position), offset: usize) -> Position {
        match (before.0..=before.0 + STRIDE).contains(&offset) {
            true => self.walk(before, offset),
            false => self.position(offset),
        }
    }

    /// What this text is called in messages.
    pub(super) fn noun(&self) -> &'static str {
        if self.set.is_some() { "the value" } else { "the file" }
    }

    /// A fault at byte `offset`.
    pub(super) fn fault(&self, offset: usize, path: &str, code: &'static str, fact: impl Into<String>) -> Fault {
        let Position { line, column } = self.position(offset);
        Fault {
            code,
            line,
            column,
            path: path.to_owned(),
            fact: fact.into(),
            hint: None,
            class: FaultClass::Graph,
            set: self.set.map(Into::into),
        }
    }
}

/// Byte offset and position of every character and of the end.
fn positions(content: &str, start: Position) -> impl Iterator<Item = (usize, Position)> {
    let mut position = start;
    let end = std::iter::once((content.len(), '\0'));
    content.char_indices().chain(end).map(move |(offset, c)| {
        let here = position;
        let ends_line = c == '\n' || c == '\r' && content.as_bytes().get(offset + 1) != Some(&b'\n');
        position = match ends_line {
            true => Position { line: position.line + 1, column: 1 },
            false => Position { line: position.line, column: position.column + 1 },
        };
        (offset, here)
    })
}

/// First bytes of compressed files, and the names of their formats.
const COMPRESSED: [(&[u8], &str); 5] = [
    (b"\x1f\x8b", "gzip"),
    (b"PK\x03\x04", "zip"),
    (b"\x28\xb5\x2f\xfd", "zstd"),
    (b"\xfd7zXZ\0", "xz"),
    (b"BZh", "bzip2"),
];

/// Decodes a file: UTF-8, with or without a byte order mark, which is removed.
///
/// # Errors
/// If the bytes are not UTF-8.
pub(super) fn decode(bytes: &[u8]) -> Result<&str, Fault> {
    let whole = |fact: &str| Text::new("", None).fault(0, "", code::ENCODING, fact).hint("save it as UTF-8");
    if let Some((_, name)) = COMPRESSED.iter().find(|(start, _)| bytes.starts_with(start)) {
        let fact = format!("the file looks like {name}, expected a text file");
        return Err(Text::new("", None).fault(0, "", code::ENCODING, fact).hint("decompress it first"));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    // In UTF-16 of either byte order, one of the first two bytes of `{` or a blank is zero.
    if matches!(bytes, [0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [0, _, ..] | [_, 0, ..]) {
        return Err(whole("the file is UTF-16 or binary, expected UTF-8"));
    }
    std::str::from_utf8(bytes).map_err(|error| {
        let good = error.valid_up_to();
        let before = std::str::from_utf8(&bytes[..good]).unwrap_or_default();
        let fact = format!("the byte {:#04x} is not UTF-8", bytes[good]);
        Text::new(before, None).fault(good, "", code::ENCODING, fact).hint("save it as UTF-8")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_count_lines_and_characters_with_any_line_ending() {
        let text = Text::new("aé\nb\r\nc\rd", None);
        let at = |offset| (text.position(offset).line, text.position(offset).column);
        assert_eq!((at(0), at(1), at(3), at(4)), ((1, 1), (1, 2), (1, 3), (2, 1)));
        assert_eq!((at(7), at(9), at(10)), ((3, 1), (4, 1), (4, 2)));
    }

    #[test]
    fn positions_in_a_long_line_are_exact() {
        let content = "é".repeat(5_000) + "\n" + &"x".repeat(3_000);
        let text = Text::new(&content, None);
        assert_eq!(text.position(9_000), Position { line: 1, column: 4_501 });
        assert_eq!(text.position(10_001 + 2_999), Position { line: 2, column: 3_000 });
        assert_eq!(text.position(content.len()), Position { line: 2, column: 3_001 });
    }

    #[test]
    fn a_position_soon_after_another_is_the_same() {
        let content = "é\r\nb\n".repeat(300);
        let text = Text::new(&content, None);
        let starts: Vec<usize> = content.char_indices().map(|(at, _)| at).chain([content.len()]).collect();
        for from in starts.iter().copied().step_by(37) {
            for offset in starts.iter().copied() {
                let found = text.position_after((from, text.position(from)), offset);
                assert_eq!(found, text.position(offset), "{offset} after {from}");
            }
        }
    }

    #[test]
    fn compressed_files_are_recognised() {
        let fault = decode(b"\x1f\x8b\x08\0\0\0\0\0").unwrap_err();
        assert_eq!(fault.to_string(), "1:1: the file looks like gzip, expected a text file; decompress it first");
        assert_eq!(decode(b"PK\x03\x04").unwrap_err().fact, "the file looks like zip, expected a text file");
    }

    #[test]
    fn a_fault_of_encoding_has_a_position() {
        assert_eq!(decode("\u{feff}{}".as_bytes()), Ok("{}"));
        let fault = decode(b"{\n \xff}").unwrap_err();
        assert_eq!((fault.line, fault.column), (2, 2));
        assert_eq!(fault.fact, "the byte 0xff is not UTF-8");
        for utf_16 in [&b"\xff\xfe{\0}\0"[..], b"\xfe\xff\0{\0}", b"{\0}\0"] {
            assert_eq!(decode(utf_16).unwrap_err().fact, "the file is UTF-16 or binary, expected UTF-8");
        }
    }
}
