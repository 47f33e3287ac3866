//! FluidSolve: viscous liquids from water to honey to nearly rigid.
//!
//! R2: a grid with a level set, directed by animated gravity and viscosity, sources, sinks and colliders. The solver is
//! [`liquid::step`], its surface [`liquid::marked`].
//!
//! Departures, and what R leaves open:
//! * Viscosity is in Pa·s and never clamped: it is solved for together with pressure, so that free fall and rotation are not
//!   slowed and sagging has its rate at any time step.
//! * Gravity and viscosity are read at the middle of each substep.

use std::sync::{Arc, OnceLock};

use engine::prelude::*;
use liquid::carried::LiquidMaterial;
use liquid::level_set::{BAND, PhiView};
use liquid::marked::MarkedSurface;
use liquid::step::{
    Coupling, Liquid, LiquidReport, LiquidSettings, LiquidSink, LiquidSource, Motion, Solid, Surface, Surroundings,
};
use liquid::velocity::Sampler;
use liquid::volumes::VolumeTargets;
use numerics::vector::{add, cross, scale, sub};
use serde::{Deserialize, Serialize};

use crate::shared::attributes::{
    PARTICLE_DENSITY, PARTICLE_KIND, PARTICLE_VISCOSITY, PARTICLE_VOLUME, SINK_ACTIVE, SINK_RATE, SOURCE_ACTIVE,
    SOURCE_DENSITY, SOURCE_RATE, SOURCE_VELOCITY, SOURCE_VISCOSITY,
};
use crate::shared::surface::{SurfaceDetail, surface};
use crate::shared::volume::volume;
use carried::CarriedColumns;
use domain::{Walls, checks, domain, lattice, settings};
use measured::{measured, pool_of};
use openings::{Opening, SAMPLES, SINK, SOURCE, Timed};
use particles::{materials_at, particles};
use shapes::{Colliders, in_cells, liquid_at_start};
use spray::{Air, SprayDrop};

mod carried;
mod domain;
mod measured;
mod openings;
mod particles;
mod shapes;
mod spray;

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
        Coupling::Auto => "auto": "where viscosity changes what the grid shows",
        Coupling::On => "on": "wherever there is viscosity",
        Coupling::Off => "off": "never: viscosity is left out",
    }
}

inputs! { INPUTS:
    LIQUID: Input<Many> = Input::many("liquid", Kind::Mesh,
        "Closed meshes full of liquid at the start. Those from Fluid_Source may have a viscosity and a density of their own; where \
         two meshes overlap, that of the later one counts.").read_at(|_| Times::START);
    SOURCES: Input<Many> = Input::many("sources", Kind::Mesh,
        "Shapes from Fluid_Source that liquid comes from. A mesh without its attributes is kept full.")
        .read_at(|_| Times::START.and(Times::within_step(SAMPLES)));
    SINKS: Input<Many> = Input::many("sinks", Kind::Mesh,
        "Shapes from Fluid_Sink that liquid drains into. A mesh without its attributes takes all that enters.")
        .read_at(|_| Times::within_step(SAMPLES));
    COLLIDERS: Input<Many> = Input::many("colliders", Kind::Mesh,
        "Meshes that liquid does not enter. They may move and deform. Sheets and thin plates do not leak.")
        .read_at(|_| Times::NOW.and(Times::START).and(Times::within_step(1)));
    TRACERS: Input<Many> = Input::many("tracers", Kind::Points,
        "Points that the liquid carries along, substep by substep, from where they are at the start. They come out in \
         `particles` with their attributes. Those in the air stay where they are until liquid comes.").read_at(|_| Times::START);
}

