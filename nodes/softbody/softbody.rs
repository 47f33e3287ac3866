//! Softbody: dough that is pounded, rolled and directed, an egg that cracks open.
//!
//! R1: "mass-spring systems" on Delaunay tetrahedra, with collisions, goal shapes for "the internal particles of the dough",
//! constraints that are animated, and springs that couple the yolk with the white. The solver is [`bodies::mass_spring`], contacts
//! are found by [`bodies::collision`].
//!
//! Departures, and what R leaves open:
//! * Springs alone let bodies turn inside out and lose volume: pressures keep it, by `volume`.
//! * One implicit step a frame instead of many explicit ones, whatever the stiffness; it says how far off it may be.
//! * Contact is part of what is solved for, not a projection afterwards.
//! * Goals act on inner particles with critical damping: bodies come to rest in them.
//! * What the body is made of is read at the start; numbers may be keyed, masks stand still.

use std::sync::{Arc, OnceLock};

use bodies::collision::{CollisionScene, ContactParams, Ground};
use bodies::mass_spring::{
    BodySolver, FrameReport, Integrator, Plasticity, SoftBody, SolverFrame, State, flow, reset, tear,
};
use engine::prelude::*;
use serde::{Deserialize, Serialize};

use crate::shared::attributes::{
    GOAL_FRAME, GOAL_HOLD, GOAL_STRENGTH, PIN_RADIUS, PIN_RELEASE, PIN_STRENGTH, SLIVER, SURFACE_POINT,
};
use goals::Goals;
use setup::{MaterialFields, ParticleNumber, SimulationSetup, StartInputs, refusal};

mod goals;
mod joints;
mod obstacles;
mod pins;
mod setup;

choice! {
    /// Which particles goals pull.
    pub enum GoalOn {
        Interior = "interior": "those inside: the surface is free to answer to what touches it",
        Surface = "surface": "those on surfaces",
        All = "all": "all: what touches the body hardly dents it",
    }
}

choice! {
    /// How time is stepped through.
    pub enum Stepping {
        Default = "default": "one step of second order a frame, or as many as contacts need; calmer steps where it begins \
                              off balance",
        Accurate = "accurate": "as many steps as keep the estimated error of a frame within `tolerance`: a reference",
        Euler = "euler": "implicit Euler: of first order, calms all motion",
    }
}

/// Times within a step at which colliders are looked at.
const COLLIDER_SAMPLES: u8 = 4;

inputs! { INPUTS:
    BODIES: Input<Many> = Input::many("bodies", Kind::Tets,
        "Bodies, as Tetrahedralize makes them, where they start. A surface beside the tets comes out moved along; without \
         one the tets' outside does.").read_at(|_| Times::START);
    COLLIDERS: Input<Many> = Input::many("colliders", Kind::Mesh,
        "Meshes that bodies cannot pass: hands, rolling pins, bowls. They may move, turn and deform.")
        .read_at(|_| Times::within_step(COLLIDER_SAMPLES));
    GOALS: Input<Many> = Input::many("goals", Kind::Tets,
        "Shapes that bodies shall take at their frames, by Softbody_Goal. One belongs to the body with the same tets.");
    PINS: Input<Many> = Input::many("pins", Kind::Points,
        "Animated points that hold what is near them at the start, by Softbody_Pin.")
        .read_at(|_| Times::START.and(Times::within_step(1)));
}

