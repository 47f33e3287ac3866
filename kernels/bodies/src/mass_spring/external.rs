//! What moves a body from outside: gravity, drag, goals, pins.
//!
//! All are evaluated within each stage, at the stage's own time; goals and pins go straight from where they are at the
//! step's start to where they are at its end.

use super::body::SoftBody;
use numerics::vector::DVec3;

/// Draws a particle towards a place: a spring of `strength`·mass N/m, and a dashpot beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoalSpring {
    /// Whom.
    pub particle: u32,
    /// Where, at the start and at the end of the frame, metres.
    pub between: [[f64; 3]; 2],
    /// 1/s².
    pub strength: f64,
    /// Against motion other than the goal's own, 1/s.
    pub damping: f64,
}

/// Puts a particle exactly where it says; nothing else moves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pin {
    /// Whom.
    pub particle: u32,
    /// Where, at the start and at the end of the frame, metres.
    pub between: [[f64; 3]; 2],
}

const NONE: u32 = u32::MAX;

/// The drive of one frame, in the solver's order.
#[derive(Clone, Debug)]
pub(super) struct ExternalForces {
    pub(super) gravity: DVec3,
    pub(super) drag: f64,
    /// Seconds the frame has.
    seconds: f64,
    /// Which goal each particle has; empty where there is none.
    goal_of: Vec<u32>,
    goals: Vec<Track>,
    pub(super) held: Vec<bool>,
    pins: Vec<(u32, [DVec3; 2])>,
}

/// A goal, or several of one particle joined: their forces add up to its.
#[derive(Clone, Copy, Debug)]
struct Track {
    between: [DVec3; 2],
    strength: f64,
    damping: f64,
}

impl ExternalForces {
    pub(super) fn new(
        body: &SoftBody,
        gravity: DVec3,
        drag: f64,
        seconds: f64,
        goals: &[GoalSpring],
        pins: &[Pin],
    ) -> Self {
        let mut external = Self {
            gravity,
            drag,
            seconds,
            goal_of: if goals.is_empty() { Vec::new() } else { vec![NONE; body.len()] },
            goals: Vec::with_capacity(goals.len()),
            held: vec![false; body.len()],
            pins: Vec::with_capacity(pins.len()),
        };
        for goal in goals.iter().filter(|goal| goal.strength > 0.0) {
            let particle = body.order.index_of[goal.particle as usize] as usize;
            let track = Track {
                between: goal.between.map(DVec3::from),
                strength: goal.strength,
                damping: goal.damping.max(0.0),
            };
            if external.goal_of[particle] == NONE {
                external.goal_of[particle] = external.goals.len() as u32;
                external.goals.push(track);
            } else {
                external.goals[external.goal_of[particle] as usize].join(&track);
            }
        }
        for pin in pins {
            let particle = body.order.index_of[pin.particle as usize];
            if !std::mem::replace(&mut external.held[particle as usize], true) {
                external.pins.push((particle, pin.between.map(DVec3::from)));
            }
        }
        external
    }

    /// Whether something moves by itself, so that energy may rise.
    pub(super) fn moves(&self) -> bool {
        let moves = |between: &[DVec3; 2]| between[0] != between[1];
        self.pins.iter().any(|pin| moves(&pin.1)) || self.goals.iter().any(|goal| moves(&goal.between))
    }

    /// Puts pinned particles where they are at `time`, a share of the frame, and `z` where (x − z)/a is their pins' velocity.
    pub(super) fn hold(&self, time: f64, x: &mut [DVec3], z: &mut [DVec3], a: f64) {
        for (particle, between) in &self.pins {
            let particle = *particle as usize;
            x[particle] = lerp(between, time);
            z[particle] = x[particle] - self.velocity(between) * a;
        }
    }

    /// What acts on a particle apart from springs, volumes and contacts, newtons.
    #[inline(always)]
    pub(super) fn force(&self, particle: usize, mass: f64, time: f64, x: DVec3, v: DVec3) -> DVec3 {
        let mut sum = self.gravity - v * self.drag;
        if let Some(goal) = self.goal(particle) {
            sum += (lerp(&goal.between, time) - x) * goal.strength;
            sum += (self.velocity(&goal.between) - v) * goal.damping;
        }
        sum * mass
    }

    /// What that resists for steps of `a`, kilograms.
    #[inline(always)]
    pub(super) fn inertia(&self, particle: usize, mass: f64, a: f64) -> f64 {
        let mut sum = a * self.drag;
        if let Some(goal) = self.goal(particle) {
            sum += a * a * goal.strength + a * goal.damping;
        }
        sum * mass
    }

    /// The energy whose slope is [`Drive::force`] where `v` changes by 1/a of what `x` does; with `a` 0 what is stored.
    pub(super) fn energy(&self, particle: usize, mass: f64, time: f64, a: f64, x: DVec3, v: DVec3) -> f64 {
        let mut sum = -self.gravity.dot(&x) + 0.5 * a * self.drag * v.norm_squared();
        sum += self.goal_energy(particle, time, x);
        if let Some(goal) = self.goal(particle) {
            sum += 0.5 * a * goal.damping * (self.velocity(&goal.between) - v).norm_squared();
        }
        sum * mass
    }

    /// What a particle's goal stores, joules a kilogram.
    pub(super) fn goal_energy(&self, particle: usize, time: f64, x: DVec3) -> f64 {
        self.goal(particle).map_or(0.0, |goal| 0.5 * goal.strength * (lerp(&goal.between, time) - x).norm_squared())
    }

    #[inline(always)]
    fn goal(&self, particle: usize) -> Option<&Track> {
        self.goals.get(*self.goal_of.get(particle)? as usize)
    }

    fn velocity(&self, between: &[DVec3; 2]) -> DVec3 {
        if self.seconds > 0.0 { (between[1] - between[0]) / self.seconds } else { DVec3::zeros() }
    }
}

impl Track {
    fn join(&mut self, other: &Self) {
        let strength = self.strength + other.strength;
        let (mine, others) = (self.strength / strength, other.strength / strength);
        self.between = std::array::from_fn(|end| self.between[end] * mine + other.between[end] * others);
        self.strength = strength;
        self.damping += other.damping;
    }
}

/// Exact at both ends.
#[inline(always)]
fn lerp(between: &[DVec3; 2], time: f64) -> DVec3 {
    if time >= 1.0 { between[1] } else { between[0] + (between[1] - between[0]) * time }
}
