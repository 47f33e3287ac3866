//! External forces and constraints: gravity, drag, goals, pins.
//!
//! All are evaluated at the time of each stage: gravity and drag as the caller gives them for that time, while goals and
//! pins move linearly through the frame.

use super::body::SoftBody;
use super::frame::SolverFrame;
use numerics::vector::DVec3;

/// Pulls a particle to a target: a spring of `strength`·mass N/m with a parallel dashpot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoalSpring {
    /// The particle, by the caller's index.
    pub particle: u32,
    /// Target at the start and at the end of the frame, metres.
    pub between: [[f64; 3]; 2],
    /// Spring stiffness ÷ mass, 1/s².
    pub strength: f64,
    /// Damping of motion relative to the target, ÷ mass, 1/s.
    pub damping: f64,
}

/// Prescribes the position of a particle exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pin {
    /// The particle, by the caller's index.
    pub particle: u32,
    /// Position at the start and at the end of the frame, metres.
    pub between: [[f64; 3]; 2],
}

/// What acts on all particles alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ambient {
    /// Acceleration by gravity, m/s².
    pub gravity: [f64; 3],
    /// Damping of all motion, 1/s.
    pub drag: f64,
}

/// [`Ambient`] at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    /// A fraction of the frame.
    time: f64,
    pub(super) gravity: DVec3,
    drag: f64,
}

/// External forces of one frame, in the solver's order.
#[derive(Clone)]
pub(super) struct ExternalForces<'a> {
    /// Gravity and drag at the end of the frame.
    at_end: Ambient,
    /// The same at a fraction of the frame, if they vary within it.
    during: Option<&'a (dyn Fn(f64) -> Ambient + Sync)>,
    /// Length of the frame, seconds.
    seconds: f64,
    /// The goal of each particle, or the sum of several; empty without goals.
    goals: Vec<Option<GoalSpring>>,
    pub(super) held: Vec<bool>,
    pins: Vec<(u32, [[f64; 3]; 2])>,
}

impl<'a> ExternalForces<'a> {
    pub(super) fn new(body: &SoftBody, frame: &SolverFrame<'a>, seconds: f64) -> Self {
        let SolverFrame { goals, pins, gravity, drag, during, .. } = *frame;
        let mut external = Self {
            at_end: Ambient { gravity, drag },
            during,
            seconds,
            goals: if goals.is_empty() { Vec::new() } else { vec![None; body.len()] },
            held: vec![false; body.len()],
            pins: Vec::with_capacity(pins.len()),
        };
        for goal in goals.iter().filter(|goal| goal.strength > 0.0) {
            let particle = body.order.index_of[goal.particle as usize] as usize;
            let goal = GoalSpring { damping: goal.damping.max(0.0), ..*goal };
            let slot = &mut external.goals[particle];
            *slot = Some(slot.map_or(goal, |known| known.joined(&goal)));
        }
        for pin in pins {
            let particle = body.order.index_of[pin.particle as usize];
            if !std::mem::replace(&mut external.held[particle as usize], true) {
                external.pins.push((particle, pin.between));
            }
        }
        external
    }

    /// Gravity and drag at `time`, a fraction of the frame.
    pub(super) fn at(&self, time: f64) -> Moment {
        let Ambient { gravity, drag } = self.during.map_or(self.at_end, |during| during(time));
        Moment { time, gravity: gravity.into(), drag: drag.max(0.0) }
    }

    /// Whether gravity changes or a goal or pin moves between two `times`, fractions of the frame, so that it can do work
    /// that is not in the energies.
    pub(super) fn drives(&self, times: [f64; 2]) -> bool {
        let moves = |between: &[[f64; 3]; 2]| between[0] != between[1];
        let [before, after] = times.map(|time| self.at(time).gravity);
        before != after
            || self.pins.iter().any(|pin| moves(&pin.1))
            || self.goals.iter().flatten().any(|goal| moves(&goal.between))
    }

    /// Moves pinned particles to their positions at `time`, a fraction of the frame, and sets `z` so that (x − z)/a
    /// is their velocity.
    pub(super) fn hold(&self, time: f64, x: &mut [DVec3], z: &mut [DVec3], a: f64) {
        for (particle, between) in &self.pins {
            let particle = *particle as usize;
            x[particle] = lerp(between, time);
            z[particle] = x[particle] - self.velocity(between) * a;
        }
    }

