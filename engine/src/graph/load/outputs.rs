//! Outputs: which node outputs are written, with which attributes, and whether with velocities.

use std::collections::BTreeSet;

use super::Draft as NodeDraft;
use super::document::{check_name, missing};
use super::wires::{Nodes, Wire};
use crate::geometry::Name;
use crate::graph::fault::{Fault, code};
use crate::graph::json::{Entry, Json, find, keep, refuse_unknown, shown};

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
    Some(entries.iter().flat_map(|entry| file(entry, &nodes, faults)).collect())
}

/// The outputs in one file: one, or those of a list.
fn file<'a>(entry: &Entry<'a>, nodes: &Nodes<'_, 'a>, faults: &mut Vec<Fault>) -> Vec<Draft> {
    check_name(entry, "an output", faults);
    if entry.name.len() > LONGEST_NAME {
        let fault = entry.fault(code::BAD_NAME, format!("the name of the output has {} characters", entry.name.len()));
        faults.push(fault.hint(format!("its files are named after it; expected at most {LONGEST_NAME}")));
    }
    let Some(items) = entry.json.elements() else {
        let name = |_: &str| entry.name.into();
        return output(&entry.json, &name, nodes, EXPECTED, faults).into_iter().collect();
    };
    if items.is_empty() {
        let fault = entry.json.fault(code::NO_OUTPUTS, "the list is empty, so the file would be too");
        faults.push(fault.hint("list the nodes to write: [\"id\", …]"));
    }
    let mut names = BTreeSet::new();
    let mut drafts = Vec::with_capacity(items.len());
    for (index, item) in items.iter().enumerate() {
        let json = entry.json.item(item, index);
        let name = |from: &str| format!("{}/{from}", entry.name).into();
        let Some(draft) = output(&json, &name, nodes, EXPECTED_IN_LIST, faults) else { continue };
        if !names.insert(draft.name.clone()) {
            let prim = draft.name.split_once('/').map_or("", |(_, prim)| prim);
            let fault = json.fault(code::DOUBLED_OUTPUT, format!("`{}` is in the list twice", shown(prim)));
            faults.push(fault.hint("each node becomes a prim with the node's name; remove one"));
        }
        drafts.push(draft);
    }
    drafts
}

const EXPECTED: &str = "a node \"id\", a list of them, or {\"from\": \"id\", \"attributes\": […], \"v\": true}";
const EXPECTED_IN_LIST: &str = "a node \"id\", or {\"from\": \"id\", \"attributes\": […], \"v\": true}";

/// An output, whose name follows from the wire as it is written.
fn output<'a>(
    json: &Json<'a>,
    name: &dyn Fn(&str) -> Name,
    nodes: &Nodes<'_, 'a>,
    expected: &str,
    faults: &mut Vec<Fault>,
) -> Option<Draft> {
    if let Some(wire) = json.string() {
        let Wire { node, port, .. } = nodes.resolve(json, faults)?;
        return Some(Draft { name: name(wire), node, port, attributes: None, v: false });
    }
    let entries = keep(json.members(expected, faults), faults)?;
    refuse_unknown(&entries, &["from", "attributes", "v"], "keys of an output", faults);
    let attributes = find(&entries, "attributes").map(|entry| attributes(&entry.json, faults));
    let v = find(&entries, "v").is_some_and(|entry| keep(entry.json.bool(), faults).unwrap_or(false));
    let Some(from) = find(&entries, "from") else {
        faults.push(missing(json, "from", "`from` names the node: {\"from\": \"id\"}"));
        return None;
    };
    let Wire { node, port, .. } = nodes.resolve(&from.json, faults)?;
    let name = name(from.json.string().unwrap_or_default());
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