params! { PARAMS:
    START_FRAME: Param<i64> = Param::int("start_frame", 1,
        "The frame at which bodies are as they come in.").unit(Unit::Frame).default_scene_start().fixed();
    GRAVITY: Param<[f32; 3]> = Param::vec3("gravity", [0.0, -9.81, 0.0], "What pulls on everything.")
        .unit(Unit::MetresPerSecondSquared);
    DENSITY: Param<Maskable> = Param::maskable("density", 1000.0, "How heavy a body is for its volume.")
        .unit(Unit::KilogramsPerCubicMetre).above(0.0).soft(100.0, 3000.0);
    STIFFNESS: Param<Maskable> = Param::maskable("stiffness", 5e3,
        "How much it resists being stretched (Young's modulus): dough 1e3 to 1e4, gelatine 1e4, rubber 1e6.")
        .unit(Unit::Pascal).at_least(0.0).soft(0.0, 1e6);
    DAMPING: Param<Maskable> = Param::maskable("damping", 0.01,
        "How soon wobbling dies away: the time by which springs lag behind their stretch. 0 rings on.")
        .unit(Unit::Seconds).at_least(0.0).soft(0.0, 0.1);
    DRAG: Param<f32> = Param::float("drag", 0.0, "Against all motion, as in thick air.")
        .unit(Unit::PerSecond).at_least(0.0).soft(0.0, 5.0);
    VOLUME: Param<f32> = Param::float("volume", 1.0,
        "Share of lost volume that is fought, inside-out tets included; 0 leaves springs alone, which crumple.")
        .within(0.0, 1.0);
    PLASTIC_YIELD: Param<f32> = Param::float("plastic_yield", 0.0,
        "Strain beyond which a spring gives way for good: 0.05 keeps most dents, 0 none.").at_least(0.0).soft(0.0, 0.5);
    PLASTIC_CREEP: Param<f32> = Param::float("plastic_creep", 0.0,
        "How fast strain beyond `plastic_yield` becomes the shape: 10 within a few frames, 0 never.")
        .unit(Unit::PerSecond).at_least(0.0).soft(0.0, 50.0);
    RESET_TO_GOALS: Param<f32> = Param::float("reset_to_goals", 1.0,
        "How much the shape of a goal becomes the body's shape at rest once its frame is passed: 1 stays there when let go, \
         0 springs back.").within(0.0, 1.0);
    RESET_FRAMES: Param<i64> = Param::int("reset_frames", 4, "Frames that takes; at once is a jolt.")
        .unit(Unit::Frames).within(0.0, 1e4).soft(0.0, 24.0);
    KEEP_DENTS: Param<f32> = Param::float("keep_dents", 1.0,
        "Share of dents that stays when the shape at rest becomes a goal's.").within(0.0, 1.0);
    GOAL_ON: Param<GoalOn> = Param::choice("goal_on", GoalOn::Interior, "Which particles goals pull.");
    COUPLING_RADIUS: Param<f64> = Param::double("coupling_radius", 0.0,
        "How near surfaces of two bodies that face each other are at the start to be joined by springs; 0 joins none.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.1).fixed();
    COUPLING_STIFFNESS: Param<f64> = Param::double("coupling_stiffness", 10.0, "How hard each of those springs pulls.")
        .unit(Unit::NewtonsPerMetre).at_least(0.0).soft(0.0, 1e3).fixed().when(couples);
    COUPLING_BREAK: Param<f32> = Param::float("coupling_break", 0.0,
        "How many times as long as at the start one of them tears; 0 never.").at_least(0.0).soft(0.0, 3.0).when(couples);
    THICKNESS: Param<f32> = Param::float("thickness", 1e-3,
        "Distance that surfaces keep from each other. About a tenth of the tets' edges is easy; thinner costs more steps.")
        .unit(Unit::Metres).above(0.0).soft(1e-4, 1e-2);
    FRICTION: Param<Maskable> = Param::maskable("friction", 0.5,
        "How much touching surfaces hold on to each other: 0 slides, 1 holds on a slope of 45 degrees.")
        .at_least(0.0).soft(0.0, 1.0);
    SELF_COLLISION: Param<bool> = Param::bool("self_collision", true, "Whether a body's surface cannot pass itself.");
    BODY_COLLISION: Param<bool> = Param::bool("body_collision", true, "Whether bodies cannot pass each other.");
    GROUND: Param<bool> = Param::bool("ground", false, "Whether there is a level ground. It wins over colliders.");
    GROUND_HEIGHT: Param<f32> = Param::float("ground_height", 0.0, "Where the ground is.")
        .unit(Unit::Metres).when(|params| params.get(GROUND));
    INTEGRATOR: Param<Stepping> = Param::choice("integrator", Stepping::Default, "How time is stepped through.");
    TOLERANCE: Param<f64> = Param::double("tolerance", 1e-3,
        "Error that a frame may add, as a share of the bodies' size.").above(0.0).soft(1e-6, 1e-2)
        .when(|params| params.get(INTEGRATOR) == Stepping::Accurate);
    SUBSTEPS: Param<i64> = Param::int("substeps", 0, "Steps in a frame; 0 takes as many as needed.").within(0.0, 256.0)
        .soft(0.0, 16.0);
    INITIAL_VELOCITY: Param<[f32; 3]> = Param::vec3("initial_velocity", [0.0; 3], "How fast bodies are at the start.")
        .unit(Unit::MetresPerSecond).fixed();
    TIME_SCALE: Param<f32> = Param::float("time_scale", 1.0, "Seconds that pass for a second of frames; 0 stops time.")
        .at_least(0.0).soft(0.0, 2.0);
}

const SURFACE: Output = Output::new(
    "surface",
    &[Kind::Mesh],
    "The surfaces that came in beside the tets, moved along with all they carry; the tets' outside where there was none.",
);
const TETS: Output = Output::new("tets", &[Kind::Tets], "The tets, moved.");

macro_rules! metrics {
    ($($name:ident = $text:literal, $unit:expr, $help:literal;)*) => {
        $(const $name: Metric = Metric::new($text, $unit, $help);)*
        /// In the order of [`said`].
        const METRICS: &[&Metric] = &[$(&$name),*];
    };
}

metrics! {
    NEWTON = "newton", Unit::None, "Newton iterations of the frame.";
    CG = "cg", Unit::None, "Iterations of linear solves.";
    RESIDUAL = "residual", Unit::None, "The largest share of a stage's first residual that was left of it.";
    CAPS_HIT = "caps_hit", Unit::None, "Solves that stopped short of what was asked, and particles that had to be stopped.";
    ERROR_ESTIMATE = "error_estimate", Unit::Metres, "Estimated error of positions that the frame added.";
    KINETIC = "kinetic", Unit::Joules, "Energy of motion.";
    ELASTIC = "elastic", Unit::Joules, "Energy in springs.";
    GOAL_ENERGY = "goal_energy", Unit::Joules, "Energy in goals.";
    RESET_ENERGY = "reset_energy", Unit::Joules, "Energy that a goal brought as it became the shape at rest; below 0 freed.";
    PLASTIC_WORK = "plastic_work", Unit::Joules,
        "Elastic energy that plastic flow dissipated after the frame's steps: it is missing from the next frame's `elastic`.";
    ENERGY_SHED = "energy_shed", Unit::Joules, "Energy taken away because a step would have made it of nothing.";
    VOLUME_RATIO = "volume_ratio", Unit::None, "Volume as a share of that at rest.";
    WORST_STRETCH = "worst_stretch", Unit::None, "The largest length of a spring by its length at rest, or the reverse.";
    INVERTED_TETS = "inverted_tets", Unit::None, "Tets inside out.";
    CONTACTS = "contacts", Unit::None, "Contacts that push.";
    DEEPEST_OVERLAP = "deepest_overlap", Unit::Metres, "How far the worst contact is nearer than `thickness`.";
    LET_GO = "let_go", Unit::None, "Edges of the surface drawn out to over 8 times their length: colliders let them go.";
    GOAL_DISTANCE = "goal_distance", Unit::Metres, "Mean distance of pulled particles to where goals draw them.";
    PINNED = "pinned", Unit::None, "Particles that pins hold or pull; 0: none was within their `radius` at the start.";
    TORN = "torn", Unit::None, "Coupling springs torn since the start.";
    SUBSTEPS_USED = "substeps_used", Unit::None, "Steps that the frame took.";
}

/// See the module.
pub static NODE: Node = Node::new(
    "Softbody",
    2,
    "Simulates soft bodies: dough, gelatine, eggs. They fall, wobble, rub and press against colliders, the ground, each \
     other and themselves, keep their volume and, where they are plastic, their dents; goals direct them and pins hold \
     them. Stiffness does not hang on how finely they are cut, and none blows up, stiff or soft, \
     light beside heavy, from any start. Inner particles collide with nothing: dough of a few hundred pascals and less may \
     fall out of its skin.",
    Cook::solver::<Run>(|params| Some(params.get(START_FRAME))),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&SURFACE, &TETS])
