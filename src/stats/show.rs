//! Statistics as text and as JSON.

use std::fmt::Write as _;

use engine::geometry::{Grid, Kind, Owner};
use serde_json::{Map, Value, json};

use super::measure::{AttributeStats, PartStats, Shape, Spread, Stats, VolumeStats};
use crate::geometry_file::GeometryFile;
use crate::numbers::{decimal, short};

/// JSON: one object for each component, with the tables of the json format.
pub(super) fn json(name: &str, file: &GeometryFile, stats: &Stats) -> String {
    let mut all = json!({"file": name, "format": file.format, "bytes": file.bytes});
    if let Some((time, times)) = file.time {
        all["frame"] = json!(time);
        all["frames"] = json!(times);
    }
    for part in &stats.parts {
        all[part.kind.name()] = part_json(part);
    }
    if let Some(volume) = &stats.volume {
        all[Kind::Volume.name()] = volume_json(volume);
    }
    serde_json::to_string_pretty(&all).unwrap_or_default() + "\n"
}

fn part_json(part: &PartStats) -> Value {
    let mut object = json!({"points": part.points, "bounds": part.bounds.map(|[min, max]| {
        json!({"min": min.map(decimal), "max": max.map(decimal)})
    })});
    match &part.shape {
        Shape::Curves { cvs, length } => {
            object["curves"] = json!(part.elements);
            object["cvs"] = spread_json(cvs.as_ref());
            object["length"] = spread_json(length.as_ref());
        }
        Shape::Mesh(surface) => {
            object["faces"] = json!(part.elements);
            object["corners"] = spread_json(Spread::of(surface.corners.iter().map(|n| f64::from(*n))).as_ref());
            object["edges"] = json!({
                "all": surface.edges, "manifold": surface.manifold, "boundary": surface.boundary,
                "non_manifold": surface.non_manifold, "flipped": surface.flipped,
            });
            object["closed"] = json!(surface.volume.is_some());
            object["area"] = json!(surface.area);
            object["volume"] = json!(surface.volume);
        }
        Shape::Points => {}
        Shape::Tets { volume, inverted } => {
            object["tets"] = json!(part.elements);
            object["volume"] = spread_json(volume.as_ref());
            object["inverted"] = json!(inverted);
        }
    }
    for (owner, attributes) in &part.attributes {
        let has_table = *owner != Owner::Element || part.kind != Kind::Points;
        if has_table {
            object[table_name(*owner)] = attributes_json(attributes);
        }
    }
    object
}

fn volume_json(volume: &VolumeStats) -> Value {
    let grid = &volume.grid;
    let mut object = json!({
        "origin": grid.origin.map(decimal), "cell": decimal(grid.cell), "size": grid.size,
        "cells": grid.cells(), "inside": volume.inside,
        "fields": attributes_json(&volume.fields), "attributes": attributes_json(&volume.attributes),
    });
    if let Some(grid) = &volume.velocity_grid {
        object["velocity_origin"] = json!(grid.origin.map(decimal));
        object["velocity_cell"] = json!(decimal(grid.cell));
        object["velocity_size"] = json!(grid.size);
    }
    object
}

fn attributes_json(attributes: &[AttributeStats]) -> Value {
    attributes.iter().map(|one| (one.name.to_string(), attribute_json(one))).collect::<Map<_, _>>().into()
}

/// Minimum, maximum and mean: numbers for scalar attributes, else lists.
fn attribute_json(attribute: &AttributeStats) -> Value {
    let each = |number: &dyn Fn(&Spread) -> f64| match attribute.spreads.as_slice() {
        [one] => json!(one.as_ref().map(number)),
        many => many.iter().map(|one| one.as_ref().map(number)).collect(),
    };
    json!({
        "type": attribute.kind.to_string(), "rows": attribute.rows, "not_finite": attribute.not_finite,
        "min": each(&|spread| as_stored(attribute, spread.min)), "max": each(&|spread| as_stored(attribute, spread.max)),
        "mean": each(&Spread::mean),
    })
}

fn spread_json(spread: Option<&Spread>) -> Value {
    json!(
        spread.map(|spread| {
            json!({"min": spread.min, "max": spread.max, "mean": spread.mean(), "total": spread.sum})
        })
    )
}

/// The name of an owner's table in the json format.
fn table_name(owner: Owner) -> &'static str {
    match owner {
        Owner::Point => "point_attributes",
        Owner::Element => "element_attributes",
        Owner::Once => "attributes",
    }
}

/// A number of an attribute as written in its file.
fn as_stored(attribute: &AttributeStats, number: f64) -> f64 {
    if attribute.kind.is_float() { decimal(number as f32) } else { number }
}

