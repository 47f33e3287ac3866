//! One implicit stage, M(x − y) = a²·f(x, (x − z)/a), solved by Newton's method.
//!
//! Implicit Euler is one such stage, TR-BDF2 two with the same a. The Jacobian is made positive semi-definite, so
//! every Newton direction is a descent direction; with a line search the objective never rises. By default a stage
//! takes one iteration; more follow where the force deviated from its linearisation and, with contacts, until these
//! converge.

use super::body::SoftBody;
use super::coarse::{self, ClusterMotions, ContactFilters};
use super::conjugate_gradients::{Coarse, Limits, Reached};
use super::contact::{ContactConstraint, ContactState};
use super::external::{ExternalForces, Moment};
use super::friction::LoadBalance;
use super::galerkin::Galerkin;
use super::springs::{self, Link, Record, RestLengths, Sums};
use super::state::CachedCoarseFactor;
use super::system::System;
use super::volume::{Inventory, ThinTet, Volumes};
use numerics::quad::Quad;
use numerics::vector::DVec3;

/// Tolerance of linear solves, relative to the residual.
pub(super) const CG_SHARE: f64 = 0.1;
/// That with contacts whose state is frozen: nothing corrects it later, so slip would drift and piles would jump. And that
/// where only bodies as wholes are out of balance.
pub(super) const CG_SHARE_PRECISE: f64 = 0.02;
/// Noise in the rotation of free pieces that a linear solve may leave, as a fraction of their rotational energy: it
/// would slow them down.
const NOISE: f64 = 1e-8;
/// Tolerance of linear solves that are to be precise, once bodies as wholes are in balance.
const LOOSE: f64 = 0.5;
/// Largest number of iterations of a linear solve.
const CG_CAP: u32 = 300;
/// A direction that moves no particle by more than this share of the size of the bodies is not seen.
const UNSETTLED: f64 = 1e-4;
/// The coarse factor is renewed once solves take this many times the iterations that they took with it new.
const STALE: f64 = 1.5;
/// It is also renewed after this many iterations, since it may have been poor from the start.
const OLD: u32 = 500;
/// It is also renewed after this change of the contact filter, which is worth about ten iterations.
const CONTACTS_CHANGED: f64 = 0.3;
/// Deviation of the force from its linearisation, relative to the initial residual, that requires another iteration.
const NONLINEAR: f64 = 0.35;
/// Largest growth of the squared residual in an iteration without line search.
const RISE: f64 = 100.0;

/// The equation of a stage.
#[derive(Clone, Copy)]
pub(super) struct Stage<'a> {
    pub(super) context: FrameContext<'a>,
    pub(super) y: &'a [DVec3],
    pub(super) z: &'a [DVec3],
    /// Step coefficient, seconds.
    pub(super) a: f64,
    /// Its end.
    pub(super) now: Moment,
    pub(super) contacts: &'a [ContactConstraint],
    /// Seconds from that time to the one that contacts were detected for.
    pub(super) early: f64,
    /// Kinetic energy of rotation of each piece, joules; may be empty: no bound on the noise.
    pub(super) rotational_energy: &'a [f64],
    /// Whether Newton's method runs with a line search and the set of active contacts may change: implicit Euler.
    pub(super) line_search: bool,
    /// Index of the stage in its step, for the iteration counts.
    pub(super) index: usize,
}

impl<'a> Stage<'a> {
    /// The stage of a line search that ends at `time`, a fraction of the frame, with step coefficient `a`, with neither
    /// contacts nor a bound on noise.
    pub(super) fn new(context: FrameContext<'a>, [y, z]: [&'a [DVec3]; 2], a: f64, time: f64) -> Self {
        let now = context.external.at(time);
        Self { context, y, z, a, now, contacts: &[], early: 0.0, rotational_energy: &[], line_search: true, index: 0 }
    }

    /// a²f − M(x − y) of a particle at `x` on which a `force` acts; 0 if it is `held`.
    #[inline(always)]
    pub(super) fn residual(&self, held: bool, particle: usize, x: &[DVec3], force: DVec3) -> DVec3 {
        let mass = self.context.body.mass[particle];
        if held { DVec3::zeros() } else { force * (self.a * self.a) - (x[particle] - self.y[particle]) * mass }
    }
}

/// What is constant during a frame.
#[derive(Clone, Copy)]
pub(super) struct FrameContext<'a> {
    pub(super) body: &'a SoftBody,
    pub(super) external: &'a ExternalForces<'a>,
    pub(super) rest: RestLengths<'a>,
    /// Current rest volumes of tetrahedra.
    pub(super) volumes: &'a [f64],
    /// Whether the frame is no longer wanted.
    pub(super) cancelled: &'a (dyn Fn() -> bool + Sync),
}

