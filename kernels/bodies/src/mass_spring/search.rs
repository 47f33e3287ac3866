//! The incremental potential that a stage minimises, and the line search on it, which never ends higher than it
//! started.

use super::assemble::velocities;
use super::body::SoftBody;
use super::contact::ContactConstraint;
use super::friction::LoadBalance;
use super::springs;
use super::stage::{BodySolver, CG_SHARE, CG_SHARE_PRECISE, FrameContext, Solved, Stage};
use numerics::simd::Path;
use numerics::vector::{DVec2, DVec3};

/// Final ÷ initial residual.
const SHARE: f64 = 0.05;
/// Tolerance of linear solves with contacts, relative to the residual: more Newton iterations follow anyway. With 0.2 those
/// of stiff bodies that hit a surface do not find their loads of friction.
const CG_SHARE_LINE_SEARCH: f64 = 0.17;
/// Where loads are settled, a solve need not leave less than this share of the residual that suffices.
const CG_SHARE_LAST: f64 = 0.5;
/// Largest number of step halvings in a line search.
const HALVINGS: usize = 16;
/// A line search that took more than this fraction of its step indicates how much decrease is left.
const LONG: f64 = 0.2;
/// Newton iterations of a stage without contacts, and with contacts.
const MOST: u32 = 12;
const MOST_IN_CONTACT: u32 = 60;
/// The same in a frame that took too many already, and where obstacles leave no room, so that loads have no balance.
const MOST_HURRIED: u32 = 30;
const MOST_JAMMED: u32 = 20;
/// Changes of the loads of friction after which these stay fixed, so that the descent terminates.
const MOST_RELOADS: u32 = 20;
/// Motion of a particle, relative to the mean spring length, after which tetrahedra may have become thin.
const THINNING: f64 = 0.1;
/// Fraction of the objective that is rounding: smaller decreases are not searched for.
const ROUNDING: f64 = 1e-12;

/// The objective, in two parts.
#[derive(Clone, Copy, Debug, Default)]
struct ObjectiveParts {
    /// Contribution of contacts.
    contacts: f64,
    /// All other contributions.
    others: f64,
}

impl ObjectiveParts {
    fn sum(self) -> f64 {
        self.contacts + self.others
    }
}

impl BodySolver {
    /// Solves the stage from the initial guess `x` by Newton's method with line search, until the residual is small, no
    /// contact is too deep, and the loads of friction are the normal forces of bodies in balance. Updates the loads of
    /// `contacts` on the way. `scale` bounds the squared initial residual, so that a poor initial guess does not loosen the
    /// tolerance; what sufficed in descents of the step `before` suffices again.
    pub(super) fn descend(
        &mut self,
        stage: &Stage<'_>,
        contacts: &mut [ContactConstraint],
        scale: f64,
        before: &Solved,
        x: &mut [DVec3],
    ) -> Solved {
        let context = &stage.context;
        self.begin(&Stage { contacts: &*contacts, ..*stage });
        let jammed = contacts.iter().any(|contact| contact.is_jammed(x));
        let most = match (contacts.is_empty(), jammed) {
            (true, _) => MOST,
            (_, true) => MOST_JAMMED,
            (_, false) if self.hurried => MOST_HURRIED,
            (_, false) => MOST_IN_CONTACT,
        };
        let mut solved = Solved::default();
        let (mut base, mut slow, mut stuck, mut reloads) = (ObjectiveParts::default(), false, false, 0);
        // How far particles of each piece may have moved since tetrahedra were last watched.
        let (mut moved, mut reloaded) = (vec![f64::INFINITY; context.body.order.pieces.len()], false);
        loop {
            let stage = &Stage { contacts: &*contacts, ..*stage };
            if std::mem::take(&mut reloaded) {
                self.assemble_contacts(stage, x);
            } else {
                self.assemble(stage, x, true);
            }
            let now = self.square(stage);
            if solved.newton == 0 {
                solved.first = if before.first > 0.0 { before.first } else { now };
                base = self.objective(stage, x);
                solved.enough = before.enough.max(SHARE * SHARE * now.min(scale));
            }
            solved.set_residual(now);
            let deep = contacts.iter().any(|contact| contact.is_too_deep(x));
            let balance = if jammed { LoadBalance::default() } else { self.balance(stage, x) };
            let reload = !balance.agrees() && reloads < MOST_RELOADS;
            if reload && !deep && (stuck || balance.is_readable()) {
                let a = stage.a;
                base.contacts += self.reload(contacts, x, a, context.body.size);
                (slow, stuck, reloads, reloaded) = (false, false, reloads + 1, true);
                continue;
            }
            let wanted = (now > solved.enough && !slow) || deep || reload || !balance.is_in_balance();
            let is_cancelled = solved.newton > 0 && (context.cancelled)();
            if !wanted || stuck || is_cancelled || solved.newton >= most {
                if moved.iter().any(|moved| *moved > 0.0)
                    && self.watch_thin(context, x)
                    && !is_cancelled
                    && solved.newton < most
                {
                    base.others = self.other_objective(stage, x);
                    (slow, stuck, self.measured) = (false, false, true);
                    moved.fill(0.0);
                    continue;
                }
                let gave_up = wanted && !stuck && most > MOST;
                solved.caps += u32::from(gave_up && (deep || self.is_unsettled(context.body)));
                break;
            }
            // Forces that are left on bodies as wholes are a small part of the residual.
            let asked = match (stage.contacts.is_empty(), (now <= solved.enough || slow) && !deep) {
                (true, _) => CG_SHARE,
                (false, false) if balance.is_settled() && !deep => {
                    CG_SHARE_LINE_SEARCH.max(CG_SHARE_LAST * (solved.enough / now).sqrt())
                }
                (false, false) => CG_SHARE_LINE_SEARCH,
                (false, true) => CG_SHARE_PRECISE,
            };
            self.store_noncontact_residual(stage);
            self.use_linearised_forces(stage);
            if !self.direction(stage, asked, Some(&balance), x, &mut solved) {
                self.watch_thin(context, x);
                break;
            }
            self.volumes.predict(context.body, &self.dx);
            let (share, lower, stopped) = self.search(stage, x, base);
            self.follow(stage, share, x);
            self.measured = share > 0.0;
            let all = share > LONG && !stopped;
            slow = all && base.sum() - lower.sum() <= solved.enough;
            // Only a direction without predictions is sure to lead downhill.
            stuck = share == 0.0 && !self.used_predicted_pressures();
            if share == 0.0 {
                self.forget_pressures();
            }
            base = lower;
            if self.add_moves(context.body, share, &mut moved) {
                moved.fill(0.0);
                if self.watch_thin(context, x) {
                    base.others = self.other_objective(stage, x);
                }
            }
        }
        let stage = &Stage { contacts: &*contacts, ..*stage };
        if self.correct_angular_momentum_downhill(stage, base.sum(), x) && !solved.failed {
            solved.set_residual(self.square(stage));
        }
        solved
    }

