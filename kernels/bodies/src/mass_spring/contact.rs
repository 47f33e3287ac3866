//! Contact and friction: who finds contacts, what they push with, how it is made linear.
//!
//! The solver asks a [`Contacts`] once a stage for all that may touch, and treats each as a spring that only pushes and only
//! below the distance kept, without limit where the surfaces meet: N = κδ ÷ (1 − δ/gap), implicit like every other force.
//! Friction is Coulomb's, sticking to a creep of [`CREEP`] body lengths a second, implicit too, with N
//! as it was at last until the step has its own.
//!
//! Limit: the surfaces a contact was found for are planes within the stage.

use super::body::SoftBody;
use super::rank_one::add_square;
use numerics::vector::DVec3;

/// κ ÷ what the particles put up against being moved: springs and inertia together. More holds the gap better in one
/// iteration, less converges faster.
const FIRM: f64 = 30.0;
/// Most that sticking resists a slip of a frame ÷ κ: beyond, frictions like 1e6 would only be noise.
const HOLD: f64 = 1e4;
/// Share of the gap from where on the push grows straight on: its slope is 1/(1 − that)² of the first.
const STRAIGHT: f64 = 0.95;
/// Share of its gap below which a contact is too deep to leave it there.
const DEEP: f64 = 0.96;
/// Shares of its gap that a step may close a contact by before it is stopped, and where: one that was apart, and one that
/// pushed already.
const CLOSED: [f64; 2] = [0.05, 0.02];
const PRESSED: [f64; 2] = [0.3, 0.1];
/// Share of a drag that is believed to go on: the rest keeps a slip from being turned round too far.
const SURE: f64 = 0.98;
/// Length of a sum of two units below which they are opposite.
const OPPOSITE: f64 = 1e-9;
/// Body lengths a second at which friction is all of μN; below it creeps in proportion.
const CREEP: f64 = 2e-5;

/// Two surfaces that may touch: u = Σ wᵢxᵢ is how far the first is from the second, along `normal` once `offset` is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The particles; those of weight 0 are none.
    pub particles: [u32; 4],
    /// Vertex against an obstacle: 1. Vertex against a face: 1 and −barycentric. Edge against edge: both, the second negative.
    pub weights: [f64; 4],
    /// Unit, from the second surface (or the obstacle) towards the first.
    pub normal: [f64; 3],
    /// n·u where the surfaces touch, at the time asked for; 0 between two bodies. Metres.
    pub offset: f64,
    /// Distance kept between them, metres.
    pub gap: f64,
    /// The obstacle's velocity there, m/s; 0 between two bodies.
    pub velocity: [f64; 3],
    /// Coulomb's μ.
    pub friction: f64,
}

/// What may touch what while particles go straight `from` here `to` there.
#[derive(Clone, Copy, Debug)]
pub struct ContactQuery<'a> {
    /// Where particles are at the first of `times`, by the caller's index.
    pub from: &'a [[f64; 3]],
    /// Where they are expected at the second: contacts hold for then.
    pub to: &'a [[f64; 3]],
    /// Shares of the frame that have passed.
    pub times: [f64; 2],
}

/// Finds contacts.
pub trait ContactFinder: Sync {
    /// Adds all contacts that may act to `out`: those that touch, and those that come closer than twice the gap on the way.
    /// In a fixed order.
    fn find(&self, query: &ContactQuery<'_>, out: &mut Vec<Contact>);
}

/// A contact in the solver's order.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactConstraint {
    pub(super) particles: [u32; 4],
    pub(super) weights: [f64; 4],
    pub(super) normal: DVec3,
    offset: f64,
    gap: f64,
    pub(super) velocity: DVec3,
    friction: f64,
    /// κ, N/m.
    penalty_stiffness: f64,
    /// Most that sticking resists slip with, N·s/m.
    hold: f64,
    /// N that friction counts, newtons.
    pub(super) load: f64,
    /// How much deeper it may be, metres: surfaces that are through each other come apart at a pace.
    slack: f64,
    /// What it is taken to do throughout a step.
    frozen: Option<ContactState>,
}

