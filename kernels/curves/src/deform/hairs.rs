//! Hairs turned as their guides are.

use super::turns::{GuideTurns, SegmentTurns, TURNED};
use crate::attach::{RootPose, relative_stretch, tasks};
use crate::guides::{GuideWeight, GuideWeights};
use nalgebra::{Quaternion, Unit};
use numerics::masked::Masked;
use numerics::parallel;
use numerics::simd::{Path, kernel};
use numerics::vector::{DMat3, DQuat, DVec3, Vec3, to_f32, to_f64};
use std::ops::Range;

/// What a groom follows.
#[derive(Clone, Copy, Debug)]
pub struct CurveDeform<'a> {
    /// The guides of each hair.
    pub weights: &'a GuideWeights,
    /// For each segment of the hairs its middle, from 0 at the root to 1 at the tip; see
    /// [`super::segment_middles`].
    pub middles: &'a [f64],
    /// How the guides have turned.
    pub turns: &'a GuideTurns,
    /// How the hairs' roots have moved and turned; `None` if they have not.
    pub poses: Option<&'a [RootPose]>,
    /// Fraction of the guides' turn that hairs follow, 0..1; a mask has one value for each CV.
    pub blend: Masked<'a, f32>,
}

/// Hairs that followed guides.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct DeformedCurves {
    /// One point for each input point, metres.
    pub points: Vec<Vec3>,
    /// The rotation of each CV, that of the segment after it; empty if not asked for.
    pub rotations: Vec<DQuat>,
    /// Largest change of a segment's length ÷ its curve's length, measured on the results.
    pub length_error: f64,
}

/// Below this the sum of rotations has cancelled, and the guide with the largest weight decides.
const CANCELLED: f64 = 1e-9;

/// Weights sum to 1 up to this.
const WEIGHT_ROUNDING: f64 = 1e-6;

/// Deforms curves `rest[starts[i]..starts[i + 1]]`, with the rotation of each CV if `with_rotations`.
///
/// # Panics
/// If `starts` does not run from 0 to the number of points, or a slice of `how` is shorter than its rows.
pub fn deform_curves(starts: &[u32], rest: &[Vec3], how: &CurveDeform<'_>, with_rotations: bool) -> DeformedCurves {
    deform_curves_on(Path::chosen(), starts, rest, how, with_rotations)
}

/// [`deform_curves`] on a given SIMD path.
pub(super) fn deform_curves_on(
    path: Path,
    starts: &[u32],
    rest: &[Vec3],
    how: &CurveDeform<'_>,
    with_rotations: bool,
) -> DeformedCurves {
    let mut points = vec![[0.0; 3]; rest.len()];
    let done = parallel::map(tasks(starts, &mut points), |_, (curves, out)| {
        follow(path, curves, starts, rest, how, out, with_rotations)
    });
    let (errors, rotations): (Vec<f64>, Vec<Vec<DQuat>>) = done.into_iter().unzip();
    let length_error = errors.into_iter().fold(0.0, f64::max);
    DeformedCurves { points, rotations: parallel::concat(rotations), length_error }
}

kernel! {
    /// Deforms `curves` into `out`; returns the largest stretch, and rotations if they are wanted.
    fn follow(
        curves: Range<usize>,
        starts: &[u32],
        rest: &[Vec3],
        how: &CurveDeform<'_>,
        out: &mut [Vec3],
        with_rotations: bool,
    ) -> (f64, Vec<DQuat>) = follow_task;
}

#[inline(always)]
fn follow_task(
    curves: Range<usize>,
    starts: &[u32],
    rest: &[Vec3],
    how: &CurveDeform<'_>,
    out: &mut [Vec3],
    with_rotations: bool,
) -> (f64, Vec<DQuat>) {
    let (mut largest, mut rotations, mut shares, mut base) = (0.0_f64, Vec::new(), Vec::new(), 0);
    for curve in curves {
        let rows = starts[curve] as usize..starts[curve + 1] as usize;
        let mine = &mut out[base..base + rows.len()];
        base += rows.len();
        let hair = Hair { curve, first: rows.start, rest: &rest[rows], how };
        hair.follow(&mut shares, mine, if with_rotations { Some(&mut rotations) } else { None });
        largest = largest.max(relative_stretch(mine, hair.rest));
    }
    (largest, rotations)
}

struct Hair<'a> {
    curve: usize,
    /// Row of its root.
    first: usize,
    rest: &'a [Vec3],
    how: &'a CurveDeform<'a>,
}

/// What a guide contributes to a hair.
struct Share {
    weight: f64,
    /// The weight times the rotation from the guide's frame to the hair's.
    matrix: DMat3,
    /// The guide's segments, and the one where the last lookup ended.
    rows: Range<usize>,
    at: usize,
}

