//! One step: TR-BDF2, or implicit Euler.
//!
//! TR-BDF2 (Bank et al. 1985) goes by the trapezoidal rule to γ = 2 − √2 of the step and by the second backward
//! difference from there: order 2, L-stable, and both stages are the same equation M(x − y) = a²f(x, (x − z)/a) with
//! a = γh/2. Its error estimate is Hosea & Shampine's (1996). Implicit Euler is that equation once, with a = h.
//!
//! A step that begins off balance (turned tetrahedra, contacts that changed in the step before, or the caller says so) is
//! implicit Euler with line search, which calms what TR-BDF2 would carry on: an impact within its first stage would come
//! back from it 1.4 times as fast, as any method of order 2 continues forces. So is one in which contacts change or that
//! turned out bad, again from the start.

use super::body::Body;
use super::contact::{Mode, Touching};
use super::energy::{Energies, measure};
use super::frame::{Frame, Integrator};
use super::guess::{Guess, Rigid};
use super::springs::{distance, drift};
use super::stage::{Newton, Setting, Solved, Stage, Work};
use super::state::Warm;
use super::volume::Inventory;
use numerics::vector::DVec3;

const GAMMA: f64 = 2.0 - std::f64::consts::SQRT_2;
/// Newton iterations a stage has by default where its force turned out otherwise than foreseen.
const MOST: u32 = 4;
/// Newton iterations a stage has in accurate mode.
const MOST_ACCURATE: u32 = 12;
/// Share of the tolerance at which Newton's method stops in accurate mode.
const NEWTON_SHARE: f64 = 0.1;
/// Share of the energy at hand that a step may gain before it is done again with implicit Euler.
const GAIN: f64 = 0.005;
/// Steps of implicit Euler after one in which contacts changed otherwise than foreseen.
const UNSETTLED: u32 = 4;

/// Positions and velocities, the solver's order.
#[derive(Clone, Debug)]
pub(super) struct Moving {
    pub(super) x: Vec<DVec3>,
    pub(super) v: Vec<DVec3>,
    /// How velocities changed in the step before, m/s²: what the next one's first guess goes by, nothing else.
    pub(super) trend: Vec<DVec3>,
    /// The push of an obstacle that each particle was under at last, newtons.
    pub(super) loads: Vec<f64>,
}

/// What a step took and reached.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stepped {
    pub(super) solved: Solved,
    /// Largest estimated error of a particle, metres.
    pub(super) estimate: f64,
    pub(super) euler: bool,
    /// Whether that was to calm it, not for its contacts.
    pub(super) calmed: bool,
    /// Joules taken out.
    pub(super) shed: f64,
    pub(super) after: Energies,
    pub(super) contacts: u32,
    pub(super) overlap: f64,
    pub(super) stopped: u32,
}

/// What steps are made with.
pub(super) struct Stepper<'a> {
    pub(super) work: &'a mut Work,
    pub(super) setting: Setting<'a>,
    pub(super) frame: &'a Frame<'a>,
    /// Of the frame.
    pub(super) seconds: f64,
    pub(super) warm: &'a mut Warm,
    /// Steps for which contacts are taken to change.
    pub(super) unsettled: &'a mut u32,
    /// Energy that steps have lost so far and that rounding of others may bring back, joules.
    pub(super) reserve: &'a mut f64,
}

