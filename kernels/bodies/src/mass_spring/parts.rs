//! Fixed parts of the particles, for threads and for sums: which part a particle is in never depends on the threads, so
//! neither does any bit.

use std::ops::Range;

/// Particles below which threads cost more than they bring.
const WORTH_THREADS: usize = 1500;

/// Ranges that follow each other from 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Parts {
    /// Where each begins, and where the last ends.
    starts: Vec<usize>,
    /// Whether there is work enough to share.
    wide: bool,
}

/// Data that can be cut in two at a particle.
pub(super) trait Cut: Send + Sized {
    /// What lies before `at`, and the rest.
    fn cut(self, at: usize) -> (Self, Self);
}

impl<T: Send> Cut for &mut [T] {
    fn cut(self, at: usize) -> (Self, Self) {
        self.split_at_mut(at)
    }
}

impl Cut for () {
    fn cut(self, _: usize) -> (Self, Self) {
        ((), ())
    }
}

/// Several entries a particle: those of the first begin at `starts[0]`.
pub(super) struct Several<'a, T> {
    starts: &'a [u32],
    data: &'a mut [T],
}

impl<'a, T> Several<'a, T> {
    /// All of `data`, each particle's from its start to the next one's.
    pub(super) fn new(starts: &'a [u32], data: &'a mut [T]) -> Self {
        Self { starts, data }
    }

    /// Each particle's, in order.
    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut [T]> {
        let mut left = &mut *self.data;
        self.starts.windows(2).map(move |ends| {
            let (mine, rest) = std::mem::take(&mut left).split_at_mut((ends[1] - ends[0]) as usize);
            left = rest;
            mine
        })
    }
}

impl<T: Send> Cut for Several<'_, T> {
    fn cut(self, at: usize) -> (Self, Self) {
        let (data, rest) = self.data.split_at_mut((self.starts[at] - self.starts[0]) as usize);
        (Self { starts: &self.starts[..=at], data }, Self { starts: &self.starts[at..], data: rest })
    }
}

impl<A: Cut, B: Cut> Cut for (A, B) {
    fn cut(self, at: usize) -> (Self, Self) {
        let ((a, a_rest), (b, b_rest)) = (self.0.cut(at), self.1.cut(at));
        ((a, b), (a_rest, b_rest))
    }
}

impl<A: Cut, B: Cut, C: Cut> Cut for (A, B, C) {
    fn cut(self, at: usize) -> (Self, Self) {
        let ((a, a_rest), (b, b_rest), (c, c_rest)) = (self.0.cut(at), self.1.cut(at), self.2.cut(at));
        ((a, b, c), (a_rest, b_rest, c_rest))
    }
}

impl<A: Cut, B: Cut, C: Cut, D: Cut> Cut for (A, B, C, D) {
    fn cut(self, at: usize) -> (Self, Self) {
        let (((a, b), (c, d)), ((a_rest, b_rest), (c_rest, d_rest))) = ((self.0, self.1), (self.2, self.3)).cut(at);
        ((a, b, c, d), (a_rest, b_rest, c_rest, d_rest))
    }
}

impl Parts {
    /// Parts that begin at `starts`, the last of which is the end.
    pub(super) fn new(starts: Vec<usize>) -> Self {
        let wide = starts.last().is_some_and(|end| *end >= WORTH_THREADS);
        Self { starts, wide }
    }

    /// Parts of `size` items each of `len`, the last shorter; `weight` is how many particles' work an item is.
    pub(super) fn even(len: usize, size: usize, weight: usize) -> Self {
        let mut starts: Vec<usize> = (0..len).step_by(size).collect();
        starts.push(len);
        Self { starts, wide: len.saturating_mul(weight) >= WORTH_THREADS }
    }

    /// Whether threads share the work.
    pub(super) fn is_wide(&self) -> bool {
        self.wide
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The particles of one.
    pub(super) fn range(&self, part: usize) -> Range<usize> {
        self.starts[part]..self.starts[part + 1]
    }

    /// What `work` gives for each part and its share of `data`.
    pub(super) fn map<D: Cut, R: Send + Default>(&self, data: D, work: impl Fn(usize, D) -> R + Sync) -> Vec<R> {
        let mut out = Vec::with_capacity(self.len());
        out.resize_with(self.len(), R::default);
        self.go(0, data, &mut out, &work);
        out
    }

    /// The sum over all parts, in their order.
    pub(super) fn sum<D: Cut>(&self, data: D, work: impl Fn(usize, D) -> f64 + Sync) -> f64 {
        self.map(data, work).into_iter().fold(0.0, |sum, part| sum + part)
    }

    /// `work` on each part and its share of `data`.
    pub(super) fn each<D: Cut>(&self, data: D, work: impl Fn(usize, D) + Sync) {
        self.map(data, work);
    }

    fn go<D: Cut, R: Send>(&self, first: usize, data: D, out: &mut [R], work: &(impl Fn(usize, D) -> R + Sync)) {
        match out {
            [] => {}
            [one] => *one = work(first, data),
            more => {
                let half = more.len() / 2;
                let (left_out, right_out) = more.split_at_mut(half);
                let (left, right) = data.cut(self.starts[first + half] - self.starts[first]);
                let go_left = || self.go(first, left, left_out, work);
                let go_right = || self.go(first + half, right, right_out, work);
                if self.wide {
                    rayon::join(go_left, go_right);
                } else {
                    go_left();
                    go_right();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_gets_its_own_share_and_sums_run_in_order() {
        for size in [1, 7, 2000] {
            let parts = Parts::even(2000, size, 1);
            let mut data = vec![0usize; 2000];
            let sum = parts.sum(&mut data[..], |part, mine: &mut [usize]| {
                let range = parts.range(part);
                assert_eq!(range.len(), mine.len());
                range.clone().zip(mine).for_each(|(index, slot)| *slot = index);
                range.len() as f64
            });
            assert_eq!(sum, 2000.0);
            assert!(data.iter().enumerate().all(|(index, value)| index == *value));
        }
        assert_eq!(Parts::new(vec![0]).len(), 0);
    }
}
