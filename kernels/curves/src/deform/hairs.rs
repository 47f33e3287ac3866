//! Hairs turned as their guides are.

use super::hair_guides::HairGuides;
use super::hair_lanes::{HairLanes, Scratch};
use super::turns::GuideTurns;
use crate::attach::RootPose;
use crate::collide::KeepOut;
use numerics::lanes::LANES;
use numerics::masked::Masked;
use numerics::parallel;
use numerics::simd::{Path, kernel};
use numerics::vector::{DQuat, Vec3};
use std::ops::Range;

/// What a groom follows.
#[derive(Clone, Copy)]
pub struct CurveDeform<'a> {
    /// The guides of each hair.
    pub guides: &'a HairGuides,
    /// How the guides have turned.
    pub turns: &'a GuideTurns,
    /// How the hairs' roots have moved and turned; `None` if they have not.
    pub poses: Option<&'a [RootPose]>,
    /// Fraction of the guides' turn that hairs follow, 0..1; a mask has one value for each CV.
    pub blend: Masked<'a, f32>,
    /// What the results are kept out of afterwards, prepared: as they are written, those are found that it need not test.
    pub keep_out: Option<&'a KeepOut<'a>>,
}

/// Hairs that followed guides.
#[must_use]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeformedCurves {
    /// One point for each input point, metres.
    pub points: Vec<Vec3>,
    /// The rotation of each CV, that of the segment after it; empty if not asked for.
    pub rotations: Vec<DQuat>,
    /// Of each curve the segments that may meet what it is to be kept out of, as [`crate::collide::keep_out()`] takes them;
    /// empty if that is not given.
    pub may_meet: Vec<u32>,
    /// Largest change of a segment's length ÷ its curve's length, measured on the results.
    pub length_error: f64,
}

/// Deforms the curves of `how.guides`, whose CVs are the rows `starts[i]..starts[i + 1]`, with the rotation of each CV if
/// `with_rotations`.
///
/// # Panics
/// If `starts` is that of other curves, or a slice of `how` is shorter than its rows.
pub fn deform_curves(starts: &[u32], how: &CurveDeform<'_>, with_rotations: bool) -> DeformedCurves {
    deform_curves_on(Path::chosen(), starts, how, with_rotations)
}

/// [`deform_curves`] on a given SIMD path.
pub(super) fn deform_curves_on(
    path: Path,
    starts: &[u32],
    how: &CurveDeform<'_>,
    with_rotations: bool,
) -> DeformedCurves {
    let mut points = vec![[0.0; 3]; starts.last().map_or(0, |end| *end as usize)];
    let done = parallel::map(tasks(starts, &mut points), |_, (curves, out)| {
        follow(path, curves, starts, how, out, with_rotations)
    });
    let mut all = DeformedCurves::default();
    for mut one in done {
        all.length_error = all.length_error.max(one.length_error);
        all.rotations.append(&mut one.rotations);
        all.may_meet.append(&mut one.may_meet);
    }
    DeformedCurves { points, ..all }
}

/// CVs in a task: some 50 µs of work.
const TASK: usize = 2048;

/// The hairs of each task, in sixteens, and the rows of their CVs.
fn tasks<'a>(starts: &[u32], mut out: &'a mut [Vec3]) -> Vec<(Range<usize>, &'a mut [Vec3])> {
    let hairs = starts.len().saturating_sub(1);
    let (mut tasks, mut first) = (Vec::new(), 0);
    while first < hairs {
        let mut end = hairs.min(first + LANES);
        while end < hairs && ((starts[end] - starts[first]) as usize) < TASK {
            end = hairs.min(end + LANES);
        }
        let (mine, after) = out.split_at_mut((starts[end] - starts[first]) as usize);
        tasks.push((first..end, mine));
        (out, first) = (after, end);
    }
    tasks
}

kernel! { avx512
    /// Deforms `curves` into `out`; returns all but the points, and rotations if they are wanted.
    fn follow(
        curves: Range<usize>,
        starts: &[u32],
        how: &CurveDeform<'_>,
        out: &mut [Vec3],
        with_rotations: bool,
    ) -> DeformedCurves = follow_task;
}

#[inline(always)]
fn follow_task(
    curves: Range<usize>,
    starts: &[u32],
    how: &CurveDeform<'_>,
    out: &mut [Vec3],
    with_rotations: bool,
) -> DeformedCurves {
    let base = starts[curves.start] as usize;
    let (mut done, mut scratch) = (DeformedCurves::default(), Scratch::default());
    if with_rotations {
        // Of CVs that start no segment and end none.
        for curve in curves.clone() {
            let rotation = how.poses.map_or_else(DQuat::identity, |poses| poses[curve].rotation);
            done.rotations.resize(starts[curve + 1] as usize - base, rotation);
        }
    }
    let mut first = curves.start;
    while first < curves.end {
        let end = if curves.end - first > LANES { first + LANES } else { curves.end };
        let hairs = HairLanes::of(first..end, starts, how);
        hairs.follow(&mut scratch, base, out, &mut done);
        first = end;
    }
    done
}