/// What a contact does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ContactMode {
    /// Nothing.
    #[default]
    Open,
    /// Pushes, without friction.
    Frictionless,
    /// Its surfaces stick.
    Sticking,
    /// Its surfaces slide.
    Sliding,
}

/// A contact at some positions.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactState {
    pub(super) mode: ContactMode,
    /// On the first surface, newtons.
    pub(super) force: DVec3,
    /// How far below the gap, metres.
    pub(super) depth: f64,
    /// N, and its slope with the depth.
    pub(super) normal_force: f64,
    slope: f64,
    /// Resistance to slip, N·s/m, and the share of all friction that the slip rouses: of length 1 where it slides.
    grip: f64,
    slip: DVec3,
    pub(super) energy: f64,
}

impl ContactConstraint {
    /// A contact as found, for frames of `seconds`; `firmness` is each particle's Σk.
    pub(super) fn new(body: &SoftBody, contact: &Contact, seconds: f64, particle_stiffness: &[f64]) -> Option<Self> {
        let finite = contact.weights.iter().chain(&contact.normal).chain(&contact.velocity).all(|x| x.is_finite());
        let normal = DVec3::from(contact.normal).try_normalize(1e-12)?;
        if !finite || !contact.offset.is_finite() || !contact.gap.is_finite() {
            return None;
        }
        let mut constraint = Self {
            particles: [0; 4],
            weights: contact.weights,
            normal,
            offset: contact.offset,
            gap: contact.gap.max(0.0),
            velocity: DVec3::from(contact.velocity),
            friction: contact.friction.max(0.0),
            penalty_stiffness: 0.0,
            hold: 0.0,
            load: 0.0,
            slack: 0.0,
            frozen: None,
        };
        let mut yielding = 0.0;
        for k in 0..4 {
            if contact.weights[k] != 0.0 {
                let particle = *body.order.index_of.get(contact.particles[k] as usize)?;
                constraint.particles[k] = particle;
                let stiff = 4.0 * body.mass[particle as usize] / (seconds * seconds)
                    + particle_stiffness[particle as usize] / 3.0;
                yielding += contact.weights[k] * contact.weights[k] / stiff;
            }
        }
        constraint.penalty_stiffness = FIRM / yielding;
        constraint.hold = HOLD * constraint.penalty_stiffness * seconds;
        (yielding > 0.0 && constraint.penalty_stiffness.is_finite()).then_some(constraint)
    }

    /// The particles, with their weights.
    pub(super) fn sides(&self) -> impl Iterator<Item = (usize, f64)> {
        let sides: [(usize, f64); 4] = std::array::from_fn(|k| (self.particles[k] as usize, self.weights[k]));
        sides.into_iter().filter(|(_, weight)| *weight != 0.0)
    }

    /// Share of the gap that a depth takes up.
    fn gap_fraction(&self, depth: f64) -> f64 {
        if self.gap > 0.0 { depth / self.gap } else { 0.0 }
    }

    /// Whether it is deeper than it may stay.
    pub(super) fn is_too_deep(&self, x: &[DVec3]) -> bool {
        let depth = self.depth(x, 0.0);
        depth > 0.0 && self.gap_fraction(depth) > DEEP
    }

    /// Whether it begins a step of `seconds` at `x` so deep that its push is a way out, not a spring's.
    pub(super) fn is_penetrating(&self, x: &[DVec3], seconds: f64) -> bool {
        self.gap_fraction(self.depth(x, seconds)) >= STRAIGHT
    }

