//! Values of a crate file: what a rep of 8 bytes stands for.
//!
//! A rep has a type, three flags (array, in place, compressed) and 48 bits that are the value itself or where it lies.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::bytes::{Bytes, Cursor, DAMAGED};
use super::half;
use super::layer::{Array, NONE, Reference, Samples, Tokens, Value};
use crate::error::FilePosition;
use crate::{FormatError, Result};

const ARRAY: u64 = 1 << 63;
const INLINED: u64 = 1 << 62;
const COMPRESSED: u64 = 1 << 61;

/// Types by their number in a rep.
pub(super) mod id {
    pub(in super::super) const BOOL: u8 = 1;
    pub(in super::super) const UCHAR: u8 = 2;
    pub(in super::super) const INT: u8 = 3;
    pub(in super::super) const UINT: u8 = 4;
    pub(in super::super) const INT64: u8 = 5;
    pub(in super::super) const UINT64: u8 = 6;
    pub(in super::super) const HALF: u8 = 7;
    pub(in super::super) const FLOAT: u8 = 8;
    pub(in super::super) const DOUBLE: u8 = 9;
    pub(in super::super) const STRING: u8 = 10;
    pub(in super::super) const TOKEN: u8 = 11;
    pub(in super::super) const ASSET: u8 = 12;
    pub(in super::super) const MATRIX2: u8 = 13;
    pub(in super::super) const MATRIX4: u8 = 15;
    pub(in super::super) const QUATD: u8 = 16;
    pub(in super::super) const QUATH: u8 = 18;
    pub(in super::super) const VEC2D: u8 = 19;
    pub(in super::super) const VEC4I: u8 = 30;
    pub(in super::super) const DICTIONARY: u8 = 31;
    pub(in super::super) const REFERENCES: u8 = 35;
    pub(in super::super) const TOKEN_VECTOR: u8 = 41;
    pub(in super::super) const SPECIFIER: u8 = 42;
    pub(in super::super) const VARIABILITY: u8 = 44;
    pub(in super::super) const TIME_SAMPLES: u8 = 46;
    pub(in super::super) const PAYLOAD: u8 = 47;
    pub(in super::super) const DOUBLE_VECTOR: u8 = 48;
    pub(in super::super) const STRING_VECTOR: u8 = 50;
    pub(in super::super) const VALUE_BLOCK: u8 = 51;
    pub(in super::super) const PAYLOADS: u8 = 55;
    pub(in super::super) const TIME_CODE: u8 = 56;
}

/// A number as it is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    Half,
    Float,
    Double,
    Int,
}

impl Number {
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Half => 2,
            Self::Float | Self::Int => 4,
            Self::Double => 8,
        }
    }
}

/// Number and width of a vector type; `None` for other types.
pub(super) fn vector(kind: u8) -> Option<(Number, usize)> {
    let place = kind.checked_sub(id::VEC2D).filter(|_| kind <= id::VEC4I)?;
    let number = [Number::Double, Number::Float, Number::Half, Number::Int][usize::from(place % 4)];
    Some((number, usize::from(place / 4) + 2))
}

/// Whether a rep is of halves or vectors of them.
pub(super) fn is_half(rep: u64) -> bool {
    let kind = Rep::of(rep).kind;
    kind == id::HALF || matches!(vector(kind), Some((Number::Half, _)))
}

/// A crate file's values.
#[derive(Debug)]
pub(super) struct CrateData {
    pub(super) bytes: Bytes,
    pub(super) version: [u8; 3],
    /// The token of each string.
    pub(super) strings: Vec<u32>,
    /// The node of each path.
    pub(super) of_path: Vec<u32>,
    /// The node above each node, and the token of its name.
    pub(super) parents: Vec<u32>,
    pub(super) names: Vec<u32>,
}

/// A rep, taken apart.
#[derive(Clone, Copy)]
pub(super) struct Rep {
    pub(super) kind: u8,
    pub(super) is_array: bool,
    is_inlined: bool,
    pub(super) is_compressed: bool,
    pub(super) payload: u64,
}

impl Rep {
    pub(super) fn of(rep: u64) -> Self {
        Self {
            kind: (rep >> 48) as u8,
            is_array: rep & ARRAY != 0,
            is_inlined: rep & INLINED != 0,
            is_compressed: rep & COMPRESSED != 0,
            payload: rep & ((1 << 48) - 1),
        }
    }
}

pub(super) fn damaged(at: usize, fact: impl Into<String>) -> FormatError {
    FormatError::with_hint(FilePosition::Byte(at), fact, DAMAGED)
}