params! { PARAMS:
    START_FRAME: Param<i64> = Param::int("start_frame", 1, "The frame at which the simulation starts from `liquid`.")
        .unit(Unit::Frame).default_scene_start().fixed();
    METHOD: Param<Method> = Param::choice("method", Method::LevelSet, "How the liquid is represented.").fixed();
    CELL: Param<f64> = Param::double("cell", 0.02,
        "Side of a cell. Details smaller than two cells are lost; half the side takes about 12 times as long.")
        .unit(Unit::Metres).above(0.0).soft(0.005, 0.1).fixed();
    DOMAIN_FROM: Param<[f64; 3]> = Param::dvec3("domain_from", [-0.5, 0.0, -0.5],
        "Lowest corner of the box that the liquid stays in.").unit(Unit::Metres).fixed();
    DOMAIN_TO: Param<[f64; 3]> = Param::dvec3("domain_to", [0.5, 1.0, 0.5],
        "Highest corner of that box. A side that is no multiple of `cell` grows to the next one. Time and memory depend on the \
         liquid, not on the box.").unit(Unit::Metres).fixed();
    FOLLOW: Param<bool> = Param::bool("follow", false,
        "Whether the box grows with the liquid; it has no walls then.").fixed();
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
        "Dynamic viscosity: water 0.001, oil 0.1, syrup 1, honey 10, batter 20, ketchup 100, peanut butter 1e3, pitch 1e8. 0 \
         leaves it out.")
        .unit(Unit::PascalSeconds).at_least(0.0).soft(0.0, 1e3).history();
    SURFACE_TENSION: Param<f64> = Param::double("surface_tension", 0.0, "Surface tension; not available yet.")
        .unit(Unit::NewtonsPerMetre).at_least(0.0).soft(0.0, 0.1);
    SLIP: Param<f32> = Param::float("slip", 0.0,
        "How freely liquid slides along `closed` walls and colliders: 0 sticks, 1 slides without friction.").within(0.0, 1.0);
    STOKES: Param<Stokes> = Param::choice("stokes", Coupling::Auto, "When pressure and viscosity are solved together.");
    CFL: Param<f64> = Param::double("cfl", 2.0,
        "Cells that the fastest liquid moves in a substep, at most. Smaller values are more accurate and take longer.")
        .above(0.0).soft(0.5, 5.0);
    MAX_SUBSTEPS: Param<i64> = Param::int("max_substeps", 32,
        "Most substeps of a frame. Where `cfl` asks for more, they are longer, and less accurate.").within(1.0, 4096.0).soft(1.0, 64.0);
    TOLERANCE: Param<f64> = Param::double("tolerance", 1e-4,
        "Largest share of a cell's volume that a substep may gain or lose, and largest error of a velocity relative to what a \
         substep changes.")
        .within(1e-9, 0.1).soft(1e-6, 1e-2);
    VOLUME_CORRECTION: Param<bool> = Param::bool("volume_correction", true,
        "Whether the surface is moved slightly in each frame so that the volume of each piece of liquid stays what it should be.");
    FLIP: Param<f32> = Param::float("flip", 0.0, "Share of FLIP of the particle method; not available yet.").within(0.0, 1.0);
    PARTICLES_PER_CELL: Param<i64> = Param::int("particles_per_cell", 8,
        "Particles of a cell in the particle method; not available yet.").within(1.0, 64.0);
    INITIAL_VELOCITY: Param<[f64; 3]> = Param::dvec3("initial_velocity", [0.0; 3], "Velocity of the liquid at the start.")
        .unit(Unit::MetresPerSecond).fixed();
    INITIAL_SPIN: Param<[f64; 3]> = Param::dvec3("initial_spin", [0.0; 3],
        "Rotation of the liquid at the start, in radians per second about axes through its centre of mass.")
        .unit(Unit::PerSecond).fixed();
    RESOLUTION: Param<i64> = Param::int("resolution", 1,
        "Cells of the surface along a side of `cell`: 2 keeps finer detail of the surface at the same motion.")
        .within(1.0, 4.0).fixed();
    TIME_SCALE: Param<f64> = Param::double("time_scale", 1.0,
        "Simulated seconds per second of the scene: 0.5 is slow motion, 0 stops time.").at_least(0.0).soft(0.0, 2.0).history();
}

const SURFACE: Output = Output::new(
    "surface",
    &[Kind::Mesh],
    "The surface of the liquid: closed, with `N`, `v` and `thickness`; the same as Fluid_Surface makes of `volume`.",
);
const PARTICLES: Output = Output::new(
    "particles",
    &[Kind::Points],
    "The markers on the surface (`kind` 0), drops too small for the grid (`kind` 1) and tracers (`kind` 3), with `id`, `v`, `N`, \
     `volume`, `viscosity`, `density`, and the floats that came with the points of `liquid`, `sources` and `tracers`.",
);
const VOLUME: Output =
    Output::new("volume", &[Kind::Volume], "The level set and the velocity, which goes on past the surface.");

