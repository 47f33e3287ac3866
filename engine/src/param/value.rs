//! Values of params: the types that nodes get, and the type-erased form that the engine keeps.

use std::sync::Arc;

use numerics::ramp::{Interpolation, Ramp};

use super::code::Code;
use crate::files::File;
use crate::geometry::{Column, Name};
use crate::key::Hasher;

/// A range a…b from which a node draws, inclusive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// The lower end.
    pub low: f32,
    /// The upper end.
    pub high: f32,
}

impl Span {
    /// Linear interpolation: `low` at 0, `high` at 1.
    pub fn at(self, share: f32) -> f32 {
        self.low + (self.high - self.low) * share
    }
}

/// A number that a point attribute may scale (⊗): `value` × the attribute.
#[derive(Clone, Debug, PartialEq)]
pub struct Maskable {
    /// The number, or the factor of the attribute.
    pub value: f32,
    /// The point attribute that scales it.
    pub attribute: Option<Name>,
}

impl From<f32> for Maskable {
    /// The number alone, without a mask.
    fn from(value: f32) -> Self {
        Self { value, attribute: None }
    }
}

/// A rotation, a unit quaternion x, y, z, w.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn(pub [f64; 4]);

/// A seed of random numbers, mixed with the scene's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seed(pub u32);

/// The erased value of a param at one time.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Not set.
    Nothing,
    /// A number.
    Float(f64),
    /// A whole number.
    Int(i64),
    /// `true` or `false`.
    Bool(bool),
    /// Two numbers.
    Vec2([f64; 2]),
    /// A vector.
    Vec3([f64; 3]),
    /// Three whole numbers.
    Int3([i64; 3]),
    /// A range a…b.
    Span([f64; 2]),
    /// A rotation as a unit quaternion x, y, z, w.
    Turn([f64; 4]),
    /// One of the options, by index.
    Choice(usize),
    /// A curve over 0…1.
    Ramp(Arc<Ramp>),
    /// A string.
    Text(Name),
    /// Strings.
    Texts(Arc<Vec<Name>>),
    /// An opened file; `None` if no file is set.
    File(Option<File>),
    /// A number that an attribute may scale.
    Masked(f64, Option<Name>),
    /// Vectors.
    Vec3s(Arc<Vec<[f32; 3]>>),
    /// Whole numbers.
    Ints(Arc<Vec<i32>>),
    /// Corners of tets.
    Tets(Arc<Vec<[u32; 4]>>),
    /// Named attributes.
    Columns(Arc<Vec<(Name, Column)>>),
    /// Assignments with the controls that they read.
    Code(Code),
}

impl Value {
    /// Numbers of rows that keep two lists from being interpolated one by one.
    pub(crate) fn different_lengths(&self, other: &Self) -> Option<[usize; 2]> {
        let lengths = match (self, other) {
            (Self::Vec3s(a), Self::Vec3s(b)) => [a.len(), b.len()],
            (Self::Ramp(a), Self::Ramp(b)) => [a.keys().len(), b.keys().len()],
            _ => return None,
        };
        (lengths[0] != lengths[1]).then_some(lengths)
    }

