//! Arrays of a crate file: as they are, as coded integers, or as indices into a table.

use super::bytes::{Cursor, DAMAGED};
use super::coding::{Stepped, ints};
use super::crate_values::{CrateData, Number, Rep, damaged, id, vector};
use super::half;
use super::layer::{Array, Tokens};
use crate::error::FilePosition;
use crate::{FormatError, Result};

/// Arrays of fewer rows are stored as they are, whatever their rep says.
const CODED_FROM: u64 = 16;

/// `bytes` as rows of `N` numbers of `W` bytes each.
fn rows<T: Copy + Default, const N: usize, const W: usize>(bytes: &[u8], number: impl Fn([u8; W]) -> T) -> Vec<[T; N]> {
    let (numbers, _) = bytes.as_chunks::<W>();
    let (rows, _) = numbers.as_chunks::<N>();
    rows.iter().map(|row| row.map(&number)).collect()
}

impl CrateData {
    /// The rows of an array.
    pub(super) fn array(&self, rep: u64, tokens: &Tokens) -> Result<Array> {
        let rep = Rep::of(rep);
        if !rep.is_array {
            return Ok(Array::Other);
        }
        if let Some((number, width)) = vector(rep.kind) {
            return self.vectors(rep, number, width);
        }
        match rep.kind {
            id::BOOL | id::UCHAR => {
                let (mut cursor, count) = self.raw(rep, 1)?;
                Ok(Array::I1(cursor.take(count)?.iter().map(|byte| i32::from(*byte)).collect()))
            }
            id::INT => Ok(Array::I1(self.whole::<i32, 4>(rep, i32::from_le_bytes)?)),
            id::UINT => {
                let values = self.whole::<i32, 4>(rep, i32::from_le_bytes)?;
                Ok(match values.iter().all(|value| *value >= 0) {
                    true => Array::I1(values),
                    false => Array::Long(values.into_iter().map(|value| value.cast_unsigned().into()).collect()),
                })
            }
            id::INT64 | id::UINT64 => {
                let values = self.whole::<i64, 8>(rep, i64::from_le_bytes)?;
                let short = values.iter().all(|value| i32::try_from(*value).is_ok());
                Ok(if short {
                    Array::I1(values.iter().map(|value| *value as i32).collect())
                } else {
                    Array::Long(values)
                })
            }
            id::HALF => self.floats(rep, |bytes: [u8; 2]| half::number(u16::from_le_bytes(bytes)), |x| x as f32),
            id::FLOAT => self.floats(rep, f32::from_le_bytes, |x| x as f32),
            id::DOUBLE => self.doubles(rep),
            id::QUATD..=id::QUATH => {
                let number = [Number::Double, Number::Float, Number::Half][usize::from(rep.kind - id::QUATD)];
                Ok(match self.vectors(rep, number, 4)? {
                    Array::F4(rows) => Array::Quaternions(rows),
                    Array::Doubles(numbers, _) => {
                        Array::Quaternions(numbers.as_chunks().0.iter().map(|row| row.map(|x: f64| x as f32)).collect())
                    }
                    other => other,
                })
            }
            id::TOKEN | id::STRING | id::ASSET => {
                match self.value((1 << 63) | u64::from(rep.kind) << 48 | rep.payload, tokens)? {
                    super::layer::Value::Texts(texts) => Ok(Array::Texts(texts)),
                    _ => Ok(Array::Other),
                }
            }
            _ => Ok(Array::Other),
        }
    }

    /// Where the rows of an array start, and how many there are of `size` bytes each.
    fn raw(&self, rep: Rep, size: usize) -> Result<(Cursor<'_>, usize)> {
        let mut cursor = self.cursor(rep.payload);
        if rep.payload == 0 {
            return Ok((cursor, 0));
        }
        let at = cursor.position();
        let count = self.row_count(&mut cursor)?;
        let count = cursor.checked(at, count, size)?;
        Ok((cursor, count))
    }

    /// The number of rows of an array, before it is known how they are stored.
    fn row_count(&self, cursor: &mut Cursor<'_>) -> Result<u64> {
        if self.version < [0, 5, 0] {
            // The number of dimensions, which is 1.
            cursor.u32()?;
        }
        if self.version < [0, 7, 0] { Ok(cursor.u32()?.into()) } else { cursor.u64() }
    }

    /// The number of rows of texts.
    pub(super) fn rows(&self, cursor: &mut Cursor<'_>, least: usize) -> Result<usize> {
        let at = cursor.position();
        let count = self.row_count(cursor)?;
        cursor.checked(at, count, least)
    }

