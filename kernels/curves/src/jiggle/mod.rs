//! Jiggle: every CV of a curve is tied by a damped spring to its position on the incoming curve, the target (W5).
//!
//! Between frames the target moves in a straight line, and the spring's response to that is exact: any stiffness,
//! damping and step is stable. Lengths are restored on the output, root to tip, and never fed back into the state.
//! Where the root's skin moves, a fraction of that motion is applied to state and target ([`RigidStep`]).
//!
//! Guarantees: the exact response to the piecewise-linear target within 1e-9 of its size for ω·dt from 1e-6 to 1e6 and
//! damping ratios from 1e-3 to 1e3; the root keeps its bits; segments as long as the target's within 4 ulp of the
//! positions; curves that stand still keep their bits; the same bits on every SIMD path and number of threads. State
//! and coefficients are f64; lanes are curves, so the cost of a step is that of the longest of sixteen curves. Metres,
//! hertz, seconds.

mod curve_lanes;
mod gather;
mod lengths;
mod response;
mod rigid_step;

pub use lengths::with_lengths_of;
pub use response::{Drag, steps_to_forget};
pub use rigid_step::RigidStep;

use crate::clumps::Clumps;
use curve_lanes::{CurveLanes, CvState, Responses, shape_lanes, step_lanes};
use numerics::lanes::{F64x16, LANES};
use numerics::masked::Masked;
use numerics::parallel;
use numerics::ramp::Ramp;
use numerics::simd::Path;
use numerics::vector::{DVec3, Vec3, to_f64};
use response::Response;
use std::f64::consts::PI;
use std::ops::Range;

/// Range in which a mask may scale frequency and damping.
pub const MASK_RANGE: [f32; 2] = [0.25, 4.0];

/// The spring of each CV. Masks have one value for each CV and are clamped to [`MASK_RANGE`].
#[derive(Clone, Debug)]
pub struct Spring<'a> {
    /// Oscillations per second at a softness of 1, without damping.
    pub frequency: Masked<'a, f64>,
    /// Damping ratio: 1 is critical.
    pub damping: Masked<'a, f64>,
    /// Divides the frequency along u, the arc length ÷ curve length at rest; 0 or less follows the target exactly.
    pub softness: &'a Ramp,
    /// What the damper resists.
    pub drag: Drag,
}

/// Curves on their springs.
#[derive(Clone, Debug)]
pub struct Jiggle {
    /// Arc length from the root ÷ that of the curve, for each CV.
    along: Vec<f32>,
    starts: Vec<u32>,
    batches: Vec<CurveBatch>,
    response_key: Option<ResponseKey>,
}

/// Number of curves in a task.
#[derive(Clone, Debug)]
struct CurveBatch {
    points: Range<usize>,
    groups: Vec<CurveLanes>,
    /// State of all groups, one after the other.
    states: Vec<CvState>,
    responses: Vec<Responses>,
}

/// Inputs from which the responses were computed.
#[derive(Clone, Debug, PartialEq)]
struct ResponseKey {
    /// Frequency, damping, dt.
    numbers: [f64; 3],
    frequency_mask: Option<Vec<f32>>,
    damping_mask: Option<Vec<f32>>,
    softness: Ramp,
    drag: Drag,
}

/// Curves with their swing.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct JiggledCurves {
    /// One point for every CV.
    pub points: Vec<Vec3>,
    /// The largest distance of a CV from its target, metres.
    pub max_offset: f64,
}

/// Minimum number of CVs in a batch: some 20 µs of work per step.
const BATCH_CVS: usize = 2048;

impl Jiggle {
    /// Curves `targets[starts[i]..starts[i + 1]]` at rest on their targets. `rest` gives the arc length at which each
    /// CV lies.
    ///
    /// # Panics
    /// If `starts` falls or does not run from 0 to the number of points, or `rest` is shorter.
    pub fn at_rest(starts: &[u32], rest: &[Vec3], targets: &[Vec3]) -> Self {
        let curves = starts.len().saturating_sub(1);
        let mut ranges = Vec::new();
        let mut first = 0;
        while first < curves {
            let mut end = first;
            while end < curves && ((starts[end] - starts[first]) as usize) < BATCH_CVS {
                end = curves.min(end + LANES);
            }
            ranges.push(first..end);
            first = end;
        }
        let batches = parallel::map(ranges, |_, range| CurveBatch::at_rest(starts, range, targets));
        Self { along: along(starts, rest), starts: starts.to_vec(), batches, response_key: None }
    }