.reads(&[
    &P,
    &SURFACE_POINT,
    &SLIVER,
    &GOAL_FRAME,
    &GOAL_STRENGTH,
    &GOAL_HOLD,
    &PIN_RADIUS,
    &PIN_STRENGTH,
    &PIN_RELEASE,
])
.writes(&[&P])
.metrics(METRICS)
.leaves_out(leaves_out);

/// Bodies on their way.
#[derive(Serialize, Deserialize)]
struct Run {
    inputs: StartInputs,
    state: State,
    /// Values of the metrics at the frame it stands at; none at the start.
    said: Vec<f64>,
    /// What only hangs on what was given: made anew after a checkpoint.
    #[serde(skip)]
    setup: OnceLock<Arc<SimulationSetup>>,
    #[serde(skip)]
    solving: Option<Solving>,
}

/// The solver's memory.
struct Solving {
    body: SoftBody,
    solver: BodySolver,
    /// Density, stiffness and damping that the body has.
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
        Ok(Self { inputs, state, said: Vec::new(), setup, solving: Some(solving) })
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
        let goals = Goals::of(&self.inputs, &setup, cx.input(GOALS), cx.get(START_FRAME) as f64)?;
        let (mut pulled, mut held) = (Vec::new(), Vec::new());
        goals.pull(times, on, &mut pulled);
        let drawn = pulled.len();
        if let [(_, before), .., (_, now)] = cx.samples(PINS) {
            pins::pull(&setup.holds, [before, now], cx.frame(), &mut held, &mut pulled)?;
        }
        let pinned = held.len() + pulled.len() - drawn;
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
        };
        let report = solving.solver.step(&solving.body, &mut self.state, &frame);
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
        self.said = said(&report, [brought, plastic_work], let_go, far.unwrap_or(0.0), pinned, &self.state);
        self.solving = Some(solving);
        Ok(())
    }

    fn output(&self, cx: &FrameCx) -> Result<Outputs> {
        let setup = self.setup(cx)?;
        for (metric, value) in METRICS.iter().zip(&self.said) {
            cx.publish(**metric, *value);
        }
        let narrow = |p: [f64; 3]| p.map(|x| x as f32);
        let (mut surface, mut tets) = (setup.surface.clone(), setup.body.clone());
        surface
            .set(P, setup.carriers.iter().map(|carrier| narrow(carrier.position(&self.state.positions))).collect())?;
        tets.set(P, self.state.positions.iter().map(|p| narrow(*p)).collect())?;
        Ok(SURFACE.with(Geometry::from(surface)).and(TETS, Geometry::from(tets)))
    }
}

