//! Geometry to PLY, binary little endian.

use std::collections::BTreeMap;
use std::io::Write;

use engine::geometry::{Column, ColumnType, Component, Geometry, GeometryError, Kind, Name, Owner, P, Table};

use super::COMPONENT;
use super::attributes::TRIPLES;
use super::names::property;
use crate::obj::CD;
use crate::out::Out;
use crate::{FormatError, FrameStamp};

/// Writes `geometry` as a PLY file; its numbers are finite.
///
/// # Errors
/// If components have an attribute with different types, or the bytes cannot be written.
pub(crate) fn write(geometry: &Geometry, stamp: &FrameStamp, sink: &mut dyn Write) -> Result<(), FormatError> {
    let parts: Vec<&Component> = geometry.parts().filter(|part| part.point_count() > 0).collect();
    let points = shared_columns(&parts)?;
    let vertices: usize = parts.iter().map(|part| part.point_count()).sum();
    // Indices are `int`, which every program can read.
    i32::try_from(vertices).map_err(|_| GeometryError::TooMany)?;
    let faces = geometry.mesh().filter(|mesh| mesh.element_count() > 0);
    let curves = geometry.curves().filter(|curves| curves.element_count() > 0);
    let is_plain = parts.len() <= 1 && geometry.mesh().is_none_or(|mesh| mesh.point_count() == 0 || faces.is_some());

    let mut out = Out::new(sink);
    out.text("ply\nformat binary_little_endian 1.0\ncomment convect, frame ");
    out.double(stamp.frame);
    out.text(", ");
    out.double(stamp.seconds);
    out.text(" s, metres, y up\n");
    declare("vertex", vertices, &mut out);
    let layout: Vec<Field> = points.iter().map(|(name, kind)| Field::of(name, *kind, &parts)).collect();
    layout.iter().for_each(|field| field.declare(&mut out));
    if !is_plain {
        out.text("property uchar ");
        out.text(COMPONENT);
        out.text("\n");
    }
    let small = faces.is_none_or(|mesh| mesh.faces().is_none_or(|faces| faces.runs.counts().all(|n| n < 256)));
    if let Some(mesh) = faces {
        declare("face", mesh.element_count(), &mut out);
        out.text(if small { "property list uchar" } else { "property list uint" });
        out.text(" int vertex_indices\n");
        element_fields(mesh).iter().for_each(|field| field.declare(&mut out));
    }
    if let Some(curves) = curves {
        declare("edge", curves.point_count() - curves.element_count(), &mut out);
        out.text("property int vertex1\nproperty int vertex2\n");
        declare("curve", curves.element_count(), &mut out);
        out.text("property uint count\n");
        element_fields(curves).iter().for_each(|field| field.declare(&mut out));
    }
    out.text("end_header\n");

    for part in &parts {
        let columns = columns(&layout, part.table(Owner::Point));
        for row in 0..part.point_count() {
            columns.iter().for_each(|(field, column)| field.put(*column, row, &mut out));
            if !is_plain {
                out.bytes(&[part.kind() as u8]);
            }
            out.pour()?;
        }
    }
    if let Some(mesh) = faces {
        // Curves come first.
        let first = curves.map_or(0, |curves| curves.point_count()) as u32;
        put_faces(mesh, first, small, &mut out)?;
    }
    if let Some(curves) = curves {
        put_curves(curves, &mut out)?;
    }
    out.finish()?;
    Ok(())
}

fn put_faces(mesh: &Component, first: u32, small: bool, out: &mut Out) -> Result<(), FormatError> {
    let fields = element_fields(mesh);
    let columns = columns(&fields, mesh.table(Owner::Element));
    for (row, face) in mesh.faces().into_iter().flat_map(|faces| faces.iter()).enumerate() {
        let count = (face.len() as u32).to_le_bytes();
        out.bytes(if small { &count[..1] } else { &count });
        face.iter().for_each(|corner| out.bytes(&(first + corner).to_le_bytes()));
        columns.iter().for_each(|(field, column)| field.put(*column, row, out));
        out.pour()?;
    }
    Ok(())
}

