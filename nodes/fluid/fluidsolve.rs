//! FluidSolve: viscous liquids from water to honey to nearly rigid.
//!
//! R2: a grid with a level set, directed by animated gravity and viscosity, sources, sinks and colliders. The solver is
//! [`liquid::step`], its surface [`liquid::marked`].
//!
//! Departures, and what R leaves open:
//! * Viscosity is in Pa·s and never clamped: it is solved for together with pressure, so that free fall and rotation are not
//!   slowed and sagging has its rate at any time step.
//! * Gravity and viscosity are read at the middle of each substep.

use engine::prelude::*;
use liquid::step::Coupling;

use crate::shared::attributes::{
    PARTICLE_DENSITY, PARTICLE_KIND, PARTICLE_VISCOSITY, PARTICLE_VOLUME, SINK_ACTIVE, SINK_RATE, SOURCE_ACTIVE,
    SOURCE_DENSITY, SOURCE_RATE, SOURCE_VELOCITY, SOURCE_VISCOSITY,
};
use domain::{Walls, checks};
use explained::{explained, leaves_out};
use openings::SAMPLES;
use run::Run;

mod carried;
mod domain;
mod drop_bins;
mod explained;
mod measured;
mod openings;
mod particles;
mod run;
mod shapes;
mod spray;
mod start;

choice! {
    /// How liquid is represented.
    enum Method {
        LevelSet = "levelset": "a level set with markers on the surface",
        Particles = "particles": "particles that fill the liquid; not available yet",
    }
}

choice! {
    /// When pressure and viscosity are solved together.
    Stokes for Coupling {
        Coupling::Auto => "auto": "where viscosity is large enough to change the result on this grid",
        Coupling::On => "on": "wherever there is viscosity",
        Coupling::Off => "off": "never; pressure, viscosity and pressure again are solved in turn. For comparison only: liquid sags 1.4 to 2 times too fast",
    }
}

inputs! { INPUTS:
    LIQUID: Input<Many> = Input::many("liquid", Kind::Mesh,
        "Closed meshes full of liquid at the start. Those from Fluid_Source may have their own viscosity and density; \
         where two meshes overlap, the one later in the list applies.").read_at(|_| Times::START);
    SOURCES: Input<Many> = Input::many("sources", Kind::Mesh,
        "Shapes from Fluid_Source that add liquid. A mesh without source attributes is kept full.")
        .read_at(|_| Times::START.and(Times::within_step(SAMPLES)));
    SINKS: Input<Many> = Input::many("sinks", Kind::Mesh,
        "Shapes from Fluid_Sink that liquid drains into. A mesh without sink attributes removes all that enters.")
        .read_at(|_| Times::within_step(SAMPLES));
    COLLIDERS: Input<Many> = Input::many("colliders", Kind::Mesh,
        "Meshes that liquid does not enter. They may move and deform. Sheets and thin plates do not leak; they displace liquid as if \
         they were 1.3 to 2 cells thick. A closed mesh is solid: liquid inside it at the start is left out.")
        .read_at(|_| Times::NOW.and(Times::START).and(Times::within_step(1)));
    TRACERS: Input<Many> = Input::many("tracers", Kind::Points,
        "Points that the liquid carries along, substep by substep, from where they are at the start. They come out in \
         `particles` with their attributes. Those outside the liquid stay where they are until liquid reaches them.").read_at(|_| Times::START);
}

