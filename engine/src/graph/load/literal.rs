//! Literals: JSON values without keyframes or expressions, read according to the shape of the param.
//!
//! Rotations are returned in degrees and seeds as written; [`super::param`] converts them to what nodes get.

use std::sync::Arc;

use jsonc_parser::ast::Value as Ast;
use numerics::ramp::{Interpolation, Ramp, RampError};

use crate::geometry::{Column, ColumnType, Name, fixed_type};
use crate::graph::fault::{Fault, code};
use crate::graph::json::{Json, counted, keep, shown, word};
use crate::param::{Shape, Value};

/// The value, or `None` after a fault. Files are not literals: see [`super::param`].
pub(super) fn literal(shape: Shape, json: &Json<'_>, faults: &mut Vec<Fault>) -> Option<Value> {
    let expected = shape.describe();
    let number = |json: &Json<'_>| single(json, "a number");
    let whole = |json: &Json<'_>| json.whole("a whole number");
    Some(match shape {
        Shape::Float => Value::Float(keep(single(json, &expected), faults)?),
        Shape::Masked => Value::Masked(keep(single(json, &expected), faults)?, None),
        Shape::Int | Shape::Seed => Value::Int(keep(json.whole(&expected), faults)?),
        Shape::Bool => Value::Bool(keep(json.bool(), faults)?),
        Shape::Vec2 => Value::Vec2(tuple(json, &expected, number, faults)?),
        Shape::Vec3 | Shape::Turn => Value::Vec3(tuple(json, &expected, number, faults)?),
        Shape::Int3 => Value::Int3(tuple(json, &expected, whole, faults)?),
        Shape::Span => Value::Span(tuple(json, &expected, number, faults)?),
        Shape::Choice(options) => {
            let words: Vec<&str> = options.iter().map(|option| option.word).collect();
            Value::Choice(keep(word(json, "option", &words), faults)?)
        }
        Shape::Text => Value::Text(keep(text(json, "a string"), faults)?),
        Shape::Texts => Value::Texts(Arc::new(list(json, &expected, |item| text(item, "a string"), faults)?)),
        Shape::Ramp => Value::Ramp(Arc::new(ramp(json, Interpolation::Linear, faults)?)),
        Shape::Vec3s => {
            let rows =
                list(json, &expected, |item| row(item, "a vector [x, y, z]", |item| single(item, "a number")), faults)?;
            Value::Vec3s(Arc::new(rows.iter().map(|row| row.map(|x| x as f32)).collect()))
        }
        Shape::Ints => Value::Ints(Arc::new(list(json, &expected, integer, faults)?)),
        Shape::Tets => {
            Value::Tets(Arc::new(list(json, &expected, |item| row(item, "a tet [a, b, c, d]", corner), faults)?))
        }
        Shape::Columns => Value::Columns(Arc::new(columns(json, &expected, faults)?)),
        // `param` reads these itself.
        Shape::File | Shape::Code => return None,
    })
}

/// A number within the range of single precision, which geometry uses.
fn single(json: &Json<'_>, expected: &str) -> Result<f64, Fault> {
    let x = json.number(expected)?;
    if x.abs() > f64::from(f32::MAX) {
        let fault = json.fault(code::NUMBER_SIZE, format!("{x:e} is too large for single precision"));
        return Err(fault.hint("expected a number within ±3.4e38"));
    }
    Ok(x)
}

fn text(json: &Json<'_>, expected: &str) -> Result<Name, Fault> {
    json.string().map(Name::from).ok_or_else(|| json.unexpected(expected))
}

fn integer(json: &Json<'_>) -> Result<i32, Fault> {
    let whole = json.whole("a whole number")?;
    whole.try_into().map_err(|_| too_large(json, whole, "±2147483647"))
}

fn corner(json: &Json<'_>) -> Result<u32, Fault> {
    let whole = json.whole("the index of a point, from 0")?;
    whole.try_into().map_err(|_| too_large(json, whole, "0…4294967295"))
}

fn too_large(json: &Json<'_>, whole: i64, range: &str) -> Fault {
    json.fault(code::NUMBER_SIZE, format!("the whole number {whole} is out of range"))
        .hint(format!("expected a whole number within {range}"))
}

