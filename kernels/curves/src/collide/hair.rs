//! One curve, root to tip.

use super::crossing::{first_crossing, first_crossing_in};
use super::segment_turn::{Nearby, Segment};
use super::{Collide, Reached, perpendicular};
use nalgebra::{Quaternion, UnitQuaternion};
use numerics::vector::{self, DVec3, Vec3, to_f32, to_f64};

/// Of the first segment, the part not tested where the root may lie on the skin: this many gaps.
const SKIPPED_GAPS: f64 = 5.0;

/// A curve as it comes in, and where it is written.
pub(super) struct Hair<'a> {
    /// Row of its root in the attributes.
    pub(super) first: usize,
    /// How far it is moved for `offset_root`.
    pub(super) shift: DVec3,
    pub(super) rest: &'a [Vec3],
    pub(super) goal: &'a [Vec3],
    pub(super) out: &'a mut [Vec3],
}

/// Memory used again from curve to curve.
#[derive(Default)]
pub(super) struct Scratch<'t> {
    nearby: Nearby<'t>,
    goal: Vec<DVec3>,
}

impl Hair<'_> {
    /// Writes the curve as it collides.
    #[inline(always)]
    pub(super) fn collide<'t>(&mut self, all: &Collide<'t>, scratch: &mut Scratch<'t>) -> Reached {
        let mut reached = Reached::default();
        self.out.copy_from_slice(self.goal);
        let cvs = self.goal.len();
        if cvs < 2 || !self.is_finite() {
            return reached;
        }
        let shift = self.shift;
        self.set_goals(all, &shift, &mut scratch.goal);
        let goal = &scratch.goal;
        let moved = shift != DVec3::zeros();
        if moved {
            self.out[0] = to_f32(goal[0]);
        }
        let largest = self.goal.iter().fold(0.0, |most: f32, cv| most.max(vector::largest(*cv)));
        let mut turned = UnitQuaternion::identity();
        let (mut axis, mut before) = (DVec3::zeros(), DVec3::zeros());
        for k in 0..cvs - 1 {
            let way = goal[k + 1] - goal[k];
            let length = (to_f64(self.goal[k + 1]) - to_f64(self.goal[k])).norm();
            if length == 0.0 || way.norm() == 0.0 {
                self.out[k + 1] = self.out[k];
                continue;
            }
            let wanted = way / way.norm();
            let rest = to_f64(self.rest[k + 1]) - to_f64(self.rest[k]);
            let from = if rest.norm() > 0.0 { turned * (rest / rest.norm()) } else { wanted };
            axis = perpendicular(&from, &axis);
            let pivot = to_f64(self.out[k]);
            let (from, to) = match all.ground(&pivot, length) {
                None => (from, wanted),
                Some(ground) => {
                    let led = [&from, &wanted]
                        .map(|at| part_way(at, &ground.lead_out(&from, at, length), &axis, all.coherence));
                    (led[0], led[1])
                }
            };
            let segment = Segment {
                pivot,
                from,
                to,
                axis,
                before,
                length,
                half: 0.5 * f64::from(all.width.at(self.first + k)),
                gap: all.gap,
                inner: if k == 0 && all.offset_root < all.gap { SKIPPED_GAPS * all.gap } else { 0.0 },
                rounding: 1.2e-7 * (f64::from(largest) + length),
            };
            let mut done = segment.turn(all.method, all.obstacles, &mut scratch.nearby);
            let mut end = segment.end(&done.direction);
            // Not where it was led elsewhere.
            let reaches = !done.met && to == wanted;
            if reaches && self.out[k] == self.goal[k] && goal[k + 1] == to_f64(self.goal[k + 1]) {
                end = self.goal[k + 1];
            }
            if !done.clear && first_crossing(&scratch.nearby, segment.start(&done.direction), end).is_some() {
                done = segment.turn_wary(all.method, all.obstacles, &mut scratch.nearby);
                end = segment.end(&done.direction);
                if let Some(crossing) = first_crossing(&scratch.nearby, segment.start(&done.direction), end) {
                    reached.unfreed_segments += 1;
                    reached.deepest_overlap = reached.deepest_overlap.max(crossing.depth);
                }
            }
            reached.contacts += u64::from(done.met);
            turned = minimal_turn(&from, &done.direction, &axis) * turned;
            before = done.direction;
            self.out[k + 1] = end;
        }
        reached.crossings_left = match self.blend(all, &shift) {
            false => reached.unfreed_segments,
            true => self.crossings(all),
        };
        reached.length_error = self.length_error();
        reached
    }

    /// Segments that cross something as they are written.
    #[inline(always)]
    fn crossings(&self, all: &Collide<'_>) -> u64 {
        let mut count = 0;
        for k in 1..self.out.len() {
            count += u64::from(first_crossing_in(all.obstacles, self.out[k - 1], self.out[k]).is_some());
        }
        count
    }

    /// The largest change of a segment's length, as a share of the curve's.
    fn length_error(&self) -> f64 {
        let (mut worst, mut whole) = (0.0_f64, 0.0);
        for k in 1..self.out.len() {
            let length = (to_f64(self.goal[k]) - to_f64(self.goal[k - 1])).norm();
            worst = worst.max(((to_f64(self.out[k]) - to_f64(self.out[k - 1])).norm() - length).abs());
            whole += length;
        }
        if whole > 0.0 { worst / whole } else { 0.0 }
    }

    fn is_finite(&self) -> bool {
        let cvs = || self.goal.iter().chain(self.rest);
        cvs().all(|cv| cv.iter().all(|x| x.is_finite()))
    }

    /// Where the CVs are to go: as they come in, or kept off the skin by `offset_scale` of their rest distance.
    #[inline(always)]
    fn set_goals(&self, all: &Collide<'_>, shift: &DVec3, goals: &mut Vec<DVec3>) {
        goals.clear();
        let (Some(scale), Some(skin)) = (all.offset_scale, &all.skin) else {
            goals.extend(self.goal.iter().map(|cv| to_f64(*cv) + shift));
            return;
        };
        let mut before = to_f64(self.goal[0]);
        goals.push(before + shift);
        for k in 1..self.goal.len() {
            let (from, to) = (to_f64(self.goal[k - 1]), to_f64(self.goal[k]));
            let raised = skin.raised(self.rest[k], &to, scale);
            // Lengths are restored root to tip: the raised CV says a direction only.
            let way = raised - before;
            let length = (to - from).norm();
            before += if way.norm() > 0.0 { way * (length / way.norm()) } else { to - from };
            goals.push(before + shift);
        }
    }

    /// Turns each segment back towards its goal by 1 − `blend`; whether that is anything.
    fn blend(&mut self, all: &Collide<'_>, shift: &DVec3) -> bool {
        let share = |k: usize| f64::from(all.blend.at(self.first + k)).clamp(0.0, 1.0);
        if (0..self.out.len()).all(|k| share(k) == 1.0) {
            return false;
        }
        let mut before = self.out[0];
        self.out[0] = to_f32(to_f64(self.goal[0]) + shift * share(0));
        for k in 1..self.out.len() {
            let (goal, end) = (to_f64(self.goal[k]) - to_f64(self.goal[k - 1]), to_f64(self.out[k]) - to_f64(before));
            before = self.out[k];
            let (Some(to), Some(from)) = (end.try_normalize(0.0), goal.try_normalize(0.0)) else {
                self.out[k] = self.out[k - 1];
                continue;
            };
            self.out[k] = if share(k - 1) == 0.0 && self.out[k - 1] == self.goal[k - 1] {
                self.goal[k]
            } else {
                let axis = perpendicular(&from, &DVec3::zeros());
                let direction = part_way(&from, &to, &axis, share(k - 1));
                to_f32(to_f64(self.out[k - 1]) + direction * goal.norm())
            };
        }
        true
    }
}

/// The unit vector a share of the way from one to another on their great circle; through `axis` × `from` where they are
/// opposite.
fn part_way(from: &DVec3, to: &DVec3, axis: &DVec3, share: f64) -> DVec3 {
    let turn = from.cross(to);
    let (sine, cosine) = (turn.norm(), from.dot(to));
    let n = if sine > 1e-9 { turn / sine } else { *axis };
    let (sine, cosine) = libm::sincos(share * libm::atan2(sine, cosine));
    from * cosine + n.cross(from) * sine
}

/// The smallest turn from one unit vector to another; about `axis` where they are opposite.
fn minimal_turn(from: &DVec3, to: &DVec3, axis: &DVec3) -> UnitQuaternion<f64> {
    let real = 1.0 + from.dot(to);
    let imaginary = if real > 1e-12 { from.cross(to) } else { *axis };
    UnitQuaternion::new_normalize(Quaternion::from_parts(if real > 1e-12 { real } else { 0.0 }, imaginary))
}
