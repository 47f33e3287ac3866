//! One implicit stage: M(x − y) = a²·f(x, (x − z)/a), by Newton's method.
//!
//! Implicit Euler is one such stage, TR-BDF2 two with the same a. The derivative is made positive semi-definite, so that each
//! iteration goes downhill; with a line search the objective never rises. One iteration is what a step has by default;
//! it goes on where the force turned out otherwise than its derivative said, and with contacts until they are met.

use super::body::Body;
use super::cg::{self, Coarse, Limits};
use super::coarse::{self, Anchors, Layout};
use super::contact::{Touch, Touching};
use super::drive::Drive;
use super::galerkin::Galerkin;
use super::springs::{Link, Record, Rest};
use super::state::Warm;
use super::system::System;
use super::volume::{Inventory, Thin, Volumes};
use numerics::vector::{DVec3, Vec3};

/// Share of the first residual that linear equations may leave.
const CG_SHARE: f64 = 0.1;
/// That share where contacts may change and Newton's method goes on anyway.
const CG_SHARE_SEARCHING: f64 = 0.2;
/// That share where contacts are taken to go on and nothing is solved again: a slip drifts by what is left, and piles jump.
const CG_SHARE_TOUCHING: f64 = 0.02;
/// Share of the energy that turns free pieces which a linear solve may leave as noise: it would slow them.
const NOISE: f64 = 1e-8;
/// Iterations a linear solve has at most.
const CG_CAP: u32 = 300;
/// Times as many iterations as when it was new, at which the coarse factor is made again.
const STALE: f64 = 1.5;
/// Iterations after which it is made again whatever it brings: what was good where it was made may do worse than a new one.
const OLD: u32 = 500;
/// Change of what contacts hold at which it is made again too: worth some ten iterations.
const MOVED: f64 = 0.3;
/// Share of the first residual above which what the derivative did not foresee asks for another iteration.
const UNFORESEEN: f64 = 0.35;
/// Times as large as before that a residual's square may be after an iteration without line search.
const RISE: f64 = 100.0;

/// What a stage is to solve.
#[derive(Clone, Copy)]
pub(super) struct Stage<'a> {
    pub(super) y: &'a [DVec3],
    pub(super) z: &'a [DVec3],
    /// Seconds.
    pub(super) a: f64,
    /// Share of the frame passed at its end.
    pub(super) time: f64,
    pub(super) contacts: &'a [Touching],
    /// Seconds from there to the time that contacts were found for.
    pub(super) early: f64,
    /// Energy that turns each piece, joules; none where it does not matter.
    pub(super) spinning: &'a [f64],
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
    /// Iterations at most.
    pub(super) most: u32,
    /// A step this short ends it, metres; 0 where it goes on as long as the force turns out otherwise than foreseen.
    pub(super) tolerance: f64,
}

/// What a stage took and reached.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Solved {
    pub(super) newton: u32,
    pub(super) cg: u32,
    pub(super) caps: u32,
    /// Residual at the end ÷ at the start.
    pub(super) residual: f64,
    /// The square of that at the start.
    pub(super) first: f64,
    /// Whether the residual rose, or a number is not finite.
    pub(super) failed: bool,
    /// The residual's square that was asked for.
    pub(super) enough: f64,
    /// How deep the worst contact is that got too deep, metres below its gap; 0 where none did.
    pub(super) unmet: f64,
    /// How deep the worst contact is of all there are at the end, those that nothing was done about too, metres below its gap.
    pub(super) deepest: f64,
}

/// Memory and the linear system, kept from stage to stage; nothing in it changes a bit.
#[derive(Clone, Debug, Default)]
pub(super) struct Work {
    pub(super) system: System,
    pub(super) layout: Layout,
    pub(super) volumes: Volumes,
    /// Whether they are of where the next look is: a search ends with measuring what it takes.
    pub(super) measured: bool,
    /// Tetrahedra as the step began, and where they were looked over since.
    pub(super) inventory: Inventory,
    pub(super) seen: Option<Inventory>,
    pub(super) arms: Vec<Vec3>,
    /// The springs as the frame has them.
    pub(super) links: Vec<Link>,
    /// Σk of those at each particle, N/m.
    pub(super) firmness: Vec<f64>,
    pub(super) scratch: cg::Scratch,
    /// Velocities at the positions looked at.
    pub(super) v: Vec<DVec3>,
    /// −(M(x − y) − a²f).
    pub(super) r: Vec<DVec3>,
    /// What of it is not of contacts.
    pub(super) pull: Vec<DVec3>,
    pub(super) dx: Vec<DVec3>,
    pub(super) trial: Vec<DVec3>,
    pub(super) thin: Vec<Thin>,
    pub(super) touches: Vec<Touch>,
    /// What friction each contact is taken to have, as a share of all that it can.
    pub(super) drags: Vec<DVec3>,
    /// What push each contact is expected to have, newtons.
    pub(super) pushes: Vec<f64>,
    /// Contacts whose push is linear from another than it has, and how much more that is.
    pub(super) unlike: Vec<(usize, f64)>,
    /// Contacts' and thin tetrahedra's forces; empty where there are none.
    pub(super) extra: Vec<DVec3>,
    /// The group of pieces that hang together by contacts, of each piece in one that is nowhere held; and pieces that nothing
    /// holds or touches.
    pub(super) groups: Vec<Option<u32>>,
    pub(super) turns: Vec<bool>,
}

