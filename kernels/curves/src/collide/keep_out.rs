//! Curves that were moved without regard to the skin, kept out of it: the kernel of Curve_Deform's `keep_out`.
//!
//! Most curves that follow collided guides do not cross the skin. One that stays above everything near its root (see
//! [`half_space`](super::half_space)) needs no query of the tree, and of the others segments that do so need none. Those
//! that cross the skin are blended with their rest shape, segment by segment by the same share, as little as leaves them
//! free: a curve that only just enters the skin moves by little, so that none jumps as it touches it.
//!
//! A curve whose root has been lifted off the skin starts from its rest shape lifted as far. One whose rest shape crosses the
//! skin is lifted until its root is outside by the gap; if it still crosses, it is turned out of the skin as far as
//! possible, as in [`super::collide()`], and back towards its goal. Of a curve that is
//! not lifted the start, which touches the skin, is not tested. Surfaces are obstacles, not volumes: a curve wholly inside
//! stays there.

use super::crossing::crosses_some;
use super::hair::SKIPPED_GAPS;
use super::half_space::HalfSpace;
use super::kept_half_spaces::{BATCH_CURVES, KeptHalfSpaces};
use super::segment_turn::{Nearby, gather};
use super::{Collide, ContactMethod, SkinSurface, collide};
use crate::attach::{RootPose, attach_curve, relative_stretch};
use clear_lanes::{ClearBounds, ClearLanes, segment_bit};
use numerics::lanes::{F32x16, LANES, set};
use numerics::masked::Masked;
use numerics::parallel;
use numerics::simd::{Path, kernel};
use numerics::tree::{Cuboid, Region, TriangleTree};
use numerics::vector::{self, DVec3, Vec3, are_finite, to_f32, to_f64};
use settle::{Entered, settle};
use std::ops::Range;
use std::sync::OnceLock;

mod clear_lanes;
mod settle;

/// Number of curves in a task.
const TASK_CURVES: usize = 256;

/// Number of curves that enter the skin in a task.
const SETTLED_CURVES: usize = 32;

/// Height of a root, in gaps, from which on its curve is tested from its root on: from a height h a segment turns by an arc
/// of π/2·h before it meets a plane, which is more than the gap.
const LIFTED: f64 = 0.7;

/// Number of successive segments that share one query of the tree.
const GATHERED_SEGMENTS: usize = 6;

/// The skin that curves are kept out of, and their shapes at rest.
#[derive(Clone, Copy)]
pub struct KeepOut<'a> {
    /// The skin.
    pub skin: SkinSurface<'a>,
    /// The curves at rest.
    pub rest: &'a [Vec3],
    /// How the skin has moved and turned each root since rest; `None` if it has not.
    pub poses: Option<&'a [RootPose]>,
    /// Arc length kept from contacts, metres. The first five of a curve whose root is not lifted are not tested.
    pub gap: f64,
    /// What is known of these curves on this skin.
    pub clearance: &'a Clearance,
}

/// Where curves meet nothing. Keep it while skin, rest shapes, poses and gap do not change: it is found from the second
/// use on, because on a skin that moves in each frame it would cost more than it saves. Threads that use it at the same time
/// share that work.
#[derive(Debug)]
pub struct Clearance {
    half_spaces: KeptHalfSpaces,
    /// Of the curves of each of its batches, sixteen at a time.
    bounds: Vec<OnceLock<Vec<ClearBounds>>>,
}

/// What [`keep_out`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[must_use]
pub struct KeptOut {
    /// Curves that had entered the skin.
    pub kept_out: u64,
    /// Curves among them that cross the skin at rest, even with their roots lifted.
    pub started_inside: u64,
    /// Segments of the curves kept out that still cross the skin.
    pub crossings_left: u64,
    /// Largest change of a segment's length ÷ curve length among the curves kept out.
    pub length_error: f64,
}

