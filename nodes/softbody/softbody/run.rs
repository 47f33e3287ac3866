//! The state of a simulation, from frame to frame.

use std::sync::{Arc, OnceLock};

use bodies::collision::{
    CaughtParticle, Closeness, CollisionScene, ContactParams, Ground, Obstacle, Overlap, OverlapPartner, Separation,
};
use bodies::mass_spring::{
    BodySolver, FrameReport, GoalSpring, Integrator, Pin, Plasticity, SoftBody, SolverFrame, State, flow, reset, tear,
};
use engine::prelude::*;
use serde::{Deserialize, Serialize};

use super::goals::{GoalHistory, Goals};
use super::measured::measured;
use super::pace::Pace;
use super::setup::{MaterialFields, ParticleNumber, SimulationSetup, StartInputs, refusal};
use super::{
    BODY_COLLISION, BOUNCE, CARRIED_OUTSIDE, CARRIED_VOLUME_RATIO, COLLIDERS, COUPLING_BREAK, DEEPEST_OVERLAP,
    DEEPEST_PENETRATION, DRAG, FRICTION, GOAL_DISTANCE, GOAL_ON, GOALS, GRAVITY, GROUND, GROUND_HEIGHT, IDLE_PINS,
    IDLE_PINS_POINT, IDLE_PINS_WIRE, INITIAL_VELOCITY, INTEGRATOR, INWARD_COLLIDERS, INWARD_COLLIDERS_WIRE, KEEP_DENTS,
    LET_GO, LOST_SHARE, NOT_PUSHED_OUT, PINNED, PINS, PLASTIC_CREEP, PLASTIC_WORK, PLASTIC_YIELD, POINTS_INSIDE,
    RESET_ENERGY, RESET_FRAMES, RESET_TO_GOALS, SELF_COLLISION, SELF_CROSSINGS, SEPARATION_FRAMES, SOFTEST_DIRECTION,
    START_FRAME, STARTED_CROSSING, STARTED_IN_BODIES, STARTED_IN_BODIES_OTHER, STARTED_IN_BODIES_WIRE,
    STARTED_IN_COLLIDERS, STARTED_INSIDE, STIFFEST_DIRECTION, STIFFEST_DIRECTION_WIRE, STIFFNESS_LIMITED,
    STIFFNESS_TO_WEIGHT, SUBSTEPS, SURFACE, Stepping, TETS, THICKNESS, TIME_SCALE, TOLERANCE, VOLUME,
};
use super::{carried, obstacles, pins};

/// The state of the simulation.
#[derive(Serialize, Deserialize)]
pub(super) struct Run {
    inputs: StartInputs,
    state: State,
    goals: GoalHistory,
    /// What overlapped at the start, until it is out, and the number of frames since in which time passed.
    overlaps: Vec<Overlap>,
    /// What is too close at the start, for as long as contacts yield for it.
    close: Vec<Closeness>,
    frames_over: u32,
    thickness: Thickness,
    caught: Vec<CaughtParticle>,
    /// Metrics of the last step, or of the start.
    metrics: MetricValues,
    /// Computed from `inputs` only, and recomputed after a checkpoint.
    #[serde(skip)]
    setup: OnceLock<Arc<SimulationSetup>>,
    #[serde(skip)]
    solving: Option<Solving>,
}

/// The solver with its body.
struct Solving {
    body: SoftBody,
    solver: BodySolver,
    /// The body's density, stiffness and damping.
    values: [f32; 3],
}

/// How contacts follow a distance to keep that grows.
#[derive(Default, Serialize, Deserialize)]
struct Thickness {
    /// That of the last frame, metres.
    reached: f64,
    /// What contacts still yield of it, metres, and the number of frames until they no longer do.
    missing: f64,
    frames: u32,
}

impl Thickness {
    /// By how much contacts yield at the start and the end of a frame of `seconds` that keeps the distance `thickness`.
    fn yielding(&mut self, thickness: f64, seconds: f64) -> [f64; 2] {
        if thickness > self.reached {
            (self.missing, self.frames) = (self.missing + thickness - self.reached, SEPARATION_FRAMES);
        }
        self.reached = thickness;
        self.missing = self.missing.min(thickness);
        let start = self.missing;
        if seconds > 0.0 && self.frames > 0 {
            self.missing -= self.missing / f64::from(self.frames);
            self.frames -= 1;
        }
        [start, self.missing]
    }
}

/// A step between two frames, or the start, which takes no time.
#[derive(Clone, Copy)]
struct Interval<'a> {
    frames: [f64; 2],
    seconds: f64,
    pace: &'a Pace<'a>,
}

