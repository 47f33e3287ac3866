//! Wires: the outputs that each input reads.

use std::collections::BTreeMap;

use jsonc_parser::ast::Value as Ast;

use super::Draft;
use crate::graph::dag::Order;
use crate::graph::fault::{Fault, code};
use crate::graph::json::{Json, counted, did_you_mean, find, is_misspelt, shown};
use crate::node::{Arity, InputSpec};

/// A wire as written in the file.
pub(super) struct Wire<'a> {
    pub(super) json: Json<'a>,
    /// The node it comes from.
    pub(super) node: usize,
    /// The index of that node's output; `None` if its type, and so its outputs, are unknown.
    pub(super) port: Option<usize>,
}

/// The nodes that wires can come from.
pub(super) struct Nodes<'d, 'a> {
    pub(super) drafts: &'d [Draft<'a>],
    by_id: BTreeMap<&'a str, usize>,
}

/// Resolves the wires of all nodes.
pub(super) fn connect<'a>(drafts: &mut [Draft<'a>], faults: &mut Vec<Fault>) {
    let nodes = Nodes::of(drafts);
    let wires: Vec<Vec<Vec<Wire<'a>>>> = drafts.iter().map(|draft| wires_of(draft, &nodes, faults)).collect();
    drafts.iter_mut().zip(wires).for_each(|(draft, wires)| draft.wires = wires);
}

/// The nodes that each node is wired to.
pub(super) fn sources(drafts: &[Draft<'_>]) -> Vec<Vec<usize>> {
    drafts.iter().map(|draft| draft.wires.iter().flatten().map(|wire| wire.node).collect()).collect()
}

/// Adds a fault for each cycle, at the wire that closes it.
pub(super) fn refuse_cycles(drafts: &[Draft<'_>], order: &Order, faults: &mut Vec<Fault>) {
    /// Cycles with more nodes are shortened in the message.
    const LISTED: usize = 12;
    for cycle in &order.cycles {
        let (first, last) = (cycle[0], cycle[cycle.len() - 1]);
        let closing = drafts[first].wires.iter().flatten().find(|wire| wire.node == last);
        let Some(wire) = closing else { continue };
        let id = |node: &usize| shown(drafts[*node].text.entry.name);
        let (fault, hint) = match cycle.len() {
            1 => {
                let fault = wire.json.fault(code::CYCLE, format!("`{}` is wired to itself", id(&first)));
                (fault, "remove this wire")
            }
            _ => {
                let mut ids: Vec<String> = cycle.iter().chain([&first]).map(id).collect();
                if ids.len() > LISTED {
                    ids.splice(LISTED / 2..ids.len() - LISTED / 2, ["…".into()]);
                }
                let fault = wire.json.fault(code::CYCLE, format!("the wires form a cycle: {}", ids.join(" → ")));
                (fault, "remove one wire of the cycle")
            }
        };
        faults.push(fault.hint(hint));
    }
}

/// The wires of each input of a node. Wires of unknown inputs are resolved too, so that their faults are reported.
fn wires_of<'a>(draft: &Draft<'a>, nodes: &Nodes<'_, 'a>, faults: &mut Vec<Fault>) -> Vec<Vec<Wire<'a>>> {
    let entries = &draft.text.inputs;
    for entry in entries.iter().filter(|entry| !draft.inputs.iter().any(|input| input.name == entry.name)) {
        if let Some(node) = draft.node {
            let fact = format!("`{}` has no input `{}`", node.name, shown(entry.name));
            let hint = match draft.specs.iter().any(|spec| spec.name == entry.name) {
                true => Some("it is a param; write it under `params`".into()),
                false => did_you_mean(faults, entry.name, draft.inputs.iter().map(|input| input.name), "inputs"),
            };
            faults.push(Fault { hint, ..entry.fault(code::UNKNOWN_INPUT, fact) });
        }
        let links = entry.json.elements().map_or_else(
            || vec![entry.json.clone()],
            |items| items.iter().enumerate().map(|(index, item)| entry.json.item(item, index)).collect(),
        );
        // The value of an unknown input may be anything; only strings can be resolved.
        links.iter().filter(|link| link.string().is_some()).for_each(|json| drop(nodes.resolve(json, faults)));
    }
    let wired = |input: &InputSpec| match find(entries, input.name) {
        Some(entry) => wires_of_input(input, &entry.json, nodes, faults),
        None => {
            let link = match input.arity {
                Arity::One => "\"id\"",
                Arity::Many { least: 1.. } => "[\"id\", …]",
                Arity::Optional | Arity::Many { .. } => return Vec::new(),
            };
            if !is_misspelt(entries, draft.inputs.iter().map(|input| input.name), input.name) {
                let fact = format!("the input `{}` has no wire", input.name);
                let fault = draft.text.entry.fault(code::MISSING_INPUT, fact);
                faults.push(fault.hint(format!("write \"inputs\": {{\"{}\": {link}}}", input.name)));
            }
            Vec::new()
        }
    };
    draft.inputs.iter().map(wired).collect()
}