/// Replaces each of the curves `points[starts[i]..starts[i + 1]]` that crosses the skin by one that turned towards it
/// from rest until it met the skin. Of each curve `may_meet` has a bit for each segment that may do so, the last for all
/// further ones too; the others are known to be clear (see [`KeepOut::prepare`]) and not tested. Empty if that has not been
/// found out.
///
/// # Panics
/// If `starts` does not run up to the number of points, of `points` and of the rest shapes, or if there are more curves than
/// in [`Clearance::of`] or `may_meet`.
pub fn keep_out(starts: &[u32], points: &mut [Vec3], how: &KeepOut<'_>, may_meet: &[u32]) -> KeptOut {
    keep_out_on(Path::chosen(), starts, points, how, may_meet)
}

/// [`keep_out`] on a given SIMD path.
pub(super) fn keep_out_on(
    path: Path,
    starts: &[u32],
    points: &mut [Vec3],
    how: &KeepOut<'_>,
    may_meet: &[u32],
) -> KeptOut {
    let curves = starts.len().saturating_sub(1);
    let half_spaces = &how.clearance.half_spaces;
    let tasks = (0..curves).step_by(TASK_CURVES).map(|first| first..curves.min(first + TASK_CURVES));
    let entered = parallel::map(tasks, |_, curves| {
        let mut found = Vec::new();
        let may_meet = match may_meet {
            [] => {
                find_segments(path, curves.clone(), starts, points, how, &mut found);
                &found[..]
            }
            known => &known[curves.clone()],
        };
        entering(path, curves, starts, points, how, may_meet)
    });
    let entered = parallel::concat(entered);
    let mut kept =
        KeptOut { started_inside: entered.iter().map(|one| u64::from(one.at_rest)).sum(), ..KeptOut::default() };
    for (lifted, at_rest) in [(false, false), (true, false), (true, true)] {
        let alike = |one: &&Entering| (one.lifted, one.at_rest) == (lifted, at_rest);
        let curves: Vec<Entering> = entered.iter().filter(alike).copied().collect();
        if !curves.is_empty() {
            turn_out(path, starts, points, how, &curves, half_spaces, &mut kept);
        }
    }
    kept
}

/// A curve that crosses the skin.
#[derive(Clone, Copy)]
struct Entering {
    curve: u32,
    /// Whether it does so at rest.
    at_rest: bool,
    /// Whether its root is off the skin.
    lifted: bool,
    /// What lifts it.
    shift: DVec3,
}

/// The start of a curve.
#[derive(Clone, Copy)]
struct Beginning {
    /// On the skin.
    root: DVec3,
    /// Whether the curve is off it.
    lifted: bool,
    /// Where the tested part starts, at rest and now; see [`tested_start`].
    tested: [Option<Vec3>; 2],
}

/// Moves CVs; without a shift they keep their bits.
fn shifted(cvs: &mut [Vec3], shift: &DVec3) {
    if *shift != DVec3::zeros() {
        cvs.iter_mut().for_each(|cv| *cv = to_f32(to_f64(*cv) + shift));
    }
}

