//! Differences as text and as JSON.

use std::fmt::Write as _;
use std::path::PathBuf;

use engine::geometry::{ColumnType, Kind, Owner};
use serde_json::{Value, json};

use super::Compared;
use super::compare::{AttributePath, Finding, FindingKind, Side, Values};
use crate::numbers::{decimal, short};

/// JSON: `same`, and a list of pairs with their findings, including differences within the tolerance.
pub(super) fn json(all: &[Compared], tolerance: Option<f64>) -> String {
    let path = |path: &Option<PathBuf>| json!(path.as_ref().map(|path| path.display().to_string()));
    let pairs: Vec<Value> = all
        .iter()
        .map(|one| {
            let findings: Vec<Value> = one.findings.iter().map(finding_json).collect();
            let mut pair =
                json!({"a": path(&one.pair.a), "b": path(&one.pair.b), "same": !one.differs(), "findings": findings});
            if let Some(time) = one.pair.time {
                pair["frame"] = json!(time);
            }
            pair
        })
        .collect();
    let same = !all.iter().any(Compared::differs);
    let all = json!({"same": same, "tolerance": tolerance, "pairs": pairs});
    serde_json::to_string_pretty(&all).unwrap_or_default() + "\n"
}

fn finding_json(finding: &Finding) -> Value {
    let mut object = json!({"component": finding.kind.name(), "same": !finding.differs()});
    let mut put = |key: &str, value: Value| object[key] = value;
    if let FindingKind::Attribute(attribute, _) | FindingKind::Type(attribute, _) | FindingKind::Values(attribute, _) =
        &finding.what
    {
        put("attribute", json!(*attribute.name));
        put("of", json!(row_name(finding.kind, attribute.owner)));
    }
    match &finding.what {
        FindingKind::Component(side) | FindingKind::Attribute(_, side) => put("only_in", json!(side_name(*side))),
        FindingKind::Count { of, counts } => {
            put("of", json!(of));
            put("counts", json!(counts));
        }
        FindingKind::Topology { of, differing, elements, first } => {
            put("of", json!(of));
            put("differing", json!(differing));
            put("elements", json!(elements));
            put("first", json!(first));
        }
        FindingKind::Grid { of, grids } => {
            put("of", json!(of));
            let grid = |k: usize| json!({"origin": grids[k].origin, "cell": grids[k].cell, "size": grids[k].size});
            put("grids", json!([grid(0), grid(1)]));
        }
        FindingKind::Type(_, types) => put("types", json!(types.map(|kind| kind.to_string()))),
        FindingKind::Values(_, values) => {
            put("numbers", json!(values.numbers));
            put("differing", json!(values.differing));
            put("not_finite", json!(values.not_finite));
            put("largest", json!(values.largest));
            put("largest_row", json!(values.largest_row));
            put("mean", json!(values.mean));
            let stored = |value: f64| if values.kind.is_float() { decimal(value as f32) } else { value };
            let first = values
                .first
                .map(|first| json!({"row": first.row, "axis": first.lane, "values": first.values.map(stored)}));
            put("first", json!(first));
        }
    }
    object
}

fn side_name(side: Side) -> &'static str {
    match side {
        Side::A => "a",
        Side::B => "b",
    }
}

/// What a row of an attribute is.
fn row_name(kind: Kind, owner: Option<Owner>) -> &'static str {
    match (owner, kind) {
        (None, _) => "cell or face",
        (Some(Owner::Point), _) => "point",
        (Some(Owner::Element), Kind::Curves) => "curve",
        (Some(Owner::Element), Kind::Mesh) => "face",
        (Some(Owner::Element), _) => "tet",
        (Some(Owner::Once), _) => "component",
    }
}