/// Stopping criteria of Newton's method without line search.
#[derive(Clone, Copy, Debug)]
pub(super) struct Newton {
    /// Maximum number of iterations.
    pub(super) most: u32,
    /// Size of the last step at which to stop, metres; with 0, iterations continue while the force deviates from its
    /// linearisation.
    pub(super) tolerance: f64,
}

/// Outcome of a stage.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Solved {
    pub(super) newton: u32,
    pub(super) cg: u32,
    pub(super) caps: u32,
    /// Final ÷ initial residual.
    pub(super) residual: f64,
    /// Squared initial residual.
    pub(super) first: f64,
    /// Whether the residual rose too far or is not finite.
    pub(super) failed: bool,
    /// Target for the squared residual.
    pub(super) enough: f64,
    /// Depth of the deepest contact that sank beyond the accepted depth, metres below its gap; 0 without any.
    pub(super) unmet: f64,
    /// Whether surfaces of such a contact went through each other.
    pub(super) passed: bool,
    /// Depth of the deepest contact detected at the end, including ones that were not solved for, metres below its
    /// gap.
    pub(super) deepest: f64,
}

impl Solved {
    /// Sets the residual from its square.
    pub(super) fn set_residual(&mut self, square: f64) {
        self.residual = if self.first > 0.0 { (square / self.first).sqrt() } else { 0.0 };
        self.failed = !square.is_finite();
    }
}

/// Steps a body through frames. What it keeps between calls only saves allocations; it does not affect results.
#[derive(Clone, Debug, Default)]
pub struct BodySolver {
    pub(super) system: System,
    pub(super) volumes: Volumes,
    /// Whether `volumes` holds values for the positions evaluated next: a line search ends with evaluating the point
    /// it accepts.
    pub(super) measured: bool,
    /// Tetrahedra watched since the start of the step, and the latest full check.
    pub(super) inventory: Inventory,
    pub(super) latest_inventory: Option<Inventory>,
    /// Lengths of springs at the start of the step, and as last measured; of torn ones any. Metres.
    pub(super) lengths: Vec<f64>,
    pub(super) lengths_now: Vec<f64>,
    pub(super) offset_from_centroid: Vec<[f32; 4]>,
    /// Springs of the current stage.
    pub(super) links: Vec<Link>,
    /// Whether each particle is of a heap; empty if none is.
    pub(super) heaps: Vec<bool>,
    /// Sum of spring stiffnesses at each particle, N/m.
    pub(super) particle_stiffness: Vec<f64>,
    /// The factored coarse matrix, that of the state during a frame.
    pub(super) cached: CachedCoarseFactor,
    /// Velocities at the current positions.
    pub(super) v: Vec<DVec3>,
    /// Residual, a²f − M(x − y).
    pub(super) r: Vec<DVec3>,
    /// The residual without contact forces.
    pub(super) noncontact_residual: Vec<DVec3>,
    pub(super) dx: Vec<DVec3>,
    pub(super) trial: Vec<DVec3>,
    pub(super) thin_tets: Vec<ThinTet>,
    pub(super) contact_states: Vec<ContactState>,
    /// Predicted pressure of thin tetrahedra, Pa, in ascending order; `None` before the first linear system.
    pub(super) predicted_pressures: Option<Vec<(u32, f64)>>,
    /// Forces of contacts and thin tetrahedra; may be empty: none.
    pub(super) transient_forces: Vec<DVec3>,
    /// For each piece the free group it belongs to: pieces joined by contacts of which none is pinned. And which
    /// pieces are neither pinned nor in contact.
    pub(super) groups: Vec<Option<u32>>,
    pub(super) free_pieces: Vec<bool>,
    /// Whether the frame took so many iterations that descents give up sooner.
    pub(super) hurried: bool,
}

impl BodySolver {
    /// For `body`, whose topology must stay the same; its material may change.
    pub fn new(body: &SoftBody) -> Self {
        let count = body.len();
        let mut system = System {
            records: vec![Record::default(); body.adjacency.incident.len()],
            sums: vec![Sums::default(); count],
            inertia: vec![0.0; count],
            held: vec![false; count],
            isolated: vec![false; count],
            smoother: vec![[0.0; 6]; count],
            ..System::default()
        };
        let regions = &body.regions;
        system.regions.set_topology(count, &regions.starts, &regions.particles, regions.partition());
        Self { system, r: vec![DVec3::zeros(); count], ..Self::default() }
    }

