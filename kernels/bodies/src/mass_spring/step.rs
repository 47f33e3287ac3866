//! One step of TR-BDF2 or implicit Euler.
//!
//! TR-BDF2 (Bank et al. 1985) applies the trapezoidal rule to γ = 2 − √2 of the step, then the second backward
//! difference formula: second order and L-stable, and both stages are the same equation M(x − y) = a²f(x, (x − z)/a)
//! with a = γh/2. The error estimate is that of Hosea & Shampine (1996). Implicit Euler solves that equation once,
//! with a = h.
//!
//! Steps that start out of balance (inverted tetrahedra, contacts that changed in the previous step, or on request)
//! use implicit Euler with line search, which damps what TR-BDF2 would carry on: an impact during its first stage
//! would rebound 1.4 times as fast, since a second-order method extrapolates forces. The same holds for a step in
//! which contacts change or that failed; it is repeated from its start.

use super::balance::TakenStep;
use super::body::SoftBody;
use super::contact::{ContactConstraint, ContactMode};
use super::energy::{Energies, measure};
use super::euler::Guess;
use super::frame::{FrameReport, Integrator, SolverFrame};
use super::predictor::RigidMotion;
use super::stage::{BodySolver, FrameContext, Solved};
use super::state::Carried;
use super::volume::Inventory;
use numerics::vector::DVec3;

/// Energy gain of a step, relative to its energy, above which it is repeated with implicit Euler.
const GAIN: f64 = 0.005;
/// Gain that motion cannot pay, relative to the energy, above which a step is repeated from the positions at its start.
const UNPAID: f64 = 1e-4;
/// Steps of implicit Euler after one in which the set of active contacts changed.
const EULER_STEPS_AFTER_CHANGE: u32 = 4;

/// Motion of all particles, in the solver's order.
#[derive(Clone, Debug)]
pub(super) struct Kinematics {
    pub(super) x: Vec<DVec3>,
    pub(super) v: Vec<DVec3>,
    /// Acceleration in the last step, m/s²; used only by the predictor.
    pub(super) acceleration: Vec<DVec3>,
    /// The last normal forces of contacts on each contact point, newtons.
    pub(super) loads: Vec<f64>,
    pub(super) carried: Carried,
}

/// A step to take.
#[derive(Clone, Copy)]
pub(super) struct Interval<'a> {
    pub(super) start: &'a Kinematics,
    /// Start and end, as fractions of the frame.
    pub(super) times: [f64; 2],
    /// Length, seconds.
    pub(super) h: f64,
}

impl Interval<'_> {
    /// Where particles would be at its end without forces.
    pub(super) fn ahead(&self) -> Vec<DVec3> {
        self.start.x.iter().zip(&self.start.v).map(|(x, v)| x + v * self.h).collect()
    }
}

/// The end of a step, or of a stage, which has no errors.
pub(super) struct StepEnd {
    pub(super) x: Vec<DVec3>,
    pub(super) v: Vec<DVec3>,
    /// Estimated errors of positions, metres.
    pub(super) errors: Vec<DVec3>,
    pub(super) solved: Solved,
}

/// Outcome of a step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stepped {
    pub(super) solved: Solved,
    /// Estimated error of the speed of a piece in contact, relative to what its energy amounts to.
    pub(super) impact_error: f64,
    /// Energy gained without external driving, which slowing the motion could not take, joules.
    pub(super) energy_gained: f64,
    pub(super) after: Energies,
    /// What is reported if it is accepted.
    pub(super) report: FrameReport,
}

/// What steps work with.
pub(super) struct Stepper<'a> {
    pub(super) solver: &'a mut BodySolver,
    pub(super) context: FrameContext<'a>,
    pub(super) frame: &'a SolverFrame<'a>,
    /// Length of the frame, seconds.
    pub(super) seconds: f64,
    /// Error of positions in a frame that [`Integrator::Accurate`] allows, metres.
    pub(super) tolerance: Option<f64>,
    /// Energies after the last step that was accepted, and what is reported of all of them.
    pub(super) energies: Energies,
    pub(super) report: FrameReport,
}

