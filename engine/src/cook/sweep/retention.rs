//! What is kept from slice to slice and from cook to cook, and what is dropped.

use super::Sweep;
use crate::key::ContentKey;
use crate::time::Frame;

/// Whole frames of a chain whose outputs a sample between frames may read again.
const KEPT_NEIGHBOURS: usize = 4;

impl Sweep<'_, '_, '_> {
    /// Keeps results of a node that later slices will read again.
    pub(super) fn keep(&mut self, node: usize) {
        if let Some(frame) = self.plan.reread_frame(node) {
            self.keep_reread(node, frame);
        }
        let planned = &self.plan.nodes[node];
        if planned.varies && planned.may_hold {
            self.keep_last(node);
        }
    }

    fn keep_reread(&mut self, node: usize, frame: Frame) {
        let Some(Ok(cooked)) = self.nodes[node].results.get(&frame) else { return };
        let Ok(resolved) = self.keys.resolve(node, frame) else { return };
        self.own.insert(resolved.key);
        if self.executor.remembers_costs() {
            self.engine.note_verified(resolved.key, &self.nodes[node].report);
        }
        let metrics = self.published(node, frame);
        self.engine.store(|store| {
            if !store.contains(resolved.key) {
                store.keep(resolved.key, cooked, metrics);
            }
        });
    }

    /// Keeps the last result instead of the one kept before: the next frame may have the same key.
    fn keep_last(&mut self, node: usize) {
        let run = &mut self.nodes[node];
        let Some((frame, Ok(cooked))) = run.results.last_key_value() else { return };
        let Ok(resolved) = self.keys.resolve(node, *frame) else { return };
        if run.held == Some(resolved.key) {
            return;
        }
        let (frame, cooked) = (*frame, cooked.clone());
        let before: Option<ContentKey> = run.held.replace(resolved.key);
        self.own.insert(resolved.key);
        if let Some(before) = before {
            self.own.remove(&before);
        }
        let metrics = self.published(node, frame);
        self.engine.store(|store| {
            before.into_iter().for_each(|key| store.drop(key));
            store.keep(resolved.key, &cooked, metrics);
        });
    }

    /// Whether nobody has the result; takes it from memory where it is there.
    pub(super) fn is_missing(&mut self, node: usize, frame: Frame) -> bool {
        if self.nodes[node].results.contains_key(&frame) {
            return false;
        }
        let outcome = match self.keys.resolve(node, frame) {
            Err(error) => Err(error),
            Ok(resolved) => match self.engine.store(|store| store.get(resolved.key)) {
                None => match self.result_on_disk(node, frame, resolved.key) {
                    None => return true,
                    Some(cooked) => Ok(cooked),
                },
                Some((cooked, metrics)) => {
                    self.record_found(node, resolved.key);
                    self.publish(node, frame, &metrics);
                    Ok(cooked)
                }
            },
        };
        self.nodes[node].results.insert(frame, outcome);
        false
    }

    /// Records a result found in memory: what a check of the graph cooked counts as cooked, what an earlier cook left
    /// counts as found; what this cook keeps from slice to slice counts as neither.
    fn record_found(&mut self, node: usize, key: ContentKey) {
        if !self.own.insert(key) {
            return;
        }
        let report = &mut self.nodes[node].report;
        match self.engine.take_verified(key) {
            None => report.from_cache += 1,
            Some(cost) => {
                report.cooks += cost.cooks;
                report.wall += cost.wall;
                report.cpu += cost.cpu;
                report.peak_bytes = report.peak_bytes.max(cost.peak_bytes);
                report.metrics = cost.metrics;
            }
        }
    }

    /// Drops a node's results of the slice.
    pub(super) fn forget(&mut self, node: usize) {
        let run = &mut self.nodes[node];
        run.results.clear();
        self.live_bytes -= std::mem::take(&mut run.bytes);
    }

    pub(super) fn forget_results(&mut self) {
        (0..self.nodes.len()).for_each(|node| self.forget(node));
    }

    /// Drops the states of windows that this slice did not move: the frames still to come lie beyond them.
    pub(super) fn forget_windows_left_behind(&mut self) {
        for run in &mut self.nodes {
            run.states.retain(|segment, state| segment.until == i64::MAX || state.moved == self.slices);
        }
        self.slices += 1;
    }

    pub(super) fn end_slice(&mut self) {
        self.forget_results();
        self.keys.end_slice();
        self.plan.files.release();
        if let Some(disk) = self.disk.as_mut() {
            disk.prune_checkpoints();
        }
        for run in &mut self.nodes {
            while run.recent.len() > KEPT_NEIGHBOURS {
                run.recent.pop_first();
            }
        }
    }
}