    /// Adds this value to a hash.
    pub fn add_to(&self, key: &mut Hasher) {
        match self {
            Self::Nothing => key.tag(20),
            Self::Float(x) => key.tag(1).f64(*x),
            Self::Int(i) => key.tag(2).i64(*i),
            Self::Bool(b) => key.tag(3).i64(i64::from(*b)),
            Self::Vec2(v) => v.iter().fold(key.tag(4), |key, x| key.f64(*x)),
            Self::Vec3(v) => v.iter().fold(key.tag(5), |key, x| key.f64(*x)),
            Self::Int3(v) => v.iter().fold(key.tag(6), |key, i| key.i64(*i)),
            Self::Span(v) => v.iter().fold(key.tag(7), |key, x| key.f64(*x)),
            Self::Turn(q) => q.iter().fold(key.tag(8), |key, x| key.f64(*x)),
            Self::Choice(i) => key.tag(9).i64(*i as i64),
            Self::Ramp(ramp) => {
                let key = key.tag(10).i64(ramp.interpolation() as i64).i64(ramp.keys().len() as i64);
                ramp.keys().iter().fold(key, |key, [x, y]| key.f64(f64::from(*x)).f64(f64::from(*y)))
            }
            Self::Text(text) => key.tag(11).text(text),
            Self::Texts(texts) => {
                let key = key.tag(12).i64(texts.len() as i64);
                texts.iter().fold(key, |key, text| key.text(text))
            }
            Self::File(None) => key.tag(13),
            Self::File(Some(file)) => key.tag(14).text(file.extension()).key(file.key()),
            Self::Masked(x, attribute) => key.tag(15).f64(*x).text(attribute.as_deref().unwrap_or_default()),
            Self::Vec3s(rows) => {
                let key = key.tag(16).i64(rows.len() as i64);
                rows.as_flattened().iter().fold(key, |key, x| key.bytes(&x.to_le_bytes()))
            }
            Self::Ints(rows) => {
                let key = key.tag(17).i64(rows.len() as i64);
                rows.iter().fold(key, |key, i| key.bytes(&i.to_le_bytes()))
            }
            Self::Tets(rows) => {
                let key = key.tag(18).i64(rows.len() as i64);
                rows.as_flattened().iter().fold(key, |key, i| key.bytes(&i.to_le_bytes()))
            }
            Self::Columns(columns) => {
                let key = key.tag(19).i64(columns.len() as i64);
                columns.iter().fold(key, |key, (name, column)| {
                    key.text(name).i64(column.kind() as i64).i64(column.len() as i64).bytes(&column.to_bytes())
                })
            }
            Self::Code(code) => code.add_to(key.tag(21)),
        };
    }
}

/// Shows a value as it is written in a graph file.
impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        fn list<T: std::fmt::Display>(f: &mut std::fmt::Formatter<'_>, items: &[T]) -> std::fmt::Result {
            let text: Vec<String> = items.iter().map(ToString::to_string).collect();
            write!(f, "[{}]", text.join(", "))
        }
        match self {
            Self::Nothing => write!(f, "none"),
            Self::Float(x) => write!(f, "{x}"),
            Self::Masked(x, None) => write!(f, "{x}"),
            Self::Masked(x, Some(attribute)) => write!(f, r#"{{"value": {x}, "attribute": "{attribute}"}}"#),
            Self::Int(i) => write!(f, "{i}"),
            Self::Bool(b) => write!(f, "{b}"),
            Self::Vec2(v) | Self::Span(v) => list(f, v),
            Self::Vec3(v) => list(f, v),
            Self::Int3(v) => list(f, v),
            Self::Turn(q) => list(f, q),
            Self::Choice(i) => write!(f, "{i}"),
            Self::Ramp(ramp) => {
                let keys: Vec<String> = ramp.keys().iter().map(|[x, y]| format!("[{x}, {y}]")).collect();
                let between = match ramp.interpolation() {
                    Interpolation::Linear => "",
                    Interpolation::Smooth => r#", "interpolation": "smooth""#,
                    Interpolation::Constant => r#", "interpolation": "constant""#,
                };
                write!(f, r#"{{"ramp": [{}]{between}}}"#, keys.join(", "))
            }
            Self::Text(text) => write!(f, "{text:?}"),
            Self::Texts(texts) => list(f, &texts.iter().map(|text| format!("{text:?}")).collect::<Vec<_>>()),
            Self::File(None) => write!(f, "none"),
            Self::File(Some(file)) => write!(f, "{:?}", file.path().display().to_string()),
            Self::Vec3s(rows) => write!(f, "{} vectors", rows.len()),
            Self::Ints(rows) => write!(f, "{} whole numbers", rows.len()),
            Self::Tets(rows) => write!(f, "{} tets", rows.len()),
            Self::Columns(columns) => write!(f, "{} attributes", columns.len()),
            Self::Code(code) => write!(f, "{code}"),
        }
    }
}
