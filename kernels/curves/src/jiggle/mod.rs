//! Jiggle: every CV of a curve hangs on a damped spring from where the curve is put (W5).
//!
//! Between frames the target moves straight, and the spring's answer to that is exact: any stiffness, damping and step is
//! stable. Lengths are restored on what is shown, root to tip, and never fed back into the state. Where the root's skin
//! moves, a share of that motion carries state and target along ([`Carry`]).
//!
//! Promise: the exact response to the piecewise-linear target within 1e-9 of its size for ω·dt from 1e-6 to 1e6 and
//! damping ratios from 1e-3 to 1e3; the root keeps its bits; segments as long as the target's within 4 ulp of the
//! positions; what stands still keeps its bits; the same bits on every SIMD path and number of threads. State and
//! coefficients are f64; lanes are curves, so a step costs what the longest of sixteen curves has. Metres, hertz, seconds.

mod carry;
mod closest;
mod group;
mod lengths;
mod response;
mod roots;

pub use carry::{Carry, Frame};
pub use lengths::with_lengths_between;
pub use response::{Drag, steps_to_forget};
pub use roots::Roots;

use group::{Curves, F64x16, Responses, Slot, shape_group, step_group};
use numerics::lanes::LANES;
use numerics::masked::Masked;
use numerics::ramp::Ramp;
use numerics::simd::Path;
use numerics::vector::Vec3;
use rayon::prelude::*;
use response::Response;
use std::f64::consts::PI;
use std::ops::Range;

/// How far a mask may scale frequency and damping, either way.
pub const MASK_RANGE: [f32; 2] = [0.25, 4.0];

/// What each CV hangs on. Masks are one value a CV, and count within [`MASK_RANGE`].
#[derive(Clone, Debug)]
pub struct Spring<'a> {
    /// Swings a second at a softness of 1, without damping.
    pub frequency: Masked<'a, f64>,
    /// Damping ratio: 1 comes to rest soonest.
    pub damping: Masked<'a, f64>,
    /// Divides the frequency along u, the arc length ÷ curve length at rest; 0 or less follows exactly.
    pub softness: &'a Ramp,
    /// What the damper resists.
    pub drag: Drag,
}

/// Curves on their springs.
#[derive(Clone, Debug)]
pub struct Jiggle {
    /// Where along its curve each CV lies, 0 at the root.
    along: Vec<f32>,
    starts: Vec<u32>,
    parts: Vec<Part>,
    tuned: Option<Tuned>,
}

/// Whole groups of curves for one thread.
#[derive(Clone, Debug)]
struct Part {
    points: Range<usize>,
    groups: Vec<Curves>,
    /// Of all groups, one after the other.
    slots: Vec<Slot>,
    responses: Vec<Responses>,
}

/// What the responses were made from.
#[derive(Clone, Debug, PartialEq)]
struct Tuned {
    /// Frequency, damping, dt.
    numbers: [f64; 3],
    frequency_mask: Option<Vec<f32>>,
    damping_mask: Option<Vec<f32>>,
    softness: Ramp,
    drag: Drag,
}

/// Where the curves are.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct Shaped {
    /// One point for every CV.
    pub points: Vec<Vec3>,
    /// The largest distance of a CV from its target, metres.
    pub max_offset: f64,
}

/// CVs a part has at least: some 20 µs of work a step.
const PART_CVS: usize = 2048;

impl Jiggle {
    /// Curves `targets[starts[i]..starts[i + 1]]` at rest where they are. `rest` gives each CV's place along its curve.
    ///
    /// # Panics
    /// Where `starts` falls or does not run from 0 to the number of points, or `rest` is shorter.
    pub fn at_rest(starts: &[u32], rest: &[Vec3], targets: &[Vec3]) -> Self {
        let curves = starts.len().saturating_sub(1);
        let mut ranges = Vec::new();
        let mut first = 0;
        while first < curves {
            let mut end = first;
            while end < curves && ((starts[end] - starts[first]) as usize) < PART_CVS {
                end = curves.min(end + LANES);
            }
            ranges.push(first..end);
            first = end;
        }
        let parts = ranges.into_par_iter().map(|range| Part::at_rest(starts, range, targets)).collect();
        Self { along: along(starts, rest), starts: starts.to_vec(), parts, tuned: None }
    }

    /// Where each curve starts among the points, and where the last ends.
    pub fn starts(&self) -> &[u32] {
        &self.starts
    }

    /// A step of `dt` seconds, in which the targets move straight to `targets`; `carries` is what carries each curve.
    ///
    /// # Panics
    /// Where a slice is shorter than the points or curves.
    pub fn step(&mut self, targets: &[Vec3], spring: &Spring<'_>, dt: f64, carries: Option<&[Carry]>) {
        self.step_on(Path::chosen(), targets, spring, dt, carries);
    }

    /// [`Jiggle::step`] on a given SIMD path.
    ///
    /// # Panics
    /// As [`Jiggle::step`].
    pub fn step_on(&mut self, path: Path, targets: &[Vec3], spring: &Spring<'_>, dt: f64, carries: Option<&[Carry]>) {
        self.tune(spring, dt);
        self.parts.par_iter_mut().for_each(|part| {
            let (mut slots, mut responses) = (part.slots.as_mut_slice(), part.responses.as_slice());
            for curves in &part.groups {
                let (mine, rest) = slots.split_at_mut(curves.longest);
                let (answers, others) = responses.split_at(curves.longest);
                step_group(path, curves, mine, answers, targets, carries);
                (slots, responses) = (rest, others);
            }
        });
    }