    /// Curves that swing as others did: on the same `starts`, `rest` and `targets` as those at their last step, with
    /// their [`Jiggle::swing`]. `None` if that is of other curves.
    ///
    /// # Panics
    /// As [`Jiggle::at_rest`].
    pub fn swinging(starts: &[u32], rest: &[Vec3], targets: &[Vec3], swing: &[f64]) -> Option<Self> {
        let mut jiggle = Self::at_rest(starts, rest, targets);
        let states = jiggle.batches.iter_mut().flat_map(|batch| &mut batch.states);
        let mut lanes = states.flat_map(|state| state.offset.iter_mut().chain(&mut state.velocity));
        let (saved, left) = swing.as_chunks::<LANES>();
        let mut saved = saved.iter();
        let fits = lanes.all(|lanes| saved.next().map(|saved| lanes.0 = *saved).is_some());
        (fits && saved.next().is_none() && left.is_empty()).then_some(jiggle)
    }

    /// Offset and velocity of every CV, in the order in which they are held: all of the state that does not follow from
    /// the curves.
    pub fn swing(&self) -> Vec<f64> {
        let states = self.batches.iter().flat_map(|batch| &batch.states);
        let lanes = states.flat_map(|state| state.offset.iter().chain(&state.velocity));
        lanes.flat_map(|lanes| lanes.0).collect()
    }

    /// Index of the first point of each curve, and the number of points at the end.
    pub fn starts(&self) -> &[u32] {
        &self.starts
    }

    /// Takes a step of `dt` seconds, in which the targets move linearly to `targets`; `carries` is the motion that each
    /// curve inherits.
    ///
    /// # Panics
    /// If a slice is shorter than the points or curves.
    pub fn step(&mut self, targets: &[Vec3], spring: &Spring<'_>, dt: f64, carries: Option<&[RigidStep]>) {
        self.step_on(Path::chosen(), targets, spring, dt, carries);
    }

    /// [`Jiggle::step`] on a given SIMD path.
    ///
    /// # Panics
    /// As [`Jiggle::step`].
    pub fn step_on(
        &mut self,
        path: Path,
        targets: &[Vec3],
        spring: &Spring<'_>,
        dt: f64,
        carries: Option<&[RigidStep]>,
    ) {
        self.update_responses(spring, dt);
        parallel::for_each(&mut self.batches, |_, batch| {
            let (mut states, mut responses) = (batch.states.as_mut_slice(), batch.responses.as_slice());
            for curves in &batch.groups {
                let (mine, rest) = states.split_at_mut(curves.longest);
                let (own, others) = responses.split_at(curves.longest);
                step_lanes(path, curves, mine, own, targets, carries);
                (states, responses) = (rest, others);
            }
        });
    }

    /// The curves, interpolated by `blend` (0…1) from their targets to their swinging positions, with their targets'
    /// lengths.
    ///
    /// # Panics
    /// If the mask is shorter than the points.
    pub fn shape(&self, blend: Masked<'_, f32>) -> JiggledCurves {
        self.shape_on(Path::chosen(), blend)
    }

    /// [`Jiggle::shape`] on a given SIMD path.
    ///
    /// # Panics
    /// As [`Jiggle::shape`].
    pub fn shape_on(&self, path: Path, blend: Masked<'_, f32>) -> JiggledCurves {
        let mut points = vec![[0.0; 3]; self.along.len()];
        let mut left = points.as_mut_slice();
        let batches = self.batches.iter().map(|batch| {
            let (mine, rest) = std::mem::take(&mut left).split_at_mut(batch.points.len());
            left = rest;
            (batch, mine)
        });
        let farthest = parallel::map(batches, |_, (batch, out)| {
            let mut states = batch.states.as_slice();
            let mut farthest = 0.0_f64;
            for curves in &batch.groups {
                let (mine, rest) = states.split_at(curves.longest);
                farthest = farthest.max(shape_lanes(path, curves, mine, blend, batch.points.start, out));
                states = rest;
            }
            farthest
        });
        let farthest = farthest.into_iter().fold(0.0, f64::max);
        JiggledCurves { points, max_offset: farthest.sqrt() }
    }