/// Turns curves, all or none of them lifted and crossing the skin at rest, out of the skin.
fn turn_out(
    path: Path,
    starts: &[u32],
    points: &mut [Vec3],
    how: &KeepOut<'_>,
    curves: &[Entering],
    half_spaces: &KeptHalfSpaces,
    kept: &mut KeptOut,
) {
    let Entering { lifted, at_rest, .. } = curves[0];
    let range = |one: &Entering| starts[one.curve as usize] as usize..starts[one.curve as usize + 1] as usize;
    let (mut own, mut goal, mut rest) = (vec![0], Vec::new(), Vec::new());
    for one in curves {
        let (cvs, first) = (range(one), goal.len());
        goal.extend_from_slice(&points[cvs.clone()]);
        shifted(&mut goal[first..], &one.shift);
        rest.resize(goal.len(), [0.0; 3]);
        how.write_rest(one.curve as usize, cvs, goal[first], &mut rest[first..]);
        own.push(goal.len() as u32);
    }
    // Where the rest shape is free, it is where a curve turns to.
    let obstacles = [how.skin.tree];
    let collided = at_rest.then(|| collide(&own, &rest, &goal, &how.collision(&obstacles, lifted)));
    let found = Entered {
        starts: &own,
        rest: &rest,
        goal: &goal,
        free: collided.as_ref().map_or(&rest, |collided| &collided.points),
        crossings: collided.as_ref().map_or(&[], |collided| &collided.crossings),
        untested: how.untested(lifted),
    };
    let tasks = (0..curves.len()).step_by(SETTLED_CURVES).map(|first| first..curves.len().min(first + SETTLED_CURVES));
    let known = |one: &Entering| {
        let curve = one.curve as usize;
        half_spaces.get(curve).map(|known| (known, how.root(curve, starts[curve] as usize)))
    };
    let known: Vec<Option<(&HalfSpace, DVec3)>> = curves.iter().map(known).collect();
    let settled = parallel::map(tasks, |_, curves| settle(path, curves, &found, &known, how.skin.tree));
    let settled = parallel::concat(settled);
    for (one, ends) in curves.iter().zip(own.windows(2)) {
        let (mine, now) = (ends[0] as usize..ends[1] as usize, range(one));
        kept.kept_out += u64::from(settled[mine.clone()] != points[now.clone()]);
        kept.length_error = kept.length_error.max(relative_stretch(&settled[mine.clone()], &goal[mine.clone()]));
        points[now].copy_from_slice(&settled[mine]);
    }
    kept.crossings_left += collided.map_or(0, |collided| collided.crossings_left);
}

impl KeepOut<'_> {
    /// Counts a use of the clearance, and finds out from the second one on where these curves meet nothing.
    ///
    /// # Panics
    /// As [`keep_out`].
    pub fn prepare(&self, starts: &[u32]) {
        let Clearance { half_spaces, bounds } = self.clearance;
        half_spaces.used(|curves, found| {
            look_up(Path::chosen(), curves.clone(), starts, self, found);
            let sixteens = curves.clone().step_by(LANES).zip(found.chunks(LANES));
            let of_batch = sixteens.map(|(first, found)| self.bounds(first, starts, found)).collect();
            let _ = bounds[curves.start / BATCH_CURVES].set(of_batch);
        });
    }

    /// The bounds of the curves from `first` on, which have these half-spaces.
    fn bounds(&self, first: usize, starts: &[u32], half_spaces: &[HalfSpace]) -> ClearBounds {
        let mut root = [F32x16::splat(0.0); 3];
        for lane in 0..half_spaces.len() {
            let cvs = starts[first + lane]..starts[first + lane + 1];
            if !cvs.is_empty() {
                set(&mut root, lane, to_f32(self.root(first + lane, cvs.start as usize)));
            }
        }
        ClearBounds::of(root, half_spaces, self.gap)
    }

    /// Sixteen curves or what is left of all from `first`, a multiple of sixteen, on, to find out which of them are clear;
    /// `None` if nothing is known of them.
    #[inline(always)]
    pub(crate) fn lanes(&self, first: usize) -> Option<ClearLanes<'_>> {
        let bounds = self.clearance.bounds[first / BATCH_CURVES].get()?.get(first % BATCH_CURVES / LANES)?;
        Some(ClearLanes::of(bounds, self.gap))
    }

    /// Whether a curve's root, `now`, is off the skin, on which `root` is.
    #[inline(always)]
    fn is_lifted(&self, now: Vec3, root: &DVec3) -> bool {
        (to_f64(now) - root).norm() >= LIFTED * self.gap
    }

    /// Length at the start of a curve that is not tested.
    fn untested(&self, lifted: bool) -> f64 {
        if lifted { 0.0 } else { SKIPPED_GAPS * self.gap }
    }

    /// The root of a curve's rest shape, its CV `cv`, on the skin as it is now.
    #[inline(always)]
    fn root(&self, curve: usize, cv: usize) -> DVec3 {
        let moved = self.poses.map_or(DVec3::zeros(), |poses| poses[curve].translation);
        to_f64(to_f32(to_f64(self.rest[cv]) + moved))
    }

    /// The rest shape of a curve on the skin as it is now, moved so that it starts at `root`.
    fn write_rest(&self, curve: usize, cvs: Range<usize>, root: Vec3, out: &mut [Vec3]) {
        match self.poses {
            Some(poses) => attach_curve(&poses[curve], &self.rest[cvs], out),
            None => out.copy_from_slice(&self.rest[cvs]),
        }
        let moved = to_f64(root) - to_f64(out[0]);
        shifted(out, &moved);
    }

    /// The start of a curve whose first CV is `cv`, and whose first two are now at `now`.
    fn beginning(&self, curve: usize, cv: usize, now: [Vec3; 2]) -> Beginning {
        let root = self.root(curve, cv);
        let lifted = self.is_lifted(now[0], &root);
        let untested = self.untested(lifted);
        let mut rest = [[0.0; 3]; 2];
        self.write_rest(curve, cv..cv + 2, now[0], &mut rest);
        let tested = [tested_start(&rest, untested), tested_start(&now, untested)];
        Beginning { root, lifted, tested }
    }

    fn collision<'o>(&self, obstacles: &'o [&'o TriangleTree], lifted: bool) -> Collide<'o>
    where
        Self: 'o,
    {
        Collide {
            obstacles,
            skin: None,
            method: ContactMethod::Exact,
            coherence: 0.0.into(),
            gap: self.gap.into(),
            // Lifts nothing without a skin; it says whether the start of a curve is tested.
            offset_root: if lifted { self.gap } else { 0.0 }.into(),
            offset_scale: None,
            loft: 0.0.into(),
            at_rest: None,
            blend: Masked::uniform(1.0),
            width: Masked::uniform(0.0),
        }
    }
}

