//! Notes: attributes that someone means and that are not there as he means them. No error, as all else is as asked, but
//! silence would let a wrong picture pass.

use std::collections::{BTreeMap, BTreeSet};

use super::Sweep;
use crate::cook::Delivered;
use crate::expr::suggest::nearest;
use crate::geometry::{Name, P, V};
use crate::graph::Body;
use crate::node::Needs;
use crate::plan::Plan;

/// What outputs ask for by name, and what there is.
pub(super) struct Asked {
    /// By output: names that no finished frame has had yet.
    unseen: BTreeMap<usize, BTreeSet<Name>>,
    /// Names that geometry has and that nobody takes.
    pub(super) there: BTreeSet<Name>,
}

impl Asked {
    pub(super) fn of(plan: &Plan<'_>) -> Self {
        let names = |place: &usize| {
            let output = &plan.graph.outputs[*place];
            let own = |name: &Name| **name == *P.name || (**name == *V.name && output.v);
            let names = output.attributes.iter().flatten().filter(|name| !own(name)).cloned().collect();
            (*place, names)
        };
        Self { unseen: plan.request.outputs.iter().map(names).collect(), there: BTreeSet::new() }
    }
}

impl Sweep<'_, '_, '_> {
    /// Looks at which of the names asked for a finished frame has.
    pub(super) fn see(&mut self, delivered: &Delivered) {
        let Some(unseen) = self.asked.unseen.get_mut(&delivered.output).filter(|unseen| !unseen.is_empty()) else {
            return;
        };
        let once =
            delivered.geometry.volume().into_iter().flat_map(|volume| volume.once().iter().map(|(name, _)| name));
        for name in delivered.geometry.parts().flat_map(|part| part.columns().map(|(_, name, _)| name)).chain(once) {
            unseen.remove(name);
        }
    }

    /// Notes the names that an output asked for and that none of its frames had.
    pub(super) fn note_unseen(&mut self) {
        for (output, names) in &self.asked.unseen {
            // An output without a frame has told why.
            if !self.report.delivered.contains_key(output) {
                continue;
            }
            for name in names {
                let output = &self.plan.graph.outputs[*output].name;
                let near = nearest(name, self.asked.there.iter().map(|name| &**name));
                let hint = near.map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
                self.report.notes.push(format!("output `{output}` asks for `{name}`, which no frame of it has{hint}"));
            }
        }
    }

    /// Notes attributes that come in under a name that the node reads, but with another owner or type than it reads.
    /// Asked once a slice and node: a column changes neither from frame to frame.
    pub(super) fn note_misread(&mut self, node: usize) {
        let graph = self.plan.graph;
        let Body::Node { node: declared, inputs, .. } = &graph.nodes[node].body else { return };
        for (input, links) in declared.inputs.iter().zip(inputs) {
            let needs = input.spec().needs;
            for link in links {
                let Some(Ok(cooked)) = self.results[link.node].values().next() else { continue };
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