    /// External force on a particle, newtons.
    #[inline(always)]
    pub(super) fn force(&self, particle: usize, mass: f64, now: &Moment, x: DVec3, v: DVec3) -> DVec3 {
        let mut sum = now.gravity - v * now.drag;
        if let Some(goal) = self.goal(particle) {
            sum += (lerp(&goal.between, now.time) - x) * goal.strength;
            sum += (self.velocity(&goal.between) - v) * goal.damping;
        }
        sum * mass
    }

    /// Its contribution to the diagonal of the system in a stage of `a`, kilograms.
    #[inline(always)]
    pub(super) fn inertia(&self, particle: usize, mass: f64, now: &Moment, a: f64) -> f64 {
        let mut sum = a * now.drag;
        if let Some(goal) = self.goal(particle) {
            sum += a * a * goal.strength + a * goal.damping;
        }
        sum * mass
    }

    /// Potential of [`ExternalForces::force`] in a stage in which `v` = (x − z)/a; with `a` = 0 the stored energy,
    /// joules.
    pub(super) fn energy(&self, particle: usize, mass: f64, now: &Moment, a: f64, x: DVec3, v: DVec3) -> f64 {
        let mut sum = -now.gravity.dot(&x) + 0.5 * a * now.drag * v.norm_squared();
        sum += self.goal_energy(particle, now.time, x);
        if let Some(goal) = self.goal(particle) {
            sum += 0.5 * a * goal.damping * (self.velocity(&goal.between) - v).norm_squared();
        }
        sum * mass
    }

    /// Energy in a particle's goal, joules a kilogram.
    pub(super) fn goal_energy(&self, particle: usize, time: f64, x: DVec3) -> f64 {
        self.goal(particle).map_or(0.0, |goal| 0.5 * goal.strength * (lerp(&goal.between, time) - x).norm_squared())
    }

    /// Work on a particle that moved by `dx` to `x` in a step of `h` seconds between two moments: that of drag, of changes
    /// of gravity (half-way), of a goal's dashpot and of a goal's motion. Gravity and springs of goals have potentials
    /// besides. Joules.
    pub(super) fn work(&self, particle: usize, mass: f64, step: ([&Moment; 2], f64), x: DVec3, dx: DVec3) -> f64 {
        let ([before, now], h) = step;
        let mut sum = -now.drag * dx.norm_squared() / h - (now.gravity - before.gravity).dot(&(x - dx * 0.5));
        if let Some(goal) = self.goal(particle) {
            let moved = self.velocity(&goal.between) * h;
            sum += goal.strength * (lerp(&goal.between, now.time) - x).dot(&moved);
            sum += goal.damping * (moved - dx).dot(&dx) / h;
        }
        sum * mass
    }

    /// The pinned particles that move.
    pub(super) fn moving_pins(&self) -> impl Iterator<Item = usize> {
        self.pins.iter().filter(|(_, between)| between[0] != between[1]).map(|(particle, _)| *particle as usize)
    }

    #[inline(always)]
    fn goal(&self, particle: usize) -> Option<&GoalSpring> {
        self.goals.get(particle)?.as_ref()
    }

    fn velocity(&self, between: &[[f64; 3]; 2]) -> DVec3 {
        let between = between.map(DVec3::from);
        if self.seconds > 0.0 { (between[1] - between[0]) / self.seconds } else { DVec3::zeros() }
    }
}

impl GoalSpring {
    /// The sum of two goals of one particle.
    fn joined(&self, other: &Self) -> Self {
        let (strength, damping) = (self.strength + other.strength, self.damping + other.damping);
        let (mine, others) = (self.strength / strength, other.strength / strength);
        let end = |end: usize| DVec3::from(self.between[end]) * mine + DVec3::from(other.between[end]) * others;
        Self { between: [end(0).into(), end(1).into()], strength, damping, ..*self }
    }
}

/// Linear interpolation, exact at both ends.
#[inline(always)]
fn lerp(between: &[[f64; 3]; 2], time: f64) -> DVec3 {
    let between = between.map(DVec3::from);
    if time >= 1.0 { between[1] } else { between[0] + (between[1] - between[0]) * time }
}