/// `N` items, with a fault for each invalid one.
fn tuple<T: Copy + Default, const N: usize>(
    json: &Json<'_>,
    expected: &str,
    read: impl Fn(&Json<'_>) -> Result<T, Fault>,
    faults: &mut Vec<Fault>,
) -> Option<[T; N]> {
    let items = json.elements().filter(|items| items.len() == N);
    let Some(items) = items else {
        let fault = json.unexpected(expected);
        faults.push(match json.value {
            Ast::NumberLit(number) => fault.hint(format!("write [{}]", vec![shown(number.value); N].join(", "))),
            _ => fault,
        });
        return None;
    };
    let mut values = [T::default(); N];
    let mut valid = true;
    for (index, item) in items.iter().enumerate() {
        let read = read(&json.item(item, index)).map_err(|fault| match item {
            Ast::StringLit(_) | Ast::Object(_) => {
                fault.hint(format!("expressions are written {{\"expr\": [{}]}}", vec!["\"…\""; N].join(", ")))
            }
            _ => fault,
        });
        match keep(read, faults) {
            Some(value) => values[index] = value,
            None => valid = false,
        }
    }
    valid.then_some(values)
}

/// `N` items, or the first fault: for lists too long to report each.
fn row<T: Copy + Default, const N: usize>(
    json: &Json<'_>,
    expected: &str,
    read: impl Fn(&Json<'_>) -> Result<T, Fault>,
) -> Result<[T; N], Fault> {
    let items = json.elements().filter(|items| items.len() == N).ok_or_else(|| json.unexpected(expected))?;
    let mut values = [T::default(); N];
    for (index, item) in items.iter().enumerate() {
        values[index] = read(&json.item(item, index))?;
    }
    Ok(values)
}

/// All items of a list, or the first fault.
fn list<T>(
    json: &Json<'_>,
    expected: &str,
    read: impl Fn(&Json<'_>) -> Result<T, Fault>,
    faults: &mut Vec<Fault>,
) -> Option<Vec<T>> {
    let Some(items) = json.elements() else {
        faults.push(json.unexpected(expected));
        return None;
    };
    keep(items.iter().enumerate().map(|(index, item)| read(&json.item(item, index))).collect(), faults)
}

/// A ramp of keys `[[x, y], …]`.
pub(super) fn ramp(json: &Json<'_>, interpolation: Interpolation, faults: &mut Vec<Fault>) -> Option<Ramp> {
    let keys = list(json, "keys [[x, y], …]", |key| row(key, "a key [x, y]", |item| single(item, "a number")), faults)?;
    let keys = keys.iter().map(|key: &[f64; 2]| key.map(|x| x as f32)).collect();
    let read = Ramp::new(keys, interpolation).map_err(|error| {
        let (RampError::OutOfRange { key, .. } | RampError::Unordered { key, .. }) = error else {
            return json.fault(code::RAMP, "the ramp has no key").hint("write at least one [x, y]");
        };
        let item = json.elements().and_then(|keys| Some(json.item(keys.get(key)?, key)));
        let at = item.as_ref().unwrap_or(json);
        match error {
            RampError::Unordered { x, before, .. } if x == before => {
                at.fault(code::RAMP, format!("two keys of the ramp are at x = {x}")).hint("remove one of them")
            }
            RampError::Unordered { x, before, .. } => {
                let fact = format!("the ramp's key at x = {x} comes after the key at x = {before}");
                at.fault(code::RAMP, fact).hint("order the keys by x")
            }
            _ => at.fault(code::RAMP, "a key of the ramp is too large").hint("expected numbers within ±1e30"),
        }
    });
    keep(read, faults)
}

/// Named attributes, each a list of numbers or of vectors of 3 or 4 components. Well-known names have their fixed type;
/// others are integers if every number is written without `.` and `e`, as in geometry files.
fn columns(json: &Json<'_>, expected: &str, faults: &mut Vec<Fault>) -> Option<Vec<(Name, Column)>> {
    let members = json.members(expected, faults);
    let entries = keep(members, faults)?;
    let columns = entries.iter().map(|entry| Some((entry.name.into(), keep(column(entry.name, &entry.json), faults)?)));
    // Collected first, so that the faults of all columns are reported.
    columns.collect::<Vec<_>>().into_iter().collect()
}

fn column(name: &str, json: &Json<'_>) -> Result<Column, Fault> {
    let rows = json.elements().ok_or_else(|| json.unexpected("a list of numbers or vectors"))?;
    let width = rows.first().and_then(|row| row.as_array()).map_or(1, |row| row.elements.len());
    let kind = match fixed_type(name) {
        Some(kind) if rows.is_empty() || kind.width() == width => kind,
        Some(kind) => {
            let fault = json.fault(code::WRONG_KIND, format!("`{name}` has {} per element", counted(width, "number")));
            return Err(fault.hint(format!("expected {}", counted(kind.width(), "number"))));
        }
        None => match (width, rows.iter().all(is_whole)) {
            (1, false) => ColumnType::F1,
            (3, false) => ColumnType::F3,
            (4, false) => ColumnType::F4,
            (1, true) => ColumnType::I1,
            (3, true) => ColumnType::I3,
            (4, true) => ColumnType::I4,
            _ => {
                let fact = format!("`{}` has {} per element", shown(name), counted(width, "number"));
                return Err(json.fault(code::WRONG_KIND, fact).hint("expected 1, 3 or 4"));
            }
        },
    };
    let single = |item: &Json<'_>| single(item, "a number").map(|x| x as f32);
    fn rows_of<T>(json: &Json<'_>, read: impl Fn(&Json<'_>) -> Result<T, Fault>) -> Result<Vec<T>, Fault> {
        let rows = json.elements().unwrap_or_default();
        rows.iter().enumerate().map(|(index, row)| read(&json.item(row, index))).collect()
    }
    Ok(match kind {
        ColumnType::F1 => Column::new(rows_of(json, single)?),
        ColumnType::F3 => Column::new(rows_of(json, |item| row::<f32, 3>(item, "three numbers", single))?),
        ColumnType::F4 => Column::new(rows_of(json, |item| row::<f32, 4>(item, "four numbers", single))?),
        ColumnType::I1 => Column::new(rows_of(json, integer)?),
        ColumnType::I3 => Column::new(rows_of(json, |item| row::<i32, 3>(item, "three whole numbers", integer))?),
        ColumnType::I4 => Column::new(rows_of(json, |item| row::<i32, 4>(item, "four whole numbers", integer))?),
    })
}

/// Whether all numbers of a row are written as integers.
fn is_whole(row: &Ast<'_>) -> bool {
    match row {
        Ast::NumberLit(number) => !number.value.contains(['.', 'e', 'E']),
        Ast::Array(row) => row.elements.iter().all(is_whole),
        _ => false,
    }
}