metrics! { METRICS:
    SUBSTEPS_USED = Metric::new("substeps_used", Unit::None, "Substeps of the frame.");
    CFL_REACHED = Metric::new("cfl_reached", Unit::None, "The most cells that liquid moved in a substep.");
    CAPS_HIT = Metric::new("caps_hit", Unit::None,
        "Substeps that were longer than `cfl` allows because of `max_substeps`, and solves that ended before `tolerance`.")
        .warn_above(0.0, "At these frames the liquid is faster than `max_substeps` allows at this `cfl`, or a solve ended \
            before `tolerance`, so it loses detail. Raise `max_substeps`, or `cell`.");
    PRESSURE_ITERATIONS = Metric::new("pressure_iterations", Unit::None, "Iterations of the pressure solves.");
    PRESSURE_RESIDUAL = Metric::new("pressure_residual", Unit::None,
        "Largest net flow of a cell that a pressure solve left, relative to the speed.");
    COUPLED_ITERATIONS = Metric::new("coupled_iterations", Unit::None,
        "Iterations of the solves for pressure and viscosity together.");
    COUPLED_RESIDUAL = Metric::new("coupled_residual", Unit::None,
        "Largest error of a velocity that such a solve left, as it estimates, relative to the speed.");
    MAX_DIVERGENCE = Metric::new("max_divergence", Unit::None,
        "The largest share of a cell's volume that a substep gained or lost.")
        .warn_above(1e-2, "Cells gain or lose more than a hundredth of their volume in a substep. Lower `tolerance`; see whether \
            colliders squeeze liquid that cannot get away.");
    VOLUME_NOW = Metric::new("volume", Unit::CubicMetres, "Volume of the liquid, as the surface encloses it outside colliders.");
    VOLUME_DRIFT_RAW = Metric::new("volume_drift_raw", Unit::None,
        "Error of the volume, relative to what it should be, if it were never corrected.")
        .warn_outside(-0.03, 0.03, "Without correction the liquid would have gained or lost more than 3 % of its volume: it has \
            many drops, sheets or jets that are thinner than `cell`. Lower `cell`, or raise `resolution`.");
    VOLUME_DRIFT = Metric::new("volume_drift", Unit::None, "Error of the volume that is left, relative to what it should be.")
        .warn_outside(-0.01, 0.01, "The volume of the liquid is off by more than a hundredth at these frames. Lower `cell`, or \
            raise `resolution`; with `volume_correction` it comes back over the next frames.");
    SPRAY = Metric::new("spray", Unit::CubicMetres,
        "Volume of drops too small for the grid, which fly on their own as `spray` in `particles`.");
    EULER_CHARACTERISTIC = Metric::new("euler_characteristic", Unit::None,
        "Points less edges plus faces of the surface: 2 for each closed surface, bubbles included, less 2 for each hole through it.");
    LIQUID_CELLS = Metric::new("liquid_cells", Unit::None, "Cells with liquid.");
    SOURCED = Metric::new("sourced", Unit::CubicMetres, "Volume that sources gave since the start.");
    SUNK = Metric::new("sunk", Unit::CubicMetres, "Volume that sinks took since the start.");
    PARTICLES_NOW = Metric::new("particles", Unit::None, "Points of the output `particles`.");
    COLLIDER_FORCE_X = Metric::new("collider_force_x", Unit::Newtons, "Force of the liquid on all colliders along x, mean of the frame.");
    COLLIDER_FORCE_Y = Metric::new("collider_force_y", Unit::Newtons, "The same along y.");
    COLLIDER_FORCE_Z = Metric::new("collider_force_z", Unit::Newtons, "The same along z.");
    WITHHELD = Metric::new("withheld", Unit::CubicMetres,
        "Volume that the rates of sources and sinks asked for in the frame and that could not pass.")
        .warn_above(1e-9, "Sources could not give, or sinks not take, what their rates ask for: the liquid has nowhere to go, \
            or there is none to take. Open a wall, make room, or move the source or sink.");
    LEFT_DOMAIN = Metric::new("left_domain", Unit::CubicMetres, "Volume that left through open walls since the start.");
}

