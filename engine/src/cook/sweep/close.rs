//! From what is asked upwards: everything a slice must have and has not.

use std::collections::{BTreeMap, BTreeSet};

use super::{Advance, LONGEST, Reach, Running, Silent, Slice, Sweep};
use crate::graph::{Body, Link};
use crate::key::Key;
use crate::node::Cook;
use crate::plan::Stretch;
use crate::time::Frame;

impl Sweep<'_, '_, '_> {
    /// From the targets upwards: everything the slice must have and has not.
    pub(super) fn close(&mut self, targets: &[(usize, Frame)], silent: &[Silent], reach: Reach) -> Slice {
        let count = self.plan.graph.nodes.len();
        let mut slice =
            Slice { need: vec![BTreeSet::new(); count], advance: (0..count).map(|_| BTreeMap::new()).collect() };
        for (node, frame) in targets {
            slice.need[*node].insert(*frame);
        }
        for Silent { node, stretch, goal } in silent {
            slice.advance[*node].insert(*stretch, Advance { goal: *goal, ..Advance::default() });
        }
        for node in (0..count).rev() {
            let frames: Vec<Frame> = slice.need[node].iter().copied().collect();
            for frame in frames {
                if !self.is_missing(node, frame) {
                    slice.need[node].remove(&frame);
                    continue;
                }
                self.demand(&mut slice, node, frame);
            }
            self.demand_of_chain(&mut slice, node, reach);
        }
        slice
    }

    /// Whether nobody has the result; takes it from memory where it is there.
    pub(super) fn is_missing(&mut self, node: usize, frame: Frame) -> bool {
        if self.results[node].contains_key(&frame) {
            return false;
        }
        let outcome = match self.keys.spot(node, frame) {
            Err(error) => Err(error),
            Ok(spot) => match self.engine.store(|store| store.get(spot.key)) {
                None => return true,
                Some((cooked, metrics)) => {
                    self.book_found(node, spot.key);
                    self.publish(node, frame, &metrics);
                    Ok(cooked)
                }
            },
        };
        self.results[node].insert(frame, outcome);
        false
    }

    /// Books a result that was there already: what a check of the graph cooked counts as cooked, what an earlier cook left
    /// as found; what this cook keeps from slice to slice is neither.
    fn book_found(&mut self, node: usize, key: Key) {
        if !self.own.insert(key) {
            return;
        }
        let report = &mut self.report.nodes[node];
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

    fn demand(&mut self, slice: &mut Slice, node: usize, frame: Frame) {
        let Body::Node { node: declared, inputs, .. } = &self.plan.graph.nodes[node].body else { return };
        match declared.cook {
            Cook::Pure(_) | Cook::Frame { .. } => {
                let Ok(spot) = self.keys.spot(node, frame) else { return };
                for (times, links) in spot.times.iter().zip(inputs) {
                    if times.now {
                        self.need_all(slice, links, frame);
                    }
                    if times.start {
                        self.need_all(slice, links, self.plan.graph.scene.start());
                    }
                }
            }
            Cook::Window(..) | Cook::Solver(..) => {
                for whole in self.plan.neighbours(frame) {
                    // An error of the stretch came out as the error of the spot before.
                    let Ok(stretch) = self.keys.stretch(node, whole) else { return };
                    let whole = whole.max(stretch.start);
                    if self.recent[node].contains_key(&whole) {
                        continue;
                    }
                    let advance = slice.advance[node].entry(stretch).or_default();
                    advance.outputs.insert(whole);
                    advance.goal = if advance.outputs.len() == 1 { whole } else { advance.goal.max(whole) };
                }
            }
        }
    }

    fn need_all(&self, slice: &mut Slice, links: &[Link], frame: Frame) {
        for link in links {
            slice.need[link.node].insert(self.plan.canonical(link.node, frame));
        }
    }

    /// What a chain reads while it moves.
    fn demand_of_chain(&mut self, slice: &mut Slice, node: usize, reach: Reach) {
        let mut advances = std::mem::take(&mut slice.advance[node]);
        for (stretch, advance) in &mut advances {
            let first = advance.outputs.first().copied().unwrap_or(advance.goal);
            self.find_state(node, *stretch, first);
            advance.from = self.running[node].get(stretch).map(|running| running.at);
        }
        self.move_beside(node, &mut advances);
        for (stretch, advance) in &advances {
            let next = advance.from.map_or(stretch.start, |at| at + 1);
            let last = match reach {
                Reach::Whole => advance.goal,
                Reach::Near => advance.goal.min(next.saturating_add(LONGEST)),
            };
            for frame in next..=last {
                self.demand_of_step(slice, node, frame, frame == stretch.start);
            }
            // The frame it stands at is read again by an output there.
            if let Some(at) = advance.from.filter(|at| advance.outputs.contains(at)) {
                self.demand_of_step(slice, node, at, at == stretch.start);
            }
        }
        slice.advance[node] = advances;
    }

    /// Lets the stretches of a window that later frames will ask for move beside those asked now: what they read is at
    /// hand, and would have to be cooked again later.
    fn move_beside(&mut self, node: usize, advances: &mut BTreeMap<Stretch, Advance>) {
        let next = |stretch: Stretch, from: Option<i64>| from.map_or(stretch.start, |at| at + 1);
        let low = advances.iter().map(|(stretch, advance)| next(*stretch, advance.from)).min();
        let high = advances.values().map(|advance| advance.goal).max();
        let until = advances.keys().map(|stretch| stretch.until).max();
        let (Some(low), Some(high), Some(mut until)) = (low, high, until) else { return };
        while until < i64::MAX
            && self.plan.nodes[node].varies
            && let Ok(stretch) = self.keys.stretch(node, until)
            && stretch.start <= high
            && self.is_asked_later(node, stretch)
        {
            let from = self.running[node].get(&stretch).map(|running| running.at);
            if (low..=high).contains(&next(stretch, from)) {
                advances.insert(stretch, Advance { goal: high, from, ..Advance::default() });
            }
            until = stretch.until;
        }
    }

    /// Whether a frame of the request lies in the stretch, or beyond it where a chain will pass through.
    fn is_asked_later(&self, node: usize, stretch: Stretch) -> bool {
        let frames = &self.plan.request.frames;
        let first = frames.get(frames.partition_point(|frame| frame.floor_number() < stretch.from));
        first.is_some_and(|frame| self.plan.nodes[node].feeds_chain || frame.floor_number() < stretch.until)
    }

    fn demand_of_step(&mut self, slice: &mut Slice, node: usize, frame: i64, starts: bool) {
        let plan = self.plan;
        let Body::Node { node: declared, inputs, .. } = &plan.graph.nodes[node].body else { return };
        let at = Frame::whole(frame);
        let Ok(params) = plan.nodes[node].resolver.at(at) else { return };
        for (input, links) in declared.inputs.iter().zip(inputs) {
            let times = (input.spec().times)(&params);
            if times.now || (starts && times.steps > 0) {
                self.need_all(slice, links, at);
            }
            if times.start && starts {
                self.need_all(slice, links, plan.start_of(declared, at));
            }
            if times.steps > 0 && !starts {
                for sample in plan.step_samples(links, times.steps, at) {
                    self.need_all(slice, links, sample);
                }
            }
        }
    }

    /// Sees to it that a state that can reach `frame` is running, if there is one: the one at hand, or a checkpoint.
    fn find_state(&mut self, node: usize, stretch: Stretch, frame: i64) {
        if self.running[node].get(&stretch).is_some_and(|running| running.at <= frame) {
            return;
        }
        self.running[node].remove(&stretch);
        let Some(Cook::Solver(_, solver)) = self.plan.graph.nodes[node].node().map(|node| node.cook) else { return };
        let Some(disk) = self.disk.as_ref() else { return };
        for at in (stretch.start..=frame).rev() {
            let Ok(key) = self.keys.state_key(node, stretch, at) else { continue };
            let state = disk.checkpoint(key).and_then(|bytes| (solver.load)(&bytes));
            if let Some(state) = state {
                self.report.nodes[node].from_cache += 1;
                self.running[node].insert(stretch, Running { at, state: Ok(state), moved: self.slices });
                return;
            }
        }
    }
}
