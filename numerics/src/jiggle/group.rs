//! Sixteen curves side by side: a lane a curve, a slot a CV.
//!
//! A lane whose curve has ended repeats its last CV; nothing of it is written.

use super::carry::Carry;
use super::response::Response;
use crate::lanes::{F32x16, LANES, Lanes, get, set};
use crate::simd::kernel;
use crate::vec3::Vec3;

/// Sixteen `f64`, aligned as the widest vector.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct F64x16(pub(super) [f64; LANES]);

impl F64x16 {
    pub(super) const ZERO: Self = Self([0.0; LANES]);
}

/// One CV of each lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    /// From the target to where the CV is, metres.
    pub(super) offset: [F64x16; 3],
    /// Velocity, metres a step.
    pub(super) pace: [F64x16; 3],
    /// The target.
    pub(super) target: Lanes<3>,
}

/// The steps of one CV of each lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Responses {
    numbers: [F64x16; 6],
}

impl Responses {
    pub(super) const NONE: Self = Self { numbers: [F64x16::ZERO; 6] };

    pub(super) fn set(&mut self, lane: usize, response: Response) {
        let Response { a, b, c, e, k, l } = response;
        for (numbers, number) in self.numbers.iter_mut().zip([a, b, c, e, k, l]) {
            numbers.0[lane] = number;
        }
    }
}

/// Up to sixteen curves.
#[derive(Clone, Debug)]
pub(super) struct Curves {
    /// Which curve each lane is; of a lane without one, the last.
    pub(super) curve: [u32; LANES],
    first: [u32; LANES],
    last: [u32; LANES],
    /// CVs that are the lane's own: 0 where it has no curve.
    count: [u32; LANES],
    /// Most CVs of a curve.
    pub(super) longest: usize,
}

impl Curves {
    /// Of the curves from `first` on that `starts` has, at most sixteen.
    pub(super) fn new(starts: &[u32], first: usize) -> Self {
        let end = (first + LANES).min(starts.len() - 1);
        let base = starts[first];
        let last = (end - 1) as u32;
        let mut curves =
            Self { curve: [last; LANES], first: [base; LANES], last: [base; LANES], count: [0; LANES], longest: 0 };
        for lane in 0..end - first {
            let [start, until] = [starts[first + lane], starts[first + lane + 1]];
            curves.curve[lane] = (first + lane) as u32;
            if start < until {
                (curves.first[lane], curves.last[lane]) = (start, until - 1);
                curves.count[lane] = until - start;
                curves.longest = curves.longest.max((until - start) as usize);
            }
        }
        curves
    }

    /// Which point is each lane's CV at `step`.
    #[inline(always)]
    pub(super) fn at(&self, step: usize) -> [usize; LANES] {
        std::array::from_fn(|lane| self.last[lane].min(self.first[lane] + step as u32) as usize)
    }

    /// Whether the CV at `step` is the lane's own.
    #[inline(always)]
    fn has(&self, lane: usize, step: usize) -> bool {
        (step as u32) < self.count[lane]
    }

    #[inline(always)]
    pub(super) fn load(&self, step: usize, points: &[Vec3]) -> Lanes<3> {
        let at = self.at(step);
        let mut lanes = [F32x16::splat(0.0); 3];
        for lane in 0..LANES {
            set(&mut lanes, lane, points[at[lane]]);
        }
        lanes
    }
}

kernel! {
    /// A step to `targets`, carried by what moves each curve, where something does.
    pub(super) fn step_group(
        curves: &Curves,
        slots: &mut [Slot],
        responses: &[Responses],
        targets: &[Vec3],
        carries: Option<&[Carry]>,
    ) -> () = step;
}

#[inline(always)]
fn step(curves: &Curves, slots: &mut [Slot], responses: &[Responses], targets: &[Vec3], carries: Option<&[Carry]>) {
    let carried = carries.map(|carries| Carried::of(curves, carries));
    for (step, (slot, responses)) in slots.iter_mut().zip(responses).enumerate() {
        let now = curves.load(step, targets);
        let mut way = [F64x16::ZERO; 3];
        for axis in 0..3 {
            for lane in 0..LANES {
                way[axis].0[lane] = f64::from(now[axis].0[lane]) - f64::from(slot.target[axis].0[lane]);
            }
        }
        if let Some(carried) = &carried {
            carried.carry(slot, &mut way);
        }
        let [a, b, c, e, k, l] = &responses.numbers;
        for axis in 0..3 {
            for lane in 0..LANES {
                let (offset, pace) = (slot.offset[axis].0[lane], slot.pace[axis].0[lane]);
                let way = way[axis].0[lane];
                slot.offset[axis].0[lane] = (a.0[lane] * offset + b.0[lane] * pace) - k.0[lane] * way;
                slot.pace[axis].0[lane] = (c.0[lane] * offset + e.0[lane] * pace) + l.0[lane] * way;
            }
        }
        slot.target = now;
    }
}

/// What carries sixteen curves.
struct Carried {
    change: [[F64x16; 3]; 3],
    about: [F64x16; 3],
    shift: [F64x16; 3],
}

impl Carried {
    #[inline(always)]
    fn of(curves: &Curves, carries: &[Carry]) -> Self {
        let zero = [F64x16::ZERO; 3];
        let mut carried = Self { change: [zero; 3], about: zero, shift: zero };
        for lane in 0..LANES {
            let carry = &carries[curves.curve[lane] as usize];
            for row in 0..3 {
                for column in 0..3 {
                    carried.change[row][column].0[lane] = carry.change[row][column];
                }
                carried.about[row].0[lane] = carry.about[row];
                carried.shift[row].0[lane] = carry.shift[row];
            }
        }
        carried
    }