    /// Starts a stage with step coefficient `a`. Dashpots measure changes of length and volume from the start of the
    /// step: `before` gives the length of a spring by its two ends, `volumes` those of the regions.
    pub(super) fn set_step_start(
        &mut self,
        context: &FrameContext<'_>,
        a: f64,
        before: impl Fn(usize, usize) -> f64 + Sync,
        volumes: Vec<f64>,
    ) {
        springs::links(context.body, &context.rest, a, before, &mut self.links);
        (self.volumes.a, self.volumes.before) = (a, volumes);
        self.measured = false;
    }

    /// Prepares a solve.
    pub(super) fn begin(&mut self, stage: &Stage<'_>) {
        self.find_free_groups(stage);
        self.forget_pressures();
        self.contact_states.clear();
        self.contact_states.extend(stage.contacts.iter().map(ContactConstraint::unsolved));
    }

    /// Solves the stage from the initial guess `x`, whose pinned particles are already in place, by Newton's method
    /// without line search; then corrects the angular momentum of free groups.
    pub(super) fn solve(&mut self, stage: &Stage<'_>, newton: Newton, x: &mut [DVec3]) -> Solved {
        self.begin(stage);
        let mut solved = Solved::default();
        loop {
            self.assemble(stage, x, true);
            let before = self.square(stage);
            if solved.newton == 0 {
                solved.first = before;
            }
            let asked = if stage.contacts.is_empty() { CG_SHARE } else { CG_SHARE_PRECISE };
            if !self.direction(stage, asked, None, x, &mut solved) {
                break;
            }
            let predicted = std::mem::take(&mut self.r);
            self.follow(stage, 1.0, x);
            self.r = vec![DVec3::zeros(); x.len()];
            self.assemble(stage, x, false);
            let after = self.square(stage);
            solved.set_residual(after);
            solved.failed |= after > RISE * before;
            let wanted = if newton.tolerance > 0.0 {
                self.dx.iter().any(|d| d.amax() > newton.tolerance)
            } else {
                let clusters = &stage.context.body.order.clusters;
                let deviation = |particle: usize| self.r[particle] - predicted[particle];
                self.squared_norm(clusters, deviation) > NONLINEAR * NONLINEAR * before
            };
            if solved.failed || !wanted || solved.newton >= newton.most || (stage.context.cancelled)() {
                break;
            }
        }
        if let Some(corrected) = self.corrected_angular_momentum(stage, x) {
            x.copy_from_slice(&corrected);
            self.assemble(stage, x, false);
            if !solved.failed {
                solved.set_residual(self.square(stage));
            }
        }
        solved
    }

    /// Applies a fraction `share` of `dx` and updates the predictions of forces.
    pub(super) fn follow(&mut self, stage: &Stage<'_>, share: f64, x: &mut [DVec3]) {
        for (contact, state) in stage.contacts.iter().zip(&mut self.contact_states) {
            contact.predict(state, &self.dx, share, stage.a);
        }
        self.volumes.shorten_predicted(share);
        let pressures = self.thin_tets.iter().map(|thin| (thin.tet, thin.predicted(&self.dx, share)));
        self.predicted_pressures = Some(pressures.collect());
        x.iter_mut().zip(&self.dx).for_each(|(x, d)| *x += d * share);
    }

    /// Takes stock within a step; returns whether tetrahedra that were not watched are thin at `x`.
    pub(super) fn watch_thin(&mut self, context: &FrameContext<'_>, x: &[DVec3]) -> bool {
        if self.volumes.is_disabled() {
            return false;
        }
        let seen = Inventory::new(context.body, x, context.volumes);
        let thinned = self.inventory.watch(&seen, context.body, x, context.volumes);
        self.latest_inventory = Some(seen);
        thinned
    }

    /// A⁻¹r, computed with conjugate gradients if it has to be `accurate`, and approximated by the preconditioner if not;
    /// and the number of iterations.
    pub(super) fn filter(&mut self, body: &SoftBody, accurate: bool, mut r: Vec<DVec3>) -> (Vec<DVec3>, u32) {
        let coarse = Coarse::new(body, &self.cached, &self.offset_from_centroid);
        if !accurate {
            return (coarse.precondition(&self.system, &r), 0);
        }
        let mut out = vec![DVec3::zeros(); r.len()];
        let limits = Limits::of(CG_SHARE, CG_CAP);
        let reached = coarse.solve(&mut self.system, limits, &mut out, &mut r);
        (out, reached.iterations)
    }

