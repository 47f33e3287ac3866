//! One frame of a body: input, report, and step size control.

use super::body::SoftBody;
use super::energy::{Energies, measure};
use super::external::{Ambient, ExternalForces, GoalSpring, Pin};
use super::finder::{ContactFinder, ContactQuery};
use super::heap::heaps;
use super::springs::{self, RestLengths};
use super::stage::{BodySolver, FrameContext};
use super::state::State;
use super::step::{Interval, Kinematics, Stepped, Stepper};
use super::volume::{Inventory, Volumes};

/// Largest number of steps in a frame, and of parts into which a step is cut at once.
const MOST_STEPS: u32 = 256;
const MOST_PARTS: f64 = 16.0;

/// Time integration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Integrator {
    /// TR-BDF2, second order, one Newton iteration a stage; implicit Euler for steps that start out of balance.
    Default,
    /// TR-BDF2 with steps chosen so that the estimated error of a frame stays below `tolerance` of the body's size.
    Accurate {
        /// Fraction of the body's size.
        tolerance: f64,
    },
    /// Implicit Euler with line search: first order, damps all motion.
    Euler,
}

/// Input for one frame.
#[derive(Clone, Copy)]
pub struct SolverFrame<'a> {
    /// Length of the frame, seconds; 0 does nothing.
    pub seconds: f64,
    /// Acceleration by gravity at the end of the frame, m/s².
    pub gravity: [f64; 3],
    /// Damping of all motion at the end of the frame, 1/s.
    pub drag: f64,
    /// Gravity and drag at a fraction of the frame, where they vary within it; `None`: they are constant.
    pub during: Option<&'a (dyn Fn(f64) -> Ambient + Sync)>,
    /// Strength of volume preservation, 0…1.
    pub volume: f64,
    /// Soft targets for particles.
    pub goals: &'a [GoalSpring],
    /// Prescribed positions of particles.
    pub pins: &'a [Pin],
    /// Contact detection; `None` without contacts.
    pub contacts: Option<&'a dyn ContactFinder>,
    /// Time integration.
    pub integrator: Integrator,
    /// Number of steps; 0: one, cut repeatedly where contacts stay too deep, and for impacts that bounce.
    pub substeps: u32,
    /// The largest speed at which bodies leave what they hit ÷ the speed at which they approached it; `None`: what the
    /// material gives. With 0 or infinity impacts take no further steps.
    pub bounce: Option<f64>,
    /// Whether to step with implicit Euler throughout: for frames that start out of balance, for example after rest
    /// lengths changed.
    pub force_implicit_euler: bool,
    /// Asked again and again: whether the frame is no longer wanted. It then ends soon, with a state of no use.
    pub cancelled: &'a (dyn Fn() -> bool + Sync),
}

impl Default for SolverFrame<'_> {
    fn default() -> Self {
        Self {
            seconds: 1.0 / 24.0,
            gravity: [0.0, -9.81, 0.0],
            drag: 0.0,
            during: None,
            volume: 1.0,
            goals: &[],
            pins: &[],
            contacts: None,
            integrator: Integrator::Default,
            substeps: 0,
            bounce: None,
            force_implicit_euler: false,
            cancelled: &|| false,
        }
    }
}

/// Outcome of one frame.
#[must_use]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameReport {
    /// Newton iterations.
    pub newton: u32,
    /// Iterations of linear solves.
    pub cg: u32,
    /// The largest final ÷ initial residual of a stage.
    pub residual: f64,
    /// Solves that reached their limit of iterations while particles still moved by more than 1e-4 of the size of the
    /// bodies, and steps that left contacts too deep.
    pub caps_hit: u32,
    /// Steps of [`Integrator::Accurate`] that were accepted with a larger estimated error than its tolerance allows.
    pub tolerance_missed: u32,
    /// Steps with an impact that were not cut as short as its bounce needs, because the frame had taken too many Newton
    /// iterations.
    pub uncut_impacts: u32,
    /// Steps in which an obstacle near a body turned farther than contacts can follow.
    pub fast_turns: u32,
    /// Estimated error of positions that the frame added, metres: the sum over its steps of the largest error of a
    /// particle that is not of a heap, whose motion no step is short enough for.
    pub error_estimate: f64,
    /// Kinetic energy, joules.
    pub kinetic: f64,
    /// Elastic energy of springs, joules.
    pub elastic: f64,
    /// Energy in pressures and thin tetrahedra, joules.
    pub volume_energy: f64,
    /// Energy in goals, joules.
    pub goal_energy: f64,
    /// Energy removed to prevent a spurious gain, joules.
    pub energy_removed: f64,
    /// Energy lost in other ways than by damping, drag and friction, joules: by time stepping, by contacts, and by limits
    /// on bounces and energy.
    pub energy_lost: f64,
    /// That ÷ the energy there was, kinetic and stored; 0 if bodies moved less than half as fast as gravity moves them in a
    /// frame.
    pub lost_share: f64,
    /// Volume ÷ rest volume.
    pub volume_ratio: f64,
    /// The largest length ÷ rest length of a spring, or its reciprocal.
    pub worst_stretch: f64,
    /// Inverted tetrahedra.
    pub inverted_tets: u32,
    /// Steps taken.
    pub substeps: u32,
    /// How many of them were implicit Euler.
    pub euler_steps: u32,
    /// Closed contacts.
    pub contacts: u32,
    /// Depth of the deepest contact below its gap, metres.
    pub deepest_overlap: f64,
    /// Closed contacts with obstacles that leave no room between them and the ground: their depth is accepted.
    pub jammed: u32,
    /// Particles whose result was not finite: they were stopped where they were.
    pub stopped: u32,
}

