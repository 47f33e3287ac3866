//! What is kept from slice to slice and from cook to cook, and what is dropped.

use super::Sweep;
use crate::cook::store::Cooked;
use crate::graph::Body;
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
        self.keep_last(node);
    }

    fn keep_reread(&mut self, node: usize, frame: Frame) {
        let Some(Ok(cooked)) = self.nodes[node].results.get(&frame).cloned() else { return };
        let Ok(resolved) = self.keys.resolve(node, frame) else { return };
        self.own.insert(resolved.key);
        self.nodes[node].reread = Some(resolved.key);
        if self.executor.remembers_costs() {
            self.engine.note_verified(resolved.key, &self.nodes[node].report);
        }
        let metrics = self.published(node, frame);
        self.engine.store(|store| {
            if !store.contains(resolved.key) {
                store.keep(resolved.key, &cooked, metrics);
            }
        });
    }

    /// Keeps the last results, which the next slice may read, or results of the same key; drops those kept before that it
    /// may not.
    fn keep_last(&mut self, node: usize) {
        let last = self.nodes[node].results.last_key_value().map(|(frame, _)| *frame);
        let Some(since) = last.and_then(|last| self.plan.reread_since(node, last)) else { return };
        let made = self.nodes[node].results.range(since..);
        let made: Vec<(Frame, Cooked)> =
            made.filter_map(|(frame, outcome)| Some((*frame, outcome.as_ref().ok()?.clone()))).collect();
        let mut held = self.nodes[node].held.split_off(&since);
        for (frame, cooked) in made {
            let Ok(resolved) = self.keys.resolve(node, frame) else { continue };
            held.insert(frame, resolved.key);
            if self.own.insert(resolved.key) {
                let metrics = self.published(node, frame);
                self.engine.store(|store| store.keep(resolved.key, &cooked, metrics));
            }
        }
        let before = std::mem::replace(&mut self.nodes[node].held, held);
        for key in before.into_values() {
            if !self.nodes[node].held.values().any(|held| *held == key) {
                self.own.remove(&key);
                self.engine.store(|store| store.drop(key));
            }
        }
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

    /// Drops what is kept of given geometry and of what was made of it: keys of these are of this plan alone. They would
    /// take the place of results that later cooks find.
    pub(super) fn forget_given(&mut self) {
        let plan = self.plan;
        let mut of_given: Vec<bool> = Vec::with_capacity(self.nodes.len());
        // Nodes stand behind their sources.
        for (node, run) in self.nodes.iter_mut().enumerate() {
            let is_given = matches!(plan.graph.nodes[node].body, Body::Given { .. });
            of_given.push(is_given || plan.dag.sources(node).any(|source| of_given[source]));
            if of_given[node] {
                let held = std::mem::take(&mut run.held).into_values().chain(run.reread.take());
                held.for_each(|key| self.engine.store(|store| store.drop(key)));
            }
        }
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
