//! Properties as attributes: grouping, names and types.

use std::collections::BTreeMap;

use engine::geometry::{Column, ColumnType, N, Name, P, UVW, fixed_type};

use super::body::Cells;
use super::header::{Property, Scalar, Shape};
use super::names::{attribute, numbered};
use crate::obj::CD;
use crate::text::free_name;

/// Attributes by name.
pub(super) type Columns = BTreeMap<Name, Column>;

/// Attributes made of three properties with special names.
pub(super) const TRIPLES: [(&str, [&str; 3]); 3] =
    [(P.name, ["x", "y", "z"]), (N.name, ["nx", "ny", "nz"]), (CD, ["red", "green", "blue"])];
/// Pairs of properties that make texture coordinates; the third component is 0.
const TEXTURES: [[&str; 2]; 3] = [["s", "t"], ["u", "v"], ["texture_u", "texture_v"]];

/// The attributes of an element's properties; one `Cells` per property.
pub(super) fn columns(properties: &[Property], cells: Vec<Cells>) -> Columns {
    let mut scalars = Scalars(BTreeMap::new());
    for (property, cells) in properties.iter().zip(cells) {
        if let (Shape::One(scalar), Cells::Floats(_) | Cells::Wholes(_)) = (property.shape, &cells) {
            scalars.0.insert(&property.name, (scalar, cells));
        }
    }
    let mut columns = Columns::new();
    for (name, parts) in TRIPLES {
        if scalars.has(&parts) {
            let [a, b, c] = parts.map(|part| scalars.floats(part, name == CD));
            insert(&mut columns, name, Column::new(rows3(&a, &b, &c)));
        }
    }
    for [u, v] in TEXTURES {
        if scalars.has(&[u, v]) && !columns.contains_key(UVW.name) {
            let [u, v] = [u, v].map(|part| scalars.floats(part, false));
            insert(&mut columns, UVW.name, Column::new(rows3(&u, &v, &vec![0.0; u.len()])));
        }
    }
    for property in properties {
        if let Some((base, _)) = numbered(&property.name)
            && let Some(column) = scalars.wide(base)
        {
            insert(&mut columns, &attribute(base, column.kind().width()), column);
        } else if let Some((_, cells)) = scalars.0.remove(property.name.as_str()) {
            let column = match cells {
                Cells::Floats(values) => Column::new(values),
                Cells::Wholes(values) => Column::new(values),
                Cells::Nothing | Cells::Indices { .. } => continue,
            };
            insert(&mut columns, &attribute(&property.name, 1), column);
        }
    }
    columns
}

/// The properties that are not yet part of an attribute: floats or integers, by name.
struct Scalars<'a>(BTreeMap<&'a str, (Scalar, Cells)>);

impl Scalars<'_> {
    fn has(&self, names: &[&str]) -> bool {
        names.iter().all(|name| self.0.contains_key(name))
    }

    /// Removes a property and returns it as floats; a colour's bytes and shorts become 0…1.
    fn floats(&mut self, name: &str, is_colour: bool) -> Vec<f32> {
        match self.0.remove(name) {
            Some((_, Cells::Floats(values))) => values,
            Some((scalar, Cells::Wholes(values))) => {
                let one = match scalar {
                    Scalar::U8 if is_colour => 255.0,
                    Scalar::U16 if is_colour => 65535.0,
                    _ => 1.0,
                };
                values.into_iter().map(|n| n as f32 / one).collect()
            }
            _ => Vec::new(),
        }
    }

    /// Removes `base.0 base.1 base.2`, and `base.3` if it exists, and returns them as one column, if they have the same
    /// type.
    fn wide(&mut self, base: &str) -> Option<Column> {
        let names = [0, 1, 2, 3].map(|part| format!("{base}.{part}"));
        let width = names.iter().take_while(|name| self.0.contains_key(name.as_str())).count();
        let names = names.get(..width.max(3))?;
        let kind = |name: &String| self.0.get(name.as_str()).map(|(scalar, _)| scalar.is_float());
        let is_float = kind(&names[0])?;
        if !names.iter().all(|name| kind(name) == Some(is_float)) {
            return None;
        }
        let mut floats = Vec::new();
        let mut wholes = Vec::new();
        for name in names {
            match self.0.remove(name.as_str()) {
                Some((_, Cells::Floats(values))) => floats.push(values),
                Some((_, Cells::Wholes(values))) => wholes.push(values),
                _ => {}
            }
        }
        match (floats.as_slice(), wholes.as_slice()) {
            ([a, b, c], []) => Some(Column::new(rows3(a, b, c))),
            ([a, b, c, d], []) => Some(Column::new(rows4(a, b, c, d))),
            ([], [a, b, c]) => Some(Column::new(rows3(a, b, c))),
            ([], [a, b, c, d]) => Some(Column::new(rows4(a, b, c, d))),
            _ => None,
        }
    }
}

fn rows3<T: Copy>(a: &[T], b: &[T], c: &[T]) -> Vec<[T; 3]> {
    a.iter().zip(b).zip(c).map(|((a, b), c)| [*a, *b, *c]).collect()
}

fn rows4<T: Copy>(a: &[T], b: &[T], c: &[T], d: &[T]) -> Vec<[T; 4]> {
    rows3(a, b, c).into_iter().zip(d).map(|([a, b, c], d)| [a, b, c, *d]).collect()
}

/// Stores a column under `name`, or under the next free name if that is taken or has another type.
fn insert(columns: &mut Columns, name: &str, column: Column) {
    let column = match (fixed_type(name), column) {
        (Some(ColumnType::F1), Column::I1(rows)) => Column::new(rows.iter().map(|n| *n as f32).collect()),
        (_, column) => column,
    };
    let conflicts = |name: &str| fixed_type(name).is_some_and(|kind| kind != column.kind());
    let name = free_name(name, |name| conflicts(name) || columns.contains_key(name));
    columns.insert(name, column);
}