pub(crate) static NODE: Node = Node::new(
    "FluidSolve",
    1,
    "Simulates a liquid, from water to honey to nearly rigid. It falls, splashes, sloshes, piles up and creeps. `viscosity` has \
     the same effect at any cell size and time step.",
    Cook::solver::<Run>(|params| Some(params.get(START_FRAME))),
)
.inputs(INPUTS)
.params(PARAMS)
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
.checks(checks)
.integrates(|params| params.get(GRAVITY))
.integrates(|params| [params.get(VISCOSITY), params.get(TIME_SCALE), 0.0]);

fn has_walls(params: &Params) -> bool {
    !params.get(FOLLOW)
}

/// The state of the simulation.
#[derive(Serialize, Deserialize)]
struct Run {
    surface: MarkedSurface,
    motion: Motion,
    /// Since the start, m³: what sources gave, what sinks took, what left through open walls.
    sourced: f64,
    sunk: f64,
    left_domain: f64,
    /// In the last frame, m³.
    withheld: f64,
    targets: VolumeTargets,
    spray: Vec<SprayDrop>,
    /// The attributes that came with liquid, sources and tracers.
    columns: CarriedColumns,
    /// The ids of the tracers at the start.
    tracer_ids: Vec<i32>,
    /// Metrics of the last step; empty at the start.
    metrics: MetricValues,
    #[serde(skip)]
    colliders: Option<Colliders>,
    /// The output at the state's frame.
    #[serde(skip)]
    volume: OnceLock<Arc<Volume>>,
}

impl Chain for Run {
    fn start(cx: &FrameCx) -> Result<Self> {
        checks(cx.params())?;
        let lattice = lattice(cx);
        let domain = domain(cx);
        let start = liquid_at_start(cx, &domain, lattice)?;
        let mut surface = start.surface.clone();
        let colliders = Colliders::at_start(cx, &domain, lattice);
        if !colliders.is_empty() {
            surface.meet(|point| colliders.distance(1.0, point));
        }
        let [velocity, spin] = [INITIAL_VELOCITY, INITIAL_SPIN].map(|param| cx.get(param).map(|x| x as f32));
        let density = |place: [f32; 3]| start.material(place).density.map_or(cx.get(DENSITY), f64::from);
        let centre = pool_of(&surface, density).centre;
        let side = lattice.cell as f32;
        let at = |point: [f32; 3]| add(velocity, cross(spin, scale(sub(point, centre), side)));
        let distance = |_: f64, point: [f32; 3]| colliders.distance(1.0, point);
        let around = Surroundings {
            solid: (!colliders.is_empty()).then(|| Solid::still(&distance)),
            ..Surroundings::new(&|_| [0.0; 3], &|_| 0.0)
        };
        let mut liquid = Liquid::new(settings(cx), surface);
        liquid.set_velocity(at, &around);
        if start.has_materials() {
            liquid.set_materials(|place| start.material(place));
        }
        let (mut columns, tracers) = (start.columns, cx.part_at_start(TRACERS));
        columns.add_tracers(&tracers);
        for mesh in cx.part_at_start(SOURCES) {
            columns.add_mesh(mesh, lattice, liquid.surface_mut());
        }
        let places = tracers.iter().flat_map(|tracers| in_cells(tracers, lattice)).collect();
        liquid.set_tracers(places);
        let (mut surface, motion) = liquid.into_parts();
        let at_rest = |point: [f32; 3]| colliders.distance(1.0, point);
        let targets = VolumeTargets::new(&mut surface, lattice.cell, colliders.solid(&at_rest));
        let mut run = Self {
            surface,
            motion,
            sourced: 0.0,
            sunk: 0.0,
            left_domain: 0.0,
            withheld: 0.0,
            targets,
            spray: Vec::new(),
            columns,
            tracer_ids: tracer_ids(&tracers),
            metrics: MetricValues::default(),
            colliders: Some(colliders),
            volume: OnceLock::new(),
        };
        run.metrics.set(LIQUID_CELLS, pool_of(&run.surface, |_| 1.0).cells as f64);
        Ok(run)
    }

