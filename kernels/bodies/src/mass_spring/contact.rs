//! Contact and Coulomb friction: the interface to contact detection, the contact forces, and their linearisation.
//!
//! Once a stage the solver asks a [`super::ContactFinder`] for all potential contacts. Each becomes a one-sided penalty
//! spring that acts below the gap and grows without bound as the surfaces meet: N = κδ ÷ (1 − δ/gap), treated
//! implicitly like every other force. Friction is Coulomb's law, regularised by a creep velocity of [`CREEP`] body
//! lengths a second and implicit too; the normal load it uses is that of the previous step until the current step has
//! its own.
//!
//! Limit: within a stage the surfaces of a contact are planes.

use super::body::SoftBody;
use super::heap::ContactScale;
use super::volume::continued;
use crate::embedding::EmbeddedPoint;
use numerics::vector::DVec3;

/// Penalty stiffness κ ÷ resistance of the particles. Larger values keep the gap better, smaller ones converge faster.
const PENALTY_RATIO: f64 = 30.0;
/// Slip of one frame is resisted by at most this times κ: friction coefficients like 1e6 would only add noise.
const STICK_RATIO: f64 = 1e4;
/// Fraction of the gap beyond which the contact force continues linearly; its slope there is 1/(1 − this)² of the
/// initial one.
const LINEAR_FROM: f64 = 0.95;
/// Fraction of the gap beyond which a contact is too deep to accept.
const TOO_DEEP: f64 = 0.96;
/// Largest increase of depth in a trial step, as a fraction of the gap, and the depth to stop at instead: for a
/// contact that was open, and for one that was closed.
const OPEN_LIMIT: [f64; 2] = [0.05, 0.02];
const CLOSED_LIMIT: [f64; 2] = [0.3, 0.1];
/// Factor on the friction dual of a predicted slip, which keeps it off the boundary, where the slip could flip.
const DUAL_SHRINK: f64 = 0.98;
/// Two unit vectors with a sum shorter than this are opposite.
const OPPOSITE: f64 = 1e-9;
/// Cosine of the largest angle by which slip may turn in a step with constant friction; at a right angle it goes round.
const SAME_DIRECTION: f64 = 0.7;
/// Slip, in body lengths a second, above which friction is μN; proportional below.
const CREEP: f64 = 2e-5;

/// Some points, and their weights.
pub(crate) type Weighted<'a> = (&'a [u32], &'a [f64]);

/// Two surfaces that may touch. With u = Σ wᵢxᵢ, n·u − offset is the distance of the first from the second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact {
    /// The contact points involved, those of the first surface first; entries of weight 0 are unused.
    pub points: [u32; 4],
    /// Vertex against obstacle: 1. Vertex against face: 1 and minus the barycentric weights. Edge against edge:
    /// weights along both, negative on the second.
    pub weights: [f64; 4],
    /// Unit normal, from the second surface (or the obstacle) towards the first.
    pub normal: [f64; 3],
    /// n·u at which the surfaces touch, at the end of the query; 0 between two bodies. Metres.
    pub offset: f64,
    /// Distance to keep between the surfaces, metres.
    pub gap: f64,
    /// Velocity of the obstacle at the contact, m/s; 0 between two bodies.
    pub velocity: [f64; 3],
    /// Coulomb's friction coefficient μ.
    pub friction: f64,
    /// Whether the obstacle leaves no room between it and the ground, so that nothing can meet both.
    pub jammed: bool,
    /// Whether what a step leaves too deep is moved back: positions do not tell the side of what went through an obstacle
    /// without an inside, and nothing else holds up what is below the ground.
    pub open: bool,
}

