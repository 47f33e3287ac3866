//! How guides have turned since rest.

use super::hair_guides::LanePlaces;
use crate::attach::RootPose;
use nalgebra::{Quaternion, Vector3};
use numerics::lanes::{F32x16, LANES, Lanes};
use numerics::parallel;
use numerics::vector::{self, DQuat, DVec3, Vec3, to_f32, to_f64};

/// A rotation as w, x, y, z. Along a guide its sign is continuous: turns of more than half a revolution are kept
/// apart from the lesser ones with the same result.
pub(super) type Turn = [f32; 4];

/// Rotations of sixteen segments, side by side: w, x, y, z.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneTurns(pub(super) Lanes<4>);

impl LaneTurns {
    /// None on all lanes.
    #[inline(always)]
    pub(super) fn none() -> Self {
        Self([1.0, 0.0, 0.0, 0.0].map(F32x16::splat))
    }

    /// Sums without a term.
    #[inline(always)]
    pub(super) fn zero() -> Self {
        Self([F32x16::splat(0.0); 4])
    }

    /// Those of sixteen.
    #[inline(always)]
    pub(super) fn side_by_side(turns: &[Turn; LANES]) -> Self {
        let mut out = Self::zero();
        for part in 0..4 {
            for lane in 0..LANES {
                out.0[part].0[lane] = turns[lane][part];
            }
        }
        out
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
    pub(super) fn add_weighted(&mut self, other: &Self, weight: &F32x16, matrix: &[F32x16; 9]) {
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

    /// Products of their quaternions, summed over the four parts.
    #[inline(always)]
    pub(super) fn dot(&self, other: &Self) -> F32x16 {
        let ([w, x, y, z], [a, b, c, d]) = (&self.0, &other.0);
        let mut dot = F32x16::splat(0.0);
        for lane in 0..LANES {
            let axes = x.0[lane] * b.0[lane] + y.0[lane] * c.0[lane] + z.0[lane] * d.0[lane];
            dot.0[lane] = w.0[lane] * a.0[lane] + axes;
        }
        dot
    }

    /// Their lengths as quaternions.
    #[inline(always)]
    pub(super) fn sizes(&self) -> F32x16 {
        let [w, x, y, z] = &self.0;
        let mut sizes = F32x16::splat(0.0);
        for lane in 0..LANES {
            let sine = x.0[lane] * x.0[lane] + y.0[lane] * y.0[lane] + z.0[lane] * z.0[lane];
            sizes.0[lane] = (w.0[lane] * w.0[lane] + sine).sqrt();
        }
        sizes
    }

    /// Vectors turned by them; they must be of length 1.
    #[inline(always)]
    pub(super) fn rotate(&self, vectors: &Lanes<3>) -> Lanes<3> {
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
fn cross_side_by_side(a: &Lanes<3>, b: &Lanes<3>) -> Lanes<3> {
    let mut out = [F32x16::splat(0.0); 3];
    for axis in 0..3 {
        let (y, z) = ((axis + 1) % 3, (axis + 2) % 3);
        for lane in 0..LANES {
            out[axis].0[lane] = a[y].0[lane] * b[z].0[lane] - a[z].0[lane] * b[y].0[lane];
        }
    }
    out
}

/// The segments of guides at rest, in rows: those of a guide, then one that ends them.
///
/// Row [`NO_GUIDE`] is that of no guide.
#[derive(Clone, Debug, PartialEq)]
pub struct GuideSegments {
    /// The first row of each guide; [`NO_GUIDE`] for one without segments.
    firsts: Vec<u32>,
    /// The middle of each row's segment, from 0 at the root to 1 at the tip; infinite where a guide has ended.
    middles: Vec<f64>,
}

/// The row of a guide that does not turn.
pub(super) const NO_GUIDE: u32 = 0;

impl GuideSegments {
    /// Those of the guides `rest[starts[i]..starts[i + 1]]`.
    ///
    /// # Panics
    /// If `starts` does not run from 0 to the number of points.
    pub fn of(starts: &[u32], rest: &[[f32; 3]]) -> Self {
        let mut of_segments = &segment_middles(starts, rest)[..];
        let (mut firsts, mut middles) = (Vec::with_capacity(starts.len()), vec![f64::INFINITY; 2]);
        for ends in starts.windows(2) {
            let (mine, others) = of_segments.split_at((ends[1] - ends[0]).saturating_sub(1) as usize);
            firsts.push(if mine.is_empty() { NO_GUIDE } else { middles.len() as u32 });
            if !mine.is_empty() {
                middles.extend_from_slice(mine);
                middles.push(f64::INFINITY);
            }
            of_segments = others;
        }
        Self { firsts, middles }
    }

    /// The first row of a guide.
    pub(super) fn first(&self, guide: usize) -> u32 {
        self.firsts[guide]
    }

    /// The row at a fraction of a guide's length, and how far that is towards the middle of the row after it, 0..1; `row` is
    /// one of the same guide's for a smaller fraction.
    pub(super) fn place(&self, row: u32, fraction: f64) -> (u32, f64) {
        let mut row = row as usize;
        while self.middles[row + 1] <= fraction {
            row += 1;
        }
        let (here, next) = (self.middles[row], self.middles[row + 1]);
        (row as u32, if fraction > here { (fraction - here) / (next - here) } else { 0.0 })
    }
}

/// The rotation of each segment of the guides since rest.
#[derive(Clone, Debug, PartialEq)]
pub struct GuideTurns {
    /// Of each row, in the frame of the root of its guide; that which ends a guide repeats its last.
    rows: Vec<Row>,
    /// The first is that of no guide.
    guides: Vec<GuideTurn>,
}

/// What is the same for all of a guide's segments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GuideTurn {
    /// From where the skin carries the root to where it is, in the frame of the rows, metres.
    pub(super) offset: Vec3,
    /// The least w of the guide's rows.
    pub(super) least_w: f32,
}

/// The rotation of a segment, and what is added to it up to the next segment's; on one line of the cache.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(32))]
pub(super) struct Row {
    here: Turn,
    step: Turn,
}

/// The rotation of what does not turn.
const STILL: Turn = [1.0, 0.0, 0.0, 0.0];

/// Number of guides in a task.
const TASK: usize = 64;

/// Below this, of 1 + the cosine between two directions, their cross product has lost half of its digits.
const OPPOSITE: f64 = 1e-10;

impl GuideTurns {
    /// The rotations of guides from `rest[starts[i]..starts[i + 1]]`, which have these `segments`, to the same ranges of
    /// `now`, whose roots' frames have moved by `poses` (`None`: not at all).
    ///
    /// # Panics
    /// If `starts` does not run from 0 to the number of points of both, there are fewer poses than guides, or `segments` are
    /// others.
    pub fn new(
        segments: &GuideSegments,
        starts: &[u32],
        [rest, now]: [&[[f32; 3]]; 2],
        poses: Option<&[RootPose]>,
    ) -> Self {
        let guides = starts.len().saturating_sub(1);
        let still = Row { here: STILL, step: [0.0; 4] };
        let none = GuideTurn { offset: [0.0; 3], least_w: 1.0 };
        let (mut rows, mut of_guides) = (vec![still; segments.middles.len()], vec![none; guides + 1]);
        let mut left = &mut rows[2..];
        let mut tasks = Vec::new();
        for (first, of_guides) in (0..guides).step_by(TASK).zip(of_guides[1..].chunks_mut(TASK)) {
            let guides = first..first + of_guides.len();
            let rows = guides.clone().map(|guide| rows_of(starts[guide + 1] - starts[guide])).sum();
            let (mine, others) = left.split_at_mut(rows);
            tasks.push((guides, mine, of_guides));
            left = others;
        }
        parallel::for_each(tasks, |_, (guides, mut rows, of_guides)| {
            for (guide, of_guide) in guides.zip(of_guides) {
                let cvs = starts[guide] as usize..starts[guide + 1] as usize;
                let still = RootPose { translation: DVec3::zeros(), rotation: DQuat::identity(), lost: false };
                let pose = poses.map_or(still, |poses| poses[guide]);
                let (mine, others) = rows.split_at_mut(rows_of(starts[guide + 1] - starts[guide]));
                of_guide.offset = to_f32(write_turns(&rest[cvs.clone()], &now[cvs], &pose, mine));
                of_guide.least_w = mine.iter().fold(1.0, |least: f32, row| least.min(row.here[0]));
                rows = others;
            }
        });
        Self { rows, guides: of_guides }
    }

    /// That of a guide, counted from 1; 0 for no guide.
    #[inline(always)]
    pub(super) fn of_guide(&self, guide: u32) -> &GuideTurn {
        &self.guides[guide as usize]
    }

    /// The rotations of all rows.
    #[inline(always)]
    pub(super) fn rows(&self) -> &[Row] {
        &self.rows
    }
}

/// The rotation at the place on a guide of one lane, interpolated between the middles of the guide's segments.
#[inline(always)]
pub(super) fn turn_at(rows: &[Row], places: &LanePlaces, lane: usize) -> Turn {
    let Row { here, step } = &rows[places.rows[lane] as usize];
    let mut turn = *here;
    for part in 0..4 {
        turn[part] += step[part] * places.shares.0[lane];
    }
    turn
}

/// Number of rows of a guide with so many CVs.
fn rows_of(cvs: u32) -> usize {
    if cvs >= 2 { cvs as usize } else { 0 }
}

/// Writes the rotations of one guide's rows; returns the offset of its root.
fn write_turns(rest: &[[f32; 3]], now: &[[f32; 3]], pose: &RootPose, rows: &mut [Row]) -> DVec3 {
    let Some((first, moved)) = rest.first().zip(now.first()) else { return DVec3::zeros() };
    let back = pose.rotation.inverse();
    let mut turn = Quaternion::new(1.0, 0.0, 0.0, 0.0);
    let segment = |cvs: &[[f32; 3]], k: usize| (to_f64(cvs[k + 1]) - to_f64(cvs[k])).try_normalize(0.0);
    for (k, row) in rows.iter_mut().enumerate() {
        // A segment without a direction turns as the one before, and so does what ends the guide.
        if k + 1 < rest.len()
            && let (Some(from), Some(to)) = (segment(rest, k), segment(now, k))
        {
            turn = smallest_rotation(&(rotated(&turn, &from)), &(back * to)) * turn;
            turn /= turn.norm();
        }
        row.here = [turn.w, turn.i, turn.j, turn.k].map(|part| part as f32);
    }
    for k in 1..rows.len() {
        rows[k - 1].step = std::array::from_fn(|part| rows[k].here[part] - rows[k - 1].here[part]);
    }
    back * (to_f64(*moved) - (to_f64(*first) + pose.translation))
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
pub(super) fn segment_middles(starts: &[u32], points: &[[f32; 3]]) -> Vec<f64> {
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
