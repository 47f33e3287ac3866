//! Curves that enter the skin, blended with a shape in which they are free.

use super::super::crossing::add_crossings;
use super::super::half_space::HalfSpace;
use super::super::perpendicular;
use super::super::segment_turn::{Nearby, gather};
use super::{is_free, rounding_of, tested_start};
use numerics::lanes::{LANES, get, set};
use numerics::simd::kernel;
use numerics::tree::{Block, TriangleTree};
use numerics::vector::{DVec3, Vec3, to_f32, to_f64};
use std::ops::Range;

/// Halvings of the turn between a curve's goal and where it is free.
const HALVINGS: usize = 7;

/// Curves that entered the skin.
#[derive(Clone, Copy)]
pub(super) struct Entered<'a> {
    pub(super) starts: &'a [u32],
    pub(super) rest: &'a [Vec3],
    pub(super) goal: &'a [Vec3],
    /// Where they are free, and the number of segments that cross the skin even there; none if that is known.
    pub(super) free: &'a [Vec3],
    pub(super) crossings: &'a [i32],
    /// Length at the start of each that is not tested.
    pub(super) untested: f64,
}

kernel! {
    /// The shapes of `curves`, as near to their goals as they stay free; `known` is a half-space of each and its root.
    pub(super) fn settle(
        curves: Range<usize>,
        entered: &Entered<'_>,
        known: &[Option<(&HalfSpace, DVec3)>],
        skin: &TriangleTree,
    ) -> Vec<Vec3> = settle_task;
}

#[inline(always)]
fn settle_task(
    curves: Range<usize>,
    entered: &Entered<'_>,
    known: &[Option<(&HalfSpace, DVec3)>],
    skin: &TriangleTree,
) -> Vec<Vec3> {
    let mut out = entered.free[entered.starts[curves.start] as usize..entered.starts[curves.end] as usize].to_vec();
    let (base, untested) = (entered.starts[curves.start] as usize, entered.untested);
    let (mut nearby, mut faces) = (Nearby::default(), Faces::default());
    let (mut pose, mut turns) = (Vec::new(), Vec::new());
    for curve in curves {
        let cvs = entered.starts[curve] as usize..entered.starts[curve + 1] as usize;
        let [rest, goal, free] = [entered.rest, entered.goal, entered.free].map(|points| &points[cvs.clone()]);
        // Of a curve that could not be freed no pose is better.
        if !entered.crossings.is_empty() && entered.crossings[curve] > 0 {
            continue;
        }
        // No closures here: they are not compiled for the kernel's path.
        let outside = tested_start(rest, untested);
        turns_between(goal, free, &mut turns);
        let (low, high) = bounds(goal[0], &turns, outside);
        gather(&[skin], low, high, &mut nearby);
        faces.pack(&nearby);
        let (mut crossing, mut clear, mut suspect) = (0.0, 1.0, 0);
        for _ in 0..HALVINGS {
            let share = 0.5 * (crossing + clear);
            pose_at(goal[0], &turns, share, &mut pose);
            let ends = [outside, tested_start(&pose, untested)];
            if faces.crossed(&pose, ends, known[curve].as_ref(), &mut suspect) {
                crossing = share;
            } else {
                clear = share;
                out[cvs.start - base..cvs.end - base].copy_from_slice(&pose);
            }
        }
    }
    out
}

/// Faces near a curve in all its poses: blocks of those alone, with their boxes.
#[derive(Default)]
struct Faces {
    blocks: Vec<Block>,
    boxes: Vec<(Vec3, Vec3)>,
    /// Number of faces.
    count: usize,
}

impl Faces {
    #[inline(always)]
    fn pack(&mut self, nearby: &Nearby<'_>) {
        self.count = 0;
        self.boxes.clear();
        for (block, lanes) in nearby {
            let mut lanes = *lanes;
            while lanes != 0 {
                let from = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                let (to, lane) = (self.count / LANES, self.count % LANES);
                self.count += 1;
                if to == self.blocks.len() {
                    self.blocks.push(Block { corners: block.corners, triangle: block.triangle });
                }
                if lane == 0 {
                    self.boxes.push(([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]));
                }
                self.blocks[to].triangle[lane] = block.triangle[from];
                let (low, high) = &mut self.boxes[to];
                for corner in 0..3 {
                    let at = get(&block.corners[corner], from);
                    set(&mut self.blocks[to].corners[corner], lane, at);
                    for axis in 0..3 {
                        low[axis] = low[axis].min(at[axis]);
                        high[axis] = high[axis].max(at[axis]);
                    }
                }
            }
        }
    }

