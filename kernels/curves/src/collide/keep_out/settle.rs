//! Curves that enter the skin, blended with a shape in which they are free.

use super::super::crossing::crosses_block;
use super::super::half_space::HalfSpace;
use super::super::perpendicular;
use super::super::segment_turn::{Nearby, gather};
use super::{is_free, rounding_of, tested_start};
use numerics::simd::kernel;
use numerics::tree::{Boxes, Cuboid, Region, TriangleTree};
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
    let (mut pose, mut turns, mut swept) = (Vec::new(), Vec::new(), Vec::new());
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
        sweeps(goal[0], &turns, outside, &mut swept);
        faces.gather(&swept, skin, &mut nearby);
        let (mut crossing, mut clear, mut suspect) = (0.0, 1.0, 0);
        for _ in 0..HALVINGS {
            let share = 0.5 * (crossing + clear);
            pose_at(goal[0], &turns, share, &mut pose);
            let ends = [outside, tested_start(&pose, untested)];
            if faces.crossed(&nearby, &pose, ends, known[curve].as_ref(), &mut suspect) {
                crossing = share;
            } else {
                clear = share;
                out[cvs.start - base..cvs.end - base].copy_from_slice(&pose);
            }
        }
    }
    out
}

/// Which faces each segment of a curve may cross in all poses of the curve.
#[derive(Default)]
struct Faces {
    /// The boxes of the faces of each nearby block.
    boxes: Vec<Boxes>,
    /// The blocks that the segments may cross, one segment after another, and the lanes of the faces that it may.
    met: Vec<(usize, u16)>,
    /// The end of each segment's.
    ends: Vec<usize>,
}

impl Faces {
    /// Finds them for segments that sweep these boxes.
    #[inline(always)]
    fn gather<'t>(&mut self, swept: &[Cuboid], skin: &'t TriangleTree, nearby: &mut Nearby<'t>) {
        let mut all = swept[0];
        for one in swept {
            all = around(all, one);
        }
        gather(&[skin], all.low, all.high, nearby);
        self.boxes.clear();
        for (block, _) in nearby.iter() {
            self.boxes.push(block.boxes());
        }
        self.met.clear();
        self.ends.clear();
        for one in swept {
            for (k, (_, lanes)) in nearby.iter().enumerate() {
                let lanes = lanes & one.meeting(&self.boxes[k]);
                if lanes != 0 {
                    self.met.push((k, lanes));
                }
            }
            self.ends.push(self.met.len());
        }
    }

    /// As [`super::crosses`]. `suspect` is the segment that crossed last: it is tested first.
    #[inline(always)]
    fn crossed(
        &self,
        nearby: &Nearby<'_>,
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
            if self.meets(nearby, k, from, cvs[k + 1]) {
                *suspect = k;
                return true;
            }
            if k == 0
                && let Some(outside) = outside
                && outside != from
                && self.meets(nearby, 0, outside, from)
            {
                *suspect = 0;
                return true;
            }
        }
        false
    }

    /// Whether one of those of segment `k` crosses the segment from `a` to `b`, a part of it.
    #[inline(always)]
    fn meets(&self, nearby: &Nearby<'_>, k: usize, a: Vec3, b: Vec3) -> bool {
        let first = if k == 0 { 0 } else { self.ends[k - 1] };
        for (block, lanes) in &self.met[first..self.ends[k]] {
            if crosses_block(nearby.blocks()[*block].0, &self.boxes[*block], *lanes, a, b) {
                return true;
            }
        }
        false
    }
}

/// The box around two.
#[inline(always)]
fn around(mut a: Cuboid, b: &Cuboid) -> Cuboid {
    for axis in 0..3 {
        a.low[axis] = a.low[axis].min(b.low[axis]);
        a.high[axis] = a.high[axis].max(b.high[axis]);
    }
    a
}

/// The box that each segment of a curve from `root` sweeps in all poses of its turns; the first with `outside`.
#[inline(always)]
fn sweeps(root: Vec3, turns: &[SegmentTurn], outside: Option<Vec3>, swept: &mut Vec<Cuboid>) {
    swept.clear();
    let (mut low, mut high) = (to_f64(root), to_f64(root));
    if let Some(outside) = outside {
        (low, high) = (low.inf(&to_f64(outside)), high.sup(&to_f64(outside)));
    }
    for turn in turns {
        let (sine, cosine) = libm::sincos(turn.angle);
        let to = turn.from * cosine + turn.side * sine;
        // The arc is at most this far from its chord.
        let bulge = 1.0 - libm::cos(0.5 * turn.angle);
        let (start_low, start_high) = (low, high);
        if swept.is_empty() {
            (low, high) = (to_f64(root), to_f64(root));
        }
        for axis in 0..3 {
            low[axis] += turn.length * (turn.from[axis].min(to[axis]) - bulge);
            high[axis] += turn.length * (turn.from[axis].max(to[axis]) + bulge);
        }
        let (all_low, all_high) = (low.inf(&start_low), high.sup(&start_high));
        // Positions are rounded, those of a pose one after the other.
        let slack = turns.len() as f64 * rounding_of(to_f32(all_low), to_f32(all_high));
        swept.push(Cuboid { low: to_f32(all_low.map(|x| x - slack)), high: to_f32(all_high.map(|x| x + slack)) });
    }
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
