//! The state of a simulation, from frame to frame.

use std::sync::Arc;

use engine::prelude::*;
use liquid::carried::{LiquidMaterial, MaterialPoints};
use liquid::level_set::{BAND, PhiView};
use liquid::marked::MarkedSurface;
use liquid::step::{
    Liquid, LiquidReport, LiquidSettings, LiquidSink, LiquidSource, Motion, Owed, Solid, Surface, Surroundings,
};
use liquid::velocity::Sampler;
use liquid::volumes::{LostPiece, VolumeReport, VolumeTargets, cap};
use numerics::vector::{add, cross, scale, sub};
use serde::{Deserialize, Serialize};

use super::carried::CarriedColumns;
use super::domain::{checks, domain, lattice, settings};
use super::measured::{centre_of_mass, euler_characteristic, liquid_cells, measured};
use super::openings::{Opening, SINK, SOURCE, Timed};
use super::particles::{particle_count, particles};
use super::shapes::{Colliders, in_cells};
use super::spray::{Air, SprayDrop, gathered, rejoining};
use super::start::{check_grown, liquid_at_start};
use super::{
    CELL, CFL_REACHED, CLASHES, COLLECTING, DENSITY, EULER_CHARACTERISTIC, FAST_SHAPES, IN_COLLIDERS, IN_VAIN,
    INITIAL_SPIN, INITIAL_VELOCITY, LEFT_DOMAIN, LIQUID, LIQUID_CELLS, MADE_GOOD, MADE_GOOD_NOW, MATERIAL_DRIFT,
    MISWIRED, OUTSIDE, PARTICLES, PARTICLES_NOW, POSITION_STEP, RATE_ENDED, SINKS, SOURCED, SOURCES, SPRAY, SUNK,
    SURFACE, TIME_SCALE, TRACERS, TRACERS_OUTSIDE, UNSEEN, VOLUME, VOLUME_BALANCE, VOLUME_CORRECTION, VOLUME_DRIFT,
    VOLUME_DRIFT_RAW, VOLUME_NOW, WITHHELD, WITHHELD_WIRE,
};
use crate::shared::attributes::{SINK_RATE, SOURCE_ACTIVE, SOURCE_RATE, SOURCE_VELOCITY};
use crate::shared::surface::{SurfaceDetail, surface};
use crate::shared::volume::volume;

/// Cells past the liquid, besides its band, that the velocity of the output goes on where liquid moves no farther, if `cfl`
/// allows it so much.
const LEAST_MOVED: f64 = 2.0;

/// Share of all volume that sums of it may be off by.
const ROUNDING: f64 = 1e-9;

/// The state of the simulation.
#[derive(Serialize, Deserialize)]
pub(super) struct Run {
    pub(super) surface: MarkedSurface,
    pub(super) motion: Motion,
    /// What there was at the start, m³.
    started: f64,
    /// Since the start, m³: what sources gave, what sinks took, what left through open walls.
    sourced: f64,
    sunk: f64,
    left_domain: f64,
    /// In the last frame, m³, and the wire of which most is.
    withheld: f64,
    withheld_wire: usize,
    /// Sources that gave nothing in the last frame, since it is too little.
    collecting: usize,
    /// For each wire of `sources`, then `sinks`: whether it had a rate in a frame before.
    had_rate: Vec<bool>,
    /// Those of them that had one, and keep full or empty in the last frame.
    rate_ended: usize,
    targets: VolumeTargets,
    /// The liquids at the start; those of sources are numbered on from there.
    start_phases: u32,
    pub(super) spray: Vec<SprayDrop>,
    /// What the surface has to gain in the next step, for drops that it lost in this one.
    owed: Vec<Owed>,
    /// The id of the next drop; they count down from −1.
    next_drop: i32,
    /// The attributes that came with liquid, sources and tracers.
    pub(super) columns: CarriedColumns,
    /// The ids of the tracers at the start.
    pub(super) tracer_ids: Vec<i32>,
    /// Metrics of the last step; empty at the start.
    metrics: MetricValues,
    /// Those of the start.
    start: MetricValues,
    #[serde(skip)]
    colliders: Option<Colliders>,
}

