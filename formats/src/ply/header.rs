//! The header of a PLY file: its elements, their numbers of rows and their properties.

use std::collections::BTreeSet;

use crate::text::{Fields, Lines, line_end, shown};
use crate::{FilePosition, FormatError};

/// How numbers are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A type of number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    /// Bytes of a number in a binary file.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(super) fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }
}

/// What a property holds per row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    One(Scalar),
    List { count: Scalar, item: Scalar },
}

/// A column of an element.
#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) shape: Shape,
}

/// A table of the file.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) rows: usize,
    pub(super) properties: Vec<Property>,
    /// The line of its declaration.
    pub(super) line: usize,
}

impl Element {
    /// The fewest bytes that a row takes in that encoding, spaces and line end included.
    pub(super) fn least_bytes(&self, encoding: Encoding) -> usize {
        let size = |property: &Property| match (encoding, property.shape) {
            (Encoding::Ascii, _) => 2,
            (_, Shape::One(scalar) | Shape::List { count: scalar, .. }) => scalar.bytes(),
        };
        self.properties.iter().map(size).sum()
    }
}

/// The parsed header.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Bytes up to the data.
    pub(super) bytes: usize,
    /// Lines up to the data.
    pub(super) lines: usize,
    /// The byte that ends lines.
    pub(super) line_end: u8,
}

/// Reads the header of `file`.
///
/// # Errors
/// With the line, if it is not a PLY header.
pub(super) fn read(file: &[u8]) -> Result<Header, FormatError> {
    // Line ends are those of the first line: binary data may hold any byte.
    let start = &file[..file.len().min(5)];
    if !Fields(start).next().is_some_and(|word| word.starts_with(b"ply")) {
        return Err(FormatError::at(FilePosition::Line(1), "a PLY file starts with a line `ply`"));
    }
    let line_end = line_end(start);
    let mut lines = Lines::new(file, 1, line_end);
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut names = BTreeSet::new();
    while let Some(line) = lines.next() {
        let number = lines.number();
        let fail = |fact: String| Err(FormatError::at(FilePosition::Line(number), fact));
        let fields: Vec<&[u8]> = Fields(line).collect();
        match fields.as_slice() {
            [b"ply"] if number == 1 => {}
            [] | [b"comment" | b"obj_info", ..] => {}
            [b"format", name, version] => match self::encoding(name) {
                Some(found) if *version == b"1.0" => encoding = Some(found),
                Some(_) => return fail(format!("PLY version {}, expected `1.0`", shown(version))),
                None => {
                    let expected = "expected `ascii`, `binary_little_endian` or `binary_big_endian`";
                    return fail(format!("{} is not a PLY encoding, {expected}", shown(name)));
                }
            },
            [b"element", name, rows] => {
                let rows = std::str::from_utf8(rows).ok().and_then(|rows| rows.parse().ok()).ok_or_else(|| {
                    FormatError::at(FilePosition::Line(number), format!("{} is not a number of rows", shown(rows)))
                })?;
                let name = String::from_utf8_lossy(name).into_owned();
                if is_known(&name) && elements.iter().any(|element| element.name == name) {
                    return fail(format!("element `{name}` appears twice"));
                }
                names.clear();
                elements.push(Element { name, rows, properties: Vec::new(), line: number });
            }
            [b"property", words @ ..] => {
                let Some(element) = elements.last_mut() else {
                    return fail("a property before the first element".into());
                };
                let property = match property(words) {
                    Ok(property) => property,
                    Err(fact) => return fail(fact),
                };
                if !names.insert(property.name.clone()) {
                    return fail(format!("property `{}` appears twice", property.name));
                }
                element.properties.push(property);
            }
            [b"end_header"] => {
                let Some(encoding) = encoding else { return fail("a header without a `format` line".into()) };
                return Ok(Header {
                    encoding,
                    elements,
                    bytes: file.len() - lines.rest().len(),
                    lines: number,
                    line_end,
                });
            }
            [word, ..] => return fail(format!("{} is not a PLY header line", shown(word))),
        }
    }
    let hint = "the file is truncated: write it again";
    Err(FormatError::with_hint(FilePosition::Line(lines.number()), "the header has no `end_header`", hint))
}

/// Whether the reader uses elements of that name; all others are skipped.
fn is_known(name: &str) -> bool {
    matches!(name, "vertex" | "face" | "edge" | "curve")
}

fn encoding(name: &[u8]) -> Option<Encoding> {
    match name {
        b"ascii" => Some(Encoding::Ascii),
        b"binary_little_endian" => Some(Encoding::LittleEndian),
        b"binary_big_endian" => Some(Encoding::BigEndian),
        _ => None,
    }
}

fn property(words: &[&[u8]]) -> Result<Property, String> {
    let scalar = |word: &[u8]| self::scalar(word).ok_or_else(|| format!("{} is not a PLY type", shown(word)));
    let (shape, name) = match words {
        [b"list", count, item, name] => {
            let [count, item] = [scalar(count)?, scalar(item)?];
            if count.is_float() {
                return Err("the count of a list has a floating-point type, expected an integer".into());
            }
            (Shape::List { count, item }, name)
        }
        [kind, name] => (Shape::One(scalar(kind)?), name),
        _ => return Err("expected `property TYPE NAME` or `property list TYPE TYPE NAME`".into()),
    };
    Ok(Property { name: String::from_utf8_lossy(name).into_owned(), shape })
}

fn scalar(name: &[u8]) -> Option<Scalar> {
    Some(match name {
        b"char" | b"int8" => Scalar::I8,
        b"uchar" | b"uint8" => Scalar::U8,
        b"short" | b"int16" => Scalar::I16,
        b"ushort" | b"uint16" => Scalar::U16,
        b"int" | b"int32" => Scalar::I32,
        b"uint" | b"uint32" => Scalar::U32,
        b"float" | b"float32" => Scalar::F32,
        b"double" | b"float64" => Scalar::F64,
        _ => return None,
    })
}