impl Clearance {
    /// Of this many curves, of which nothing is known yet.
    pub fn of(curves: usize) -> Self {
        let bounds = (0..curves.div_ceil(BATCH_CURVES)).map(|_| OnceLock::new()).collect();
        Self { half_spaces: KeptHalfSpaces::of(curves), bounds }
    }
}

kernel! { avx512
    fn look_up(curves: Range<usize>, starts: &[u32], how: &KeepOut<'_>, out: &mut [HalfSpace]) = look_up_task;
}

#[inline(always)]
fn look_up_task(curves: Range<usize>, starts: &[u32], how: &KeepOut<'_>, out: &mut [HalfSpace]) {
    let obstacles = [how.skin.tree];
    let collision = Collide { skin: Some(how.skin), ..how.collision(&obstacles, false) };
    let mut rest = Vec::new();
    for (curve, out) in curves.zip(out) {
        let cvs = starts[curve] as usize..starts[curve + 1] as usize;
        rest.resize(cvs.len(), [0.0; 3]);
        let root = to_f32(how.root(curve, cvs.start));
        how.write_rest(curve, cvs, root, &mut rest);
        if rest.len() >= 2 && are_finite(&rest) {
            *out = HalfSpace::of(&rest, &DVec3::zeros(), 0.0, how.gap, &collision);
        }
    }
}

kernel! { avx512
    /// Adds to `may_meet` the segments of each of `curves` that leave its half-space, as a bit each.
    fn find_segments(
        curves: Range<usize>,
        starts: &[u32],
        points: &[Vec3],
        how: &KeepOut<'_>,
        may_meet: &mut Vec<u32>,
    ) = find_segments_task;
}

#[inline(always)]
fn find_segments_task(
    curves: Range<usize>,
    starts: &[u32],
    points: &[Vec3],
    how: &KeepOut<'_>,
    may_meet: &mut Vec<u32>,
) {
    for first in curves.clone().step_by(LANES) {
        let hairs = LANES.min(curves.end - first);
        let Some(mut lanes) = how.lanes(first) else {
            may_meet.resize(may_meet.len() + hairs, u32::MAX);
            continue;
        };
        let mut cvs = [0; LANES];
        let (mut cv, mut most) = ([F32x16::splat(0.0); 3], 0);
        for lane in 0..hairs {
            let start = starts[first + lane] as usize;
            cvs[lane] = starts[first + lane + 1] as usize - start;
            most = most.max(cvs[lane]);
            if cvs[lane] > 0 {
                set(&mut cv, lane, points[start]);
            }
        }
        for k in 1..most {
            let before = cv;
            for lane in 0..hairs {
                if k < cvs[lane] {
                    set(&mut cv, lane, points[starts[first + lane] as usize + k]);
                }
            }
            lanes.add(k, &before, &cv);
        }
        let mask = lanes.mask();
        for lane in 0..hairs {
            may_meet.push(if mask >> lane & 1 == 1 { 0 } else { lanes.segments_below(lane, cvs[lane]) });
        }
    }
}

kernel! { avx512
    /// Those of `curves` that cross the skin, and whether they do at rest; segments without a bit do not.
    fn entering(
        curves: Range<usize>,
        starts: &[u32],
        points: &[Vec3],
        how: &KeepOut<'_>,
        may_meet: &[u32],
    ) -> Vec<Entering> = entering_task;
}

#[inline(always)]
fn entering_task(
    curves: Range<usize>,
    starts: &[u32],
    points: &[Vec3],
    how: &KeepOut<'_>,
    may_meet: &[u32],
) -> Vec<Entering> {
    let (mut entered, mut rest) = (Vec::new(), Vec::new());
    let mut nearby = Nearby::default();
    for (curve, may_meet) in curves.zip(may_meet) {
        let cvs = starts[curve] as usize..starts[curve + 1] as usize;
        let now = &points[cvs.clone()];
        if *may_meet == 0 || now.len() < 2 || !are_finite(now) {
            continue;
        }
        let (first, tree) = ([now[0], now[1]], how.skin.tree);
        // Of no use where the first segment is not tested, and what it is made of would have to be fetched.
        let mut beginning = None;
        if may_meet & 1 == 1 {
            beginning = Some(how.beginning(curve, cvs.start, first));
        }
        let starts = beginning.as_ref().map_or([None; 2], |beginning| beginning.tested);
        if crosses(now, starts, tree, &Tested::Segments(*may_meet), &mut nearby) {
            let known = beginning.unwrap_or_else(|| how.beginning(curve, cvs.start, first));
            let Beginning { root, lifted, tested: [outside, _] } = known;
            let mut one = Entering { curve: curve as u32, at_rest: false, lifted, shift: DVec3::zeros() };
            let tested = Tested::Outside(how.clearance.half_spaces.get(curve).zip(Some(root)));
            rest.resize(now.len(), [0.0; 3]);
            how.write_rest(curve, cvs, now[0], &mut rest);
            if crosses(&rest, [outside; 2], tree, &tested, &mut nearby) {
                (one.lifted, one.shift) = (true, how.skin.lift(now[0], how.gap).shift);
                shifted(&mut rest, &one.shift);
                one.at_rest = crosses(&rest, [Some(rest[0]); 2], tree, &tested, &mut nearby);
            }
            entered.push(one);
        }
    }
    entered
}

/// Rounding of positions up to this size and length.
#[inline(always)]
fn rounding_of(a: Vec3, b: Vec3) -> f64 {
    5e-7 * f64::from(vector::largest(a).max(vector::largest(b)))
}

/// Whether a segment of a curve with this root is in its half-space.
#[inline(always)]
fn is_free((half_space, root): &(&HalfSpace, DVec3), a: Vec3, b: Vec3) -> bool {
    half_space.clears(root, [&to_f64(a), &to_f64(b)], rounding_of(a, b))
}

/// Where the tested part of a curve starts; `None` if its first segment is not tested.
#[inline(always)]
fn tested_start(cvs: &[Vec3], untested: f64) -> Option<Vec3> {
    let along = to_f64(cvs[1]) - to_f64(cvs[0]);
    let length = along.norm();
    (length > untested).then(|| to_f32(to_f64(cvs[0]) + along * (untested / length)))
}

/// A segment, or what the start of a curve has passed through, with the box around it.
#[derive(Clone, Copy)]
struct Piece {
    from: Vec3,
    to: Vec3,
    around: Cuboid,
}

impl Piece {
    const NONE: Self = Self { from: [0.0; 3], to: [0.0; 3], around: Cuboid { low: [0.0; 3], high: [0.0; 3] } };

    #[inline(always)]
    fn between(from: Vec3, to: Vec3) -> Self {
        let mut around = Cuboid { low: from, high: from };
        for axis in 0..3 {
            around.low[axis] = around.low[axis].min(to[axis]);
            around.high[axis] = around.high[axis].max(to[axis]);
        }
        Self { from, to, around }
    }
}

/// The segments of a curve that are tested.
enum Tested<'a> {
    /// Those with a bit; see [`keep_out`].
    Segments(u32),
    /// Those that are not in the half-space of the curve, which has this root.
    Outside(Option<(&'a HalfSpace, DVec3)>),
}

impl Tested<'_> {
    /// Whether segment `k`, of which the part from `a` to `b` counts, is none of them.
    #[inline(always)]
    fn leaves_out(&self, k: usize, a: Vec3, b: Vec3) -> bool {
        match self {
            Self::Segments(bits) => bits >> segment_bit(k) & 1 == 0,
            Self::Outside(known) => known.as_ref().is_some_and(|known| is_free(known, a, b)),
        }
    }
}

/// Whether a curve, whose tested part starts at `start`, crosses the skin. So does one whose start has passed through it
/// since rest, when it was at `outside`.
#[inline(always)]
fn crosses<'t>(
    cvs: &[Vec3],
    [outside, start]: [Option<Vec3>; 2],
    tree: &'t TriangleTree,
    which: &Tested<'_>,
    nearby: &mut Nearby<'t>,
) -> bool {
    let last = cvs.len() - 1;
    for first in (0..last).step_by(GATHERED_SEGMENTS) {
        let (mut pieces, mut count) = ([Piece::NONE; GATHERED_SEGMENTS + 1], 0);
        for k in first..last.min(first + GATHERED_SEGMENTS) {
            let Some(from) = (if k == 0 { start } else { Some(cvs[k]) }) else { continue };
            if which.leaves_out(k, from, cvs[k + 1]) {
                continue;
            }
            pieces[count] = Piece::between(from, cvs[k + 1]);
            count += 1;
            if k == 0
                && let Some(outside) = outside.filter(|outside| *outside != from)
            {
                pieces[count] = Piece::between(outside, from);
                count += 1;
            }
        }
        let pieces = &pieces[..count];
        let Some(Piece { around: Cuboid { mut low, mut high }, .. }) = pieces.first().copied() else { continue };
        for Piece { around, .. } in &pieces[1..] {
            for axis in 0..3 {
                low[axis] = low[axis].min(around.low[axis]);
                high[axis] = high[axis].max(around.high[axis]);
            }
        }
        gather(&[tree], low, high, nearby);
        for (block, lanes) in nearby.iter() {
            // All boxes before the first triangle, without branches.
            let (boxes, mut meeting, mut any) = (block.boxes(), [0; GATHERED_SEGMENTS + 1], 0);
            for (meeting, piece) in meeting.iter_mut().zip(pieces) {
                *meeting = lanes & piece.around.meeting(&boxes);
                any |= *meeting;
            }
            if any == 0 {
                continue;
            }
            for (lanes, piece) in meeting.into_iter().zip(pieces) {
                if lanes != 0 && crosses_some(block, lanes, piece.from, piece.to) {
                    return true;
                }
            }
        }
    }
    false
}

#[cfg(test)]
mod tests;
