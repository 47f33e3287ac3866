//! How far curves were bent and their lengths changed, measured on the written positions.

use super::Reached;
use numerics::lanes::{F32x16, LANES, Lanes, get};
use numerics::trig;
use numerics::vector;

/// A squared tangent of half an angle this many times another belongs to an angle that is smaller after rounding too.
const CLEARLY_LESS: f32 = 1.0 - 1e-5;

/// Above this squared tangent angles are so close to π that rounding may make those equal whose tangents differ.
const COARSE: f32 = 100.0;

/// Running measures of sixteen curves, in units.
pub(super) struct Tally {
    /// Squares of the difference and of the sum of a segment before and after, where their ratio, the squared tangent
    /// of half the angle between them, is largest: accurate from 0 to π.
    difference: F32x16,
    sum: F32x16,
    /// Largest change of a segment's length, and the sum of all changes.
    largest: F32x16,
    total: F32x16,
}

impl Tally {
    pub(super) fn new() -> Self {
        let [zero, one] = [0.0, 1.0].map(F32x16::splat);
        Self { difference: zero, sum: one, largest: zero, total: zero }
    }

    /// Adds a segment: its input, the displacement of its end by its rotation, and its result.
    #[inline(always)]
    pub(super) fn add(&mut self, segment: &Lanes<3>, moved: &Lanes<3>, written: &Lanes<3>) {
        for lane in 0..LANES {
            let (segment, moved) = (get(segment, lane), get(moved, lane));
            let both = vector::add(vector::add(segment, segment), moved);
            let (difference, sum) = (vector::dot(moved, moved), vector::dot(both, both));
            let more = difference * self.sum.0[lane] > self.difference.0[lane] * sum;
            self.difference.0[lane] = if more { difference } else { self.difference.0[lane] };
            self.sum.0[lane] = if more { sum } else { self.sum.0[lane] };

            let length = vector::length(segment);
            let change = vector::length(get(written, lane)) - length;
            let change = if length > 0.0 { change } else { 0.0 };
            self.total.0[lane] += change;
            let size = change.abs();
            self.largest.0[lane] = if size > self.largest.0[lane] { size } else { self.largest.0[lane] };
        }
    }

    /// The largest over the lanes, whose curves have these lengths, and over those `before`.
    #[inline(always)]
    pub(super) fn reached(&self, length: &F32x16, before: &Reached) -> Reached {
        let (mut difference, mut sum, mut length_error) = (0.0, 1.0, before.length_error);
        for lane in 0..LANES {
            let change = self.largest.0[lane].max(self.total.0[lane].abs());
            if length.0[lane] > 0.0 {
                length_error = length_error.max(change / length.0[lane]);
            }
            if self.difference.0[lane] * sum > difference * self.sum.0[lane] {
                (difference, sum) = (self.difference.0[lane], self.sum.0[lane]);
            }
        }
        // Most groups turn clearly less than one before, so that their angle is not needed.
        let ratio = difference / sum;
        if ratio < CLEARLY_LESS * before.ratio && ratio < COARSE {
            return Reached { length_error, ..*before };
        }
        let angle = 2.0 * trig::atan2(difference.sqrt(), sum.sqrt());
        Reached { max_angle: before.max_angle.max(angle), ratio: before.ratio.max(ratio), length_error }
    }
}
