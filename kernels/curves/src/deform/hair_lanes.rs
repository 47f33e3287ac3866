//! Sixteen hairs side by side, turned as their guides are.

use super::hairs::{CurveDeform, DeformedCurves};
use super::turns::{LaneRows, LaneTurns, NO_GUIDE};
use crate::attach::RootPose;
use crate::collide::ClearLanes;
use nalgebra::{Quaternion, Unit};
use numerics::lanes::{F32x16, F64x16, LANES, Lanes, get, set};
use numerics::vector::{DQuat, DVec3, Vec3, to_f32};
use std::ops::Range;

/// Below this the sum of rotations has cancelled, and the guide with the largest weight decides.
const CANCELLED: f64 = 1e-9;

/// Weights sum to 1 up to this.
const WEIGHT_ROUNDING: f64 = 1e-6;

/// What one guide of each hair contributes.
pub(super) struct Share {
    weight: F64x16,
    /// The weight times the rotation from the guide's frame to the hair's, row by row.
    matrix: [F64x16; 9],
    /// Where the last lookup ended; see [`super::GuideTurns::at`].
    at: LaneRows,
}

/// Up to sixteen successive hairs.
pub(super) struct HairLanes<'a> {
    how: &'a CurveDeform<'a>,
    rest: &'a [Vec3],
    first: usize,
    /// Number of hairs.
    hairs: usize,
    /// The row of each root, and the number of CVs.
    root: [usize; LANES],
    cvs: [usize; LANES],
}

impl<'a> HairLanes<'a> {
    /// The hairs `curves`, sixteen at most, of `rest[starts[i]..starts[i + 1]]`.
    #[inline(always)]
    pub(super) fn of(curves: Range<usize>, starts: &[u32], rest: &'a [Vec3], how: &'a CurveDeform<'a>) -> Self {
        let (mut root, mut cvs) = ([0; LANES], [0; LANES]);
        for lane in 0..curves.len() {
            let (from, to) = (starts[curves.start + lane] as usize, starts[curves.start + lane + 1] as usize);
            (root[lane], cvs[lane]) = (from, to - from);
        }
        Self { how, rest, first: curves.start, hairs: curves.len(), root, cvs }
    }

    /// Writes the hairs to `out`, whose first row is `base` of all, and the rotation of each CV to those `done` unless there
    /// are none; adds the largest stretch, and which hairs are clear if that is wanted.
    #[inline(always)]
    pub(super) fn follow(&self, shares: &mut Vec<Share>, base: usize, out: &mut [Vec3], done: &mut DeformedCurves) {
        let mut displacement = self.gather(shares);
        let part = self.blends(0);
        for axis in 0..3 {
            for lane in 0..LANES {
                displacement[axis].0[lane] *= part.0[lane];
            }
        }
        let mut still = None;
        if let Some(poses) = self.how.poses {
            still = Some(self.place_roots(poses, &mut displacement));
        }
        let unguided = unguided(shares);
        let mut rest = [F64x16::ZERO; 3];
        self.read(0, &mut rest);
        let mut now = self.write(0, [&rest, &displacement], base, out);
        let mut clear = self.clear_lanes(&rest);
        let (mut whole, mut largest) = (F64x16::ZERO, F64x16::ZERO);
        for segment in 0..self.most_cvs().saturating_sub(1) {
            let mut turns = self.turns(shares, segment, &unguided);
            self.take_part(&mut turns, segment);
            let (from, before) = (rest, now);
            self.read(segment + 1, &mut rest);
            let along = difference(&rest, &from);
            let mut turned = turns.rotate(&along);
            if let Some(still) = &still {
                turned = still.rotate(&turned);
            }
            for axis in 0..3 {
                for lane in 0..LANES {
                    displacement[axis].0[lane] += turned[axis].0[lane] - along[axis].0[lane];
                }
            }
            now = self.write(segment + 1, [&rest, &displacement], base, out);
            if let Some(clear) = &mut clear {
                clear.add(segment + 1, &before, &now);
            }
            self.write_rotations(segment, &turns, base, &mut done.rotations);
            let (length, new) = (lengths(&along), lengths(&difference(&widened(&now), &widened(&before))));
            for lane in 0..LANES {
                let error = (new.0[lane] - length.0[lane]).abs();
                whole.0[lane] += length.0[lane];
                largest.0[lane] = if error > largest.0[lane] { error } else { largest.0[lane] };
            }
        }
        for lane in 0..LANES {
            let share = if whole.0[lane] > 0.0 { largest.0[lane] / whole.0[lane] } else { 0.0 };
            done.length_error = if share > done.length_error { share } else { done.length_error };
        }
        if let Some(clear) = clear {
            let mask = clear.mask();
            for lane in 0..self.hairs {
                done.clear.push(mask >> lane & 1 == 1 && self.cvs[lane] >= 2);
            }
        }
    }

