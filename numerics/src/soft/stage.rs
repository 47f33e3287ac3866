//! One implicit stage: M(x − y) = a²·f(x, (x − z)/a), by Newton's method.
//!
//! Implicit Euler is one such stage, TR-BDF2 two with the same a. The derivative is made positive semi-definite, so that each
//! iteration goes downhill; with a line search the objective never rises. One iteration is what a step has by default;
//! it goes on where contacts change or the force turned out otherwise than its derivative said.

use super::V3;
use super::body::Body;
use super::cg::{self, Coarse, Limits};
use super::coarse::{self, Layout};
use super::contact::{Mode, Touch, Touching};
use super::drive::Drive;
use super::guess::Turn;
use super::order::pieces;
use super::parts::{Parts, Several};
use super::rows::Rows;
use super::springs::{self, Link, Motion, Record, Rest};
use super::state::Warm;
use super::system::{System, halfway, smoother};
use super::volume::{Inventory, Thin, Volumes};
use nalgebra::Matrix3;

/// Share of the first residual that linear equations may leave.
const CG_SHARE: f64 = 0.1;
/// Share of the energy that turns free pieces which a linear solve may leave as noise: it would slow them.
const NOISE: f64 = 1e-8;
/// Iterations a linear solve has at most.
const CG_CAP: u32 = 300;
/// Times as many iterations as when it was new, at which the coarse factor is made again.
const STALE: f64 = 1.5;
/// Share of the first residual above which what the derivative did not foresee asks for another iteration.
const UNFORESEEN: f64 = 0.5;
/// Times as large as before that a residual's square may be after an iteration without line search.
const RISE: f64 = 100.0;
/// Iterations a stage may have where contacts change.
const CONTACT_ITERATIONS: u32 = 20;
/// Share of a step that a line search takes where friction is made linear with more care from then on.
const CAREFUL: f64 = 0.3;
/// Halvings of a step that a line search tries.
const HALVINGS: u32 = 16;
/// Share of the objective that is rounding: a smaller decrease is not searched for.
const ROUNDING: f64 = 1e-12;

/// What a stage is to solve.
#[derive(Clone, Copy)]
pub(super) struct Stage<'a> {
    pub(super) y: &'a [V3],
    pub(super) z: &'a [V3],
    /// Seconds.
    pub(super) a: f64,
    /// Share of the frame passed at its end.
    pub(super) time: f64,
    pub(super) contacts: &'a [Touching],
    /// Seconds from there to the time that contacts were found for.
    pub(super) early: f64,
    /// Energy that turns free pieces, joules.
    pub(super) spinning: f64,
    /// Which of a step's stages, for the count of iterations.
    pub(super) index: usize,
}

/// What holds for a whole frame.
#[derive(Clone, Copy)]
pub(super) struct Setting<'a> {
    pub(super) body: &'a Body,
    pub(super) drive: &'a Drive,
    pub(super) rest: Rest<'a>,
    /// Volumes of tetrahedra at rest.
    pub(super) volumes: &'a [f64],
}

/// When Newton's method stops.
#[derive(Clone, Copy, Debug)]
pub(super) struct Newton {
    /// Iterations at most; contacts that change get [`CONTACT_ITERATIONS`].
    pub(super) most: u32,
    /// With a line search, the share of the first residual that ends it.
    pub(super) share: f64,
    /// A step this short ends it, metres.
    pub(super) tolerance: f64,
    /// Whether the objective may not rise.
    pub(super) search: bool,
}

/// How sliding contacts resist in the linear system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Friction {
    Exact,
    Careful,
}

/// What a stage took and reached.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Solved {
    pub(super) newton: u32,
    pub(super) cg: u32,
    pub(super) caps: u32,
    /// Residual at the end ÷ at the start.
    pub(super) residual: f64,
    /// Whether the residual rose, or a number is not finite.
    pub(super) failed: bool,
}

