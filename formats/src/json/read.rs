//! Json to geometry.
//!
//! The text is parsed in one pass, key by key, directly into columns, without a tree of values.

use std::collections::BTreeSet;
use std::fmt;

use engine::geometry::{Geometry, Kind, Owner, VOLUME_FIELDS};
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, Visitor};
use serde_json::value::RawValue;

use super::numbers::{NumbersOf, float};
use super::part::Part;
use super::table_key;
use crate::{FilePosition, FormatError};

/// The geometry of a json file.
///
/// # Errors
/// With line and column: if the text is not json, or not a geometry.
pub(crate) fn read(bytes: &[u8]) -> Result<Geometry, FormatError> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let fact = "a byte is not valid UTF-8";
        FormatError::with_hint(FilePosition::Byte(error.valid_up_to()), fact, "save the file as UTF-8")
    })?;
    let mut json = serde_json::Deserializer::from_str(text);
    let geometry = json_object(GeometryOf, &mut json).and_then(|geometry| json.end().map(|()| geometry));
    geometry.map_err(|error| {
        let full = error.to_string();
        let fact = full.rsplit_once(" at line ").map_or(full.as_str(), |(fact, _)| fact).to_owned();
        let hint = error.is_eof().then_some("the file is truncated: write it again");
        FormatError::Content { position: FilePosition::Column(error.line(), error.column()), fact, hint }
    })
}

fn json_object<'de, V: Visitor<'de>, D: Deserializer<'de>>(visitor: V, json: D) -> Result<V::Value, D::Error> {
    json.deserialize_map(visitor)
}

/// Reads the whole file.
struct GeometryOf;

impl<'de> Visitor<'de> for GeometryOf {
    type Value = Geometry;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an object with a key per component, such as `curves`")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Geometry, A::Error> {
        let mut geometry = Geometry::default();
        let mut seen = Seen::default();
        while let Some(key) = map.next_key::<String>()? {
            seen.once::<A::Error>(&key)?;
            match Kind::ALL.into_iter().find(|kind| kind.name() == key) {
                Some(kind) => {
                    let part = map.next_value_seed(PartOf(kind))?;
                    part.put_into(&mut geometry, kind).map_err(|fact| A::Error::custom(format!("`{kind}`: {fact}")))?;
                }
                None if key == "frame" || key == "time" => {
                    map.next_value::<f64>()?;
                }
                None => return Err(unknown_key(&key, ["frame", "time"].into_iter().chain(Kind::ALL.map(Kind::name)))),
            }
        }
        Ok(geometry)
    }
}

/// Reads the object of a component.
struct PartOf(Kind);

impl<'de> DeserializeSeed<'de> for PartOf {
    type Value = Part;

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<Part, D::Error> {
        json_object(self, json)
    }
}

impl<'de> Visitor<'de> for PartOf {
    type Value = Part;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "an object for `{}`", self.0)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Part, A::Error> {
        let kind = self.0;
        let mut part = Part::default();
        let mut seen = Seen::default();
        while let Some(key) = map.next_key::<String>()? {
            seen.once::<A::Error>(&key)?;
            match (key.as_str(), kind) {
                ("counts", Kind::Curves | Kind::Mesh) => part.counts = Some(map.next_value()?),
                ("indices", Kind::Mesh) => part.corners = Some(map.next_value()?),
                ("indices", Kind::Tets) => part.tets = Some(map.next_value()?),
                ("points", Kind::Curves | Kind::Mesh | Kind::Points | Kind::Tets) => {
                    part.points = Some(map.next_value_seed(NumbersOf(&key))?);
                }
                ("origin", Kind::Volume) => part.grid.origin = Some(map.next_value_seed(NumbersOf(&key))?),
                ("cell", Kind::Volume) => part.grid.cell = Some(one_float(&mut map, &key)?),
                ("size", Kind::Volume) => part.grid.size = Some(map.next_value()?),
                ("background", Kind::Volume) => part.background = Some(one_float(&mut map, &key)?),
                ("velocity_origin", Kind::Volume) => {
                    part.velocity_grid.origin = Some(map.next_value_seed(NumbersOf(&key))?);
                }
                ("velocity_cell", Kind::Volume) => part.velocity_grid.cell = Some(one_float(&mut map, &key)?),
                ("velocity_size", Kind::Volume) => part.velocity_grid.size = Some(map.next_value()?),
                (field, _) => {
                    let owner = Owner::ALL.into_iter().position(|owner| table_key(kind, owner) == Some(field));
                    let array = VOLUME_FIELDS.iter().position(|name| kind == Kind::Volume && *name == field);
                    match (owner, array) {
                        (Some(owner), _) => map.next_value_seed(TableInto(&mut part.tables[owner]))?,
                        (_, Some(k)) => part.fields[k] = Some(map.next_value_seed(NumbersOf(&key))?),
                        _ => return Err(unknown_key(&key, part_keys(kind))),
                    }
                }
            }
        }
        Ok(part)
    }
}

/// The value of a key that is one float.
fn one_float<'de, A: MapAccess<'de>>(map: &mut A, key: &str) -> Result<f32, A::Error> {
    float(map.next_value::<&RawValue>()?.get()).map_err(|fact| A::Error::custom(format!("`{key}`: {fact}")))
}

/// The keys of a component's object.
fn part_keys(kind: Kind) -> impl Iterator<Item = &'static str> {
    let own: &[&str] = match kind {
        Kind::Curves => &["counts", "points"],
        Kind::Mesh => &["counts", "indices", "points"],
        Kind::Points => &["points"],
        Kind::Tets => &["indices", "points"],
        Kind::Volume => &["origin", "cell", "size", "background", "velocity_origin", "velocity_cell", "velocity_size"],
    };
    let fields: &[&str] = if kind == Kind::Volume { &VOLUME_FIELDS } else { &[] };
    own.iter().chain(fields).copied().chain(Owner::ALL.into_iter().filter_map(move |owner| table_key(kind, owner)))
}

/// Reads a table's columns and appends them.
struct TableInto<'a>(&'a mut Vec<super::part::NamedNumbers>);

impl<'de> DeserializeSeed<'de> for TableInto<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<(), D::Error> {
        json_object(self, json)
    }
}

impl<'de> Visitor<'de> for TableInto<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an object with a list of rows per attribute")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut seen = Seen::default();
        while let Some(name) = map.next_key::<String>()? {
            seen.once::<A::Error>(&name)?;
            let numbers = map.next_value_seed(NumbersOf(&name))?;
            self.0.push((name.into(), numbers));
        }
        Ok(())
    }
}

/// Keys of an object seen so far.
#[derive(Default)]
struct Seen(BTreeSet<String>);

impl Seen {
    fn once<E: Error>(&mut self, key: &str) -> Result<(), E> {
        if self.0.insert(key.to_owned()) { Ok(()) } else { Err(E::custom(format!("`{key}` appears twice"))) }
    }
}

fn unknown_key<E: Error>(key: &str, known: impl Iterator<Item = &'static str>) -> E {
    let known = known.map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", ");
    E::custom(format!("unknown key `{key}`, expected one of {known}"))
}