    /// Which hairs are clear of what they are kept out of, if that is wanted.
    #[inline(always)]
    fn clear_lanes(&self, roots: &[F64x16; 3]) -> Option<ClearLanes> {
        let keep_out = self.how.keep_out?;
        let mut root = [F32x16::splat(0.0); 3];
        for lane in 0..self.hairs {
            let mut at = DVec3::new(roots[0].0[lane], roots[1].0[lane], roots[2].0[lane]);
            if let Some(poses) = self.how.poses {
                at += poses[self.first + lane].translation;
            }
            set(&mut root, lane, to_f32(at));
        }
        Some(keep_out.lanes(self.first..self.first + self.hairs, &root))
    }

    /// Collects the hairs' guides; returns the mean offset of their roots, in the frames of the hairs.
    #[inline(always)]
    fn gather(&self, shares: &mut Vec<Share>) -> [F64x16; 3] {
        shares.clear();
        let mut offset = [F64x16::ZERO; 3];
        if self.how.weights.hairs() == 0 || self.hairs == 0 {
            return offset;
        }
        for rank in 0..self.how.weights.of(self.first).len() {
            let mut rotation = [F64x16::ZERO, F64x16::ZERO, F64x16::ZERO, F64x16([1.0; LANES])];
            let mut arm = [F64x16::ZERO; 3];
            let (mut weight, mut firsts) = (F64x16::ZERO, [NO_GUIDE; LANES]);
            for lane in 0..self.hairs {
                let guide = &self.how.weights.of(self.first + lane)[rank];
                if guide.weight <= 0.0 {
                    continue;
                }
                firsts[lane] = self.how.turns.first(guide.guide as usize);
                weight.0[lane] = f64::from(guide.weight);
                for part in 0..4 {
                    rotation[part].0[lane] = f64::from(guide.rotation[part]);
                }
                let moved = self.how.turns.offset(guide.guide as usize);
                for axis in 0..3 {
                    arm[axis].0[lane] = moved[axis];
                }
            }
            shares.push(Share { weight, matrix: [F64x16::ZERO; 9], at: self.how.turns.start(firsts) });
            let share = &mut shares[rank];
            share.set_matrix(&rotation);
            for row in 0..3 {
                let [a, b, c] = [&share.matrix[3 * row], &share.matrix[3 * row + 1], &share.matrix[3 * row + 2]];
                for lane in 0..LANES {
                    let across = a.0[lane] * arm[0].0[lane] + b.0[lane] * arm[1].0[lane] + c.0[lane] * arm[2].0[lane];
                    offset[row].0[lane] += across;
                }
            }
        }
        offset
    }

    /// Carries the displacements of roots along with their poses; returns the rotations of these.
    #[inline(always)]
    fn place_roots(&self, poses: &[RootPose], displacement: &mut [F64x16; 3]) -> LaneTurns {
        let (mut still, mut moved) = (LaneTurns::none(), [F64x16::ZERO; 3]);
        for lane in 0..self.hairs {
            let pose = &poses[self.first + lane];
            still.put(lane, &[pose.rotation.w, pose.rotation.i, pose.rotation.j, pose.rotation.k]);
            for axis in 0..3 {
                moved[axis].0[lane] = pose.translation[axis];
            }
        }
        // Added as displacements, so that guides at rest change no bit.
        let turned = still.rotate(displacement);
        for axis in 0..3 {
            for lane in 0..LANES {
                displacement[axis].0[lane] = moved[axis].0[lane] + turned[axis].0[lane];
            }
        }
        still
    }