/// Memory and the linear system, kept from stage to stage; nothing in it changes a bit.
#[derive(Clone, Debug, Default)]
pub(super) struct Work {
    pub(super) system: System,
    pub(super) layout: Layout,
    pub(super) volumes: Volumes,
    /// Tetrahedra as the step began.
    pub(super) inventory: Inventory,
    pub(super) arms: Vec<[f32; 3]>,
    /// The springs as the frame has them.
    pub(super) links: Vec<Link>,
    scratch: cg::Scratch,
    /// Velocities at the positions looked at.
    v: Vec<V3>,
    /// −(M(x − y) − a²f).
    r: Vec<V3>,
    dx: Vec<V3>,
    trial: Vec<V3>,
    pub(super) thin: Vec<Thin>,
    touches: Vec<Touch>,
    /// Contacts' and thin tetrahedra's forces; empty where there are none.
    extra: Vec<V3>,
    /// The group of each piece whose momentum nothing outside but gravity changes, and pieces that nothing touches.
    groups: Vec<Option<u32>>,
    turns: Vec<bool>,
}

impl Work {
    pub(super) fn new(body: &Body) -> Self {
        let count = body.len();
        let system = System {
            records: vec![Record::default(); body.hung.len()],
            inertia: vec![0.0; count],
            held: vec![false; count],
            smoother: vec![[0.0; 6]; count],
            ..System::default()
        };
        Self { system, layout: Layout::new(&body.order), r: vec![V3::zeros(); count], ..Self::default() }
    }

    /// The force on each particle at `x` and `v`.
    pub(super) fn forces(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[V3], v: &[V3]) -> Vec<V3> {
        self.loose_forces(on, stage, x, v);
        let mut out = vec![V3::zeros(); x.len()];
        let (body, work) = (on.body, &*self);
        let motion = Motion { x, v };
        body.order.clusters.each(&mut out[..], |cluster, out: &mut [V3]| {
            for (place, out) in body.order.clusters.range(cluster).zip(out) {
                *out = springs::force(work.links(body, place), &motion, place) + work.own_force(on, stage.time, place, &motion);
            }
        });
        out
    }

    /// Solves the stage from the guess `x`, whose held particles are where they have to be.
    pub(super) fn solve(
        &mut self,
        on: &Setting<'_>,
        stage: &Stage<'_>,
        newton: Newton,
        warm: &mut Warm,
        x: &mut Vec<V3>,
    ) -> Solved {
        let body = on.body;
        self.find_free(on, stage);
        let mut solved = Solved::default();
        let mut first = 0.0;
        let mut friction = Friction::Exact;
        loop {
            self.assemble(on, stage, x, Some(friction));
            let before = self.square();
            if solved.newton == 0 {
                first = before;
            }
            let modes: Vec<(Mode, bool)> = self.touches.iter().map(Touch::state).collect();
            let base = if newton.search { self.objective(on, stage, x) } else { 0.0 };
            self.direction(on, stage, warm, x, &mut solved);
            solved.newton += 1;
            let foreseen = std::mem::take(&mut self.r);
            if !self.dx.iter().all(|d| d.iter().all(|d| d.is_finite())) {
                self.r = foreseen;
                solved.failed = true;
                return solved;
            }
            let share = if newton.search { self.search(on, stage, x, base) } else { 1.0 };
            self.dx.iter_mut().for_each(|d| *d *= share);
            x.iter_mut().zip(&self.dx).for_each(|(x, d)| *x += d);
            self.r = vec![V3::zeros(); x.len()];
            self.assemble(on, stage, x, None);
            let after = self.square();
            if !newton.search && !(after <= RISE * before) {
                solved.failed = true;
                return solved;
            }
            solved.residual = if first > 0.0 { (after / first).sqrt() } else { 0.0 };
            let longest = self.dx.iter().map(|d| d.amax()).fold(0.0, f64::max);
            let unforeseen = share == 1.0 && self.distance(&foreseen) > UNFORESEEN * UNFORESEEN * before;
            let changed = self.touches.iter().zip(&modes).any(|(touch, state)| touch.state() != *state);
            let deep = stage.contacts.iter().any(|contact| contact.too_near(x));
            let stuck = share < CAREFUL && friction == Friction::Exact && !self.touches.is_empty();
            friction = if share < CAREFUL { Friction::Careful } else { Friction::Exact };
            let most = if changed || deep || stuck { CONTACT_ITERATIONS } else { newton.most };
            let wanted = if newton.search {
                solved.residual > newton.share
            } else if newton.tolerance > 0.0 {
                longest > newton.tolerance
            } else {
                unforeseen
            };
            let wanted = (wanted && share > 0.0) || stuck || ((changed || deep) && share > 0.0);
            if !wanted || solved.newton >= most {
                solved.failed |= !after.is_finite();
                self.turn(body, x);
                return solved;
            }
        }
    }

