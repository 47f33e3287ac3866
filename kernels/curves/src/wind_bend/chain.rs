//! The rotation accumulated down a curve: one quaternion and one displacement.

use super::Bend;
use super::curve_group::Unit;
use super::share::gather;
use numerics::lanes::{F32x16, LANES, Lanes, get, set};
use numerics::trig;
use numerics::vector::{self, IDENTITY, Vec3};

/// Sine of the remaining angle to π below which the cross product of two directions is rounding noise (its error is
/// 2e-7), and the axis of rotation is taken from the curve instead.
const OPPOSITE: f32 = 1e-6;

/// Area between curve and chord, relative to the curve's size², above which the curve counts as bent, not as straight
/// up to rounding.
const STRAIGHT: f32 = 1e-5;

/// The state of sixteen curves at a pivot.
pub(super) struct Chain {
    /// The rotations of this and all earlier pivots, composed.
    turned: Lanes<4>,
    /// Displacement of the CV in units, and the rounding error of its sum (Kahan).
    offset: Lanes<3>,
    carry: Lanes<3>,
    /// The axes about which curves bend at rest, if one was needed.
    bulges: [Option<Vec3>; LANES],
}

impl Chain {
    pub(super) fn new() -> Self {
        let still = [F32x16::splat(0.0); 3];
        Self { turned: IDENTITY.map(F32x16::splat), offset: still, carry: still, bulges: [None; LANES] }
    }

    /// Rotates the rest of the curve about the pivot by `share` of the angle from its tip to `towards`; `chord` is the
    /// input tip minus the input pivot. `bulge` gives the axis that a lane's curve bends about, or 0.
    #[inline(always)]
    pub(super) fn turn(&mut self, chord: &Lanes<3>, towards: &Lanes<3>, share: &F32x16, bulge: impl Fn(usize) -> Vec3) {
        let mut tip = [F32x16::splat(0.0); 3];
        let mut axis = tip;
        let mut half = F32x16::splat(0.0);
        let mut opposite = [0; LANES];
        for lane in 0..LANES {
            let from = vector::turned(get(&self.turned, lane), get(chord, lane));
            let to = get(towards, lane);
            let between = Between::of(from, to);
            set(&mut tip, lane, from);
            set(&mut axis, lane, between.axis);
            half.0[lane] = 0.5 * share.0[lane] * between.angle;
            opposite[lane] = u32::from(between.opposite && share.0[lane] != 0.0);
        }
        if opposite != [0; LANES] {
            for lane in (0..LANES).filter(|lane| opposite[*lane] != 0) {
                let own = *self.bulges[lane].get_or_insert_with(|| bulge(lane));
                let own = vector::turned(get(&self.turned, lane), own);
                set(&mut axis, lane, own_axis(own, get(&tip, lane)));
            }
        }
        let (sine, cosine) = trig::sin_cos_lanes(&half);
        for lane in 0..LANES {
            let [x, y, z] = vector::scale(get(&axis, lane), sine.0[lane]);
            let turn = [x, y, z, cosine.0[lane]];
            let turned = vector::compose(turn, get(&self.turned, lane));
            set(&mut self.turned, lane, turned);
        }
    }

    /// Advances to the next CV, at the end of `segment`; returns the displacement that the rotation of the segment
    /// adds.
    #[inline(always)]
    pub(super) fn advance(&mut self, bend: &Bend<'_>, segment: &Lanes<3>, at: &[usize; LANES]) -> Lanes<3> {
        let whole = bend.blend.value >= 1.0 && bend.blend.mask.is_none();
        let turned = if whole { self.turned } else { self.blended(bend, at) };
        let mut moved = [F32x16::splat(0.0); 3];
        for lane in 0..LANES {
            set(&mut moved, lane, vector::moved(get(&turned, lane), get(segment, lane)));
        }
        for axis in 0..3 {
            for lane in 0..LANES {
                let term = moved[axis].0[lane] - self.carry[axis].0[lane];
                let before = self.offset[axis].0[lane];
                let after = before + term;
                self.carry[axis].0[lane] = (after - before) - term;
                self.offset[axis].0[lane] = after;
            }
        }
        moved
    }