impl BodySolver {
    /// Advances `state` by one frame.
    ///
    /// # Panics
    /// If `state` does not fit `body`, a goal or pin has an index out of range, or `body` has another
    /// topology than in [`BodySolver::new`].
    pub fn step(&mut self, body: &SoftBody, state: &mut State, frame: &SolverFrame<'_>) -> FrameReport {
        assert!(state.fits(body), "a state of another body");
        if body.order.clusters.is_parallel() {
            // Inside of a scope, starting a parallel loop needs no hand-over between threads.
            rayon::scope(|_| self.step_here(body, state, frame))
        } else {
            self.step_here(body, state, frame)
        }
    }

    fn step_here(&mut self, body: &SoftBody, state: &mut State, frame: &SolverFrame<'_>) -> FrameReport {
        let seconds = if frame.seconds.is_finite() { frame.seconds.max(0.0) } else { 0.0 };
        let external = ExternalForces::new(body, frame, seconds);
        let lengths = state.rest_lengths();
        let rest = RestLengths { lengths: &lengths, torn: &state.torn };
        self.volumes = Volumes::new(body, frame.volume, &state.volumes);
        self.system.regions.idle = self.volumes.is_disabled();
        springs::particle_stiffness(body, &rest, &mut self.particle_stiffness);
        self.heaps = heaps(body, external.at(1.0).gravity);
        self.system.held.clone_from(&external.held);
        self.system.isolated = self.particle_stiffness.iter().map(|k| *k == 0.0).collect();
        let context =
            FrameContext { body, external: &external, rest, volumes: &state.volumes, cancelled: frame.cancelled };
        state.acceleration.resize(body.len(), [0.0; 3]);
        let acceleration = body.to_solver_order(&state.acceleration);
        let mut loads = vec![0.0; body.contact_point_count()];
        for (point, load) in body.contact_indices().zip(&state.loads) {
            loads[point] = *load;
        }
        let (x, v) = (body.to_solver_order(&state.positions), body.to_solver_order(&state.velocities));
        let mut motion = Kinematics { x, v, acceleration, loads, carried: std::mem::take(&mut state.carried) };
        self.inventory = Inventory::new(body, &motion.x, &state.volumes);
        self.lengths.clear();
        let before = measure(self, &context, 0.0, [&motion.x, &motion.v], false);
        self.lengths.clone_from(&self.lengths_now);
        self.cached = std::mem::take(&mut state.cached);
        let mut stepper = Stepper {
            solver: self,
            context,
            frame,
            seconds,
            tolerance: match frame.integrator {
                Integrator::Accurate { tolerance } => Some(tolerance.max(1e-12) * body.size),
                Integrator::Default | Integrator::Euler => None,
            },
            energies: before,
            report: FrameReport::default(),
        };
        if seconds > 0.0 && !body.is_empty() {
            stepper.advance_in(frame.substeps.clamp(1, MOST_STEPS), &mut motion, [0.0, 1.0], f64::INFINITY);
        }
        let (mut report, after) = (stepper.report, stepper.energies);
        (report.inverted_tets, report.volume_ratio) = (self.inventory.inverted, self.inventory.ratio);
        (report.kinetic, report.elastic) = (after.kinetic, after.springs);
        (report.volume_energy, report.goal_energy) = (after.volumes, after.goals);
        let springs = (0..).zip(self.lengths.iter().zip(&lengths));
        let stretches = springs.filter(|(spring, (_, rest))| context.rest.is_intact(*spring) && **rest > 0.0);
        let stretches = stretches.map(|(_, (now, rest))| now / rest);
        report.worst_stretch = stretches.map(|stretch| stretch.max(1.0 / stretch)).fold(1.0, f64::max);
        report.lost_share =
            lost_share(report.energy_lost, [&before, &after], body, external.at(1.0).gravity.norm() * seconds);
        (state.cached, state.carried) = (std::mem::take(&mut self.cached), motion.carried);
        state.loads.clear();
        state.loads.extend(body.contact_indices().map(|point| motion.loads[point]));
        for (caller, particle) in body.order.index_of.iter().enumerate() {
            state.positions[caller] = motion.x[*particle as usize].into();
            state.velocities[caller] = motion.v[*particle as usize].into();
            state.acceleration[caller] = motion.acceleration[*particle as usize].into();
        }
        report
    }
}