    /// Adds to how far each piece has `moved` a `share` of the direction, by its largest component; returns whether
    /// tetrahedra may have become thin by that.
    fn add_moves(&self, body: &SoftBody, share: f64, moved: &mut [f64]) -> bool {
        let mut any = false;
        for (particles, moved) in body.pieces().zip(moved) {
            *moved += share * self.dx[particles.clone()].iter().map(|d| d.amax()).fold(0.0, f64::max);
            any |= *moved > THINNING * body.spacing[particles.start];
        }
        any
    }

    /// Corrects the angular momentum of free groups, unless that raises the objective above `base`, as closing
    /// contacts may. Returns whether `x` was changed.
    fn correct_angular_momentum_downhill(&mut self, stage: &Stage<'_>, base: f64, x: &mut [DVec3]) -> bool {
        let turned = self.corrected_angular_momentum(stage, x);
        let Some(turned) = turned.filter(|turned| turned != x) else { return false };
        let level = self.objective(stage, &turned).sum();
        self.measured = level <= base + ROUNDING * base.abs();
        if self.measured {
            x.copy_from_slice(&turned);
            self.assemble(stage, x, false);
            return true;
        }
        velocities(stage, x, &mut self.v);
        false
    }

    /// The objective at `x`; sets the velocities to those at `x`.
    fn objective(&mut self, stage: &Stage<'_>, x: &[DVec3]) -> ObjectiveParts {
        ObjectiveParts { contacts: self.contact_objective(stage, x), others: self.other_objective(stage, x) }
    }

    /// The objective ½(x − y)ᵀM(x − y) + a²·(potentials) without contacts, at positions for which
    /// [`Self::contact_objective`] was just evaluated.
    fn other_objective(&mut self, stage: &Stage<'_>, x: &[DVec3]) -> f64 {
        let (FrameContext { body, external, .. }, a) = (stage.context, stage.a);
        self.volumes.measure(body, x);
        let [stored, thin] = self.volumes.energy(&stage.context, x, &self.inventory.watched);
        let (v, links) = (&self.v, &self.links);
        let clusters = &body.order.clusters;
        let sums = clusters.sum((), |cluster, ()| {
            let particles = clusters.range(cluster);
            let springs = springs::potential(Path::chosen(), &body.adjacency, links, x, particles.clone());
            let free = particles.filter(|particle| !external.held[*particle]);
            free.fold(DVec2::new(springs, 0.0), |sum, particle| {
                let mass = body.mass[particle];
                let energy = external.energy(particle, mass, &stage.now, a, x[particle], v[particle]);
                let inertial = 0.5 * mass * (x[particle] - stage.y[particle]).norm_squared();
                DVec2::new(sum.x + energy, sum.y + inertial)
            })
        });
        let (own, inertial) = (sums.x, sums.y);
        inertial + a * a * (stored + self.volumes.damped + thin + own)
    }

