//! The objective that a stage makes least, and the line search on it: with it a stage never ends higher than it began.

use super::assemble::velocities;
use super::contact::Touching;
use super::springs;
use super::stage::{Setting, Solved, Stage, Work};
use super::state::Warm;
use numerics::vector::DVec3;

/// Halvings of a step that a line search tries.
const HALVINGS: usize = 16;
/// Share of a step from which on what it gained tells what is left to gain.
const LONG: f64 = 0.2;
/// Iterations a stage may have without contacts, and with them.
const MOST: u32 = 4;
const MOST_TOUCHING: u32 = 20;
/// Iterations after which friction counts what it counted at last, so that a descent ends.
const RELOADS: u32 = 8;
/// Share of all loads that friction may have counted otherwise than they turn out.
const CHANGED: f64 = 0.3;
/// Share of the objective that is rounding: a smaller decrease is not searched for.
const ROUNDING: f64 = 1e-12;

/// When a descent ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Enough {
    /// Share of the first residual.
    pub(super) share: f64,
    /// That residual's square counts as this at most: what a guess that is far off leaves is no measure.
    pub(super) scale: f64,
    /// A residual's square that is enough whatever the first was.
    pub(super) square: f64,
    /// The square of the residual that the step began with; 0 where it begins here.
    pub(super) first: f64,
}

/// The objective at some positions.
#[derive(Clone, Copy, Debug, Default)]
struct Level {
    /// What contacts count in it.
    contacts: f64,
    /// What all else does.
    others: f64,
}

impl Level {
    fn sum(self) -> f64 {
        self.contacts + self.others
    }
}

/// Where a line search ends.
struct Found {
    /// Of the direction; 0 where none lowers the objective.
    share: f64,
    /// The objective there.
    lower: Level,
    /// Whether contacts stopped particles.
    stopped: bool,
}

impl Work {
    /// Solves the stage from the guess `x` by Newton's method downhill, until the residual is small enough and no contact too
    /// deep. Friction counts the pushes that `contacts` are found to have on the way, which replace their loads.
    pub(super) fn descend(
        &mut self,
        on: &Setting<'_>,
        stage: &Stage<'_>,
        contacts: &mut [Touching],
        enough: Enough,
        warm: &mut Warm,
        x: &mut [DVec3],
    ) -> Solved {
        self.begin(on, contacts);
        let most = if contacts.is_empty() { MOST } else { MOST_TOUCHING };
        let mut solved = Solved::default();
        let (mut base, mut slow, mut stuck) = (Level::default(), false, false);
        loop {
            let stage = &Stage { contacts: &*contacts, ..*stage };
            self.assemble(on, stage, x, true);
            let now = self.square(&on.body.order.clusters);
            if solved.newton == 0 {
                solved.first = if enough.first > 0.0 { enough.first } else { now };
                let contacts = self.of_contacts(on, stage, x);
                base = Level { contacts, others: self.of_others(on, stage, x) };
                solved.enough = enough.square.max(enough.share * enough.share * now.min(enough.scale));
            }
            solved.residual = if solved.first > 0.0 { (now / solved.first).sqrt() } else { 0.0 };
            let deep = contacts.iter().any(|contact| contact.too_near(x));
            let wanted = (now > solved.enough && !slow) || deep;
            if !wanted || stuck || solved.newton >= most {
                solved.caps += u32::from(wanted && !stuck && most == MOST_TOUCHING);
                solved.failed = !now.is_finite();
                break;
            }
            self.keep_pull(stage);
            self.foresee(stage);
            if !self.direction(on, stage, warm, x, &mut solved) {
                break;
            }
            let Found { share, lower, stopped } = self.search(on, stage, x, base);
            self.follow(stage, share, x);
            self.measured = share > 0.0;
            let all = share > LONG && !stopped;
            (slow, stuck) = (all && base.sum() - lower.sum() <= solved.enough, share == 0.0);
            base = lower;
            let loads_may_change = share == 1.0 && !deep && solved.newton <= RELOADS;
            if loads_may_change && let Some(more) = reload(contacts, x, &self.v, stage.a, on.body.size) {
                base.contacts += more;
                slow = false;
            }
        }
        let stage = &Stage { contacts: &*contacts, ..*stage };
        self.turn_downhill(on, stage, base, x);
        solved
    }

    /// Turns groups as wholes, if that does not lead higher than `base`: contacts that were open may close.
    fn turn_downhill(&mut self, on: &Setting<'_>, stage: &Stage<'_>, base: Level, x: &mut [DVec3]) {
        let mut turned = x.to_vec();
        self.turn(on.body, stage, &mut turned);
        if turned == x {
            return;
        }
        let contacts = self.of_contacts(on, stage, &turned);
        let level = Level { contacts, others: self.of_others(on, stage, &turned) };
        self.measured = level.sum() <= base.sum() + ROUNDING * base.sum().abs();
        if self.measured {
            x.copy_from_slice(&turned);
        } else {
            velocities(&on.body.order.clusters, x, stage, &mut self.v);
        }
    }

