//! Softbody: simulates soft bodies, such as dough that is pounded, rolled and directed, or an egg that cracks open.
//!
//! R1: "mass-spring systems" on Delaunay tetrahedra, with collisions, goal shapes for "the internal particles of the
//! dough", animated constraints, and springs that couple the yolk with the white. The solver is
//! [`bodies::mass_spring`]; [`bodies::collision`] finds contacts.
//!
//! Departures, and what R leaves open:
//! * Springs alone let bodies turn inside out and lose volume: pressures scaled by `volume` preserve it.
//! * One implicit step per frame instead of many explicit ones, whatever the stiffness; its error is estimated.
//! * Contacts are part of the system that is solved, not a projection afterwards.
//! * Goals act on inner particles with critical damping, so bodies come to rest in them.
//! * Masks of materials are read at the start and may not change; their numbers may be keyed.

use engine::prelude::*;

use crate::shared::attributes::{
    BODY_NUMBER, FILL, GOAL_FRAME, GOAL_HOLD, GOAL_SHARE, GOAL_START, GOAL_STRENGTH, PIN_RADIUS, PIN_RELEASE,
    PIN_STRENGTH, SLIVER, SURFACE_POINT,
};
use run::Run;

mod carried;
mod goals;
mod joints;
mod measured;
mod obstacles;
mod pace;
mod pins;
mod run;
mod setup;

choice! {
    /// The particles that goals pull.
    enum GoalOn {
        Interior = "interior": "inner particles only, so that the surface responds freely to contacts",
        Surface = "surface": "particles on the surface only",
        All = "all": "all particles, so that contacts hardly dent the body",
    }
}

choice! {
    /// The time integrator.
    enum Stepping {
        Default = "default": "one second-order step per frame, more if contacts need them; steps are damped where \
                              a motion starts abruptly",
        Accurate = "accurate": "as many steps as are needed to keep the estimated error of each frame within \
            `tolerance`; slow, for reference",
        Euler = "euler": "implicit Euler: first order, visibly damps all motion",
    }
}

/// Number of times within a step at which colliders are sampled.
const COLLIDER_SAMPLES: u8 = 4;
/// Number of frames in which what starts inside is pushed out.
const SEPARATION_FRAMES: u32 = 12;

inputs! { INPUTS:
    BODIES: Input<Many> = Input::many("bodies", Kind::Tets,
        "Bodies from Tetrahedralize, in their initial positions. A surface mesh that comes with the tets is carried \
         along by them and makes the contacts; without one, the boundary of the tets is the surface.").read_at(|_| Times::START);
    COLLIDERS: Input<Many> = Input::many("colliders", Kind::Mesh,
        "Meshes that bodies collide with: hands, rolling pins, bowls. They may move, rotate and deform. The faces of a \
         closed one face outwards; inwards they make a room.")
        .read_at(|_| Times::within_step(COLLIDER_SAMPLES));
    GOALS: Input<Many> = Input::many("goals", Kind::Tets,
        "Target shapes from Softbody_Goal. A body moves from one goal to the next and reaches each at the frame set \
         there. A goal applies to the body with the same tets.");
    PINS: Input<Many> = Input::many("pins", Kind::Points,
        "Animated points from Softbody_Pin. Each holds the particles that are near it at the start.")
        .read_at(|_| Times::START.and(Times::within_step(1)));
}