    fn step(&mut self, cx: &StepCx) -> Result<()> {
        let (lattice, settings) = (lattice(cx), settings(cx));
        let colliders = Colliders::within_step(cx, self.colliders.take(), &settings.domain, lattice)?;
        let passed = |frame: Frame| cx.integrals::<2>(frame)[1][1];
        let seconds = passed(cx.frame()) - passed(cx.previous());
        self.volume = OnceLock::new();
        let report = match seconds > 0.0 {
            true => self.advance(cx, settings, &colliders, seconds)?,
            false => LiquidReport { liquid_cells: self.motion.liquid_cells(), ..LiquidReport::default() },
        };
        self.sourced += report.sourced;
        self.sunk += report.sunk;
        self.left_domain += report.left_domain;
        self.metrics = measured(&report);
        self.correct(cx, &report, &colliders);
        self.metrics.set(SOURCED, self.sourced);
        self.metrics.set(SUNK, self.sunk);
        self.metrics.set(WITHHELD, if report.substeps > 0 { self.withheld } else { 0.0 });
        self.metrics.set(LEFT_DOMAIN, self.left_domain);
        self.colliders = Some(colliders);
        Ok(())
    }

    fn output(&self, cx: &FrameCx) -> Result<Outputs> {
        let volume = self.volume(cx)?;
        cx.publish_all(&self.metrics);
        let surface = surface(cx, &volume, SurfaceDetail::AS_IS)?;
        cx.publish(VOLUME_NOW, self.targets.volume());
        cx.publish(EULER_CHARACTERISTIC, measured::euler_characteristic(&surface));
        let mut out = Geometry::default();
        out.put_volume(volume.clone());
        let particles = particles(cx, self, lattice(cx), &volume)?;
        cx.publish(PARTICLES_NOW, particles.point_count() as f64);
        Ok(SURFACE.with(Geometry::from(surface)).and(PARTICLES, Geometry::from(particles)).and(VOLUME, out))
    }
}

impl Run {
    /// Moves on by a step of that many simulated seconds.
    fn advance(
        &mut self,
        cx: &StepCx,
        settings: LiquidSettings,
        colliders: &Colliders,
        seconds: f64,
    ) -> Result<LiquidReport> {
        let lattice = lattice(cx);
        let openings = |input, says| Opening::all(cx, input, says, &settings.domain, lattice);
        let (mut sources, sinks) = (openings(SOURCES, SOURCE)?, openings(SINKS, SINK)?);
        for source in &mut sources {
            let (mesh, attributes) = source.attributes();
            *attributes = self.columns.add_mesh(mesh, lattice, &mut self.surface);
        }
        let has_material = sources.iter().any(Opening::has_material);
        let share = |time: f64| (time / seconds).clamp(0.0, 1.0);
        let (first, frames) = (cx.previous().number(), cx.frame().number() - cx.previous().number());
        let params = |time: f64| cx.integrands::<2>(first + frames * share(time));
        let distance = |time: f64, point: [f32; 3]| colliders.distance(share(time) as f32, point);
        let speed = (lattice.cell / seconds) as f32;
        let velocity = |time: f64, point: [f32; 3]| colliders.velocity(share(time) as f32, point).map(|u| u * speed);
        let [sources, sinks] = [&sources, &sinks].map(|openings| Timed::all(openings, seconds));
        let sources: Vec<LiquidSource> = sources.iter().map(Timed::source).collect();
        let sinks: Vec<LiquidSink> = sinks.iter().map(Timed::sink).collect();
        let around = Surroundings {
            gravity: &|time| params(time)[0],
            viscosity: &|time| params(time)[1][0],
            solid: (!colliders.is_empty()).then_some(Solid { distance: &distance, velocity: &velocity }),
            sources: &sources,
            sinks: &sinks,
            cancelled: &|| cx.check_cancelled().is_err(),
        };
        let mut liquid = Liquid::resume(settings, self.surface.clone(), std::mem::take(&mut self.motion));
        if has_material && liquid.motion().materials().is_none() {
            liquid.set_materials(|_| LiquidMaterial::default());
        }
        let report = liquid.step_frame(&around, seconds);
        cx.check_cancelled()?;
        for account in liquid.sources() {
            self.targets.add(account.moved, Some(account.place));
        }
        for account in liquid.sinks() {
            self.targets.add(-account.moved, Some(account.place));
        }
        self.targets.add(-report.left_domain, None);
        let accounts = liquid.sources().iter().chain(liquid.sinks());
        self.withheld = accounts.fold(0.0, |sum, account| sum + account.withheld);
        let domain = domain(cx);
        let air = Air { gravity: params(0.5 * seconds)[0], seconds, cell: lattice.cell, domain: &domain, colliders };
        self.spray.retain_mut(|drop| {
            let stays = drop.fly(&air);
            self.left_domain += if stays { 0.0 } else { f64::from(drop.volume) };
            stays
        });
        (self.surface, self.motion) = liquid.into_parts();
        Ok(report)
    }