    /// Carries the state of a CV along, and takes out of its target's way what is the carrier's.
    #[inline(always)]
    fn carry(&self, slot: &mut Slot, way: &mut [F64x16; 3]) {
        let mut from = [F64x16::ZERO; 3];
        for axis in 0..3 {
            for lane in 0..LANES {
                from[axis].0[lane] = f64::from(slot.target[axis].0[lane]) - self.about[axis].0[lane];
            }
        }
        let (from, offset, pace) = (self.turned(&from), self.turned(&slot.offset), self.turned(&slot.pace));
        for axis in 0..3 {
            for lane in 0..LANES {
                way[axis].0[lane] -= from[axis].0[lane] + self.shift[axis].0[lane];
                slot.offset[axis].0[lane] += offset[axis].0[lane];
                slot.pace[axis].0[lane] += pace[axis].0[lane];
            }
        }
    }

    /// What the turn adds to a vector.
    #[inline(always)]
    fn turned(&self, v: &[F64x16; 3]) -> [F64x16; 3] {
        let mut out = [F64x16::ZERO; 3];
        for axis in 0..3 {
            let [x, y, z] = &self.change[axis];
            for lane in 0..LANES {
                out[axis].0[lane] = (x.0[lane] * v[0].0[lane] + y.0[lane] * v[1].0[lane]) + z.0[lane] * v[2].0[lane];
            }
        }
        out
    }
}

/// How much of the offset is shown.
#[derive(Clone, Copy)]
pub(super) struct Blend<'a> {
    pub(super) share: f32,
    pub(super) mask: Option<&'a [f32]>,
}

impl Blend<'_> {
    #[inline(always)]
    fn at(&self, curves: &Curves, step: usize) -> F64x16 {
        let mut shares = F64x16([f64::from(self.share); LANES]);
        if let Some(mask) = self.mask {
            let at = curves.at(step);
            for lane in 0..LANES {
                let share = self.share * mask[at[lane]];
                let share = if share > 0.0 { share } else { 0.0 };
                shares.0[lane] = f64::from(if share < 1.0 { share } else { 1.0 });
            }
        }
        shares
    }
}

kernel! {
    /// Writes where the curves are, their segments as long as their targets', to `out`, whose first point is `base`.
    /// Gives the largest square of a distance from the target.
    pub(super) fn shape_group(
        curves: &Curves,
        slots: &[Slot],
        blend: Blend<'_>,
        base: usize,
        out: &mut [Vec3],
    ) -> f64 = shape;
}

#[inline(always)]
fn shape(curves: &Curves, slots: &[Slot], blend: Blend<'_>, base: usize, out: &mut [Vec3]) -> f64 {
    let mut farthest = F64x16::ZERO;
    let mut moved = [F64x16::ZERO; 3];
    let mut before: Option<(&Slot, [F64x16; 3])> = None;
    for (step, slot) in slots.iter().enumerate() {
        let shares = blend.at(curves, step);
        let mut shown = slot.offset;
        for axis in 0..3 {
            for lane in 0..LANES {
                shown[axis].0[lane] *= shares.0[lane];
            }
        }
        if let Some((last, last_shown)) = &before {
            let mut rest = [F64x16::ZERO; 3];
            let mut swung = rest;
            for axis in 0..3 {
                for lane in 0..LANES {
                    rest[axis].0[lane] = f64::from(slot.target[axis].0[lane]) - f64::from(last.target[axis].0[lane]);
                    swung[axis].0[lane] = rest[axis].0[lane] + (shown[axis].0[lane] - last_shown[axis].0[lane]);
                }
            }
            for lane in 0..LANES {
                let (long, now) = (square(&rest, lane).sqrt(), square(&swung, lane).sqrt());
                // Equal segments give exactly 1; one without a direction keeps its target's.
                let scale = if now > 0.0 { long / now } else { 0.0 };
                for axis in 0..3 {
                    let end = if now > 0.0 { scale * swung[axis].0[lane] } else { rest[axis].0[lane] };
                    moved[axis].0[lane] += end - rest[axis].0[lane];
                }
                let distance = square(&moved, lane);
                let counts = curves.has(lane, step) && distance > farthest.0[lane];
                farthest.0[lane] = if counts { distance } else { farthest.0[lane] };
            }
        }
        let mut written = slot.target;
        for axis in 0..3 {
            for lane in 0..LANES {
                let to = f64::from(slot.target[axis].0[lane]) + moved[axis].0[lane];
                // Not the sum where nothing moved: −0 + 0 would lose its sign.
                let still = moved[axis].0[lane] == 0.0;
                written[axis].0[lane] = if still { slot.target[axis].0[lane] } else { to as f32 };
            }
        }
        for lane in 0..LANES {
            if curves.has(lane, step) {
                out[curves.first[lane] as usize + step - base] = get(&written, lane);
            }
        }
        before = Some((slot, shown));
    }
    farthest.0.into_iter().fold(0.0, f64::max)
}

#[inline(always)]
fn square(v: &[F64x16; 3], lane: usize) -> f64 {
    (v[0].0[lane] * v[0].0[lane] + v[1].0[lane] * v[1].0[lane]) + v[2].0[lane] * v[2].0[lane]
}
