//! What is probably not as it was meant in a graph without faults.

use std::collections::BTreeMap;

use crate::geometry::Name;
use crate::graph::{Body, Graph, GraphNode};
use crate::note::{Note, kind};
use crate::param::{ParamSpec, Source, Unit, Value};

/// Unused nodes with a note each; of the rest only the number is told.
const NAMED: usize = 8;

/// The notes of a graph, apart from those of its params.
pub(super) fn of(graph: &Graph) -> Vec<Note> {
    let mut notes = unused_nodes(graph);
    notes.extend(similar_names(graph));
    notes.extend(late_frames(graph));
    notes
}

/// Frames at which something is to happen, in params that cannot be animated, after the last frame of the scene.
fn late_frames(graph: &Graph) -> Vec<Note> {
    let (first, last) = (graph.scene.first, graph.scene.last);
    let late = |node: &GraphNode| {
        let Body::Node { specs, params, .. } = &node.body else { return Vec::new() };
        let frames =
            specs.iter().zip(&params[..]).filter(|(spec, _)| spec.facts.unit == Unit::Frame && spec.facts.fixed);
        let note = |(spec, source): (&ParamSpec, &Source)| {
            let frame = match source {
                Source::Constant(Value::Float(frame)) => *frame,
                Source::Constant(Value::Int(frame)) => *frame as f64,
                _ => return None,
            };
            let (id, name) = (&node.id, spec.name);
            let text = format!(
                "`{id}` ({}): `{name}` is {frame}, after the last frame of the scene, whose frames are {first}-{last}",
                node.type_name()
            );
            let hint = "What happens at that frame is not seen. Set an earlier frame, or extend `scene.frames`.";
            (frame > last as f64).then(|| Note::new(kind::OUTSIDE_SCENE, text).of_node(id).hint(hint))
        };
        frames.filter_map(note).collect()
    };
    graph.nodes.iter().flat_map(late).collect()
}

/// Nodes that no output needs.
fn unused_nodes(graph: &Graph) -> Vec<Note> {
    let mut needed = vec![false; graph.nodes.len()];
    graph.outputs.iter().for_each(|output| needed[output.from.node] = true);
    // What is bypassed, and what only bypassed nodes need, is so on purpose.
    for (needed, node) in needed.iter_mut().zip(&graph.nodes) {
        *needed |= graph.bypassed.contains(&node.id);
    }
    // Every node comes after those that it reads.
    for place in (0..graph.nodes.len()).rev() {
        if needed[place] {
            graph.nodes[place].inputs().iter().flatten().for_each(|link| needed[link.node] = true);
        }
    }
    let unused = || graph.nodes.iter().zip(&needed).filter(|(_, needed)| !**needed).map(|(node, _)| node);
    let hint = "Connect it, or remove it; it is not cooked.";
    let note = |id: &Name, type_name: &str| {
        let text = format!("no output needs `{id}` ({type_name})");
        Note::new(kind::UNUSED_NODE, text).of_node(id).hint(hint)
    };
    let mut notes: Vec<Note> = unused().take(NAMED).map(|node| note(&node.id, node.type_name())).collect();
    let more = unused().count() - notes.len();
    if more > 0 {
        notes.push(
            Note::new(kind::UNUSED_NODE, format!("no output needs {more} more nodes")).hint("They are not cooked."),
        );
    }
    notes
}

/// Outputs that would be one file where names ignore case.
fn similar_names(graph: &Graph) -> Vec<Note> {
    let mut by_name: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for output in &graph.outputs {
        let names = by_name.entry(output.file().to_lowercase()).or_default();
        if !names.contains(&output.file()) {
            names.push(output.file());
        }
    }
    let same = by_name.into_values().filter(|names| names.len() > 1);
    let note = |names: Vec<&str>| {
        let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        Note::new(kind::SIMILAR_NAMES, format!("the outputs {} differ only in case", names.join(" and "))).hint(
            "Their files replace each other on file systems that ignore case, as on Windows and macOS; rename one.",
        )
    };
    same.map(note).collect()
}
