//! Hairs turned as their guides are.

use super::turns::{GuideTurns, Turn};
use crate::attach::{RootPose, relative_stretch, tasks};
use crate::guides::{GuideWeight, GuideWeights};
use nalgebra::{Quaternion, Unit};
use numerics::masked::Masked;
use numerics::parallel;
use numerics::vector::{DMat3, DQuat, DVec3, to_f32, to_f64};
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
    pub points: Vec<[f32; 3]>,
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
pub fn deform_curves(starts: &[u32], rest: &[[f32; 3]], how: &CurveDeform<'_>, with_rotations: bool) -> DeformedCurves {
    let mut points = vec![[0.0; 3]; rest.len()];
    let done = parallel::map(tasks(starts, &mut points), |_, (curves, mut out)| {
        let (mut largest, mut rotations, mut shares) = (0.0_f64, Vec::new(), Vec::new());
        for curve in curves {
            let rows = starts[curve] as usize..starts[curve + 1] as usize;
            let (mine, after) = out.split_at_mut(rows.len());
            let hair = Hair { curve, first: rows.start, rest: &rest[rows], how };
            hair.follow(&mut shares, mine, with_rotations.then_some(&mut rotations));
            largest = largest.max(relative_stretch(mine, hair.rest));
            out = after;
        }
        (largest, rotations)
    });
    let (errors, rotations): (Vec<f64>, Vec<Vec<DQuat>>) = done.into_iter().unzip();
    let length_error = errors.into_iter().fold(0.0, f64::max);
    DeformedCurves { points, rotations: parallel::concat(rotations), length_error }
}

struct Hair<'a> {
    curve: usize,
    /// Row of its root.
    first: usize,
    rest: &'a [[f32; 3]],
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
    fn follow(&self, shares: &mut Vec<Share>, out: &mut [[f32; 3]], mut rotations: Option<&mut Vec<DQuat>>) {
        let Some(root) = out.first_mut() else { return };
        let offset = self.gather(shares);
        let pose = self.how.poses.map(|poses| poses[self.curve]);
        let carried = |v: DVec3| pose.map_or(v, |pose| pose.rotation * v);
        let moved = pose.map_or(DVec3::zeros(), |pose| pose.translation);
        // Added as displacements, so that guides at rest change no bit.
        let mut displacement = moved + carried(offset * self.blend(0));
        *root = to_f32(to_f64(self.rest[0]) + displacement);
        let still = pose.map_or_else(DQuat::identity, |pose| pose.rotation);
        let mut rotation = still;
        // Hairs before this one have a segment less than CVs.
        let middles = &self.how.middles[self.first - self.curve..];
        for k in 0..self.rest.len() - 1 {
            let segment = to_f64(self.rest[k + 1]) - to_f64(self.rest[k]);
            let turn = self.part(self.turn(shares, middles[k]), k);
            displacement += carried(turn * segment) - segment;
            out[k + 1] = to_f32(to_f64(self.rest[k + 1]) + displacement);
            if let Some(rotations) = &mut rotations {
                rotation = still * turn;
                rotations.push(rotation);
            }
        }
        if let Some(rotations) = rotations {
            rotations.push(rotation);
        }
    }

    /// Collects its guides; returns the mean offset of their roots, in its own frame.
    fn gather(&self, shares: &mut Vec<Share>) -> DVec3 {
        shares.clear();
        let mut offset = DVec3::zeros();
        if self.how.weights.hairs() == 0 {
            return offset;
        }
        for guide in self.how.weights.of(self.curve).iter().filter(|guide| guide.weight > 0.0) {
            let (rows, matrix) = (self.how.turns.rows(guide.guide as usize), weighted(guide));
            offset += matrix * self.how.turns.offset(guide.guide as usize);
            shares.push(Share { weight: f64::from(guide.weight), matrix, at: rows.start, rows });
        }
        offset
    }

    /// The mean rotation of its guides at `u`.
    fn turn(&self, shares: &mut [Share], u: f64) -> Quaternion<f64> {
        let (mut w, mut v, mut rest) = (0.0, DVec3::zeros(), 1.0);
        let mut heaviest: Option<Turn> = None;
        for share in shares {
            rest -= share.weight;
            if share.rows.is_empty() {
                w += share.weight;
                continue;
            }
            let turn = self.how.turns.at(&share.rows, u, &mut share.at);
            let turn = Turn { w: share.weight * turn.w, v: share.matrix * turn.v };
            (w, v) = (w + turn.w, v + turn.v);
            heaviest = heaviest.or(Some(turn));
        }
        // What no guide holds stays at rest.
        w += if rest > WEIGHT_ROUNDING { rest } else { 0.0 };
        let size = (w * w + v.norm_squared()).sqrt();
        if size > CANCELLED {
            return Quaternion::from_parts(w / size, v / size);
        }
        let Turn { w, v } = heaviest.unwrap_or(Turn { w: 1.0, v: DVec3::zeros() });
        let size = (w * w + v.norm_squared()).sqrt();
        Quaternion::from_parts(w / size, v / size)
    }

    /// The part of a rotation that the CV follows.
    fn part(&self, turn: Quaternion<f64>, cv: usize) -> DQuat {
        let share = self.blend(cv);
        if share == 1.0 {
            return Unit::new_unchecked(turn);
        }
        let (sine, cosine) = (turn.imag().norm(), turn.w);
        if sine == 0.0 {
            return DQuat::identity();
        }
        let (part_sine, part_cosine) = libm::sincos(share * libm::atan2(sine, cosine));
        Unit::new_unchecked(Quaternion::from_parts(part_cosine, turn.imag() * (part_sine / sine)))
    }

    fn blend(&self, cv: usize) -> f64 {
        f64::from(self.how.blend.at(self.first + cv)).clamp(0.0, 1.0)
    }
}

/// A guide's weight times the rotation from its frame to the hair's.
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
