//! Geometry to json.

use std::io::Write;

use engine::geometry::{
    Column, Component, Geometry, GeometryError, Grid, Kind, Owner, P, Table, Topology, Volume, dense_len,
};

use super::table_key;
use crate::out::Out;
use crate::{FormatError, FrameStamp};

/// Writes `geometry` as json; its numbers are finite.
///
/// # Errors
/// If the bytes cannot be written, or a volume's box is too large for dense arrays.
pub(crate) fn write(geometry: &Geometry, stamp: &FrameStamp, sink: &mut dyn Write) -> Result<(), FormatError> {
    let mut out = Out::new(sink);
    out.text("{\"frame\": ");
    out.double(stamp.frame);
    out.text(", \"time\": ");
    out.double(stamp.seconds);
    for part in geometry.parts() {
        component(part, &mut out)?;
    }
    if let Some(found) = geometry.volume() {
        volume(found, &mut out)?;
    }
    out.text("}\n");
    out.finish()?;
    Ok(())
}

fn component(component: &Component, out: &mut Out) -> Result<(), FormatError> {
    out.text(",\n \"");
    out.text(component.kind().name());
    out.text("\": {");
    match component.topology() {
        Topology::Curves(runs) => {
            out.text("\"counts\": ");
            list(runs.counts(), |count, out| out.whole(count), out)?;
            out.text(", ");
        }
        Topology::Mesh(faces) => {
            out.text("\"counts\": ");
            list(faces.runs.counts(), |count, out| out.whole(count), out)?;
            out.text(", \"indices\": ");
            list(&faces.corners, |corner, out| out.whole(*corner), out)?;
            out.text(", ");
        }
        Topology::Tets(tets) => {
            out.text("\"indices\": ");
            list(tets.iter(), |tet, out| row(tet, |corner, out| out.whole(corner), out), out)?;
            out.text(", ");
        }
        Topology::Points => {}
    }
    out.text("\"points\": ");
    list(component.positions(), |position, out| row(position, |x, out| out.float(x), out), out)?;
    for owner in Owner::ALL {
        if let Some(key) = table_key(component.kind(), owner) {
            out.text(",\n  ");
            table(key, component.table(owner), owner == Owner::Point, out)?;
        }
    }
    out.text("}");
    Ok(())
}

fn volume(volume: &Volume, out: &mut Out) -> Result<(), FormatError> {
    for (name, field) in volume.fields() {
        dense_len(field.size()).map_err(|error| GeometryError::Field { name, error })?;
    }
    let (level, velocity) = (volume.level_grid(), volume.velocity_grid());
    out.text(",\n \"volume\": {");
    grid("", level, out);
    let values = volume.level_set();
    if values.background() != Volume::default_background(&level, values.iter_dense()) {
        out.text(", \"background\": ");
        out.float(values.background());
    }
    if velocity != level {
        out.text(",\n  ");
        grid("velocity_", velocity, out);
    }
    for (name, field) in volume.fields() {
        out.text(",\n  \"");
        out.text(name);
        out.text("\": ");
        list(field.iter_dense(), |x, out| out.float(x), out)?;
    }
    out.text(",\n  ");
    if let Some(key) = table_key(Kind::Volume, Owner::Once) {
        table(key, volume.once(), false, out)?;
    }
    out.text("}");
    Ok(())
}

/// The keys of a grid, each preceded by `prefix`.
fn grid(prefix: &str, grid: Grid, out: &mut Out) {
    out.text(&format!("\"{prefix}origin\": "));
    row(&grid.origin, |x, out| out.float(x), out);
    out.text(&format!(", \"{prefix}cell\": "));
    out.float(grid.cell);
    out.text(&format!(", \"{prefix}size\": "));
    row(&grid.size, |n, out| out.whole(n), out);
}

/// The columns of a table by name, without the positions, which have their own key.
fn table(key: &str, table: &Table, has_positions: bool, out: &mut Out) -> Result<(), FormatError> {
    out.text("\"");
    out.text(key);
    out.text("\": {");
    let columns = table.iter().filter(|(name, _)| !(has_positions && &***name == P.name));
    for (k, (name, column)) in columns.enumerate() {
        out.text(if k > 0 { ",\n   " } else { "" });
        out.text(&serde_json::Value::from(&**name).to_string());
        out.text(": ");
        rows(column, out)?;
    }
    out.text("}");
    Ok(())
}

fn rows(column: &Column, out: &mut Out) -> Result<(), FormatError> {
    let float = |x: f32, out: &mut Out| out.float(x);
    let whole = |n: i32, out: &mut Out| out.whole(n);
    match column {
        Column::F1(rows) => list(rows.iter(), |x, out| float(*x, out), out),
        Column::F3(rows) => list(rows.iter(), |x, out| row(x, float, out), out),
        Column::F4(rows) => list(rows.iter(), |x, out| row(x, float, out), out),
        Column::I1(rows) => list(rows.iter(), |n, out| whole(*n, out), out),
        Column::I3(rows) => list(rows.iter(), |n, out| row(n, whole, out), out),
        Column::I4(rows) => list(rows.iter(), |n, out| row(n, whole, out), out),
    }
}

/// `[a, b, …]`.
fn list<T>(items: impl IntoIterator<Item = T>, put: impl Fn(T, &mut Out), out: &mut Out) -> Result<(), FormatError> {
    out.text("[");
    for (k, item) in items.into_iter().enumerate() {
        out.text(if k > 0 { ", " } else { "" });
        put(item, out);
        out.pour()?;
    }
    out.text("]");
    Ok(())
}

/// `[a, b, c]`: one row.
fn row<const N: usize, T: Copy>(row: &[T; N], put: impl Fn(T, &mut Out), out: &mut Out) {
    out.text("[");
    for (k, item) in row.iter().enumerate() {
        out.text(if k > 0 { ", " } else { "" });
        put(*item, out);
    }
    out.text("]");
}
