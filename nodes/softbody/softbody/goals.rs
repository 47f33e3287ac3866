//! Which particles goals pull, when, and when goals become the rest shape.
//!
//! A body moves from its start to its first goal, is held there, moves to the next, and is released after the last. A
//! goal with a frame from which it pulls leaves the body free until then, and takes it up wherever it is.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use bodies::mass_spring;
use bodies::tets::bounds;
use engine::prelude::*;
use numerics::masked::Masked;
use numerics::vector::{DVec3, to_f64};
use serde::{Deserialize, Serialize};

use super::setup::{SimulationSetup, StartInputs};
use super::{
    DOUBLED_GOALS, DOUBLED_GOALS_WIRE, EARLY_GOALS, EARLY_GOALS_WIRE, GOAL_MISS, GOAL_MISS_BODY, GOAL_MISS_GOAL,
    GoalOn, IDLE_GOALS, IDLE_GOALS_WIRE,
};
use crate::shared::attributes::{ALWAYS, GOAL_FRAME, GOAL_HOLD, GOAL_SHARE, GOAL_START, GOAL_STRENGTH};

/// A goal of a body.
struct GoalKey<'a> {
    /// Index of its wire.
    index: usize,
    frame: f64,
    /// From when on it pulls.
    start: f64,
    /// For each point of the body.
    strength: Masked<'a, f64>,
    hold: f64,
    positions: &'a [[f32; 3]],
}

/// What goals remember of a simulation.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct GoalHistory {
    /// The bodies on their way to goals that took them up after their start, by index of the goal's wire.
    starts: BTreeMap<usize, GoalStart>,
    /// The smallest distance of a body from a goal while it should have had its shape, relative to the size of the
    /// body, by index of the goal's wire.
    nearest: BTreeMap<usize, Miss>,
}

/// Where a goal took up a body.
#[derive(Serialize, Deserialize)]
struct GoalStart {
    frame: f64,
    /// The particles of the body.
    positions: Vec<[f64; 3]>,
}

/// How far a body is from a goal.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Miss {
    /// Index of the body's wire.
    body: usize,
    distance: f64,
}

/// The goals of each wire of bodies, by frame.
pub(super) struct Goals<'a> {
    of: Vec<Vec<GoalKey<'a>>>,
    setup: &'a SimulationSetup,
    start: f64,
    history: &'a mut GoalHistory,
}

/// The shape that a body leaves.
enum Origin<'a> {
    /// The one at the start of the simulation.
    Rest,
    /// That of the goal before.
    Goal(&'a [[f32; 3]]),
    /// The one in which a goal took it up.
    Found(&'a [[f64; 3]]),
}

/// The target of a body at a time: an interpolation between two shapes, and between the strengths of two goals.
struct GoalSample<'a> {
    from: Origin<'a>,
    to: &'a GoalKey<'a>,
    share: f64,
    /// That of the goal before, if the body comes from its shape.
    strength_before: Option<Masked<'a, f64>>,
}

impl GoalSample<'_> {
    /// How strongly a point of the body is pulled, 1/s².
    fn strength(&self, point: usize) -> f64 {
        let to = self.to.strength.at(point).max(0.0);
        let from = self.strength_before.map_or(to, |before| before.at(point).max(0.0));
        from + (to - from) * self.share
    }
}

/// Critical damping of the motion towards a goal, 1/s.
pub(super) fn damping(strength: f64) -> f64 {
    2.0 * strength.sqrt()
}