    /// The accumulated rotation with its angle scaled by `blend`.
    #[inline(always)]
    fn blended(&self, bend: &Bend<'_>, at: &[usize; LANES]) -> Lanes<4> {
        let mut share = gather(bend.blend.mask, at);
        let mut half = F32x16::splat(0.0);
        let mut sine = half;
        for lane in 0..LANES {
            let [x, y, z, w] = get(&self.turned, lane);
            let blend = bend.blend.value * share.0[lane];
            let blend = if blend > 0.0 { blend } else { 0.0 };
            let blend = if blend < 1.0 { blend } else { 1.0 };
            share.0[lane] = blend;
            sine.0[lane] = vector::length([x, y, z]);
            half.0[lane] = blend * trig::atan2(sine.0[lane], w.abs());
        }
        let (part, cosine) = trig::sin_cos_lanes(&half);
        let mut out = self.turned;
        for lane in 0..LANES {
            let [x, y, z, w] = get(&self.turned, lane);
            // The shorter rotation: one by more than π equals one by less than π in the opposite sense.
            let part = if w < 0.0 { -part.0[lane] } else { part.0[lane] };
            let part = if sine.0[lane] > 0.0 { part / sine.0[lane] } else { 0.0 };
            let whole = share.0[lane] >= 1.0;
            let [px, py, pz] = vector::scale([x, y, z], part);
            let blended = [px, py, pz, cosine.0[lane]];
            set(&mut out, lane, if whole { [x, y, z, w] } else { blended });
        }
        out
    }

    /// The input CVs `points`, displaced: the same bits if the displacement is 0.
    #[inline(always)]
    pub(super) fn displace(&self, points: &Lanes<3>, unit: &Unit) -> Lanes<3> {
        let mut out = *points;
        for axis in 0..3 {
            for lane in 0..LANES {
                let offset = self.offset[axis].0[lane];
                let moved = out[axis].0[lane] + offset * unit.from.0[lane];
                out[axis].0[lane] = if offset == 0.0 { out[axis].0[lane] } else { moved };
            }
        }
        out
    }
}

/// The smallest rotation from one direction to another.
struct Between {
    /// Of length 1, or 0 if undefined.
    axis: Vec3,
    /// 0..π.
    angle: f32,
    /// Whether the directions are so nearly opposite that `axis` is rounding noise.
    opposite: bool,
}

impl Between {
    /// From `from` to `to`, of any lengths; no rotation if one is zero.
    #[inline(always)]
    fn of(from: Vec3, to: Vec3) -> Self {
        let normal = vector::cross(from, to);
        // For nearly opposite directions rounding tilts the normal towards them: make it perpendicular again.
        let square = vector::dot(from, from);
        let lean = if square > 0.0 { vector::dot(normal, from) / square } else { 0.0 };
        let normal = vector::sub(normal, vector::scale(from, lean));
        let (sine, cosine) = (vector::length(normal), vector::dot(from, to));
        let inverse = if sine > 0.0 { 1.0 / sine } else { 0.0 };
        Self {
            axis: vector::scale(normal, inverse),
            angle: trig::atan2(sine, cosine),
            opposite: sine < -OPPOSITE * cosine,
        }
    }
}

/// An axis to rotate `tip` about: the one the curve is bent about, `bulge`, or any perpendicular to `tip` if the curve
/// is straight.
fn own_axis(bulge: Vec3, tip: Vec3) -> Vec3 {
    let along = vector::dot(bulge, tip) / vector::dot(tip, tip);
    let upright = vector::sub(bulge, vector::scale(tip, along));
    let size = vector::length(upright);
    if size > STRAIGHT { vector::scale(upright, 1.0 / size) } else { vector::perpendicular(tip) }
}