/// Text: one line for each difference, and the verdict.
pub(super) fn text(all: &[Compared], tolerance: Option<f64>) -> String {
    let mut text = String::new();
    for one in all {
        let time = one.pair.time.filter(|_| all.len() > 1);
        let time = time.map(|time| format!(" at frame {time}")).unwrap_or_default();
        let named =
            |path: &Option<PathBuf>| path.as_ref().map(|path| format!("{}{time}", path.display())).unwrap_or_default();
        let (a, b) = (named(&one.pair.a), named(&one.pair.b));
        match (&one.pair.a, &one.pair.b) {
            (Some(_), None) if one.pair.time.is_some() => _ = writeln!(text, "{a}: no such frame in the other"),
            (None, _) if one.pair.time.is_some() => _ = writeln!(text, "{b}: no such frame in the other"),
            (Some(_), None) => _ = writeln!(text, "{a}: no file to compare it with"),
            (None, _) => _ = writeln!(text, "{b}: no file to compare it with"),
            _ if all.len() > 1 && one.differs() => _ = writeln!(text, "{a} and {b}:"),
            _ => {}
        }
        for finding in one.findings.iter().filter(|finding| finding.differs()) {
            let indent = if all.len() > 1 { "  " } else { "" };
            let _ = writeln!(text, "{indent}{}: {}", finding.kind, line(finding, &a, &b));
        }
    }
    let differing = all.iter().filter(|one| one.differs()).count();
    let _ = match (differing, tolerance) {
        (0, None) => writeln!(text, "the same"),
        (0, Some(tolerance)) => writeln!(text, "the same within {tolerance}{}", largest_difference(all)),
        (_, _) if all.len() > 1 => writeln!(text, "different: {differing} of {} pairs", all.len()),
        _ => writeln!(text, "different"),
    };
    text
}

/// The largest difference within the tolerance.
fn largest_difference(all: &[Compared]) -> String {
    let largest = all.iter().flat_map(|one| &one.findings).filter_map(|finding| match &finding.what {
        FindingKind::Values(attribute, values) => Some((values.largest, attribute, finding.kind)),
        _ => None,
    });
    match largest.max_by(|(a, ..), (b, ..)| a.total_cmp(b)) {
        Some((largest, attribute, kind)) => {
            format!("; `{}` of {kind} differs by at most {}", attribute.name, short(largest))
        }
        None => ", bit for bit".to_owned(),
    }
}

fn line(finding: &Finding, a: &str, b: &str) -> String {
    let side = |side: Side| if side == Side::A { a } else { b };
    match &finding.what {
        FindingKind::Component(found) => format!("only in {}", side(*found)),
        FindingKind::Attribute(attribute, found) => format!("`{}`: only in {}", attribute.name, side(*found)),
        FindingKind::Count { of, counts: [a, b] } => format!("{a} {of} and {b}"),
        FindingKind::Topology { of, differing, elements, first } => {
            format!("{differing} of {elements} {of} have different points; the first is {first}")
        }
        FindingKind::Grid { of, grids: [a, b] } => {
            let grid = |grid: &engine::geometry::Grid| {
                let [x, y, z] = grid.size;
                format!("{x} × {y} × {z} cells of {} m from {:?}", grid.cell, grid.origin)
            };
            format!("{of}: {} and {}", grid(a), grid(b))
        }
        FindingKind::Type(attribute, [a, b]) => format!("`{}`: {a} and {b}", attribute.name),
        FindingKind::Values(attribute, values) => values_line(finding.kind, attribute, values),
    }
}

fn values_line(kind: Kind, attribute: &AttributePath, values: &Values) -> String {
    let Values { numbers, differing, not_finite, .. } = values;
    let name = row_name(kind, attribute.owner);
    let mut line = format!("`{}`: {differing} of {numbers} numbers differ", attribute.name);
    let _ = match values.largest > 0.0 {
        true => {
            let (largest, row, mean) = (short(values.largest), values.largest_row, short(values.mean));
            write!(line, ", by at most {largest} ({name} {row}) and {mean} on average")
        }
        false if *not_finite == 0 => write!(line, ", but only in the sign of zero, which --tolerance 0 ignores"),
        false => Ok(()),
    };
    if *not_finite > 0 {
        let _ = write!(line, ", {not_finite} of them NaN or infinite");
    }
    if let Some(first) = values.first {
        let axis = if values.kind.width() > 1 { format!("[{}]", first.lane) } else { String::new() };
        let [a, b] = first.values.map(|value| shown(value, values.kind));
        let _ = write!(line, "; the first is {name} {}{axis}: {a} and {b}", first.row);
    }
    line
}

/// A number in its shortest exact form.
fn shown(value: f64, kind: ColumnType) -> String {
    if kind.is_float() { format!("{:?}", value as f32) } else { value.to_string() }
}
