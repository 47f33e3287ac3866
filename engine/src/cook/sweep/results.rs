//! Results of nodes on disk: those that take long to make for their size, so that a changed graph cooks only what comes
//! after the change, and windows that start anew find their past.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use super::Sweep;
use crate::cook::DiskCache;
use crate::cook::disk::KeptMetric;
use crate::cook::store::Cooked;
use crate::geometry::Kind;
use crate::key::ContentKey;
use crate::plan::Read;
use crate::time::Frame;

/// What a sweep knows of a node's results and states on disk.
#[derive(Default)]
pub(super) struct OnDisk {
    /// The result that was read last, with which the next one shares what has not changed.
    loaded: Option<Cooked>,
    /// Whether results are worth keeping.
    is_kept: bool,
    /// What it takes to make a result again from what is there.
    recreated_in: Duration,
    /// What it takes to move the states of a window to where they are from where they were saved last.
    pub(super) moved_for: Duration,
    /// Bytes of these states when they were last written.
    pub(super) state_bytes: usize,
}

impl Sweep<'_, '_, '_> {
    /// A result that an earlier cook has kept.
    pub(super) fn result_on_disk(&mut self, node: usize, frame: Frame, key: ContentKey) -> Option<Cooked> {
        let (mut cooked, metrics) = self.disk.as_mut()?.result(key)?;
        let outputs = self.plan.graph.nodes[node].node().map_or(1, |declared| declared.outputs.len());
        if cooked.len() != outputs {
            return None;
        }
        self.share_loaded(node, &mut cooked);
        self.nodes[node].report.from_cache += 1;
        let bytes = cooked.iter().map(|geometry| geometry.bytes()).sum::<usize>();
        self.nodes[node].bytes += bytes;
        self.live_bytes += bytes;
        self.publish_results(node, frame, &metrics);
        Some(cooked)
    }

    /// Shares topology and arrays with what was loaded before: nodes know what they have prepared, such as trees, by
    /// address.
    fn share_loaded(&mut self, node: usize, cooked: &mut Cooked) {
        let own = self.nodes[node].on_disk.loaded.take();
        let others = self.nodes.iter().filter_map(|run| run.on_disk.loaded.clone());
        let known: Vec<Cooked> = if own.is_some() { own.into_iter().collect() } else { others.collect() };
        for geometry in Arc::get_mut(cooked).into_iter().flatten().filter_map(Arc::get_mut) {
            for kind in Kind::ALL {
                let Some(part) = geometry.part_mut(kind) else { continue };
                let theirs = known.iter().flat_map(|cooked| cooked.iter()).filter_map(|theirs| theirs.part(kind));
                theirs.for_each(|theirs| part.share_with(theirs));
            }
        }
        self.nodes[node].on_disk.loaded = Some(cooked.clone());
    }

    /// Keeps the results just cooked at `frames`, which took `wall` together, if they are worth it; after a cancellation
    /// those of calls that had ended, or ended all the same.
    pub(super) fn save_results(&mut self, node: usize, frames: &BTreeSet<Frame>, wall: Duration) {
        if self.disk.is_none() || frames.is_empty() {
            return;
        }
        let cost = wall / frames.len() as u32 + self.upstream_recreated_in(node);
        self.nodes[node].on_disk.recreated_in = cost;
        for frame in frames {
            let Some(Ok(cooked)) = self.nodes[node].results.get(frame).cloned() else { continue };
            let bytes = cooked.iter().map(|geometry| geometry.bytes()).sum();
            // Once and for all: a window with some of its results would start anew for the others.
            let worth = self.nodes[node].on_disk.is_kept
                || self.until.contains(&node)
                || self.disk.as_ref().is_some_and(|disk| disk.is_worth(cost, bytes));
            if !worth {
                continue;
            }
            self.nodes[node].on_disk.is_kept = true;
            let Ok(resolved) = self.keys.resolve(node, *frame) else { continue };
            let Some(metrics) = self.metrics_of_result(node, *frame) else { continue };
            if let Some(disk) = self.disk.as_mut() {
                disk.save_result(resolved.key, &cooked, &metrics);
            }
            self.nodes[node].on_disk.recreated_in = DiskCache::read_in(bytes);
        }
    }

    /// Results at these frames of the nodes that are cooked instead of the outputs.
    pub(super) fn reads_until(&self, frames: &[Frame]) -> Vec<Read> {
        let plan = self.plan;
        let of =
            |node: usize| frames.iter().map(move |frame| Read { node, port: 0, frame: plan.canonical(node, *frame) });
        self.until.iter().flat_map(|node| of(*node)).collect()
    }

    /// Records the errors of the nodes that are cooked instead of the outputs, as those of the first output.
    pub(super) fn record_errors_until(&mut self, reads: &[Read]) {
        if self.until.is_empty() {
            return;
        }
        let output = self.plan.request.outputs.first().copied().unwrap_or_default();
        for Read { node, frame, .. } in reads {
            if let Some(Err(error)) = self.nodes[*node].results.get(frame).cloned() {
                self.record_error(output, error);
            }
        }
    }

    /// What it takes to make the results again that one of this node is made from.
    pub(super) fn upstream_recreated_in(&self, node: usize) -> Duration {
        self.plan.dag.sources(node).map(|source| self.nodes[source].on_disk.recreated_in).sum()
    }

    /// What a node and those it depends on published at a frame; `None` where a cancellation came before all keys were
    /// found.
    fn metrics_of_result(&mut self, node: usize, frame: Frame) -> Option<Vec<KeptMetric>> {
        let behind = self.results_behind(node, frame);
        let measured = self.plan.ancestors(node).into_iter().filter(|of| self.measures(*of)).count();
        if self.cancelled() && behind.len() < measured {
            return None;
        }
        let mut metrics = Vec::new();
        for (of, at, key) in behind {
            metrics.extend(self.kept_of(of, at, key));
        }
        Some(metrics)
    }

    /// Publishes what was kept with a result.
    fn publish_results(&mut self, node: usize, frame: Frame, kept: &[KeptMetric]) {
        if kept.is_empty() {
            return;
        }
        for (of, at, key) in self.results_behind(node, frame) {
            self.publish_of_key(of, at, key, kept);
        }
    }

    /// Results at a frame of a node and of those it depends on that have metrics: node, frame, key.
    fn results_behind(&mut self, node: usize, frame: Frame) -> Vec<(usize, Frame, ContentKey)> {
        let plan = self.plan;
        let mut found = Vec::new();
        for of in plan.ancestors(node) {
            if !self.measures(of) {
                continue;
            }
            let at = plan.canonical(of, frame);
            found.extend(self.keys.resolve(of, at).ok().map(|resolved| (of, at, resolved.key)));
        }
        found
    }
}
