//! Which components each wire carries, and whether the inputs get the components that they need.

use super::Draft;
use super::wires::Wire;
use crate::geometry::Kind;
use crate::graph::Catalogue;
use crate::graph::dag::Order;
use crate::graph::fault::{Fault, code};
use crate::graph::json::shown;
use crate::node::{Carries, Needs};

/// What each output of each node carries, and what is read instead of the outputs of bypassed nodes.
pub(super) struct Components {
    /// The components of each output; `None` if a fault upstream makes them unknown.
    kinds: Vec<Vec<Option<Vec<Kind>>>>,
    /// Of each output of a bypassed node: the output that is passed, itself not of a bypassed node.
    passed: Vec<Vec<Option<(usize, usize)>>>,
}

impl Components {
    /// Propagates components from node to node.
    pub(super) fn along(drafts: &[Draft<'_>], order: &Order) -> Self {
        let mut components = Self { kinds: vec![Vec::new(); drafts.len()], passed: vec![Vec::new(); drafts.len()] };
        for node in &order.nodes {
            let draft = &drafts[*node];
            let outputs = draft.node.map(|declared| declared.outputs).unwrap_or_default();
            let carried = outputs.iter().map(|output| match output.carries {
                Carries::Kinds(kinds) => Some(kinds.to_vec()),
                Carries::Like(input) | Carries::Union(input) => components.of_input(draft, input),
            });
            let mut carried: Vec<Option<Vec<Kind>>> = carried.collect();
            if draft.text.bypass.is_some() {
                let passed = carried.iter().map(|kinds| components.wire_with(draft, kinds.as_deref()?));
                let passed: Vec<Option<(usize, usize)>> = passed.collect();
                for (kinds, passed) in carried.iter_mut().zip(&passed) {
                    *kinds = passed.and_then(|(node, port)| components.kinds[node][port].clone());
                }
                components.passed[*node] = passed;
            }
            components.kinds[*node] = carried;
        }
        components
    }

    /// The output that a wire from `node` and `port` reads: another one if the node is bypassed.
    pub(super) fn source(&self, node: usize, port: usize) -> Option<(usize, usize)> {
        match self.passed[node].get(port) {
            None => Some((node, port)),
            Some(passed) => *passed,
        }
    }

    /// The output read by the first wire of a node that carries all of `kinds`.
    fn wire_with(&self, draft: &Draft<'_>, kinds: &[Kind]) -> Option<(usize, usize)> {
        let has_all = |wire: &&Wire<'_>| {
            self.of(wire.node, wire.port).is_some_and(|carried| kinds.iter().all(|kind| carried.contains(kind)))
        };
        let wire = draft.wires.iter().flatten().find(has_all)?;
        self.source(wire.node, wire.port?)
    }

    /// Adds a fault for each bypassed node with an output that is read, by a wire or an output of the graph, and that
    /// no input can replace.
    pub(super) fn refuse_impassable(
        &self,
        drafts: &[Draft<'_>],
        outputs: &[(usize, Option<usize>)],
        faults: &mut Vec<Fault>,
    ) {
        let wires = drafts.iter().flat_map(|draft| draft.wires.iter().flatten()).map(|wire| (wire.node, wire.port));
        let mut read: Vec<(usize, usize)> =
            wires.chain(outputs.iter().copied()).filter_map(|(node, port)| Some((node, port?))).collect();
        read.sort_unstable();
        read.dedup();
        for (node, port) in read {
            let draft = &drafts[node];
            // Where an input lacks a wire, or has one of unknown components, that is a fault already.
            let is_known = draft.wires.iter().flatten().all(|wire| self.of(wire.node, wire.port).is_some());
            let (Some(bypass), Some(declared)) = (&draft.text.bypass, draft.node) else { continue };
            if !is_known || self.source(node, port).is_some() || self.passed[node].is_empty() {
                continue;
            }
            let output = &declared.outputs[port];
            let kinds = match output.carries {
                Carries::Kinds(kinds) => Some(kinds.to_vec()),
                Carries::Like(input) | Carries::Union(input) => self.of_input(draft, input),
            };
            let Some(kinds) = kinds else { continue };
            let fact = format!(
                "the node cannot be bypassed: no input carries {}, which its output `{}` has",
                listed(&kinds),
                output.name
            );
            let hint = "remove `bypass`, or connect the nodes that read this one to another";
            faults.push(bypass.fault(code::BYPASS, fact).hint(hint));
        }
    }

    /// The components of an output; `None` if they are unknown.
    pub(super) fn of(&self, node: usize, port: Option<usize>) -> Option<&[Kind]> {
        self.kinds[node].get(port?)?.as_deref()
    }

    /// All components that the wires of an input carry.
    fn of_input(&self, draft: &Draft<'_>, input: &str) -> Option<Vec<Kind>> {
        let index = draft.inputs.iter().position(|spec| spec.name == input)?;
        let mut kinds = Vec::new();
        for wire in draft.wires.get(index)? {
            kinds.extend(self.of(wire.node, wire.port)?);
        }
        kinds.sort_unstable();
        kinds.dedup();
        Some(kinds)
    }

    /// Adds a fault for each wire that lacks the component that its input needs.
    pub(super) fn refuse_misfits(&self, drafts: &[Draft<'_>], catalogue: Catalogue, faults: &mut Vec<Fault>) {
        for draft in drafts {
            for (input, wires) in draft.inputs.iter().zip(&draft.wires) {
                let Needs::Kind(kind) = input.needs else { continue };
                for wire in wires {
                    let Some(kinds) = self.of(wire.node, wire.port) else { continue };
                    if !input.needs.hold(kinds) {
                        let link = wire.json.string().unwrap_or_default();
                        let fact = format!(
                            "`{}` carries {}, but the input `{}` needs {}",
                            shown(link),
                            listed(kinds),
                            input.name,
                            kind.phrase()
                        );
                        let hint = self.provider(wire, kind, drafts, catalogue);
                        faults.push(Fault { hint, ..wire.json.fault(code::WRONG_COMPONENT, fact) });
                    }
                }
            }
        }
    }

    /// A hint at what provides a missing component: another output of the same node, else node types of the catalogue.
    fn provider(&self, wire: &Wire<'_>, kind: Kind, drafts: &[Draft<'_>], catalogue: Catalogue) -> Option<String> {
        const NAMED: usize = 5;
        let source = &drafts[wire.node];
        let outputs = source.node.map(|declared| declared.outputs).unwrap_or_default();
        let sibling = outputs
            .iter()
            .enumerate()
            .find(|(port, _)| self.of(wire.node, Some(*port)).is_some_and(|kinds| kinds.contains(&kind)));
        if let Some((_, output)) = sibling {
            return Some(format!("`{}.{}` carries {}", shown(source.text.entry.name), output.name, kind.phrase()));
        }
        let gives = |carries: &Carries| matches!(carries, Carries::Kinds(kinds) if kinds.contains(&kind));
        let types: Vec<&str> = catalogue
            .nodes()
            .filter(|node| node.outputs.iter().any(|output| gives(&output.carries)))
            .map(|node| node.name)
            .take(NAMED)
            .collect();
        (!types.is_empty()).then(|| format!("node types that output {}: `{}`", kind.phrase(), types.join("`, `")))
    }
}

/// `curves and a mesh`, or `nothing`.
fn listed(kinds: &[Kind]) -> String {
    let names: Vec<&str> = kinds.iter().map(|kind| kind.phrase()).collect();
    if names.is_empty() { "nothing".into() } else { names.join(" and ") }
}
