//! A step of TR-BDF2 (Bank et al. 1985): the trapezoidal rule to γ = 2 − √2 of the step, then the second backward
//! difference formula; with the error estimate of Hosea & Shampine (1996).

use super::contact::ContactConstraint;
use super::predictor::Predictor;
use super::springs::{distance, drift};
use super::stage::{BodySolver, FrameContext, Newton, Solved, Stage};
use super::step::{Interval, StepEnd, Stepper, sum};
use numerics::vector::DVec3;

const GAMMA: f64 = 2.0 - std::f64::consts::SQRT_2;
/// Newton iterations of a stage by default.
const MOST: u32 = 4;
/// Newton iterations of a stage in accurate mode.
const MOST_ACCURATE: u32 = 12;
/// Tolerance of Newton's method in accurate mode, as a fraction of that of the frame.
const NEWTON_SHARE: f64 = 0.1;

/// What both stages of a step share.
struct Step<'a> {
    context: FrameContext<'a>,
    of: Interval<'a>,
    contacts: &'a [ContactConstraint],
    predictor: Predictor<'a>,
    /// Kinetic energy of rotation of each piece, joules.
    rotational_energy: Vec<f64>,
    /// Volume of each region at the start, m³, and its rate of change, m³/s.
    volumes: Vec<[f64; 2]>,
    /// Step coefficient of both stages, seconds.
    a: f64,
    newton: Newton,
}

impl<'a> Step<'a> {
    /// The equation of one of the stages.
    fn stage<'b>(&'b self, [y, z]: [&'b [DVec3]; 2], time: f64, early: f64, index: usize) -> Stage<'b> {
        let (contacts, rotational_energy, line_search) = (self.contacts, &self.rotational_energy[..], false);
        let stage = Stage::new(self.context, [y, z], self.a, time);
        Stage { contacts, early, rotational_energy, index, line_search, ..stage }
    }
}

impl Stepper<'_> {
    /// Takes a step with frozen `contacts`; `Err` if it stopped halfway, where tetrahedra became
    /// thin. With a tolerance Newton's method converges.
    pub(super) fn tr_bdf2(&mut self, of: Interval<'_>, contacts: &[ContactConstraint]) -> Result<StepEnd, Solved> {
        let body = self.context.body;
        let Interval { start, h, .. } = of;
        let loose: Vec<bool> = (0..body.len()).map(|particle| self.solver.system.is_loose(particle)).collect();
        let predictor = Predictor::new(body, &loose, [&start.x, &start.v, &start.acceleration], h);
        let step = Step {
            context: self.context,
            of,
            contacts,
            rotational_energy: predictor.rotational_energy(),
            predictor,
            volumes: self.solver.volumes.drift(body, &start.x, &start.v),
            a: 0.5 * GAMMA * h,
            newton: match self.tolerance {
                Some(tolerance) => Newton { most: MOST_ACCURATE, tolerance: NEWTON_SHARE * tolerance },
                None => Newton { most: MOST, tolerance: 0.0 },
            },
        };
        let middle = self.trapezoidal_stage(&step);
        if !self.solver.inventory.watched.is_empty() && self.solver.watch_thin(&self.context, &middle.x) {
            return Err(middle.solved);
        }
        let end = self.backward_difference_stage(&step, &middle);
        let error = self.unfiltered_error(&step, &middle, &end);
        let (errors, cg) = self.solver.filter(body, self.tolerance.is_some(), error);
        let mut solved = sum(middle.solved, end.solved);
        solved.cg += cg;
        Ok(StepEnd { errors, solved, ..end })
    }