impl Hair<'_> {
    #[inline(always)]
    fn follow(&self, shares: &mut Vec<Share>, out: &mut [Vec3], mut rotations: Option<&mut Vec<DQuat>>) {
        let Some(root) = out.first_mut() else { return };
        let offset = self.gather(shares);
        let mut unguided = 1.0;
        for share in shares.iter() {
            unguided -= share.weight;
        }
        let (mut displacement, mut still) = (offset * self.blend(0), None);
        if let Some(poses) = self.how.poses {
            let pose = &poses[self.curve];
            // Added as displacements, so that guides at rest change no bit.
            displacement = pose.translation + pose.rotation * displacement;
            still = Some(pose.rotation);
        }
        *root = to_f32(to_f64(self.rest[0]) + displacement);
        let mut rotation = still.unwrap_or_else(DQuat::identity);
        // Hairs before this one have a segment less than CVs.
        let segments = self.rest.len() - 1;
        let middles = &self.how.middles[self.first - self.curve..][..segments];
        for first in (0..segments).step_by(TURNED) {
            let count = TURNED.min(segments - first);
            let mut turns = self.turns(shares, &middles[first..first + count], unguided);
            self.take_part(&mut turns, first, count);
            let mut along = [[0.0; TURNED]; 3];
            for lane in 0..count {
                let [from, to] = [self.rest[first + lane], self.rest[first + lane + 1]];
                for axis in 0..3 {
                    along[axis][lane] = f64::from(to[axis]) - f64::from(from[axis]);
                }
            }
            let mut turned = turns.rotate(&along);
            if let Some(still) = &still {
                turned = SegmentTurns::all(still).rotate(&turned);
            }
            for lane in 0..count {
                for axis in 0..3 {
                    displacement[axis] += turned[axis][lane] - along[axis][lane];
                }
                let cv = first + lane + 1;
                out[cv] = to_f32(to_f64(self.rest[cv]) + displacement);
                if let Some(rotations) = &mut rotations {
                    let turn = turns.quaternion(lane);
                    rotation = still.map_or(turn, |still| still * turn);
                    rotations.push(rotation);
                }
            }
        }
        if let Some(rotations) = rotations {
            rotations.push(rotation);
        }
    }

    /// Collects its guides; returns the mean offset of their roots, in its own frame.
    #[inline(always)]
    fn gather(&self, shares: &mut Vec<Share>) -> DVec3 {
        shares.clear();
        let mut offset = DVec3::zeros();
        if self.how.weights.hairs() == 0 {
            return offset;
        }
        for guide in self.how.weights.of(self.curve) {
            if guide.weight <= 0.0 {
                continue;
            }
            let (rows, matrix) = (self.how.turns.rows(guide.guide as usize), weighted(guide));
            offset += matrix * self.how.turns.offset(guide.guide as usize);
            shares.push(Share { weight: f64::from(guide.weight), matrix, at: rows.start, rows });
        }
        offset
    }

    /// The mean rotations of its guides at some fractions of their lengths; `unguided` is the weight that no guide holds.
    #[inline(always)]
    fn turns(&self, shares: &mut [Share], middles: &[f64], unguided: f64) -> SegmentTurns {
        let mut sum = SegmentTurns::default();
        let mut heaviest: Option<SegmentTurns> = None;
        for share in shares {
            if share.rows.is_empty() {
                sum.add_still(share.weight);
                continue;
            }
            let turns = self.how.turns.at(&share.rows, middles, &mut share.at);
            let turns = turns.weighted(share.weight, &share.matrix);
            sum.add(&turns);
            if heaviest.is_none() {
                heaviest = Some(turns);
            }
        }
        // What no guide holds stays at rest.
        sum.add_still(if unguided > WEIGHT_ROUNDING { unguided } else { 0.0 });
        let sizes = sum.sizes();
        let mut unit = sum.divided(&sizes);
        for lane in 0..middles.len() {
            if sizes[lane] > CANCELLED {
                continue;
            }
            let heaviest = heaviest.unwrap_or_else(|| SegmentTurns::all(&DQuat::identity()));
            unit.set(lane, &heaviest.divided(&heaviest.sizes()));
        }
        unit
    }

    /// Replaces rotations by the part that the CVs from `first` on follow.
    #[inline(always)]
    fn take_part(&self, turns: &mut SegmentTurns, first: usize, count: usize) {
        for lane in 0..count {
            let share = self.blend(first + lane);
            if share == 1.0 {
                continue;
            }
            let turn = turns.quaternion(lane);
            let (sine, cosine) = (turn.imag().norm(), turn.w);
            let mut part = DQuat::identity();
            if sine > 0.0 {
                let (part_sine, part_cosine) = libm::sincos(share * libm::atan2(sine, cosine));
                part = Unit::new_unchecked(Quaternion::from_parts(part_cosine, turn.imag() * (part_sine / sine)));
            }
            turns.set(lane, &SegmentTurns::all(&part));
        }
    }

    #[inline(always)]
    fn blend(&self, cv: usize) -> f64 {
        f64::from(self.how.blend.at(self.first + cv)).clamp(0.0, 1.0)
    }
}

/// A guide's weight times the rotation from its frame to the hair's.
#[inline(always)]
fn weighted(guide: &GuideWeight) -> DMat3 {
    let [x, y, z, w] = guide.rotation.map(f64::from);
    let weight = f64::from(guide.weight);
    if [x, y, z] == [0.0; 3] {
        return DMat3::from_diagonal_element(weight);
    }
    // Divided by its squared length, which rounding to f32 made unequal to 1.
    let twice = 2.0 / (x * x + y * y + z * z + w * w);
    let rows = [
        [1.0 - twice * (y * y + z * z), twice * (x * y - w * z), twice * (x * z + w * y)],
        [twice * (x * y + w * z), 1.0 - twice * (x * x + z * z), twice * (y * z - w * x)],
        [twice * (x * z - w * y), twice * (y * z + w * x), 1.0 - twice * (x * x + y * y)],
    ];
    DMat3::from(rows).transpose() * weight
}
