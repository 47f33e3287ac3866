//! Sixteen hairs side by side, turned as their guides are.

use super::hair_guides::{KnownLanes, LaneGuides, LanePlaces};
use super::hairs::{CurveDeform, DeformedCurves};
use super::turns::{LaneTurns, NO_GUIDE, Turn, turn_at};
use crate::attach::RootPose;
use nalgebra::{Quaternion, Unit};
use numerics::lanes::{F32x16, F64x16, LANES, Lanes, get};
use numerics::vector::{DQuat, DVec3, Vec3};
use std::ops::Range;

/// Below this the sum of rotations has cancelled, and the guide with the largest weight decides.
const CANCELLED: f32 = 1e-6;

/// Quaternions q and −q are one rotation. Where the product of a guide's with that of the heaviest guide is below this, they
/// are more than 240° apart by way of rest, and less than 120° the other way: the guide passed half a turn before the
/// other, or after it, and counts with the other sign. Not as soon as the other way is the shorter, since guides that lie
/// down on the two sides of a parting are half a turn apart, and what is between them stands.
const FAR_APART: f32 = -0.5;

/// No rotations with at least this w, of 120° and a little less, are [`FAR_APART`].
const NEVER_FAR_APART: f32 = 0.5 + 1e-6;

/// Weights sum to 1 up to this.
const WEIGHT_ROUNDING: f32 = 1e-6;

/// What one guide of each hair contributes.
#[derive(Clone)]
pub(super) struct Share {
    weight: F32x16,
    /// The weight times the rotation from the guide's frame to the hair's, row by row.
    matrix: [F32x16; 9],
    /// The guides' rotations at the segment that is turned.
    turns: [Turn; LANES],
}

impl Share {
    const NONE: Self =
        Self { weight: F32x16([0.0; LANES]), matrix: [F32x16([0.0; LANES]); 9], turns: [[0.0; 4]; LANES] };
}

/// What is known of sixteen hairs while they are turned. Hairs are written one by one, each along its CVs: across
/// them, sixteen at a time, each number would need its own index.
#[derive(Default)]
pub(super) struct Scratch {
    shares: Vec<Share>,
    /// CVs displaced, as they are written; hairs with fewer repeat their last.
    now: Vec<Lanes<3>>,
}

/// Up to sixteen successive hairs.
pub(super) struct HairLanes<'a> {
    how: &'a CurveDeform<'a>,
    guides: &'a [LaneGuides],
    places: &'a [LanePlaces],
    /// CVs at rest; hairs with fewer repeat their last.
    rest: &'a [Lanes<3>],
    /// A multiple of sixteen.
    first: usize,
    /// Number of hairs.
    hairs: usize,
    /// The row of each root, and the number of CVs.
    root: [usize; LANES],
    cvs: [usize; LANES],
}

impl<'a> HairLanes<'a> {
    /// The hairs `curves`, sixteen at most, with the CVs `starts[i]..starts[i + 1]`.
    #[inline(always)]
    pub(super) fn of(curves: Range<usize>, starts: &[u32], how: &'a CurveDeform<'a>) -> Self {
        let (mut root, mut cvs) = ([0; LANES], [0; LANES]);
        for lane in 0..curves.len() {
            let (from, to) = (starts[curves.start + lane] as usize, starts[curves.start + lane + 1] as usize);
            (root[lane], cvs[lane]) = (from, to - from);
        }
        let KnownLanes { guides, places, rest } = how.guides.lanes(curves.start);
        Self { how, guides, places, rest, first: curves.start, hairs: curves.len(), root, cvs }
    }

