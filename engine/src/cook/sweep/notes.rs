//! Notes: attributes that a graph names but that are missing, or differ from what a node reads. They are not errors, but
//! a wrong picture might otherwise go unnoticed.

use std::collections::{BTreeMap, BTreeSet};

use super::Sweep;
use crate::cook::{Delivered, warnings};
use crate::expr::suggest::nearest;
use crate::geometry::{Name, P, V};
use crate::graph::Body;
use crate::node::Needs;
use crate::plan::Plan;

/// Attributes that outputs ask for by name, and those that exist.
pub(super) struct RequestedAttributes {
    /// By output: names that no finished frame has had yet.
    missing: BTreeMap<usize, BTreeSet<Name>>,
    /// Names of attributes that were made and are used nowhere.
    pub(super) unused: BTreeSet<Name>,
}

impl RequestedAttributes {
    pub(super) fn of(plan: &Plan<'_>) -> Self {
        let names = |index: &usize| {
            let output = &plan.graph.outputs[*index];
            let own = |name: &Name| **name == *P.name || (**name == *V.name && output.v);
            let names = output.attributes.iter().flatten().filter(|name| !own(name)).cloned().collect();
            (*index, names)
        };
        Self { missing: plan.request.outputs.iter().map(names).collect(), unused: BTreeSet::new() }
    }

    /// Records which of the names asked for a finished frame has.
    pub(super) fn record(&mut self, delivered: &Delivered) {
        let Some(missing) = self.missing.get_mut(&delivered.output).filter(|missing| !missing.is_empty()) else {
            return;
        };
        let once =
            delivered.geometry.volume().into_iter().flat_map(|volume| volume.once().iter().map(|(name, _)| name));
        for name in delivered.geometry.parts().flat_map(|part| part.columns().map(|(_, name, _)| name)).chain(once) {
            missing.remove(name);
        }
    }
}

impl Sweep<'_, '_, '_> {
    /// Notes the names that an output asked for and that none of its frames had.
    pub(super) fn note_missing_attributes(&mut self) {
        for (output, names) in &self.requested.missing {
            // An output without a frame has reported an error.
            if !self.report.delivered.contains_key(output) {
                continue;
            }
            for name in names {
                let output = &self.plan.graph.outputs[*output].name;
                let near = nearest(name, self.requested.unused.iter().map(|name| &**name));
                let hint = near.map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
                self.report
                    .notes
                    .push(format!("output `{output}` requests the attribute `{name}`, which it has at no frame{hint}"));
            }
        }
    }

    /// Notes metrics that exceed the limit their node declares.
    pub(super) fn note_warnings(&mut self) {
        for (node, run) in self.plan.graph.nodes.iter().zip(&self.nodes) {
            let declared = node.node().map_or(&[][..], |declared| declared.metrics);
            let notes = warnings::notes(&node.id, run.report.type_name, declared, &run.report.metrics);
            self.report.notes.extend(notes);
        }
    }

    /// Notes attributes of inputs that have a name that the node reads, but another owner or type. One frame a slice is
    /// enough: neither changes from frame to frame.
    pub(super) fn note_misread(&mut self, node: usize) {
        let graph = self.plan.graph;
        let Body::Node { node: declared, inputs, .. } = &graph.nodes[node].body else { return };
        for (input, links) in declared.inputs.iter().zip(inputs) {
            let needs = input.spec().needs;
            for link in links {
                let Some(Ok(cooked)) = self.nodes[link.node].results.values().next() else { continue };
                let taken = cooked[link.port].parts().filter(|part| match needs {
                    Needs::Kind(kind) => part.kind() == kind,
                    Needs::Any => true,
                });
                for part in taken {
                    for (name, owner, rows) in declared.reads.iter().map(|attribute| attribute.spec()) {
                        let as_read = part.table(owner).column(name).is_some_and(|column| column.kind() == rows);
                        let Some(found) = part.describe(name).filter(|_| !as_read) else { continue };
                        let (id, kind) = (&graph.nodes[node].id, part.kind());
                        let note = format!(
                            "`{id}` ({}) does not read `{name}` of the {kind}, which is {found}; it reads {}",
                            declared.name,
                            kind.rows_text(owner, rows)
                        );
                        if !self.report.notes.contains(&note) {
                            self.report.notes.push(note);
                        }
                    }
                }
            }
        }
    }
}