impl Work {
    pub(super) fn new(body: &Body) -> Self {
        let count = body.len();
        let mut system = System {
            records: vec![Record::default(); body.hanging.hung.len()],
            inertia: vec![0.0; count],
            held: vec![false; count],
            smoother: vec![[0.0; 6]; count],
            ..System::default()
        };
        let regions = &body.regions;
        system.regions.set_topology(count, &regions.starts, &regions.particles, regions.parts());
        Self { system, layout: Layout::new(body), r: vec![DVec3::zeros(); count], ..Self::default() }
    }

    /// Makes ready for a stage's first look at `contacts`.
    pub(super) fn begin(&mut self, on: &Setting<'_>, contacts: &[Touching]) {
        self.find_free(on, contacts);
        self.drags.clear();
        self.drags.resize(contacts.len(), DVec3::zeros());
        self.pushes.clear();
        self.pushes.extend(contacts.iter().map(|contact| contact.load));
    }

    /// Solves the stage from the guess `x`, whose held particles are where they have to be, without looking back: Newton's
    /// method goes on where the force turned out otherwise than foreseen, or until steps are short.
    pub(super) fn solve(
        &mut self,
        on: &Setting<'_>,
        stage: &Stage<'_>,
        newton: Newton,
        warm: &mut Warm,
        x: &mut [DVec3],
    ) -> Solved {
        self.begin(on, stage.contacts);
        let solved = self.iterate(on, stage, newton, warm, x);
        self.turn(on.body, stage, x);
        solved
    }

    fn iterate(
        &mut self,
        on: &Setting<'_>,
        stage: &Stage<'_>,
        newton: Newton,
        warm: &mut Warm,
        x: &mut [DVec3],
    ) -> Solved {
        let clusters = &on.body.order.clusters;
        let mut solved = Solved::default();
        let mut first = 0.0;
        loop {
            self.assemble(on, stage, x, true);
            let before = self.square(clusters);
            if solved.newton == 0 {
                first = before;
            }
            if !self.direction(on, stage, warm, x, &mut solved) {
                return solved;
            }
            let foreseen = std::mem::take(&mut self.r);
            self.follow(stage, 1.0, x);
            self.r = vec![DVec3::zeros(); x.len()];
            self.assemble(on, stage, x, false);
            let after = self.square(clusters);
            solved.failed = after > RISE * before || !after.is_finite();
            solved.residual = if first > 0.0 { (after / first).sqrt() } else { 0.0 };
            let wanted = if newton.tolerance > 0.0 {
                self.dx.iter().map(|d| d.amax()).fold(0.0, f64::max) > newton.tolerance
            } else {
                self.distance(clusters, &foreseen) > UNFORESEEN * UNFORESEEN * before
            };
            if solved.failed || !wanted || solved.newton >= newton.most {
                return solved;
            }
        }
    }

    /// Goes a `share` of `dx`, with what contacts are expected to do there.
    pub(super) fn follow(&mut self, stage: &Stage<'_>, share: f64, x: &mut [DVec3]) {
        let known = stage.contacts.iter().zip(&self.touches).zip(&mut self.drags).zip(&mut self.pushes);
        for (((contact, touch), drag), push) in known {
            *drag = contact.drag(touch, drag, &self.dx, share, stage.a);
            *push = contact.expected(touch, &self.dx, share);
        }
        x.iter_mut().zip(&self.dx).for_each(|(x, d)| *x += d * share);
    }

    /// The preconditioner's answer to a residual `r`: near A⁻¹r, in one go.
    pub(super) fn smooth(&self, body: &Body, warm: &Warm, r: &mut [DVec3]) {
        let coarse = Coarse { factor: &warm.factor, arms: &self.arms, anchors: &warm.anchors };
        cg::precondition(&self.system, body, coarse, r);
    }

