//! The notes of parts as those of the whole: once a kind and node.

use engine::node::{Node, Trouble};
use engine::time::Frame;
use serde_json::{Map, Value, json};

use crate::CATALOGUE;

/// The notes of several reports, joined: the frames of all, and of a metric the text of its worst value. `whole` has the
/// metrics of all parts.
pub(super) fn joined<'r>(reports: impl Iterator<Item = &'r Value>, whole: &Value) -> Value {
    // In the order in which they are first said.
    let mut groups: Vec<(Group, Vec<&Value>)> = Vec::new();
    for note in reports.flat_map(|report| report["notes"].as_array().into_iter().flatten()) {
        let group = Group::of(note, whole);
        match groups.iter_mut().find(|(known, _)| *known == group) {
            Some((_, notes)) => notes.push(note),
            None => groups.push((group, vec![note])),
        }
    }
    groups.into_iter().filter_map(|(group, notes)| group.join(&notes, whole)).collect()
}

/// Notes that are one of the whole.
#[derive(PartialEq)]
enum Group {
    /// About a metric of a node: its name, the node's id, and which values are worth a note.
    Metric { kind: String, node: String, when: Trouble },
    /// Any others, of the same kind, node and text.
    Other { kind: Value, node: Value, text: Value },
}

impl Group {
    fn of(note: &Value, whole: &Value) -> Self {
        let metric = || {
            let (kind, node) = (note["kind"].as_str()?, note["node"].as_str()?);
            let declared: &Node = CATALOGUE.get(whole["nodes"][node]["type"].as_str()?)?;
            let when = declared.metrics.iter().find(|metric| metric.name == kind)?.warning?.when;
            Some(Self::Metric { kind: kind.to_owned(), node: node.to_owned(), when })
        };
        let [kind, node, text] = ["kind", "node", "text"].map(|key| note[key].clone());
        metric().unwrap_or(Self::Other { kind, node, text })
    }

    /// One note of several; `None` where the whole has no such note.
    fn join(&self, notes: &[&Value], whole: &Value) -> Option<Value> {
        let frames = |note: &Value| note["frames"].as_array().cloned().unwrap_or_default();
        let mut all: Vec<Value> = notes.iter().flat_map(|note| frames(note)).collect();
        all.sort_by(|a, b| number(a).total_cmp(&number(b)));
        all.dedup();
        let mut chosen = *notes.first()?;
        if let Self::Metric { kind, node, when } = self {
            let values = whole["nodes"][node]["metrics"][kind].as_object()?;
            let value = |frame: &Value| {
                let name = Frame::exactly(number(frame)).ok()?.to_string();
                values.get(&name).or_else(|| values.values().next())?.as_f64()
            };
            let excess = |frame: &Value| value(frame).map_or(f64::NEG_INFINITY, |value| when.excess(value));
            match when {
                Trouble::AlwaysAbove(_) if all.len() < values.len() => return None,
                Trouble::LastAbove(_) => {
                    let last =
                        values.keys().filter_map(|frame| frame.parse::<f64>().ok()).fold(f64::NEG_INFINITY, f64::max);
                    all.retain(|frame| number(frame) == last);
                    chosen = notes.iter().find(|note| frames(note).iter().any(|frame| number(frame) == last))?;
                }
                _ => {
                    let worst = |note: &Value| frames(note).iter().map(excess).fold(f64::NEG_INFINITY, f64::max);
                    for note in notes {
                        chosen = if worst(note) > worst(chosen) { note } else { chosen };
                    }
                }
            }
        }
        let mut joined = chosen.clone();
        joined["frames"] = json!(all);
        Some(joined)
    }
}

fn number(frame: &Value) -> f64 {
    frame.as_f64().unwrap_or_default()
}

/// Puts the values of all metrics in the order of their frames.
pub(super) fn sort_metrics(report: &mut Value) {
    let nodes = report["nodes"].as_object_mut().into_iter().flat_map(Map::values_mut);
    for values in nodes.filter_map(|node| node["metrics"].as_object_mut()).flat_map(Map::values_mut) {
        let Value::Object(values) = values else { continue };
        let mut by_frame: Vec<(String, Value)> = std::mem::take(values).into_iter().collect();
        by_frame.sort_by(|(a, _), (b, _)| {
            let [a, b] = [a, b].map(|frame| frame.parse::<f64>().unwrap_or(f64::NEG_INFINITY));
            a.total_cmp(&b)
        });
        *values = by_frame.into_iter().collect();
    }
}