fn wires_of_input<'a>(
    input: &InputSpec,
    json: &Json<'a>,
    nodes: &Nodes<'_, 'a>,
    faults: &mut Vec<Fault>,
) -> Vec<Wire<'a>> {
    let resolve_one = |json: &Json<'a>, faults: &mut Vec<Fault>| nodes.resolve(json, faults).into_iter().collect();
    let Arity::Many { least } = input.arity else {
        let fault = match json.value {
            Ast::Array(list) if list.elements.len() > 1 => {
                let fact = format!("the input `{}` takes one wire, not {}", input.name, list.elements.len());
                json.fault(code::TOO_MANY_WIRES, fact).hint("combine them with a Merge node")
            }
            Ast::Array(_) => json.unexpected("a node \"id\" or \"id.output\", not in a list"),
            _ => return resolve_one(json, faults),
        };
        faults.push(fault);
        return Vec::new();
    };
    let Some(items) = json.elements() else { return resolve_one(json, faults) };
    if items.len() < least {
        let fact = format!("the input `{}` has {}", input.name, counted(items.len(), "wire"));
        faults.push(json.fault(code::MISSING_INPUT, fact).hint(format!("expected at least {least}")));
    }
    items.iter().enumerate().filter_map(|(index, item)| nodes.resolve(&json.item(item, index), faults)).collect()
}

impl<'d, 'a> Nodes<'d, 'a> {
    pub(super) fn of(drafts: &'d [Draft<'a>]) -> Self {
        let by_id = drafts.iter().enumerate().map(|(index, draft)| (draft.text.entry.name, index)).collect();
        Self { drafts, by_id }
    }

    /// Resolves `"id"` or `"id.output"`.
    pub(super) fn resolve(&self, json: &Json<'a>, faults: &mut Vec<Fault>) -> Option<Wire<'a>> {
        let Some(text) = json.string() else {
            faults.push(json.unexpected("a node \"id\" or \"id.output\""));
            return None;
        };
        let (id, port) = text.split_once('.').map_or((text, None), |(id, port)| (id, Some(port)));
        let Some(&node) = self.by_id.get(id) else {
            let fault = json.fault(code::UNKNOWN_NODE, format!("there is no node `{}`", shown(id)));
            let hint = did_you_mean(faults, id, self.drafts.iter().map(|draft| draft.text.entry.name), "nodes");
            faults.push(Fault { hint, ..fault });
            return None;
        };
        let json = json.clone();
        let Some(declared) = self.drafts[node].node else { return Some(Wire { json, node, port: None }) };
        let Some(port) = port else { return Some(Wire { json, node, port: Some(0) }) };
        let found = declared.outputs.iter().position(|output| output.name == port);
        if found.is_none() {
            let fact = format!("`{}` is a `{}`, which has no output `{}`", shown(id), declared.name, shown(port));
            let hint = did_you_mean(faults, port, declared.outputs.iter().map(|output| output.name), "outputs");
            faults.push(Fault { hint, ..json.fault(code::UNKNOWN_PORT, fact) });
        }
        Some(Wire { json, node, port: found })
    }
}