    /// How far what goes from `x` `to` there has to stay back where it would get deep into the contact: a step further is seen
    /// how it pushes.
    pub(super) fn overshoot(&self, x: &[DVec3], to: &[DVec3]) -> Option<f64> {
        let (before, after) = (self.depth(x, 0.0), self.depth(to, 0.0));
        let [most, stop] = if before > 0.0 { PRESSED } else { CLOSED };
        let left = before.max(stop * self.gap);
        (self.gap > 0.0 && after > most * self.gap && after > left).then_some(after - left)
    }

    /// Whether one particle alone is in it.
    pub(super) fn single_particle(&self) -> Option<(usize, f64)> {
        let mut sides = self.sides();
        sides.next().filter(|_| sides.next().is_none())
    }

    /// Σ w·values.
    pub(super) fn weighted_sum(&self, values: &[DVec3]) -> DVec3 {
        self.sides().fold(DVec3::zeros(), |sum, (particle, weight)| sum + values[particle] * weight)
    }

    /// Distance above the gap, `seconds` before the time it was found for.
    pub(super) fn clearance(&self, x: &[DVec3], seconds: f64) -> f64 {
        let offset = self.offset - self.normal.dot(&self.velocity) * seconds;
        self.normal.dot(&self.weighted_sum(x)) - offset - self.gap
    }

    /// How far below the gap it pushes, likewise.
    fn depth(&self, x: &[DVec3], seconds: f64) -> f64 {
        -self.clearance(x, seconds) - self.slack
    }

    /// Takes it to be on its way out where surfaces are through each other as a step of `seconds` begins at `x`: by `way` in
    /// that step. All at once, within a short step, they would leave each other like a shot.
    pub(super) fn depenetrating(self, x: &[DVec3], seconds: f64, way: f64) -> Self {
        let through = -self.clearance(x, seconds) - self.gap;
        Self { slack: (through - way).max(0.0), ..self }
    }

    /// Takes it to go on as at `x` and `v`, `seconds` before the time it was found for: to push or not, stick or slide, with
    /// the push a straight line of the depth. A step that only pushes one way is no step of order 2; one that goes on is.
    pub(super) fn frozen(&self, x: &[DVec3], v: &[DVec3], seconds: f64, size: f64) -> Self {
        Self { frozen: Some(self.at(x, v, seconds, size)), ..*self }
    }

    /// Whether what a frozen contact was taken to do is what it does at `x` and `v`.
    pub(super) fn active_set_unchanged(&self, x: &[DVec3], v: &[DVec3]) -> bool {
        let Some(then) = self.frozen else { return true };
        let depth = self.depth(x, 0.0);
        let push = then.normal_force + then.slope * (depth - then.depth);
        let slip = self.slip(v);
        let stays = depth > 0.0 && self.gap_fraction(depth) < STRAIGHT;
        match then.mode {
            ContactMode::Open => depth <= 0.0,
            ContactMode::Frictionless => stays,
            ContactMode::Sticking => stays && slip.norm() * then.grip <= self.friction * push.max(0.0),
            ContactMode::Sliding => stays && slip.dot(&then.slip) >= 0.0,
        }
    }

    /// How fast the surfaces slip.
    fn slip(&self, v: &[DVec3]) -> DVec3 {
        let pace = self.weighted_sum(v) - self.velocity;
        pace - self.normal * self.normal.dot(&pace)
    }

