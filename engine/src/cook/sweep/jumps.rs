//! Jumps of curves between consecutive samples of a request, which no single frame shows: for the report alone, so they are
//! neither kept on disk nor found there.

use std::collections::BTreeMap;

use super::Sweep;
use crate::cook::tips::{EndTips, Tips};
use crate::geometry::Geometry;
use crate::graph::Link;
use crate::time::Frame;

/// What is known of one node.
#[derive(Default)]
pub(super) struct Jumps {
    /// By frames of this slice, and the last of the one before.
    tips: BTreeMap<Frame, Tips>,
    /// The share of tips that jumped since the sample before.
    shares: BTreeMap<Frame, f64>,
    /// The first sample, and its tips.
    first: Option<(Frame, Tips)>,
}

impl Sweep<'_, '_, '_> {
    /// The name of a node's metric of jumps, where they are asked for and it has one.
    fn metric_of_jumps(&self, node: usize) -> Option<&'static str> {
        let declared =
            self.plan.graph.nodes[node].node().filter(|_| self.engine.compares && self.executor.delivers())?;
        declared.metrics.iter().find(|metric| metric.is_of_jumps).map(|metric| metric.name)
    }

    /// Keeps the tips of a node's curves at frames of the request.
    pub(super) fn record_tips(&mut self, node: usize, frames: &[Frame]) {
        if self.metric_of_jumps(node).is_none() {
            return;
        }
        for frame in frames {
            let read = self.plan.read(Link { node, port: 0 }, *frame);
            if let Some(Ok(cooked)) = self.nodes[node].results.get(&read.frame) {
                let geometry = cooked[0].clone();
                self.record_tips_of(node, *frame, &geometry);
            }
        }
    }

    /// Keeps the tips of a node's curves at a frame of the request.
    pub(super) fn record_tips_of(&mut self, node: usize, frame: Frame, geometry: &Geometry) {
        if self.metric_of_jumps(node).is_some()
            && let Some(curves) = geometry.curves()
        {
            self.nodes[node].jumps.tips.entry(frame).or_insert_with(|| Tips::of(curves));
        }
    }

    /// Compares the frames of a slice, oldest first, with each other, and the first one with `before`.
    pub(super) fn compare_tips(&mut self, before: Option<Frame>, frames: &[Frame]) {
        for Jumps { tips, shares, first } in self.nodes.iter_mut().map(|run| &mut run.jumps) {
            if before.is_none() {
                *first = frames.first().and_then(|frame| Some((*frame, tips.get(frame)?.clone())));
            }
            let mut before = before;
            for frame in frames {
                if let (Some(now), Some(then)) = (tips.get(frame), before.and_then(|before| tips.get(&before)))
                    && let Some(share) = now.jumped_since(then)
                {
                    shares.insert(*frame, share);
                }
                before = Some(*frame);
            }
            tips.retain(|frame, _| Some(*frame) == before);
        }
    }

    /// Adds the shares to the report, and the tips at its ends.
    pub(super) fn report_jumps(&mut self) {
        let last = self.plan.request.frames.last();
        for node in 0..self.nodes.len() {
            let Some(name) = self.metric_of_jumps(node) else { continue };
            let run = &mut self.nodes[node];
            let mut shares = std::mem::take(&mut run.jumps.shares);
            // Cooked for one sample only.
            let second = self.plan.request.frames.get(1).filter(|_| !run.report.varies && run.report.needed);
            if let Some(second) = second {
                shares = BTreeMap::from([(second, 0.0)]);
            }
            if !shares.is_empty() {
                run.report.metrics.insert(name, shares);
            }
            let ends = run.jumps.first.take().zip(last.and_then(|last| Some((last, run.jumps.tips.remove(&last)?))));
            run.report.ends = ends.filter(|_| run.report.varies).map(|(first, last)| EndTips::new(name, first, last));
        }
    }
}
