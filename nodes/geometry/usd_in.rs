//! Usd_In: curves, a mesh, points and tets from a USD file.
//!
//! The structure of the file is read once a cook; a frame decodes what it needs. Without several samples in what is read,
//! the node does not vary with the frame.

use crate::shared::source::COMPONENTS;
use crate::shared::usd::{UsdSource, refused};
use engine::files::File;
use engine::prelude::*;

params! { PARAMS:
    FILE: Param<Option<File>> = Param::file("file",
        "A usdc, usda or usdz file. A run of `#` in its name stands for the frame number, rounded down, as in \
         `fur.####.usdc`. Files that it references, and value clips, are read too.")
        .read_with(companions);
    PRIM: Param<Name> = Param::text("prim", "",
        "Path of the prim to read, with all its descendants, such as `/set/fur`. If empty, all prims are read.").fixed();
    FRAME: Param<f64> = Param::double("frame", 0.0,
        "The time code to read. Between two samples of the file values are interpolated.")
        .unit(Unit::Frame).default_current_time().of_timed_file(moves);
    SCALE: Param<f64> = Param::double("scale", 1.0,
        "Multiplies positions, velocities and widths, after the file's own unit is converted to metres. USD assumes \
         centimetres where a file gives no unit: a `scale` of 100 undoes that.")
        .soft(0.001, 1000.0);
}

const CURVES: Output = Output::new("curves", &[Kind::Curves], "All curves as one component.").may_lack();
const MESH: Output = Output::new("mesh", &[Kind::Mesh], "All meshes as one component.").may_lack();
const POINTS: Output = Output::new("points", &[Kind::Points], "All points as one component.").may_lack();
const TETS: Output = Output::new("tets", &[Kind::Tets], "All tets as one component.").may_lack();

const LEFT_OUT: Metric = Metric::new("left_out", Unit::None, "Prims and attributes of the file that are not read.")
    .warn_above(0.0, "The file has prims or attributes that are not read. `convect stats FILE` names them, and why.");
const HELD: Metric = Metric::new(
    "held",
    Unit::Frame,
    "How far the frame is before the first or after the last sample of the file.",
)
.warn_above(
    0.0,
    "The file has no samples there, so its first or last pose is held. `convect stats FILE` says how many it has. Set \
             `frame`, or cook other frames.",
);

pub(crate) static NODE: Node = Node::new(
    "Usd_In",
    2,
    "Curves, meshes, points and tets from a USD file: grooms, animation, files written by convect. Transforms are \
     applied, animated ones too, and the file's unit and up axis are converted to metres and Y up. Primvars become \
     attributes: `displayColor` is `Cd`, `st` is `uvw`, `widths` is `width`, `velocities` is `v`. Cubic curves are read \
     as their control points, subdivision surfaces as their control mesh. Invisible prims, proxies and guides are not \
     read.",
    Cook::Pure(cook),
)
.params(PARAMS)
.outputs(&[&CURVES, &MESH, &POINTS, &TETS])
.writes(&[&P])
.attributes(|_| [AttrNames::These(Vec::new()), AttrNames::All])
.metrics(&[&COMPONENTS, &LEFT_OUT, &HELD])
.changes_topology()
.checks(|params| match params.get(FILE) {
    Some(_) => Ok(()),
    None => Err(no_file()),
});

fn no_file() -> Error {
    Error::refused("it has no `file`").hint("name a usdc, usda or usdz file").of(FILE.name())
}

/// What the file is read with at a frame.
fn companions(file: &File, frame: f64) -> Result<Vec<File>> {
    let folder = file.folder();
    let names = UsdSource::of(file)?.stage.files_at(frame);
    names.iter().map(|name| folder.open(name)).collect()
}

/// Whether the file moves; if it cannot be read, the cook says why.
fn moves(params: &Params) -> bool {
    let Some(file) = params.get(FILE) else { return true };
    UsdSource::of(&file).is_ok_and(|source| source.stage.moves(&params.get(PRIM)).unwrap_or(true))
}

fn cook(cx: &Cx) -> Result<Outputs> {
    let file = cx.get(FILE).ok_or_else(no_file)?;
    let source = UsdSource::of(&file)?;
    let prim = cx.get(PRIM);
    let read = source.stage.read(&prim, cx.get(FRAME), &|name| cx.wants_named(name));
    let formats::usd::UsdReading { mut geometry, notes, hides_some } = read.map_err(|error| refused(&file, &error))?;
    // What is invisible at times is nothing there.
    if geometry.kinds().next().is_none() && !hides_some {
        let place = if prim.is_empty() { String::new() } else { format!(" at `{prim}`") };
        let fact = format!("`{}` has no curves, mesh, points or tets{place}", file.path().display());
        return Err(Error::file(match notes.first() {
            Some(note) => format!("{fact}: {note}"),
            None => fact,
        }));
    }
    if let Some((kind, name, row)) = not_finite(&geometry) {
        let fact = format!(
            "`{}` has a NaN or infinity: `{name}` of the {kind} at index {row}, counted from 0",
            file.path().display()
        );
        let hint = "`convect stats FILE --frame F` counts NaNs and infinities by attribute; repair the file, or name a `prim` without any";
        return Err(Error::file(fact).hint(hint));
    }
    cx.publish(COMPONENTS, geometry.kinds().count() as f64);
    cx.publish(LEFT_OUT, notes.len() as f64);
    cx.publish(HELD, held(&source, &prim, cx.get(FRAME))?);
    geometry.scale_lengths(cx.get(SCALE));
    let part = |kind: Kind| geometry.part(kind).cloned().map(Geometry::from).unwrap_or_default();
    let [curves, mesh, points, tets] = [Kind::Curves, Kind::Mesh, Kind::Points, Kind::Tets].map(part);
    Ok(CURVES.with(curves).and(MESH, mesh).and(POINTS, points).and(TETS, tets))
}

/// How far a time is from those that the file has samples at; 0 if nothing moves.
fn held(source: &UsdSource, prim: &str, time: f64) -> Result<f64> {
    let span = source.span(prim).map_err(|error| Error::file(error.to_string()))?;
    Ok(span.map_or(0.0, |[first, last]| (first - time).max(time - last).max(0.0)))
}

/// The first number that is NaN or infinite: its component, attribute and row.
fn not_finite(geometry: &Geometry) -> Option<(Kind, Name, usize)> {
    geometry.parts().find_map(|part| {
        let mut columns = part.columns();
        columns.find_map(|(_, name, column)| Some((part.kind(), name.clone(), column.first_not_finite()?)))
    })
}

#[cfg(test)]
mod tests;