    /// The preconditioner's answer to a residual `r`: near A⁻¹r, in one go.
    pub(super) fn smooth(&self, body: &Body, warm: &Warm, r: &mut [V3]) {
        let coarse = Coarse { layout: &self.layout, factor: &warm.factor, arms: &self.arms };
        cg::precondition(&self.system, body, coarse, r);
    }

    /// A⁻¹r, by conjugate gradients.
    pub(super) fn filter(&mut self, body: &Body, warm: &Warm, r: &mut Vec<V3>) -> cg::Reached {
        let coarse = Coarse { layout: &self.layout, factor: &warm.factor, arms: &self.arms };
        let limits = Limits { share: CG_SHARE, square: f64::INFINITY, cap: CG_CAP };
        let mut out = vec![V3::zeros(); r.len()];
        let reached = cg::solve(&mut self.system, body, coarse, limits, &mut self.scratch, &mut out, r);
        *r = out;
        reached
    }

    /// Contacts that push, and the deepest of them, metres below its gap.
    pub(super) fn touching(&self) -> (u32, f64) {
        let pushing = self.touches.iter().filter(|touch| touch.push > 0.0);
        pushing.fold((0, 0.0), |(count, deepest), touch| (count + 1, touch.depth.max(deepest)))
    }

    /// Volumes, thin tetrahedra, contacts at `x` and `v`, and the forces of the last two.
    fn loose_forces(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[V3], v: &[V3]) {
        let body = on.body;
        self.volumes.measure(body, x, v, 0.0);
        self.thin = self.volumes.thin(body, x, on.volumes, &self.inventory.watched);
        self.touches.clear();
        self.touches.extend(stage.contacts.iter().map(|contact| contact.at(x, v, stage.early, body.size)));
        self.extra.clear();
        if !self.thin.is_empty() || !self.touches.is_empty() {
            self.extra.resize(x.len(), V3::zeros());
            for thin in &self.thin {
                for (corner, gradient) in thin.corners.iter().zip(&thin.gradient) {
                    self.extra[*corner as usize] += gradient * thin.pressure;
                }
            }
            for (contact, touch) in stage.contacts.iter().zip(&self.touches).filter(|pair| pair.1.mode != Mode::Apart) {
                for (place, weight) in contact.sides() {
                    self.extra[place] += touch.force * weight;
                }
            }
        }
    }

    #[inline(always)]
    fn links(&self, body: &Body, place: usize) -> &[Link] {
        &self.links[body.starts[place] as usize..body.starts[place + 1] as usize]
    }

    /// All but springs.
    #[inline(always)]
    fn own_force(&self, on: &Setting<'_>, time: f64, place: usize, motion: &Motion<'_>) -> V3 {
        let mut sum = on.drive.force(place, on.body.mass[place], time, motion.x[place], motion.v[place]);
        if !self.volumes.is_off() {
            sum -= self.system.regions.gather(place, &self.volumes.pressures, &self.volumes.gradients);
        }
        if let Some(extra) = self.extra.get(place) {
            sum += extra;
        }
        sum
    }