impl Chain for Run {
    fn start(cx: &FrameCx) -> Result<Self> {
        checks(cx.params())?;
        let lattice = lattice(cx);
        let domain = domain(cx);
        let start = liquid_at_start(cx, &domain, lattice)?;
        let mut surface = start.surface.clone();
        let colliders = Colliders::at_start(cx, &domain, lattice)?;
        if !colliders.is_empty() {
            surface.meet(&|point| colliders.distance(1.0, point));
        }
        let [velocity, spin] = [INITIAL_VELOCITY, INITIAL_SPIN].map(|param| cx.get(param).map(|x| x as f32));
        let density = |place: [f32; 3]| match colliders.distance(1.0, place) >= 0.0 {
            true => start.material(place).density.map_or(cx.get(DENSITY), f64::from),
            false => 0.0,
        };
        let centre = if spin == [0.0; 3] { spin } else { centre_of_mass(&surface, density) };
        let side = lattice.cell as f32;
        let at = |point: [f32; 3]| add(velocity, cross(spin, scale(sub(point, centre), side)));
        let distance = |_: f64, point: [f32; 3]| colliders.distance(1.0, point);
        let around = Surroundings {
            solid: (!colliders.is_empty()).then(|| Solid::still(&distance)),
            ..Surroundings::new(&|_| [0.0; 3], &|_| 0.0)
        };
        let mut liquid = Liquid::new(settings(cx), surface);
        liquid.set_velocity(at, &around);
        let start_phases = start.phases();
        if start.has_materials() {
            liquid.set_materials(|place| start.material(place));
        }
        let parts = start.parts(&domain, &colliders, lattice.cell);
        let known = start.known(&domain, &colliders, lattice.cell);
        let mut start_metrics = MetricValues::default();
        start_metrics.set(OUTSIDE, known.outside);
        start_metrics.set(IN_COLLIDERS, known.in_colliders);
        start_metrics.set(IN_VAIN, said_in_vain(cx) as f64);
        let (mut columns, tracers) = (start.columns, cx.part_at_start(TRACERS));
        columns.add_tracers(&tracers);
        for mesh in cx.part_at_start(SOURCES) {
            columns.add_mesh(mesh, lattice, liquid.surface_mut());
        }
        let places = tracers.iter().flat_map(|tracers| in_cells(tracers, lattice)).collect();
        liquid.set_tracers(places);
        let (mut surface, mut motion) = liquid.into_parts();
        let at_rest = |point: [f32; 3]| colliders.distance(1.0, point);
        let parts = if cx.get(VOLUME_CORRECTION) { parts } else { Vec::new() };
        let (solid, materials) = (colliders.solid(&at_rest), motion.materials_mut());
        let targets = VolumeTargets::of_parts(&mut surface, lattice.cell, solid, materials, &parts);
        let tracer_places = motion.tracers().points();
        let is_outside = |place: &&[f32; 3]| !domain.contains(place.map(|x| x.floor() as i32));
        start_metrics.set(TRACERS_OUTSIDE, tracer_places.iter().filter(is_outside).count() as f64);
        start_metrics.set(UNSEEN, known.unseen(targets.volume()));
        let mut run = Self {
            surface,
            motion,
            started: targets.target() + targets.waiting(),
            sourced: 0.0,
            sunk: 0.0,
            left_domain: 0.0,
            withheld: 0.0,
            withheld_wire: 0,
            collecting: 0,
            had_rate: Vec::new(),
            rate_ended: 0,
            targets,
            start_phases,
            spray: Vec::new(),
            owed: Vec::new(),
            next_drop: -1,
            columns,
            tracer_ids: tracer_ids(&tracers),
            metrics: MetricValues::default(),
            start: start_metrics,
            colliders: Some(colliders),
        };
        run.metrics.set(LIQUID_CELLS, liquid_cells(&run.surface) as f64);
        Ok(run)
    }