    /// What it does at `x` and `v`, `seconds` before the time it was found for; `size` is the body's.
    pub(super) fn at(&self, x: &[DVec3], v: &[DVec3], seconds: f64, size: f64) -> ContactState {
        let depth = self.depth(x, seconds);
        if let Some(then) = self.frozen {
            let push = then.normal_force + then.slope * (depth - then.depth);
            let drag = match then.mode {
                ContactMode::Open | ContactMode::Frictionless => DVec3::zeros(),
                ContactMode::Sticking => self.slip(v) * then.grip,
                ContactMode::Sliding => then.slip * (self.friction * self.load),
            };
            let force = if then.mode == ContactMode::Open { DVec3::zeros() } else { self.normal * push - drag };
            // Sliding goes on whatever its speed: nothing resists across it either.
            let grip = if then.mode == ContactMode::Sliding { 0.0 } else { then.grip };
            return ContactState { depth, normal_force: push, force, grip, ..then };
        }
        let mut state = ContactState {
            mode: ContactMode::Open,
            force: DVec3::zeros(),
            depth,
            normal_force: 0.0,
            slope: 0.0,
            grip: 0.0,
            slip: DVec3::zeros(),
            energy: 0.0,
        };
        if depth > 0.0 {
            state.mode = ContactMode::Frictionless;
            (state.normal_force, state.slope, state.energy) = self.spring(depth);
            state.force = self.normal * state.normal_force;
        }
        // A load goes on through the step, as otherwise friction would begin and end with a jump.
        let most = self.friction * self.load;
        if most > 0.0 {
            let slip = self.slip(v);
            let (speed, creep) = (slip.norm(), creep(size).max(most / self.hold));
            state.mode = if speed <= creep { ContactMode::Sticking } else { ContactMode::Sliding };
            state.grip = most / speed.max(creep);
            state.slip = slip / speed.max(creep);
            state.force -= slip * state.grip;
        }
        state
    }

    /// Takes the push at `x`, `seconds` before the time it was found for, as what friction counts: so friction has an energy
    /// of its own, and what is solved stays convex. A contact that begins has none yet. Where the surface moves so far that
    /// its plane then is not known it is what the particle was under at last, of `loads`.
    pub(super) fn with_load(&self, x: &[DVec3], loads: &[f64], seconds: f64) -> Self {
        let near = self.velocity.norm() * seconds <= self.gap;
        let last = self.sides().map(|(particle, _)| loads[particle]).fold(0.0, f64::max);
        let now = if near {
            self.load_at_depth(self.depth(x, seconds))
        } else if self.single_particle().is_some() {
            last
        } else {
            0.0
        };
        Self { load: now.min(last), ..*self }
    }

    /// The push at `x`, as a load.
    pub(super) fn load_at(&self, x: &[DVec3]) -> f64 {
        self.load_at_depth(self.depth(x, 0.0))
    }

    fn load_at_depth(&self, depth: f64) -> f64 {
        // Where surfaces are through each other the push is no load but a way out.
        if depth <= 0.0 || self.gap_fraction(depth) > 1.0 {
            return 0.0;
        }
        let deepest = if self.gap > 0.0 { STRAIGHT * self.gap } else { f64::INFINITY };
        self.spring(depth.min(deepest)).0
    }

    /// The push at a depth > 0, its slope, and the energy it stores.
    fn spring(&self, depth: f64) -> (f64, f64, f64) {
        let (k, gap) = (self.penalty_stiffness, self.gap);
        let edge = STRAIGHT * gap;
        if gap <= 0.0 {
            return (k * depth, k, 0.5 * k * depth * depth);
        }
        let curved = |depth: f64| {
            let left = 1.0 - depth / gap;
            (k * depth / left, k / (left * left), k * gap * (-depth - gap * libm::log(left)))
        };
        if depth <= edge {
            return curved(depth);
        }
        let (push, slope, energy) = curved(edge);
        let more = depth - edge;
        (push + slope * more, slope, energy + push * more + 0.5 * slope * more * more)
    }

    /// Makes the push linear where it is `expected`, if that is less than it is: from too deep, where it grows without limit,
    /// Newton's method would come back by half of what is left at a time.
    pub(super) fn expect(&self, state: &mut ContactState, expected: f64) {
        if self.frozen.is_some() || state.depth <= 0.0 || self.gap <= 0.0 || expected >= state.normal_force {
            return;
        }
        let left = self.penalty_stiffness / (self.penalty_stiffness + expected / self.gap);
        let slope = self.penalty_stiffness / (left * left);
        let push = expected + slope * (state.depth - self.gap * (1.0 - left));
        (state.normal_force, state.slope) = (push, slope);
    }