    fn vectors(&self, rep: Rep, number: Number, width: usize) -> Result<Array> {
        let size = width * number.bytes();
        let (mut cursor, count) = self.raw(rep, size)?;
        let bytes = cursor.take(count * size)?;
        let float = f32::from_le_bytes;
        let half = |bytes: [u8; 2]| half::number(u16::from_le_bytes(bytes));
        let int = i32::from_le_bytes;
        Ok(match (number, width) {
            (Number::Float, 2) => Array::F2(rows(bytes, float)),
            (Number::Float, 3) => Array::F3(rows(bytes, float)),
            (Number::Float, _) => Array::F4(rows(bytes, float)),
            (Number::Half, 2) => Array::F2(rows(bytes, half)),
            (Number::Half, 3) => Array::F3(rows(bytes, half)),
            (Number::Half, _) => Array::F4(rows(bytes, half)),
            (Number::Int, 2) => Array::I2(rows(bytes, int)),
            (Number::Int, 3) => Array::I3(rows(bytes, int)),
            (Number::Int, _) => Array::I4(rows(bytes, int)),
            (Number::Double, _) => {
                Array::Doubles(bytes.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect(), width)
            }
        })
    }

    /// Whole numbers, coded or not.
    fn whole<T: Stepped, const W: usize>(&self, rep: Rep, number: impl Fn([u8; W]) -> T) -> Result<Vec<T>> {
        if rep.payload != 0 && rep.is_compressed {
            let mut cursor = self.cursor(rep.payload);
            let count = self.row_count(&mut cursor)?;
            if count >= CODED_FROM {
                return coded(&mut cursor, count);
            }
        }
        let (mut cursor, count) = self.raw(rep, W)?;
        Ok(cursor.take(count * W)?.as_chunks().0.iter().map(|bytes| number(*bytes)).collect())
    }

    fn floats<const W: usize>(
        &self,
        rep: Rep,
        number: impl Fn([u8; W]) -> f32,
        whole: impl Fn(i32) -> f32,
    ) -> Result<Array> {
        if let Some(values) = self.compressed(rep, &number, &whole)? {
            return Ok(Array::F1(values));
        }
        let (mut cursor, count) = self.raw(rep, W)?;
        Ok(Array::F1(cursor.take(count * W)?.as_chunks().0.iter().map(|bytes| number(*bytes)).collect()))
    }

    /// The rows of an array of doubles.
    pub(super) fn doubles(&self, rep: Rep) -> Result<Array> {
        if let Some(values) = self.compressed(rep, &f64::from_le_bytes, &f64::from)? {
            return Ok(Array::Doubles(values, 1));
        }
        self.vectors(rep, Number::Double, 1)
    }

    /// Floats that are stored as whole numbers, or as indices into a table; `None` if they are not.
    fn compressed<T: Copy, const W: usize>(
        &self,
        rep: Rep,
        number: &impl Fn([u8; W]) -> T,
        whole: &impl Fn(i32) -> T,
    ) -> Result<Option<Vec<T>>> {
        if rep.payload == 0 || !rep.is_compressed || self.version < [0, 6, 0] {
            return Ok(None);
        }
        let mut cursor = self.cursor(rep.payload);
        let count = self.row_count(&mut cursor)?;
        if count < CODED_FROM {
            return Ok(None);
        }
        let at = cursor.position();
        match cursor.u8()? {
            b'i' => Ok(Some(coded(&mut cursor, count)?.into_iter().map(whole).collect())),
            b't' => {
                let length = cursor.u32()?.into();
                let length = cursor.checked(at, length, W)?;
                let table: Vec<T> = cursor.take(length * W)?.as_chunks().0.iter().map(|bytes| number(*bytes)).collect();
                let indices = coded::<i32>(&mut cursor, count)?;
                let value = |index: i32| table.get(index.cast_unsigned() as usize).copied();
                let values = indices.into_iter().map(value).collect::<Option<Vec<T>>>();
                Ok(Some(values.ok_or_else(|| damaged(at, "an index goes past the end of its table"))?))
            }
            other => Err(damaged(at, format!("floats are coded as {other}, expected `i` or `t`"))),
        }
    }
}

/// `count` coded integers, of which the file may hold more than its bytes.
fn coded<T: Stepped>(cursor: &mut Cursor<'_>, count: u64) -> Result<Vec<T>> {
    let at = cursor.position();
    // At least a quarter of a byte for each, compressed at most 255 times.
    cursor.checked(at, count / 1024, 1)?;
    let count = usize::try_from(count)
        .map_err(|_| FormatError::with_hint(FilePosition::Byte(at), format!("it has {count} entries"), DAMAGED))?;
    ints(cursor, count)
}
