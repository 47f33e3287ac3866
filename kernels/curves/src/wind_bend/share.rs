//! The fraction of the angle to the wind by which each pivot rotates.

use super::{Bend, BendMode};
use numerics::lanes::{F32x16, LANES, Lanes, get};
use numerics::trig;
use numerics::vector;

/// Largest fraction: beyond 1 a segment turns past the wind, beyond thousands its angle is meaningless. Up to this
/// value sine and cosine of half the angle are still accurate.
const LARGEST: f32 = 5e5;

/// The shares of successive pivots.
pub(super) struct Share<'a> {
    bend: &'a Bend<'a>,
    /// The curves' lengths.
    length: F32x16,
    /// u at the middle of the previous segment.
    middle: F32x16,
}

impl<'a> Share<'a> {
    pub(super) fn new(bend: &'a Bend<'a>, length: F32x16) -> Self {
        Self { bend, length, middle: F32x16::splat(0.0) }
    }

    /// The shares at the pivots whose segments run between two `arcs`; `at` are the pivots' indices. 0 for a segment
    /// without length.
    #[inline(always)]
    pub(super) fn at(&mut self, arcs: [&F32x16; 2], segment: &Lanes<3>, at: &[usize; LANES]) -> F32x16 {
        let mut u = F32x16::splat(0.0);
        for lane in 0..LANES {
            u.0[lane] = along(arcs[0].0[lane], self.length.0[lane]);
        }
        let mut share = match self.bend.ramp.is_constant() {
            Some(value) => F32x16::splat(value),
            None => self.bend.ramp.eval_lanes(&u),
        };
        let mask = gather(self.bend.rotate.mask, at);
        let envelope = gather(self.bend.envelope, at);
        for lane in 0..LANES {
            let envelope = if envelope.0[lane] > 0.0 { envelope.0[lane] } else { 0.0 };
            let product = self.bend.rotate.value * share.0[lane] * mask.0[lane] * envelope;
            // Infinity times 0 is NaN and counts as 0.
            share.0[lane] = if product.is_nan() { 0.0 } else { product };
        }
        if let BendMode::ResolutionFree { reference_segments } = self.bend.mode {
            self.free_of_resolution(&mut share, arcs, segment, reference_segments);
        }
        for lane in 0..LANES {
            let value = share.0[lane];
            let still = vector::largest(get(segment, lane)) == 0.0;
            let value = if still { 0.0 } else { value };
            let value = if value < LARGEST { value } else { LARGEST };
            share.0[lane] = if value > -LARGEST { value } else { -LARGEST };
        }
        share
    }

    /// Replaces g by 1 − (1 − g)^(Δ·n), Δ the difference of u from the middle of the previous segment.
    #[inline(always)]
    fn free_of_resolution(
        &mut self,
        share: &mut F32x16,
        arcs: [&F32x16; 2],
        segment: &Lanes<3>,
        reference_segments: f32,
    ) {
        let mut exponent = F32x16::splat(0.0);
        for lane in 0..LANES {
            let middle = 0.5 * arcs[0].0[lane] + 0.5 * arcs[1].0[lane];
            let middle = along(middle, self.length.0[lane]);
            // A segment without length does not rotate; its part of Δ is added to the next.
            let still = vector::largest(get(segment, lane)) == 0.0;
            let middle = if still { self.middle.0[lane] } else { middle };
            exponent.0[lane] = (middle - self.middle.0[lane]) * reference_segments;
            self.middle.0[lane] = middle;
        }
        for lane in 0..LANES {
            let left = 1.0 - share.0[lane];
            let left = if left > 0.0 { left } else { 0.0 };
            share.0[lane] = trig::one_minus_pow(left, exponent.0[lane]);
        }
    }
}

/// Arc length relative to a curve's length; 0 on a curve without length.
#[inline(always)]
fn along(arc: f32, length: f32) -> f32 {
    if length > 0.0 { arc / length } else { 0.0 }
}

/// The value for each lane from `values`, or 1 if there are none.
#[inline(always)]
pub(super) fn gather(values: Option<&[f32]>, at: &[usize; LANES]) -> F32x16 {
    match values {
        Some(values) => F32x16::from_fn(|lane| values[at[lane]]),
        None => F32x16::splat(1.0),
    }
}