    /// Writes the hairs to `out`, whose first row is `base` of all, and the rotation of each CV to those `done` unless there
    /// are none; adds the largest stretch, and which segments may meet something if that is wanted.
    #[inline(always)]
    pub(super) fn follow(&self, scratch: &mut Scratch, base: usize, out: &mut [Vec3], done: &mut DeformedCurves) {
        scratch.now.resize(self.rest.len(), [F32x16::splat(0.0); 3]);
        let (mut offset, least_w) = self.gather(&mut scratch.shares);
        let part = self.blends(0);
        for axis in 0..3 {
            for lane in 0..LANES {
                offset[axis].0[lane] *= part.0[lane];
            }
        }
        let mut displacement = widened(&offset);
        let mut still = None;
        if let Some(poses) = self.how.poses {
            still = Some(self.place_roots(poses, &offset, &mut displacement));
        }
        let (unguided, may_be_far_apart) = (unguided(&scratch.shares), least_w < NEVER_FAR_APART);
        let (mut whole, mut largest) = (F64x16::ZERO, F64x16::ZERO);
        let Scratch { shares, now: moved } = scratch;
        let (mut rest, mut now) = ([F32x16::splat(0.0); 3], [F32x16::splat(0.0); 3]);
        for (k, (cv, out)) in self.rest.iter().zip(&mut *moved).enumerate() {
            let (from, before) = (rest, now);
            rest = *cv;
            let Some(segment) = k.checked_sub(1) else {
                now = displaced(cv, &displacement);
                *out = now;
                continue;
            };
            let mut turns = self.turns(shares, segment, &unguided, may_be_far_apart);
            self.take_part(&mut turns, segment);
            let along = difference(&rest, &from);
            let mut turned = turns.rotate(&along);
            if let Some(still) = &still {
                turned = still.rotate(&turned);
            }
            for axis in 0..3 {
                for lane in 0..LANES {
                    displacement[axis].0[lane] += f64::from(turned[axis].0[lane] - along[axis].0[lane]);
                }
            }
            now = displaced(cv, &displacement);
            *out = now;
            self.write_rotations(segment, &turns, base, &mut done.rotations);
            let (length, new) = (lengths(&rest, &from), lengths(&now, &before));
            for lane in 0..LANES {
                let error = (new.0[lane] - length.0[lane]).abs();
                whole.0[lane] += length.0[lane];
                largest.0[lane] = if error > largest.0[lane] { error } else { largest.0[lane] };
            }
        }
        // Divided side by side: also by 0, of which nothing is kept.
        let mut stretch = F64x16::ZERO;
        for lane in 0..LANES {
            let share = largest.0[lane] / whole.0[lane];
            stretch.0[lane] = if whole.0[lane] > 0.0 { share } else { 0.0 };
        }
        for share in stretch.0 {
            done.length_error = if share > done.length_error { share } else { done.length_error };
        }
        self.write(scratch, base, out);
        self.add_segments(scratch, done);
    }

    /// Adds which segments may meet what they are kept out of, if that is wanted.
    #[inline(always)]
    fn add_segments(&self, scratch: &Scratch, done: &mut DeformedCurves) {
        let Some(keep_out) = self.how.keep_out else { return };
        let Some(mut clear) = keep_out.lanes(self.first) else {
            done.may_meet.resize(done.may_meet.len() + self.hairs, u32::MAX);
            return;
        };
        for (k, ends) in scratch.now.windows(2).enumerate() {
            clear.add(k + 1, &ends[0], &ends[1]);
        }
        let mask = clear.mask();
        for lane in 0..self.hairs {
            done.may_meet.push(if mask >> lane & 1 == 1 { 0 } else { clear.segments_below(lane, self.cvs[lane]) });
        }
    }