impl Stepper<'_> {
    /// From one of `times`, shares of the frame, to the other; `tolerance` in metres where Newton's method is to converge.
    /// `before` are the energies there; `calm` asks for implicit Euler.
    pub(super) fn step(
        &mut self,
        moving: &mut Moving,
        times: [f64; 2],
        before: &Energies,
        tolerance: Option<f64>,
        calm: bool,
    ) -> Stepped {
        let h = (times[1] - times[0]) * self.seconds;
        let body = self.setting.body;
        let start = moving.clone();
        let mut stepped = Stepped::default();

        let mut full = match self.frame.contacts {
            Some(_) => {
                let ahead: Vec<DVec3> = start.x.iter().zip(&start.v).map(|(x, v)| x + v * h).collect();
                self.contacts(&start, &ahead, times)
            }
            None => Vec::new(),
        };
        let turned = self.frame.volume > 0.0 && self.work.inventory.turned > 0;
        // What pushes a way out grows no weaker in a straight line: it would throw.
        let through = full.iter().any(|contact| contact.is_through(&start.x, h));
        let rough = calm || *self.unsettled > 0 || self.frame.rough || turned || through;
        *self.unsettled = self.unsettled.saturating_sub(1);
        let mut after = None;
        if rough || self.frame.integrator == Integrator::Euler {
            let off = calm || self.frame.rough || turned;
            (stepped.solved, stepped.estimate) = self.euler(moving, times, &mut full, off);
            (stepped.euler, stepped.calmed) = (true, off);
        } else {
            let size = body.size;
            let frozen: Vec<Touching> = full.iter().map(|c| c.frozen(&start.x, &start.v, h, size)).collect();
            (stepped.solved, stepped.estimate) = self.tr_bdf2(moving, times, &frozen, tolerance);
            let energies = measure(self.work, &self.setting, times[1], moving, true);
            let gain = energies.sum() - before.sum();
            let gained = self.undriven() && gain > GAIN * before.scale().max(energies.kinetic - before.kinetic);
            after = Some(energies);
            let mut goes_on = frozen.iter().all(|contact| contact.goes_on(&moving.x, &moving.v));
            if goes_on {
                let (found, missed) = self.missed(&full, &start, &moving.x, times);
                stepped.solved.deepest = deepest(&found, &moving.x);
                goes_on = !missed;
            }
            let thinned = goes_on && self.thinned(&moving.x);
            if stepped.solved.failed || gained || !goes_on || thinned || !energies.sum().is_finite() {
                moving.clone_from(&start);
                let off = stepped.solved.failed || gained;
                let (again, estimate) = self.euler(moving, times, &mut full, off);
                let solved = Solved { failed: again.failed, residual: again.residual, ..sum(stepped.solved, again) };
                stepped = Stepped { solved, estimate, euler: true, calmed: off, ..Stepped::default() };
                after = None;
                *self.unsettled = if goes_on { 0 } else { UNSETTLED };
            }
        }
        if full.iter().any(|c| (c.clearance(&start.x, h) < 0.0) != (c.clearance(&moving.x, 0.0) < 0.0)) {
            *self.unsettled = (*self.unsettled).max(1);
        }
        (stepped.contacts, stepped.overlap) = self.work.touching();
        stepped.overlap = stepped.overlap.max(stepped.solved.deepest);
        let touches = stepped.euler || stepped.contacts > 0;
        let trend = |(v, before): (&DVec3, &DVec3)| if touches { DVec3::zeros() } else { (v - before) / h };
        moving.trend = moving.v.iter().zip(&start.v).map(trend).collect();
        moving.loads = self.loads(&full, &moving.x);
        self.keep_finite(&start, moving, &mut stepped);
        self.look(moving);
        stepped.after = match after.filter(|_| stepped.stopped == 0) {
            Some(energies) => energies,
            None => measure(self.work, &self.setting, times[1], moving, false),
        };
        if self.undriven() {
            self.shed(before, moving, &mut stepped);
        } else {
            *self.reserve = 0.0;
        }
        stepped
    }

    /// Looks the tetrahedra over for what begins where particles are now.
    pub(super) fn look(&mut self, moving: &Moving) {
        let seen = self.work.seen.take();
        self.work.inventory =
            seen.unwrap_or_else(|| Inventory::new(self.setting.body, &moving.x, self.setting.volumes));
    }

    /// Looks them over within a step, and says whether any got thin at `x` that were not watched.
    pub(super) fn thinned(&mut self, x: &[DVec3]) -> bool {
        if self.work.volumes.is_off() {
            return false;
        }
        let (body, volumes) = (self.setting.body, self.setting.volumes);
        let seen = Inventory::new(body, x, volumes);
        let thinned = self.work.inventory.watch(&seen, body, x, volumes);
        self.work.seen = Some(seen);
        thinned
    }

    /// Whether nothing from outside did work in the step but gravity and goals that stand still: contacts may be near, not
    /// push.
    fn undriven(&self) -> bool {
        !self.setting.drive.moves() && self.work.touches.iter().all(|touch| touch.mode == Mode::Apart)
    }

    fn newton(&self, tolerance: Option<f64>) -> Newton {
        match tolerance {
            Some(tolerance) => Newton { most: MOST_ACCURATE, tolerance: NEWTON_SHARE * tolerance },
            None => Newton { most: MOST, tolerance: 0.0 },
        }
    }

    fn tr_bdf2(
        &mut self,
        moving: &mut Moving,
        times: [f64; 2],
        contacts: &[Touching],
        tolerance: Option<f64>,
    ) -> (Solved, f64) {
        let body = self.setting.body;
        let h = (times[1] - times[0]) * self.seconds;
        let a = 0.5 * GAMMA * h;
        let middle = times[0] + GAMMA * (times[1] - times[0]);
        let newton = self.newton(tolerance);

        let start = moving.clone();
        let guess = Guess::new(body, &self.loose(), &start.x, &start.v, &start.trend, h);
        let mut x = guess.at(2.0 * a);
        let spinning = guess.spinning();
        let mut stage = Stage { y: &[], z: &[], a, time: times[0], contacts, early: h, spinning: &spinning, index: 0 };
        let volumes = self.work.volumes.drift(body, &moving.x, &moving.v);
        // Lengths and volumes go by the same rules as positions do.
        let on_from_start = |work: &mut Work, seconds: f64| {
            let length = |first, second| {
                let [length, pace] = drift(&moving.x, &moving.v, first, second);
                length + pace * seconds
            };
            let volumes = volumes.iter().map(|[volume, pace]| volume + pace * seconds).collect();
            work.come_from(&self.setting, a, length, volumes);
        };
        on_from_start(self.work, -a);
        let force = self.work.forces(&self.setting, &stage, &moving.x, &moving.v);
        on_from_start(self.work, a);
        let mut z: Vec<DVec3> = moving.x.iter().zip(&moving.v).map(|(x, v)| x + v * a).collect();
        let y: Vec<DVec3> = (0..x.len())
            .map(|place| z[place] + moving.v[place] * a + force[place] * (a * a / body.mass[place]))
            .collect();
        self.pin(&mut x, &mut z, middle, a);
        (stage.y, stage.z, stage.time, stage.early) = (&y, &z, middle, (1.0 - GAMMA) * h);
        let first = self.work.solve(&self.setting, &stage, newton, self.warm, &mut x);
        let v_middle: Vec<DVec3> = x.iter().zip(&z).map(|(x, z)| (x - z) / a).collect();
        let x_middle = x;

        // Of the second backward difference: what the middle and the start count.
        let weight = 1.0 / (GAMMA * (2.0 - GAMMA));
        let start_weight = weight * (1.0 - GAMMA) * (1.0 - GAMMA);
        let mix = |middle: &[DVec3], start: &[DVec3]| -> Vec<DVec3> {
            middle.iter().zip(start).map(|(middle, start)| middle * weight - start * start_weight).collect()
        };
        let swollen = self.work.volumes.at(body, &x_middle);
        let swollen = swollen.iter().zip(&volumes).map(|(now, [then, _])| now * weight - then * start_weight).collect();
        let length = |first, second| {
            distance(&x_middle, first, second) * weight - distance(&moving.x, first, second) * start_weight
        };
        self.work.come_from(&self.setting, a, length, swollen);
        let (mut z, z_pace) = (mix(&x_middle, &moving.x), mix(&v_middle, &moving.v));
        let y: Vec<DVec3> = z.iter().zip(&z_pace).map(|(z, pace)| z + pace * a).collect();
        let mut x = guess.past(h, GAMMA, &x_middle);
        self.pin(&mut x, &mut z, times[1], a);
        let stage = Stage { y: &y, z: &z, a, time: times[1], contacts, early: 0.0, spinning: &spinning, index: 1 };
        let second = self.work.solve(&self.setting, &stage, newton, self.warm, &mut x);
        let v: Vec<DVec3> = x.iter().zip(&z).map(|(x, z)| (x - z) / a).collect();

        let scale = 2.0 * h * (-3.0 * GAMMA * GAMMA + 4.0 * GAMMA - 2.0) / (12.0 * (2.0 - GAMMA));
        let raw = |place: usize| {
            let bent = moving.v[place] / GAMMA - v_middle[place] / (GAMMA * (1.0 - GAMMA)) + v[place] / (1.0 - GAMMA);
            if self.setting.drive.held[place] { DVec3::zeros() } else { bent * (scale * body.mass[place]) }
        };
        let mut error: Vec<DVec3> = (0..x.len()).map(raw).collect();
        let mut solved = sum(first, second);
        if tolerance.is_some() {
            let reached = self.work.filter(body, self.warm, &mut error);
            solved.cg += reached.iterations;
        } else {
            self.work.smooth(body, self.warm, &mut error);
        }
        let estimate = error.iter().map(DVec3::norm_squared).fold(0.0, f64::max).sqrt();
        (moving.x, moving.v) = (x, v);
        (solved, estimate)
    }

    /// Particles that do not go along with their piece: those held, and those that hang on nothing.
    fn loose(&self) -> Vec<bool> {
        let (held, alone) = (&self.setting.drive.held, &self.work.system.alone);
        (0..held.len()).map(|place| held[place] || alone.get(place) == Some(&true)).collect()
    }

    /// Puts held particles where they are at `time`, and where (x − z)/a is their velocity.
    pub(super) fn pin(&self, x: &mut [DVec3], z: &mut [DVec3], time: f64, a: f64) {
        self.setting.drive.hold(time, x, z, a);
    }

    /// Particles that are nowhere stay where they were.
    fn keep_finite(&mut self, start: &Moving, moving: &mut Moving, stepped: &mut Stepped) {
        for place in 0..moving.x.len() {
            if !moving.x[place].iter().chain(moving.v[place].iter()).all(|x| x.is_finite()) {
                (moving.x[place], moving.v[place]) = (start.x[place], DVec3::zeros());
                moving.trend[place] = DVec3::zeros();
                stepped.stopped += 1;
                self.work.seen = None;
            }
        }
    }

    /// Slows all particles against their mean where the step made energy.
    fn shed(&mut self, before: &Energies, moving: &mut Moving, stepped: &mut Stepped) {
        /// Share of the energy that is rounding.
        const ROUNDING: f64 = 1e-9;
        /// Share of it that what was lost may bring back.
        const LENT: f64 = 2e-3;
        let after = &mut stepped.after;
        let gained = after.sum() - before.sum();
        *self.reserve = (*self.reserve - gained).min(LENT * after.scale());
        if *self.reserve >= -ROUNDING * before.scale().max(after.scale()) {
            return;
        }
        let body = self.setting.body;
        let held = &self.setting.drive.held;
        // What bends a piece pays first, then all that is not a shift of it: momentum is not to pay.
        for turning in [true, false] {
            let gained = -*self.reserve;
            let mut moved = moving.v.clone();
            for piece in &body.order.pieces {
                let rigid = Rigid::new(body, held, piece, &moving.x, &moving.v, &moving.trend);
                let rigid = if turning { rigid } else { rigid.shift() };
                for place in rigid.places.clone() {
                    moved[place] = rigid.velocity(moving.x[place]);
                }
            }
            let own = |v: &[DVec3], place: usize| v[place] - moved[place];
            let inner: f64 =
                (0..body.len()).map(|place| 0.5 * body.mass[place] * own(&moving.v, place).norm_squared()).sum();
            if !(gained > 0.0 && inner > 0.0) {
                continue;
            }
            let keep = ((inner - gained) / inner).max(0.0).sqrt();
            for place in (0..body.len()).filter(|place| !held[*place]) {
                moving.v[place] = moved[place] + own(&moving.v, place) * keep;
            }
            let kinetic = kinetic(body, &moving.v);
            *self.reserve += after.kinetic - kinetic;
            stepped.shed += after.kinetic - kinetic;
            after.kinetic = kinetic;
        }
    }
}

/// Joules.
fn kinetic(body: &Body, v: &[DVec3]) -> f64 {
    v.iter().zip(&body.mass).map(|(v, mass)| 0.5 * mass * v.norm_squared()).sum()
}

/// How far the worst contact is below its gap at `x`, metres; 0 where none is.
pub(super) fn deepest(contacts: &[Touching], x: &[DVec3]) -> f64 {
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
