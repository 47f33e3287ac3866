//! The objective that a stage makes least, and the line search on it: with it a stage never ends higher than it began.

use super::V3;
use super::assemble::velocities;
use super::springs;
use super::stage::{Newton, Setting, Solved, Stage, Work};
use super::state::Warm;

/// Halvings of a step that a line search tries.
const HALVINGS: u32 = 16;
/// Share of a step from which on what it gained tells what is left to gain.
const LONG: f64 = 0.2;
/// Iterations a stage with contacts may have.
const CONTACT_ITERATIONS: u32 = 20;
/// Share of the objective that is rounding: a smaller decrease is not searched for.
const ROUNDING: f64 = 1e-12;

impl Work {
    /// Newton's method downhill, until the residual is small enough and no contact too deep.
    pub(super) fn descend(
        &mut self,
        on: &Setting<'_>,
        stage: &Stage<'_>,
        newton: Newton,
        warm: &mut Warm,
        x: &mut [V3],
    ) -> Solved {
        let most = if stage.contacts.is_empty() { newton.most } else { CONTACT_ITERATIONS };
        let mut solved = Solved::default();
        let (mut first, mut base, mut slow, mut stuck) = (0.0, 0.0, false, false);
        loop {
            self.assemble(on, stage, x, true);
            let now = self.square(&on.body.order.clusters);
            if solved.newton == 0 {
                first = now;
                base = self.objective(on, stage, x);
                solved.enough = newton.enough.max(newton.share * newton.share * first.min(newton.scale));
            }
            solved.residual = if first > 0.0 { (now / first).sqrt() } else { 0.0 };
            let deep = stage.contacts.iter().any(|contact| contact.too_near(x));
            let wanted = (now > solved.enough && !slow) || deep;
            if !wanted || stuck || solved.newton >= most {
                solved.caps += u32::from(wanted && !stuck && most == CONTACT_ITERATIONS);
                solved.failed = !now.is_finite();
                return solved;
            }
            self.foresee(stage);
            if !self.direction(on, stage, warm, x, &mut solved) {
                return solved;
            }
            let (share, lower) = self.search(on, stage, x, base);
            self.follow(stage, share, x);
            self.measured = share > 0.0;
            (slow, stuck) = (share > LONG && base - lower <= solved.enough, share == 0.0);
            base = lower;
        }
    }

    /// What the stage makes least: ½(x − y)ᵀM(x − y) + a²·(energies).
    pub(super) fn objective(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[V3]) -> f64 {
        let (body, a) = (on.body, stage.a);
        let mut v = std::mem::take(&mut self.v);
        velocities(&body.order.clusters, x, stage, &mut v);
        let damped = self.volumes.measure(body, x, &v, a);
        let stored = self.volumes.stored + damped;
        let watched = &self.inventory.watched;
        let thin: f64 = self.volumes.thin(body, x, on.volumes, watched).iter().map(|thin| thin.energy).sum();
        let mut contact = 0.0;
        for touching in stage.contacts {
            let touch = touching.at(x, &v, stage.early, body.size);
            contact += touch.energy + touching.friction_energy(&v, a, body.size);
        }
        let springs = body.spring_parts.sum((), |part, ()| {
            let of = |at| springs::energy(body, &on.rest, x, at) + springs::dissipation(body, &on.rest, x, &v, at, a);
            body.spring_parts.range(part).map(of).sum()
        });
        let clusters = &body.order.clusters;
        let (mut own, mut inertial) = (0.0, 0.0);
        for (mine, moved) in clusters.map((), |cluster, ()| {
            clusters.range(cluster).filter(|place| !on.drive.held[*place]).fold((0.0, 0.0), |sum, place| {
                let mass = body.mass[place];
                let energy = on.drive.energy(place, mass, stage.time, a, x[place], v[place]);
                (sum.0 + energy, sum.1 + 0.5 * mass * (x[place] - stage.y[place]).norm_squared())
            })
        }) {
            own += mine;
            inertial += moved;
        }
        self.v = v;
        inertial + a * a * (stored + thin + contact + springs + own)
    }

    /// The share of `dx` that lowers the objective from `base`, 1, ½, ¼ …, or 0 where none does; and what it is there.
    pub(super) fn search(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[V3], base: f64) -> (f64, f64) {
        let mut trial = std::mem::take(&mut self.trial);
        let mut share = 1.0;
        for _ in 0..HALVINGS {
            trial.clear();
            trial.extend(x.iter().zip(&self.dx).map(|(x, d)| x + d * share));
            let value = self.objective(on, stage, &trial);
            if value <= base + ROUNDING * base.abs() {
                self.trial = trial;
                return (share, value);
            }
            share *= 0.5;
        }
        self.trial = trial;
        (0.0, base)
    }
}
