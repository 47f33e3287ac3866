//! The state of a simulation, from frame to frame.

use std::sync::{Arc, OnceLock};

use bodies::collision::{CollisionScene, ContactParams, Ground};
use bodies::mass_spring::{BodySolver, Integrator, Plasticity, SoftBody, SolverFrame, State, flow, reset, tear};
use engine::prelude::*;
use serde::{Deserialize, Serialize};

use super::goals::{GoalHistory, Goals};
use super::measured::measured;
use super::setup::{MaterialFields, ParticleNumber, SimulationSetup, StartInputs, refusal};
use super::{
    BODY_COLLISION, COLLIDERS, COUPLING_BREAK, DEEPEST_PENETRATION, DRAG, FRICTION, GOAL_DISTANCE, GOAL_ON, GOALS,
    GRAVITY, GROUND, GROUND_HEIGHT, IDLE_PINS, IDLE_PINS_POINT, IDLE_PINS_WIRE, INITIAL_VELOCITY, INTEGRATOR,
    KEEP_DENTS, LET_GO, PINNED, PINS, PLASTIC_CREEP, PLASTIC_WORK, PLASTIC_YIELD, RESET_ENERGY, RESET_FRAMES,
    RESET_TO_GOALS, SELF_COLLISION, START_FRAME, STARTED_INSIDE, STIFFNESS_TO_WEIGHT, SUBSTEPS, SURFACE, Stepping,
    TETS, THICKNESS, TIME_SCALE, TOLERANCE, VOLUME,
};
use super::{obstacles, pins};

/// The state of the simulation.
#[derive(Serialize, Deserialize)]
pub(super) struct Run {
    inputs: StartInputs,
    state: State,
    goals: GoalHistory,
    /// Metrics of the last step; empty at the start.
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

impl Chain for Run {
    fn start(cx: &FrameCx) -> Result<Self> {
        let inputs = StartInputs::at(cx);
        let setup = SimulationSetup::of(cx, &inputs)?;
        let solving = Solving::new(&setup, &MaterialFields::at(cx, &inputs)?)?;
        let mut state = State::at_rest(&solving.body);
        state.velocities.fill(cx.get(INITIAL_VELOCITY).map(f64::from));
        let setup = OnceLock::from(Arc::new(setup));
        let (goals, metrics) = (GoalHistory::default(), MetricValues::default());
        Ok(Self { inputs, state, goals, metrics, setup, solving: Some(solving) })
    }

