//! Curves at rest: how far their roots are lifted, and which cross something already.

use super::Collide;
use super::crossing::first_crossing;
use super::half_space::{HalfSpace, SAME_SIDE};
use super::kept_half_spaces::{BATCH_CURVES, KeptHalfSpaces};
use super::root_surface::RootSurface;
use super::segment_turn::{Nearby, gather};
use numerics::parallel;
use numerics::simd::{Path, kernel};
use numerics::vector::{DVec3, Vec3, are_finite, to_f32, to_f64};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// Number of successive segments that share one query of the trees.
const GATHERED_SEGMENTS: usize = 6;

/// Everything that depends only on curves, obstacles and skin at rest, not on the wind: on `obstacles`, `skin` and
/// `offset_root` of [`Collide`], and on whether its `loft` is 0. Keep it and pass it in [`Collide::at_rest`] while these
/// and the curves do not change.
///
/// It is found at its first use. Threads that use it at the same time share that work. None waits for another, so that a few
/// batches are examined twice; results are the same.
#[derive(Debug)]
pub struct AtRest {
    batches: Vec<Batch>,
    half_spaces: KeptHalfSpaces,
}

/// What is known of some curves.
#[derive(Debug, Default)]
struct Batch {
    is_claimed: AtomicBool,
    grown: OnceLock<Grown>,
}

/// Curves at rest.
#[derive(Debug, Default)]
struct Grown {
    /// Their displacements, which put their roots `offset_root` above the skin.
    shifts: Vec<DVec3>,
    /// The skin around their roots; empty without `loft`.
    around: Vec<Option<RootSurface>>,
    /// Whether their roots are nearer to the skin than `offset_root`.
    is_low: Vec<bool>,
    /// Number of curves that cross something, displaced.
    inside: u64,
}

impl AtRest {
    /// Of this many curves, of which nothing is known yet.
    pub fn of(curves: usize) -> Self {
        let batches = (0..curves.div_ceil(BATCH_CURVES)).map(|_| Batch::default()).collect();
        Self { batches, half_spaces: KeptHalfSpaces::of(curves) }
    }

    /// Examines the curves as far as that has not been done.
    ///
    /// # Panics
    /// If there are more curves than in [`AtRest::of`], or as [`super::collide()`].
    pub fn find(&self, starts: &[u32], rest: &[Vec3], how: &Collide<'_>) {
        self.find_on(Path::chosen(), starts, rest, how);
    }

    pub(super) fn find_on(&self, path: Path, starts: &[u32], rest: &[Vec3], how: &Collide<'_>) {
        if self.batches.iter().all(|batch| batch.grown.get().is_some()) {
            return;
        }
        let grown = |n: usize| {
            let mut grown = Grown::default();
            grow(path, ends_of(n, starts), rest, how, &mut grown);
            grown
        };
        parallel::for_each(&self.batches, |n, batch| {
            if !batch.is_claimed.swap(true, Ordering::Relaxed) {
                let _ = batch.grown.set(grown(n));
            }
        });
        // Batches that other threads have claimed and not finished: waiting for them could deadlock a pool.
        for (n, batch) in self.batches.iter().enumerate() {
            if batch.grown.get().is_none() {
                let _ = batch.grown.set(grown(n));
            }
        }
    }

    /// Counts a use, and finds half-spaces from the second one on.
    pub(super) fn used(&self, path: Path, starts: &[u32], rest: &[Vec3], how: &Collide<'_>) {
        if how.skin.is_none() {
            return;
        }
        self.half_spaces.used(|curves, found| {
            let batch = curves.start / BATCH_CURVES;
            if let Some(grown) = self.batches[batch].grown.get() {
                look_up(path, ends_of(batch, starts), rest, how, &grown.shifts, found);
            }
        });
    }

    /// What is known of a curve, and its index there.
    #[inline(always)]
    fn batch(&self, curve: usize) -> (&Batch, usize) {
        (&self.batches[curve / BATCH_CURVES], curve % BATCH_CURVES)
    }

    fn grown(&self) -> impl Iterator<Item = &Grown> {
        self.batches.iter().filter_map(|batch| batch.grown.get())
    }

    /// Number of curves that cross something.
    pub(super) fn inside(&self) -> u64 {
        self.grown().map(|grown| grown.inside).sum()
    }

    /// Number of half-spaces found so far that may free something.
    #[cfg(test)]
    pub(super) fn half_spaces_found(&self) -> usize {
        self.half_spaces.known().filter(|found| **found != HalfSpace::default()).count()
    }

    /// Whether the root of each curve is nearer to the skin than the root offset, as far as that is known.
    pub fn is_low(&self) -> impl Iterator<Item = bool> {
        self.grown().flat_map(|grown| &grown.is_low).copied()
    }