    /// Finds what the hairs' guides contribute; returns the mean offset of their roots, in the frames of the hairs, and the
    /// least w of all their rotations.
    #[inline(always)]
    fn gather(&self, shares: &mut Vec<Share>) -> (Lanes<3>, f32) {
        let (mut offset, mut least_w) = ([F32x16::splat(0.0); 3], 1.0);
        shares.resize(self.guides.len(), Share::NONE);
        for (guide, share) in self.guides.iter().zip(shares) {
            share.set(guide);
            let mut arm = [F32x16::splat(0.0); 3];
            for lane in 0..LANES {
                let guide = self.how.turns.of_guide(guide.guide[lane]);
                for axis in 0..3 {
                    arm[axis].0[lane] = guide.offset[axis];
                }
                least_w = if guide.least_w < least_w { guide.least_w } else { least_w };
            }
            for row in 0..3 {
                let [a, b, c] = [&share.matrix[3 * row], &share.matrix[3 * row + 1], &share.matrix[3 * row + 2]];
                for lane in 0..LANES {
                    let across = a.0[lane] * arm[0].0[lane] + b.0[lane] * arm[1].0[lane] + c.0[lane] * arm[2].0[lane];
                    offset[row].0[lane] += across;
                }
            }
        }
        (offset, least_w)
    }

    /// Carries the offsets of roots along with their poses, and adds how these have moved; returns the rotations of these.
    #[inline(always)]
    fn place_roots(&self, poses: &[RootPose], offset: &Lanes<3>, displacement: &mut [F64x16; 3]) -> LaneTurns {
        let (mut still, mut moved) = (LaneTurns::none(), [F64x16::ZERO; 3]);
        for lane in 0..self.hairs {
            let pose = &poses[self.first + lane];
            let turn = [pose.rotation.w, pose.rotation.i, pose.rotation.j, pose.rotation.k];
            still.put(lane, &turn.map(|part| part as f32));
            for axis in 0..3 {
                moved[axis].0[lane] = pose.translation[axis];
            }
        }
        // Added as displacements, so that guides at rest change no bit.
        let turned = still.rotate(offset);
        for axis in 0..3 {
            for lane in 0..LANES {
                displacement[axis].0[lane] = moved[axis].0[lane] + f64::from(turned[axis].0[lane]);
            }
        }
        still
    }

    /// The mean rotations of the hairs' guides at the middle of a segment; `unguided` is the weight that no guide holds,
    /// `may_be_far_apart` whether any of these may be [`FAR_APART`].
    #[inline(always)]
    fn turns(&self, shares: &mut [Share], segment: usize, unguided: &F32x16, may_be_far_apart: bool) -> LaneTurns {
        let mut sum = LaneTurns::zero();
        let places = &self.places[segment * shares.len()..];
        // All are looked up before the first is read: what is read at once, across what was just written, is waited for.
        let rows = self.how.turns.rows();
        for (share, places) in shares.iter_mut().zip(places) {
            for lane in 0..LANES {
                share.turns[lane] = turn_at(rows, places, lane);
            }
        }
        if may_be_far_apart {
            add_aligned(&mut sum, shares);
        } else {
            for share in shares {
                sum.add_weighted(&LaneTurns::side_by_side(&share.turns), &share.weight, &share.matrix);
            }
        }
        for lane in 0..LANES {
            sum.0[0].0[lane] += unguided.0[lane];
        }
        let sizes = sum.sizes();
        let mut unit = sum;
        for part in 0..4 {
            for lane in 0..LANES {
                unit.0[part].0[lane] /= sizes.0[lane];
            }
        }
        // Looked for on all lanes at once: there are hardly ever any.
        let mut cancelled = F32x16::splat(0.0);
        for lane in 0..LANES {
            cancelled.0[lane] = if sizes.0[lane] > CANCELLED { 0.0 } else { 1.0 };
        }
        if cancelled != F32x16::splat(0.0) {
            for lane in 0..self.hairs {
                if cancelled.0[lane] > 0.0 {
                    unit.put(lane, &self.heaviest(lane, places));
                }
            }
        }
        unit
    }

