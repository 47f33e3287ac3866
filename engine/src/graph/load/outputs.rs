//! Outputs: what is to come out, which attributes of it, and whether with velocities.

use super::Draft as NodeDraft;
use super::document::{check_name, missing};
use super::order::Order;
use super::wires::{Nodes, Wire};
use crate::geometry::{Name, V};
use crate::graph::fault::{Fault, code};
use crate::graph::json::{Entry, Json, find, keep, refuse_unknown, shown};
use crate::node::Cook;
use crate::param::{Source, Unset};

/// An output as far as it could be read.
pub(super) struct Draft {
    pub(super) name: Name,
    pub(super) node: usize,
    pub(super) port: Option<usize>,
    pub(super) attributes: Option<Vec<Name>>,
    pub(super) v: bool,
}

/// Reads the outputs; `None` where there is nothing to read.
pub(super) fn read<'a>(
    json: Option<&Json<'a>>,
    drafts: &[NodeDraft<'a>],
    order: &Order,
    faults: &mut Vec<Fault>,
) -> Option<Vec<Draft>> {
    let json = json?;
    let members = json.members("outputs {\"name\": \"node\", …}", faults);
    let entries = keep(members, faults)?;
    if entries.is_empty() {
        let fault = json.fault(code::NO_OUTPUTS, "there are no outputs, so nothing would be cooked");
        faults.push(fault.hint("name what is to come out: {\"name\": \"node\"}"));
    }
    let (nodes, motion) = (Nodes::of(drafts), Motion::along(drafts, order));
    Some(entries.iter().filter_map(|entry| output(entry, &nodes, &motion, faults)).collect())
}

fn output<'a>(entry: &Entry<'a>, nodes: &Nodes<'_, 'a>, motion: &Motion, faults: &mut Vec<Fault>) -> Option<Draft> {
    check_name(entry, "an output", faults);
    let name: Name = entry.name.into();
    if entry.json.string().is_some() {
        let Wire { node, port, .. } = nodes.follow(&entry.json, faults)?;
        return Some(Draft { name, node, port, attributes: None, v: false });
    }
    let members = entry.json.members("a node \"id\", or {\"from\": \"id\", \"attributes\": […], \"v\": true}", faults);
    let entries = keep(members, faults)?;
    refuse_unknown(&entries, &["from", "attributes", "v"], "keys of an output", faults);
    let attributes = find(&entries, "attributes").map(|entry| attributes(&entry.json, faults));
    let v = find(&entries, "v").map(|entry| (keep(entry.json.bool(), faults).unwrap_or(false), &entry.json));
    let Some(from) = find(&entries, "from") else {
        faults.push(missing(&entry.json, "from", "it names the node: {\"from\": \"id\"}"));
        return None;
    };
    let Wire { node, port, .. } = nodes.follow(&from.json, faults)?;
    if let Some((true, json)) = v
        && let Some(culprit) = motion.without_velocity(node, nodes.drafts)
    {
        let id = shown(nodes.drafts[culprit].text.entry.name);
        let fact = format!("there are no velocities where points come and go, as they may at `{id}`");
        faults.push(json.fault(code::NO_VELOCITY, fact).hint("leave `v` out, or take the output before that node"));
    }
    let v = v.is_some_and(|(v, _)| v);
    Some(Draft { name, node, port, attributes: attributes.flatten(), v })
}

fn attributes(json: &Json<'_>, faults: &mut Vec<Fault>) -> Option<Vec<Name>> {
    let Some(items) = json.elements() else {
        faults.push(json.unexpected("a list of attributes [\"P\", …]"));
        return None;
    };
    let mut names: Vec<Name> = Vec::with_capacity(items.len());
    for (place, item) in items.iter().enumerate() {
        let json = json.item(item, place);
        match json.string() {
            Some(name) if !name.is_empty() => names.push(name.into()),
            _ => faults.push(json.unexpected("the name of an attribute")),
        }
    }
    Some(names)
}

/// Which nodes may give something else at another frame.
struct Motion {
    moves: Vec<bool>,
    /// Nearest node upstream, itself included, whose points may come and go.
    comes_and_goes: Vec<Option<usize>>,
}

impl Motion {
    fn along(drafts: &[NodeDraft<'_>], order: &Order) -> Self {
        let mut motion = Self { moves: vec![false; drafts.len()], comes_and_goes: vec![None; drafts.len()] };
        for node in &order.nodes {
            let draft = &drafts[*node];
            let Some(declared) = draft.node else { continue };
            let sources = || draft.wires.iter().flatten().map(|wire| wire.node);
            let moves = !matches!(declared.cook, Cook::Pure(_))
                || params_move(draft)
                || sources().any(|source| motion.moves[source]);
            let upstream = sources().find_map(|source| motion.comes_and_goes[source]);
            motion.comes_and_goes[*node] = if declared.changes_topology && moves { Some(*node) } else { upstream };
            motion.moves[*node] = moves;
        }
        motion
    }

    /// The node that leaves `node` without velocities; `None` where it writes its own, or no points come and go.
    fn without_velocity(&self, node: usize, drafts: &[NodeDraft<'_>]) -> Option<usize> {
        let writes = drafts[node].node.map(|declared| declared.writes).unwrap_or_default();
        if writes.iter().any(|attribute| attribute.spec().0 == V.name) {
            return None;
        }
        self.comes_and_goes[node]
    }
}

/// Whether any param that is read moves. One that is the current frame unless set says which file of a sequence is
/// meant: without a sequence it means nothing.
fn params_move(draft: &NodeDraft<'_>) -> bool {
    let sequence = draft.params.iter().any(|source| matches!(source, Source::File { numbered: true, .. }));
    let mut params = draft.specs.iter().zip(&draft.params);
    params.any(|(spec, source)| source.is_animated() && (sequence || spec.facts.unset != Unset::CurrentFrame))
}