    fn step(&mut self, cx: &StepCx) -> Result<()> {
        let setup = self.setup(cx)?;
        let material = MaterialFields::at(cx, &self.inputs)?;
        let mut solving = match self.solving.take() {
            Some(solving) => solving.of(&material)?,
            None => Solving::new(&setup, &material)?,
        };
        let times = [cx.previous(), cx.frame()].map(Frame::number);
        let seconds = cx.dt() * f64::from(cx.get(TIME_SCALE));
        let on = cx.get(GOAL_ON);
        let (whole, frames) = (f64::from(cx.get(RESET_TO_GOALS)), cx.get(RESET_FRAMES) as f64);
        let mut goals = Goals::of(&self.inputs, &setup, &cx.part(GOALS), cx.get(START_FRAME) as f64, &mut self.goals)?;
        goals.start(times, &self.state.positions);
        let (mut pulled, mut held) = (Vec::new(), Vec::new());
        goals.pull(times, on, &mut pulled);
        let by_goals = pulled.len();
        if let [(_, before), .., (_, now)] = cx.samples(PINS) {
            pins::pull(&setup.pins.bindings, [before, now], cx.frame(), &mut held, &mut pulled)?;
        }
        let pinned = held.len() + pulled.len() - by_goals;
        let contact_friction = ParticleNumber::of(cx, &self.inputs, FRICTION)?;
        let (friction, thickness) = (f64::from(contact_friction.value), f64::from(cx.get(THICKNESS)));
        let obstacles = obstacles::obstacles(cx.samples(COLLIDERS), seconds, thickness, friction)?;
        let rub = ContactParams { thickness, friction };
        let ground = Ground { up: [0.0, 1.0, 0.0], height: f64::from(cx.get(GROUND_HEIGHT)), thickness, friction };
        let scene = CollisionScene {
            skins: &setup.skins,
            friction: contact_friction.mask.as_deref(),
            ground: cx.get(GROUND).then_some(ground),
            obstacles: &obstacles,
            body_contact: (cx.get(BODY_COLLISION) && setup.skins.len() > 1).then_some(rub),
            self_contact: cx.get(SELF_COLLISION).then_some(rub),
        };
        let touches = scene.ground.is_some()
            || !obstacles.is_empty()
            || scene.body_contact.is_some()
            || scene.self_contact.is_some();
        let frame = SolverFrame {
            seconds,
            gravity: cx.get(GRAVITY).map(f64::from),
            drag: f64::from(cx.get(DRAG)),
            volume: f64::from(cx.get(VOLUME)),
            goals: &pulled,
            pins: &held,
            contacts: if touches { Some(&scene) } else { None },
            integrator: match cx.get(INTEGRATOR) {
                Stepping::Default => Integrator::Default,
                Stepping::Accurate => Integrator::Accurate { tolerance: cx.get(TOLERANCE) },
                Stepping::Euler => Integrator::Euler,
            },
            substeps: cx.get(SUBSTEPS) as u32,
            force_implicit_euler: goals.reset_at(times[0], whole, frames),
            cancelled: &|| cx.check_cancelled().is_err(),
        };
        // Positions are those of the start only in the first step.
        let started_inside =
            self.metrics.get(STARTED_INSIDE).unwrap_or_else(|| scene.count_inside(&self.state.positions) as f64);
        let report = solving.solver.step(&solving.body, &mut self.state, &frame);
        cx.check_cancelled()?;
        let plasticity =
            Plasticity { yield_strain: f64::from(cx.get(PLASTIC_YIELD)), creep: f64::from(cx.get(PLASTIC_CREEP)) };
        let drawn = goals.shape(times[1]);
        let plastic_work = flow(&solving.body, &mut self.state, plasticity, seconds, drawn.as_deref());
        let mut brought = 0.0;
        let keep = f64::from(cx.get(KEEP_DENTS));
        goals.resets(times[1], whole, frames, |shape, share| {
            brought += reset(&solving.body, &mut self.state, shape, share, keep);
        });
        let stretch = f64::from(cx.get(COUPLING_BREAK));
        if setup.joints() > 0 && stretch > 0.0 {
            let _ = tear(&solving.body, &mut self.state, stretch, NEAR * solving.body.size());
        }
        let far = goals.distance(times[1], on, &self.state.positions);
        let let_go = if obstacles.is_empty() { 0 } else { setup.let_go(&self.state.positions) };
        self.metrics = measured(&report, &self.state);
        self.metrics.set(RESET_ENERGY, brought);
        self.metrics.set(PLASTIC_WORK, plastic_work);
        self.metrics.set(LET_GO, let_go as f64);
        self.metrics.set(STARTED_INSIDE, started_inside);
        let thickness = f64::from(cx.get(THICKNESS));
        let support = solving.body.stiffness_to_weight(frame.gravity);
        if support.is_finite() && (scene.ground.is_some() || !obstacles.is_empty()) {
            self.metrics.set(STIFFNESS_TO_WEIGHT, support);
        }
        self.metrics.set(DEEPEST_PENETRATION, (report.deepest_overlap - thickness).max(0.0));
        self.metrics.set(GOAL_DISTANCE, far.unwrap_or(0.0));
        goals.measure(times[1], on, &self.state.positions, &mut self.metrics);
        self.metrics.set(PINNED, pinned as f64);
        self.solving = Some(solving);
        Ok(())
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
        Ok(SURFACE.with(Geometry::from(surface)).and(TETS, Geometry::from(tets)))
    }
}

/// Length below which a coupling spring of rest length 0 does not tear, relative to the size of the bodies.
const NEAR: f64 = 1e-6;

impl Run {
    fn setup(&self, cx: &Cx) -> Result<Arc<SimulationSetup>> {
        if let Some(setup) = self.setup.get() {
            return Ok(setup.clone());
        }
        let setup = Arc::new(SimulationSetup::of(cx, &self.inputs)?);
        Ok(self.setup.get_or_init(|| setup).clone())
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