params! { PARAMS:
    START_FRAME: Param<i64> = Param::int("start_frame", 1, "The frame at which the simulation starts from `liquid`.")
        .unit(Unit::Frame).default_scene_start().fixed();
    METHOD: Param<Method> = Param::choice("method", Method::LevelSet, "How the liquid is represented.").fixed();
    CELL: Param<f64> = Param::double("cell", 0.02,
        "Edge length of a cell. Details smaller than two cells are lost; halving it takes up to 12 times as long.")
        .unit(Unit::Metres).above(0.0).soft(0.005, 0.1).fixed();
    DOMAIN_FROM: Param<[f64; 3]> = Param::dvec3("domain_from", [-0.5, 0.0, -0.5],
        "Lowest corner of the box that the liquid stays in.").unit(Unit::Metres).fixed();
    DOMAIN_TO: Param<[f64; 3]> = Param::dvec3("domain_to", [0.5, 1.0, 0.5],
        "Highest corner of that box. A side that is not a multiple of `cell` is rounded up to one. Time and memory \
         depend on the liquid, not on the box.").unit(Unit::Metres).fixed();
    FOLLOW: Param<bool> = Param::bool("follow", false,
        "Whether the box grows with the liquid. If true, the box has no walls.").fixed();
    WALL_X_MIN: Param<Walls> = Param::choice("wall_x_min", domain::CLOSED, "The wall at the lowest x.").fixed().when(has_walls);
    WALL_X_MAX: Param<Walls> = Param::choice("wall_x_max", domain::CLOSED, "The wall at the highest x.").fixed().when(has_walls);
    WALL_Y_MIN: Param<Walls> = Param::choice("wall_y_min", domain::CLOSED, "The floor.").fixed().when(has_walls);
    WALL_Y_MAX: Param<Walls> = Param::choice("wall_y_max", domain::CLOSED, "The ceiling.").fixed().when(has_walls);
    WALL_Z_MIN: Param<Walls> = Param::choice("wall_z_min", domain::CLOSED, "The wall at the lowest z.").fixed().when(has_walls);
    WALL_Z_MAX: Param<Walls> = Param::choice("wall_z_max", domain::CLOSED, "The wall at the highest z.").fixed().when(has_walls);
    GRAVITY: Param<[f64; 3]> = Param::dvec3("gravity", [0.0, -9.81, 0.0],
        "Acceleration due to gravity. Animate it to direct the liquid.").unit(Unit::MetresPerSecondSquared).history();
    DENSITY: Param<f64> = Param::double("density", 1000.0,
        "Mass per volume: water 1000, honey 1400. Denser liquid flows faster at the same viscosity.")
        .unit(Unit::KilogramsPerCubicMetre).above(0.0).soft(100.0, 3000.0);
    VISCOSITY: Param<f64> = Param::double("viscosity", 1.0,
        "Dynamic viscosity: water 0.001, oil 0.1, syrup 1, honey 10, batter 20, ketchup 100, peanut butter 1e3, pitch 1e8. 0: \
         no viscosity.")
        .unit(Unit::PascalSeconds).at_least(0.0).soft(0.0, 1e3).history();
    SURFACE_TENSION: Param<f64> = Param::double("surface_tension", 0.0, "Surface tension; not available yet.")
        .unit(Unit::NewtonsPerMetre).at_least(0.0).soft(0.0, 0.1);
    SLIP: Param<f32> = Param::float("slip", 0.0,
        "How freely liquid slides along `closed` walls and colliders: 0 sticks, 1 slides without friction. It has no \
         effect where viscosity is not solved for; `convect explain` says where viscosity is solved for.").within(0.0, 1.0);
    STOKES: Param<Stokes> = Param::choice("stokes", Coupling::Auto, "When pressure and viscosity are solved together. \
         Solved one after the other, thick liquid falls and rotates correctly, but sags, buckles and coils at the wrong \
         rate.");
    CFL: Param<f64> = Param::double("cfl", 2.0,
        "Maximum number of cells that liquid travels in a substep; the fastest 0.01 % of it may travel twice as many. \
         Smaller values are more accurate and take longer. The surfaces of colliders travel at most one cell.")
        .above(0.0).soft(0.5, 5.0);
    MAX_SUBSTEPS: Param<i64> = Param::int("max_substeps", 32,
        "Maximum number of substeps per frame. Where `cfl` or a fast collider asks for more, substeps are longer and less \
         accurate.").within(1.0, 4096.0).soft(1.0, 64.0);
    TOLERANCE: Param<f64> = Param::double("tolerance", 1e-4,
        "Largest share of a cell's volume that a substep may gain or lose, and largest error of a velocity relative to what a \
         substep changes.")
        .within(1e-9, 0.1).soft(1e-6, 1e-2);
    VOLUME_CORRECTION: Param<bool> = Param::bool("volume_correction", true,
        "Whether the surface is moved slightly in each frame so that each separate piece of liquid keeps its correct \
            volume.");
    FLIP: Param<f32> = Param::float("flip", 0.0, "Share of FLIP in the particle method's velocity update; not available \
        yet.").within(0.0, 1.0);
    PARTICLES_PER_CELL: Param<i64> = Param::int("particles_per_cell", 8,
        "Particles per cell in the particle method; not available yet.").within(1.0, 64.0);
    INITIAL_VELOCITY: Param<[f64; 3]> = Param::dvec3("initial_velocity", [0.0; 3], "Velocity of the liquid at the start.")
        .unit(Unit::MetresPerSecond).fixed();
    INITIAL_SPIN: Param<[f64; 3]> = Param::dvec3("initial_spin", [0.0; 3],
        "Angular velocity of the liquid at the start, in radians per second, about its centre of mass.")
        .unit(Unit::PerSecond).fixed();
    RESOLUTION: Param<i64> = Param::int("resolution", 1,
        "Number of surface cells per edge of a cell. 2 keeps finer detail of the surface and, in a splash, more of the \
            volume that 1 loses, in two to three times the time; velocity and pressure keep their cells.")
        .within(1.0, 4.0).fixed();
    TIME_SCALE: Param<f64> = Param::double("time_scale", 1.0,
        "Simulated seconds per second of the scene: 0.5 is slow motion, 0 stops time. Velocities, spin and rates in params and \
         sources are per simulated second; `v` and the velocity in `volume` are per second of the scene.").at_least(0.0).soft(0.0, 2.0).history();
}