    fn step(&mut self, cx: &StepCx) -> Result<()> {
        let (lattice, settings) = (lattice(cx), settings(cx));
        let colliders = Colliders::within_step(cx, self.colliders.take(), &settings.domain, lattice)?;
        let passed = |frame: Frame| cx.integrals::<2>(frame)[1][1];
        let seconds = passed(cx.frame()) - passed(cx.previous());
        self.metrics = MetricValues::default();
        let (report, fast_openings) = match seconds > 0.0 {
            true => self.advance(cx, settings, &colliders, seconds)?,
            false => (LiquidReport { liquid_cells: self.motion.liquid_cells(), ..LiquidReport::default() }, 0),
        };
        measured(&mut self.metrics, &report);
        self.balance(&report);
        let has_moved = report.substeps > 0;
        self.metrics.set(WITHHELD, if has_moved { self.withheld } else { 0.0 });
        self.metrics.set(WITHHELD_WIRE, self.withheld_wire as f64);
        self.metrics.set(COLLECTING, if has_moved { self.collecting as f64 } else { 0.0 });
        self.metrics.set(RATE_ENDED, if has_moved { self.rate_ended as f64 } else { 0.0 });
        self.metrics.set(MISWIRED, miswired(cx) as f64);
        self.metrics.set(FAST_SHAPES, (colliders.fast() + fast_openings) as f64);
        self.colliders = Some(colliders);
        Ok(())
    }

    fn output(&self, cx: &FrameCx) -> Result<Outputs> {
        let volume = self.volume(cx)?;
        cx.publish_all(&self.metrics);
        cx.publish_all(&self.start);
        let surface = surface(cx, &volume, SurfaceDetail::AS_IS)?;
        cx.publish(VOLUME_NOW, self.targets.volume());
        cx.publish(EULER_CHARACTERISTIC, euler_characteristic(&surface));
        cx.publish(PARTICLES_NOW, particle_count(self) as f64);
        cx.publish(POSITION_STEP, position_step(&surface) / cx.get(CELL));
        cx.publish(CLASHES, self.columns.clashes() as f64);
        let mut outputs = SURFACE.with(Geometry::from(surface));
        if cx.wants_output(PARTICLES) {
            outputs = outputs.and(PARTICLES, Geometry::from(particles(cx, self, lattice(cx), &volume)?));
        }
        if cx.wants_output(VOLUME) {
            let mut out = Geometry::default();
            out.put_volume(volume);
            outputs = outputs.and(VOLUME, out);
        }
        Ok(outputs)
    }
}

