//! Geometry to OBJ text.

use std::io::Write;

use engine::geometry::{Component, Geometry, N, Owner, Topology, UVW};

use super::CD;
use crate::out::Out;
use crate::{FormatError, FrameStamp};

/// Writes `geometry` as an OBJ file; its numbers are finite.
///
/// # Errors
/// If the bytes cannot be written.
pub(crate) fn write(geometry: &Geometry, stamp: &FrameStamp, sink: &mut dyn Write) -> Result<(), FormatError> {
    let mut out = Out::new(sink);
    out.text("# convect, frame ");
    out.double(stamp.frame);
    out.text(", ");
    out.double(stamp.seconds);
    out.text(" s, metres, y up\n");
    let mut first = First { vertex: 1, texture: 1, normal: 1 };
    for component in geometry.parts().filter(|component| component.point_count() > 0) {
        object(component, &mut first, &mut out)?;
    }
    out.finish()?;
    Ok(())
}

/// The index that the next `v`, `vt` and `vn` will have.
struct First {
    vertex: usize,
    texture: usize,
    normal: usize,
}

fn object(component: &Component, first: &mut First, out: &mut Out) -> Result<(), FormatError> {
    let rows = |name| component.table(Owner::Point).get::<[f32; 3]>(name);
    let (colours, normals, textures) = (rows(CD), rows(N.name), rows(UVW.name));
    out.text("o ");
    out.text(component.kind().name());
    out.text("\n");
    for (row, position) in component.positions().iter().enumerate() {
        out.text("v");
        floats(position, out);
        if let Some(colours) = colours {
            floats(&colours[row], out);
        }
        out.text("\n");
        out.pour()?;
    }
    for (statement, rows) in [("vt", textures), ("vn", normals)] {
        for row in rows.unwrap_or_default() {
            out.text(statement);
            floats(row, out);
            out.text("\n");
            out.pour()?;
        }
    }
    // An `l` line can reference texture coordinates but no normals, a `p` line neither.
    let corner = |point: usize, with_normal: bool, out: &mut Out| {
        out.text(" ");
        out.whole(first.vertex + point);
        let normal = normals.filter(|_| with_normal);
        if textures.is_some() {
            out.text("/");
            out.whole(first.texture + point);
        } else if normal.is_some() {
            out.text("/");
        }
        if normal.is_some() {
            out.text("/");
            out.whole(first.normal + point);
        }
    };
    match component.topology() {
        Topology::Curves(runs) => {
            for range in runs.ranges() {
                out.text("l");
                for point in range {
                    corner(point, false, out);
                }
                out.text("\n");
                out.pour()?;
            }
        }
        Topology::Mesh(faces) => {
            for face in faces.iter() {
                out.text("f");
                for point in face {
                    corner(*point as usize, true, out);
                }
                out.text("\n");
                out.pour()?;
            }
        }
        Topology::Points | Topology::Tets(_) => {
            for point in 0..component.point_count() {
                out.text("p ");
                out.whole(first.vertex + point);
                out.text("\n");
                out.pour()?;
            }
        }
    }
    first.vertex += component.point_count();
    first.texture += textures.map_or(0, <[_]>::len);
    first.normal += normals.map_or(0, <[_]>::len);
    Ok(())
}

fn floats(row: &[f32; 3], out: &mut Out) {
    for number in row {
        out.text(" ");
        out.float(*number);
    }
}