impl Contact {
    /// A contact at rest and without friction of points of one surface with points of another, none of an obstacle.
    pub(crate) fn between([first, second]: [Weighted<'_>; 2], normal: DVec3, gap: f64) -> Self {
        let mut contact = Self { normal: normal.into(), gap, ..Self::default() };
        let all = [(first, 1.0), (second, -1.0)].into_iter();
        let all = all.flat_map(|((points, weights), sign)| points.iter().zip(weights.iter().map(move |w| w * sign)));
        for (slot, (point, weight)) in all.enumerate() {
            (contact.points[slot], contact.weights[slot]) = (*point, weight);
        }
        contact
    }

    /// Depth below its gap with contact points at `x`, metres; negative above it.
    pub(crate) fn depth(&self, x: &[[f64; 3]]) -> f64 {
        let sides = self.points.iter().zip(self.weights).filter(|side| side.1 != 0.0);
        let at: DVec3 = sides.map(|(particle, weight)| DVec3::from(x[*particle as usize]) * weight).sum();
        self.gap + self.offset - DVec3::from(self.normal).dot(&at)
    }
}

/// The most particles of a contact: each of its points may ride along on four.
const MOST_PARTICLES: usize = 16;

/// A contact as the solver treats it, with particles in the solver's order.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ContactConstraint {
    /// As it was detected. Its points that are particles are in the solver's order; those that ride along count on from these.
    pub(super) of: Contact,
    /// The particles that its points depend on, each once, and their weights; and how many there are, in all and of the first
    /// surface.
    pub(super) particles: [u32; MOST_PARTICLES],
    weights: [f64; MOST_PARTICLES],
    counts: [usize; 2],
    /// Its unit normal, and its velocity.
    pub(super) normal: DVec3,
    pub(super) velocity: DVec3,
    /// Whether it is between skin of heaps, or of one and another body: any depth is accepted.
    pub(super) of_heap: bool,
    /// Penalty stiffness κ, N/m.
    penalty_stiffness: f64,
    /// Largest resistance of friction to a slip rate, N·s/m.
    stick_limit: f64,
    /// Normal load that friction is computed from, newtons.
    pub(super) load: f64,
    /// Depth at which the penalty force starts, metres: above 0 while surfaces that penetrated each other are
    /// separated gradually.
    allowed_depth: f64,
    /// State that the contact keeps throughout a step, if it is frozen.
    frozen: Option<ContactState>,
}

/// State of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ContactMode {
    /// Open: no force.
    #[default]
    Open,
    /// Closed, without friction.
    Frictionless,
    /// Closed and sticking.
    Sticking,
    /// Closed and sliding.
    Sliding,
}

/// Forces of a contact at some positions.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ContactState {
    pub(super) mode: ContactMode,
    /// Force on the first surface, newtons.
    pub(super) force: DVec3,
    /// Depth below the gap, metres.
    pub(super) depth: f64,
    /// Normal force N, newtons, and its derivative with respect to depth.
    pub(super) normal_force: f64,
    slope: f64,
    /// Resistance to slip, N·s/m, and the slip relative to the creep velocity, which has length 1 where the contact
    /// slides.
    grip: f64,
    slip: DVec3,
    pub(super) energy: f64,
    /// Friction dual: the predicted friction relative to its bound.
    dual: DVec3,
    /// Predicted normal force, newtons, and the difference of the one around which the contact was linearised from the current
    /// one.
    pub(super) predicted: f64,
    pub(super) offset: f64,
}

impl ContactConstraint {
    /// A detected contact, as stiff as the `scale` tells. `None` if it is degenerate.
    pub(super) fn new(body: &SoftBody, contact: &Contact, scale: &ContactScale<'_>) -> Option<Self> {
        let finite = contact.weights.iter().chain(&contact.normal).chain(&contact.velocity).all(|x| x.is_finite());
        let normal = DVec3::from(contact.normal).try_normalize(1e-12)?;
        if !finite || !contact.offset.is_finite() || !contact.gap.is_finite() {
            return None;
        }
        let (gap, friction) = (contact.gap.max(0.0), contact.friction.max(0.0));
        let of = Contact { points: [0; 4], gap, friction, ..*contact };
        let mut constraint = Self { of, normal, velocity: contact.velocity.into(), ..Self::default() };
        for k in 0..4 {
            if contact.weights[k] != 0.0 {
                constraint.add_point(body, k, contact.points[k] as usize)?;
            }
        }
        let two_sided = constraint.is_two_sided();
        let stiff = |particle| scale.resistance(body, particle, gap, two_sided);
        let yielding = constraint.sides().fold(0.0, |sum, side| sum + side.1 * side.1 / stiff(side.0));
        constraint.of_heap = two_sided && constraint.sides().any(|side| scale.heaps.get(side.0) == Some(&true));
        constraint.penalty_stiffness = PENALTY_RATIO / yielding;
        constraint.stick_limit = STICK_RATIO * constraint.penalty_stiffness * scale.seconds;
        (yielding > 0.0 && constraint.penalty_stiffness.is_finite()).then_some(constraint)
    }

