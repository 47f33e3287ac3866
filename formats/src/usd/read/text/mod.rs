//! `.usda`: the structure is read at once, values when they are asked for.
//!
//! A handle is where a value is written, with its type. Samples and references are lists of their own.

mod lexer;
mod parser;
mod types;

use std::sync::Arc;

use super::bytes::Bytes;
use super::layer::{Array, Handle, Reference, Samples, Value};
use crate::Result;
use lexer::Lexer;
use types::{Scalar, TextType};

pub(super) use parser::layer;

/// The first bytes of a text file.
pub(super) const MAGIC: &[u8] = b"#usda";

/// Handles of lists have this where others have a type.
const SAMPLES: u8 = 0xfe;
const REFERENCES: u8 = 0xff;

fn handle(code: u8, at: usize) -> Handle {
    u64::from(code) << 56 | at as u64
}

/// A text file's values.
#[derive(Debug)]
pub(super) struct TextData {
    bytes: Bytes,
    samples: Vec<Samples>,
    references: Vec<Vec<Reference>>,
}

impl TextData {
    /// The value of a handle. Its syntax was checked only as far as brackets; what is wrong inside is no value.
    pub(super) fn value(&self, handle: Handle) -> Value {
        let (code, at) = ((handle >> 56) as u8, (handle & ((1 << 56) - 1)) as usize);
        match code {
            SAMPLES => self.samples.get(at).cloned().map_or(Value::Other, Value::Samples),
            REFERENCES => self.references.get(at).cloned().map_or(Value::Other, Value::References),
            _ => value(&mut Lexer::new(self.bytes.get(), at), TextType::of(code)).unwrap_or(Value::Other),
        }
    }

    /// The rows of an array.
    pub(super) fn array(&self, handle: Handle) -> Result<Array> {
        let (code, at) = ((handle >> 56) as u8, (handle & ((1 << 56) - 1)) as usize);
        match TextType::of(code) {
            kind if kind.is_array => array(&mut Lexer::new(self.bytes.get(), at), kind),
            _ => Ok(Array::Other),
        }
    }
}

/// Whether a handle is of halves or vectors of them.
pub(super) fn is_half(handle: Handle) -> bool {
    matches!(TextType::of((handle >> 56) as u8).scalar, Scalar::Half)
}

fn value(lexer: &mut Lexer<'_>, kind: TextType) -> Result<Value> {
    let next = lexer.peek();
    let before = *lexer;
    match next {
        Some(b'"' | b'\'' | b'@' | b'<') => return Ok(Value::Text(lexer.quoted()?.into())),
        Some(b'[') if !matches!(kind.scalar, Scalar::Text | Scalar::Unknown) => return Ok(Value::Array),
        Some(b'[') => return texts(lexer),
        Some(b'{') => return dictionary(lexer),
        Some(b'(') => {
            let numbers = numbers(lexer)?;
            return Ok(match (kind.scalar, &numbers[..]) {
                (Scalar::Quaternion, [w, x, y, z]) => Value::Quaternion([*x, *y, *z, *w]),
                _ => Value::Numbers(numbers),
            });
        }
        _ => {}
    }
    let word = lexer.word();
    Ok(match (word, lexer::parsed(word)) {
        ("None", _) => Value::Block,
        ("true", _) => Value::Int(1),
        ("false", _) => Value::Int(0),
        // Not by way of a double, which does not hold all of them.
        (word, Some(number)) => match word.parse() {
            Ok(whole) if kind.scalar == Scalar::Int => Value::Int(whole),
            _ => Value::Double(number),
        },
        ("", _) => return Err(before.error(format!("{}, expected a value", before.found()))),
        (word, None) => Value::Text(word.into()),
    })
}

/// A list of texts; a list of anything else has no meaning where this is called.
fn texts(lexer: &mut Lexer<'_>) -> Result<Value> {
    lexer.expect(b'[')?;
    let mut texts: Vec<Arc<str>> = Vec::new();
    loop {
        match lexer.peek() {
            Some(b']') => return Ok(Value::Texts(texts)),
            Some(b',') => lexer.at += 1,
            // The offset of a layer.
            Some(b'(') => lexer.skip_brackets()?,
            Some(b'"' | b'\'' | b'@' | b'<') => texts.push(lexer.quoted()?.into()),
            _ => return Ok(Value::Other),
        }
    }
}

/// The numbers of a tuple or of a tuple of tuples.
fn numbers(lexer: &mut Lexer<'_>) -> Result<Vec<f64>> {
    lexer.expect(b'(')?;
    let (mut depth, mut numbers) = (1, Vec::new());
    while depth > 0 {
        match lexer.peek() {
            Some(b'(') => depth += 1,
            Some(b')') => depth -= 1,
            Some(b',') => {}
            _ => {
                numbers.push(lexer.number()?);
                continue;
            }
        }
        lexer.at += 1;
    }
    Ok(numbers)
}

fn dictionary(lexer: &mut Lexer<'_>) -> Result<Value> {
    lexer.expect(b'{')?;
    let mut entries = Vec::new();
    loop {
        match lexer.peek() {
            Some(b'}') => return Ok(Value::Dictionary(entries)),
            Some(b',') => {
                lexer.at += 1;
                continue;
            }
            _ => {}
        }
        let kind = written_type(lexer)?;
        let key = match lexer.peek() {
            Some(b'"' | b'\'') => lexer.quoted()?,
            _ => lexer.word().to_owned(),
        };
        lexer.expect(b'=')?;
        lexer.peek();
        entries.push((key, handle(kind.code(), lexer.at)));
        skip_value(lexer)?;
    }
}