    /// The push where particles are a `share` of `dx` on.
    pub(super) fn expected(&self, state: &ContactState, dx: &[DVec3], share: f64) -> f64 {
        if state.depth <= 0.0 {
            return 0.0;
        }
        (state.normal_force - state.slope * share * self.normal.dot(&self.weighted_sum(dx))).max(0.0)
    }

    /// The energy that friction counts as in a line search, where `v` changes by 1/a of what `x` does.
    pub(super) fn friction_energy(&self, v: &[DVec3], a: f64, size: f64) -> f64 {
        let most = self.friction * self.load;
        let (speed, creep) = (self.slip(v).norm(), creep(size).max(most / self.hold));
        let held = if speed <= creep { 0.5 * speed * speed / creep } else { speed - 0.5 * creep };
        a * most * held
    }

    /// What it resists for steps of `a`: up to three directions, each scaled by the root of its stiffness.
    ///
    /// Friction grows no further once surfaces slide, so that Newton's method alone would turn slips round and back. It is
    /// made linear together with what it is (Chan, Golub & Mulet 1999): with no `drag` it resists as slower surfaces would,
    /// which never overshoots, and with the drag that belongs to the slip exactly.
    pub(super) fn stiffness_directions(&self, state: &ContactState, a: f64, drag: &DVec3) -> ([DVec3; 3], usize) {
        let n = self.normal;
        let mut out = [n * (a * a * state.slope).max(0.0).sqrt(), DVec3::zeros(), DVec3::zeros()];
        let (along, [least, most]) = match state.mode {
            ContactMode::Open => return (out, 0),
            ContactMode::Frictionless => return (out, 1),
            ContactMode::Sticking => (DVec3::zeros(), [1.0, 1.0]),
            ContactMode::Sliding => {
                let (length, common) = (drag.norm(), drag.dot(&state.slip));
                let middle = if length > 0.0 { drag / length + state.slip } else { state.slip };
                (middle, [1.0 - 0.5 * (common + length), 1.0 - 0.5 * (common - length)])
            }
        };
        let any = || n.cross(&if n.x.abs() < 0.7 { DVec3::x() } else { DVec3::y() }).normalize();
        let along = along.try_normalize(OPPOSITE).unwrap_or_else(any);
        out[1] = along * (a * state.grip * least).max(0.0).sqrt();
        out[2] = n.cross(&along) * (a * state.grip * most).max(0.0).sqrt();
        (out, 3)
    }

    /// The drag that belongs to where particles are a `share` of `dx` on in a stage of `a`, of length 1 at most, as the
    /// system that [`Self::resisted`] with `drag` stands for has it. None where all of a step that was too long would have
    /// turned the slip round.
    pub(super) fn drag(&self, state: &ContactState, drag: &DVec3, dx: &[DVec3], share: f64, a: f64) -> DVec3 {
        let most = self.friction * self.load;
        if most <= 0.0 || state.mode == ContactMode::Open {
            return DVec3::zeros();
        }
        let way = self.weighted_sum(dx);
        let more = (way - self.normal * self.normal.dot(&way)) * (state.grip / (a * most));
        let slides = state.mode == ContactMode::Sliding;
        if slides && share < 1.0 && state.slip.dot(&(state.slip + more)) < 0.0 {
            return DVec3::zeros();
        }
        let turned = if slides { more - drag * state.slip.dot(&more) } else { more };
        let next = drag.lerp(&(state.slip + turned), share);
        next * (SURE / next.norm().max(1.0))
    }

    /// That, as the block of a particle alone in it.
    pub(super) fn add_block(&self, resisted: &([DVec3; 3], usize), weight: f64, block: &mut [f64; 6]) {
        resisted.0[..resisted.1].iter().for_each(|way| add_square(block, *way, weight * weight));
    }
}

/// Slip at which friction is all of μN, m/s.
fn creep(size: f64) -> f64 {
    (CREEP * size).max(f64::MIN_POSITIVE)
}