impl Run {
    /// Moves on by a step of that many simulated seconds. Returns how many sources and sinks move too fast besides.
    fn advance(
        &mut self,
        cx: &StepCx,
        settings: LiquidSettings,
        colliders: &Colliders,
        seconds: f64,
    ) -> Result<(LiquidReport, usize)> {
        let lattice = lattice(cx);
        let openings = |input, says| Opening::all(cx, input, says, &settings.domain, lattice);
        let (mut sources, sinks) = (openings(SOURCES, SOURCE)?, openings(SINKS, SINK)?);
        for (source, phase) in sources.iter_mut().zip(self.start_phases..) {
            source.set_phase(phase);
            let (mesh, attributes) = source.attributes();
            *attributes = self.columns.add_mesh(mesh, lattice, &mut self.surface);
        }
        let is_split = self.motion.materials().is_some();
        for source in &sources {
            check_grown(cx, source.kept_cells(&settings.domain, lattice), is_split)?;
        }
        let fast = sources.iter().chain(&sinks).filter(|opening| opening.is_fast()).count();
        self.note_rates(sources.iter().chain(&sinks));
        let has_material = sources.iter().any(Opening::has_material);
        let share = |time: f64| (time / seconds).clamp(0.0, 1.0);
        let (first, frames) = (cx.previous().number(), cx.frame().number() - cx.previous().number());
        let params = |time: f64| cx.integrands::<2>(first + frames * share(time));
        let distance = |time: f64, point: [f32; 3]| colliders.distance(share(time) as f32, point);
        let speed = (lattice.cell / seconds) as f32;
        let solid_speed = colliders.sweep_near(self.surface.view().rows.bounds()) * lattice.cell / seconds;
        let velocity = |time: f64, point: [f32; 3]| colliders.velocity(share(time) as f32, point).map(|u| u * speed);
        let [sources, sinks] = [&sources, &sinks].map(|openings| Timed::all(openings, seconds));
        let sources: Vec<LiquidSource> = sources.iter().map(Timed::source).collect();
        let sinks: Vec<LiquidSink> = sinks.iter().map(Timed::sink).collect();
        let around = Surroundings {
            gravity: &|time| params(time)[0],
            viscosity: &|time| params(time)[1][0],
            solid: (!colliders.is_empty()).then_some(Solid {
                distance: &distance,
                velocity: &velocity,
                speed: solid_speed,
            }),
            sources: &sources,
            sinks: &sinks,
            cancelled: &|| cx.check_cancelled().is_err(),
        };
        let mut liquid = Liquid::resume(settings.clone(), self.surface.clone(), std::mem::take(&mut self.motion));
        if has_material && liquid.motion().materials().is_none() {
            liquid.set_materials(|_| LiquidMaterial::default());
        }
        let report = liquid.step_frame(&around, seconds);
        cx.check_cancelled()?;
        check_grown(cx, report.liquid_cells as f64, liquid.motion().materials().is_some())?;
        let has_phases = liquid.motion().materials().is_some();
        let phase = |n: u32| if has_phases { self.start_phases + n } else { 0 };
        for (account, n) in liquid.sources().iter().zip(0..) {
            self.targets.add_phase(account.moved, phase(n), Some(account.place));
        }
        for account in liquid.sinks() {
            self.targets.add(-account.moved, Some(account.place));
        }
        for outflow in liquid.outflow() {
            self.targets.add(-outflow.volume, Some(outflow.place()));
        }
        let withheld: Vec<f64> =
            liquid.sources().iter().chain(liquid.sinks()).map(|account| account.withheld).collect();
        self.withheld = withheld.iter().fold(0.0, |sum, withheld| sum + withheld);
        self.withheld_wire =
            (0..withheld.len()).rev().max_by(|a, b| withheld[*a].total_cmp(&withheld[*b])).unwrap_or(0);
        self.collecting = liquid.sources().iter().filter(|account| account.is_collecting()).count();
        let domain = domain(cx);
        let air = Air { gravity: params(0.5 * seconds)[0], seconds, cell: lattice.cell, domain: &domain, colliders };
        self.spray.retain_mut(|drop| {
            let stays = drop.fly(&air);
            self.left_domain += if stays { 0.0 } else { drop.volume };
            stays
        });
        let landed = rejoining(&mut self.spray, liquid.surface(), lattice.cell);
        let in_cells = |volume: f64| (volume / (lattice.cell * lattice.cell * lattice.cell)) as f32;
        let mut owed = std::mem::take(&mut self.owed);
        owed.extend(landed.iter().map(|drop| (drop.place, in_cells(drop.volume))));
        liquid.give(&owed, &around, seconds);
        (self.surface, self.motion) = liquid.into_parts();
        for drop in landed {
            self.targets.add_phase(drop.volume, drop.phase, Some(drop.place));
        }
        self.correct(cx, settings, &report, &air);
        Ok((report, fast))
    }