impl Stepper<'_> {
    /// Takes equal parts of a step between `times`.
    fn advance_in(&mut self, parts: u32, motion: &mut Kinematics, times: [f64; 2], deepest: f64) {
        let at = |part: u32| times[0] + (times[1] - times[0]) * f64::from(part) / f64::from(parts);
        for part in (0..parts).take_while(|_| !(self.frame.cancelled)()) {
            self.advance(motion, [at(part), at(part + 1)], deepest);
        }
    }

    /// Takes one step between `times`, or several parts of it: if contacts stay too deep, if it loses much of a bounce, or
    /// if its estimated error is too large. Short steps are only cut further for deep contacts if that reduces the depth
    /// below `deepest`, metres.
    fn advance(&mut self, motion: &mut Kinematics, times: [f64; 2], deepest: f64) {
        /// Largest depth after halving ÷ before for which another halving is worth while.
        const HELPS: f64 = 0.9;
        /// Steps longer than this fraction of the frame are always halved.
        const SHORT: f64 = 1.0 / 16.0;
        let share = times[1] - times[0];
        let shortest = share * f64::from(MOST_STEPS) < 2.0;
        let step = Interval { start: motion, times, h: share * self.seconds };
        let turns = self.least_steps(step);
        if turns > 1 && self.frame.substeps == 0 && !shortest {
            return self.advance_in(turns.min((share * f64::from(MOST_STEPS)) as u32), motion, times, deepest);
        }
        self.report.fast_turns += u32::from(turns > 1);
        let turned = self.solver.inventory.inverted > 0;
        let (mut end, mut stepped) = self.step(step);
        self.report.newton += stepped.solved.newton;
        self.report.cg += stepped.solved.cg;
        let unmet = stepped.solved.unmet;
        let allowed = self.tolerance.map_or(f64::INFINITY, |tolerance| tolerance * share);
        let (wanted, mut parts) = match self.tolerance {
            Some(_) => (1, accurate_parts(&stepped, allowed)),
            None => self.parts_of_impact(&stepped, turned),
        };
        let no_help = share <= SHORT && unmet > HELPS * deepest;
        if (unmet > 0.0 || stepped.solved.failed) && !no_help {
            parts = parts.max(2);
        }
        // What went through while solves converged has a step that is too long, not contacts in conflict. A part that follows
        // an impact in the same frame would otherwise pass what it meets.
        let missed = stepped.solved.passed && stepped.solved.caps == 0 && share > SHORT;
        let is_over = self.is_spent() && !missed || shortest;
        if self.frame.substeps > 0 || (self.frame.cancelled)() || is_over || parts < 2 {
            self.report.uncut_impacts += u32::from(wanted > 1 && !shortest);
            self.report.tolerance_missed += u32::from(stepped.report.error_estimate > allowed);
            if unmet > 0.0 {
                self.keep_sides(step, &mut end, &mut stepped);
            }
            *motion = end;
            return self.accept(&stepped);
        }
        self.refresh_inventory(&motion.x);
        let parts = parts.min((share * f64::from(MOST_STEPS)) as u32).max(2);
        let deepest = if unmet > 0.0 { unmet } else { deepest };
        self.advance_in(parts, motion, times, deepest);
    }

    /// Whether the frame took so many Newton iterations that steps are accepted, so that it ends. Where `substeps` sets their
    /// number, each is solved like the first.
    pub(super) fn is_spent(&self) -> bool {
        /// By default and with heaps, and with a tolerance.
        const MOST_NEWTON: [u32; 2] = [400, 4000];
        let precise = self.tolerance.is_some() && self.solver.heaps.is_empty();
        self.frame.substeps == 0 && self.report.newton >= MOST_NEWTON[usize::from(precise)]
    }

    /// The number of parts that a step has to be cut into because of obstacles that turn.
    fn least_steps(&self, step: Interval<'_>) -> u32 {
        let Some(contacts) = self.frame.contacts else { return 1 };
        let [from, to] = [&step.start.x, &step.ahead()].map(|x| self.context.body.contact_points(x));
        contacts.least_steps(&ContactQuery { from: &from, to: &to, times: step.times })
    }

    /// The number of parts that a step has to be cut into so that an impact keeps its bounce, and how many of them the
    /// frame can still pay for. `turned` if it started with inverted tetrahedra.
    fn parts_of_impact(&self, stepped: &Stepped, turned: bool) -> (u32, u32) {
        /// Relative error of the speed of a body in contact.
        const IMPACT_ERROR: f64 = 0.1;
        /// Energy ÷ (E × volume) above which a body is crushed.
        const CRUSHED: f64 = 10.0;
        /// Newton iterations of a frame after which steps are no longer cut for that.
        const MOST_NEWTON: u32 = 350;
        let frame = self.frame;
        // What is crushed, or starts out of balance, does not bounce.
        let crushed = self.energies.scale() > CRUSHED * self.context.body.modulus_times_volume();
        let bounces = frame.integrator == Integrator::Default
            && frame.bounce.is_none_or(|bounce| bounce > 0.0 && bounce.is_finite())
            && !(frame.substeps > 0 || frame.force_implicit_euler || turned || crushed || stepped.report.jammed > 0);
        let wanted = if bounces { (stepped.impact_error / IMPACT_ERROR).clamp(1.0, MOST_PARTS) } else { 1.0 };
        let wanted = (wanted.ceil() as u32).next_power_of_two();
        // As if a part cost what the whole did.
        let left = MOST_NEWTON.saturating_sub(self.report.newton) / stepped.solved.newton.max(1);
        (wanted, wanted.min(1 << left.max(1).ilog2()))
    }

    /// Keeps the result of a step.
    fn accept(&mut self, stepped: &Stepped) {
        let (solver, report) = (&mut *self.solver, &mut self.report);
        std::mem::swap(&mut solver.lengths, &mut solver.lengths_now);
        self.energies = stepped.after;
        report.caps_hit += stepped.solved.caps + u32::from(stepped.solved.unmet > 0.0);
        report.residual = report.residual.max(stepped.solved.residual);
        report.error_estimate += stepped.report.error_estimate;
        report.energy_removed += stepped.report.energy_removed;
        report.energy_lost += stepped.report.energy_lost;
        report.substeps += 1;
        report.euler_steps += stepped.report.euler_steps;
        report.stopped = report.stopped.max(stepped.report.stopped);
        report.contacts = stepped.report.contacts;
        report.deepest_overlap = report.deepest_overlap.max(stepped.report.deepest_overlap);
        report.jammed = report.jammed.max(stepped.report.jammed);
    }
}

