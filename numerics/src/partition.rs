//! Fixed partitions of particles for parallel loops and sums. They do not depend on the number of threads, so neither
//! do results.

use crate::parallel;
use std::ops::{Add, Range};

/// Number of particles below which threads cost more than they gain.
const WORTH_THREADS: usize = 1500;

/// Consecutive ranges that start at 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Partition {
    /// Start of each range, and the end of the last.
    starts: Vec<usize>,
    /// Whether loops run in parallel.
    parallel: bool,
}

/// Per-particle data that can be split between two particles.
pub trait SplitAt: Send + Sized {
    /// The parts before and from particle `at` on.
    fn halves(self, at: usize) -> (Self, Self);
}

impl<T: Send> SplitAt for &mut [T] {
    fn halves(self, at: usize) -> (Self, Self) {
        self.split_at_mut(at)
    }
}

impl SplitAt for () {
    fn halves(self, _: usize) -> (Self, Self) {
        ((), ())
    }
}

/// A slice with a variable number of entries for each particle.
pub struct RaggedSlice<'a, T> {
    starts: &'a [u32],
    data: &'a mut [T],
}

impl<'a, T> RaggedSlice<'a, T> {
    /// `data` with the entries of each particle from its start to the next one's.
    pub fn new(starts: &'a [u32], data: &'a mut [T]) -> Self {
        Self { starts, data }
    }

    /// The entries of each particle, in order.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut [T]> {
        let mut left = &mut *self.data;
        self.starts.windows(2).map(move |ends| {
            let (mine, rest) = std::mem::take(&mut left).split_at_mut((ends[1] - ends[0]) as usize);
            left = rest;
            mine
        })
    }
}

impl<T: Send> SplitAt for RaggedSlice<'_, T> {
    fn halves(self, at: usize) -> (Self, Self) {
        let (data, rest) = self.data.split_at_mut((self.starts[at] - self.starts[0]) as usize);
        (Self { starts: &self.starts[..=at], data }, Self { starts: &self.starts[at..], data: rest })
    }
}

impl<A: SplitAt, B: SplitAt> SplitAt for (A, B) {
    fn halves(self, at: usize) -> (Self, Self) {
        let ((a, a_rest), (b, b_rest)) = (self.0.halves(at), self.1.halves(at));
        ((a, b), (a_rest, b_rest))
    }
}

impl<A: SplitAt, B: SplitAt, C: SplitAt> SplitAt for (A, B, C) {
    fn halves(self, at: usize) -> (Self, Self) {
        let ((a, a_rest), (b, b_rest), (c, c_rest)) = (self.0.halves(at), self.1.halves(at), self.2.halves(at));
        ((a, b, c), (a_rest, b_rest, c_rest))
    }
}

impl<A: SplitAt, B: SplitAt, C: SplitAt, D: SplitAt> SplitAt for (A, B, C, D) {
    fn halves(self, at: usize) -> (Self, Self) {
        let (((a, b), (c, d)), ((a_rest, b_rest), (c_rest, d_rest))) = ((self.0, self.1), (self.2, self.3)).halves(at);
        ((a, b, c, d), (a_rest, b_rest, c_rest, d_rest))
    }
}

impl Partition {
    /// Ranges that begin at `starts`, whose last element is the end.
    pub fn new(starts: Vec<usize>) -> Self {
        let parallel = starts.last().is_some_and(|end| *end >= WORTH_THREADS);
        Self { starts, parallel }
    }

    /// Ranges of `size` out of `len` items, the last one shorter; `weight` is the cost of an item relative to that of
    /// a particle.
    pub fn even(len: usize, size: usize, weight: usize) -> Self {
        let mut starts: Vec<usize> = (0..len).step_by(size).collect();
        starts.push(len);
        Self { starts, parallel: len.saturating_mul(weight) >= WORTH_THREADS }
    }

    /// Whether loops run in parallel.
    pub fn is_parallel(&self) -> bool {
        self.parallel
    }

    /// Number of ranges.
    #[inline]
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether there are no ranges.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One range.
    #[inline]
    pub fn range(&self, part: usize) -> Range<usize> {
        self.starts[part]..self.starts[part + 1]
    }

    /// Evaluates `work` for each range with its part of `data`.
    pub fn map<D: SplitAt, R: Send + Default>(&self, data: D, work: impl Fn(usize, D) -> R + Sync) -> Vec<R> {
        self.map_dyn(data, &work)
    }

    /// The sum of `work` over all ranges, in order.
    pub fn sum<D: SplitAt, R>(&self, data: D, work: impl Fn(usize, D) -> R + Sync) -> R
    where
        R: Add<Output = R> + Default + Send,
    {
        self.map(data, work).into_iter().fold(R::default(), |sum, part| sum + part)
    }

    /// Runs `work` for each range with its part of `data`.
    pub fn for_each<D: SplitAt>(&self, data: D, work: impl Fn(usize, D) + Sync) {
        self.map(data, work);
    }

    /// [`Self::map`], compiled once for all closures on the same data.
    fn map_dyn<D: SplitAt, R: Send + Default>(&self, data: D, work: &(dyn Fn(usize, D) -> R + Sync)) -> Vec<R> {
        let mut out = Vec::with_capacity(self.len());
        out.resize_with(self.len(), R::default);
        let mut left = Some(data);
        let parts = self.starts.windows(2).zip(&mut out).filter_map(|(ends, out)| {
            let (mine, rest) = left.take()?.halves(ends[1] - ends[0]);
            left = Some(rest);
            Some((mine, out))
        });
        let run = |part, (mine, out): (D, &mut R)| *out = work(part, mine);
        if self.parallel {
            parallel::for_each(parts, run);
        } else {
            parts.enumerate().for_each(|(part, piece)| run(part, piece));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_range_gets_its_part_of_the_data_and_sums_run_in_order() {
        for size in [1, 7, 2000] {
            let partition = Partition::even(2000, size, 1);
            let mut data = vec![0usize; 2000];
            let sum = partition.sum(&mut data[..], |part, mine: &mut [usize]| {
                let range = partition.range(part);
                assert_eq!(range.len(), mine.len());
                range.clone().zip(mine).for_each(|(index, slot)| *slot = index);
                range.len() as f64
            });
            assert_eq!(sum, 2000.0);
            assert!(data.iter().enumerate().all(|(index, value)| index == *value));
        }
        assert_eq!(Partition::new(vec![0]).len(), 0);
    }
}
