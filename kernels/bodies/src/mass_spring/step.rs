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

use super::body::SoftBody;
use super::contact::{ContactConstraint, ContactMode};
use super::energy::{Energies, measure};
use super::frame::{Integrator, SolverFrame};
use super::predictor::{Predictor, RigidMotion};
use super::springs::{distance, drift};
use super::stage::{FrameContext, Newton, Solved, Stage, StageSolver};
use super::state::CachedCoarseFactor;
use super::volume::Inventory;
use numerics::vector::DVec3;

const GAMMA: f64 = 2.0 - std::f64::consts::SQRT_2;
/// Newton iterations of a stage by default.
const MOST: u32 = 4;
/// Newton iterations of a stage in accurate mode.
const MOST_ACCURATE: u32 = 12;
/// Tolerance of Newton's method in accurate mode, as a fraction of that of the frame.
const NEWTON_SHARE: f64 = 0.1;
/// Energy gain of a step, relative to its energy, above which it is repeated with implicit Euler.
const GAIN: f64 = 0.005;
/// Steps of implicit Euler after one in which the set of active contacts changed.
const EULER_STEPS_AFTER_CHANGE: u32 = 4;

/// Motion of all particles, in the solver's order.
#[derive(Clone, Debug)]
pub(super) struct Kinematics {
    pub(super) x: Vec<DVec3>,
    pub(super) v: Vec<DVec3>,
    /// Acceleration in the last step, m/s²; used only by the predictor.
    pub(super) acceleration: Vec<DVec3>,
    /// The last normal force of contacts on each particle, newtons.
    pub(super) loads: Vec<f64>,
}

/// Outcome of a step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stepped {
    pub(super) solved: Solved,
    /// Largest estimated error of a particle, metres.
    pub(super) estimate: f64,
    pub(super) euler: bool,
    /// Whether implicit Euler was used to damp the step, not because of contacts.
    pub(super) damped: bool,
    /// Energy removed to prevent a spurious gain, joules.
    pub(super) energy_removed: f64,
    pub(super) after: Energies,
    pub(super) contacts: u32,
    pub(super) overlap: f64,
    pub(super) stopped: u32,
}

/// What steps work with.
pub(super) struct Stepper<'a> {
    pub(super) solver: &'a mut StageSolver,
    pub(super) context: FrameContext<'a>,
    pub(super) frame: &'a SolverFrame<'a>,
    /// Length of the frame, seconds.
    pub(super) seconds: f64,
    pub(super) cached: &'a mut CachedCoarseFactor,
    /// Number of steps still to be taken with implicit Euler.
    pub(super) euler_steps_left: &'a mut u32,
    /// Energy that steps have dissipated so far, and that rounding in later ones may return, joules.
    pub(super) energy_budget: &'a mut f64,
}