    /// Number of roots that are nearer to the skin than the root offset.
    pub(super) fn low_roots(&self) -> u64 {
        self.grown().map(|grown| grown.is_low.iter().filter(|is_low| **is_low).count() as u64).sum()
    }

    /// The skin around a curve's root; none where it is not known.
    #[inline]
    pub(super) fn around(&self, curve: usize) -> Option<RootSurface> {
        let (batch, n) = self.batch(curve);
        batch.grown.get()?.around.get(n).copied().flatten()
    }

    /// The displacement of a curve.
    #[inline]
    pub(super) fn shift(&self, curve: usize) -> DVec3 {
        let (batch, n) = self.batch(curve);
        batch.grown.get().map_or_else(DVec3::zeros, |grown| grown.shifts[n])
    }

    /// The half-space of a curve, if it is known.
    #[inline]
    pub(super) fn half_space(&self, curve: usize) -> Option<&HalfSpace> {
        self.half_spaces.get(curve)
    }
}

/// The first CVs of the curves of a batch, and the end of the last.
fn ends_of(batch: usize, starts: &[u32]) -> &[u32] {
    let first = batch * BATCH_CURVES;
    &starts[first..starts.len().min(first + BATCH_CURVES + 1)]
}

/// Examines curves at rest at once; see [`AtRest`].
///
/// # Panics
/// As [`super::collide()`].
pub fn at_rest(starts: &[u32], rest: &[Vec3], how: &Collide<'_>) -> AtRest {
    let found = AtRest::of(starts.len().saturating_sub(1));
    found.find(starts, rest, how);
    found
}

kernel! { avx512
    fn grow(ends: &[u32], rest: &[Vec3], how: &Collide<'_>, grown: &mut Grown) = grow_task;
}

#[inline(always)]
fn grow_task(ends: &[u32], rest: &[Vec3], how: &Collide<'_>, grown: &mut Grown) {
    let mut nearby = Nearby::default();
    for ends in ends.windows(2) {
        let cvs = &rest[ends[0] as usize..ends[1] as usize];
        let is_whole = cvs.len() >= 2 && are_finite(cvs);
        let (mut shift, mut is_low, mut around) = (DVec3::zeros(), false, None);
        if let Some(skin) = how.skin.as_ref().filter(|_| is_whole) {
            let lifted = skin.lift(cvs[0], how.offset_root_at(ends[0] as usize));
            (shift, is_low) = (lifted.shift, lifted.low);
            if how.loft.value > 0.0 {
                around = RootSurface::of(skin, &to_f64(cvs[0]), SAME_SIDE);
            }
        }
        grown.shifts.push(shift);
        grown.is_low.push(is_low);
        if how.loft.value > 0.0 {
            grown.around.push(around);
        }
        grown.inside += u64::from(is_whole && crosses_any(cvs, &shift, how, &mut nearby));
    }
}

kernel! { avx512
    fn look_up(
        ends: &[u32],
        rest: &[Vec3],
        how: &Collide<'_>,
        shifts: &[DVec3],
        out: &mut [HalfSpace],
    ) = look_up_task;
}

#[inline(always)]
fn look_up_task(ends: &[u32], rest: &[Vec3], how: &Collide<'_>, shifts: &[DVec3], out: &mut [HalfSpace]) {
    for (k, out) in out.iter_mut().enumerate() {
        let cvs = ends[k] as usize..ends[k + 1] as usize;
        if cvs.len() >= 2 && are_finite(&rest[cvs.clone()]) {
            let width = cvs.clone().fold(0.0, |most: f32, cv| most.max(how.width.at(cv)));
            *out = HalfSpace::of(&rest[cvs.clone()], &shifts[k], f64::from(width), how.gap_at(cvs.start), how);
        }
    }
}

/// Whether a displaced curve crosses something.
#[inline(always)]
fn crosses_any<'t>(cvs: &[Vec3], shift: &DVec3, how: &Collide<'t>, nearby: &mut Nearby<'t>) -> bool {
    let at = |k: usize| to_f32(to_f64(cvs[k]) + shift);
    for first in (0..cvs.len() - 1).step_by(GATHERED_SEGMENTS) {
        let last = (first + GATHERED_SEGMENTS).min(cvs.len() - 1);
        let mut low = at(first);
        let mut high = low;
        for k in first + 1..=last {
            let cv = at(k);
            low = [low[0].min(cv[0]), low[1].min(cv[1]), low[2].min(cv[2])];
            high = [high[0].max(cv[0]), high[1].max(cv[1]), high[2].max(cv[2])];
        }
        gather(how.obstacles, low, high, nearby);
        for k in first..last {
            if first_crossing(nearby.blocks(), at(k), at(k + 1)).is_some() {
                return true;
            }
        }
    }
    false
}