/// The number of parts that a step has to be cut into so that its estimated error is `allowed`, metres.
fn accurate_parts(stepped: &Stepped, allowed: f64) -> u32 {
    /// Safety factor.
    const RESERVE: f64 = 0.9;
    let Stepped { report: FrameReport { error_estimate, euler_steps, .. }, .. } = *stepped;
    if error_estimate <= allowed {
        return 1;
    }
    // The estimate ÷ step size is proportional to the step size for a first-order method, to its square for a second-order
    // one.
    let ratio = error_estimate / allowed;
    let ratio = if euler_steps > 0 { ratio } else { ratio.sqrt() };
    (ratio / RESERVE).ceil().clamp(2.0, MOST_PARTS) as u32
}

/// Energy `lost` in a frame in which gravity adds the speed `falling`, relative to what there was; 0 for slow bodies.
fn lost_share(lost: f64, [before, after]: [&Energies; 2], body: &SoftBody, falling: f64) -> f64 {
    /// Fraction of `falling` that is slow, and of the energy of a crushed body that is little.
    const SLOW: f64 = 0.5;
    const LITTLE: f64 = 1e-6;
    let slow = 0.5 * body.mass.iter().sum::<f64>() * (SLOW * falling) * (SLOW * falling);
    let share = lost / before.scale().max(after.scale() + lost);
    if before.kinetic > slow + LITTLE * body.modulus_times_volume() && share.is_finite() { share } else { 0.0 }
}