params! { PARAMS:
    START_FRAME: Param<i64> = Param::int("start_frame", 1,
        "The frame at which the simulation starts from `bodies`.").unit(Unit::Frame).default_scene_start().fixed();
    GRAVITY: Param<[f32; 3]> = Param::vec3("gravity", [0.0, -9.81, 0.0], "Acceleration due to gravity.")
        .unit(Unit::MetresPerSecondSquared).history();
    DENSITY: Param<Maskable> = Param::maskable("density", 1000.0,
        "Mass per volume. At the same stiffness, denser bodies sag more.")
        .unit(Unit::KilogramsPerCubicMetre).above(0.0).soft(100.0, 3000.0);
    STIFFNESS: Param<Maskable> = Param::maskable("stiffness", 5e3,
        "Resistance to stretching (Young's modulus): dough 1e3 to 1e4, gelatine 1e4, rubber 1e6. To carry its weight a \
         body needs about `density` × gravity × its height: at that stiffness it sags by a sixth, at a quarter of it to \
         half its height; at a twentieth tets turn inside out, and below a hundredth it collapses into a heap, whose \
         skin may go through itself. More than 1e8 × `density` counts as that.")
        .unit(Unit::Pascal).at_least(0.0).soft(0.0, 1e6);
    DAMPING: Param<Maskable> = Param::maskable("damping", 0.01,
        "How quickly wobbling fades: the ratio of the springs' damping to their stiffness. With 0 bodies keep \
         wobbling.")
        .unit(Unit::Seconds).at_least(0.0).soft(0.0, 0.1);
    DRAG: Param<f32> = Param::float("drag", 0.0,
        "Rate at which all motion is slowed, as by thick air: at 1 a body loses 63 % of its speed in a second.")
        .unit(Unit::PerSecond).at_least(0.0).soft(0.0, 5.0).history();
    VOLUME: Param<f32> = Param::float("volume", 1.0,
        "Strength of volume preservation and of the resistance to tets turning inside out: at 1 volume stays nearly \
         constant, at 0 there are only springs, and soft bodies crumple.")
        .within(0.0, 1.0);
    PLASTIC_YIELD: Param<f32> = Param::float("plastic_yield", 0.0,
        "Strain (change of length relative to the rest length) beyond which deformation becomes permanent: at 0.05 \
         most dents stay. 0 turns plasticity off.")
        .at_least(0.0).soft(0.0, 0.5);
    PLASTIC_CREEP: Param<f32> = Param::float("plastic_creep", 0.0,
        "Rate at which strain beyond `plastic_yield` becomes permanent: at 10 within a few frames, at 0 never.")
        .unit(Unit::PerSecond).at_least(0.0).soft(0.0, 50.0);
    RESET_TO_GOALS: Param<f32> = Param::float("reset_to_goals", 1.0,
        "How much of a goal's shape becomes the body's rest shape once the goal's frame is passed: at 1 the body keeps \
         the goal's shape after it is released, at 0 it springs back.").within(0.0, 1.0);
    RESET_FRAMES: Param<i64> = Param::int("reset_frames", 4, "Number of frames over which the rest shape changes to \
        that of a goal. A sudden change jolts the body.")
        .unit(Unit::Frames).within(0.0, 1e4).soft(0.0, 24.0);
    KEEP_DENTS: Param<f32> = Param::float("keep_dents", 1.0,
        "How much of the plastic dents is kept when the rest shape changes to that of a goal: 1 keeps them, 0 removes \
         them.").within(0.0, 1.0);
    GOAL_ON: Param<GoalOn> = Param::choice("goal_on", GoalOn::Interior, "The particles that goals pull.");
    COUPLING_RADIUS: Param<f64> = Param::double("coupling_radius", 0.0,
        "Two bodies are joined by springs where their surfaces face each other within this distance at the start. 0 \
         joins none.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.1).fixed();
    COUPLING_STIFFNESS: Param<f64> = Param::double("coupling_stiffness", 10.0,
        "Stiffness of each spring between bodies.")
        .unit(Unit::NewtonsPerMetre).at_least(0.0).soft(0.0, 1e3).fixed().when(couples);
    COUPLING_BREAK: Param<f32> = Param::float("coupling_break", 0.0,
        "Stretch at which a spring between bodies tears: at 1.5 it tears at one and a half times its length at the \
         start. 0 never tears.")
        .at_least(0.0).soft(0.0, 3.0).when(couples);
    THICKNESS: Param<f32> = Param::float("thickness", 1e-3,
        "Distance that surfaces keep from each other. A tenth of the tets' edge length is cheap; smaller values take \
         more time steps. What starts closer, or is when this grows, is moved away over 12 frames.")
        .unit(Unit::Metres).above(0.0).soft(1e-4, 1e-2);
    FRICTION: Param<Maskable> = Param::maskable("friction", 0.5,
        "Coefficient of friction: at 0 bodies slide freely, at 1 they stick to a slope of 45 degrees.")
        .at_least(0.0).soft(0.0, 1.0);
    BOUNCE: Param<f32> = Param::float("bounce", -1.0,
        "The largest speed at which a body leaves what it hits, relative to its speed of approach: at 0 it does not \
         bounce, at 0.5 it rises at most to a quarter of the height it fell from. Below 0 the bounce is not limited: \
         only stiffness and damping determine it. Except at 0, impacts take more time steps. Those slower than three \
         frames of free fall (1.2 m/s at 24 fps) do not, so they lose more speed.")
        .within(-1.0, 1.0);
    SELF_COLLISION: Param<bool> = Param::bool("self_collision", true, "Whether bodies collide with themselves.");
    BODY_COLLISION: Param<bool> = Param::bool("body_collision", true, "Whether bodies collide with each other.");
    GROUND: Param<bool> = Param::bool("ground", false, "Whether there is a level ground. Colliders never push \
        bodies below it.");
    GROUND_HEIGHT: Param<f32> = Param::float("ground_height", 0.0, "Height of the ground.")
        .unit(Unit::Metres).when(|params| params.get(GROUND));
    INTEGRATOR: Param<Stepping> = Param::choice("integrator", Stepping::Default, "The time integrator.");
    TOLERANCE: Param<f64> = Param::double("tolerance", 1e-3,
        "Error that the `accurate` integrator allows per frame, relative to the size of the bodies.")
        .above(0.0).soft(1e-6, 1e-2)
        .when(|params| params.get(INTEGRATOR) == Stepping::Accurate);
    SUBSTEPS: Param<i64> = Param::int("substeps", 0,
        "Number of time steps per frame. 0 uses as many as needed, usually one.")
        .within(0.0, 256.0)
        .soft(0.0, 16.0);
    INITIAL_VELOCITY: Param<[f32; 3]> = Param::vec3("initial_velocity", [0.0; 3],
        "Velocity of the bodies at the start.")
        .unit(Unit::MetresPerSecond).fixed();
    TIME_SCALE: Param<f32> = Param::float("time_scale", 1.0,
        "Simulated seconds per second of the scene: 0.5 is slow motion, 0 stops time.")
        .at_least(0.0).soft(0.0, 2.0).history();
}

const SURFACE: Output = Output::new(
    "surface",
    &[Kind::Mesh],
    "The surface meshes that came with the tets, moved with them; the boundary of the tets if there were none. \
     Attributes come along: `v` is the velocity of the simulation, `N` turns with the surface, `orient` is left out.",
);
const TETS: Output = Output::new(
    "tets",
    &[Kind::Tets],
    "The tets, in their simulated positions, with velocities `v`. `surface_point` \
    and `body` count on over all bodies; `N` and `orient` are left out.",
);

metrics! { METRICS:
    NEWTON = Metric::new("newton", Unit::None, "Newton iterations in the frame.");
    CG = Metric::new("cg", Unit::None, "Iterations of linear solves in the frame.");
    RESIDUAL = Metric::new("residual", Unit::None,
        "The largest residual left by a solve, relative to the initial one.");
    CAPS_HIT = Metric::new("caps_hit", Unit::None,
        "Solves that reached their iteration limit while particles still moved by more than 1e-4 of the size of the \
         bodies, and particles whose motion had to be limited. 0 is good.")
        .warn_above(0.0, "At these frames the solver reached its iteration limit, so motion may be damped or contacts \
            may be deeper than `thickness`. Set more `substeps`, or lower the stiffness or the speed of colliders.");
    TOLERANCE_MISSED = Metric::new("tolerance_missed", Unit::None,
        "Steps of the `accurate` integrator whose estimated error exceeds what `tolerance` allows.")
        .warn_above(0.0, "The shortest time steps were still less accurate than `tolerance` at these frames, so they \
            exceed it. Raise `tolerance`, or lower `stiffness`, the speed of colliders or the strength of goals.");
    ERROR_ESTIMATE = Metric::new("error_estimate", Unit::Metres, "Estimated error that the frame added to positions.");
    KINETIC = Metric::new("kinetic", Unit::Joules, "Kinetic energy.");
    ELASTIC = Metric::new("elastic", Unit::Joules, "Elastic energy of the springs.");
    GOAL_ENERGY = Metric::new("goal_energy", Unit::Joules, "Potential energy of the goals.");
    RESET_ENERGY = Metric::new("reset_energy", Unit::Joules,
        "Energy added when the rest shape was changed to that of a goal; negative if energy was released.");
    PLASTIC_WORK = Metric::new("plastic_work", Unit::Joules,
        "Elastic energy that plastic flow dissipates at the end of the frame; it is no longer part of the next frame's \
         `elastic`.");
    ENERGY_SHED = Metric::new("energy_shed", Unit::Joules, "Energy removed to prevent a spurious gain.");
    ENERGY_LOST = Metric::new("energy_lost", Unit::Joules,
        "Energy that the frame lost in other ways than by `damping`, `drag` and `friction`: by time stepping, by contacts \
         and by `bounce`. More `substeps` lose less.");
    LOST_SHARE = Metric::new("lost_share", Unit::None,
        "`energy_lost` relative to the kinetic and stored energy at the start of the frame, or at its end plus what was lost if that is more. 0 for slow bodies; missing where `bounce` \
         is 0.")
        .warn_above(0.9, "Bodies stop dead at these frames where they would bounce: time steps are too long for what they \
            hit. Set more `substeps`, or leave that to the solver (`substeps` 0, `integrator` `default`); with `bounce` 0 they \
            are meant to.");
    UNCUT_IMPACTS = Metric::new("uncut_impacts", Unit::None,
        "Time steps with an impact that should have been shortened for the bounce, but were not because the frame took \
         350 Newton iterations or more.")
        .warn_above(0.0, "So much is in contact that there is no time for bounces at these frames: bodies lose more speed \
            than their material would. Set `substeps` to pay for them, or `bounce` to 0 if they need not bounce.");
    FAST_TURNS = Metric::new("fast_turns", Unit::None,
        "Time steps in which a collider near a body turns by more than 60 degrees.")
        .warn_above(0.0, "A collider turns so far within a time step at these frames that it may pass bodies untouched. Set \
            `substeps` to 0, which takes steps in which it turns by 60 degrees at most, or to a larger number.");
    VOLUME_RATIO = Metric::new("volume_ratio", Unit::None, "Volume of the tets relative to that at rest.")
        .warn_outside(0.9, 1.1, "The bodies lose or gain more than a tenth of their volume. Raise `volume`, or \
            `stiffness`; look for colliders that squeeze them into too small a space.");
    CARRIED_VOLUME_RATIO = Metric::new("carried_volume_ratio", Unit::None,
        "Volume that a mesh that rides along encloses, relative to that at rest; of the one for which it differs most from 1. 1 if \
         no closed mesh rides along.")
        .warn_outside(0.9, 1.1, "A mesh that rides along loses or gains more than a tenth of its volume, although the tets of its cage keep \
            theirs: they are too coarse for it, and bend through it. Lower `spacing` of Tetrahedralize, or use `method` `delaunay` if \
            the mesh allows it.");
    WORST_STRETCH = Metric::new("worst_stretch", Unit::None,
        "The largest stretch or compression of a spring: length ÷ rest length, or rest length ÷ length.");
    INVERTED_TETS = Metric::new("inverted_tets", Unit::None, "Tets that are inside out.")
        .warn_above(0.0, "Parts of a body are turned inside out: something squeezes it harder than it can resist. \
            Raise `volume` or `stiffness`, slow the colliders, or leave more room between them.");
    STIFFNESS_TO_WEIGHT = Metric::new("stiffness_to_weight", Unit::None,
        "How well the softest body carries its own weight: `stiffness` ÷ (density × gravity × height). Not reported if \
         bodies have no weight, or neither collider nor ground to lie on.")
        .warn_outside(0.25, f64::INFINITY, "A body is too soft to carry its weight: it flattens where it lies. Raise \
            `stiffness`, or lower `density` or `gravity`.");
    STIFFNESS_LIMITED = Metric::new("stiffness_limited", Unit::None,
        "Particles with a `stiffness` of more than 1e8 × `density`, in Pa and kg/m³, which counts as that.")
        .warn_above(0.0, "`stiffness` exceeds 1e8 × `density` (in Pa and kg/m³), so 1e8 × `density` is taken instead: stiffer for \
            its weight than steel. Beyond that the arithmetic does not hold, and nothing would look different. Lower `stiffness`, \
            or raise `density`.");
    CONTACTS = Metric::new("contacts", Unit::None, "Contacts in which surfaces press on each other.");
    DEEPEST_OVERLAP = Metric::new("deepest_overlap", Unit::Metres,
        "`thickness` minus the smallest distance between surfaces in the output (negative where one is inside another): \
         by how much they are closer than `thickness`, at worst. More than `thickness` means that something is inside.");
    POINTS_INSIDE = Metric::new("points_inside", Unit::None,
        "Particles and surface points of the output that lie inside a closed collider or another body.");
    INWARD_COLLIDERS = Metric::new("inward_colliders", Unit::None,
        "Closed colliders whose faces point inwards, although bodies are outside them when the simulation starts.")
        .warn_above(0.0, "The faces of {colliders:inward_colliders_wire} point inwards, so it is a room that holds what is in it, \
            and bodies that start outside pass through its faces. If it is meant to be solid, turn its faces round where it is made: \
            the corners of each, seen from outside, run counter-clockwise.");
    INWARD_COLLIDERS_WIRE = Metric::new("inward_colliders_wire", Unit::None, "The first of these colliders, from 0; −1 if there is none.");
    DEEPEST_PENETRATION = Metric::new("deepest_penetration", Unit::Metres,
        "By how much `deepest_overlap` exceeds `thickness`: how far points, or edges, went through surfaces of colliders \
         and other bodies. 0 until all that started inside has been pushed out.")
        .warn_above(0.0, "Surfaces went through each other. Set more `substeps`, slow the colliders, leave more room \
            between them, or raise `thickness`.");
    SELF_CROSSINGS = Metric::new("self_crossings", Unit::None,
        "Edges of bodies' surfaces in the output that go through the surface of the same body; those that do at rest are left \
         out.")
        .warn_above(0.0, "The surface of a body goes through itself at these frames, and may stay so. Turn `self_collision` \
            on if it is off. Otherwise set `substeps` to 8 or more, or `integrator` to `accurate`, from a few frames before \
            the first of them, or raise `stiffness`, so that the body folds less.");
    JAMMED = Metric::new("jammed", Unit::None,
        "Contacts with colliders less than twice `thickness` above the ground, which leave a body no room.")
        .warn_above(0.0, "A collider closes on the ground with a body between, where there is no room for it. It counts \
            as stopped above the ground there, and passes through the body. Keep it higher by 2 `thickness` or more.");
    STARTED_INSIDE = Metric::new("started_inside", Unit::None,
        "Particles that are deeper than `thickness` inside a closed collider, inside another body, or below the ground \
         when the simulation starts. They are pushed out over 12 frames.");
    STARTED_IN_BODIES = Metric::new("started_in_bodies", Unit::None,
        "Pairs of bodies that are inside each other when the simulation starts.")
        .warn_above(0.0, "Bodies start inside each other: {bodies:started_in_bodies_wire} and \
            {bodies:started_in_bodies_other}, for one. They are pushed apart the shortest way over 12 frames. Move them \
            apart at `start_frame`.");
    STARTED_IN_BODIES_WIRE = Metric::new("started_in_bodies_wire", Unit::None,
        "The wire of one body of the first such pair, counted from 0; −1 if there is none.");
    STARTED_IN_BODIES_OTHER = Metric::new("started_in_bodies_other", Unit::None,
        "The wire of the other; −1 if there are none.");
    STARTED_CROSSING = Metric::new("started_crossing", Unit::None,
        "Pairs of bodies, or of a body and a closed collider, that go through each other when the simulation starts \
         although no point of one is inside the other, as crossed bars.")
        .warn_above(0.0, "Bodies start crossed with each other or with a collider, with no point of one inside the other. \
            They are not pushed apart. Move them apart at `start_frame`, or give their surfaces shorter edges.");
    STARTED_IN_COLLIDERS = Metric::new("started_in_colliders", Unit::None,
        "Pairs of a body and a closed collider, or the ground, that are inside each other when the simulation starts.")
        .warn_above(0.0, "Bodies start inside a collider or below the ground, and are pushed out the shortest way over 12 \
            frames, which may be the wrong one. Move them apart at `start_frame`.");
    NOT_PUSHED_OUT = Metric::new("not_pushed_out", Unit::None,
        "Points that have been inside something since the start and still are after 12 frames. Not reported before that, \
         or if none started inside.")
        .warn_above(0.0, "What started inside something could not be pushed out in 12 frames, and stays inside by \
            `deepest_overlap`: pins or colliders leave it no room. Move bodies apart at `start_frame`.");
    LET_GO = Metric::new("let_go", Unit::None,
        "Edges of the surface that are stretched to more than 8 times their rest length, so that colliders let them \
         pass.")
        .warn_above(0.0, "A collider has caught the skin and stretched it to more than 8 times its length, so it lets \
            the skin pass there. Give the collider a smoother shape, lower `friction`, or raise `stiffness`.");
    GOAL_DISTANCE = Metric::new("goal_distance", Unit::Metres,
        "Mean distance of the particles pulled by goals from their targets.");
    GOAL_MISS = Metric::new("goal_miss", Unit::None,
        "How far a body was from a goal's shape when it should have had it: mean distance relative to the body's size. \
         The largest over all goals so far; not reported before the first.")
        .warn_last_above(0.25, "{bodies:goal_miss_body} never comes near {goals:goal_miss_goal}: something is in the way, or the goal is too weak. Raise `strength` of Softbody_Goal, give the body more \
            frames to get there, or lower `stiffness`; see whether colliders, pins or the ground hold it back.");
    GOAL_MISS_BODY = Metric::new("goal_miss_body", Unit::None, "The wire of that body, from 0.");
    GOAL_MISS_GOAL = Metric::new("goal_miss_goal", Unit::None, "The wire of that goal, from 0.");
    IDLE_GOALS = Metric::new("idle_goals", Unit::None, "Goals that have no particle to pull.")
        .warn_above(0.0, "{goals:idle_goals_wire} has no effect: its body has no particle of the kind \
            that `goal_on` names. Make inner points with `interior` and a smaller `spacing` of Tetrahedralize, or set \
            `goal_on` to `all`.");
    IDLE_GOALS_WIRE = Metric::new("idle_goals_wire", Unit::None, "The first of these goals, from 0; −1 if there is none.");
    EARLY_GOALS = Metric::new("early_goals", Unit::None, "Goals that are over when the simulation starts.")
        .warn_above(0.0, "{goals:early_goals_wire} is over when the simulation starts, so it does not \
            pull. Give it a `frame` after the simulation's `start_frame`.");
    EARLY_GOALS_WIRE = Metric::new("early_goals_wire", Unit::None, "The first of these goals, from 0; −1 if there is none.");
    DOUBLED_GOALS = Metric::new("doubled_goals", Unit::None, "Goals whose body is still held by another goal at their \
        frame.")
        .warn_above(0.0, "At the `frame` of {goals:doubled_goals_wire} its body is still held by another \
            goal, so it jumps from one to the other. Give each goal a `frame` after the `frame` and `hold` of the one \
            before it.");
    DOUBLED_GOALS_WIRE = Metric::new("doubled_goals_wire", Unit::None, "The first of these goals, from 0; −1 if there is none.");
    IDLE_PINS = Metric::new("idle_pins", Unit::None, "Pins with no particle within their `radius` at the start.")
        .warn_above(0.0, "These pins hold nothing; the first is point {idle_pins_point} (from 0) of \
            {pins:idle_pins_wire}. Move them to the body at `start_frame`, or raise their `radius`.");
    IDLE_PINS_WIRE = Metric::new("idle_pins_wire", Unit::None, "The wire of the first of these pins, from 0; −1 if there is none.");
    IDLE_PINS_POINT = Metric::new("idle_pins_point", Unit::None, "The point of the first of these pins, from 0; −1 if there is none.");
    CARRIED_OUTSIDE = Metric::new("carried_outside", Unit::None,
        "Points of the mesh that rides along that are outside the tets by more than the size of a tet.")
        .warn_above(0.0, "The mesh that rides along reaches far out of the tets, which stretch it there beyond what the body \
            does. Give `carry` of Tetrahedralize a mesh that lies within its surface, or the surface the shape of that mesh.");
    STIFFEST_DIRECTION = Metric::new("stiffest_direction", Unit::None,
        "Resistance of the springs to even stretching in the direction in which they resist most, relative to `stiffness`; of \
         the body for which that is largest. About 1 for tets that are as wide as long; long tets are stiffer along their \
         length. 0 if no body has a volume.")
        .warn_above(1.7, "{bodies:stiffest_direction_wire} has long tets, which make it stiffer along their length than \
            `stiffness` says, by about the factor `stiffest_direction`. Give its surface faces that are as long as wide, use \
            `method` `cage` of Tetrahedralize, or lower `stiffness`.");
    STIFFEST_DIRECTION_WIRE = Metric::new("stiffest_direction_wire", Unit::None, "The wire of that body, from 0; −1 if there is none.");
    SOFTEST_DIRECTION = Metric::new("softest_direction", Unit::None,
        "The same in the direction in which they resist least, of the body for which that is smallest.");
    PINNED = Metric::new("pinned", Unit::None,
        "Particles held or pulled by pins. If it is 0, no particle was within a pin's `radius` at the start.");
    TORN = Metric::new("torn", Unit::None, "Coupling springs torn since the start.");
    SUBSTEPS_USED = Metric::new("substeps_used", Unit::None, "Number of time steps in the frame.");
}

pub(crate) static NODE: Node = Node::new(
    "Softbody",
    21,
    "Simulates soft bodies: dough, gelatine, eggs. They fall, wobble, and collide with colliders, the ground, each \
     other and themselves, with friction. They keep their volume and, if plastic, their dents; goals direct them and \
     pins hold them. `stiffness` has the same effect at any mesh resolution as long as tets are about as wide as long \
     (`stiffest_direction`), and the solver is stable for any stiffness, mass and initial state.",
    Cook::solver::<Run>(|params| Some(params.get(START_FRAME))),
)
.inputs(INPUTS)
.params(PARAMS)
.accuracy(&[
    Accuracy::larger("substeps", Trials::These(&["1", "2", "4", "8"])).order(2.0),
    Accuracy::words("integrator", &["euler", "default", "accurate"]),
    Accuracy::smaller("tolerance", Trials::These(&["1e-2", "1e-3", "1e-4"])).needs("integrator", "accurate"),
])
.outputs(&[&SURFACE, &TETS])
.reads(&[
    &P,
    &SURFACE_POINT,
    &SLIVER,
    &FILL,
    &BODY_NUMBER,
    &GOAL_FRAME,
    &GOAL_START,
    &GOAL_STRENGTH,
    &GOAL_SHARE,
    &GOAL_HOLD,
    &PIN_RADIUS,
    &PIN_STRENGTH,
    &PIN_RELEASE,
])
.writes(&[&P, &V, &N, &SURFACE_POINT, &BODY_NUMBER])
.metrics(METRICS)
.leaves_out(leaves_out)
.integrates(|params| params.get(GRAVITY).map(f64::from))
.integrates(|params| [params.get(DRAG), params.get(TIME_SCALE), 0.0].map(f64::from));

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
