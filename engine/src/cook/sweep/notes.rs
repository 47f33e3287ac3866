//! Notes of a cook: attributes that are missing or differ from what a node reads; outputs without geometry; frames outside the scene. They are not errors, but a wrong picture might otherwise go unnoticed.

use std::collections::{BTreeMap, BTreeSet};

use super::Sweep;
use super::coarse::CoarsePositions;
use crate::cook::{Delivered, warnings};
use crate::expr::suggest::nearest;
use crate::geometry::{Name, Owner, P, V};
use crate::graph::Body;
use crate::node::Needs;
use crate::note::{Note, kind};
use crate::plan::Plan;
use crate::time::Frame;

/// Most frames that a note lists.
const MOST_LISTED: usize = 10_000;

/// What outputs and nodes have been found to have at the frames cooked so far.
pub(super) struct Observed {
    /// By output: names of requested attributes that no finished frame has had yet.
    missing: BTreeMap<usize, BTreeSet<Name>>,
    /// Names of attributes that were made and are used nowhere.
    pub(super) unused: BTreeSet<Name>,
    /// By output: frames without geometry; `None` once there was one with geometry.
    empty: BTreeMap<usize, Option<Vec<Frame>>>,
    /// By output: how coarse its positions were at the first frame with geometry, where that is too coarse.
    pub(super) coarse: BTreeMap<usize, Option<CoarsePositions>>,
}

impl Observed {
    pub(super) fn of(plan: &Plan<'_>) -> Self {
        let names = |index: &usize| {
            let output = &plan.graph.outputs[*index];
            let own = |name: &Name| **name == *P.name || (**name == *V.name && output.v);
            let names = output.attributes.iter().flatten().filter(|name| !own(name)).cloned().collect();
            (*index, names)
        };
        Self {
            missing: plan.request.outputs.iter().map(names).collect(),
            unused: BTreeSet::new(),
            empty: BTreeMap::new(),
            coarse: BTreeMap::new(),
        }
    }

    /// Records whether a finished frame has geometry, and which of the names asked for.
    pub(super) fn record(&mut self, delivered: &Delivered) {
        let Delivered { output, frame, geometry } = delivered;
        let is_empty = geometry.parts().all(|part| part.table(Owner::Point).rows() == 0) && geometry.volume().is_none();
        let empty = self.empty.entry(*output).or_insert_with(|| Some(Vec::new()));
        match empty {
            Some(frames) if is_empty => frames.push(*frame),
            _ if is_empty => {}
            empty => *empty = None,
        }
        if !is_empty {
            self.coarse.entry(*output).or_insert_with(|| CoarsePositions::of(geometry, *frame));
        }
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
    /// Notes frames of the request that are not in the scene.
    pub(super) fn note_frames_outside(&mut self) {
        let scene = &self.plan.graph.scene;
        let (first, last) = (Frame::whole(scene.first), Frame::whole(scene.last));
        let request = &self.plan.request.frames;
        if request.first().is_none_or(|frame| frame >= first) && request.last().is_none_or(|frame| frame <= last) {
            return;
        }
        let outside = || request.iter().filter(|frame| !(first..=last).contains(frame));
        let frames: Vec<Frame> = outside().take(MOST_LISTED).collect();
        let Some(one) = frames.first() else { return };
        let text = match outside().count() {
            1 => format!("frame {one} is outside the scene, whose frames are {first}-{last}"),
            count => format!("{count} frames are outside the scene, whose frames are {first}-{last}"),
        };
        let hint = "Keyframes hold their first and last value there, and solvers start at the scene's first frame. \
                    Extend `scene.frames` if that is not meant.";
        self.report.notes.push(Note::new(kind::OUTSIDE_SCENE, text).at(frames).hint(hint));
    }

    /// Notes outputs that had no geometry at any frame.
    pub(super) fn note_empty_outputs(&mut self) {
        for (output, frames) in std::mem::take(&mut self.observed.empty) {
            let Some(frames) = frames else { continue };
            let output = &self.plan.graph.outputs[output];
            let from = &self.plan.graph.nodes[output.from.node];
            let text = format!("output `{}` has no geometry at any frame", output.name);
            let hint = format!("Look at what `{}` ({}) returns, and what it is given.", from.id, from.type_name());
            self.report.notes.push(Note::new(kind::EMPTY_OUTPUT, text).of_node(&from.id).at(frames).hint(hint));
        }
    }

    /// Notes the names that an output asked for and that none of its frames had.
    pub(super) fn note_missing_attributes(&mut self) {
        for (output, names) in &self.observed.missing {
            // An output without a frame has reported an error.
            if !self.report.delivered.contains_key(output) {
                continue;
            }
            for name in names {
                let output = &self.plan.graph.outputs[*output].name;
                let near = nearest(name, self.observed.unused.iter().map(|name| &**name));
                let hint = near.map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
                let text = format!("output `{output}` requests the attribute `{name}`, which it has at no frame{hint}");
                self.report.notes.push(Note::new(kind::MISSING_ATTRIBUTE, text));
            }
        }
    }

    /// Notes metrics that exceed the limit their node declares.
    pub(super) fn note_warnings(&mut self) {
        let graph = self.plan.graph;
        for (node, run) in graph.nodes.iter().zip(&self.nodes) {
            let declared = node.node().map_or(&[][..], |declared| declared.metrics);
            let wired = |inputs: &str, number: usize| graph.wire_name(node, inputs, number);
            let notes = warnings::notes(&node.id, run.report.type_name, declared, &run.report.metrics, &wired);
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
                        let text = format!(
                            "`{id}` ({}) does not read `{name}` of the {kind}, which is {found}; it reads {}",
                            declared.name,
                            kind.rows_text(owner, rows)
                        );
                        let note = Note::new(kind::MISREAD_ATTRIBUTE, text).of_node(id);
                        if !self.report.notes.contains(&note) {
                            self.report.notes.push(note);
                        }
                    }
                }
            }
        }
    }
}
