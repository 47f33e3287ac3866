//! Warm-up: chains that are far behind the frames asked are moved towards them a slice at a time, without their outputs.

use super::demand::Lookahead;
use super::{MOST_CHAIN_FRAMES, Sweep};
use crate::plan::{ChainSegment, Read};

/// A frame that a state must reach before the slice that needs it.
#[derive(Clone, Copy)]
pub(super) struct WarmUp {
    pub(super) node: usize,
    pub(super) segment: ChainSegment,
    pub(super) goal: i64,
}

impl Sweep<'_, '_, '_> {
    /// Moves states that are far behind the targets.
    pub(super) fn warm_up_chains(&mut self, targets: &[Read]) {
        loop {
            let behind = self.chains_behind(targets);
            let Some(until) = behind.iter().map(|(warm_up, _)| warm_up.goal).min() else { return };
            let warm_ups: Vec<WarmUp> = behind
                .into_iter()
                .filter(|(_, from)| *from < until)
                .map(|(warm_up, _)| WarmUp { goal: until.max(warm_up.segment.start), ..warm_up })
                .collect();
            self.forget_results();
            let demand = self.collect_demand(&[], &warm_ups, Lookahead::Whole);
            self.cook_slice(demand, &[], &[]);
            self.end_slice();
            if self.cancelled() {
                return;
            }
        }
    }

    /// States that are more than a slice behind: how far each moves next, and the frame it stands at.
    fn chains_behind(&mut self, targets: &[Read]) -> Vec<(WarmUp, i64)> {
        let mut behind = Vec::new();
        for (node, demand) in self.collect_demand(targets, &[], Lookahead::Near).into_iter().enumerate() {
            for (segment, advance) in demand.segments {
                let from = advance.from.unwrap_or(segment.start - 1);
                let before_outputs = advance.outputs.first().map_or(advance.goal, |first| first - 1);
                let goal = before_outputs.min(from + MOST_CHAIN_FRAMES);
                if advance.goal - from > MOST_CHAIN_FRAMES && goal > from && goal >= segment.start {
                    behind.push((WarmUp { node, segment, goal }, from));
                }
            }
        }
        behind
    }
}
