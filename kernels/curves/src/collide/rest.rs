//! Curves at rest: how far their roots are lifted, and which cross something already.

use super::Collide;
use super::crossing::first_crossing;
use super::half_space::{HalfSpace, SAME_SIDE};
use super::root_surface::RootSurface;
use super::segment_turn::{Nearby, gather};
use numerics::parallel;
use numerics::simd::{Path, kernel};
use numerics::vector::{DVec3, Vec3, to_f32, to_f64};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// Number of successive segments that share one query of the trees.
const GATHERED_SEGMENTS: usize = 6;

/// Number of curves in a task.
const TASK_CURVES: usize = 64;

/// Everything that depends only on curves, obstacles and skin at rest, not on the wind; see [`at_rest`].
#[derive(Debug, Default)]
pub struct AtRest {
    curves: Vec<Grown>,
    /// How often it was used.
    uses: AtomicU32,
    /// Found at the second use: on a skin that moves in each frame there is none, and they would cost more than they
    /// save.
    half_spaces: OnceLock<Vec<HalfSpace>>,
}

/// A curve at rest.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Grown {
    /// Its displacement, which puts its root `offset_root` above the skin.
    pub(super) shift: DVec3,
    /// Whether it crosses something, displaced.
    pub(super) inside: bool,
    /// Whether its root is nearer to the skin than that.
    pub(super) low: bool,
    /// The skin around its root; none without `loft`.
    pub(super) around: Option<RootSurface>,
}

/// Examines curves at rest. The result depends on `obstacles`, `skin` and `offset_root` of `how`, and on whether its
/// `loft` is 0: keep it and pass it in [`Collide::at_rest`] while these and the curves do not change.
///
/// # Panics
/// As [`super::collide()`].
pub fn at_rest(starts: &[u32], rest: &[Vec3], how: &Collide<'_>) -> AtRest {
    at_rest_on(Path::chosen(), starts, rest, how)
}

pub(super) fn at_rest_on(path: Path, starts: &[u32], rest: &[Vec3], how: &Collide<'_>) -> AtRest {
    let mut curves = vec![Grown::default(); starts.len().saturating_sub(1)];
    parallel::for_each(curves.chunks_mut(TASK_CURVES), |task, grown| {
        let first = task * TASK_CURVES;
        grow(path, &starts[first..=first + grown.len()], rest, how, grown);
    });
    AtRest { curves, ..AtRest::default() }
}

kernel! {
    fn grow(starts: &[u32], rest: &[Vec3], how: &Collide<'_>, grown: &mut [Grown]) = grow_task;
}

#[inline(always)]
fn grow_task(starts: &[u32], rest: &[Vec3], how: &Collide<'_>, grown: &mut [Grown]) {
    let mut nearby = Nearby::default();
    for (ends, grown) in starts.windows(2).zip(grown) {
        let cvs = &rest[ends[0] as usize..ends[1] as usize];
        if cvs.len() < 2 || cvs.as_flattened().iter().any(|x| !x.is_finite()) {
            continue;
        }
        if let Some(skin) = &how.skin {
            let lifted = skin.lift(cvs[0], how.offset_root_at(ends[0] as usize));
            (grown.shift, grown.low) = (lifted.shift, lifted.low);
            if how.loft.value > 0.0 {
                grown.around = RootSurface::of(skin, &to_f64(cvs[0]), SAME_SIDE);
            }
        }
        grown.inside = crosses_any(cvs, &grown.shift, how, &mut nearby);
    }
}

kernel! {
    fn look_up(
        first: usize,
        starts: &[u32],
        rest: &[Vec3],
        how: &Collide<'_>,
        grown: &[Grown],
        out: &mut [HalfSpace],
    ) = look_up_task;
}

#[inline(always)]
fn look_up_task(
    first: usize,
    starts: &[u32],
    rest: &[Vec3],
    how: &Collide<'_>,
    grown: &[Grown],
    out: &mut [HalfSpace],
) {
    for (k, out) in out.iter_mut().enumerate() {
        let cvs = starts[first + k] as usize..starts[first + k + 1] as usize;
        if cvs.len() >= 2 && rest[cvs.clone()].as_flattened().iter().all(|x| x.is_finite()) {
            let width = cvs.clone().fold(0.0, |most: f32, cv| most.max(how.width.at(cv)));
            *out = HalfSpace::of(
                &rest[cvs.clone()],
                &grown[first + k].shift,
                f64::from(width),
                how.gap_at(cvs.start),
                how,
            );
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
            if first_crossing(nearby, at(k), at(k + 1)).is_some() {
                return true;
            }
        }
    }
    false
}

impl AtRest {
    /// Number of curves that cross something.
    pub(super) fn inside(&self) -> u64 {
        self.curves.iter().map(|curve| u64::from(curve.inside)).sum()
    }

    /// Counts a use, and finds half-spaces at the second one. Uses beside it get none, instead of waiting for a thread
    /// that may be waiting for them.
    pub(super) fn used(&self, path: Path, starts: &[u32], rest: &[Vec3], how: &Collide<'_>) -> &[HalfSpace] {
        if self.uses.fetch_add(1, Ordering::Relaxed) == 1 && how.skin.is_some() {
            let mut found = vec![HalfSpace::default(); self.curves.len()];
            parallel::for_each(found.chunks_mut(TASK_CURVES), |task, out| {
                look_up(path, task * TASK_CURVES, starts, rest, how, &self.curves, out);
            });
            let _ = self.half_spaces.set(found);
        }
        self.half_spaces.get().map_or(&[], Vec::as_slice)
    }

    /// Number of half-spaces found so far that may free something.
    #[cfg(test)]
    pub(super) fn half_spaces_found(&self) -> usize {
        let found = self.half_spaces.get().map_or(&[][..], Vec::as_slice);
        found.iter().filter(|found| **found != HalfSpace::default()).count()
    }

    /// Whether the root of each curve is nearer to the skin than the root offset.
    pub fn is_low(&self) -> impl ExactSizeIterator<Item = bool> {
        self.curves.iter().map(|curve| curve.low)
    }

    /// Number of roots that are nearer to the skin than the root offset.
    pub(super) fn low_roots(&self) -> u64 {
        self.curves.iter().map(|curve| u64::from(curve.low)).sum()
    }

    /// The skin around a curve's root; none where it is not known.
    pub(super) fn around(&self, curve: usize) -> Option<RootSurface> {
        self.curves[curve].around
    }

    /// The displacement of a curve.
    pub(super) fn shift(&self, curve: usize) -> DVec3 {
        self.curves[curve].shift
    }
}