    /// A⁻¹r, by conjugate gradients.
    pub(super) fn filter(&mut self, body: &Body, warm: &Warm, r: &mut Vec<DVec3>) -> cg::Reached {
        let coarse = Coarse { factor: &warm.factor, arms: &self.arms, anchors: &warm.anchors };
        let limits = Limits { share: CG_SHARE, square: f64::INFINITY, cap: CG_CAP };
        let mut out = vec![DVec3::zeros(); r.len()];
        let reached = cg::solve(&mut self.system, body, coarse, limits, &mut self.scratch, &mut out, r);
        *r = out;
        reached
    }

    /// Contacts that push, and the deepest of them, metres below its gap.
    pub(super) fn touching(&self) -> (u32, f64) {
        let pushing = self.touches.iter().filter(|touch| touch.push > 0.0);
        pushing.fold((0, 0.0), |(count, deepest), touch| (count + 1, touch.depth.max(deepest)))
    }

    /// The Newton direction `dx` at `x`; `r` becomes what of the residual it leaves. False where it is none.
    pub(super) fn direction(
        &mut self,
        on: &Setting<'_>,
        stage: &Stage<'_>,
        warm: &mut Warm,
        x: &[DVec3],
        solved: &mut Solved,
    ) -> bool {
        let body = on.body;
        self.dx.clear();
        self.dx.resize(x.len(), DVec3::zeros());
        let whole = self.whole(body, stage);
        self.shift(body, stage, &whole);
        coarse::arms(&body.order.clusters, x, &mut self.arms);
        let anchors = Anchors::new(&self.system);
        let old = warm.factor.len() != self.layout.rows() || warm.spent > OLD;
        if old || anchors.change(&warm.anchors) > MOVED {
            self.renew(body, warm, anchors);
        }
        let fresh = &mut warm.fresh[stage.index];
        let bound = if *fresh == 0 { CG_CAP } else { (3 * *fresh).max(*fresh + 10) };
        let free = stage.spinning.iter().zip(&self.turns).filter(|piece| *piece.1);
        let spinning: f64 = free.map(|piece| piece.0).sum();
        let square = if spinning > 0.0 { 2.0 * stage.a * stage.a * NOISE * spinning } else { f64::INFINITY };
        let touching = !stage.contacts.is_empty();
        // Implicit Euler alone asks for no bound on turning.
        let searching = touching && stage.spinning.is_empty();
        let asked = if searching {
            CG_SHARE_SEARCHING
        } else if touching {
            CG_SHARE_TOUCHING
        } else {
            CG_SHARE
        };
        let limits = Limits { share: asked, square, cap: bound.min(CG_CAP) };
        let mut reached = self.gradients(body, warm, limits);
        solved.cg += reached.iterations;
        if !reached.met && bound < CG_CAP {
            // Stale past use: go on with a new one.
            self.renew(body, warm, Anchors::new(&self.system));
            let limits = Limits { share: (asked / reached.share.max(asked)).min(1.0), square, cap: CG_CAP };
            reached = self.gradients(body, warm, limits);
            solved.cg += reached.iterations;
        }
        warm.spent += reached.iterations;
        let fresh = &mut warm.fresh[stage.index];
        if *fresh == 0 {
            *fresh = reached.iterations.max(1);
        } else if !searching && f64::from(reached.iterations) > STALE * f64::from(*fresh) + 1.0 {
            *warm = Warm::default();
        }
        solved.caps += u32::from(!reached.met);
        // Linear solves leave a share of the residual; momentum they may not touch.
        self.shift(body, stage, &whole);
        solved.newton += 1;
        solved.failed = !self.dx.iter().all(|d| d.iter().all(|d| d.is_finite()));
        !solved.failed
    }

    fn gradients(&mut self, body: &Body, warm: &Warm, limits: Limits) -> cg::Reached {
        let coarse = Coarse { factor: &warm.factor, arms: &self.arms, anchors: &warm.anchors };
        cg::solve(&mut self.system, body, coarse, limits, &mut self.scratch, &mut self.dx, &mut self.r)
    }

    fn renew(&mut self, body: &Body, warm: &mut Warm, anchors: Anchors) {
        let (layout, system, arms) = (&self.layout, &self.system, &self.arms);
        warm.factor = Galerkin { layout, body, system, arms, anchors: &anchors }.factor();
        (warm.anchors, warm.fresh, warm.spent) = (anchors, [0; 2], 0);
    }
}