    /// The rotation, at one of these places, of the guide with the largest weight that has one.
    #[inline(always)]
    fn heaviest(&self, lane: usize, places: &[LanePlaces]) -> Turn {
        for (guide, places) in self.guides.iter().zip(places) {
            if places.rows[lane] != NO_GUIDE {
                let turn = turn_at(self.how.turns.rows(), places, lane);
                let [x, y, z, w] = get(&guide.rotation, lane);
                let rotation = Unit::new_unchecked(Quaternion::new(w, x, y, z).cast::<f64>());
                let [cosine, axis @ ..] = turn.map(f64::from);
                let axis = rotation * DVec3::from(axis);
                let size = (cosine * cosine + axis.norm_squared()).sqrt();
                return [cosine / size, axis.x / size, axis.y / size, axis.z / size].map(|part| part as f32);
            }
        }
        [1.0, 0.0, 0.0, 0.0]
    }

    /// Replaces rotations by the part that the CVs at the start of their segments follow.
    #[inline(always)]
    fn take_part(&self, turns: &mut LaneTurns, segment: usize) {
        if self.how.blend.mask.is_none() && self.how.blend.value == 1.0 {
            return;
        }
        let part = self.blends(segment);
        for lane in 0..self.hairs {
            let share = f64::from(part.0[lane]);
            if share == 1.0 {
                continue;
            }
            let [w, axis @ ..] = turns.get(lane).map(f64::from);
            let sine = DVec3::from(axis).norm();
            let mut some = [1.0, 0.0, 0.0, 0.0];
            if sine > 0.0 {
                let (part_sine, part_cosine) = libm::sincos(share * libm::atan2(sine, w));
                let scale = part_sine / sine;
                some = [part_cosine, axis[0] * scale, axis[1] * scale, axis[2] * scale];
            }
            turns.put(lane, &some.map(|part| part as f32));
        }
    }

    /// How much of the guides' turn the hairs follow at their CV `cv`; 0 where there is none.
    #[inline(always)]
    fn blends(&self, cv: usize) -> F32x16 {
        let mut blends = F32x16::splat(0.0);
        for lane in 0..self.hairs {
            if cv < self.cvs[lane] {
                blends.0[lane] = self.how.blend.at(self.root[lane] + cv).clamp(0.0, 1.0);
            }
        }
        blends
    }

    /// Writes the displaced CVs.
    #[inline(always)]
    fn write(&self, scratch: &Scratch, base: usize, out: &mut [Vec3]) {
        for lane in 0..LANES {
            // By index: an iterator becomes gathers, which take longer.
            for cv in 0..self.cvs[lane] {
                out[self.root[lane] + cv - base] = get(&scratch.now[cv], lane);
            }
        }
    }

    /// Writes the rotations of the CVs at the start of segments, and of those at the end, which have the same unless they
    /// start one too.
    #[inline(always)]
    fn write_rotations(&self, segment: usize, turns: &LaneTurns, base: usize, rotations: &mut [DQuat]) {
        if rotations.is_empty() {
            return;
        }
        for lane in 0..self.hairs {
            if segment + 1 >= self.cvs[lane] {
                continue;
            }
            let [w, x, y, z] = turns.get(lane).map(f64::from);
            let mut rotation = Unit::new_normalize(Quaternion::new(w, x, y, z));
            if let Some(poses) = self.how.poses {
                rotation = poses[self.first + lane].rotation * rotation;
            }
            let first = self.root[lane] + segment - base;
            rotations[first..first + 2].fill(rotation);
        }
    }
}