const SURFACE: Output = Output::new(
    "surface",
    &[Kind::Mesh],
    "The surface of the liquid: closed, with `N`, `v` and `thickness`; the same mesh that Fluid_Surface makes from \
        `volume`. `v` is how the liquid moves: what a node after it, such as an animated Transform, adds from frame to frame is not in it.",
);
const PARTICLES: Output = Output::new(
    "particles",
    &[Kind::Points],
    "The markers on the surface (`kind` 0), drops too small for the grid (`kind` 1) and tracers (`kind` 3; 2 is not used \
     yet), with `id`, `v`, `N`, `volume`, `viscosity`, `density`, and the float attributes on the points of `liquid`, `sources` and \
     `tracers`.",
);
const VOLUME: Output =
    Output::new("volume", &[Kind::Volume], "The level set and the velocity, which is extrapolated beyond the surface.");

metrics! { METRICS:
    SUBSTEPS_USED = Metric::new("substeps_used", Unit::None, "Substeps of the frame.");
    CFL_REACHED = Metric::new("cfl_reached", Unit::None, "The most cells that liquid moved in a substep.")
        .warn_above(64.0, "Liquid that moves more than 64 cells in a substep ends anywhere, and is lost. Look for a velocity, spin, \
            gravity or rate that is too high; or raise `max_substeps`, or `cell`.");
    CAPS_HIT = Metric::new("caps_hit", Unit::None,
        "Substeps that were longer than `cfl` or a fast collider allow because of `max_substeps`, plus solves that stopped without \
            reaching `tolerance`. 0 is good.");
    LONG_SUBSTEPS = Metric::new("long_substeps", Unit::None, "Substeps that were longer than `cfl` or a fast collider allow because of `max_substeps`.")
        .warn_above(0.0, "Substeps at these frames are too long: liquid moves up to {cfl_reached} cells in one, or, where that is within `cfl`, \
            the surface of a collider moves more than one cell and takes away liquid before it can move on. Raise \
            `max_substeps`, or `cell`.");
    SOLVES_CUT_SHORT = Metric::new("solves_cut_short", Unit::None, "Solves that stopped without reaching `tolerance`.")
        .warn_above(0.0, "Velocities are off by {coupled_residual} of the speed, net flows of cells by {pressure_residual}. Raise \
            `tolerance` or `cell`, or bring the viscosities of the liquids closer together.");
    PRESSURE_ITERATIONS = Metric::new("pressure_iterations", Unit::None, "Iterations of the pressure solves.");
    PRESSURE_RESIDUAL = Metric::new("pressure_residual", Unit::None,
        "Largest net flow into or out of a cell after a pressure solve, relative to the liquid's largest speed.");
    COUPLED_ITERATIONS = Metric::new("coupled_iterations", Unit::None,
        "Iterations of the solves for pressure and viscosity together.");
    COUPLED_RESIDUAL = Metric::new("coupled_residual", Unit::None,
        "Largest error of a velocity after such a solve, as the solver estimates it, relative to the liquid's largest speed.");
    VISCOSITY_ITERATIONS = Metric::new("viscosity_iterations", Unit::None,
        "Iterations of the solves for viscosity alone, where `stokes` is off.");
    VISCOSITY_RESIDUAL = Metric::new("viscosity_residual", Unit::None,
        "Largest error of a velocity after such a solve, as the solver estimates it, relative to the liquid's largest speed.");
    MAX_DIVERGENCE = Metric::new("max_divergence", Unit::None,
        "The largest share of a cell's volume that a substep gained or lost.")
        .warn_above(1e-2, "Cells gain or lose more than a hundredth of their volume in a substep. Lower `tolerance`; see whether \
            colliders squeeze liquid that cannot get away.");
    VOLUME_NOW = Metric::new("volume", Unit::CubicMetres, "Volume that the surface encloses, without the parts inside \
        colliders.");
    VOLUME_DRIFT_RAW = Metric::new("volume_drift_raw", Unit::None,
        "Relative error that the volume would have if it had never been corrected.")
        .warn_last_outside(-0.03, 0.03, "This share of the liquid's volume was lost (below 0) or gained (above 0) up to this frame because \
            cells and substeps are too coarse, before `volume_correction` made good {volume_made_good} % of the volume, {made_good_now} % in this \
            frame; 0 if it is off. With it, the volume as a whole is right, but some parts of the liquid are too thick and others too thin. \
            Films, drops, sheets and jets thinner than two cells enclose more or less than they hold, and liquid loses \
            volume as it moves near sources, sinks and open walls, and where colliders move by more than two cells in a substep: \
            smaller cells, or `resolution` 2 with `cfl` 1, lose less.");
    MADE_GOOD = Metric::new("volume_made_good", Unit::Percent,
        "Volume that correction has added to what cells hold, or removed, since the start, in percent of the volume.");
    MADE_GOOD_NOW = Metric::new("made_good_now", Unit::Percent,
        "Volume that correction added to what cells hold, or removed, in the frame, in percent of the volume.");
    VOLUME_DRIFT = Metric::new("volume_drift", Unit::None, "Relative error of the volume that remains after correction.")
        .warn_outside(-0.01, 0.01, "The volume of the liquid is off by more than a hundredth at these frames: there are {volume} m³ of liquid and \
            {spray} of spray after {sourced} came from sources, {sunk} sank and {left_domain} left. With `volume_correction` the surface \
            moves by a tenth to half a cell in a frame to make it good, where there is room: drops and thin films take several frames, and \
            where a box is full or colliders enclose the liquid, it stays off. Without `volume_correction` it stays off, too; lower `cell`, or \
            raise `resolution`, where colliders or sheets of liquid are thinner than two cells.");
    VOLUME_BALANCE = Metric::new("volume_balance", Unit::None,
        "Relative difference between `volume` + `spray` + `sunk` + `left_domain` and the volume at the start + \
            `sourced`: 0 if no volume is unaccounted for. Beyond a hundredth, `volume_drift` is, too, and has a note.");
    MATERIAL_DRIFT = Metric::new("material_drift", Unit::None,
        "Where liquids of several viscosities or densities meet: the largest relative error of any one liquid's share of \
            the volume.")
        .warn_outside(-1.0, 0.1, "One of the liquids of different viscosity or density is off by {material_drift} of the volume that it \
            should have: others took its place, or it took theirs. A layer thinner than a cell mixes with what is around it; use \
            smaller cells.");
    SPRAY = Metric::new("spray", Unit::CubicMetres,
        "Volume of drops too small for the grid, which fly on their own (`kind` 1 in `particles`).");
    EULER_CHARACTERISTIC = Metric::new("euler_characteristic", Unit::None,
        "Points minus edges plus faces of the surface: 2 for each closed surface, bubbles included, minus 2 for each \
            hole through it.");
    LIQUID_CELLS = Metric::new("liquid_cells", Unit::None, "Cells with liquid.");
    SOURCED = Metric::new("sourced", Unit::CubicMetres, "Volume that sources have added since the start.");
    SUNK = Metric::new("sunk", Unit::CubicMetres, "Volume that sinks have removed since the start.");
    PARTICLES_NOW = Metric::new("particles", Unit::None, "Number of points in the output `particles`.");
    COLLIDER_FORCE_X = Metric::new("collider_force_x", Unit::Newtons, "Total force of the liquid on all colliders along \
        x, averaged over the frame. What stops in the last half cell before a collider does not count.");
    COLLIDER_FORCE_Y = Metric::new("collider_force_y", Unit::Newtons, "The same along y.");
    COLLIDER_FORCE_Z = Metric::new("collider_force_z", Unit::Newtons, "The same along z.");
    WITHHELD = Metric::new("withheld", Unit::CubicMetres,
        "Volume that the rates of sources and sinks asked for in the frame but that could not be added or removed.")
        .warn_above(1e-9, "Sources could not give, or sinks not take, what their rates ask for, most of it \
            {sources+sinks:withheld_wire}: the liquid has nowhere to go, or there is none to take. Open a wall, \
            make room, or move the source or sink.");
    WITHHELD_WIRE = Metric::new("withheld_wire", Unit::None,
        "The wire with the most withheld volume in the frame, counted from 0 through `sources`, then `sinks`.");
    COLLECTING = Metric::new("collecting", Unit::None,
        "Sources that added nothing in the frame because their rate is too small for the grid: it is collected over \
            several frames.")
        .warn_above(0.0, "What the rates of these sources give in a frame is less than the smallest drop that cells show, a ball of one \
            cell's radius, so it is collected until it is as much. Raise `rate`, or lower `cell`; where drops go on to come in \
            pulses, give the source a `velocity` of at most `rate` ÷ 3 cell².");
    MISWIRED = Metric::new("miswired", Unit::None, "Wires from a Fluid_Sink to `sources`, and from a Fluid_Source to \
        `sinks`.")
        .warn_above(0.0, "A Fluid_Sink at `sources` gives liquid, and a Fluid_Source at `sinks` takes all that enters it. Wire each to \
            the input that it is made for.");
    RATE_ENDED = Metric::new("rate_ended", Unit::None,
        "Sources and sinks whose `rate` was above 0 in an earlier frame and is 0 in this one.")
        .warn_above(0.0, "The `rate` of these sources and sinks has fallen to 0, which does not stop them: a source then keeps its shape \
            full, and a sink removes all that enters it. To stop one, animate `active`.");
    IN_VAIN = Metric::new("liquid_settings_unused", Unit::None,
        "Wires from a Fluid_Source to `liquid`, and not to `sources`, whose `velocity`, `rate` or `active` has no effect.")
        .warn_last_above(0.0, "A Fluid_Source at `liquid` only says where liquid is at the start, and its viscosity and density; its \
            `velocity`, `rate` and `active` have no effect. Use `initial_velocity`, or wire it to `sources`.");
    CLASHES = Metric::new("attribute_clashes", Unit::None,
        "Names of float attributes on `liquid`, `sources` and `tracers` that have another number of floats on some than on the first.")
        .warn_above(0.0, "Inputs have attributes of the same name with different numbers of floats. Those of the first wire that has the \
            name were kept, in the order `liquid`, `tracers`, `sources`, and the others were left out. Rename one of them.");
    POSITION_STEP = Metric::new("position_step", Unit::None,
        "Distance, in cells, between neighbouring positions in single precision where the surface is farthest from the origin.")
        .warn_above(0.03125, "The liquid is so far from the origin that positions, which have single precision, step by {position_step} \
            of a cell: the shapes that come in and the surface are rounded to that. Move the scene near the origin, and set the scene's \
            `origin` to where it was.");
    OUTSIDE = Metric::new("liquid_outside", Unit::None,
        "Largest share of any mesh wired to `liquid` that lay outside the box at the start, and was left out.")
        .warn_last_above(0.01, "A mesh at `liquid` lies outside the box, wholly or in part; what is outside was left out. If that is not meant, move it, \
            or make the box larger with `domain_from` and `domain_to`.");
    IN_COLLIDERS = Metric::new("liquid_in_colliders", Unit::None,
        "Largest share of a mesh at `liquid` that lay inside colliders at the start, and was left out.")
        .warn_last_above(0.5, "Most of a mesh at `liquid` lies inside colliders, and was left out. A closed mesh is solid: give a vessel \
            walls with an inner side, or leave it open; and see whether a mesh is wired to both `liquid` and `colliders`.");
    UNSEEN = Metric::new("liquid_unseen", Unit::None,
        "Share of the liquid at the start that the surface does not enclose, because cells are too large for it.")
        .warn_last_above(0.25, "Much of the liquid at the start is thinner than the cells of the surface, which do not show it. Use a \
            smaller `cell`, raise `resolution`, or make the meshes at `liquid` larger.");
    TRACERS_OUTSIDE = Metric::new("tracers_outside", Unit::None, "Tracers that lay outside the box at the start.")
        .warn_last_above(0.0, "These tracers lie outside the box, where there is no liquid, and stay where they are. Move them, or make \
            the box larger with `domain_from` and `domain_to`.");
    FAST_SHAPES = Metric::new("fast_shapes", Unit::None,
        "Colliders, sources and sinks that move more than 64 cells in the frame.")
        .warn_above(0.0, "These colliders, sources or sinks move more than 64 cells in a frame, so that where they are in between \
            is inaccurate, and thin ones may let liquid through. Slow them down, or raise `cell`.");
    PASSED_THROUGH = Metric::new("passed_through", Unit::CubicMetres,
        "Volume that colliders passed over in the frame: it was before one that moves more than two cells in a substep, and was behind it \
            afterwards.")
        .warn_above(0.0, "Colliders passed through {passed_through} m³ of liquid at these frames, because they move too far in a substep. \
            Raise `max_substeps` to the number of cells that they move in a frame, slow them down, or raise `cell`.");
    LEFT_DOMAIN = Metric::new("left_domain", Unit::CubicMetres, "Volume that left through open walls since the start.");
}