    /// As [`super::crosses`]. `suspect` is the segment that crossed last: it is tested first.
    #[inline(always)]
    fn crossed(
        &self,
        cvs: &[Vec3],
        [outside, start]: [Option<Vec3>; 2],
        known: Option<&(&HalfSpace, DVec3)>,
        suspect: &mut usize,
    ) -> bool {
        let last = cvs.len() - 1;
        for turn in 0..=last {
            // The suspect once more is cheaper than to leave it out.
            let k = if turn == 0 { *suspect } else { turn - 1 };
            let Some(from) = (if k == 0 { start } else { Some(cvs[k]) }) else { continue };
            if let Some(known) = known
                && is_free(known, from, cvs[k + 1])
            {
                continue;
            }
            if self.meets(from, cvs[k + 1]) {
                *suspect = k;
                return true;
            }
            if k == 0
                && let Some(outside) = outside
                && outside != from
                && self.meets(outside, from)
            {
                *suspect = 0;
                return true;
            }
        }
        false
    }

    /// Whether one of them crosses the segment from `a` to `b`.
    #[inline(always)]
    fn meets(&self, a: Vec3, b: Vec3) -> bool {
        let (mut left, mut first) = (self.count, None);
        for (block, (low, high)) in self.blocks.iter().zip(&self.boxes) {
            let lanes = if left >= LANES { u16::MAX } else { (1 << left) - 1 };
            left -= LANES.min(left);
            let mut meets = true;
            for axis in 0..3 {
                meets &= a[axis].min(b[axis]) <= high[axis] && a[axis].max(b[axis]) >= low[axis];
            }
            if meets {
                add_crossings(block, lanes, a, b, &mut first);
                if first.is_some() {
                    return true;
                }
            }
        }
        false
    }
}

/// Bounds of a curve from `root` in all poses of its turns, and of `outside`.
#[inline(always)]
fn bounds(root: Vec3, turns: &[SegmentTurn], outside: Option<Vec3>) -> (Vec3, Vec3) {
    let (mut low, mut high) = (to_f64(root), to_f64(root));
    let (mut all_low, mut all_high) = (low, high);
    for turn in turns {
        let (sine, cosine) = libm::sincos(turn.angle);
        let to = turn.from * cosine + turn.side * sine;
        // The arc is at most this far from its chord.
        let bulge = 1.0 - libm::cos(0.5 * turn.angle);
        for axis in 0..3 {
            low[axis] += turn.length * (turn.from[axis].min(to[axis]) - bulge);
            high[axis] += turn.length * (turn.from[axis].max(to[axis]) + bulge);
            all_low[axis] = all_low[axis].min(low[axis]);
            all_high[axis] = all_high[axis].max(high[axis]);
        }
    }
    if let Some(outside) = outside {
        (all_low, all_high) = (all_low.inf(&to_f64(outside)), all_high.sup(&to_f64(outside)));
    }
    // Positions are rounded, those of a pose one after the other.
    let slack = turns.len() as f64 * rounding_of(to_f32(all_low), to_f32(all_high));
    (to_f32(all_low.map(|x| x - slack)), to_f32(all_high.map(|x| x + slack)))
}

/// The turn of a segment in its plane.
struct SegmentTurn {
    /// Its direction, and the one a right angle on.
    from: DVec3,
    side: DVec3,
    /// Radians.
    angle: f64,
    /// Metres.
    length: f64,
}

/// The turns of segments from those of `from` to those of `to`, which keep the lengths of `from`.
#[inline(always)]
fn turns_between(from: &[Vec3], to: &[Vec3], turns: &mut Vec<SegmentTurn>) {
    turns.clear();
    for k in 0..from.len() - 1 {
        let [along, towards] = [from, to].map(|cvs| to_f64(cvs[k + 1]) - to_f64(cvs[k]));
        let (length, other) = (along.norm(), towards.norm());
        if length == 0.0 || other == 0.0 {
            turns.push(SegmentTurn { from: along, side: DVec3::zeros(), angle: 0.0, length: 1.0 });
            continue;
        }
        let (from, to) = (along / length, towards / other);
        let axis = from.cross(&to);
        let sine = axis.norm();
        let axis = if sine > 1e-9 { axis / sine } else { perpendicular(&from, &DVec3::zeros()) };
        turns.push(SegmentTurn { from, side: axis.cross(&from), angle: libm::atan2(sine, from.dot(&to)), length });
    }
}

/// The curve from `root` whose segments have turned by this share.
#[inline(always)]
fn pose_at(root: Vec3, turns: &[SegmentTurn], share: f64, pose: &mut Vec<Vec3>) {
    pose.clear();
    pose.push(root);
    for (k, turn) in turns.iter().enumerate() {
        let (sine, cosine) = libm::sincos(share * turn.angle);
        let direction = turn.from * cosine + turn.side * sine;
        pose.push(to_f32(to_f64(pose[k]) + direction * turn.length));
    }
}