/// Length below which a coupling spring of length 0 does not tear, as a share of the bodies' size.
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

    /// With what bodies consist of now.
    fn of(mut self, material: &MaterialFields) -> Result<Self> {
        if self.values != material.values() {
            self.body.set_material(&material.material()).map_err(refusal)?;
            self.values = material.values();
        }
        Ok(self)
    }
}

/// Values in the order of [`METRICS`].
fn said(
    report: &FrameReport,
    [reset_energy, plastic_work]: [f64; 2],
    let_go: usize,
    goal_distance: f64,
    pinned: usize,
    state: &State,
) -> Vec<f64> {
    let torn = state.torn.iter().filter(|torn| **torn).count();
    vec![
        f64::from(report.newton),
        f64::from(report.cg),
        report.residual,
        f64::from(report.caps_hit + report.stopped),
        report.error_estimate,
        report.kinetic,
        report.elastic,
        report.goal_energy,
        reset_energy,
        plastic_work,
        report.energy_removed,
        report.volume_ratio,
        report.worst_stretch,
        f64::from(report.inverted_tets),
        f64::from(report.contacts),
        report.deepest_overlap,
        let_go as f64,
        goal_distance,
        pinned as f64,
        torn as f64,
        f64::from(report.substeps),
    ]
}

fn couples(params: &Params) -> bool {
    params.get(COUPLING_RADIUS) > 0.0
}

fn leaves_out(params: &Params, wires: &Wires) -> Vec<LeftOut> {
    let mut out = Vec::new();
    let mut without = |stage, why| out.push(LeftOut::new(stage, why));
    if wires.count(&COLLIDERS) == 0 {
        without("colliders", "no `colliders` are wired");
    }
    if wires.count(&GOALS) == 0 {
        without("goals", "no `goals` are wired");
    }
    if wires.count(&PINS) == 0 {
        without("pins", "no `pins` are wired");
    }
    if !params.get(GROUND) {
        without("ground", "`ground` is false");
    }
    if !params.get(SELF_COLLISION) {
        without("self-collision", "`self_collision` is false");
    }
    if !params.get(BODY_COLLISION) {
        without("collision of bodies", "`body_collision` is false");
    }
    if params.get(VOLUME) == 0.0 {
        without("volume", "`volume` is 0");
    }
    if params.get(PLASTIC_YIELD) == 0.0 {
        without("plasticity", "`plastic_yield` is 0");
    } else if params.get(PLASTIC_CREEP) == 0.0 {
        without("plasticity", "`plastic_creep` is 0");
    }
    if !couples(params) {
        without("coupling", "`coupling_radius` is 0");
    }
    out
}

#[cfg(test)]
mod tests;
