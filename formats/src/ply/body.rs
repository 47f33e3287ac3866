//! The data of a PLY file, element by element, in any encoding.
//!
//! Before an element is read, its declared rows are checked against the remaining bytes: nothing is allocated for rows
//! that the file cannot hold.

use super::header::{Element, Encoding, Header, Property, Scalar, Shape};
use crate::text::{Fields, Lines, counted, float, shown};
use crate::{FilePosition, FormatError};

/// What to keep of a property.
#[derive(Clone, Copy)]
pub(super) enum Keep {
    Nothing,
    Values,
    /// Indices into a table of this many rows; others are a fault.
    Indices {
        rows: usize,
    },
}

/// What was kept of a property.
#[derive(Debug)]
pub(super) enum Cells {
    Nothing,
    Floats(Vec<f32>),
    Wholes(Vec<i32>),
    /// The items of all lists, all below `rows`, and the length of each list; 1 for a scalar.
    Indices {
        counts: Vec<u32>,
        items: Vec<u32>,
        rows: usize,
    },
}

/// The data after the header.
pub(super) enum Body<'a> {
    Ascii(Ascii<'a>),
    Binary(Binary<'a>),
}

impl<'a> Body<'a> {
    pub(super) fn new(header: &Header, file: &'a [u8]) -> Self {
        let data = &file[header.bytes..];
        match header.encoding {
            Encoding::Ascii => {
                let lines = Lines::new(data, header.lines + 1, header.line_end);
                Self::Ascii(Ascii { lines, fields: Fields(&[]) })
            }
            encoding => {
                let big_endian = encoding == Encoding::BigEndian;
                Self::Binary(Binary { data, start: header.bytes, next: 0, big_endian })
            }
        }
    }

    /// Reads the rows of the next element; one list of cells per property.
    ///
    /// # Errors
    /// With line or byte: if the data ends early, or a number is malformed, not finite or out of range.
    pub(super) fn element(
        &mut self,
        element: &Element,
        keep: impl Fn(&Property) -> Keep,
    ) -> Result<Vec<Cells>, FormatError> {
        let keep: Vec<Keep> = element.properties.iter().map(keep).collect();
        match self {
            Self::Ascii(source) => rows(source, Encoding::Ascii, element, &keep),
            Self::Binary(source) => rows(source, Encoding::LittleEndian, element, &keep),
        }
    }
}

/// A number as stored in the file.
#[derive(Clone, Copy)]
enum Number {
    Whole(i64),
    Float(f32),
}

/// Where numbers come from.
trait Source {
    fn position(&self) -> FilePosition;
    /// Remaining bytes.
    fn left(&self) -> usize;
    fn start_row(&mut self) -> Result<(), String>;
    fn number(&mut self, scalar: Scalar) -> Result<Number, String>;
    fn end_row(&mut self) -> Result<(), String>;
}

fn rows<S: Source>(
    source: &mut S,
    encoding: Encoding,
    element: &Element,
    keep: &[Keep],
) -> Result<Vec<Cells>, FormatError> {
    // Rows without properties have no bytes.
    if element.properties.is_empty() {
        return Ok(Vec::new());
    }
    let needed = element.rows.checked_mul(element.least_bytes(encoding));
    // The last line of a text may lack its line end.
    let left = source.left() + usize::from(encoding == Encoding::Ascii);
    if needed.is_none_or(|needed| needed > left) {
        let fact = format!(
            "`{}` has {}, more than fit in the {} after the header",
            element.name,
            counted(element.rows, "row"),
            counted(source.left(), "byte"),
        );
        let hint = "the file is truncated or its header is damaged: write it again";
        return Err(FormatError::with_hint(FilePosition::Line(element.line), fact, hint));
    }
    let mut cells: Vec<Cells> =
        element.properties.iter().zip(keep).map(|(property, keep)| empty(property, *keep, element.rows)).collect();
    for row in 0..element.rows {
        let fail = |source: &S, fact| FormatError::at(source.position(), format!("`{}` {row}: {fact}", element.name));
        source.start_row().map_err(|fact| fail(source, fact))?;
        for (property, cells) in element.properties.iter().zip(&mut cells) {
            take(source, property, cells).map_err(|fact| fail(source, format!("`{}`: {fact}", property.name)))?;
        }
        source.end_row().map_err(|fact| fail(source, fact))?;
    }
    Ok(cells)
}

/// Cells with capacity for the rows that the file can hold.
fn empty(property: &Property, keep: Keep, rows: usize) -> Cells {
    match (keep, property.shape) {
        (Keep::Values, Shape::One(scalar)) if scalar.is_float() => Cells::Floats(Vec::with_capacity(rows)),
        (Keep::Values, Shape::One(_)) => Cells::Wholes(Vec::with_capacity(rows)),
        (Keep::Indices { rows: below }, _) => {
            Cells::Indices { counts: Vec::with_capacity(rows), items: Vec::new(), rows: below }
        }
        (Keep::Nothing, _) | (Keep::Values, Shape::List { .. }) => Cells::Nothing,
    }
}

fn take<S: Source>(source: &mut S, property: &Property, cells: &mut Cells) -> Result<(), String> {
    let (length, scalar) = match property.shape {
        Shape::One(scalar) => (1, scalar),
        Shape::List { count, item } => match source.number(count)? {
            Number::Whole(length) => (u32::try_from(length).map_err(|_| format!("a list of {length} items"))?, item),
            Number::Float(length) => return Err(format!("a list of {length} items")),
        },
    };
    if let Cells::Indices { counts, .. } = cells {
        counts.push(length);
    }
    for _ in 0..length {
        let number = source.number(scalar)?;
        match (&mut *cells, number) {
            (Cells::Floats(values), Number::Float(x)) if x.is_finite() => values.push(x),
            (Cells::Floats(_), Number::Float(x)) => return Err(format!("{x} is not a finite number")),
            (Cells::Floats(values), Number::Whole(n)) => values.push(n as f32),
            // Bits are kept, because packed colours often use the upper half of the range.
            (Cells::Wholes(values), Number::Whole(n)) => values.push(n as i32),
            (Cells::Wholes(_), Number::Float(x)) => return Err(format!("{x} is not a whole number")),
            (Cells::Indices { items, rows, .. }, number) => items.push(index(number, *rows)?),
            (Cells::Nothing, _) => {}
        }
    }
    Ok(())
}

fn index(number: Number, rows: usize) -> Result<u32, String> {
    let Number::Whole(n) = number else { return Err("an index has a floating-point type, expected an integer".into()) };
    let index = u32::try_from(n).ok().filter(|index| (*index as usize) < rows);
    index.ok_or_else(|| format!("index {n} is out of range: `vertex` has {}, counted from 0", counted(rows, "row")))
}

/// A text: one line per row.
pub(super) struct Ascii<'a> {
    lines: Lines<'a>,
    fields: Fields<'a>,
}

