//! How guides have turned since rest.

use crate::attach::RootPose;
use nalgebra::{Quaternion, Vector3};
use numerics::parallel;
use numerics::vector::{self, DMat3, DQuat, DVec3, to_f32, to_f64};
use std::ops::Range;

/// A rotation as w and x, y, z. Along a guide its sign is continuous: turns of more than half a revolution are kept
/// apart from the lesser ones with the same result.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Turn {
    w: f64,
    v: DVec3,
}

/// Number of segments that are turned side by side.
pub(super) const TURNED: usize = 4;

/// Rotations of successive segments of a curve, side by side: w, x, y, z.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SegmentTurns([[f64; TURNED]; 4]);

impl SegmentTurns {
    /// The same for all.
    #[inline(always)]
    pub(super) fn all(turn: &DQuat) -> Self {
        Self([[turn.w; TURNED], [turn.i; TURNED], [turn.j; TURNED], [turn.k; TURNED]])
    }

    #[inline(always)]
    fn put(&mut self, lane: usize, turn: &Turn) {
        let Turn { w, v } = turn;
        for (part, value) in [*w, v.x, v.y, v.z].into_iter().enumerate() {
            self.0[part][lane] = value;
        }
    }

    /// Takes one of the rotations from others.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, from: &Self) {
        for part in 0..4 {
            self.0[part][lane] = from.0[part][lane];
        }
    }

    /// One of them, which must be of length 1.
    #[inline(always)]
    pub(super) fn quaternion(&self, lane: usize) -> DQuat {
        let [w, x, y, z] = self.0;
        nalgebra::Unit::new_unchecked(Quaternion::new(w[lane], x[lane], y[lane], z[lane]))
    }

    #[inline(always)]
    fn towards(mut self, next: &Self, shares: &[f64; TURNED]) -> Self {
        for part in 0..4 {
            for lane in 0..TURNED {
                self.0[part][lane] += (next.0[part][lane] - self.0[part][lane]) * shares[lane];
            }
        }
        self
    }

    /// Times a weight; `matrix` is the weight times a rotation, which turns the axes.
    #[inline(always)]
    pub(super) fn weighted(&self, weight: f64, matrix: &DMat3) -> Self {
        let [w, x, y, z] = &self.0;
        let mut out = Self::default();
        for lane in 0..TURNED {
            out.0[0][lane] = weight * w[lane];
        }
        for row in 0..3 {
            for lane in 0..TURNED {
                let [a, b] = [matrix[(row, 0)] * x[lane], matrix[(row, 1)] * y[lane]];
                out.0[row + 1][lane] = a + b + matrix[(row, 2)] * z[lane];
            }
        }
        out
    }

    #[inline(always)]
    pub(super) fn add(&mut self, other: &Self) {
        for part in 0..4 {
            for lane in 0..TURNED {
                self.0[part][lane] += other.0[part][lane];
            }
        }
    }

    /// Adds a weight of no rotation.
    #[inline(always)]
    pub(super) fn add_still(&mut self, weight: f64) {
        for lane in 0..TURNED {
            self.0[0][lane] += weight;
        }
    }

    /// Their lengths as quaternions.
    #[inline(always)]
    pub(super) fn sizes(&self) -> [f64; TURNED] {
        let [w, x, y, z] = &self.0;
        let mut sizes = [0.0; TURNED];
        for lane in 0..TURNED {
            let sine = x[lane] * x[lane] + y[lane] * y[lane] + z[lane] * z[lane];
            sizes[lane] = (w[lane] * w[lane] + sine).sqrt();
        }
        sizes
    }

    #[inline(always)]
    pub(super) fn divided(mut self, by: &[f64; TURNED]) -> Self {
        for part in 0..4 {
            for lane in 0..TURNED {
                self.0[part][lane] /= by[lane];
            }
        }
        self
    }

    /// Vectors, side by side, turned by them; they must be of length 1.
    #[inline(always)]
    pub(super) fn rotate(&self, vectors: &[[f64; TURNED]; 3]) -> [[f64; TURNED]; 3] {
        let [w, axis @ ..] = &self.0;
        let mut turned = cross_side_by_side(axis, vectors);
        for part in &mut turned {
            for lane in 0..TURNED {
                part[lane] *= 2.0;
            }
        }
        let across = cross_side_by_side(axis, &turned);
        for part in 0..3 {
            for lane in 0..TURNED {
                turned[part][lane] = turned[part][lane] * w[lane] + across[part][lane] + vectors[part][lane];
            }
        }
        turned
    }
}

#[inline(always)]
fn cross_side_by_side(a: &[[f64; TURNED]; 3], b: &[[f64; TURNED]; 3]) -> [[f64; TURNED]; 3] {
    let mut out = [[0.0; TURNED]; 3];
    for axis in 0..3 {
        let (y, z) = ((axis + 1) % 3, (axis + 2) % 3);
        for lane in 0..TURNED {
            out[axis][lane] = a[y][lane] * b[z][lane] - a[z][lane] * b[y][lane];
        }
    }
    out
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
    pub(super) fn rows(&self, guide: usize) -> Range<usize> {
        self.starts[guide] as usize..self.starts[guide + 1] as usize
    }

    #[inline(always)]
    pub(super) fn offset(&self, guide: usize) -> &DVec3 {
        &self.offsets[guide]
    }

    /// The rotations at ascending fractions of a guide with segments in these `rows`, interpolated between the middles of
    /// segments; `at` is the row of the last call for smaller fractions, or the first.
    #[inline(always)]
    pub(super) fn at(&self, rows: &Range<usize>, fractions: &[f64], at: &mut usize) -> SegmentTurns {
        let (mut here, mut next, mut shares) = (SegmentTurns::default(), SegmentTurns::default(), [0.0; TURNED]);
        let middles = &self.middles[..rows.end];
        for (lane, u) in fractions.iter().enumerate() {
            while *at + 1 < rows.end && middles[*at + 1] <= *u {
                *at += 1;
            }
            let is_between = *at + 1 < rows.end && *u > middles[*at];
            let after = *at + usize::from(is_between);
            if is_between {
                shares[lane] = (u - middles[*at]) / (middles[after] - middles[*at]);
            }
            here.put(lane, &self.turns[*at]);
            next.put(lane, &self.turns[after]);
        }
        here.towards(&next, &shares)
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