/// What acts on bodies in a step, besides contacts.
struct Influences<'a> {
    goals: Goals<'a>,
    pulled: Vec<GoalSpring>,
    held: Vec<Pin>,
    /// Number of particles held or pulled by pins.
    pinned: usize,
}

impl Chain for Run {
    fn start(cx: &FrameCx) -> Result<Self> {
        let inputs = StartInputs::at(cx);
        let setup = SimulationSetup::of(cx, &inputs)?;
        let solving = Solving::new(&setup, &MaterialFields::at(cx, &inputs)?)?;
        let mut state = State::at_rest(&solving.body);
        state.velocities.fill(cx.get(INITIAL_VELOCITY).map(f64::from));
        let mut run = Self {
            inputs,
            state,
            goals: GoalHistory::default(),
            overlaps: Vec::new(),
            close: Vec::new(),
            frames_over: 0,
            thickness: Thickness::default(),
            caught: Vec::new(),
            metrics: MetricValues::default(),
            setup: OnceLock::from(Arc::new(setup)),
            solving: Some(solving),
        };
        let frames = [cx.frame().number(); 2];
        run.advance(cx, Interval { frames, seconds: 0.0, pace: &Pace::new(cx, frames) })?;
        Ok(run)
    }

    fn step(&mut self, cx: &StepCx) -> Result<()> {
        let frames = [cx.previous(), cx.frame()].map(Frame::number);
        let pace = Pace::new(cx, frames);
        self.advance(cx, Interval { frames, seconds: pace.seconds(cx), pace: &pace })
    }

    fn output(&self, cx: &FrameCx) -> Result<Outputs> {
        let setup = self.setup(cx)?;
        cx.publish_all(&self.metrics);
        cx.publish(IDLE_PINS, setup.pins.idle.len() as f64);
        let first = setup.pins.idle.first().map_or([-1.0; 2], |first| first.map(|index| index as f64));
        cx.publish(IDLE_PINS_WIRE, first[0]);
        cx.publish(IDLE_PINS_POINT, first[1]);
        let narrow = |p: [f64; 3]| p.map(|x| x as f32);
        let (mut surface, mut tets) = (setup.surface.clone(), setup.body.clone());
        surface
            .set(P, setup.carriers.iter().map(|carrier| narrow(carrier.position(&self.state.positions))).collect())?;
        tets.set(P, self.state.positions.iter().map(|p| narrow(*p)).collect())?;
        let scale = f64::from(cx.get(TIME_SCALE));
        let velocity = |v: [f64; 3]| narrow(v.map(|v| v * scale));
        let carried = setup.carriers.iter().map(|carrier| velocity(carrier.position(&self.state.velocities))).collect();
        carried::follow(cx, &setup.surface, &mut surface, carried)?;
        let own = self.state.velocities.iter().map(|v| velocity(*v)).collect();
        carried::follow(cx, &setup.body, &mut tets, own)?;
        Ok(SURFACE.with(Geometry::from(surface)).and(TETS, Geometry::from(tets)))
    }
}

/// Length below which a coupling spring of rest length 0 does not tear, relative to the size of the bodies.
const NEAR: f64 = 1e-6;