    /// Contribution of contacts to the objective at `x`; sets the velocities to those at `x`.
    fn contact_objective(&mut self, stage: &Stage<'_>, x: &[DVec3]) -> f64 {
        let (body, a) = (stage.context.body, stage.a);
        velocities(stage, x, &mut self.v);
        let of = |contact: &ContactConstraint| {
            let state = contact.at(x, &self.v, stage.early, body.size);
            state.energy + contact.friction_energy(&self.v, a, body.size)
        };
        a * a * stage.contacts.iter().map(of).sum::<f64>()
    }

    /// Stores the residual without contact forces.
    fn store_noncontact_residual(&mut self, stage: &Stage<'_>) {
        self.noncontact_residual.clone_from(&self.r);
        for (contact, state) in stage.contacts.iter().zip(&self.contact_states) {
            for (particle, weight) in contact.sides().filter(|side| !self.system.held[side.0]) {
                self.noncontact_residual[particle] -= state.force * (weight * stage.a * stage.a);
            }
        }
    }

    /// Tries 1, ½, ¼ … of `dx` until the objective falls below `base`, each both unchanged and limited by [`Self::stop`].
    /// `dx` becomes the direction actually taken. Returns the fraction of it, 0 if none lowers the objective, the objective at
    /// the end, and whether particles were stopped at contacts.
    ///
    /// The contact part is evaluated first: a trial is rejected without evaluating the rest if contacts gain more
    /// than the rest can lose along its initial slope. Moving too far into a contact is the usual reason for a
    /// rejection.
    fn search(&mut self, stage: &Stage<'_>, x: &[DVec3], base: ObjectiveParts) -> (f64, ObjectiveParts, bool) {
        let mut trial = std::mem::take(&mut self.trial);
        let mut found = (0.0, base, false);
        let most = base.sum() + ROUNDING * base.sum().abs();
        let clusters = &stage.context.body.order.clusters;
        let shares = std::iter::successors(Some(1.0), |share| Some(0.5 * share)).take(HALVINGS);
        for (share, stopped) in shares.flat_map(|share| [(share, false), (share, true)]) {
            if !stopped {
                trial.clear();
                trial.extend(x.iter().zip(&self.dx).map(|(x, d)| x + d * share));
            } else if !self.stop(stage, x, &mut trial) {
                continue;
            }
            let contacts = self.contact_objective(stage, &trial);
            let lost = |particle: usize| self.noncontact_residual[particle].dot(&(trial[particle] - x[particle]));
            let lost: f64 = clusters.sum((), |cluster, ()| clusters.range(cluster).map(lost).sum());
            if base.sum() + (contacts - base.contacts) - lost > most {
                continue;
            }
            let lower = ObjectiveParts { contacts, others: self.other_objective(stage, &trial) };
            if lower.sum() <= most {
                if stopped {
                    self.dx.iter_mut().zip(&trial).zip(x).for_each(|((d, trial), x)| *d = (trial - x) / share);
                }
                found = (share, lower, stopped);
                break;
            }
        }
        self.trial = trial;
        found
    }

    /// Stops single points on their way from `x` to `trial` where they would get too deep into a contact; returns
    /// whether there were any. The direction does not know of contacts that it closes and linearises their forces; a
    /// single such point would otherwise shorten the step of all others. Free pieces that touch no obstacle yet stop as wholes:
    /// falling on, their inside would pass their skin and be found below the obstacle.
    fn stop(&self, stage: &Stage<'_>, x: &[DVec3], trial: &mut [DVec3]) -> bool {
        let (body, held, mut stopped) = (stage.context.body, &stage.context.external.held, false);
        let (pieces, touching): (Vec<_>, _) = (body.pieces().collect(), self.touching_obstacles(stage));
        let moves = |contact: &&ContactConstraint| contact.sides().any(|side| !held[side.0]);
        for contact in stage.contacts.iter().filter(|contact| contact.is_of_one_point()).filter(moves) {
            let Some(back) = contact.overshoot(x, trial) else { continue };
            let piece = body.layout.piece_of(contact.particles[0] as usize);
            if self.groups[piece].is_some() && !touching[piece] {
                trial[pieces[piece].clone()].iter_mut().for_each(|trial| *trial += contact.normal * back);
            } else {
                contact.shift(back, held, trial);
            }
            stopped = true;
        }
        stopped
    }

    /// Whether each piece is pressed by an obstacle, as last linearised.
    pub(super) fn touching_obstacles(&self, stage: &Stage<'_>) -> Vec<bool> {
        let mut touching = vec![false; stage.context.body.order.pieces.len()];
        let known = stage.contacts.iter().zip(&self.contact_states);
        for (contact, _) in known.filter(|known| known.1.normal_force > 0.0 && !known.0.is_two_sided()) {
            touching[stage.context.body.layout.piece_of(contact.particles[0] as usize)] = true;
        }
        touching
    }
}