/// The name of a type, with `[]` if there are many.
fn written_type(lexer: &mut Lexer<'_>) -> Result<TextType> {
    let before = *lexer;
    let name = lexer.word();
    if name.is_empty() {
        return Err(before.error(format!("{}, expected a type", before.found())));
    }
    let is_array = lexer.text.get(lexer.at..).is_some_and(|rest| rest.starts_with(b"[]"));
    lexer.at += if is_array { 2 } else { 0 };
    Ok(TextType::named(name, is_array))
}

/// Goes past a value.
fn skip_value(lexer: &mut Lexer<'_>) -> Result<()> {
    match lexer.peek() {
        Some(b'(' | b'[' | b'{') => lexer.skip_brackets(),
        Some(open @ (b'"' | b'\'' | b'@' | b'<')) => lexer.skip_quoted(open).map(|_| ()),
        _ => {
            let before = *lexer;
            match lexer.word() {
                "" => Err(before.error(format!("{}, expected a value", before.found()))),
                _ => Ok(()),
            }
        }
    }
}

/// The rows of an array of numbers.
fn array(lexer: &mut Lexer<'_>, kind: TextType) -> Result<Array> {
    let half = |x: f64| super::half::nearest(x as f32);
    Ok(match (kind.scalar, kind.width) {
        (Scalar::Half, 1) => Array::F1(rows(lexer, |[x]: [f64; 1]| half(x))?),
        (Scalar::Half, 2) => Array::F2(rows(lexer, |row| row.map(half))?),
        (Scalar::Half, 3) => Array::F3(rows(lexer, |row| row.map(half))?),
        (Scalar::Half, _) => Array::F4(rows(lexer, |row| row.map(half))?),
        (Scalar::Float, 1) => Array::F1(rows(lexer, |[x]: [f64; 1]| x as f32)?),
        (Scalar::Float, 2) => Array::F2(rows(lexer, |row| row.map(|x: f64| x as f32))?),
        (Scalar::Float, 3) => Array::F3(rows(lexer, |row| row.map(|x: f64| x as f32))?),
        (Scalar::Float, _) => Array::F4(rows(lexer, |row| row.map(|x: f64| x as f32))?),
        (Scalar::Double, 1) => Array::Doubles(rows(lexer, |[x]: [f64; 1]| x)?, 1),
        (Scalar::Double, 2) => Array::Doubles(rows(lexer, |row: [f64; 2]| row)?.into_flattened(), 2),
        (Scalar::Double, 3) => Array::Doubles(rows(lexer, |row: [f64; 3]| row)?.into_flattened(), 3),
        (Scalar::Double, _) => Array::Doubles(rows(lexer, |row: [f64; 4]| row)?.into_flattened(), 4),
        (Scalar::Quaternion, _) => {
            Array::Quaternions(rows(lexer, |[w, x, y, z]: [f64; 4]| [x, y, z, w].map(|x| x as f32))?)
        }
        (Scalar::Int, 1) => {
            // Beyond 2⁵³ a whole number is not exact here; such an identity does not fit in an i32 anyway.
            let long: Vec<i64> = rows(lexer, |[x]: [f64; 1]| x as i64)?;
            match long.iter().all(|value| i32::try_from(*value).is_ok()) {
                true => Array::I1(long.into_iter().map(|value| value as i32).collect()),
                false => Array::Long(long),
            }
        }
        (Scalar::Int, 2) => Array::I2(rows(lexer, |row| row.map(|x: f64| x as i32))?),
        (Scalar::Int, 3) => Array::I3(rows(lexer, |row| row.map(|x: f64| x as i32))?),
        (Scalar::Int, _) => Array::I4(rows(lexer, |row| row.map(|x: f64| x as i32))?),
        (Scalar::Text, _) => match texts(lexer)? {
            Value::Texts(texts) => Array::Texts(texts),
            _ => Array::Other,
        },
        _ => Array::Other,
    })
}

/// Rows of `N` numbers each, in brackets where `N` is not 1.
fn rows<const N: usize, T>(lexer: &mut Lexer<'_>, row: impl Fn([f64; N]) -> T) -> Result<Vec<T>> {
    lexer.expect(b'[')?;
    let mut rows = Vec::new();
    while !lexer.take(b']') {
        let mut numbers = [0.0; N];
        if N > 1 {
            lexer.expect(b'(')?;
        }
        for (place, number) in numbers.iter_mut().enumerate() {
            if place > 0 {
                lexer.expect(b',')?;
            }
            *number = match lexer.peek() {
                Some(b't') if lexer.take_word("true") => 1.0,
                Some(b'f') if lexer.take_word("false") => 0.0,
                _ => lexer.number()?,
            };
        }
        if N > 1 {
            lexer.expect(b')')?;
        }
        rows.push(row(numbers));
        if !lexer.take(b',') {
            lexer.expect(b']')?;
            break;
        }
    }
    Ok(rows)
}