    /// The mean rotations of the hairs' guides at the middle of a segment; `unguided` is the weight that no guide holds.
    #[inline(always)]
    fn turns(&self, shares: &mut [Share], segment: usize, unguided: &F64x16) -> LaneTurns {
        let mut sum = LaneTurns([F64x16::ZERO; 4]);
        let middles = self.middles(segment);
        for share in shares.iter_mut() {
            let turns = self.how.turns.at(&middles, &mut share.at);
            sum.add_weighted(&turns, &share.weight, &share.matrix);
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
        for lane in 0..self.hairs {
            if sizes.0[lane] <= CANCELLED || sizes.0[lane].is_nan() {
                unit.put(lane, &self.heaviest(lane, &middles));
            }
        }
        unit
    }

    /// The rotation, at a fraction of its length, of the guide with the largest weight that has one.
    #[inline(always)]
    fn heaviest(&self, lane: usize, fractions: &F64x16) -> [f64; 4] {
        if self.how.weights.hairs() > 0 {
            for guide in self.how.weights.of(self.first + lane) {
                let row = self.how.turns.first(guide.guide as usize);
                if guide.weight > 0.0 && row != NO_GUIDE {
                    let turns = self.how.turns;
                    let turn = turns.at(fractions, &mut turns.start([row; LANES])).get(lane);
                    let [x, y, z, w] = guide.rotation;
                    let rotation = Unit::new_unchecked(Quaternion::new(w, x, y, z).cast::<f64>());
                    let axis = rotation * DVec3::new(turn[1], turn[2], turn[3]);
                    let size = (turn[0] * turn[0] + axis.norm_squared()).sqrt();
                    return [turn[0] / size, axis.x / size, axis.y / size, axis.z / size];
                }
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
            let share = part.0[lane];
            if share == 1.0 {
                continue;
            }
            let [w, axis @ ..] = turns.get(lane);
            let sine = DVec3::from(axis).norm();
            let mut some = [1.0, 0.0, 0.0, 0.0];
            if sine > 0.0 {
                let (part_sine, part_cosine) = libm::sincos(share * libm::atan2(sine, w));
                let scale = part_sine / sine;
                some = [part_cosine, axis[0] * scale, axis[1] * scale, axis[2] * scale];
            }
            turns.put(lane, &some);
        }
    }

    /// How much of the guides' turn the hairs follow at their CV `cv`; 0 where there is none.
    #[inline(always)]
    fn blends(&self, cv: usize) -> F64x16 {
        let mut blends = F64x16::ZERO;
        for lane in 0..self.hairs {
            if cv < self.cvs[lane] {
                blends.0[lane] = f64::from(self.how.blend.at(self.root[lane] + cv)).clamp(0.0, 1.0);
            }
        }
        blends
    }

    /// The middles of segments; 0 where there is none.
    #[inline(always)]
    fn middles(&self, segment: usize) -> F64x16 {
        let mut middles = F64x16::ZERO;
        for lane in 0..self.hairs {
            if segment + 1 < self.cvs[lane] {
                // Hairs before this one have a segment less than CVs.
                middles.0[lane] = self.how.middles[self.root[lane] - (self.first + lane) + segment];
            }
        }
        middles
    }

    #[inline(always)]
    fn most_cvs(&self) -> usize {
        let mut most = 0;
        for cvs in self.cvs {
            most = if cvs > most { cvs } else { most };
        }
        most
    }

    /// Reads the CVs `cv` at rest; lanes without one keep theirs.
    #[inline(always)]
    fn read(&self, cv: usize, rest: &mut [F64x16; 3]) {
        for lane in 0..self.hairs {
            if cv < self.cvs[lane] {
                let p = self.rest[self.root[lane] + cv];
                for axis in 0..3 {
                    rest[axis].0[lane] = f64::from(p[axis]);
                }
            }
        }
    }

    /// Writes the CVs `cv`, displaced; returns what is written.
    #[inline(always)]
    fn write(&self, cv: usize, [rest, displacement]: [&[F64x16; 3]; 2], base: usize, out: &mut [Vec3]) -> Lanes<3> {
        let mut rounded = [F32x16::splat(0.0); 3];
        for axis in 0..3 {
            for lane in 0..LANES {
                rounded[axis].0[lane] = (rest[axis].0[lane] + displacement[axis].0[lane]) as f32;
            }
        }
        for lane in 0..self.hairs {
            if cv < self.cvs[lane] {
                out[self.root[lane] + cv - base] = get(&rounded, lane);
            }
        }
        rounded
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
            let [w, x, y, z] = turns.get(lane);
            let mut rotation = Unit::new_unchecked(Quaternion::new(w, x, y, z));
            if let Some(poses) = self.how.poses {
                rotation = poses[self.first + lane].rotation * rotation;
            }
            let first = self.root[lane] + segment - base;
            rotations[first..first + 2].fill(rotation);
        }
    }
}

impl Share {
    /// Its matrix, from the rotations x, y, z, w.
    #[inline(always)]
    fn set_matrix(&mut self, [x, y, z, w]: &[F64x16; 4]) {
        for lane in 0..LANES {
            let (x, y, z, w, weight) = (x.0[lane], y.0[lane], z.0[lane], w.0[lane], self.weight.0[lane]);
            // Divided by its squared length, which rounding to f32 made unequal to 1.
            let twice = 2.0 / (DVec3::new(x, y, z).norm_squared() + w * w);
            self.matrix[0].0[lane] = (1.0 - twice * (y * y + z * z)) * weight;
            self.matrix[1].0[lane] = twice * (x * y - w * z) * weight;
            self.matrix[2].0[lane] = twice * (x * z + w * y) * weight;
            self.matrix[3].0[lane] = twice * (x * y + w * z) * weight;
            self.matrix[4].0[lane] = (1.0 - twice * (x * x + z * z)) * weight;
            self.matrix[5].0[lane] = twice * (y * z - w * x) * weight;
            self.matrix[6].0[lane] = twice * (x * z - w * y) * weight;
            self.matrix[7].0[lane] = twice * (y * z + w * x) * weight;
            self.matrix[8].0[lane] = (1.0 - twice * (x * x + y * y)) * weight;
        }
    }
}

/// The weight that no guide of each hair holds.
#[inline(always)]
fn unguided(shares: &[Share]) -> F64x16 {
    let mut unguided = F64x16([1.0; LANES]);
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
fn difference(a: &[F64x16; 3], b: &[F64x16; 3]) -> [F64x16; 3] {
    let mut out = [F64x16::ZERO; 3];
    for axis in 0..3 {
        for lane in 0..LANES {
            out[axis].0[lane] = a[axis].0[lane] - b[axis].0[lane];
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

#[inline(always)]
fn lengths([x, y, z]: &[F64x16; 3]) -> F64x16 {
    let mut out = F64x16::ZERO;
    for lane in 0..LANES {
        out.0[lane] = DVec3::new(x.0[lane], y.0[lane], z.0[lane]).norm();
    }
    out
}