    /// Counts the openings whose rate fell to 0, where that no longer limits what they give or take.
    fn note_rates<'a>(&mut self, openings: impl Iterator<Item = &'a Opening>) {
        self.rate_ended = 0;
        for (n, opening) in openings.enumerate() {
            self.had_rate.resize(self.had_rate.len().max(n + 1), false);
            let had = self.had_rate[n];
            self.had_rate[n] = had || opening.has_rate();
            self.rate_ended += usize::from(had && !opening.has_rate() && opening.is_active(1.0));
        }
    }

    /// Brings each piece of liquid to the volume that it should have, and makes spray of those that the grid lost, and liquid
    /// of spray that it can show.
    fn correct(&mut self, cx: &StepCx, settings: LiquidSettings, report: &LiquidReport, air: &Air<'_>) {
        let distance = |point: [f32; 3]| air.colliders.distance(1.0, point);
        let solid = air.colliders.solid(&distance);
        let corrected = match cx.get(VOLUME_CORRECTION) {
            true => {
                let way = report.cfl_reached * f64::from(report.substeps);
                self.targets.correct_within(&mut self.surface, solid, self.motion.materials_mut(), cap(way))
            }
            false => {
                let phases = self.motion.materials().map(MaterialPoints::phases);
                self.targets.measure(&mut self.surface, solid, phases.as_ref())
            }
        };
        self.metrics.set(MADE_GOOD, percent(corrected.corrected, corrected.target));
        self.metrics.set(MADE_GOOD_NOW, percent(corrected.corrected_now, corrected.target));
        self.spray(&corrected.lost, air);
        self.owed.extend(&corrected.owed);
        let raw_drift = corrected.raw_drift;
        let now = self.gather(settings, air).unwrap_or(corrected);
        if report.caps_hit > 0 {
            // In substeps too long to follow the liquid, no region knew what it had lost.
            self.owed.clear();
        }
        let waiting = self.targets.take_waiting();
        self.spray(&waiting, air);
        self.metrics.set(VOLUME_DRIFT_RAW, raw_drift);
        self.metrics.set(VOLUME_DRIFT, now.drift);
        self.metrics.set(MATERIAL_DRIFT, now.phase_drift);
    }

    /// Makes drops of liquid that the grid does not show.
    fn spray(&mut self, pieces: &[LostPiece], air: &Air<'_>) {
        let mut sampler = Sampler::new(self.motion.rows());
        let places: Vec<([f32; 3], u32)> = pieces.iter().map(|piece| (piece.place, piece.phase)).collect();
        let materials = self.motion.materials().map(|materials| materials.closest_of_phases(&places));
        for (n, piece) in pieces.iter().enumerate() {
            let velocity = self.motion.velocity().at(&mut sampler, piece.place);
            let material = materials.as_ref().map_or([None; 2], |own| [own[n].viscosity, own[n].density]);
            let LostPiece { place, volume, phase } = *piece;
            let mut drop = SprayDrop { place, velocity, volume, material, phase, id: self.next_drop };
            drop.put_outside(air);
            self.next_drop = self.next_drop.checked_sub(1).unwrap_or(-1);
            self.spray.push(drop);
        }
    }

    /// Makes liquid of drops that hold enough for the grid to show; what is measured then, if there are any.
    fn gather(&mut self, settings: LiquidSettings, air: &Air<'_>) -> Option<VolumeReport> {
        let balls = gathered(&mut self.spray, air);
        if balls.is_empty() {
            return None;
        }
        let distance = |_: f64, point: [f32; 3]| air.colliders.distance(1.0, point);
        let solid = (!air.colliders.is_empty()).then(|| Solid::still(&distance));
        let mut liquid = Liquid::resume(settings, self.surface.clone(), std::mem::take(&mut self.motion));
        for (ball, volume) in balls {
            liquid.add_ball(&ball, solid, 0.0);
            self.targets.add_phase(volume, ball.material.phase, Some(ball.place));
        }
        (self.surface, self.motion) = liquid.into_parts();
        let phases = self.motion.materials().map(MaterialPoints::phases);
        let at_end = |point: [f32; 3]| air.colliders.distance(1.0, point);
        let now = self.targets.measure(&mut self.surface, air.colliders.solid(&at_end), phases.as_ref());
        self.spray(&now.lost, air);
        self.owed.extend(&now.owed);
        Some(now)
    }

    /// Settles what sinks and open walls took beyond what there was, and sets what is measured of the accounts.
    fn balance(&mut self, report: &LiquidReport) {
        let owed = self.targets.forgive();
        let from_sinks = owed.min(report.sunk);
        self.sunk += report.sunk - from_sinks;
        self.left_domain += report.left_domain - (owed - from_sinks);
        self.sourced += report.sourced;
        let spray = self.spray.iter().fold(0.0, |sum, drop| sum + drop.volume);
        let (came, went) = (self.started + self.sourced, self.sunk + self.left_domain);
        // What pieces should hold is exact; what they do hold follows.
        let owned = self.targets.target() + self.targets.waiting() + spray;
        let off = owned + went - came;
        debug_assert!(off.is_nan() || off.abs() <= ROUNDING * came.max(went), "{owned} m³, {came} came, {went} went");
        let error = self.targets.volume() + spray + went - came;
        self.metrics.set(VOLUME_BALANCE, if came > 0.0 { error / came } else { 0.0 });
        self.metrics.set(SPRAY, spray);
        self.metrics.set(SOURCED, self.sourced);
        self.metrics.set(SUNK, self.sunk);
        self.metrics.set(LEFT_DOMAIN, self.left_domain);
    }

    /// The output's volume: the level set without what lies inside colliders, and the velocity.
    fn volume(&self, cx: &FrameCx) -> Result<Arc<Volume>> {
        let (lattice, settings) = (lattice(cx), settings(cx));
        let bounds = [settings.domain.low, settings.domain.high];
        // `cfl` may ask for more cells than liquid moves.
        let moved = self.metrics.get(CFL_REACHED).unwrap_or_default().max(LEAST_MOVED);
        let layers = BAND as i32 + settings.cfl.min(moved).ceil() as i32;
        let velocity = self.motion.velocity_past_liquid(&settings.domain, layers);
        let by = self.surface.resolution();
        let colliders = Colliders::now(cx, &domain(cx), lattice);
        let solid = |point: [f32; 3]| colliders.distance(1.0, point);
        let outside = colliders.solid(&solid).map(|solid| self.surface.phi_outside(solid));
        let view = self.surface.level_set().view();
        let phi = outside.as_deref().unwrap_or(view.phi);
        let volume = volume(PhiView { phi, ..view }, lattice.refined(by), &velocity, pace(cx), bounds, lattice)?;
        Ok(Arc::new(volume))
    }
}