    /// Adds a contact point of the caller's: a particle, or the particles that it rides along on.
    fn add_point(&mut self, body: &SoftBody, k: usize, point: usize) -> Option<()> {
        let (of_particle, weight) = (body.order.index_of.get(point), self.of.weights[k]);
        let carrier = match of_particle {
            Some(_) => EmbeddedPoint::at_particle(point as u32),
            None => *body.riding.get(point - body.len())?,
        };
        self.of.points[k] = of_particle.copied().unwrap_or(point as u32);
        for (particle, share) in carrier.sides() {
            let (particle, count) = (body.order.index_of[particle as usize], self.counts[0]);
            let known = self.particles[..count].iter().position(|known| *known == particle).unwrap_or(count);
            self.particles[known] = particle;
            self.weights[known] += weight * share;
            self.counts[0] = count.max(known + 1);
        }
        if weight > 0.0 {
            self.counts[1] = self.counts[0];
        }
        Some(())
    }

    /// The particles with their weights.
    pub(super) fn sides(&self) -> impl Iterator<Item = (usize, f64)> {
        let count = self.counts[0];
        self.particles[..count].iter().zip(&self.weights).map(|(particle, weight)| (*particle as usize, *weight))
    }

    /// The particles of the first surface, and of the second if that is a body's.
    pub(super) fn surfaces(&self) -> [&[u32]; 2] {
        self.particles[..self.counts[0]].split_at(self.counts[1]).into()
    }

    /// The contact points with their weights.
    pub(super) fn points(&self) -> impl Iterator<Item = (usize, f64)> {
        let points: [(usize, f64); 4] = std::array::from_fn(|k| (self.of.points[k] as usize, self.of.weights[k]));
        points.into_iter().filter(|(_, weight)| *weight != 0.0)
    }

    /// Whether it is between bodies: the sum of its weights is 0 there, and 1 with an obstacle.
    pub(super) fn is_two_sided(&self) -> bool {
        self.of.weights.iter().sum::<f64>().abs() < 0.5
    }

    /// Whether it is closed at `x` although the obstacle leaves no room there.
    pub(super) fn is_jammed(&self, x: &[DVec3]) -> bool {
        self.of.jammed && self.clearance(x, 0.0) < 0.0
    }

    /// Depth as a fraction of the gap.
    fn gap_fraction(&self, depth: f64) -> f64 {
        if self.of.gap > 0.0 { depth / self.of.gap } else { 0.0 }
    }

    /// Whether the contact is too deep to be accepted at `x`.
    pub(super) fn is_too_deep(&self, x: &[DVec3]) -> bool {
        let depth = self.depth(x, 0.0);
        !self.of_heap && depth > 0.0 && self.gap_fraction(depth) > TOO_DEEP
    }

    /// Whether the surfaces penetrate each other at the start `x` of a step of `seconds`: the force then separates
    /// them instead of acting as a spring.
    pub(super) fn is_penetrating(&self, x: &[DVec3], seconds: f64) -> bool {
        self.gap_fraction(self.depth(x, seconds)) >= LINEAR_FROM
    }

    /// How much deeper than allowed a contact would get by a motion from `x` to `to`, metres; `None` if it stays
    /// within the limits. Limiting the motion lets the next iteration see the contact force.
    pub(super) fn overshoot(&self, x: &[DVec3], to: &[DVec3]) -> Option<f64> {
        let (before, after) = (self.depth(x, 0.0), self.depth(to, 0.0));
        let [most, stop] = if before > 0.0 { CLOSED_LIMIT } else { OPEN_LIMIT };
        let left = before.max(stop * self.of.gap);
        (self.of.gap > 0.0 && after > most * self.of.gap && after > left).then_some(after - left)
    }

    /// Whether it is that of a single point of a body.
    pub(super) fn is_of_one_point(&self) -> bool {
        self.of.weights.iter().filter(|weight| **weight != 0.0).count() == 1
    }