    /// [`Jiggle::shape`] of curves that are drawn together by `share`, 0..1: from their own swing towards the mean swing of
    /// their clump at the same fraction of their length.
    ///
    /// # Panics
    /// If a mask is shorter than the points, or there are fewer curves in the clumps.
    pub fn shape_clumped(&self, blend: Masked<'_, f32>, clumps: &Clumps, share: Masked<'_, f32>) -> JiggledCurves {
        let mut offsets = vec![DVec3::zeros(); self.along.len()];
        for (curves, step, state) in self.batches.iter().flat_map(CurveBatch::steps) {
            for (lane, cv) in curves.cvs(step) {
                offsets[cv] = [0, 1, 2].map(|axis: usize| state.offset[axis].0[lane]).into();
            }
        }
        let offsets = gather::gathered(&self.starts, &self.along, &offsets, clumps, share);
        let mut together = self.clone();
        for batch in &mut together.batches {
            let steps = batch.groups.iter().flat_map(|curves| (0..curves.longest).map(move |step| (curves, step)));
            for ((curves, step), state) in steps.zip(&mut batch.states) {
                for (lane, cv) in curves.cvs(step) {
                    for axis in 0..3 {
                        state.offset[axis].0[lane] = offsets[cv][axis];
                    }
                }
            }
        }
        together.shape(blend)
    }

    /// Recomputes the responses if they are not those of `spring` and `dt`.
    fn update_responses(&mut self, spring: &Spring<'_>, dt: f64) {
        if self.response_key.as_ref().is_some_and(|key| key.is(spring, dt)) {
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
        parallel::for_each(&mut self.batches, |_, batch| {
            let steps = batch.groups.iter().flat_map(|curves| (0..curves.longest).map(move |step| (curves, step)));
            for ((curves, step), responses) in steps.zip(&mut batch.responses) {
                for (lane, cv) in curves.at(step).into_iter().enumerate() {
                    // The root follows exactly, whatever the value of the ramp there.
                    responses.set(lane, if step == 0 { Response::RIGID } else { response(cv) });
                }
            }
        });
        self.response_key = Some(ResponseKey::of(spring, dt));
    }
}

impl CurveBatch {
    /// Each step of its groups, with the state there.
    fn steps(&self) -> impl Iterator<Item = (&CurveLanes, usize, &CvState)> {
        let steps = self.groups.iter().flat_map(|curves| (0..curves.longest).map(move |step| (curves, step)));
        steps.zip(&self.states).map(|((curves, step), state)| (curves, step, state))
    }

    fn at_rest(starts: &[u32], range: Range<usize>, targets: &[Vec3]) -> Self {
        let points = starts[range.start] as usize..starts[range.end] as usize;
        let groups: Vec<CurveLanes> = range.step_by(LANES).map(|first| CurveLanes::new(starts, first)).collect();
        let still = [F64x16::ZERO; 3];
        let steps = groups.iter().flat_map(|curves| (0..curves.longest).map(move |step| (curves, step)));
        let state = |(curves, step): (&CurveLanes, usize)| CvState {
            offset: still,
            velocity: still,
            target: curves.load(step, targets),
        };
        let states: Vec<CvState> = steps.map(state).collect();
        let responses = vec![Responses::NONE; states.len()];
        Self { points, groups, states, responses }
    }
}

impl ResponseKey {
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

/// Arc length from the root ÷ that of the curve, for each CV; 0 on curves without length.
fn along(starts: &[u32], points: &[Vec3]) -> Vec<f32> {
    let mut along = vec![0.0; starts.last().map_or(0, |end| *end as usize)];
    for ends in starts.windows(2).filter(|ends| ends[0] < ends[1]) {
        let curve = ends[0] as usize..ends[1] as usize;
        let segment = |pair: &[Vec3]| (to_f64(pair[1]) - to_f64(pair[0])).norm();
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
