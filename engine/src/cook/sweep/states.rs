//! States of chains on disk: a solver's after every frame, a window's where warming it up again would take longer.

use std::time::Duration;

use super::{ChainState, Sweep};
use crate::cook::disk::StateOf;
use crate::node::{ChainFns, Cook, SavedFns};
use crate::plan::ChainSegment;

impl Sweep<'_, '_, '_> {
    /// How a node's states are kept on disk, if they are.
    fn saved_states(&self, node: usize) -> Option<SavedFns> {
        match self.plan.graph.nodes[node].node()?.cook {
            Cook::Window(ChainFns { saved, .. }, _) | Cook::Solver(ChainFns { saved, .. }, _) => saved,
            Cook::Pure(_) | Cook::Frame { .. } => None,
        }
    }

    /// Whether a window's states are written and read back after each step.
    pub(super) fn reloads_windows(&self, node: usize) -> bool {
        self.executor.reloads() && self.saved_states(node).is_some_and(|saved| saved.resume.is_some())
    }

    /// Provides a state at `frame` or before, if there is one: that of an earlier slice, or one on disk.
    pub(super) fn find_state(&mut self, node: usize, segment: ChainSegment, frame: i64) {
        if self.nodes[node].states.get(&segment).is_some_and(|state| state.at <= frame) {
            return;
        }
        self.nodes[node].states.remove(&segment);
        if self.saved_states(node).is_none() || !self.disk.as_ref().is_some_and(|disk| disk.has_checkpoints()) {
            return;
        }
        // Keys are found from the start on, and the latest state is the one to go on from.
        let mut saved = Vec::new();
        for at in segment.start..=frame {
            let Ok(key) = self.keys.state_key(node, segment, at) else { break };
            if self.disk.as_ref().is_some_and(|disk| disk.has_checkpoint(key)) {
                saved.push(at);
            }
        }
        for at in saved.into_iter().rev() {
            self.find_state_at(node, segment, at);
            if self.nodes[node].states.contains_key(&segment) {
                return;
            }
        }
    }

    /// Takes the state at exactly that frame from disk, unless there is a state of the segment.
    pub(super) fn find_state_at(&mut self, node: usize, segment: ChainSegment, at: i64) {
        let Some(saved) = self.saved_states(node).filter(|_| at >= segment.start) else { return };
        if self.nodes[node].states.contains_key(&segment) {
            return;
        }
        let Some(disk) = self.disk.as_mut().filter(|disk| disk.has_checkpoints()) else { return };
        let Ok(key) = self.keys.state_key(node, segment, at) else { return };
        if !disk.has_checkpoint(key) {
            return;
        }
        let (id, of) = (&self.plan.graph.nodes[node].id, state_of(saved));
        if let Some(state) = disk.checkpoint((id, of), at, key).and_then(|bytes| (saved.load)(&bytes)) {
            let run = &mut self.nodes[node];
            run.report.from_cache += 1;
            let state = ChainState { at, state: Ok(state), moved: self.slices, is_saved: saved.resume.is_some() };
            run.states.insert(segment, state);
        }
    }

    /// Saves the states of a window that has moved by `frames` frames, which took `wall`, once that took long enough.
    pub(super) fn save_window_states(&mut self, node: usize, frames: usize, wall: Duration) {
        let Some(saved) = self.saved_states(node).filter(|saved| saved.resume.is_some()) else { return };
        if self.disk.is_none() || frames == 0 || self.cancelled() {
            return;
        }
        let again = wall + self.upstream_recreated_in(node) * frames as u32;
        let on_disk = &mut self.nodes[node].on_disk;
        on_disk.moved_for += again;
        let (moved_for, bytes) = (on_disk.moved_for, on_disk.state_bytes);
        if !self.disk.as_ref().is_some_and(|disk| disk.is_worth_state(moved_for, bytes)) {
            return;
        }
        let moved = self.slices;
        let states: Vec<(ChainSegment, i64, Vec<u8>)> = self.nodes[node]
            .states
            .iter()
            .filter(|(segment, state)| state.moved == moved && state.at > segment.start && !state.is_saved)
            .filter_map(|(segment, state)| Some((*segment, state.at, (saved.save)(state.state.as_ref().ok()?)?)))
            .collect();
        self.nodes[node].on_disk.state_bytes = states.iter().map(|(_, _, bytes)| bytes.len()).sum();
        if !self.disk.as_ref().is_some_and(|disk| disk.is_worth_state(moved_for, self.nodes[node].on_disk.state_bytes))
        {
            return;
        }
        for (segment, at, bytes) in states {
            self.save_state(node, segment, at, saved, &bytes);
        }
        self.nodes[node].on_disk.moved_for = Duration::ZERO;
    }

    /// Saves the state of a chain at a frame.
    pub(super) fn save_state(&mut self, node: usize, segment: ChainSegment, frame: i64, saved: SavedFns, bytes: &[u8]) {
        let Ok(key) = self.keys.state_key(node, segment, frame) else { return };
        if let Some(disk) = self.disk.as_mut() {
            disk.save_checkpoint((&self.plan.graph.nodes[node].id, state_of(saved)), frame, key, bytes);
        }
    }
}

/// A window's state is resumed, a solver's is whole.
fn state_of(saved: SavedFns) -> StateOf {
    if saved.resume.is_some() { StateOf::Window } else { StateOf::Solver }
}
