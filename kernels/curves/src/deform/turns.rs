//! How guides have turned since rest.

use crate::attach::RootPose;
use nalgebra::{Quaternion, Vector3};
use numerics::lanes::{F64x16, LANES};
use numerics::parallel;
use numerics::vector::{self, DQuat, DVec3, to_f32, to_f64};
use std::ops::Range;

/// A rotation as w, x, y, z. Along a guide its sign is continuous: turns of more than half a revolution are kept
/// apart from the lesser ones with the same result.
type Turn = [f64; 4];

/// Rotations of sixteen segments, side by side: w, x, y, z.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneTurns(pub(super) [F64x16; 4]);

impl LaneTurns {
    /// None on all lanes.
    #[inline(always)]
    pub(super) fn none() -> Self {
        Self([F64x16([1.0; LANES]), F64x16::ZERO, F64x16::ZERO, F64x16::ZERO])
    }

    #[inline(always)]
    pub(super) fn put(&mut self, lane: usize, turn: &Turn) {
        for part in 0..4 {
            self.0[part].0[lane] = turn[part];
        }
    }

    #[inline(always)]
    pub(super) fn get(&self, lane: usize) -> Turn {
        [self.0[0].0[lane], self.0[1].0[lane], self.0[2].0[lane], self.0[3].0[lane]]
    }

    /// Adds others times a weight; `matrix` is the weight times a rotation, row by row, which turns their axes.
    #[inline(always)]
    pub(super) fn add_weighted(&mut self, other: &Self, weight: &F64x16, matrix: &[F64x16; 9]) {
        let [w, x, y, z] = &other.0;
        for lane in 0..LANES {
            self.0[0].0[lane] += weight.0[lane] * w.0[lane];
        }
        for row in 0..3 {
            let [a, b, c] = [&matrix[3 * row], &matrix[3 * row + 1], &matrix[3 * row + 2]];
            for lane in 0..LANES {
                let across = a.0[lane] * x.0[lane] + b.0[lane] * y.0[lane] + c.0[lane] * z.0[lane];
                self.0[row + 1].0[lane] += across;
            }
        }
    }

    /// Their lengths as quaternions.
    #[inline(always)]
    pub(super) fn sizes(&self) -> F64x16 {
        let [w, x, y, z] = &self.0;
        let mut sizes = F64x16::ZERO;
        for lane in 0..LANES {
            let sine = x.0[lane] * x.0[lane] + y.0[lane] * y.0[lane] + z.0[lane] * z.0[lane];
            sizes.0[lane] = (w.0[lane] * w.0[lane] + sine).sqrt();
        }
        sizes
    }

    /// Vectors turned by them; they must be of length 1.
    #[inline(always)]
    pub(super) fn rotate(&self, vectors: &[F64x16; 3]) -> [F64x16; 3] {
        let [w, axis @ ..] = &self.0;
        let mut turned = cross_side_by_side(axis, vectors);
        for part in 0..3 {
            for lane in 0..LANES {
                turned[part].0[lane] *= 2.0;
            }
        }
        let across = cross_side_by_side(axis, &turned);
        for part in 0..3 {
            for lane in 0..LANES {
                turned[part].0[lane] = turned[part].0[lane] * w.0[lane] + across[part].0[lane] + vectors[part].0[lane];
            }
        }
        turned
    }
}

#[inline(always)]
fn cross_side_by_side(a: &[F64x16; 3], b: &[F64x16; 3]) -> [F64x16; 3] {
    let mut out = [F64x16::ZERO; 3];
    for axis in 0..3 {
        let (y, z) = ((axis + 1) % 3, (axis + 2) % 3);
        for lane in 0..LANES {
            out[axis].0[lane] = a[y].0[lane] * b[z].0[lane] - a[z].0[lane] * b[y].0[lane];
        }
    }
    out
}

/// A segment of a guide.
#[derive(Clone, Copy, Debug, PartialEq)]
struct GuideSegment {
    /// Its middle at rest, from 0 at the root to 1 at the tip.
    middle: f64,
    /// Its rotation since rest, in the frame of its guide's root.
    turn: Turn,
}

/// The rotation of each segment of the guides since rest.
#[derive(Clone, Debug, PartialEq)]
pub struct GuideTurns {
    /// First row of each guide's segments, and the end of the last.
    starts: Vec<u32>,
    segments: Vec<GuideSegment>,
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
        let middles = segment_middles(starts, rest);
        let mut all =
            Self { starts: vec![0], segments: Vec::with_capacity(rest.len()), offsets: Vec::with_capacity(guides) };
        for (turns, offset) in found {
            for turn in turns {
                all.segments.push(GuideSegment { middle: middles[all.segments.len()], turn });
            }
            all.offsets.push(offset);
            all.starts.push(all.segments.len() as u32);
        }
        all
    }

    /// The rows of a guide's segments.
    #[inline(always)]
    pub(super) fn rows(&self, guide: usize) -> Range<usize> {
        self.starts[guide] as usize..self.starts[guide + 1] as usize
    }

    #[inline(always)]
    pub(super) fn offset(&self, guide: usize) -> &DVec3 {
        &self.offsets[guide]
    }

    /// The rotation at a fraction of a guide, interpolated between the middles of its segments, of which the last is before
    /// row `end`; `at` is the row of the last call for a smaller fraction, or the first.
    #[inline(always)]
    pub(super) fn at(&self, fraction: f64, at: &mut usize, end: usize) -> Turn {
        let segments = &self.segments[*at..end];
        let mut here = &segments[0];
        for next in &segments[1..] {
            if next.middle <= fraction {
                (here, *at) = (next, *at + 1);
                continue;
            }
            let mut turn = here.turn;
            if fraction > here.middle {
                let share = (fraction - here.middle) / (next.middle - here.middle);
                for part in 0..4 {
                    turn[part] += (next.turn[part] - turn[part]) * share;
                }
            }
            return turn;
        }
        here.turn
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
        turns.push([turn.w, turn.i, turn.j, turn.k]);
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