impl Stepper<'_> {
    /// Steps between two `times`, as fractions of the frame. `tolerance`, metres, makes Newton's method converge.
    /// `before` are the energies at the start; `calm` asks for a damped step.
    pub(super) fn step(
        &mut self,
        motion: &mut Kinematics,
        times: [f64; 2],
        before: &Energies,
        tolerance: Option<f64>,
        damp: bool,
    ) -> Stepped {
        let h = (times[1] - times[0]) * self.seconds;
        let body = self.context.body;
        let start = motion.clone();
        let mut stepped = Stepped::default();

        let mut full = match self.frame.contacts {
            Some(_) => {
                let ahead: Vec<DVec3> = start.x.iter().zip(&start.v).map(|(x, v)| x + v * h).collect();
                self.contacts(&start, &ahead, times)
            }
            None => Vec::new(),
        };
        let turned = self.frame.volume > 0.0 && self.solver.inventory.inverted > 0;
        // Frozen contacts continue linearly, so surfaces that are being separated would be thrown apart.
        let through = full.iter().any(|contact| contact.is_penetrating(&start.x, h));
        let force_implicit_euler =
            damp || *self.euler_steps_left > 0 || self.frame.force_implicit_euler || turned || through;
        *self.euler_steps_left = self.euler_steps_left.saturating_sub(1);
        let mut after = None;
        if force_implicit_euler || self.frame.integrator == Integrator::Euler {
            let damped = damp || self.frame.force_implicit_euler || turned;
            (stepped.solved, stepped.estimate) = self.euler(motion, times, &mut full, damped);
            (stepped.euler, stepped.damped) = (true, damped);
        } else {
            let size = body.size;
            let frozen: Vec<ContactConstraint> = full.iter().map(|c| c.frozen(&start.x, &start.v, h, size)).collect();
            (stepped.solved, stepped.estimate) = self.tr_bdf2(motion, times, &frozen, tolerance);
            let energies = measure(self.solver, &self.context, times[1], motion, true);
            let gain = energies.sum() - before.sum();
            let gained = self.undriven() && gain > GAIN * before.scale().max(energies.kinetic - before.kinetic);
            after = Some(energies);
            let mut active_set_unchanged =
                frozen.iter().all(|contact| contact.active_set_unchanged(&motion.x, &motion.v));
            if active_set_unchanged {
                let (found, missed) = self.find_missed(&full, &start, &motion.x, times);
                stepped.solved.deepest = deepest(&found, &motion.x);
                active_set_unchanged = !missed;
            }
            let thinned = active_set_unchanged && self.watch_thin(&motion.x);
            if stepped.solved.failed || gained || !active_set_unchanged || thinned || !energies.sum().is_finite() {
                motion.clone_from(&start);
                let damped = stepped.solved.failed || gained;
                let (again, estimate) = self.euler(motion, times, &mut full, damped);
                let solved = Solved { failed: again.failed, residual: again.residual, ..sum(stepped.solved, again) };
                stepped = Stepped { solved, estimate, euler: true, damped: damped, ..Stepped::default() };
                after = None;
                *self.euler_steps_left = if active_set_unchanged { 0 } else { EULER_STEPS_AFTER_CHANGE };
            }
        }
        if full.iter().any(|c| (c.clearance(&start.x, h) < 0.0) != (c.clearance(&motion.x, 0.0) < 0.0)) {
            *self.euler_steps_left = (*self.euler_steps_left).max(1);
        }
        (stepped.contacts, stepped.overlap) = self.solver.active_contacts();
        stepped.overlap = stepped.overlap.max(stepped.solved.deepest);
        let contact_states = stepped.euler || stepped.contacts > 0;
        let acceleration =
            |(v, before): (&DVec3, &DVec3)| if contact_states { DVec3::zeros() } else { (v - before) / h };
        motion.acceleration = motion.v.iter().zip(&start.v).map(acceleration).collect();
        motion.loads = self.loads(&full, &motion.x);
        self.keep_finite(&start, motion, &mut stepped);
        self.refresh_inventory(motion);
        stepped.after = match after.filter(|_| stepped.stopped == 0) {
            Some(energies) => energies,
            None => measure(self.solver, &self.context, times[1], motion, false),
        };
        if self.undriven() {
            self.remove_energy_gain(before, motion, &mut stepped);
        } else {
            *self.energy_budget = 0.0;
        }
        stepped
    }

    /// Takes stock of the tetrahedra at the current positions, for the next step.
    pub(super) fn refresh_inventory(&mut self, motion: &Kinematics) {
        let seen = self.solver.latest_inventory.take();
        self.solver.inventory =
            seen.unwrap_or_else(|| Inventory::new(self.context.body, &motion.x, self.context.volumes));
    }

    /// Takes stock within a step; returns whether tetrahedra that were not watched are thin at `x`.
    pub(super) fn watch_thin(&mut self, x: &[DVec3]) -> bool {
        if self.solver.volumes.is_disabled() {
            return false;
        }
        let (body, volumes) = (self.context.body, self.context.volumes);
        let seen = Inventory::new(body, x, volumes);
        let thinned = self.solver.inventory.watch(&seen, body, x, volumes);
        self.solver.latest_inventory = Some(seen);
        thinned
    }

    /// Whether nothing external but gravity and resting goals did work in the step: contacts may be near, but not
    /// closed.
    fn undriven(&self) -> bool {
        !self.context.external.moves() && self.solver.contact_states.iter().all(|state| state.mode == ContactMode::Open)
    }

    fn newton(&self, tolerance: Option<f64>) -> Newton {
        match tolerance {
            Some(tolerance) => Newton { most: MOST_ACCURATE, tolerance: NEWTON_SHARE * tolerance },
            None => Newton { most: MOST, tolerance: 0.0 },
        }
    }

    fn tr_bdf2(
        &mut self,
        motion: &mut Kinematics,
        times: [f64; 2],
        contacts: &[ContactConstraint],
        tolerance: Option<f64>,
    ) -> (Solved, f64) {
        let body = self.context.body;
        let h = (times[1] - times[0]) * self.seconds;
        let a = 0.5 * GAMMA * h;
        let middle = times[0] + GAMMA * (times[1] - times[0]);
        let newton = self.newton(tolerance);

        let start = motion.clone();
        let predictor = Predictor::new(body, &self.loose(), &start.x, &start.v, &start.acceleration, h);
        let mut x = predictor.at(2.0 * a);
        let rotational_energy = predictor.rotational_energy();
        let mut stage = Stage {
            y: &[],
            z: &[],
            a,
            time: times[0],
            contacts,
            early: h,
            rotational_energy: &rotational_energy,
            line_search: false,
            index: 0,
        };
        let volumes = self.solver.volumes.drift(body, &motion.x, &motion.v);
        // Lengths and volumes follow the same rules as positions.
        let on_from_start = |solver: &mut StageSolver, seconds: f64| {
            let length = |first, second| {
                let [length, rate] = drift(&motion.x, &motion.v, first, second);
                length + rate * seconds
            };
            let volumes = volumes.iter().map(|[volume, rate]| volume + rate * seconds).collect();
            solver.set_step_start(&self.context, a, length, volumes);
        };
        on_from_start(self.solver, -a);
        let force = self.solver.forces(&self.context, &stage, &motion.x, &motion.v);
        on_from_start(self.solver, a);
        let mut z: Vec<DVec3> = motion.x.iter().zip(&motion.v).map(|(x, v)| x + v * a).collect();
        let y: Vec<DVec3> = (0..x.len())
            .map(|particle| z[particle] + motion.v[particle] * a + force[particle] * (a * a / body.mass[particle]))
            .collect();
        self.pin(&mut x, &mut z, middle, a);
        (stage.y, stage.z, stage.time, stage.early) = (&y, &z, middle, (1.0 - GAMMA) * h);
        let first = self.solver.solve(&self.context, &stage, newton, self.cached, &mut x);
        let v_middle: Vec<DVec3> = x.iter().zip(&z).map(|(x, z)| (x - z) / a).collect();
        let x_middle = x;

        // Weights of the middle and the start in the second backward difference formula.
        let weight = 1.0 / (GAMMA * (2.0 - GAMMA));
        let start_weight = weight * (1.0 - GAMMA) * (1.0 - GAMMA);
        let mix = |middle: &[DVec3], start: &[DVec3]| -> Vec<DVec3> {
            middle.iter().zip(start).map(|(middle, start)| middle * weight - start * start_weight).collect()
        };
        let combined = self.solver.volumes.at(body, &x_middle);
        let combined =
            combined.iter().zip(&volumes).map(|(now, [then, _])| now * weight - then * start_weight).collect();
        let length = |first, second| {
            distance(&x_middle, first, second) * weight - distance(&motion.x, first, second) * start_weight
        };
        self.solver.set_step_start(&self.context, a, length, combined);
        let (mut z, z_rate) = (mix(&x_middle, &motion.x), mix(&v_middle, &motion.v));
        let y: Vec<DVec3> = z.iter().zip(&z_rate).map(|(z, rate)| z + rate * a).collect();
        let mut x = predictor.past(h, GAMMA, &x_middle);
        self.pin(&mut x, &mut z, times[1], a);
        let stage = Stage {
            y: &y,
            z: &z,
            a,
            time: times[1],
            contacts,
            early: 0.0,
            rotational_energy: &rotational_energy,
            line_search: false,
            index: 1,
        };
        let second = self.solver.solve(&self.context, &stage, newton, self.cached, &mut x);
        let v: Vec<DVec3> = x.iter().zip(&z).map(|(x, z)| (x - z) / a).collect();

        let scale = 2.0 * h * (-3.0 * GAMMA * GAMMA + 4.0 * GAMMA - 2.0) / (12.0 * (2.0 - GAMMA));
        let raw = |particle: usize| {
            let bent =
                motion.v[particle] / GAMMA - v_middle[particle] / (GAMMA * (1.0 - GAMMA)) + v[particle] / (1.0 - GAMMA);
            if self.context.external.held[particle] { DVec3::zeros() } else { bent * (scale * body.mass[particle]) }
        };
        let mut error: Vec<DVec3> = (0..x.len()).map(raw).collect();
        let mut solved = sum(first, second);
        if tolerance.is_some() {
            let reached = self.solver.filter(body, self.cached, &mut error);
            solved.cg += reached.iterations;
        } else {
            self.solver.smooth(body, self.cached, &mut error);
        }
        let estimate = error.iter().map(DVec3::norm_squared).fold(0.0, f64::max).sqrt();
        (motion.x, motion.v) = (x, v);
        (solved, estimate)
    }

    /// Particles that do not move with their piece: pinned and isolated ones.
    fn loose(&self) -> Vec<bool> {
        let (held, alone) = (&self.context.external.held, &self.solver.system.isolated);
        (0..held.len()).map(|particle| held[particle] || alone.get(particle) == Some(&true)).collect()
    }

    /// Moves pinned particles to their positions at `time`, with velocities (x − z)/a.
    pub(super) fn pin(&self, x: &mut [DVec3], z: &mut [DVec3], time: f64, a: f64) {
        self.context.external.hold(time, x, z, a);
    }

    /// Stops particles whose result is not finite where they were.
    fn keep_finite(&mut self, start: &Kinematics, motion: &mut Kinematics, stepped: &mut Stepped) {
        for particle in 0..motion.x.len() {
            if !motion.x[particle].iter().chain(motion.v[particle].iter()).all(|x| x.is_finite()) {
                (motion.x[particle], motion.v[particle]) = (start.x[particle], DVec3::zeros());
                motion.acceleration[particle] = DVec3::zeros();
                stepped.stopped += 1;
                self.solver.latest_inventory = None;
            }
        }
    }

    /// Slows particles relative to their mean motion if the step gained energy.
    fn remove_energy_gain(&mut self, before: &Energies, motion: &mut Kinematics, stepped: &mut Stepped) {
        /// Fraction of the energy that is rounding.
        const ROUNDING: f64 = 1e-9;
        /// Largest budget of previously dissipated energy, as a fraction of the energy.
        const MOST_BUDGET: f64 = 2e-3;
        let after = &mut stepped.after;
        let gained = after.sum() - before.sum();
        *self.energy_budget = (*self.energy_budget - gained).min(MOST_BUDGET * after.scale());
        if *self.energy_budget >= -ROUNDING * before.scale().max(after.scale()) {
            return;
        }
        let body = self.context.body;
        let held = &self.context.external.held;
        // Takes energy from the deformation first, then from all motion but translation: momentum is conserved.
        for turning in [true, false] {
            let gained = -*self.energy_budget;
            let mut moved = motion.v.clone();
            for piece in &body.order.pieces {
                let rigid = RigidMotion::new(body, held, piece, &motion.x, &motion.v, &motion.acceleration);
                let rigid = if turning { rigid } else { rigid.shift() };
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
            *self.energy_budget += after.kinetic - kinetic;
            stepped.energy_removed += after.kinetic - kinetic;
            after.kinetic = kinetic;
        }
    }
}

/// Kinetic energy, joules.
fn kinetic(body: &SoftBody, v: &[DVec3]) -> f64 {
    v.iter().zip(&body.mass).map(|(v, mass)| 0.5 * mass * v.norm_squared()).sum()
}

/// Depth of the deepest contact at `x`, metres below its gap; 0 without any.
pub(super) fn deepest(contacts: &[ContactConstraint], x: &[DVec3]) -> f64 {
    contacts.iter().map(|contact| -contact.clearance(x, 0.0)).fold(0.0, f64::max)
}

pub(super) fn sum(a: Solved, b: Solved) -> Solved {
    Solved {
        newton: a.newton + b.newton,
        cg: a.cg + b.cg,
        caps: a.caps + b.caps,
        residual: a.residual.max(b.residual),
        first: b.first,
        failed: a.failed || b.failed,
        enough: a.enough.max(b.enough),
        unmet: b.unmet,
        deepest: b.deepest,
    }
}
