//! The half-spaces of many curves, found in batches that the threads which use them share.

use super::half_space::HalfSpace;
use numerics::parallel;
use std::ops::Range;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Number of curves that are examined together.
pub(super) const BATCH_CURVES: usize = 64;

/// The half-spaces of curves, as far as they are known.
///
/// They are found from the second use on: on a skin that moves in each frame there is none, and they would cost more
/// than they save. Frames that use them at the same time share that work. None waits for another's, which could deadlock a
/// pool of threads: half-spaces save time and change no result.
#[derive(Debug)]
pub(super) struct KeptHalfSpaces {
    curves: usize,
    batches: Vec<Batch>,
    uses: AtomicU32,
}

#[derive(Debug, Default)]
struct Batch {
    is_claimed: AtomicBool,
    found: OnceLock<Vec<HalfSpace>>,
}

impl KeptHalfSpaces {
    /// Of this many curves, of which nothing is known yet.
    pub(super) fn of(curves: usize) -> Self {
        let batches = (0..curves.div_ceil(BATCH_CURVES)).map(|_| Batch::default()).collect();
        Self { curves, batches, uses: AtomicU32::new(0) }
    }

    /// Counts a use. From the second one on, `find` writes the half-spaces of the batches that nobody has begun; it gets the
    /// curves of a batch.
    pub(super) fn used(&self, find: impl Fn(Range<usize>, &mut [HalfSpace]) + Sync) {
        let is_first = self.uses.fetch_add(1, Ordering::Relaxed) == 0;
        if is_first || self.batches.iter().all(|batch| batch.found.get().is_some()) {
            return;
        }
        parallel::for_each(&self.batches, |n, batch| {
            if !batch.is_claimed.swap(true, Ordering::Relaxed) {
                let first = n * BATCH_CURVES;
                let curves = first..self.curves.min(first + BATCH_CURVES);
                let mut found = vec![HalfSpace::default(); curves.len()];
                find(curves, &mut found);
                let _ = batch.found.set(found);
            }
        });
    }

    /// The half-space of a curve, if it is known.
    #[inline(always)]
    pub(super) fn get(&self, curve: usize) -> Option<&HalfSpace> {
        self.batches[curve / BATCH_CURVES].found.get()?.get(curve % BATCH_CURVES)
    }

    /// Those found so far.
    #[cfg(test)]
    pub(super) fn known(&self) -> impl Iterator<Item = &HalfSpace> {
        self.batches.iter().filter_map(|batch| batch.found.get()).flatten()
    }
}