impl CrateData {
    pub(super) fn cursor(&self, at: u64) -> Cursor<'_> {
        Cursor::at(self.bytes.get(), at)
    }

    fn string<'t>(&self, index: u32, tokens: &'t Tokens) -> &'t str {
        self.strings.get(index as usize).map_or("", |token| tokens.get(*token))
    }

    /// The value of a rep.
    pub(super) fn value(&self, rep: u64, tokens: &Tokens) -> Result<Value> {
        let rep = Rep::of(rep);
        if rep.is_array {
            return match rep.kind {
                id::TOKEN | id::STRING | id::ASSET => Ok(Value::Texts(self.texts(rep, tokens)?)),
                _ => Ok(Value::Array),
            };
        }
        if let Some((number, width)) = vector(rep.kind) {
            return Ok(Value::Numbers(self.numbers(rep, number, width, 1)?));
        }
        let inlined = rep.payload as u32;
        Ok(match rep.kind {
            id::VALUE_BLOCK => Value::Block,
            id::BOOL | id::UCHAR | id::UINT | id::SPECIFIER..=id::VARIABILITY => Value::Int(i64::from(inlined)),
            id::INT => Value::Int(i64::from(inlined.cast_signed())),
            id::INT64 | id::UINT64 if rep.is_inlined => Value::Int(i64::from(inlined.cast_signed())),
            id::INT64 | id::UINT64 => Value::Int(self.cursor(rep.payload).i64()?),
            id::HALF => Value::Double(half::number(rep.payload as u16).into()),
            id::FLOAT => Value::Double(f32::from_bits(inlined).into()),
            id::DOUBLE | id::TIME_CODE if rep.is_inlined => Value::Double(f32::from_bits(inlined).into()),
            id::DOUBLE | id::TIME_CODE => Value::Double(self.cursor(rep.payload).f64()?),
            id::STRING => Value::Text(self.string(inlined, tokens).into()),
            id::TOKEN | id::ASSET => Value::Text(tokens.get(inlined).into()),
            id::MATRIX2..=id::MATRIX4 => {
                let width = usize::from(rep.kind - id::MATRIX2) + 2;
                Value::Numbers(self.numbers(rep, Number::Double, width * width, width + 1)?)
            }
            id::QUATD..=id::QUATH => {
                let number = [Number::Double, Number::Float, Number::Half][usize::from(rep.kind - id::QUATD)];
                match self.numbers(rep, number, 4, 1)?[..] {
                    [x, y, z, w] => Value::Quaternion([x, y, z, w]),
                    _ => Value::Other,
                }
            }
            id::DICTIONARY => Value::Dictionary(self.dictionary(rep)?.map_or_else(Vec::new, |entries| {
                entries.into_iter().map(|(key, rep)| (self.string(key, tokens).to_owned(), rep)).collect()
            })),
            id::REFERENCES | id::PAYLOADS => Value::References(self.references(rep, tokens)?),
            id::PAYLOAD => Value::References(vec![self.reference(&mut self.cursor(rep.payload), true, tokens)?]),
            id::TOKEN_VECTOR | id::STRING_VECTOR => Value::Texts(self.texts(rep, tokens)?),
            id::TIME_SAMPLES => Value::Samples(self.samples(rep)?),
            _ => Value::Other,
        })
    }

    /// The numbers of a vector, quaternion or matrix. In place, each is a byte; of a matrix only every `step`th is
    /// stored, and the others are 0.
    fn numbers(&self, rep: Rep, number: Number, width: usize, step: usize) -> Result<Vec<f64>> {
        if rep.is_inlined {
            let bytes = rep.payload.to_le_bytes();
            let mut numbers = vec![0.0; width];
            for (x, byte) in numbers.iter_mut().step_by(step).zip(bytes) {
                *x = f64::from(byte.cast_signed());
            }
            return Ok(numbers);
        }
        let mut cursor = self.cursor(rep.payload);
        let bytes = cursor.take(width * number.bytes())?;
        Ok(match number {
            Number::Half => bytes.as_chunks().0.iter().map(|b| half::number(u16::from_le_bytes(*b)).into()).collect(),
            Number::Float => bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b).into()).collect(),
            Number::Double => bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect(),
            Number::Int => bytes.as_chunks().0.iter().map(|b| i32::from_le_bytes(*b).into()).collect(),
        })
    }

    fn texts(&self, rep: Rep, tokens: &Tokens) -> Result<Vec<Arc<str>>> {
        if rep.payload == 0 {
            return Ok(Vec::new());
        }
        let mut cursor = self.cursor(rep.payload);
        let count = if rep.is_array { self.rows(&mut cursor, 4)? } else { cursor.count(4)? };
        let is_string = matches!(rep.kind, id::STRING | id::STRING_VECTOR);
        // Equal texts are one: of a damaged list, all may be. Those that do not exist are empty.
        let mut known: BTreeMap<Option<u32>, Arc<str>> = BTreeMap::new();
        let mut texts = Vec::with_capacity(count);
        for _ in 0..count {
            let index = cursor.u32()?;
            let token = if is_string { self.strings.get(index as usize).copied() } else { Some(index) };
            let token = token.filter(|token| (*token as usize) < tokens.ends.len());
            let text = known.entry(token).or_insert_with(|| token.map_or("", |token| tokens.get(token)).into());
            texts.push(text.clone());
        }
        Ok(texts)
    }

    /// Keys and reps; `None` if it is empty.
    fn dictionary(&self, rep: Rep) -> Result<Option<Vec<(u32, u64)>>> {
        if rep.payload == 0 {
            return Ok(None);
        }
        let mut cursor = self.cursor(rep.payload);
        let count = cursor.count(20)?;
        let mut entries = Vec::with_capacity(count);
        for _ in 0..count {
            let key = cursor.u32()?;
            let mut value = self.relative(&mut cursor)?;
            entries.push((key, value.u64()?));
            cursor = value;
        }
        Ok(Some(entries))
    }

    /// Where an offset, counted from its own start, leads.
    fn relative<'a>(&'a self, cursor: &mut Cursor<'a>) -> Result<Cursor<'a>> {
        let at = cursor.position() as u64;
        let offset = cursor.i64()?;
        let target = at.checked_add_signed(offset).filter(|target| *target > at);
        Ok(self.cursor(target.ok_or_else(|| damaged(at as usize, "an offset leads back"))?))
    }

    fn samples(&self, rep: Rep) -> Result<Samples> {
        let mut cursor = self.cursor(rep.payload);
        let mut times = self.relative(&mut cursor)?;
        let rep_of_times = Rep::of(times.u64()?);
        let mut values = self.relative(&mut times)?;
        let at = values.position();
        let count = values.count(8)?;
        let values = (0..count).map(|_| values.u64()).collect::<Result<Arc<[u64]>>>()?;
        let times: Arc<[f64]> = match rep_of_times.kind {
            id::DOUBLE if rep_of_times.is_array => match self.doubles(rep_of_times)? {
                Array::Doubles(times, _) => times.into(),
                _ => Arc::from([]),
            },
            id::DOUBLE_VECTOR => {
                let mut cursor = self.cursor(rep_of_times.payload);
                let count = cursor.count(8)?;
                (0..count).map(|_| cursor.f64()).collect::<Result<_>>()?
            }
            _ => return Err(damaged(at, "the times of samples are no numbers")),
        };
        let is_sorted = times.windows(2).all(|pair| pair[0] < pair[1]) && times.iter().all(|time| time.is_finite());
        if times.len() != values.len() || !is_sorted {
            return Err(damaged(at, "the times of samples do not increase, or are not as many as the values"));
        }
        Ok(Samples { times, values })
    }

    /// The items of a list operation, those that it deletes left out.
    fn references(&self, rep: Rep, tokens: &Tokens) -> Result<Vec<Reference>> {
        let mut cursor = self.cursor(rep.payload);
        let is_payload = rep.kind == id::PAYLOADS;
        let flags = cursor.u8()?;
        let mut all = Vec::new();
        // Explicit, added, prepended, appended; then deleted and ordered, which name no others.
        for flag in [1_u8, 2, 5, 6] {
            if flags & (1 << flag) == 0 {
                continue;
            }
            let count = cursor.count(if is_payload { 8 } else { 32 })?;
            for _ in 0..count {
                all.push(self.reference(&mut cursor, is_payload, tokens)?);
            }
        }
        Ok(all)
    }

    fn reference<'a>(&'a self, cursor: &mut Cursor<'a>, is_payload: bool, tokens: &Tokens) -> Result<Reference> {
        let asset = self.string(cursor.u32()?, tokens).to_owned();
        let prim = self.path(cursor.u32()?, tokens);
        let [offset, scale] =
            if is_payload && self.version < [0, 8, 0] { [0.0, 1.0] } else { [cursor.f64()?, cursor.f64()?] };
        if !is_payload {
            // Custom data: a dictionary in place.
            for _ in 0..cursor.count(20)? {
                cursor.u32()?;
                let mut value = self.relative(cursor)?;
                value.u64()?;
                *cursor = value;
            }
        }
        Ok(Reference { asset, prim, offset, scale })
    }

    /// The path of that index; empty if there is none.
    fn path(&self, index: u32, tokens: &Tokens) -> String {
        let mut node = self.of_path.get(index as usize).copied().unwrap_or(NONE);
        let mut names = Vec::new();
        while let (Some(parent), Some(name)) = (self.parents.get(node as usize), self.names.get(node as usize)) {
            if *parent != NONE {
                names.push(tokens.get(*name));
            }
            node = *parent;
        }
        names.iter().rev().fold(String::new(), |path, name| path + "/" + name)
    }
}
