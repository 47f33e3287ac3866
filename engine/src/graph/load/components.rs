//! Which components each wire carries, and whether the inputs get the components that they need.

use super::Draft;
use super::wires::Wire;
use crate::geometry::Kind;
use crate::graph::Catalogue;
use crate::graph::dag::Order;
use crate::graph::fault::{Fault, code};
use crate::graph::json::shown;
use crate::node::{Carries, Needs};

/// The components of each output of each node; `None` if a fault upstream makes them unknown.
pub(super) struct Components(Vec<Vec<Option<Vec<Kind>>>>);

impl Components {
    /// Propagates components from node to node.
    pub(super) fn along(drafts: &[Draft<'_>], order: &Order) -> Self {
        let mut components = Self(vec![Vec::new(); drafts.len()]);
        for node in &order.nodes {
            let draft = &drafts[*node];
            let outputs = draft.node.map(|declared| declared.outputs).unwrap_or_default();
            let carried = outputs.iter().map(|output| match output.carries {
                Carries::Kinds(kinds) => Some(kinds.to_vec()),
                Carries::Like(input) | Carries::Union(input) => components.of_input(draft, input),
            });
            components.0[*node] = carried.collect();
        }
        components
    }

    /// The components of an output; `None` if they are unknown.
    pub(super) fn of(&self, node: usize, port: Option<usize>) -> Option<&[Kind]> {
        self.0[node].get(port?)?.as_deref()
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
                            "`{}` carries {}, but the input `{}` needs {kind}",
                            shown(link),
                            listed(kinds),
                            input.name
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
            return Some(format!("`{}.{}` carries {kind}", shown(source.text.entry.name), output.name));
        }
        let gives = |carries: &Carries| matches!(carries, Carries::Kinds(kinds) if kinds.contains(&kind));
        let types: Vec<&str> = catalogue
            .nodes()
            .filter(|node| node.outputs.iter().any(|output| gives(&output.carries)))
            .map(|node| node.name)
            .take(NAMED)
            .collect();
        (!types.is_empty()).then(|| format!("node types that output {kind}: `{}`", types.join("`, `")))
    }
}

/// `curves and mesh`, or `nothing`.
fn listed(kinds: &[Kind]) -> String {
    let names: Vec<&str> = kinds.iter().map(|kind| kind.name()).collect();
    if names.is_empty() { "nothing".into() } else { names.join(" and ") }
}