    /// Number of closed contacts, and the depth of the deepest, metres below its gap.
    pub(super) fn active_contacts(&self) -> (u32, f64) {
        let pushing = self.contact_states.iter().filter(|state| state.normal_force > 0.0);
        pushing.fold((0, 0.0), |(count, deepest), state| (count + 1, state.depth.max(deepest)))
    }

    /// Computes the Newton direction `dx` at `x` until the residual `r` of the linear system has fallen to the share that is
    /// `asked`, and again with the contacts that it closes if bodies are near `balance`. What is asked to be precise also ends
    /// once bodies as wholes are in balance. Returns false if the direction is not finite.
    pub(super) fn direction(
        &mut self,
        stage: &Stage<'_>,
        asked: f64,
        balance: Option<&LoadBalance>,
        x: &[DVec3],
        solved: &mut Solved,
    ) -> bool {
        let body = stage.context.body;
        self.dx.clear();
        self.dx.resize(x.len(), DVec3::zeros());
        let mut right = self.r.clone();
        let mut target = self.momentum_target(stage, &right);
        self.correct_linear_momentum(stage, &target);
        coarse::offset_from_centroid(&body.order.clusters, x, &mut self.offset_from_centroid);
        let filters = ContactFilters::new(&self.system, &body.layout);
        let old = self.cached.factor.len() != body.layout.rows() || self.cached.iterations_since > OLD;
        if old || filters.change(&self.cached.filters) > CONTACTS_CHANGED {
            self.renew(body, filters);
        }
        let usual = self.cached.initial_iterations[stage.index];
        let bound = if usual == 0 { CG_CAP } else { (3 * usual).max(usual + 10) };
        let free = stage.rotational_energy.iter().zip(&self.free_pieces).filter(|piece| *piece.1);
        let rotational_energy: f64 = free.map(|piece| piece.0).sum();
        let square =
            if rotational_energy > 0.0 { 2.0 * stage.a * stage.a * NOISE * rotational_energy } else { f64::INFINITY };
        let searching = !stage.contacts.is_empty() && stage.line_search;
        let precise = balance.filter(|_| asked == CG_SHARE_PRECISE);
        let holds = |r: &[Quad]| precise.is_some_and(|balance| balance.holds(stage.a, x, r));
        let limits = Limits { square, loose_share: LOOSE, suffices: &holds, ..Limits::of(asked, bound) };
        let first = self.gradients(body, limits, solved);
        let mut reached = first;
        if balance.is_some_and(LoadBalance::is_near) && self.close_contacts(stage, x, &mut right) {
            target = self.momentum_target(stage, &right);
            self.correct_linear_momentum(stage, &target);
            let share = if first.met { asked.max(first.share) } else { asked };
            let enough = share * share * first.start;
            reached = self.gradients(body, Limits { square: enough, ..Limits::of(1.0, bound) }, solved);
        }
        let usual = &mut self.cached.initial_iterations[stage.index];
        if *usual == 0 {
            *usual = first.iterations.max(1);
        } else if !searching && f64::from(first.iterations) > STALE * f64::from(*usual) + 1.0 {
            self.cached = CachedCoarseFactor::default();
        }
        let gave_up = !reached.met && self.is_unsettled(body);
        solved.caps += u32::from(gave_up);
        // The linear solve left part of the residual; momentum has to be exact.
        self.correct_linear_momentum(stage, &target);
        solved.newton += 1;
        solved.failed = !self.dx.iter().all(|d| d.iter().all(|d| d.is_finite()));
        !solved.failed
    }

    /// Whether the last direction moves a particle visibly, so that a solve that ends here is not done. Bodies at rest
    /// pass limits on iterations while they move by less than anyone sees.
    pub(super) fn is_unsettled(&self, body: &SoftBody) -> bool {
        let least = UNSETTLED * body.size();
        self.dx.iter().any(|d| d.norm() > least)
    }

    /// Solves the linear system from `dx` on; with a new coarse factor if that takes more iterations than the limit.
    fn gradients(&mut self, body: &SoftBody, limits: Limits<'_>, solved: &mut Solved) -> Reached {
        let mut solve = |solver: &mut Self, limits| {
            let coarse = Coarse::new(body, &solver.cached, &solver.offset_from_centroid);
            let reached = coarse.solve(&mut solver.system, limits, &mut solver.dx, &mut solver.r);
            solved.cg += reached.iterations;
            solver.cached.iterations_since += reached.iterations;
            reached
        };
        let first = solve(self, Limits { cap: limits.cap.min(CG_CAP), ..limits });
        if first.met || limits.cap >= CG_CAP {
            return first;
        }
        // The factor is too old to be useful.
        self.renew(body, ContactFilters::new(&self.system, &body.layout));
        let share = (limits.share / first.share.max(limits.share)).min(1.0);
        Reached { start: first.start, ..solve(self, Limits { share, cap: CG_CAP, ..limits }) }
    }

