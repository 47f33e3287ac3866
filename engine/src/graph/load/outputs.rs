//! Outputs: which node outputs are written, with which attributes, and whether with velocities.

use super::Draft as NodeDraft;
use super::document::{check_name, missing};
use super::wires::{Nodes, Wire};
use crate::geometry::Name;
use crate::graph::fault::{Fault, code};
use crate::graph::json::{Entry, Json, find, keep, refuse_unknown};

/// An output as far as it is valid.
pub(super) struct Draft {
    pub(super) name: Name,
    pub(super) node: usize,
    pub(super) port: Option<usize>,
    pub(super) attributes: Option<Vec<Name>>,
    pub(super) v: bool,
}

/// Longest name of an output. File systems allow 255 bytes, of which frame number, extension and the marks of temporary
/// files take a part.
const LONGEST_NAME: usize = 128;

/// Reads the outputs; `None` if the key is missing or its value is not an object.
pub(super) fn read<'a>(
    json: Option<&Json<'a>>,
    drafts: &[NodeDraft<'a>],
    faults: &mut Vec<Fault>,
) -> Option<Vec<Draft>> {
    let json = json?;
    let members = json.members("outputs {\"name\": \"node\", …}", faults);
    let entries = keep(members, faults)?;
    if entries.is_empty() {
        let fault = json.fault(code::NO_OUTPUTS, "there are no outputs, so nothing would be cooked");
        faults.push(fault.hint("name at least one output: {\"name\": \"node\"}"));
    }
    let nodes = Nodes::of(drafts);
    Some(entries.iter().filter_map(|entry| output(entry, &nodes, faults)).collect())
}

fn output<'a>(entry: &Entry<'a>, nodes: &Nodes<'_, 'a>, faults: &mut Vec<Fault>) -> Option<Draft> {
    check_name(entry, "an output", faults);
    if entry.name.len() > LONGEST_NAME {
        let fault = entry.fault(code::BAD_NAME, format!("the name of the output has {} characters", entry.name.len()));
        faults.push(fault.hint(format!("its files are named after it; expected at most {LONGEST_NAME}")));
    }
    let name: Name = entry.name.into();
    if entry.json.string().is_some() {
        let Wire { node, port, .. } = nodes.resolve(&entry.json, faults)?;
        return Some(Draft { name, node, port, attributes: None, v: false });
    }
    let members = entry.json.members("a node \"id\", or {\"from\": \"id\", \"attributes\": […], \"v\": true}", faults);
    let entries = keep(members, faults)?;
    refuse_unknown(&entries, &["from", "attributes", "v"], "keys of an output", faults);
    let attributes = find(&entries, "attributes").map(|entry| attributes(&entry.json, faults));
    let v = find(&entries, "v").is_some_and(|entry| keep(entry.json.bool(), faults).unwrap_or(false));
    let Some(from) = find(&entries, "from") else {
        faults.push(missing(&entry.json, "from", "`from` names the node: {\"from\": \"id\"}"));
        return None;
    };
    let Wire { node, port, .. } = nodes.resolve(&from.json, faults)?;
    Some(Draft { name, node, port, attributes: attributes.flatten(), v })
}

fn attributes(json: &Json<'_>, faults: &mut Vec<Fault>) -> Option<Vec<Name>> {
    let Some(items) = json.elements() else {
        faults.push(json.unexpected("a list of attributes [\"P\", …]"));
        return None;
    };
    let mut names: Vec<Name> = Vec::with_capacity(items.len());
    for (index, item) in items.iter().enumerate() {
        let json = json.item(item, index);
        match json.string() {
            Some(name) if !name.is_empty() => names.push(name.into()),
            _ => faults.push(json.unexpected("the name of an attribute")),
        }
    }
    Some(names)
}