impl<'a> Goals<'a> {
    /// From the geometries at the input at a frame; `start` is the first frame of the simulation.
    ///
    /// # Errors
    /// If a goal matches no body or two, or lacks the attributes of Softbody_Goal.
    pub(super) fn of(
        inputs: &StartInputs,
        setup: &'a SimulationSetup,
        goals: &[&'a Component],
        start: f64,
        history: &'a mut GoalHistory,
    ) -> Result<Self> {
        let mut of: Vec<Vec<GoalKey<'a>>> = setup.wires.iter().map(|_| Vec::new()).collect();
        for (index, shape) in goals.iter().enumerate() {
            let wire = owner(inputs, index, shape)?;
            let number = |attribute: Attr<f32>| {
                shape.get(attribute).and_then(|rows| rows.first()).map(|x| f64::from(*x)).ok_or_else(|| {
                    Error::refused(format!("`goals` {index} has no `{}`", attribute.name))
                        .hint("make goals with Softbody_Goal")
                })
            };
            let key = GoalKey {
                index,
                frame: number(GOAL_FRAME)?,
                start: number(GOAL_START).unwrap_or(f64::from(ALWAYS)),
                strength: Masked { value: number(GOAL_STRENGTH)?, mask: shape.get(GOAL_SHARE) },
                hold: number(GOAL_HOLD)?.max(0.0),
                positions: shape.positions(),
            };
            of[wire].extend(key.pulling());
        }
        of.iter_mut().for_each(|keys| keys.sort_by(|a, b| a.frame.total_cmp(&b.frame)));
        Ok(Self { of, setup, start, history })
    }

    /// Lets goals whose time has come take up their bodies before a step between two frames, from particles at
    /// `positions`.
    pub(super) fn start(&mut self, times: [f64; 2], positions: &[[f64; 3]]) {
        let mut starts = std::mem::take(&mut self.history.starts);
        let mut kept = BTreeMap::new();
        for wire in 0..self.of.len() {
            let (before, Some(to)) = self.around(wire, times[1]) else { continue };
            if !to.waits_for(before, self.start) || to.start > times[0] {
                continue;
            }
            let here = || GoalStart { frame: times[0], positions: positions[self.setup.wires[wire].clone()].to_vec() };
            kept.insert(to.index, starts.remove(&to.index).unwrap_or_else(here));
        }
        self.history.starts = kept;
    }

    /// The last goal of a wire's body before a frame, and the first that is not.
    fn around(&self, wire: usize, frame: f64) -> (Option<&GoalKey<'a>>, Option<&GoalKey<'a>>) {
        let keys = &self.of[wire];
        let next = keys.partition_point(|key| key.frame < frame);
        (next.checked_sub(1).map(|index| &keys[index]), keys.get(next))
    }

    /// Adds the goal springs of a step between two frames.
    pub(super) fn pull(&self, times: [f64; 2], on: GoalOn, out: &mut Vec<mass_spring::GoalSpring>) {
        for (wire, particles) in self.setup.wires.iter().enumerate() {
            let Some(now) = self.sample(wire, times[1]) else { continue };
            let before = self.sample(wire, times[0]);
            for (point, particle) in self.pulled(particles, &now, on) {
                let strength = now.strength(point);
                let to = self.place(&now, particle, point);
                let from = before.as_ref().map_or(to, |before| self.place(before, particle, point));
                let between = [from.into(), to.into()];
                out.push(mass_spring::GoalSpring {
                    particle: particle as u32,
                    between,
                    strength,
                    damping: damping(strength),
                });
            }
        }
    }

    /// The points of a wire's body that are pulled, and their particles.
    fn pulled<'b>(
        &'b self,
        particles: &Range<usize>,
        now: &'b GoalSample<'_>,
        on: GoalOn,
    ) -> impl Iterator<Item = (usize, usize)> + 'b {
        let free = |point: usize| now.to.strength.mask.is_some() && now.strength(point) <= 0.0;
        particles.clone().enumerate().filter(move |(point, particle)| self.is_on(*particle, on) && !free(*point))
    }

    fn is_on(&self, particle: usize, on: GoalOn) -> bool {
        match on {
            GoalOn::Interior => !self.setup.outer[particle],
            GoalOn::Surface => self.setup.outer[particle],
            GoalOn::All => true,
        }
    }

    fn place(&self, sample: &GoalSample<'_>, particle: usize, point: usize) -> DVec3 {
        let from = match sample.from {
            Origin::Rest => self.setup.rest[particle].into(),
            Origin::Goal(shape) => to_f64(shape[point]),
            Origin::Found(positions) => positions[point].into(),
        };
        let to = to_f64(sample.to.positions[point]);
        if sample.share >= 1.0 { to } else { from + (to - from) * sample.share }
    }

    /// The target of a wire's body at a frame; `None` while no goal pulls it.
    fn sample(&self, wire: usize, frame: f64) -> Option<GoalSample<'_>> {
        let (before, next) = self.around(wire, frame);
        let held = |at: &&GoalKey<'_>| frame <= at.released() && next.is_none_or(|next| frame < next.frame);
        if let Some(to) = before.filter(held) {
            return Some(GoalSample { from: Origin::Rest, to, share: 1.0, strength_before: None });
        }
        let to = next?;
        let (from, since, strength_before) = match before {
            _ if to.waits_for(before, self.start) => {
                let start = self.history.starts.get(&to.index)?;
                (Origin::Found(&start.positions), start.frame, None)
            }
            Some(before) => (Origin::Goal(before.positions), before.released(), Some(before.strength)),
            None => (Origin::Rest, self.start, None),
        };
        let share = if to.frame > since { ((frame - since) / (to.frame - since)).clamp(0.0, 1.0) } else { 1.0 };
        Some(GoalSample { from, to, share, strength_before })
    }

    /// The target positions of all particles at a frame, NaN for particles without a goal; `None` if there are no
    /// goals.
    pub(super) fn shape(&self, frame: f64) -> Option<Vec<[f64; 3]>> {
        let mut shape = None;
        for (wire, particles) in self.setup.wires.iter().enumerate() {
            let Some(now) = self.sample(wire, frame) else { continue };
            let shape = shape.get_or_insert_with(|| vec![[f64::NAN; 3]; self.setup.rest.len()]);
            for (point, particle) in particles.clone().enumerate() {
                shape[particle] = self.place(&now, particle, point).into();
            }
        }
        shape
    }

    /// Calls `reset` for each goal towards which the rest shape changes in the step to `frame`, with the goal's
    /// positions (NaN for other particles) and the share of the remaining change. In `frames` steps the rest shape
    /// changes by `whole`, 0..1.
    pub(super) fn resets(&self, frame: f64, whole: f64, frames: f64, mut reset: impl FnMut(&[[f64; 3]], f64)) {
        for (wire, key, step) in self.passed(frame) {
            let Some(share) = share_of_step(step, whole, frames) else { continue };
            let mut shape = vec![[f64::NAN; 3]; self.setup.rest.len()];
            for (place, at) in shape[self.setup.wires[wire].clone()].iter_mut().zip(key.positions) {
                *place = at.map(f64::from);
            }
            reset(&shape, share);
        }
    }

    /// Whether the rest shape changes in the step to `frame`.
    pub(super) fn reset_at(&self, frame: f64, whole: f64, frames: f64) -> bool {
        self.passed(frame).any(|(_, _, step)| share_of_step(step, whole, frames).is_some())
    }

    /// All goals, with their body's wire.
    fn all(&self) -> impl Iterator<Item = (usize, &GoalKey<'a>)> {
        self.of.iter().enumerate().flat_map(|(wire, keys)| keys.iter().map(move |key| (wire, key)))
    }

    /// Goals passed by `frame`, with the number of steps since, the step that passed them included.
    fn passed(&self, frame: f64) -> impl Iterator<Item = (usize, &GoalKey<'_>, f64)> {
        self.all()
            .map(move |(wire, key)| (wire, key, frame - key.frame.ceil().max(self.start + 1.0) + 1.0))
            .filter(|(_, _, step)| *step >= 1.0)
    }

    /// Mean distance of pulled particles from their targets at a frame, metres; `None` if none is pulled.
    pub(super) fn distance(&self, frame: f64, on: GoalOn, positions: &[[f64; 3]]) -> Option<f64> {
        let wires = 0..self.of.len();
        let [sum, count] = wires.fold([0.0; 2], |[sum, count], wire| {
            let [own, particles] = self.distances(wire, frame, on, positions);
            [sum + own, count + particles]
        });
        (count > 0.0).then(|| sum / count)
    }

    /// Notes how near bodies are to the goals whose shape they should have at a frame.
    fn compare(&mut self, frame: f64, on: GoalOn, positions: &[[f64; 3]]) {
        for body in 0..self.of.len() {
            let reached = |now: &GoalSample<'_>| now.share >= 1.0 && now.to.strength.value > 0.0;
            let Some(goal) = self.sample(body, frame).filter(reached).map(|now| now.to.index) else { continue };
            let [sum, count] = self.distances(body, frame, on, positions);
            let [low, high] = bounds(self.setup.rest[self.setup.wires[body].clone()].iter().copied());
            let size = (DVec3::from(high) - DVec3::from(low)).norm();
            if count > 0.0 && size > 0.0 {
                let distance = sum / count / size;
                let nearest = self.history.nearest.entry(goal).or_insert(Miss { body, distance });
                nearest.distance = nearest.distance.min(distance);
            }
        }
    }

    /// Sets the metrics that tell whether goals work, with particles at `positions`.
    pub(super) fn measure(&mut self, frame: f64, on: GoalOn, positions: &[[f64; 3]], metrics: &mut MetricValues) {
        self.compare(frame, on, positions);
        let farther = |a: &(&usize, &Miss), b: &(&usize, &Miss)| a.1.distance.total_cmp(&b.1.distance);
        if let Some((goal, miss)) = self.history.nearest.iter().max_by(farther) {
            metrics.set(GOAL_MISS, miss.distance);
            metrics.set(GOAL_MISS_BODY, miss.body as f64);
            metrics.set(GOAL_MISS_GOAL, *goal as f64);
        }
        for (goals, count, wire) in [
            (self.idle(on), IDLE_GOALS, IDLE_GOALS_WIRE),
            (self.early(), EARLY_GOALS, EARLY_GOALS_WIRE),
            (self.doubled(), DOUBLED_GOALS, DOUBLED_GOALS_WIRE),
        ] {
            metrics.set(count, goals.len() as f64);
            metrics.set(wire, goals.first().map_or(-1.0, |first| *first as f64));
        }
    }

    /// Sum of the distances of a wire's pulled particles from their targets, and their number.
    fn distances(&self, wire: usize, frame: f64, on: GoalOn, positions: &[[f64; 3]]) -> [f64; 2] {
        let Some(now) = self.sample(wire, frame) else { return [0.0; 2] };
        self.pulled(&self.setup.wires[wire], &now, on).fold([0.0; 2], |[sum, count], (point, particle)| {
            let to = self.place(&now, particle, point);
            [sum + (to - DVec3::from(positions[particle])).norm(), count + 1.0]
        })
    }

    /// The goals that have no particle to pull, by index of their wire.
    fn idle(&self, on: GoalOn) -> Vec<usize> {
        let pulls = |wire: usize, key: &GoalKey<'_>| {
            let share = |point: usize| key.strength.factor(point) > 0.0;
            self.setup.wires[wire].clone().enumerate().any(|(point, particle)| self.is_on(particle, on) && share(point))
        };
        let mut idle: Vec<usize> =
            self.all().filter(|(wire, key)| !pulls(*wire, key)).map(|(_, key)| key.index).collect();
        idle.sort_unstable();
        idle
    }

    /// The goals that are over by the end of the first step, by index of their wire.
    fn early(&self) -> Vec<usize> {
        let over = |key: &&GoalKey<'_>| key.released() < self.start + 1.0;
        let mut early: Vec<usize> = self.of.iter().flatten().filter(over).map(|key| key.index).collect();
        early.sort_unstable();
        early
    }

    /// The goals at whose frame their body is still held by another one, which they follow among the wires.
    fn doubled(&self) -> Vec<usize> {
        let pairs = self.of.iter().flat_map(|keys| keys.windows(2)).filter(|pair| pair[0].released() >= pair[1].frame);
        let mut doubled: Vec<usize> = pairs.map(|pair| pair[1].index).collect();
        doubled.sort_unstable();
        doubled
    }
}