/// Simulated seconds per second of the scene: what makes velocities of the scene of those of the simulation.
pub(super) fn pace(cx: &Cx) -> f32 {
    cx.get(TIME_SCALE) as f32
}

/// The distance between neighbouring coordinates that single precision has, m, at the largest of a part.
fn position_step(part: &Component) -> f64 {
    let largest = part.positions().iter().flatten().fold(0.0_f32, |most, x| most.max(x.abs()));
    f64::from(largest.next_up()) - f64::from(largest)
}

/// Wires of `liquid` that say what only a source does, and are none.
fn said_in_vain(cx: &FrameCx) -> usize {
    let sources = cx.part_at_start(SOURCES);
    let is_source = |mesh: &Component| sources.iter().any(|source| source.positions() == mesh.positions());
    let says = |mesh: &Component| {
        let has_rate = mesh.get(SOURCE_RATE).and_then(|rows| rows.first()).is_some_and(|rate| *rate > 0.0);
        let is_off = mesh.get(SOURCE_ACTIVE).and_then(|rows| rows.first()) == Some(&0);
        has_rate || is_off || mesh.get(SOURCE_VELOCITY).is_some()
    };
    cx.part_at_start(LIQUID).into_iter().filter(|mesh| says(mesh) && !is_source(mesh)).count()
}

/// A share of a volume in per cent, without its sign; 0 of none.
fn percent(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { (100.0 * part / whole).abs() } else { 0.0 }
}

/// Wires of `sources` that are sinks, and of `sinks` that are sources.
fn miswired(cx: &StepCx) -> usize {
    let count = |input, is: Attr<f32>, is_not: Attr<f32>| {
        let wires = cx.samples(input).last().map_or(&[][..], |(_, wires)| &wires[..]);
        let meshes = wires.iter().filter_map(|wire| wire.mesh());
        meshes.filter(|mesh| mesh.get(is).is_some() && mesh.get(is_not).is_none()).count()
    };
    count(SOURCES, SINK_RATE, SOURCE_RATE) + count(SINKS, SOURCE_RATE, SINK_RATE)
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