impl Share {
    /// Replaces it by that of a guide.
    #[inline(always)]
    fn set(&mut self, guide: &LaneGuides) {
        let Self { weight, matrix, .. } = self;
        *weight = guide.weight;
        let [x, y, z, w] = &guide.rotation;
        for lane in 0..LANES {
            let (x, y, z, w) = (x.0[lane], y.0[lane], z.0[lane], w.0[lane]);
            let weight = weight.0[lane];
            // Divided by its squared length, which rounding to f32 made unequal to 1.
            let twice = 2.0 / (x * x + y * y + z * z + w * w);
            matrix[0].0[lane] = (1.0 - twice * (y * y + z * z)) * weight;
            matrix[1].0[lane] = twice * (x * y - w * z) * weight;
            matrix[2].0[lane] = twice * (x * z + w * y) * weight;
            matrix[3].0[lane] = twice * (x * y + w * z) * weight;
            matrix[4].0[lane] = (1.0 - twice * (x * x + z * z)) * weight;
            matrix[5].0[lane] = twice * (y * z - w * x) * weight;
            matrix[6].0[lane] = twice * (x * z - w * y) * weight;
            matrix[7].0[lane] = twice * (y * z + w * x) * weight;
            matrix[8].0[lane] = (1.0 - twice * (x * x + y * y)) * weight;
        }
    }
}

/// Adds the rotations of guides, those that are [`FAR_APART`] from the heaviest guide's with the other sign.
#[inline(always)]
fn add_aligned(sum: &mut LaneTurns, shares: &[Share]) {
    let mut heaviest = *sum;
    for (rank, share) in shares.iter().enumerate() {
        let mut turns = LaneTurns::zero();
        turns.add_weighted(&LaneTurns::side_by_side(&share.turns), &share.weight, &share.matrix);
        if rank == 0 {
            heaviest = turns;
        }
        let dot = turns.dot(&heaviest);
        for lane in 0..LANES {
            let far = FAR_APART * (shares[0].weight.0[lane] * share.weight.0[lane]);
            let sign = if dot.0[lane] < far { -1.0 } else { 1.0 };
            for part in 0..4 {
                sum.0[part].0[lane] += sign * turns.0[part].0[lane];
            }
        }
    }
}

/// The weight that no guide of each hair holds.
#[inline(always)]
fn unguided(shares: &[Share]) -> F32x16 {
    let mut unguided = F32x16::splat(1.0);
    for share in shares {
        for lane in 0..LANES {
            unguided.0[lane] -= share.weight.0[lane];
        }
    }
    for lane in 0..LANES {
        unguided.0[lane] = if unguided.0[lane] > WEIGHT_ROUNDING { unguided.0[lane] } else { 0.0 };
    }
    unguided
}

#[inline(always)]
fn difference(a: &Lanes<3>, b: &Lanes<3>) -> Lanes<3> {
    let mut out = [F32x16::splat(0.0); 3];
    for axis in 0..3 {
        for lane in 0..LANES {
            out[axis].0[lane] = a[axis].0[lane] - b[axis].0[lane];
        }
    }
    out
}

/// Points moved.
#[inline(always)]
fn displaced(points: &Lanes<3>, displacement: &[F64x16; 3]) -> Lanes<3> {
    let mut out = [F32x16::splat(0.0); 3];
    for axis in 0..3 {
        for lane in 0..LANES {
            out[axis].0[lane] = (f64::from(points[axis].0[lane]) + displacement[axis].0[lane]) as f32;
        }
    }
    out
}

#[inline(always)]
fn widened(points: &Lanes<3>) -> [F64x16; 3] {
    let mut out = [F64x16::ZERO; 3];
    for axis in 0..3 {
        for lane in 0..LANES {
            out[axis].0[lane] = f64::from(points[axis].0[lane]);
        }
    }
    out
}

/// The distances between points, in f64: squares of no scene's lengths overflow there.
#[inline(always)]
fn lengths(from: &Lanes<3>, to: &Lanes<3>) -> F64x16 {
    let (from, to) = (widened(from), widened(to));
    let mut out = F64x16::ZERO;
    for lane in 0..LANES {
        let x = to[0].0[lane] - from[0].0[lane];
        let y = to[1].0[lane] - from[1].0[lane];
        let z = to[2].0[lane] - from[2].0[lane];
        out.0[lane] = DVec3::new(x, y, z).norm();
    }
    out
}