impl GoalKey<'_> {
    /// The goal as it pulls, if it ever does: where it starts to pull only when its body should have its shape, it is
    /// reached at once.
    fn pulling(self) -> Option<Self> {
        let end = self.released();
        if self.start < self.frame {
            return Some(self);
        }
        (self.start < end).then_some(Self { frame: self.start, hold: end - self.start, ..self })
    }

    /// The last frame at which it holds its body.
    fn released(&self) -> f64 {
        self.frame + self.hold
    }

    /// Whether it takes up its body later than where the goal before it, or the start of the simulation, leaves it.
    fn waits_for(&self, before: Option<&GoalKey<'_>>, start: f64) -> bool {
        self.start > before.map_or(start, GoalKey::released)
    }
}

/// The share of the remaining change that a step makes, if `frames` equal steps make `whole` of the change; `None`
/// after them.
fn share_of_step(step: f64, whole: f64, frames: f64) -> Option<f64> {
    let frames = frames.max(1.0);
    if whole <= 0.0 || step > frames {
        return None;
    }
    let gone = whole * (step - 1.0) / frames;
    Some((whole / frames / (1.0 - gone)).min(1.0))
}

/// The index of the wire whose body has the tets of a goal.
fn owner(inputs: &StartInputs, index: usize, shape: &Component) -> Result<usize> {
    let fits = |geometry: &Arc<Geometry>| {
        geometry.tets().is_some_and(|body| {
            body.point_count() == shape.point_count()
                && (body.topology().same(shape.topology()) || body.topology() == shape.topology())
        })
    };
    let bodies = &inputs.bodies;
    let found: Vec<usize> = (0..bodies.len()).filter(|wire| fits(&bodies[*wire])).collect();
    match found[..] {
        [wire] => Ok(wire),
        [] => {
            let count = |part: &Component| format!("{} tets of {} points", part.element_count(), part.point_count());
            let has: Vec<String> = bodies.iter().filter_map(|body| body.tets().map(count)).collect();
            let fact = format!("`goals` {index} has {}, and no body has the same: {}", count(shape), has.join(", "));
            Err(Error::refused(fact).hint("make goals with Softbody_Goal from the tets that are simulated"))
        }
        [a, b, ..] => {
            let fact = format!("`goals` {index} has the tets of both `bodies` {a} and {b}");
            Err(Error::refused(fact).hint("simulate identical bodies in separate nodes"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_shape_changes_in_equal_steps() {
        let mut length = 1.0;
        for step in 1..=4 {
            let share = share_of_step(f64::from(step), 0.8, 4.0).unwrap();
            length += (2.0 - length) * share;
            assert!((length - (1.0 + 0.2 * f64::from(step))).abs() < 1e-12);
        }
        assert_eq!(share_of_step(5.0, 0.8, 4.0), None);
        assert_eq!(share_of_step(1.0, 1.0, 0.0), Some(1.0), "with no frames the whole change is made at once");
        assert_eq!(share_of_step(1.0, 0.0, 4.0), None);
    }
}
