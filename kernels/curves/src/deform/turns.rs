//! How guides have turned since rest.

use crate::attach::RootPose;
use nalgebra::{Quaternion, Vector3};
use numerics::parallel;
use numerics::vector::{self, DQuat, DVec3, to_f32, to_f64};

/// A rotation as w and x, y, z. Along a guide its sign is continuous: turns of more than half a revolution are kept
/// apart from the lesser ones with the same result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn {
    pub(super) w: f64,
    pub(super) v: DVec3,
}

/// The rotation of each segment of the guides since rest.
#[derive(Clone, Debug, PartialEq)]
pub struct GuideTurns {
    /// First row of each guide's segments, and the end of the last.
    starts: Vec<u32>,
    /// For each segment its middle at rest, from 0 at the root to 1 at the tip.
    middles: Vec<f64>,
    /// For each segment its rotation, in the frame of its guide's root at rest.
    turns: Vec<Turn>,
    /// From where the skin carries each root to where it is, in the same frame, metres.
    offsets: Vec<DVec3>,
}

/// Number of guides in a task.
const TASK: usize = 64;

/// Below this, of 1 + the cosine between two directions, their cross product has lost half of its digits.
const OPPOSITE: f64 = 1e-10;

impl GuideTurns {
    /// The rotations of guides from `rest[starts[i]..starts[i + 1]]` to the same ranges of `now`, whose roots' frames
    /// have moved by `poses` (`None`: not at all).
    ///
    /// # Panics
    /// If `starts` does not run from 0 to the number of points of both, or there are fewer poses than guides.
    pub fn new(starts: &[u32], rest: &[[f32; 3]], now: &[[f32; 3]], poses: Option<&[RootPose]>) -> Self {
        let guides = starts.len().saturating_sub(1);
        let one = |guide: usize| {
            let cvs = starts[guide] as usize..starts[guide + 1] as usize;
            let still = RootPose { translation: DVec3::zeros(), rotation: DQuat::identity(), lost: false };
            let pose = poses.map_or(still, |poses| poses[guide]);
            turns_of(&rest[cvs.clone()], &now[cvs], &pose)
        };
        let found = parallel::tabulate(guides, TASK, one);
        let mut all = Self {
            starts: vec![0],
            middles: segment_middles(starts, rest),
            turns: Vec::with_capacity(rest.len()),
            offsets: Vec::with_capacity(guides),
        };
        for (turns, offset) in found {
            all.turns.extend(turns);
            all.offsets.push(offset);
            all.starts.push(all.turns.len() as u32);
        }
        all
    }

    /// The rows of a guide's segments.
    #[inline(always)]
    pub(super) fn rows(&self, guide: usize) -> std::ops::Range<usize> {
        self.starts[guide] as usize..self.starts[guide + 1] as usize
    }

    #[inline(always)]
    pub(super) fn offset(&self, guide: usize) -> &DVec3 {
        &self.offsets[guide]
    }

    /// The rotation at `u` of a guide with segments in these `rows`, interpolated between the middles of segments;
    /// `at` is the row of the last call for a smaller `u`, or the first.
    #[inline(always)]
    pub(super) fn at(&self, rows: &std::ops::Range<usize>, u: f64, at: &mut usize) -> Turn {
        while *at + 1 < rows.end && self.middles[*at + 1] <= u {
            *at += 1;
        }
        let here = self.turns[*at];
        if *at + 1 == rows.end || u <= self.middles[*at] {
            return here;
        }
        let [from, to] = [self.middles[*at], self.middles[*at + 1]];
        let (next, share) = (self.turns[*at + 1], (u - from) / (to - from));
        Turn { w: here.w + (next.w - here.w) * share, v: here.v + (next.v - here.v) * share }
    }
}

/// The rotations of one guide's segments, and the offset of its root.
fn turns_of(rest: &[[f32; 3]], now: &[[f32; 3]], pose: &RootPose) -> (Vec<Turn>, DVec3) {
    let Some((first, moved)) = rest.first().zip(now.first()) else { return (Vec::new(), DVec3::zeros()) };
    let back = pose.rotation.inverse();
    let offset = back * (to_f64(*moved) - (to_f64(*first) + pose.translation));
    let mut turn = Quaternion::new(1.0, 0.0, 0.0, 0.0);
    let segment = |cvs: &[[f32; 3]], k: usize| (to_f64(cvs[k + 1]) - to_f64(cvs[k])).try_normalize(0.0);
    let mut turns = Vec::with_capacity(rest.len().saturating_sub(1));
    for k in 0..rest.len() - 1 {
        // A segment without a direction turns as the one before.
        if let (Some(from), Some(to)) = (segment(rest, k), segment(now, k)) {
            turn = smallest_rotation(&(rotated(&turn, &from)), &(back * to)) * turn;
            turn /= turn.norm();
        }
        turns.push(Turn { w: turn.w, v: turn.imag() });
    }
    (turns, offset)
}

/// A vector rotated by a unit quaternion.
fn rotated(turn: &Quaternion<f64>, vector: &Vector3<f64>) -> DVec3 {
    nalgebra::Unit::new_unchecked(*turn) * vector
}

/// The smallest rotation from one unit vector to another, with w ≥ 0, not normalised; about any perpendicular axis if
/// they are opposite.
fn smallest_rotation(from: &DVec3, to: &DVec3) -> Quaternion<f64> {
    let w = 1.0 + from.dot(to);
    if w > OPPOSITE {
        return Quaternion::from_parts(w, from.cross(to));
    }
    let axis = to_f64(vector::perpendicular(to_f32(*from)));
    Quaternion::from_parts(0.0, axis - from * from.dot(&axis))
}

/// For each segment of curves `points[starts[i]..starts[i + 1]]`, curve by curve, the fraction of the curve's length
/// from its root to the segment's middle; 0 where the curve has no length.
///
/// # Panics
/// If `starts` does not run from 0 to the number of points.
pub fn segment_middles(starts: &[u32], points: &[[f32; 3]]) -> Vec<f64> {
    let of_curve = |curve: usize| {
        let cvs = &points[starts[curve] as usize..starts[curve + 1] as usize];
        let mut passed = 0.0;
        let mut middles = Vec::with_capacity(cvs.len().saturating_sub(1));
        for ends in cvs.windows(2) {
            let length = (to_f64(ends[1]) - to_f64(ends[0])).norm();
            middles.push(passed + 0.5 * length);
            passed += length;
        }
        middles.iter_mut().for_each(|middle| *middle = if passed > 0.0 { *middle / passed } else { 0.0 });
        middles
    };
    parallel::concat(parallel::tabulate(starts.len().saturating_sub(1), TASK, of_curve))
}