    /// The trapezoidal rule, from the start to γ of the step.
    fn trapezoidal_stage(&mut self, step: &Step<'_>) -> StepEnd {
        let Step { of: Interval { start, times, h }, a, .. } = *step;
        let body = self.context.body;
        let time = times[0] + GAMMA * (times[1] - times[0]);
        let mut x = step.predictor.at(2.0 * a);
        // Lengths and volumes follow the same rules as positions.
        let extrapolate = |solver: &mut BodySolver, seconds: f64| {
            let length = |first, second| {
                let [length, rate] = drift(&start.x, &start.v, first, second);
                length + rate * seconds
            };
            let volumes = step.volumes.iter().map(|[volume, rate]| volume + rate * seconds).collect();
            solver.set_step_start(&self.context, a, length, volumes);
        };
        extrapolate(self.solver, -a);
        let force = self.solver.forces(&step.stage([&[], &[]], times[0], h, 0), &start.x, &start.v);
        extrapolate(self.solver, a);
        let mut z: Vec<DVec3> = start.x.iter().zip(&start.v).map(|(x, v)| x + v * a).collect();
        let y: Vec<DVec3> = (0..x.len())
            .map(|particle| z[particle] + start.v[particle] * a + force[particle] * (a * a / body.mass[particle]))
            .collect();
        self.context.external.hold(time, &mut x, &mut z, a);
        let stage = step.stage([&y, &z], time, (1.0 - GAMMA) * h, 0);
        let solved = self.solver.solve(&stage, step.newton, &mut x);
        let v = x.iter().zip(&z).map(|(x, z)| (x - z) / a).collect();
        StepEnd { x, v, errors: Vec::new(), solved }
    }

    /// The second backward difference formula, from the start and the `middle` to the end of the step.
    fn backward_difference_stage(&mut self, step: &Step<'_>, middle: &StepEnd) -> StepEnd {
        let Step { of: Interval { start, times, h }, a, .. } = *step;
        // Weights of the middle and the start.
        let weight = 1.0 / (GAMMA * (2.0 - GAMMA));
        let start_weight = weight * (1.0 - GAMMA) * (1.0 - GAMMA);
        let mix = |middle: &[DVec3], start: &[DVec3]| -> Vec<DVec3> {
            middle.iter().zip(start).map(|(middle, start)| middle * weight - start * start_weight).collect()
        };
        let volumes = self.solver.volumes.at(self.context.body, &middle.x);
        let volumes =
            volumes.iter().zip(&step.volumes).map(|(now, [then, _])| now * weight - then * start_weight).collect();
        let length = |first, second| {
            distance(&middle.x, first, second) * weight - distance(&start.x, first, second) * start_weight
        };
        self.solver.set_step_start(&self.context, a, length, volumes);
        let (mut z, z_rate) = (mix(&middle.x, &start.x), mix(&middle.v, &start.v));
        let y: Vec<DVec3> = z.iter().zip(&z_rate).map(|(z, rate)| z + rate * a).collect();
        let mut x = step.predictor.past(h, GAMMA, &middle.x);
        self.context.external.hold(times[1], &mut x, &mut z, a);
        let stage = step.stage([&y, &z], times[1], 0.0, 1);
        let solved = self.solver.solve(&stage, step.newton, &mut x);
        let v = x.iter().zip(&z).map(|(x, z)| (x - z) / a).collect();
        StepEnd { x, v, errors: Vec::new(), solved }
    }

    /// The error estimate, to which A⁻¹ still has to be applied.
    fn unfiltered_error(&self, step: &Step<'_>, middle: &StepEnd, end: &StepEnd) -> Vec<DVec3> {
        let scale = 2.0 * step.of.h * (-3.0 * GAMMA * GAMMA + 4.0 * GAMMA - 2.0) / (12.0 * (2.0 - GAMMA));
        let error = |particle: usize| {
            let second_difference = step.of.start.v[particle] / GAMMA - middle.v[particle] / (GAMMA * (1.0 - GAMMA))
                + end.v[particle] / (1.0 - GAMMA);
            if self.context.external.held[particle] {
                DVec3::zeros()
            } else {
                second_difference * (scale * self.context.body.mass[particle])
            }
        };
        (0..end.x.len()).map(error).collect()
    }
}