/// Text, one block for each component.
pub(super) fn text(name: &str, file: &GeometryFile, stats: &Stats) -> String {
    let mut text = format!("{name}: {}, {} bytes\n", file.format, file.bytes);
    if let Some((time, times)) = file.time {
        let of = if times == 0 { "nothing moves".to_owned() } else { format!("of {times} with samples") };
        line(&mut text, "frame", &format!("{time}, {of}"));
    }
    for part in &stats.parts {
        part_text(part, &mut text);
    }
    if let Some(volume) = &stats.volume {
        volume_text(volume, &mut text);
    }
    if stats.parts.is_empty() && stats.volume.is_none() {
        text += "no components\n";
    }
    text
}

fn part_text(part: &PartStats, text: &mut String) {
    let PartStats { kind, points, elements, .. } = part;
    match part.shape {
        Shape::Curves { .. } => line(text, kind.name(), &format!("{elements}, {points} points")),
        Shape::Mesh(_) => line(text, kind.name(), &format!("{elements} faces, {points} points")),
        Shape::Points => line(text, kind.name(), &points.to_string()),
        Shape::Tets { .. } => line(text, kind.name(), &format!("{elements}, {points} points")),
    }
    if let Some([low, high]) = part.bounds {
        let size: Vec<f64> = (0..3).map(|k| f64::from(high[k]) - f64::from(low[k])).collect();
        let [low, high] = [low, high].map(|corner| list(&corner.map(f64::from)));
        line(text, "  bounds", &format!("{low} to {high} m, size {}", list(&size)));
    }
    match &part.shape {
        Shape::Curves { cvs, length } => {
            spread_line(text, "  cvs", cvs.as_ref(), "");
            spread_line(text, "  length", length.as_ref(), " m");
        }
        Shape::Mesh(surface) => {
            line(text, "  area", &format!("{} m²", short(surface.area)));
            match surface.volume {
                Some(volume) => line(text, "  volume", &format!("{} m³", short(volume))),
                None => line(text, "  volume", "none: the surface is not closed"),
            }
            let mut edges = format!("{}: {} manifold, {} boundary", surface.edges, surface.manifold, surface.boundary);
            let _ = write!(edges, ", {} non-manifold, {} flipped", surface.non_manifold, surface.flipped);
            line(text, "  edges", &edges);
        }
        Shape::Points => {}
        Shape::Tets { volume, inverted } => {
            spread_line(text, "  volume", volume.as_ref(), " m³");
            line(text, "  inverted", &inverted.to_string());
        }
    }
    for (owner, attributes) in &part.attributes {
        attributes_text(&owner.to_string(), attributes, text);
    }
}

fn volume_text(volume: &VolumeStats, text: &mut String) {
    let cells = |grid: &Grid| {
        let [x, y, z] = grid.size;
        format!("{x} × {y} × {z} cells of {} m", decimal(grid.cell))
    };
    let grid = &volume.grid;
    line(text, Kind::Volume.name(), &cells(grid));
    line(text, "  origin", &list(&grid.origin.map(f64::from)));
    if let Some(grid) = &volume.velocity_grid {
        line(text, "  velocity", &format!("{} from {}", cells(grid), list(&grid.origin.map(f64::from))));
    }
    line(text, "  inside", &format!("{} of {} cells", volume.inside, grid.cells()));
    attributes_text("field", &volume.fields, text);
    attributes_text(&Owner::Once.to_string(), &volume.attributes, text);
}

/// One line for each attribute: its owner, type and range.
fn attributes_text(owner: &str, attributes: &[AttributeStats], text: &mut String) {
    for attribute in attributes {
        let each = |number: &dyn Fn(&Spread) -> f64| match attribute.spreads.as_slice() {
            [one] => one.as_ref().map_or("none".to_owned(), |spread| short(number(spread))),
            many => list(&many.iter().map(|one| one.as_ref().map_or(f64::NAN, number)).collect::<Vec<_>>()),
        };
        let mut facts = format!("{owner} {}, ", attribute.kind);
        let _ = match attribute.rows {
            0 => write!(facts, "no rows"),
            _ => write!(facts, "{} to {}, mean {}", each(&|x| x.min), each(&|x| x.max), each(&Spread::mean)),
        };
        if attribute.not_finite > 0 {
            let _ = write!(facts, ", {} not finite", attribute.not_finite);
        }
        line(text, &format!("  {}", attribute.name), &facts);
    }
}

fn spread_line(text: &mut String, label: &str, spread: Option<&Spread>, unit: &str) {
    if let Some(spread) = spread {
        let [min, max, mean, sum] = [spread.min, spread.max, spread.mean(), spread.sum].map(short);
        line(text, label, &format!("{min} to {max}{unit}, mean {mean}, total {sum}"));
    }
}

fn line(text: &mut String, label: &str, facts: &str) {
    let _ = writeln!(text, "{label:<14} {facts}");
}

fn list(numbers: &[f64]) -> String {
    let numbers: Vec<String> = numbers.iter().map(|x| short(*x)).collect();
    format!("[{}]", numbers.join(", "))
}