fn put_curves(curves: &Component, out: &mut Out) -> Result<(), FormatError> {
    for range in curves.runs().ranges() {
        for cv in range.start..range.end - 1 {
            out.bytes(&(cv as u32).to_le_bytes());
            out.bytes(&(cv as u32 + 1).to_le_bytes());
        }
        out.pour()?;
    }
    let fields = element_fields(curves);
    let columns = columns(&fields, curves.table(Owner::Element));
    for (row, count) in curves.runs().counts().enumerate() {
        out.bytes(&count.to_le_bytes());
        columns.iter().for_each(|(field, column)| field.put(*column, row, out));
        out.pour()?;
    }
    Ok(())
}

fn declare(element: &str, rows: usize, out: &mut Out) {
    out.text("element ");
    out.text(element);
    out.text(" ");
    out.whole(rows);
    out.text("\n");
}

/// The point attributes of all parts, positions first; every part is written with all of them.
fn shared_columns(parts: &[&Component]) -> Result<Vec<(Name, ColumnType)>, FormatError> {
    let mut columns: BTreeMap<Name, (ColumnType, Kind)> = BTreeMap::new();
    for part in parts {
        for (name, column) in part.table(Owner::Point).iter() {
            let (kind, first) = *columns.entry(name.clone()).or_insert((column.kind(), part.kind()));
            if kind != column.kind() {
                return Err(FormatError::TypesDiffer { name: name.clone(), first, second: part.kind() });
            }
        }
    }
    columns.remove(P.name);
    let others = columns.into_iter().map(|(name, (kind, _))| (name, kind));
    Ok(std::iter::once((Name::from(P.name), ColumnType::F3)).chain(others).collect())
}

/// An attribute as properties.
struct Field {
    name: Name,
    kind: ColumnType,
    /// Whether it is a colour whose numbers are all multiples of 1/255.
    as_bytes: bool,
}

impl Field {
    fn of(name: &Name, kind: ColumnType, parts: &[&Component]) -> Self {
        let is_byte = |x: &f32| (byte_of(*x) as f32 / 255.0).to_bits() == x.to_bits();
        let all_bytes = |part: &&Component| {
            let rows = part.table(Owner::Point).get::<[f32; 3]>(name);
            rows.is_none_or(|rows| rows.as_flattened().iter().all(is_byte))
        };
        let is_colour = &**name == CD && kind == ColumnType::F3;
        Self { name: name.clone(), kind, as_bytes: is_colour && parts.iter().all(all_bytes) }
    }

    fn declare(&self, out: &mut Out) {
        let scalar = match (self.as_bytes, self.kind.is_float()) {
            (true, _) => "uchar",
            (_, true) => "float",
            (_, false) => "int",
        };
        let width = self.kind.width();
        let own = TRIPLES.iter().find(|(name, _)| **name == *self.name && self.kind == ColumnType::F3);
        for part in 0..width {
            out.text("property ");
            out.text(scalar);
            out.text(" ");
            match own {
                Some((_, names)) => out.text(names[part]),
                None => out.text(&property(&self.name, part, width)),
            }
            out.text("\n");
        }
    }

    /// The row of a column of this field; zeros if there is no column.
    fn put(&self, column: Option<&Column>, row: usize, out: &mut Out) {
        let mut floats = |numbers: &[f32]| {
            for x in numbers {
                if self.as_bytes { out.bytes(&[byte_of(*x)]) } else { out.bytes(&x.to_le_bytes()) }
            }
        };
        match column {
            Some(Column::F1(rows)) => floats(&[rows[row]]),
            Some(Column::F3(rows)) => floats(&rows[row]),
            Some(Column::F4(rows)) => floats(&rows[row]),
            Some(Column::I1(rows)) => out.bytes(&rows[row].to_le_bytes()),
            Some(Column::I3(rows)) => rows[row].iter().for_each(|n| out.bytes(&n.to_le_bytes())),
            Some(Column::I4(rows)) => rows[row].iter().for_each(|n| out.bytes(&n.to_le_bytes())),
            None => floats(&[0.0; 4][..self.kind.width()]),
        }
    }
}

fn byte_of(x: f32) -> u8 {
    (x * 255.0).round() as u8
}

/// The attributes of a component's elements.
fn element_fields(component: &Component) -> Vec<Field> {
    let field = |(name, column): (&Name, &Column)| Field { name: name.clone(), kind: column.kind(), as_bytes: false };
    component.table(Owner::Element).iter().map(field).collect()
}

fn columns<'a>(fields: &'a [Field], table: &'a Table) -> Vec<(&'a Field, Option<&'a Column>)> {
    fields.iter().map(|field| (field, table.column(&field.name))).collect()
}
