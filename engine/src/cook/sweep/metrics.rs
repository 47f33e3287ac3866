//! Metrics: what nodes publish goes into the report, and is kept on disk with each finished frame.

use super::Sweep;
use super::masks::MaskFigures;
use crate::cook::disk::KeptMetric;
use crate::graph::Body;
use crate::key::ContentKey;
use crate::note::Note;
use crate::time::Frame;

/// What the name of a kept number begins with that is about the mask of a param; the param's index and the number's follow.
/// No metric has a blank in its name.
const MASK: &str = "mask ";

impl Sweep<'_, '_, '_> {
    /// Adds what a node published at a frame to the report. What is not a number that a file can hold is left out, and a
    /// note says so once.
    pub(super) fn publish(&mut self, node: usize, frame: Frame, metrics: &[(&'static str, f64)]) {
        for (name, value) in metrics {
            if !value.is_finite() {
                if self.nodes[node].left_out_metrics.insert(name) {
                    let (id, type_name) = (&self.plan.graph.nodes[node].id, self.nodes[node].report.type_name);
                    let what = if value.is_nan() { "undefined" } else { "infinite" };
                    let note =
                        format!("`{id}` ({type_name}) reports no `{name}` at frame {frame}, because it is {what}");
                    self.report.notes.push(Note::new(name, note).of_node(id).at(vec![frame]));
                }
                continue;
            }
            self.nodes[node].report.metrics.entry(name).or_default().insert(frame, *value);
        }
    }

    /// What a node published at a frame.
    pub(super) fn published(&self, node: usize, frame: Frame) -> Vec<(&'static str, f64)> {
        let metrics = &self.nodes[node].report.metrics;
        metrics.iter().filter_map(|(name, values)| Some((*name, *values.get(&frame)?))).collect()
    }

    /// Whether there is anything to keep with a node's results: metrics, or what its masks are.
    pub(super) fn measures(&self, node: usize) -> bool {
        let node = &self.plan.graph.nodes[node];
        let is_masked = || matches!(&node.body, Body::Node { params, .. } if params.iter().any(|p| p.mask().is_some()));
        node.node().is_some_and(|declared| !declared.metrics.is_empty()) || is_masked()
    }

    /// What is kept with a result of a node: its metrics, and what its masks are.
    pub(super) fn kept_of(&self, node: usize, frame: Frame, key: ContentKey) -> impl Iterator<Item = KeptMetric> {
        let metrics = self.published(node, frame).into_iter().map(|(name, value)| (name.to_owned(), value));
        let masks = self.nodes[node].masks.iter();
        let masks = masks.filter_map(|(param, frames)| Some((*param, frames.get(&frame)?.numbers())));
        let masks: Vec<_> = masks
            .flat_map(|(param, numbers)| {
                let named = move |(index, number)| (format!("{MASK}{param} {index}"), number);
                numbers.into_iter().enumerate().map(named)
            })
            .collect();
        metrics.chain(masks).map(move |(name, value)| (key, name, value))
    }

    /// The results that went into a finished frame and have metrics: node, frame, key.
    fn measured(&mut self, output: usize, frame: Frame) -> Vec<(usize, Frame, ContentKey)> {
        let plan = self.plan;
        let mut found = Vec::new();
        for node in plan.ancestors(plan.graph.outputs[output].from.node) {
            if !self.measures(node) {
                continue;
            }
            for at in plan.measured_frames(node, output, frame) {
                found.extend(self.keys.resolve(node, at).ok().map(|resolved| (node, at, resolved.key)));
            }
        }
        found
    }

    /// The metrics to keep with a finished frame.
    pub(super) fn metrics_to_keep(&mut self, output: usize, frame: Frame) -> Vec<KeptMetric> {
        let measured = self.measured(output, frame).into_iter();
        measured.flat_map(|(node, at, key)| self.kept_of(node, at, key)).collect()
    }

    /// Publishes what was kept with a finished frame.
    pub(super) fn publish_kept(&mut self, output: usize, frame: Frame, kept: &[KeptMetric]) {
        for (node, at, key) in self.measured(output, frame) {
            self.publish_of_key(node, at, key, kept);
        }
    }

    /// Publishes those of the kept metrics that belong to one result.
    pub(super) fn publish_of_key(&mut self, node: usize, at: Frame, key: ContentKey, kept: &[KeptMetric]) {
        let declared = self.plan.graph.nodes[node].node().map_or(&[][..], |declared| declared.metrics);
        let of_key = || kept.iter().filter(|(of, _, _)| *of == key);
        for (_, name, value) in of_key() {
            let indices = name.strip_prefix(MASK).and_then(|rest| rest.split_once(' '));
            if let Some((Ok(param), Ok(index))) = indices.map(|(param, index)| (param.parse(), index.parse())) {
                let frames = self.nodes[node].masks.entry(param).or_default();
                frames.entry(at).or_insert(MaskFigures::NONE).set_number(index, *value);
            }
        }
        let metrics: Vec<(&'static str, f64)> = of_key()
            .filter_map(|(_, name, value)| Some((declared.iter().find(|metric| metric.name == name)?.name, *value)))
            .collect();
        self.publish(node, at, &metrics);
    }
}