    /// Brings each piece of liquid to the volume that it should have, and makes spray of those that the grid lost.
    fn correct(&mut self, cx: &StepCx, report: &LiquidReport, colliders: &Colliders) {
        if report.substeps == 0 {
            return;
        }
        let solid = |point: [f32; 3]| colliders.distance(1.0, point);
        let corrected = match cx.get(VOLUME_CORRECTION) {
            true => self.targets.correct(&mut self.surface, colliders.solid(&solid)),
            false => self.targets.measure(&mut self.surface, colliders.solid(&solid)),
        };
        let mut sampler = Sampler::new(self.motion.rows());
        let places: Vec<[f32; 3]> = corrected.lost.iter().map(|piece| piece.place).collect();
        for (piece, material) in corrected.lost.iter().zip(materials_at(&self.motion, &places)) {
            let velocity = self.motion.velocity().at(&mut sampler, piece.place);
            self.spray.push(SprayDrop { place: piece.place, velocity, volume: piece.volume as f32, material });
        }
        self.metrics.set(VOLUME_DRIFT_RAW, corrected.raw_drift);
        self.metrics.set(VOLUME_DRIFT, corrected.drift);
        self.metrics.set(SPRAY, self.spray.iter().fold(0.0, |sum, drop| sum + f64::from(drop.volume)));
    }

    /// The output's volume: the level set without what lies inside colliders, and the velocity.
    fn volume(&self, cx: &FrameCx) -> Result<Arc<Volume>> {
        if let Some(volume) = self.volume.get() {
            return Ok(volume.clone());
        }
        let (lattice, settings) = (lattice(cx), settings(cx));
        let (bounds, layers) = ([settings.domain.low, settings.domain.high], BAND as i32 + settings.cfl.ceil() as i32);
        let velocity = Liquid::resume(settings, self.surface.clone(), self.motion.clone()).velocity(layers);
        let by = self.surface.resolution();
        let colliders = Colliders::now(cx, &domain(cx), lattice);
        let solid = |point: [f32; 3]| colliders.distance(1.0, point);
        let outside = colliders.solid(&solid).map(|solid| self.surface.phi_outside(solid));
        let view = self.surface.level_set().view();
        let phi = outside.as_deref().unwrap_or(view.phi);
        let volume = volume(PhiView { phi, ..view }, lattice.refined(by), &velocity, bounds, lattice)?;
        let volume = Arc::new(volume);
        Ok(self.volume.get_or_init(|| volume).clone())
    }
}

/// The ids of tracers: their own, or else their numbers.
fn tracer_ids(wires: &[&Component]) -> Vec<i32> {
    let mut ids = Vec::new();
    for tracers in wires {
        match tracers.get(ID) {
            Some(own) => ids.extend(own),
            None => ids.extend((ids.len() as i32..).take(tracers.point_count())),
        }
    }
    ids
}

fn leaves_out(params: &Params, wires: &Wires) -> Vec<LeftOut> {
    let mut out = Vec::new();
    let mut without = |stage, why| out.push(LeftOut::new(stage, why));
    if wires.count(&SOURCES) == 0 {
        without("sources", "no `sources` are wired");
    }
    if wires.count(&SINKS) == 0 {
        without("sinks", "no `sinks` are wired");
    }
    if wires.count(&COLLIDERS) == 0 {
        without("colliders", "no `colliders` are wired");
    }
    if wires.count(&TRACERS) == 0 {
        without("tracers", "no `tracers` are wired");
    }
    if !params.get(VOLUME_CORRECTION) {
        without("volume correction", "`volume_correction` is false");
    }
    if params.get(STOKES) == Coupling::Off {
        without("viscous stress", "`stokes` is off");
    }
    out
}

#[cfg(test)]
mod tests;