impl Run {
    /// Moves bodies through an interval and sets the metrics; at the start only these.
    fn advance(&mut self, cx: &FrameCx, interval: Interval<'_>) -> Result<()> {
        let setup = self.setup(cx)?;
        let material = MaterialFields::at(cx, &self.inputs)?;
        let mut solving = match self.solving.take() {
            Some(solving) => solving.of(&material)?,
            None => Solving::new(&setup, &material)?,
        };
        let is_start = interval.frames[0] == interval.frames[1];
        let friction = ParticleNumber::of(cx, &self.inputs, FRICTION)?;
        let friction_mask = friction.mask.map(|mask| setup.at_contact_points(mask));
        let rub = ContactParams { thickness: f64::from(cx.get(THICKNESS)), friction: f64::from(friction.value) };
        let obstacles = obstacles::obstacles(cx.samples(COLLIDERS), interval.seconds, rub.thickness, rub.friction)?;
        let mut scene = scene(cx, &setup, &obstacles, rub);
        scene.friction = friction_mask.as_deref();
        if is_start {
            let (overlaps, inside) = scene.overlaps(&setup.contact_points(&self.state.positions));
            let crossings = scene.crossings(&setup.contact_points(&self.state.positions), &overlaps);
            self.metrics.set(STARTED_CROSSING, crossings.len() as f64);
            self.metrics.set(STARTED_INSIDE, inside as f64);
            set_overlaps(&setup, &overlaps, &mut self.metrics);
            self.metrics.set(CARRIED_OUTSIDE, setup.carried_outside() as f64);
            let rooms = scene.rooms_beside(&setup.contact_points(&self.state.positions));
            self.metrics.set(INWARD_COLLIDERS, rooms.len() as f64);
            self.metrics.set(INWARD_COLLIDERS_WIRE, rooms.first().map_or(-1.0, |wire| *wire as f64));
            set_evenness(&setup, &solving.body, &mut self.metrics);
            self.close = scene.too_close(&setup.contact_points(&self.state.positions), &overlaps);
            self.overlaps = overlaps;
            self.thickness.reached = rub.thickness;
        }
        let grown = self.thickness.yielding(rub.thickness, interval.seconds);
        let (mut overlaps, close) = (std::mem::take(&mut self.overlaps), std::mem::take(&mut self.close));
        let (over, seconds) = (self.frames_over, interval.seconds);
        let caught = std::mem::take(&mut self.caught);
        scene.caught = &caught;
        scene.separation =
            Some(Separation { overlaps: &overlaps, close: &close, grown, frames: SEPARATION_FRAMES, over, seconds });
        let mut goals = std::mem::take(&mut self.goals);
        let mut influences = self.influences(cx, &setup, &mut goals, interval)?;
        let before = setup.contact_points(&self.state.positions);
        let report = self.solve(cx, &mut solving, &influences, &scene, interval)?;
        self.caught = scene.caught_after(&before, &setup.contact_points(&self.state.positions));
        let at_start = AT_START.map(|metric| (metric, self.metrics.get(metric).unwrap_or(0.0)));
        self.metrics = measured(&report, &self.state);
        at_start.into_iter().for_each(|(metric, value)| self.metrics.set(metric, value));
        if cx.get(BOUNCE) != 0.0 {
            self.metrics.set(LOST_SHARE, report.lost_share);
        }
        self.metrics.set(STIFFNESS_LIMITED, material.limited as f64);
        self.metrics.set(PLASTIC_WORK, 0.0);
        self.metrics.set(RESET_ENERGY, 0.0);
        if !is_start {
            self.deform(cx, &setup, &solving.body, &influences.goals, interval);
        }
        let far = influences.goals.distance(interval.frames[1], cx.get(GOAL_ON), &self.state.positions);
        self.metrics.set(GOAL_DISTANCE, far.unwrap_or(0.0));
        self.frames_over = over.saturating_add(u32::from(seconds > 0.0));
        let all_out = self.measure_contacts(&setup, &scene, rub.thickness);
        let support = solving.body.stiffness_to_weight(cx.get(GRAVITY).map(f64::from));
        if support.is_finite() && (scene.ground.is_some() || !obstacles.is_empty()) {
            self.metrics.set(STIFFNESS_TO_WEIGHT, support);
        }
        if all_out {
            overlaps.clear();
        }
        self.close = if self.frames_over < SEPARATION_FRAMES { close } else { Vec::new() };
        self.metrics.set(PINNED, influences.pinned as f64);
        influences.goals.measure(interval.frames[1], cx.get(GOAL_ON), &self.state.positions, &mut self.metrics);
        (self.goals, self.overlaps, self.solving) = (goals, overlaps, Some(solving));
        Ok(())
    }