    /// The residual at `x`, and where `linear` the system there.
    fn assemble(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[V3], linear: Option<Friction>) {
        let (body, a) = (on.body, stage.a);
        let clusters = &body.order.clusters;
        let mut v = std::mem::take(&mut self.v);
        velocities(clusters, x, stage, &mut v);
        self.loose_forces(on, stage, x, &v);
        let motion = Motion { x, v: &v };
        let mut r = std::mem::take(&mut self.r);
        if let Some(friction) = linear {
            self.set_rows(on, stage, friction == Friction::Careful);
            let mut system = std::mem::take(&mut self.system);
            let (held, blocks, regions, loose) = (&system.held, &system.blocks, &system.regions, &system.loose);
            let parts = (
                &mut r[..],
                &mut system.inertia[..],
                &mut system.smoother[..],
                Several::new(&body.starts, &mut system.records),
            );
            // `own_force` reads the regions' entries, which have moved out of `self` with the system.
            let work = &*self;
            clusters.each(parts, |cluster, (r, inertia, smooth, mut records)| {
                let places = clusters.range(cluster).zip(r).zip(inertia).zip(smooth).zip(records.iter_mut());
                for ((((place, r), inertia), smooth), records) in places {
                    let (pull, mut block) = springs::linearise(work.links(body, place), &motion, a, place, records);
                    let mass = body.mass[place];
                    let mut own = on.drive.force(place, mass, stage.time, x[place], v[place]);
                    if !regions.is_empty() {
                        own -= regions.gather(place, &work.volumes.pressures, &work.volumes.gradients);
                        regions.add_block(place, &mut block);
                    }
                    own += work.extra.get(place).copied().unwrap_or_default();
                    if !loose.is_empty() {
                        loose.add_block(place, &mut block);
                    }
                    if let Some(extra) = blocks.get(place) {
                        block.iter_mut().zip(extra).for_each(|(sum, extra)| *sum += extra);
                    }
                    *inertia = mass + on.drive.inertia(place, mass, a);
                    [0, 3, 5].iter().for_each(|diagonal| block[*diagonal] += *inertia);
                    *r = if held[place] { V3::zeros() } else { (own + pull) * (a * a) - (x[place] - stage.y[place]) * mass };
                    *smooth = if held[place] { [0.0; 6] } else { smoother(&block) };
                }
            });
            self.system = system;
        } else {
            let work = &*self;
            clusters.each(&mut r[..], |cluster, r: &mut [V3]| {
                for (place, r) in clusters.range(cluster).zip(r) {
                    *r = if work.system.held[place] {
                        V3::zeros()
                    } else {
                        let force = springs::force(work.links(body, place), &motion, place)
                            + work.own_force(on, stage.time, place, &motion);
                        force * (a * a) - (x[place] - stage.y[place]) * body.mass[place]
                    };
                }
            });
        }
        self.r = r;
        self.v = v;
    }

    /// What volumes, thin tetrahedra and contacts resist.
    fn set_rows(&mut self, on: &Setting<'_>, stage: &Stage<'_>, careful: bool) {
        let (body, a) = (on.body, stage.a);
        let clusters = &body.order.clusters;
        if !self.volumes.is_off() {
            let weights = self.volumes.weights(a);
            self.system.regions.set(&weights, &self.volumes.gradients, clusters);
        }
        self.system.blocks.clear();
        let (mut starts, mut places, mut along) = (vec![0u32], Vec::new(), Vec::new());
        for thin in &self.thin {
            let root = (a * a * thin.stiffness).sqrt();
            places.extend(thin.corners);
            along.extend(thin.gradient.iter().map(|g| g * root));
            starts.push(places.len() as u32);
        }
        for (contact, touch) in stage.contacts.iter().zip(&self.touches).filter(|pair| pair.1.mode != Mode::Apart) {
            let resisted = contact.resisted(touch, a, careful);
            if let Some((place, weight)) = contact.alone() {
                if self.system.blocks.is_empty() {
                    self.system.blocks.resize(body.len(), [0.0; 6]);
                }
                contact.add_block(&resisted, weight, &mut self.system.blocks[place]);
                continue;
            }
            let (directions, count) = resisted;
            for direction in &directions[..count] {
                for (place, weight) in contact.sides() {
                    places.push(place as u32);
                    along.push(direction * weight);
                }
                starts.push(places.len() as u32);
            }
        }
        let parts = Parts::even(starts.len() - 1, 512, 1);
        let loose: &mut Rows = &mut self.system.loose;
        loose.set_topology(body.len(), &starts, &places, parts);
        loose.set(&vec![1.0; starts.len() - 1], &along, clusters);
    }