    /// Moves those of its particles that are not `held` so that their weighted sum moves by `distance` along the normal.
    pub(super) fn shift(&self, distance: f64, held: &[bool], x: &mut [DVec3]) {
        let free = || self.sides().filter(|side| !held[side.0]);
        let square: f64 = free().map(|(_, weight)| weight * weight).sum();
        free().for_each(|(particle, weight)| x[particle] += self.normal * (distance * weight / square));
    }

    /// Σ wᵢ·valuesᵢ.
    pub(super) fn weighted_sum(&self, values: &[DVec3]) -> DVec3 {
        self.sides().fold(DVec3::zeros(), |sum, (particle, weight)| sum + values[particle] * weight)
    }

    /// Adds a `force` on the first surface to those of its particles.
    pub(super) fn push(&self, force: DVec3, forces: &mut [DVec3]) {
        self.sides().for_each(|(particle, weight)| forces[particle] += force * weight);
    }

    /// Distance above the gap at `x`, `seconds` before the time the contact was detected for.
    pub(super) fn clearance(&self, x: &[DVec3], seconds: f64) -> f64 {
        let offset = self.of.offset - self.normal.dot(&self.velocity) * seconds;
        self.normal.dot(&self.weighted_sum(x)) - offset - self.of.gap
    }

    /// Depth at which the penalty acts, likewise.
    fn depth(&self, x: &[DVec3], seconds: f64) -> f64 {
        -self.clearance(x, seconds) - self.allowed_depth
    }

    /// For surfaces that penetrate each other at the start `x` of a step of `seconds`, limits the separation in that
    /// step to `separation` metres. Separated at once within a short step, they would fly apart.
    pub(super) fn depenetrating(self, x: &[DVec3], seconds: f64, separation: f64) -> Self {
        let through = -self.clearance(x, seconds) - self.of.gap;
        Self { allowed_depth: (through - separation).max(0.0), ..self }
    }

    /// Freezes the state at `x` and `v`, `seconds` before the detection time: open or closed, sticking or sliding,
    /// with the normal force linear in depth. A one-sided force would reduce the order of the step to 1.
    pub(super) fn frozen(&self, x: &[DVec3], v: &[DVec3], seconds: f64, size: f64) -> Self {
        Self { frozen: Some(self.at(x, v, seconds, size)), ..*self }
    }

    /// Whether a frozen contact would have the same state at `x` and `v`.
    pub(super) fn active_set_unchanged(&self, x: &[DVec3], v: &[DVec3]) -> bool {
        let Some(then) = self.frozen else { return true };
        let depth = self.depth(x, 0.0);
        let push = then.normal_force + then.slope * (depth - then.depth);
        let slip = self.slip(v);
        let stays = depth > 0.0 && self.gap_fraction(depth) < LINEAR_FROM;
        match then.mode {
            ContactMode::Open => depth <= 0.0,
            ContactMode::Frictionless => stays,
            ContactMode::Sticking => stays && slip.norm() * then.grip <= self.of.friction * push.max(0.0),
            ContactMode::Sliding => stays && slip.dot(&then.slip) >= SAME_DIRECTION * slip.norm(),
        }
    }

    /// Slip velocity of the surfaces.
    fn slip(&self, v: &[DVec3]) -> DVec3 {
        let relative = self.weighted_sum(v) - self.velocity;
        relative - self.normal * self.normal.dot(&relative)
    }

    /// Updates a state, which keeps its predictions, as [`Self::at`].
    pub(super) fn update(&self, state: &mut ContactState, [x, v]: [&[DVec3]; 2], seconds: f64, size: f64) {
        let ContactState { dual, predicted, .. } = *state;
        *state = ContactState { dual, predicted, ..self.at(x, v, seconds, size) };
    }