impl Source for Ascii<'_> {
    fn position(&self) -> FilePosition {
        FilePosition::Line(self.lines.number())
    }

    fn left(&self) -> usize {
        self.lines.rest().len()
    }

    fn start_row(&mut self) -> Result<(), String> {
        let is_blank = |line: &&[u8]| line.iter().all(u8::is_ascii_whitespace);
        self.fields = Fields(self.lines.by_ref().find(|line| !is_blank(line)).ok_or("the file ends")?);
        Ok(())
    }

    fn number(&mut self, scalar: Scalar) -> Result<Number, String> {
        let field = self.fields.next().ok_or("the line ends")?;
        let not_a_number = || format!("{} is not a number", shown(field));
        if scalar.is_float() {
            return float(field).map(Number::Float).ok_or_else(not_a_number);
        }
        let whole: Option<i64> = std::str::from_utf8(field).ok().and_then(|text| text.parse().ok());
        match whole {
            Some(n) if (i64::from(i32::MIN)..=i64::from(u32::MAX)).contains(&n) => Ok(Number::Whole(n)),
            Some(_) => Err(format!("{} does not fit 32 bits", shown(field))),
            // Some programs write `255.0` into integer columns.
            None => match float(field) {
                Some(x) if x as i32 as f32 == x => Ok(Number::Whole(i64::from(x as i32))),
                Some(_) => Err(format!("{} is not a whole number", shown(field))),
                None => Err(not_a_number()),
            },
        }
    }

    fn end_row(&mut self) -> Result<(), String> {
        match self.fields.next() {
            Some(field) => Err(format!("{} follows the last property of the row", shown(field))),
            None => Ok(()),
        }
    }
}

/// Binary data, packed without gaps.
pub(super) struct Binary<'a> {
    data: &'a [u8],
    /// Offset of the data in the file.
    start: usize,
    next: usize,
    big_endian: bool,
}

impl Binary<'_> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let found = self.data.get(self.next..).and_then(<[u8]>::first_chunk::<N>).ok_or("the file ends")?;
        self.next += N;
        let mut bytes = *found;
        if self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }
}

impl Source for Binary<'_> {
    fn position(&self) -> FilePosition {
        FilePosition::Byte(self.start + self.next)
    }

    fn left(&self) -> usize {
        self.data.len() - self.next
    }

    fn start_row(&mut self) -> Result<(), String> {
        Ok(())
    }

    fn number(&mut self, scalar: Scalar) -> Result<Number, String> {
        Ok(match scalar {
            Scalar::I8 => Number::Whole(i8::from_le_bytes(self.bytes()?).into()),
            Scalar::U8 => Number::Whole(u8::from_le_bytes(self.bytes()?).into()),
            Scalar::I16 => Number::Whole(i16::from_le_bytes(self.bytes()?).into()),
            Scalar::U16 => Number::Whole(u16::from_le_bytes(self.bytes()?).into()),
            Scalar::I32 => Number::Whole(i32::from_le_bytes(self.bytes()?).into()),
            Scalar::U32 => Number::Whole(u32::from_le_bytes(self.bytes()?).into()),
            Scalar::F32 => Number::Float(f32::from_le_bytes(self.bytes()?)),
            Scalar::F64 => Number::Float(f64::from_le_bytes(self.bytes()?) as f32),
        })
    }

    fn end_row(&mut self) -> Result<(), String> {
        Ok(())
    }
}