    /// The Newton direction `dx` at `x`; `r` becomes what of the residual it leaves.
    fn direction(&mut self, on: &Setting<'_>, stage: &Stage<'_>, warm: &mut Warm, x: &[V3], solved: &mut Solved) {
        let body = on.body;
        self.dx.clear();
        self.dx.resize(x.len(), V3::zeros());
        let wanted = self.momenta(body);
        self.shift(body, &wanted);
        coarse::arms(&body.order.clusters, x, &mut self.arms);
        if warm.factor.len() != self.layout.size() {
            self.renew(body, warm);
        }
        let fresh = &mut warm.fresh[stage.index];
        let bound = if *fresh == 0 { CG_CAP } else { (3 * *fresh).max(*fresh + 10) };
        let square = if stage.spinning > 0.0 { 2.0 * stage.a * stage.a * NOISE * stage.spinning } else { f64::INFINITY };
        let limits = Limits { share: CG_SHARE, square, cap: bound.min(CG_CAP) };
        let mut reached = self.iterate(body, warm, limits);
        solved.cg += reached.iterations;
        if !reached.met && bound < CG_CAP {
            // Stale past use: go on with a new one.
            self.renew(body, warm);
            let limits = Limits { share: (CG_SHARE / reached.share.max(CG_SHARE)).min(1.0), square, cap: CG_CAP };
            reached = self.iterate(body, warm, limits);
            solved.cg += reached.iterations;
        }
        let fresh = &mut warm.fresh[stage.index];
        if *fresh == 0 {
            *fresh = reached.iterations.max(1);
        } else if f64::from(reached.iterations) > STALE * f64::from(*fresh) + 1.0 {
            *warm = Warm::default();
        }
        solved.caps += u32::from(!reached.met);
        // Linear solves leave a share of the residual; momentum they may not touch.
        self.shift(body, &wanted);
    }

    fn iterate(&mut self, body: &Body, warm: &Warm, limits: Limits) -> cg::Reached {
        let coarse = Coarse { layout: &self.layout, factor: &warm.factor, arms: &self.arms };
        cg::solve(&mut self.system, body, coarse, limits, &mut self.scratch, &mut self.dx, &mut self.r)
    }

    fn renew(&mut self, body: &Body, warm: &mut Warm) {
        warm.factor = coarse::factor(&self.layout, body, &self.system, &self.arms);
        warm.fresh = [0; 2];
    }

    /// Which pieces, joined by contacts with each other, nothing but gravity, drag and goals acts on from outside; and which
    /// of them are in no contact.
    fn find_free(&mut self, on: &Setting<'_>, stage: &Stage<'_>) {
        let order = &on.body.order;
        let piece_of = |place: usize| {
            let cluster = self.layout.cluster[place] as usize;
            order.pieces.partition_point(|piece| piece.end <= cluster)
        };
        self.system.held.clone_from(&on.drive.held);
        let mut bound = vec![false; order.pieces.len()];
        let mut turns = vec![true; order.pieces.len()];
        for place in (0..on.body.len()).filter(|place| on.drive.held[*place]) {
            bound[piece_of(place)] = true;
        }
        let mut links = Vec::new();
        for contact in stage.contacts {
            let first = contact.places[0] as usize;
            for (place, _) in contact.sides() {
                turns[piece_of(place)] = false;
                links.push([piece_of(first) as u32, piece_of(place) as u32]);
                bound[piece_of(place)] |= contact.alone().is_some();
            }
        }
        let groups = pieces(order.pieces.len(), links.into_iter());
        let mut free = vec![true; order.pieces.len()];
        for (piece, group) in groups.iter().enumerate() {
            free[*group as usize] &= !bound[piece];
        }
        self.turns = turns.iter().zip(&bound).map(|(turns, bound)| *turns && !bound).collect();
        self.groups = groups.iter().map(|group| free[*group as usize].then_some(*group)).collect();
    }

    /// For each group of pieces the sum of residuals and of inertia.
    fn momenta(&self, body: &Body) -> Vec<(V3, f64)> {
        self.sums(body, |place| (self.r[place], self.system.inertia[place]))
    }

    fn sums(&self, body: &Body, of: impl Fn(usize) -> (V3, f64) + Sync) -> Vec<(V3, f64)> {
        let clusters = &body.order.clusters;
        let add = |sum: (V3, f64), part: (V3, f64)| (sum.0 + part.0, sum.1 + part.1);
        let sums =
            clusters.map((), |cluster, ()| clusters.range(cluster).map(&of).fold((V3::zeros(), 0.0), add));
        let mut groups = vec![(V3::zeros(), 0.0); body.order.pieces.len()];
        for (piece, group) in body.order.pieces.iter().zip(&self.groups) {
            if let Some(group) = group {
                let slot = &mut groups[*group as usize];
                *slot = sums[piece.clone()].iter().copied().fold(*slot, add);
            }
        }
        groups
    }