    /// The forces at `x` and `v`, `seconds` before the detection time, for a body of the given `size`.
    pub(super) fn at(&self, x: &[DVec3], v: &[DVec3], seconds: f64, size: f64) -> ContactState {
        let depth = self.depth(x, seconds);
        if let Some(then) = self.frozen {
            let push = then.normal_force + then.slope * (depth - then.depth);
            let dual = match then.mode {
                ContactMode::Open | ContactMode::Frictionless => DVec3::zeros(),
                ContactMode::Sticking => self.slip(v) * then.grip,
                ContactMode::Sliding => then.slip * (self.of.friction * self.load),
            };
            let force = if then.mode == ContactMode::Open { DVec3::zeros() } else { self.normal * push - dual };
            // Sliding friction does not depend on the slip, so it has no stiffness across it either.
            let grip = if then.mode == ContactMode::Sliding { 0.0 } else { then.grip };
            return ContactState { depth, normal_force: push, force, grip, ..then };
        }
        let mut state = ContactState { depth, ..ContactState::default() };
        if depth > 0.0 {
            state.mode = ContactMode::Frictionless;
            (state.normal_force, state.slope, state.energy) = self.penalty(depth);
            state.force = self.normal * state.normal_force;
        }
        // The load is constant within a step; otherwise friction would start and stop with a jump.
        let most = self.of.friction * self.load;
        if most > 0.0 {
            let slip = self.slip(v);
            let (speed, creep) = (slip.norm(), self.creep(size));
            state.mode = if speed <= creep { ContactMode::Sticking } else { ContactMode::Sliding };
            state.grip = most / speed.max(creep);
            state.slip = slip / speed.max(creep);
            state.force -= slip * state.grip;
        }
        state
    }

    /// The state before the first linear system.
    pub(super) fn unsolved(&self) -> ContactState {
        ContactState { predicted: self.load, ..ContactState::default() }
    }

    /// Fixes the normal load of friction: the force at `x`, `seconds` before the detection time, but no more than the
    /// last step's `loads`. With a given load friction has a potential and the stage stays a convex minimisation. A
    /// new contact has no load yet. Where an obstacle moves so far that its plane at that time is unknown, a contact
    /// of a single point takes the last load.
    pub(super) fn with_load(&self, x: &[DVec3], loads: &[f64], seconds: f64) -> Self {
        let near = self.velocity.norm() * seconds <= self.of.gap;
        let last = self.points().map(|(point, _)| loads[point]).fold(0.0, f64::max);
        let now = if near {
            self.load_at(x, seconds)
        } else if self.is_of_one_point() {
            last
        } else {
            0.0
        };
        Self { load: now.min(last), ..*self }
    }

    /// The normal force at `x`, `seconds` before the detection time, as a load for friction.
    pub(super) fn load_at(&self, x: &[DVec3], seconds: f64) -> f64 {
        let depth = self.depth(x, seconds);
        // Where the surfaces penetrate each other, the force only separates them and causes no friction.
        if depth <= 0.0 || self.gap_fraction(depth + self.allowed_depth) > 1.0 {
            return 0.0;
        }
        let deepest = if self.of.gap > 0.0 { LINEAR_FROM * self.of.gap } else { f64::INFINITY };
        self.penalty(depth.min(deepest)).0
    }

    /// Normal force at a depth > 0, its derivative, and the stored energy.
    fn penalty(&self, depth: f64) -> (f64, f64, f64) {
        let (k, gap) = (self.penalty_stiffness, self.of.gap);
        let edge = LINEAR_FROM * gap;
        if gap <= 0.0 {
            return (k * depth, k, 0.5 * k * depth * depth);
        }
        let curved = |depth: f64| {
            let left = 1.0 - depth / gap;
            (k * depth / left, k / (left * left), k * gap * (-depth - gap * libm::log(left)))
        };
        if depth <= edge { curved(depth) } else { continued(curved(edge), depth - edge) }
    }

    /// Linearises the normal force at a predicted value instead of the current one, if that is smaller. Far into the
    /// steep part of the penalty, Newton's method would only halve the excess in each iteration.
    pub(super) fn linearise(&self, state: &mut ContactState) {
        let expected = state.predicted;
        if self.frozen.is_some() || state.depth <= 0.0 || self.of.gap <= 0.0 || expected >= state.normal_force {
            return;
        }
        let left = self.penalty_stiffness / (self.penalty_stiffness + expected / self.of.gap);
        let slope = self.penalty_stiffness / (left * left);
        let push = expected + slope * (state.depth - self.of.gap * (1.0 - left));
        (state.offset, state.normal_force, state.slope) = (push - state.normal_force, push, slope);
    }