    /// The goals and pins of an interval.
    fn influences<'a>(
        &self,
        cx: &'a FrameCx<'_>,
        setup: &'a SimulationSetup,
        history: &'a mut GoalHistory,
        interval: Interval<'_>,
    ) -> Result<Influences<'a>> {
        let wired = cx.part(GOALS);
        let mut goals = Goals::of(&self.inputs, setup, &wired, cx.get(START_FRAME) as f64, history)?;
        let (mut pulled, mut held) = (Vec::new(), Vec::new());
        if interval.frames[0] < interval.frames[1] {
            goals.start(interval.frames, &self.state.positions);
        }
        goals.pull(interval.frames, cx.get(GOAL_ON), &mut pulled);
        let by_goals = pulled.len();
        let samples = cx.samples(PINS);
        if let Some(((_, before), (_, now))) = samples.first().zip(samples.last()) {
            pins::pull(&setup.pins.bindings, [before, now], cx.frame(), &mut held, &mut pulled)?;
        }
        let pinned = held.len() + pulled.len() - by_goals;
        Ok(Influences { goals, pulled, held, pinned })
    }

    /// Steps the solver.
    fn solve(
        &mut self,
        cx: &FrameCx,
        solving: &mut Solving,
        influences: &Influences<'_>,
        scene: &CollisionScene<'_>,
        interval: Interval<'_>,
    ) -> Result<FrameReport> {
        let touches = scene.ground.is_some()
            || !scene.obstacles.is_empty()
            || scene.body_contact.is_some()
            || scene.self_contact.is_some();
        let (whole, frames) = (f64::from(cx.get(RESET_TO_GOALS)), cx.get(RESET_FRAMES) as f64);
        let pushed = scene.separation.is_some_and(|apart| !apart.overlaps.is_empty() && apart.over < apart.frames);
        let ambient = |time: f64| interval.pace.ambient(time);
        let frame = SolverFrame {
            seconds: interval.seconds,
            gravity: cx.get(GRAVITY).map(f64::from),
            drag: f64::from(cx.get(DRAG)),
            during: if interval.pace.varies { Some(&ambient) } else { None },
            volume: f64::from(cx.get(VOLUME)),
            goals: &influences.pulled,
            pins: &influences.held,
            contacts: if touches { Some(scene) } else { None },
            integrator: match cx.get(INTEGRATOR) {
                Stepping::Default => Integrator::Default,
                Stepping::Accurate => Integrator::Accurate { tolerance: cx.get(TOLERANCE) },
                Stepping::Euler => Integrator::Euler,
            },
            substeps: cx.get(SUBSTEPS) as u32,
            // What is pushed apart comes apart evenly.
            bounce: if pushed {
                Some(f64::INFINITY)
            } else {
                Some(f64::from(cx.get(BOUNCE))).filter(|share| *share >= 0.0)
            },
            force_implicit_euler: influences.goals.reset_at(interval.frames[0], whole, frames),
            cancelled: &|| cx.check_cancelled().is_err(),
        };
        let report = solving.solver.step(&solving.body, &mut self.state, &frame);
        cx.check_cancelled()?;
        Ok(report)
    }

    /// Changes rest shapes at the end of a step: by plastic flow, towards goals that are passed, and by tearing.
    fn deform(
        &mut self,
        cx: &FrameCx,
        setup: &SimulationSetup,
        body: &SoftBody,
        goals: &Goals<'_>,
        interval: Interval<'_>,
    ) {
        let now = interval.frames[1];
        let plasticity =
            Plasticity { yield_strain: f64::from(cx.get(PLASTIC_YIELD)), creep: f64::from(cx.get(PLASTIC_CREEP)) };
        let drawn = goals.shape(now);
        self.metrics.set(PLASTIC_WORK, flow(body, &mut self.state, plasticity, interval.seconds, drawn.as_deref()));
        let (whole, frames) = (f64::from(cx.get(RESET_TO_GOALS)), cx.get(RESET_FRAMES) as f64);
        let (mut brought, keep) = (0.0, f64::from(cx.get(KEEP_DENTS)));
        goals.resets(now, whole, frames, |shape, share| {
            brought += reset(body, &mut self.state, shape, share, keep);
        });
        self.metrics.set(RESET_ENERGY, brought);
        let stretch = f64::from(cx.get(COUPLING_BREAK));
        if setup.joints() > 0 && stretch > 0.0 {
            let _ = tear(body, &mut self.state, stretch, NEAR * body.size());
        }
    }

    /// Sets the metrics of contacts from the positions that are returned. Until what overlapped at the start is out,
    /// surfaces went through nothing; returns whether it is.
    fn measure_contacts(&mut self, setup: &SimulationSetup, scene: &CollisionScene<'_>, thickness: f64) -> bool {
        let points = setup.contact_points(&self.state.positions);
        let returned: Vec<[f64; 3]> = points.iter().map(|point| point.map(|x| f64::from(x as f32))).collect();
        let found = scene.penetration(&returned);
        let started = scene.separation.is_some_and(|separation| !separation.overlaps.is_empty());
        let is_over = self.frames_over >= SEPARATION_FRAMES;
        if started && is_over {
            self.metrics.set(NOT_PUSHED_OUT, found.inside as f64);
        }
        let all_out = !started || (is_over && found.inside == 0);
        let through = if all_out { (found.deepest - thickness - scene.yields()).max(0.0) } else { 0.0 };
        self.metrics.set(DEEPEST_OVERLAP, found.deepest);
        self.metrics.set(POINTS_INSIDE, found.inside as f64);
        self.metrics.set(DEEPEST_PENETRATION, through);
        self.metrics.set(SELF_CROSSINGS, scene.self_crossings(&returned) as f64);
        let let_go = if scene.obstacles.is_empty() { 0 } else { setup.let_go(&points) };
        self.metrics.set(LET_GO, let_go as f64);
        let carried = setup.skins.iter().filter_map(|skin| skin.carried_volume_ratio(&points));
        let farthest = carried.max_by(|a, b| (a - 1.0).abs().total_cmp(&(b - 1.0).abs()));
        self.metrics.set(CARRIED_VOLUME_RATIO, farthest.unwrap_or(1.0));
        all_out
    }

    #[expect(clippy::disallowed_methods, reason = "only moves what is there")]
    fn setup(&self, cx: &Cx) -> Result<Arc<SimulationSetup>> {
        if let Some(setup) = self.setup.get() {
            return Ok(setup.clone());
        }
        let setup = Arc::new(SimulationSetup::of(cx, &self.inputs)?);
        Ok(self.setup.get_or_init(|| setup).clone())
    }
}

