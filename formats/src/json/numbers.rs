//! A list of numbers or of rows of numbers, whose type is determined while reading.
//!
//! Each item is read as raw text, which serde has validated as json, and converted to f32 or i32 directly: a conversion
//! via f64 would change the last bit of some f32.

use std::fmt;

use engine::geometry::{Column, ColumnType};
use serde::de::{DeserializeSeed, Deserializer, Error, SeqAccess, Visitor};
use serde_json::value::RawValue;

use crate::text::{counted, shown};

/// The numbers of a column, row by row.
#[derive(Default)]
pub(super) struct Numbers {
    /// Numbers per row; 0 before the first row.
    width: usize,
    /// All numbers while they are integers; empty from the first float on.
    wholes: Vec<i32>,
    /// All numbers from the first float on.
    floats: Option<Vec<f32>>,
}

impl Numbers {
    /// A column of these rows; `wanted` is the type of a well-known name. A column without rows has the type
    /// `wanted`, or float.
    pub(super) fn column(self, wanted: Option<ColumnType>) -> Column {
        if self.width == 0 {
            return Column::zeros(wanted.unwrap_or(ColumnType::F1), 0);
        }
        let whole = self.floats.is_none() && !wanted.is_some_and(ColumnType::is_float);
        match (self.width, whole) {
            (3, true) => Column::new(self.wholes.as_chunks::<3>().0.to_vec()),
            (4, true) => Column::new(self.wholes.as_chunks::<4>().0.to_vec()),
            (_, true) => Column::new(self.wholes),
            (3, false) => Column::new(self.flat().as_chunks::<3>().0.to_vec()),
            (4, false) => Column::new(self.flat().as_chunks::<4>().0.to_vec()),
            (_, false) => Column::new(self.flat()),
        }
    }

    /// The rows of three floats.
    ///
    /// # Errors
    /// If rows have another width, which the error names.
    pub(super) fn triples(self) -> Result<Vec<[f32; 3]>, String> {
        match self.width {
            0 | 3 => Ok(self.flat().as_chunks::<3>().0.to_vec()),
            width => Err(format!("rows of {}, expected 3", counted(width, "number"))),
        }
    }

    /// Bare floats.
    ///
    /// # Errors
    /// If rows have another width, which the error names.
    pub(super) fn singles(self) -> Result<Vec<f32>, String> {
        match self.width {
            0 | 1 => Ok(self.flat()),
            width => Err(format!("rows of {}, expected bare numbers", counted(width, "number"))),
        }
    }

    fn flat(self) -> Vec<f32> {
        self.floats.unwrap_or_else(|| as_floats(self.wholes))
    }

    fn push_row(&mut self, text: &str) -> Result<(), String> {
        let width = match text.strip_prefix('[').and_then(|row| row.strip_suffix(']')) {
            Some(row) => {
                let mut width = 0;
                for number in row.split(',').filter(|number| !number.trim_ascii().is_empty()) {
                    self.push(number.trim_ascii())?;
                    width += 1;
                }
                if width != 3 && width != 4 {
                    return Err(format!("{} in a list, expected 3 or 4, or a bare number", counted(width, "number")));
                }
                width
            }
            None => {
                self.push(text)?;
                1
            }
        };
        if self.width == 0 {
            self.width = width;
        }
        if width != self.width {
            return Err(format!("{}, where the rows before have {}", counted(width, "number"), self.width));
        }
        Ok(())
    }

    fn push(&mut self, text: &str) -> Result<(), String> {
        let is_float = text.contains(['.', 'e', 'E']);
        if is_float || self.floats.is_some() {
            let number = float(text)?;
            self.floats.get_or_insert_with(|| as_floats(std::mem::take(&mut self.wholes))).push(number);
            return Ok(());
        }
        self.wholes.push(text.parse().map_err(|_| {
            if text.trim_start_matches('-').bytes().all(|byte| byte.is_ascii_digit()) {
                format!("{text} is out of range for a 32-bit integer; write it as {text}.0 to make it a float")
            } else {
                not_a_number(text)
            }
        })?);
        Ok(())
    }
}

fn as_floats(wholes: Vec<i32>) -> Vec<f32> {
    wholes.into_iter().map(|n| n as f32).collect()
}

/// The nearest f32 of the text of a json value.
///
/// # Errors
/// If the value is not a number, or out of the range of f32.
pub(super) fn float(text: &str) -> Result<f32, String> {
    let number: f32 = text.parse().map_err(|_| not_a_number(text))?;
    if number.is_finite() { Ok(number) } else { Err(format!("{text} is out of range, expected at most 3.4e38")) }
}

fn not_a_number(text: &str) -> String {
    format!("{} is not a number", shown(text.as_bytes()))
}

/// Reads a list of numbers or of rows; the text is its name in messages.
pub(super) struct NumbersOf<'a>(pub(super) &'a str);

impl<'de> DeserializeSeed<'de> for NumbersOf<'_> {
    type Value = Numbers;

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<Numbers, D::Error> {
        json.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for NumbersOf<'_> {
    type Value = Numbers;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "a list of numbers for `{}`", self.0)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Numbers, A::Error> {
        let mut numbers = Numbers::default();
        let mut row = 0;
        while let Some(item) = items.next_element::<&RawValue>()? {
            numbers
                .push_row(item.get())
                .map_err(|fact| A::Error::custom(format!("`{}`, row {row}: {fact}", self.0)))?;
            row += 1;
        }
        Ok(numbers)
    }
}