    /// Lets the linearised normal force of an open contact act from the gap on if the direction `dx` goes below it; returns
    /// whether it does. The force without a motion is below 0.
    pub(super) fn close(&self, state: &mut ContactState, dx: &[DVec3]) -> bool {
        if state.slope > 0.0 || self.normal.dot(&self.weighted_sum(dx)) >= state.depth {
            return false;
        }
        (state.normal_force, state.slope) = (self.penalty_stiffness * state.depth, self.penalty_stiffness);
        state.offset = state.normal_force;
        if state.mode == ContactMode::Open {
            state.mode = ContactMode::Frictionless;
        }
        true
    }

    /// Predicts the normal force and the friction dual after a fraction `share` of the step `dx` in a stage of `a`, as
    /// linearised. The dual has length 1 at most; it is zero where the step was cut because it would have reversed the slip.
    pub(super) fn predict(&self, state: &mut ContactState, dx: &[DVec3], share: f64, a: f64) {
        let separation = self.weighted_sum(dx);
        let along = self.normal.dot(&separation);
        state.predicted = (state.normal_force - state.slope * share * along).max(0.0);
        let (before, most) = (std::mem::take(&mut state.dual), self.of.friction * self.load);
        if most <= 0.0 || state.mode == ContactMode::Open {
            return;
        }
        let more = (separation - self.normal * along) * (state.grip / (a * most));
        let slides = state.mode == ContactMode::Sliding;
        if slides && share < 1.0 && state.slip.dot(&(state.slip + more)) < 0.0 {
            return;
        }
        let turned = if slides { more - before * state.slip.dot(&more) } else { more };
        let next = before.lerp(&(state.slip + turned), share);
        state.dual = next * (DUAL_SHRINK / next.norm().max(1.0));
    }

    /// Slip velocity above which friction is μN, m/s.
    fn creep(&self, size: f64) -> f64 {
        (CREEP * size).max(f64::MIN_POSITIVE).max(self.of.friction * self.load / self.stick_limit)
    }

    /// Friction potential of the stage in which `v` = (x − z)/a.
    pub(super) fn friction_energy(&self, v: &[DVec3], a: f64, size: f64) -> f64 {
        let most = self.of.friction * self.load;
        let (speed, creep) = (self.slip(v).norm(), self.creep(size));
        let held = if speed <= creep { 0.5 * speed * speed / creep } else { speed - 0.5 * creep };
        a * most * held
    }

    /// Up to three directions in which the contact has stiffness in a stage of `a`, each scaled by the square root of
    /// that stiffness.
    ///
    /// The derivative of sliding friction vanishes along the slip, so plain Newton iterations would oscillate. The
    /// linearisation is the primal-dual one of Chan, Golub & Mulet (1999): with a dual of 0 it is that of slower
    /// surfaces, which never overshoots; with the dual that matches the slip it is exact.
    pub(super) fn stiffness_directions(&self, state: &ContactState, a: f64) -> impl Iterator<Item = DVec3> {
        let (n, dual) = (self.normal, state.dual);
        let mut out = [n * (a * a * state.slope).max(0.0).sqrt(), DVec3::zeros(), DVec3::zeros()];
        let (along, [least, most]) = match state.mode {
            ContactMode::Open => return out.into_iter().take(0),
            ContactMode::Frictionless => return out.into_iter().take(1),
            ContactMode::Sticking => (DVec3::zeros(), [1.0, 1.0]),
            ContactMode::Sliding => {
                let (length, common) = (dual.norm(), dual.dot(&state.slip));
                let middle = if length > 0.0 { dual / length + state.slip } else { state.slip };
                (middle, [1.0 - 0.5 * (common + length), 1.0 - 0.5 * (common - length)])
            }
        };
        let any = || n.cross(&if n.x.abs() < 0.7 { DVec3::x() } else { DVec3::y() }).normalize();
        let along = along.try_normalize(OPPOSITE).unwrap_or_else(any);
        out[1] = along * (a * state.grip * least).max(0.0).sqrt();
        out[2] = n.cross(&along) * (a * state.grip * most).max(0.0).sqrt();
        out.into_iter().take(3)
    }
}