/// Metrics of the start that later frames publish, too.
const AT_START: [Metric; 12] = [
    INWARD_COLLIDERS,
    INWARD_COLLIDERS_WIRE,
    STARTED_CROSSING,
    STARTED_INSIDE,
    STARTED_IN_BODIES,
    STARTED_IN_BODIES_WIRE,
    STARTED_IN_BODIES_OTHER,
    STARTED_IN_COLLIDERS,
    CARRIED_OUTSIDE,
    STIFFEST_DIRECTION,
    STIFFEST_DIRECTION_WIRE,
    SOFTEST_DIRECTION,
];

/// Sets the metrics of how evenly bodies resist in all directions.
fn set_evenness(setup: &SimulationSetup, body: &SoftBody, metrics: &mut MetricValues) {
    let moduli = body.directional_moduli();
    let stiffest = moduli.iter().rev().max_by(|a, b| a.range[1].total_cmp(&b.range[1]));
    let wire = stiffest.and_then(|stiffest| setup.wire_of_particle(stiffest.particle as usize));
    let softest = moduli.iter().map(|modulus| modulus.range[0]).reduce(f64::min);
    metrics.set(STIFFEST_DIRECTION, stiffest.map_or(0.0, |stiffest| stiffest.range[1]));
    metrics.set(STIFFEST_DIRECTION_WIRE, wire.map_or(-1.0, |wire| wire as f64));
    metrics.set(SOFTEST_DIRECTION, softest.unwrap_or(0.0));
}

/// Sets the metrics of what is inside something at the start.
fn set_overlaps(setup: &SimulationSetup, overlaps: &[Overlap], metrics: &mut MetricValues) {
    let bodies = || {
        overlaps.iter().filter_map(|overlap| match overlap.partner {
            OverlapPartner::Skin(other) => Some([overlap.skin, other]),
            OverlapPartner::Ground | OverlapPartner::Obstacle(_) => None,
        })
    };
    let count = bodies().count();
    let wires = bodies().next().map_or([None; 2], |pair| pair.map(|skin| setup.wire_of(skin)));
    let [wire, other] = wires.map(|wire| wire.map_or(-1.0, |wire| wire as f64));
    metrics.set(STARTED_IN_BODIES, count as f64);
    metrics.set(STARTED_IN_BODIES_WIRE, wire);
    metrics.set(STARTED_IN_BODIES_OTHER, other);
    metrics.set(STARTED_IN_COLLIDERS, (overlaps.len() - count) as f64);
}

/// What may be in contact.
fn scene<'a>(
    cx: &FrameCx,
    setup: &'a SimulationSetup,
    obstacles: &'a [Obstacle],
    rub: ContactParams,
) -> CollisionScene<'a> {
    let ContactParams { thickness, friction } = rub;
    let ground = Ground { up: [0.0, 1.0, 0.0], height: f64::from(cx.get(GROUND_HEIGHT)), thickness, friction };
    CollisionScene {
        skins: &setup.skins,
        ground: cx.get(GROUND).then_some(ground),
        obstacles,
        body_contact: (cx.get(BODY_COLLISION) && setup.skins.len() > 1).then_some(rub),
        self_contact: cx.get(SELF_COLLISION).then_some(rub),
        ..CollisionScene::default()
    }
}

impl Solving {
    fn new(setup: &SimulationSetup, material: &MaterialFields) -> Result<Self> {
        let body = setup.body(material)?;
        Ok(Self { solver: BodySolver::new(&body), body, values: material.values() })
    }

    /// The solver with the current material.
    fn of(mut self, material: &MaterialFields) -> Result<Self> {
        if self.values != material.values() {
            self.body.set_material(&material.material()).map_err(refusal)?;
            self.values = material.values();
        }
        Ok(self)
    }
}