    /// Where the curves are: `blend` of the way from their targets to where they swing (0…1), with
    /// their targets' lengths.
    ///
    /// # Panics
    /// Where the mask is shorter than the points.
    pub fn shape(&self, blend: Masked<'_, f32>) -> Shaped {
        self.shape_on(Path::chosen(), blend)
    }

    /// [`Jiggle::shape`] on a given SIMD path.
    ///
    /// # Panics
    /// As [`Jiggle::shape`].
    pub fn shape_on(&self, path: Path, blend: Masked<'_, f32>) -> Shaped {
        let mut points = vec![[0.0; 3]; self.along.len()];
        let mut left = points.as_mut_slice();
        let parts = self.parts.iter().map(|part| {
            let (mine, rest) = std::mem::take(&mut left).split_at_mut(part.points.len());
            left = rest;
            (part, mine)
        });
        let parts: Vec<_> = parts.collect();
        let shape = |(part, out): (&Part, &mut [Vec3])| {
            let mut slots = part.slots.as_slice();
            let mut farthest = 0.0_f64;
            for curves in &part.groups {
                let (mine, rest) = slots.split_at(curves.longest);
                farthest = farthest.max(shape_group(path, curves, mine, blend, part.points.start, out));
                slots = rest;
            }
            farthest
        };
        let farthest = parts.into_par_iter().map(shape).reduce(|| 0.0, f64::max);
        Shaped { points, max_offset: farthest.sqrt() }
    }

    /// Sees to it that the responses are those of `spring` and `dt`.
    fn tune(&mut self, spring: &Spring<'_>, dt: f64) {
        if self.tuned.as_ref().is_some_and(|tuned| tuned.is(spring, dt)) {
            return;
        }
        let along = &self.along;
        let factor =
            |number: &Masked<'_, f64>, cv: usize| f64::from(number.factor(cv).clamp(MASK_RANGE[0], MASK_RANGE[1]));
        let response = |cv: usize| {
            let softness = f64::from(spring.softness.eval(along[cv]));
            if softness > 0.0 {
                let frequency = spring.frequency.value * factor(&spring.frequency, cv);
                let zeta = spring.damping.value * factor(&spring.damping, cv);
                Response::new(2.0 * PI * frequency / softness * dt, zeta, spring.drag)
            } else {
                Response::RIGID
            }
        };
        self.parts.par_iter_mut().for_each(|part| {
            let steps = part.groups.iter().flat_map(|curves| (0..curves.longest).map(move |step| (curves, step)));
            for ((curves, step), responses) in steps.zip(&mut part.responses) {
                for (lane, cv) in curves.at(step).into_iter().enumerate() {
                    // The root is held, whatever the ramp says there.
                    responses.set(lane, if step == 0 { Response::RIGID } else { response(cv) });
                }
            }
        });
        self.tuned = Some(Tuned::of(spring, dt));
    }
}

impl Part {
    fn at_rest(starts: &[u32], range: Range<usize>, targets: &[Vec3]) -> Self {
        let points = starts[range.start] as usize..starts[range.end] as usize;
        let groups: Vec<Curves> = range.step_by(LANES).map(|first| Curves::new(starts, first)).collect();
        let still = [F64x16::ZERO; 3];
        let steps = groups.iter().flat_map(|curves| (0..curves.longest).map(move |step| (curves, step)));
        let slot =
            |(curves, step): (&Curves, usize)| Slot { offset: still, pace: still, target: curves.load(step, targets) };
        let slots: Vec<Slot> = steps.map(slot).collect();
        let responses = vec![Responses::NONE; slots.len()];
        Self { points, groups, slots, responses }
    }
}

impl Tuned {
    fn of(spring: &Spring<'_>, dt: f64) -> Self {
        Self {
            numbers: [spring.frequency.value, spring.damping.value, dt],
            frequency_mask: spring.frequency.mask.map(<[f32]>::to_vec),
            damping_mask: spring.damping.mask.map(<[f32]>::to_vec),
            softness: spring.softness.clone(),
            drag: spring.drag,
        }
    }

    fn is(&self, spring: &Spring<'_>, dt: f64) -> bool {
        self.numbers == [spring.frequency.value, spring.damping.value, dt]
            && self.frequency_mask.as_deref() == spring.frequency.mask
            && self.damping_mask.as_deref() == spring.damping.mask
            && self.softness == *spring.softness
            && self.drag == spring.drag
    }
}

/// Arc length from the root ÷ the curve's, a CV; 0 on curves of no length.
fn along(starts: &[u32], points: &[Vec3]) -> Vec<f32> {
    let mut along = vec![0.0; starts.last().map_or(0, |end| *end as usize)];
    for ends in starts.windows(2).filter(|ends| ends[0] < ends[1]) {
        let curve = ends[0] as usize..ends[1] as usize;
        let segment = |pair: &[Vec3]| {
            let d: [f64; 3] = std::array::from_fn(|axis| f64::from(pair[1][axis]) - f64::from(pair[0][axis]));
            (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
        };
        let lengths = points[curve.clone()].windows(2).map(segment);
        let whole: f64 = lengths.clone().sum();
        if whole > 0.0 {
            let mut arc = 0.0;
            for (along, length) in along[curve].iter_mut().skip(1).zip(lengths) {
                arc += length;
                *along = (arc / whole) as f32;
            }
        }
    }
    along
}

#[cfg(test)]
mod tests;