    /// Shifts each free group as a whole so that `dx` gives it the momentum `wanted`, and takes it from `r`.
    fn shift(&mut self, body: &Body, wanted: &[(V3, f64)]) {
        let given = self.sums(body, |place| (self.dx[place] * self.system.inertia[place], 0.0));
        for (index, piece) in body.order.pieces.iter().enumerate() {
            let Some(group) = self.groups[index].map(|group| group as usize) else { continue };
            let by = (wanted[group].0 - given[group].0) / wanted[group].1;
            if by.iter().all(|by| by.is_finite()) {
                for place in body.places(piece) {
                    self.dx[place] += by;
                    self.r[place] -= by * self.system.inertia[place];
                }
            }
        }
    }

    /// Turns each free piece as a whole so that it has the angular momentum of the stage's equation, whatever linear solves
    /// left: springs and volumes do not feel it.
    fn turn(&self, body: &Body, x: &mut [V3]) {
        /// Share of a piece's inertia below which it has none about an axis.
        const NOTHING: f64 = 1e-9;
        let inertia = &self.system.inertia;
        for (_, piece) in body.order.pieces.iter().enumerate().filter(|(index, _)| self.turns[*index]) {
            let places = body.places(piece);
            let (sum, mass) = places
                .clone()
                .fold((V3::zeros(), 0.0), |(sum, mass), place| (sum + x[place] * inertia[place], mass + inertia[place]));
            let middle = sum / mass;
            let (mut torque, mut tensor) = (V3::zeros(), Matrix3::zeros());
            for place in places.clone() {
                let arm = x[place] - middle;
                torque += arm.cross(&self.r[place]);
                tensor += (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * inertia[place];
            }
            tensor += Matrix3::identity() * (NOTHING * tensor.trace());
            let Some(angle) = tensor.try_inverse().map(|inverse| inverse * torque) else { continue };
            if angle.iter().all(|x| x.is_finite()) {
                let turn = Turn::by(angle);
                x[places].iter_mut().for_each(|x| *x = middle + turn.apply(*x - middle));
            }
        }
    }

    /// The residual's square in the norm of the particles' own blocks.
    fn square(&self) -> f64 {
        let mut all = 0.0;
        for (w, r) in self.system.smoother.iter().zip(&self.r) {
            all += halfway(w, *r).norm_squared();
        }
        all
    }

    /// That of its difference to another.
    fn distance(&self, other: &[V3]) -> f64 {
        let each = self.system.smoother.iter().zip(&self.r).zip(other);
        each.fold(0.0, |sum, ((w, r), other)| sum + halfway(w, *r - *other).norm_squared())
    }

    /// What the stage makes least: ½(x − y)ᵀM(x − y) + a²·(energies).
    fn objective(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[V3]) -> f64 {
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

    /// The share of `dx` that lowers the objective from `base`: 1, ½, ¼ …; 0 where none does.
    fn search(&mut self, on: &Setting<'_>, stage: &Stage<'_>, x: &[V3], base: f64) -> f64 {
        let mut trial = std::mem::take(&mut self.trial);
        let mut share = 1.0;
        for _ in 0..HALVINGS {
            trial.clear();
            trial.extend(x.iter().zip(&self.dx).map(|(x, d)| x + d * share));
            let value = self.objective(on, stage, &trial);
            if value <= base + ROUNDING * base.abs() {
                self.trial = trial;
                return share;
            }
            share *= 0.5;
        }
        self.trial = trial;
        0.0
    }
}

/// (x − z)/a.
fn velocities(clusters: &Parts, x: &[V3], stage: &Stage<'_>, v: &mut Vec<V3>) {
    v.resize(x.len(), V3::zeros());
    clusters.each(&mut v[..], |cluster, v: &mut [V3]| {
        for (place, v) in clusters.range(cluster).zip(v) {
            *v = (x[place] - stage.z[place]) / stage.a;
        }
    });
}