pub(crate) static NODE: Node = Node::new(
    "FluidSolve",
    26,
    "Simulates a liquid, from water to honey to nearly rigid. It falls, splashes, sloshes, piles up and creeps. `viscosity` has \
     the same effect at any cell size and time step.",
    Cook::solver::<Run>(|params| Some(params.get(START_FRAME))),
)
.inputs(INPUTS)
.params(PARAMS)
.accuracy(&[
    Accuracy::smaller("cell", Trials::Times(&[4.0, 2.0, 1.0])),
    Accuracy::smaller("cfl", Trials::These(&["4", "2", "1", "0.5"])),
    Accuracy::smaller("tolerance", Trials::These(&["1e-2", "1e-3", "1e-4", "1e-5"])),
    Accuracy::larger("resolution", Trials::These(&["1", "2", "4"])),
])
.outputs(&[&SURFACE, &PARTICLES, &VOLUME])
.reads(&[
    &P,
    &SOURCE_RATE,
    &SOURCE_ACTIVE,
    &SOURCE_VELOCITY,
    &SOURCE_VISCOSITY,
    &SOURCE_DENSITY,
    &SINK_RATE,
    &SINK_ACTIVE,
    &ID,
])
.writes(&[
    &P,
    &N,
    &V,
    &THICKNESS,
    &ID,
    &PARTICLE_KIND,
    &PARTICLE_VOLUME,
    &PARTICLE_VISCOSITY,
    &PARTICLE_DENSITY,
])
.changes_topology()
.metrics(METRICS)
.leaves_out(leaves_out)
.explains(explained)
.checks(checks)
.integrates(|params| params.get(GRAVITY))
.integrates(|params| [params.get(VISCOSITY), params.get(TIME_SCALE), 0.0]);

fn has_walls(params: &Params) -> bool {
    !params.get(FOLLOW)
}

#[cfg(test)]
mod tests;