    fn renew(&mut self, body: &SoftBody, filters: ContactFilters) {
        let motions = ClusterMotions { offset_from_centroid: &self.offset_from_centroid, filters: &filters };
        let factor = Galerkin { body, system: &self.system, motions }.factor();
        self.cached = CachedCoarseFactor { factor, filters, ..CachedCoarseFactor::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::super::body::{Material, Mesh};
    use super::super::frame::SolverFrame;
    use super::*;
    use crate::tets::cubes;

    /// Calls `with` a stage of a spinning and deforming block without pins, and a solver for it.
    fn with_block(line_search: bool, with: impl Fn(&Stage<'_>, &mut BodySolver, Vec<DVec3>)) {
        let h = 1.0 / 24.0;
        let (points, tets) = cubes([3, 2, 2], [0.0; 3], [0.3, 0.2, 0.2]);
        let material = Material { density: 1000.0.into(), stiffness: 1e4.into(), damping: 0.01.into() };
        let mesh = Mesh { points: &points, tets: &tets, ..Mesh::default() };
        let body = SoftBody::new(&mesh, &material, &[]).unwrap();
        let frame = SolverFrame { gravity: [0.0; 3], ..SolverFrame::default() };
        let external = ExternalForces::new(&body, &frame, h);
        let rest = RestLengths { lengths: &body.lengths, torn: &[] };
        let context =
            FrameContext { body: &body, external: &external, rest, volumes: &body.volumes, cancelled: &|| false };
        let start: Vec<DVec3> = body.rest.iter().map(|x| x + DVec3::new(x.y * x.y, 0.3 * x.z, x.x * x.y)).collect();
        let inertial: Vec<DVec3> = start.iter().map(|x| x + DVec3::z().cross(x) * (5.0 * h)).collect();
        let mut solver = BodySolver::new(&body);
        solver.volumes = Volumes::new(&body, 1.0, &body.volumes);
        springs::particle_stiffness(&body, &context.rest, &mut solver.particle_stiffness);
        let volumes = solver.volumes.at(&body, &start);
        solver.set_step_start(&context, h, |a, b| springs::distance(&start, a, b), volumes);
        let stage = Stage { line_search, ..Stage::new(context, [&inertial, &start], h, 1.0) };
        with(&stage, &mut solver, inertial.clone());
    }

    /// The angular momentum of the block is corrected after Newton's method.
    #[test]
    fn the_residual_is_that_of_the_positions_returned() {
        for line_search in [false, true] {
            with_block(line_search, |stage, solver, mut x| {
                let solved = if line_search {
                    solver.descend(stage, &mut [], f64::INFINITY, &Solved::default(), &mut x)
                } else {
                    solver.solve(stage, Newton { most: 1, tolerance: 0.0 }, &mut x)
                };
                solver.assemble(stage, &x, false);
                assert!(solver.corrected_angular_momentum(stage, &x).is_some(), "nothing holds the block");
                let residual = (solver.square(stage) / solved.first).sqrt();
                assert!(residual > 0.0 && !solved.failed, "{solved:?}");
                let off = (solved.residual / residual - 1.0).abs();
                assert!(off < 1e-9, "line search {line_search}: {} instead of {residual}", solved.residual);
            });
        }
    }

    /// Without loads bodies are in balance under them.
    #[test]
    fn a_precise_linear_solve_ends_sooner_with_bodies_in_balance() {
        with_block(true, |stage, solver, x| {
            let mut iterations = |asked, balance: Option<&LoadBalance>| {
                let mut solved = Solved::default();
                solver.begin(stage);
                solver.assemble(stage, &x, true);
                let before = solver.square(stage);
                assert!(solver.direction(stage, asked, balance, &x, &mut solved));
                (solved.cg, solver.square(stage) / before)
            };
            let balance = LoadBalance::default();
            let [usual, precise, sooner] =
                [(CG_SHARE, None), (CG_SHARE_PRECISE, None), (CG_SHARE_PRECISE, Some(&balance))]
                    .map(|(asked, balance)| iterations(asked, balance));
            assert!(sooner.0 < usual.0 && usual.0 < precise.0, "{sooner:?} {usual:?} {precise:?}");
            assert_eq!(iterations(CG_SHARE, Some(&balance)), usual, "only precise ones");
        });
    }
}