    /// What all but contacts count in what the stage makes least, ½(x − y)ᵀM(x − y) + a²·(energies), at positions that
    /// [`Self::of_contacts`] was asked about.
    fn of_others(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[DVec3]) -> f64 {
        let (body, a) = (on.body, stage.a);
        self.volumes.measure(body, x);
        let stored = self.volumes.stored + self.volumes.damped;
        let watched = &self.inventory.watched;
        let thin: f64 = self.volumes.thin(body, x, on.volumes, watched).iter().map(|thin| thin.energy).sum();
        let (v, links) = (&self.v, &self.links);
        let clusters = &body.order.clusters;
        let (mut own, mut inertial) = (0.0, 0.0);
        for (mine, moved) in clusters.map((), |cluster, ()| {
            clusters.range(cluster).fold((0.0, 0.0), |(own, inertial), place| {
                let springs = springs::energy_at(body.hanging.of(place, links), x, place);
                if on.drive.held[place] {
                    return (own + springs, inertial);
                }
                let mass = body.mass[place];
                let energy = on.drive.energy(place, mass, stage.time, a, x[place], v[place]);
                (own + springs + energy, inertial + 0.5 * mass * (x[place] - stage.y[place]).norm_squared())
            })
        }) {
            own += mine;
            inertial += moved;
        }
        inertial + a * a * (stored + thin + own)
    }

    /// What contacts count in it at `x`; makes velocities those there.
    fn of_contacts(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[DVec3]) -> f64 {
        let (body, a) = (on.body, stage.a);
        velocities(&body.order.clusters, x, stage, &mut self.v);
        let of = |contact: &Touching| {
            let touch = contact.at(x, &self.v, stage.early, body.size);
            touch.energy + contact.friction_energy(&self.v, a, body.size)
        };
        a * a * stage.contacts.iter().map(of).sum::<f64>()
    }

    /// Keeps what of the residual is not of contacts.
    fn keep_pull(&mut self, stage: &Stage<'_>) {
        self.pull.clone_from(&self.r);
        for (contact, touch) in stage.contacts.iter().zip(&self.touches) {
            for (place, weight) in contact.sides().filter(|side| !self.system.held[side.0]) {
                self.pull[place] -= touch.force * (weight * stage.a * stage.a);
            }
        }
    }

    /// Goes 1, ½, ¼ … of `dx` until that lowers the objective from `base`, each share as it is and then with [`stop`]. `dx`
    /// becomes what led there.
    ///
    /// Where contacts gain more on the way than all else loses on its slope, nothing else is asked: a step too far into a
    /// contact is the most usual of those that lower nothing.
    fn search(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[DVec3], base: Level) -> Found {
        let mut trial = std::mem::take(&mut self.trial);
        let mut found = Found { share: 0.0, lower: base, stopped: false };
        let most = base.sum() + ROUNDING * base.sum().abs();
        let clusters = &on.body.order.clusters;
        let shares = std::iter::successors(Some(1.0), |share| Some(0.5 * share)).take(HALVINGS);
        for (share, stopped) in shares.flat_map(|share| [(share, false), (share, true)]) {
            if !stopped {
                trial.clear();
                trial.extend(x.iter().zip(&self.dx).map(|(x, d)| x + d * share));
            } else if !stop(on, stage, x, &mut trial) {
                continue;
            }
            let contacts = self.of_contacts(on, stage, &trial);
            let lost = |place: usize| self.pull[place].dot(&(trial[place] - x[place]));
            let lost = clusters.sum((), |cluster, ()| clusters.range(cluster).map(lost).sum());
            if base.sum() + (contacts - base.contacts) - lost > most {
                continue;
            }
            let lower = Level { contacts, others: self.of_others(on, stage, &trial) };
            if lower.sum() <= most {
                if stopped {
                    self.dx.iter_mut().zip(&trial).zip(x).for_each(|((d, trial), x)| *d = (trial - x) / share);
                }
                found = Found { share, lower, stopped };
                break;
            }
        }
        self.trial = trial;
        found
    }
}

/// Stops particles that go from `x` to `trial` on their own where they would get too deep into a contact, and says whether
/// there were any. A direction knows nothing of contacts that it closes, and takes their pushes for straight lines: one
/// particle that has to stop would hold up all others.
fn stop(on: &Setting<'_>, stage: &Stage<'_>, x: &[DVec3], trial: &mut [DVec3]) -> bool {
    let mut stopped = false;
    for contact in stage.contacts {
        let Some((place, weight)) = contact.alone().filter(|side| !on.drive.held[side.0]) else { continue };
        if let Some(back) = contact.stops(x, trial) {
            trial[place] += contact.normal * (back / weight);
            stopped = true;
        }
    }
    stopped
}

/// Has friction count the pushes that contacts have at `x`, where velocities are `v`, if what it counted before is another by
/// more than [`CHANGED`]: then gives how much more it counts in the objective of a stage of `a`.
pub(super) fn reload(contacts: &mut [Touching], x: &[DVec3], v: &[DVec3], a: f64, size: f64) -> Option<f64> {
    let sums = contacts.iter().map(|contact| (contact.push(x), contact.load));
    let (sum, changed) = sums.fold((0.0, 0.0), |sums, (now, then)| (sums.0 + now, sums.1 + (now - then).abs()));
    (changed > CHANGED * sum).then(|| {
        let more = contacts.iter_mut().map(|contact| {
            let before = contact.friction_energy(v, a, size);
            contact.load = contact.push(x);
            contact.friction_energy(v, a, size) - before
        });
        a * a * more.sum::<f64>()
    })
}
