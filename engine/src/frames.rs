//! Sets of frames, stored as runs of equal steps: a billion frames take as little memory as one.

use crate::time::Frame;

/// Frames, ascending and without repetition.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FrameSet {
    runs: Vec<Run>,
}

/// Frames at equal steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Run {
    first: Frame,
    /// Ticks from a frame to the next; 1 for a single frame.
    step: i64,
    count: i64,
    /// Frames in the runs before.
    before: i64,
}

impl Run {
    fn at(&self, index: i64) -> Frame {
        self.first.plus_ticks(index * self.step)
    }

    fn last(&self) -> Frame {
        self.at(self.count - 1)
    }
}

impl FrameSet {
    /// The whole frames from `first` to `last`; none if `last` is earlier.
    pub fn whole(first: i64, last: i64) -> Self {
        Self::range(Frame::whole(first), Frame::whole(last), Frame::TICKS)
    }

    /// Every frame from `first` to `last` that is a multiple of `step` ticks after `first`; none if `last` is earlier.
    ///
    /// # Panics
    /// If `step` is not positive.
    pub fn range(first: Frame, last: Frame, step: i64) -> Self {
        assert!(step > 0, "a step of {step} ticks");
        let count = (last.ticks() - first.ticks()).div_euclid(step) + 1;
        let step = if count == 1 { 1 } else { step };
        Self { runs: if count > 0 { vec![Run { first, step, count, before: 0 }] } else { Vec::new() } }
    }

    /// The frames of both sets.
    #[must_use]
    pub fn union(mut self, other: &Self) -> Self {
        match (self.last(), other.first()) {
            // Runs that follow each other are kept, however long.
            (Some(last), Some(first)) if last >= first => self.iter().chain(other.iter()).collect(),
            _ => {
                let before = self.len() as i64;
                self.runs.extend(other.runs.iter().map(|run| Run { before: before + run.before, ..*run }));
                self
            }
        }
    }

    /// The number of frames.
    pub fn len(&self) -> usize {
        self.runs.last().map_or(0, |run| (run.before + run.count) as usize)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// The frame at `index`.
    pub fn get(&self, index: usize) -> Option<Frame> {
        let index = i64::try_from(index).ok()?;
        let run = self.runs.get(self.runs.partition_point(|run| run.before + run.count <= index))?;
        Some(run.at(index - run.before))
    }

    /// The first frame.
    pub fn first(&self) -> Option<Frame> {
        self.runs.first().map(|run| run.first)
    }

    /// The last frame.
    pub fn last(&self) -> Option<Frame> {
        self.runs.last().map(Run::last)
    }

    /// The first frame that is not whole.
    pub fn fraction(&self) -> Option<Frame> {
        // Of a run all frames are whole if the first and the step are.
        let whole = |run: &&Run| run.first.is_whole() && (run.count == 1 || run.step % Frame::TICKS == 0);
        let run = self.runs.iter().find(|run| !whole(run))?;
        (0..run.count).map(|index| run.at(index)).find(|frame| !frame.is_whole())
    }

    /// All frames in order.
    pub fn iter(&self) -> impl Iterator<Item = Frame> + '_ {
        self.runs.iter().flat_map(|run| (0..run.count).map(|index| run.at(index)))
    }

    /// The first frame that is not before `frame`.
    pub fn at_or_after(&self, frame: Frame) -> Option<Frame> {
        let run = self.runs.get(self.runs.partition_point(|run| run.last() < frame))?;
        let ticks = (frame.ticks() - run.first.ticks()).max(0);
        Some(run.at(ticks.div_euclid(run.step) + i64::from(ticks % run.step != 0)))
    }

    /// Whether it has this frame.
    pub fn contains(&self, frame: Frame) -> bool {
        self.at_or_after(frame) == Some(frame)
    }
}

impl FromIterator<Frame> for FrameSet {
    fn from_iter<I: IntoIterator<Item = Frame>>(frames: I) -> Self {
        let mut frames: Vec<Frame> = frames.into_iter().collect();
        frames.sort_unstable();
        frames.dedup();
        let mut runs: Vec<Run> = Vec::new();
        for (index, frame) in frames.into_iter().enumerate() {
            let gap = runs.last().map(|run| frame.ticks() - run.last().ticks());
            match (runs.last_mut(), gap) {
                (Some(run), Some(gap)) if run.count == 1 || run.step == gap => {
                    run.step = gap;
                    run.count += 1;
                }
                _ => runs.push(Run { first: frame, step: 1, count: 1, before: index as i64 }),
            }
        }
        Self { runs }
    }
}

impl From<Vec<Frame>> for FrameSet {
    fn from(frames: Vec<Frame>) -> Self {
        frames.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(numbers: &[i64]) -> Vec<Frame> {
        numbers.iter().copied().map(Frame::whole).collect()
    }

    #[test]
    fn a_set_is_its_list_sorted_and_without_repetition() {
        for list in [&[][..], &[4], &[3, 1, 2, 3], &[1, 2, 4, 6, 8, 9, 20], &[-5, 0, 5, 6]] {
            let set: FrameSet = frames(list).into();
            let mut sorted = frames(list);
            sorted.sort_unstable();
            sorted.dedup();
            assert_eq!(set.iter().collect::<Vec<_>>(), sorted);
            assert_eq!((set.len(), set.is_empty()), (sorted.len(), sorted.is_empty()));
            assert_eq!((set.first(), set.last()), (sorted.first().copied(), sorted.last().copied()));
            assert_eq!((0..=sorted.len()).map_while(|index| set.get(index)).collect::<Vec<_>>(), sorted);
            for frame in frames(&(-7..22).collect::<Vec<_>>()).into_iter().flat_map(|at| [at, at.plus_ticks(1)]) {
                assert_eq!(set.at_or_after(frame), sorted.iter().copied().find(|at| *at >= frame), "{frame}");
                assert_eq!(set.contains(frame), sorted.contains(&frame));
            }
        }
    }

    #[test]
    fn unions_of_sets_that_overlap_follow_each_other_or_are_empty() {
        let set = |first, last| FrameSet::whole(first, last);
        let union = |a: &FrameSet, b: &FrameSet| a.clone().union(b).iter().map(Frame::floor_number).collect::<Vec<_>>();
        assert_eq!(union(&set(1, 3), &set(2, 5)), [1, 2, 3, 4, 5]);
        assert_eq!(union(&set(7, 8), &set(1, 2)), [1, 2, 7, 8]);
        assert_eq!(union(&set(1, 2), &set(7, 8)), [1, 2, 7, 8]);
        assert_eq!(union(&set(1, 0), &set(7, 7)), [7]);
        let steps = FrameSet::range(Frame::whole(1), Frame::whole(2), Frame::TICKS / 4).union(&set(3, 3));
        assert_eq!((steps.fraction(), set(1, 9).fraction()), (steps.get(1), None));
        assert_eq!((steps.len(), steps.get(1), steps.get(5)), (6, "1.25".parse().ok(), "3".parse().ok()));
    }

    #[test]
    fn a_billion_frames_take_no_memory() {
        let all = FrameSet::whole(-Frame::LIMIT, Frame::LIMIT).union(&FrameSet::default());
        assert_eq!((all.len(), all.runs.len()), (2_000_000_001, 1));
        assert_eq!(all.get(1_500_000_000).map(Frame::floor_number), Some(500_000_000));
        assert!(all.contains(Frame::whole(77)) && !all.contains(Frame::whole(77).plus_ticks(1)));
    }
}