impl Stepper<'_> {
    /// Takes a step. From the predicted positions of a crumpled body a descent may end in another valley of its energy, so high
    /// that no motion is left to slow. Then the step is repeated from where the body is.
    pub(super) fn step(&mut self, step: Interval<'_>) -> (Kinematics, Stepped) {
        let first = self.step_once(step, false);
        let unpaid = first.1.energy_gained > UNPAID * self.energies.scale().max(first.1.after.scale());
        if !unpaid {
            return first;
        }
        self.refresh_inventory(&step.start.x);
        let (motion, stepped) = self.step_once(step, true);
        (motion, Stepped { solved: repeated(first.1.solved, stepped.solved), ..stepped })
    }

    /// A step; with implicit Euler from where bodies are if they are to be `moved_on`.
    fn step_once(&mut self, step: Interval<'_>, moved_on: bool) -> (Kinematics, Stepped) {
        let (Interval { start, times, h }, before) = (step, &{ self.energies });
        let mut motion = start.clone();
        let mut full = self.contacts(step, &step.ahead());
        let turned = self.frame.volume > 0.0 && self.solver.inventory.inverted > 0;
        // Frozen contacts continue linearly, so surfaces that are being separated would be thrown apart.
        let through = full.iter().any(|contact| contact.is_penetrating(&start.x, h));
        let touched = full.iter().any(|contact| contact.clearance(&start.x, h) < 0.0);
        let guess = match (moved_on, self.frame.force_implicit_euler || turned) {
            (true, _) => Guess::MovedOn,
            (_, true) => Guess::Start,
            _ => Guess::Predicted,
        };
        let euler = start.carried.euler_steps_left > 0 || guess != Guess::Predicted || through;
        motion.carried.euler_steps_left = start.carried.euler_steps_left.saturating_sub(1);
        let (end, after) = if euler || self.frame.integrator == Integrator::Euler {
            (self.euler(step, &mut full, guess), None)
        } else {
            self.tr_bdf2_or_euler(step, before, &mut full, &mut motion.carried.euler_steps_left)
        };
        let StepEnd { x, v, errors, solved } = end;
        (motion.x, motion.v) = (x, v);
        let mut stepped = Stepped { solved, ..Stepped::default() };
        let report = &mut stepped.report;
        report.euler_steps = u32::from(after.is_none());
        let heaps = &self.solver.heaps;
        let counted = errors.iter().enumerate().filter(|(particle, _)| heaps.get(*particle) != Some(&true));
        report.error_estimate = counted.map(|error| error.1.norm_squared()).fold(0.0, f64::max).sqrt();
        if full.iter().any(|c| (c.clearance(&start.x, h) < 0.0) != (c.clearance(&motion.x, 0.0) < 0.0)) {
            motion.carried.euler_steps_left = motion.carried.euler_steps_left.max(1);
        }
        (report.contacts, report.deepest_overlap) = self.solver.active_contacts();
        report.deepest_overlap = report.deepest_overlap.max(stepped.solved.deepest);
        report.jammed = full.iter().filter(|contact| contact.is_jammed(&motion.x)).count() as u32;
        if report.jammed > 0 {
            // Shorter steps would not help.
            stepped.solved.unmet = 0.0;
        }
        let discontinuous = after.is_none() || report.contacts > 0;
        let acceleration =
            |(v, before): (&DVec3, &DVec3)| if discontinuous { DVec3::zeros() } else { (v - before) / h };
        motion.acceleration = motion.v.iter().zip(&start.v).map(acceleration).collect();
        motion.loads = self.loads(&full, |contact| contact.load_at(&motion.x, 0.0));
        report.stopped = self.keep_finite(start, &mut motion);
        // Infinity is no limit, not even times an approach of 0.
        let bounce = self.frame.bounce.filter(|bounce| bounce.is_finite());
        let slowed = bounce.and_then(|bounce| self.limit_bounce(bounce, &full, step, &mut motion));
        self.refresh_inventory(&motion.x);
        stepped.after = match after.filter(|_| report.stopped == 0 && slowed.is_none()) {
            Some(energies) => energies,
            None => measure(self.solver, &self.context, times[1], [&motion.x, &motion.v], false),
        };
        if self.undriven(times) {
            self.remove_energy_gain(before, &mut motion, &mut stepped);
            // What contacts had stored, they return.
            if !touched {
                stepped.energy_gained = (stepped.after.sum() - before.sum()).min(-motion.carried.energy_budget);
            }
        } else {
            motion.carried.energy_budget = 0.0;
        }
        let taken = TakenStep { interval: step, end: &motion, contacts: &full };
        stepped.impact_error = self.impact_error(taken, &errors);
        let lost = self.energy_lost([before, &stepped.after], taken);
        stepped.report.energy_lost = lost + slowed.unwrap_or(0.0);
        (motion, stepped)
    }

    /// A step of TR-BDF2 with frozen contacts, repeated with implicit Euler where that fails, gains energy, or the set of
    /// active contacts or of thin tetrahedra changes. Returns the energies at the end too, if it was not repeated.
    fn tr_bdf2_or_euler(
        &mut self,
        step: Interval<'_>,
        before: &Energies,
        contacts: &mut Vec<ContactConstraint>,
        euler_steps_left: &mut u32,
    ) -> (StepEnd, Option<Energies>) {
        let (Interval { start, times, h }, size) = (step, self.context.body.size);
        let frozen: Vec<ContactConstraint> = contacts.iter().map(|c| c.frozen(&start.x, &start.v, h, size)).collect();
        let (mut gained, mut active_set_unchanged) = (false, true);
        let solved = match self.tr_bdf2(step, &frozen) {
            Err(halfway) => halfway,
            Ok(mut end) => {
                let energies = measure(self.solver, &self.context, times[1], [&end.x, &end.v], true);
                let gain = energies.sum() - before.sum();
                gained = self.undriven(times) && gain > GAIN * before.scale().max(energies.kinetic - before.kinetic);
                active_set_unchanged = frozen.iter().all(|contact| contact.active_set_unchanged(&end.x, &end.v));
                if active_set_unchanged {
                    let (found, missed) = self.find_missed(contacts, step, &end.x);
                    end.solved.deepest = deepest(&found, &end.x);
                    active_set_unchanged = !missed;
                }
                let thinned = active_set_unchanged && self.solver.watch_thin(&self.context, &end.x);
                if !(end.solved.failed || gained || !active_set_unchanged || thinned) && energies.sum().is_finite() {
                    return (end, Some(energies));
                }
                end.solved
            }
        };
        let guess = if solved.failed || gained { Guess::Start } else { Guess::Predicted };
        let mut end = self.euler(step, contacts, guess);
        end.solved = repeated(solved, end.solved);
        *euler_steps_left = if active_set_unchanged { 0 } else { EULER_STEPS_AFTER_CHANGE };
        (end, None)
    }

    /// Takes stock of the tetrahedra at `x`, for the next step.
    pub(super) fn refresh_inventory(&mut self, x: &[DVec3]) {
        let seen = self.solver.latest_inventory.take();
        self.solver.inventory = seen.unwrap_or_else(|| Inventory::new(self.context.body, x, self.context.volumes));
    }

    /// Whether nothing external but constant gravity and resting goals did work in the step between two `times`: contacts
    /// may be near, but not closed.
    fn undriven(&self, times: [f64; 2]) -> bool {
        !self.context.external.drives(times)
            && self.solver.contact_states.iter().all(|state| state.mode == ContactMode::Open)
    }

    /// Stops particles whose result is not finite where they were; returns how many.
    fn keep_finite(&mut self, start: &Kinematics, motion: &mut Kinematics) -> u32 {
        let mut stopped = 0;
        for particle in 0..motion.x.len() {
            if !motion.x[particle].iter().chain(motion.v[particle].iter()).all(|x| x.is_finite()) {
                (motion.x[particle], motion.v[particle]) = (start.x[particle], DVec3::zeros());
                motion.acceleration[particle] = DVec3::zeros();
                stopped += 1;
                self.solver.latest_inventory = None;
            }
        }
        stopped
    }

    /// Slows particles relative to their mean motion if the step gained energy.
    fn remove_energy_gain(&mut self, before: &Energies, motion: &mut Kinematics, stepped: &mut Stepped) {
        /// Fraction of the energy that is rounding.
        const ROUNDING: f64 = 1e-9;
        /// Largest budget of previously dissipated energy, as a fraction of the energy.
        const MOST_BUDGET: f64 = 2e-3;
        let after = &mut stepped.after;
        let gained = after.sum() - before.sum();
        let budget = &mut motion.carried.energy_budget;
        *budget = (*budget - gained).min(MOST_BUDGET * after.scale());
        if *budget >= -ROUNDING * before.scale().max(after.scale()) {
            return;
        }
        let body = self.context.body;
        let held = &self.context.external.held;
        // Takes energy from the deformation first, then from all motion but translation: momentum is conserved.
        for turning in [true, false] {
            let gained = -*budget;
            let mut moved = motion.v.clone();
            for piece in body.pieces() {
                let rigid = RigidMotion::new(body, held, piece, [&motion.x, &motion.v, &motion.acceleration]);
                let rigid = if turning { rigid } else { rigid.without_rotation() };
                for particle in rigid.particles.clone() {
                    moved[particle] = rigid.velocity(motion.x[particle]);
                }
            }
            let own = |v: &[DVec3], particle: usize| v[particle] - moved[particle];
            let inner: f64 = (0..body.len())
                .map(|particle| 0.5 * body.mass[particle] * own(&motion.v, particle).norm_squared())
                .sum();
            if !(gained > 0.0 && inner > 0.0) {
                continue;
            }
            let keep = ((inner - gained) / inner).max(0.0).sqrt();
            for particle in (0..body.len()).filter(|particle| !held[*particle]) {
                motion.v[particle] = moved[particle] + own(&motion.v, particle) * keep;
            }
            let kinetic = kinetic(body, &motion.v);
            *budget += after.kinetic - kinetic;
            stepped.report.energy_removed += after.kinetic - kinetic;
            after.kinetic = kinetic;
        }
    }
}

/// Kinetic energy, joules.
pub(super) fn kinetic(body: &SoftBody, v: &[DVec3]) -> f64 {
    v.iter().zip(&body.mass).map(|(v, mass)| 0.5 * mass * v.norm_squared()).sum()
}

/// Depth of the deepest contact at `x`, metres below its gap; 0 without any.
pub(super) fn deepest(contacts: &[ContactConstraint], x: &[DVec3]) -> f64 {
    contacts.iter().map(|contact| -contact.clearance(x, 0.0)).fold(0.0, f64::max)
}

/// Outcome of a solve that was taken again, with the work of both.
fn repeated(first: Solved, again: Solved) -> Solved {
    Solved { failed: again.failed, residual: again.residual, ..sum(first, again) }
}

pub(super) fn sum(a: Solved, b: Solved) -> Solved {
    Solved {
        newton: a.newton + b.newton,
        cg: a.cg + b.cg,
        caps: a.caps + b.caps,
        residual: a.residual.max(b.residual),
        failed: a.failed || b.failed,
        enough: a.enough.max(b.enough),
        ..b
    }
}
