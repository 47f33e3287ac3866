//! A liquid moved frame by frame: substeps short enough for its speed, each of them the surface moved, the velocity
//! carried along, forces added, and divergence driven out.
//!
//! Order of a substep: velocity continued past the liquid → surface moved, past solids as they are in the substep's middle; from
//! here on they are where they are at its end → the surface gains what it did not keep → sources fill, sinks empty → velocity carried
//! onto the new liquid → gravity, read at the substep's middle → pressure, and viscosity
//! with it ([`Coupling`]). The surface moves with a mean velocity of the substep, in which the flow has carried itself along for
//! half of it; liquid that touches nothing has fallen for half of it, too, and falls by ½g·t² in substeps of any length.
//!
//! Splitting velocity from pressure loses spin. [`Splitting::KeepsSpin`] adds what is lost before the velocity is carried.
//! A disk with a free surface, 19 cells in radius, keeps of its angular momentum over a turn (semi-Lagrangian), and a pool
//! at rest moves at most in 240 frames:
//!
//! | | 100 substeps a turn | 50 | pool, ÷ g·Δt |
//! |---|---|---|---|
//! | carried, then made free of divergence | 0.846 | 0.746 | 4e-7 |
//! | with the pressure's impulse carried once more, every substep (trapezoid) | 1.000 | 0.999 | waves grow |
//! | the same every other substep (advection–reflection: Zehnder, Narain and Thomaszewski 2018) | 1.000 | 0.999 | 1.6 |
//! | [`Splitting::KeepsSpin`] | 0.998 | 0.991 | 4e-7 |
//!
//! Disks of 10 and 38 cells and MacCormack are within 0.002 of it. The two in the middle hold the weight of the liquid at
//! the surface of the substep before, so any wave grows; a dam break gained a third of its energy. All take one pressure
//! solve a substep.
//!
//! A source adds ∫ rate dt from the first substep on: what is missing of its shape is filled, only in the middle where the
//! rate does not cover all of it, and the rest is divergence of its liquid, which acts in the next substep and is therefore what
//! the rate will ask for there. A frame with which that begins or ends starts with a substep of no length worth mentioning. Liquid enclosed on all sides gives way to no more
//! than leaves it elsewhere; the rest is withheld ([`FlowAccount`]). A drop of less than
//! a cell's radius is collected. Limit: where a jet only 6 cells across leaves the sharp
//! edge of a shape that is kept full, markers bulge, and it is 7 % too thick.
//!
//! Time and memory follow the liquid, not the domain: the cells that are stored are chosen anew each substep.

mod balls;
mod continuity;
mod domain;
mod exchange;
mod flight;
mod force;
mod fullness;
mod mean;
mod motion;
mod outflow;
mod part;
mod passed;
mod pools;
mod pour;
mod project;
mod regions;
mod remainder;
mod shape_cells;
mod shares;
mod sources;
mod stokes;
mod substep;
#[cfg(test)]
mod tests;
mod turned;

pub use balls::LiquidBall;
pub use continuity::Swelling;
pub use domain::{Domain, Solid, Wall};
pub use motion::Motion;
pub use outflow::Outflow;
pub(crate) use shares::{Shares, WHOLE};
pub use sources::{AttributeEdit, FlowAccount, LiquidSink, LiquidSource, SourceShape};
pub use substep::{Moving, Owed, Surface, Surroundings};

use self::exchange::Exchange;
use self::mean::Kept;
use self::pools::Pools;
use self::remainder::{Held, NEAR, Others, Remainder};
use self::sources::Span;
use self::substep::LOOKS;
use crate::carried::{LiquidMaterial, MaterialPoints, TracerPoints};
use crate::rows::CellRows;
use crate::velocity::{MacVelocity, Scheme};
use numerics::vector::Vec3;

/// How pressure is split from motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Splitting {
    /// The velocity is carried, then made free of divergence.
    Plain,
    /// What this loses of the spin is added before the velocity is carried.
    KeepsSpin,
}

/// When pressure and viscosity are solved together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coupling {
    /// Where viscosity changes what the grid shows: from [`LEAST_VISCOSITY`] on. Below, it is left out.
    #[default]
    Auto,
    /// Wherever there is viscosity.
    On,
    /// Never: pressure, viscosity and pressure again, where [`Self::Auto`] would solve them together. For comparison: a column
    /// sags 1.4 to 2 times too fast.
    Off,
}

/// The least viscosity · Δt ÷ (density · cell²) that is solved for: in a substep it takes at most 0.12 % from a wave of two
/// cells, the fastest to fade, which is less than carrying the velocity takes.
pub const LEAST_VISCOSITY: f64 = 1e-4;

/// How viscosity is solved for in a substep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViscousSolve {
    /// Not at all: pressure alone acts.
    LeftOut,
    /// Together with pressure.
    Coupled,
    /// After pressure, which then acts again.
    Decoupled,
}

impl Coupling {
    /// How a substep with this viscosity · Δt ÷ (density · cell²) is solved; the largest of its liquid.
    pub fn solve(self, viscosity: f64) -> ViscousSolve {
        match self {
            Self::Auto if viscosity >= LEAST_VISCOSITY => ViscousSolve::Coupled,
            Self::On if viscosity > 0.0 => ViscousSolve::Coupled,
            Self::Off if viscosity >= LEAST_VISCOSITY => ViscousSolve::Decoupled,
            Self::Auto | Self::On | Self::Off => ViscousSolve::LeftOut,
        }
    }

    /// Whether viscosity is solved for in such a substep.
    pub fn runs_viscosity(self, viscosity: f64) -> bool {
        self.solve(viscosity) != ViscousSolve::LeftOut
    }
}

/// What does not change while a liquid moves.
#[derive(Clone, Debug)]
pub struct LiquidSettings {
    /// The box of the liquid and its walls.
    pub domain: Domain,
    /// The side of a cell, m.
    pub cell: f64,
    /// Mass of a volume where no [`LiquidMaterial`] says otherwise, kg/m³.
    pub density: f64,
    /// When viscosity is solved for.
    pub coupling: Coupling,
    /// Share of the shear stress at closed walls and solids that is dropped: 0 no slip, 1 free slip.
    pub slip: f32,
    /// Cells that liquid and the surfaces of solids move in a substep, at most; one face of the liquid in 10,000 may move up to
    /// twice as far, and solids at most a cell.
    pub cfl: f64,
    /// Most substeps of a frame; with fewer than `cfl` asks for, they are longer.
    pub max_substeps: u32,
    /// Largest divergence · Δt that is left, and largest error of a velocity ÷ what forces add in a substep.
    pub tolerance: f64,
    /// Most iterations of a solve.
    pub max_iterations: u32,
    /// How velocity is carried.
    pub scheme: Scheme,
    /// How pressure is split from motion.
    pub splitting: Splitting,
}

impl LiquidSettings {
    /// The defaults for a domain of cells with this side, m.
    pub fn new(domain: Domain, cell: f64) -> Self {
        Self {
            domain,
            cell,
            density: 1000.0,
            coupling: Coupling::Auto,
            slip: 0.0,
            cfl: 2.0,
            max_substeps: 32,
            tolerance: 1e-4,
            max_iterations: 200,
            scheme: Scheme::MacCormack,
            splitting: Splitting::KeepsSpin,
        }
    }

    /// The volume of a cell, m³.
    pub(crate) fn cell_volume(&self) -> f64 {
        self.cell * self.cell * self.cell
    }
}

/// What a frame took and how it ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LiquidReport {
    /// Substeps taken.
    pub substeps: u32,
    /// The most cells that liquid moved in a substep.
    pub cfl_reached: f64,
    /// Substeps that were longer than `cfl` allows because of `max_substeps`.
    pub caps_hit: u32,
    /// Iterations of all pressure solves.
    pub pressure_iterations: u32,
    /// The largest net flow of a cell that a pressure solve left ÷ the speed.
    pub pressure_residual: f64,
    /// Substeps in which viscosity was solved for.
    pub viscous_substeps: u32,
    /// Iterations of all solves for pressure and viscosity together.
    pub coupled_iterations: u32,
    /// Largest error of a velocity that such a solve left, as it estimates, ÷ the speed.
    pub coupled_residual: f64,
    /// Iterations of all solves for viscosity alone ([`Coupling::Off`]).
    pub viscosity_iterations: u32,
    /// Largest error of a velocity that such a solve left, as it estimates, ÷ the speed.
    pub viscosity_residual: f64,
    /// Solves that ended before `tolerance`: at `max_iterations`, or where only rounding was left.
    pub solves_cut_short: u32,
    /// The largest divergence · Δt that was left in a substep.
    pub max_divergence: f64,
    /// The largest inflow · Δt, of a cell's volume, that liquid closed in on all sides could not give way to.
    pub unbalanced: f64,
    /// Liquid cells at the end.
    pub liquid_cells: usize,
    /// Cells stored at most.
    pub stored_cells: usize,
    /// What flowed out through open walls, m³.
    pub left_domain: f64,
    /// What was before a solid that moves too far in a substep, and is behind it since, m³.
    pub passed_through: f64,
    /// What sources gave, m³.
    pub sourced: f64,
    /// What sinks took, m³.
    pub sunk: f64,
    /// The force of pressure and viscosity on the solid, N: the mean over the time.
    pub solid_force: [f64; 3],
}

impl LiquidReport {
    /// Counts the iterations of other solves, and whether they ended early; not the errors that they left, where the solve at
    /// the end of the substep makes these good.
    fn count_solves(&mut self, other: &Self) {
        self.pressure_iterations += other.pressure_iterations;
        self.coupled_iterations += other.coupled_iterations;
        self.viscosity_iterations += other.viscosity_iterations;
        self.solves_cut_short += other.solves_cut_short;
    }

    fn add(&mut self, other: &Self) {
        self.count_solves(other);
        self.substeps += other.substeps;
        self.cfl_reached = self.cfl_reached.max(other.cfl_reached);
        self.caps_hit += other.caps_hit;
        self.pressure_residual = self.pressure_residual.max(other.pressure_residual);
        self.viscous_substeps += other.viscous_substeps;
        self.coupled_residual = self.coupled_residual.max(other.coupled_residual);
        self.viscosity_residual = self.viscosity_residual.max(other.viscosity_residual);
        self.max_divergence = self.max_divergence.max(other.max_divergence);
        self.unbalanced = self.unbalanced.max(other.unbalanced);
        self.liquid_cells = other.liquid_cells;
        self.stored_cells = self.stored_cells.max(other.stored_cells);
        self.left_domain += other.left_domain;
        self.passed_through += other.passed_through;
        self.sourced += other.sourced;
        self.sunk += other.sunk;
        (0..3).for_each(|axis| self.solid_force[axis] += other.solid_force[axis]);
    }
}

/// One in so many faces may be faster than `cfl` allows, by up to this factor: a splash has jets of a few cells, which would
/// ask for twice the substeps.
const RARE: usize = 10_000;
const FASTER: f64 = 2.0;

/// Cells that the surface of a solid moves along its normal in a substep, at most, however large `cfl` is: liquid that does not
/// yet move as the solid does loses what the solid moves over.
const SOLID_WAY: f64 = 1.0;

/// Share of a frame that a substep takes in which pouring begins or ends: it does so at the end of a substep.
const BEGINNING: f64 = 1e-6;

/// The next substep, s, one of so many equal ones.
struct Plan {
    step: f64,
    count: f64,
    /// Whether it is longer than the speed asks for.
    is_capped: bool,
}

/// A liquid, and all that its next frame depends on.
#[derive(Clone, Debug)]
pub struct Liquid<S> {
    settings: LiquidSettings,
    surface: S,
    motion: Motion,
}

impl<S: Surface> Liquid<S> {
    /// A liquid with this surface, at rest.
    pub fn new(settings: LiquidSettings, surface: S) -> Self {
        Self { settings, surface, motion: Motion::default() }
    }

    /// A liquid as it was when `surface` and `motion` were taken from it: its further frames have the same bits.
    pub fn resume(settings: LiquidSettings, surface: S, motion: Motion) -> Self {
        Self { settings, surface, motion }
    }

    /// The surface.
    pub fn surface(&self) -> &S {
        &self.surface
    }

    /// The surface, to change it between frames: liquid where there was none gets the velocity of what is around it.
    pub fn surface_mut(&mut self) -> &mut S {
        &mut self.surface
    }

    /// The velocity and what else the next substep starts from.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Gives every liquid face the velocity at its middle, a place in cells, m/s.
    pub fn set_velocity(&mut self, velocity: impl Fn([f32; 3]) -> [f32; 3] + Sync, around: &Surroundings<'_>) {
        let carried = std::mem::take(&mut self.motion);
        let (tracers, materials) = (carried.tracers, carried.materials);
        let motion = Motion::starting(&self.settings, &self.surface, around, &velocity);
        self.motion = Motion { tracers, materials, ..motion };
    }

    /// Lets the liquid carry tracers from these places, in cells.
    pub fn set_tracers(&mut self, places: Vec<Vec3>) {
        self.motion.tracers = TracerPoints::new(places);
    }

    /// Says what the liquid is made of at each place, in cells, instead of the same everywhere.
    pub fn set_materials(&mut self, material: impl Fn(Vec3) -> LiquidMaterial + Sync) {
        self.motion.materials = Some(MaterialPoints::filling(&self.surface.view(), material));
    }

    /// Moves the surface outward so that it gains these volumes, each in the part of the liquid where it is. `seconds`: when, since the
    /// start of the frame.
    pub fn give(&mut self, owed: &[Owed], around: &Surroundings<'_>, seconds: f64) {
        if owed.is_empty() || self.surface.view().rows.is_empty() {
            return;
        }
        let solid = around.solid.map(|solid| solid.at(seconds));
        let view = self.surface.view();
        let others = Others {
            domain: &self.settings.domain,
            solids: solid.map(|solid| [solid; 2]),
            is_counted: true,
            is_thin: solid.is_some_and(|solid| Pools::are_needed(&view, solid)),
            shapes: &[],
            time: seconds,
        };
        let rows = view.rows.filtered(|_, at| view.phi[at] < NEAR);
        let held = Held::of(&rows, &self.surface, &others, 0.0);
        let mut remainder = Remainder::of(None, &held, &others, 0.0);
        remainder.owe(owed);
        remainder.give_back(&mut self.surface, LOOKS);
    }

    /// The surface, and all else that the next frame depends on.
    pub fn into_parts(self) -> (S, Motion) {
        (self.surface, self.motion)
    }

    /// The velocity, m/s, continued `layers` cells past the liquid, but no farther than a substep follows it.
    pub fn velocity(&self, layers: i32) -> MacVelocity {
        self.motion.velocity_past_liquid(&self.settings.domain, layers)
    }

    /// Moves on by `seconds`, in as many substeps as the speed asks for.
    pub fn step_frame(&mut self, around: &Surroundings<'_>, seconds: f64) -> LiquidReport {
        let mut report = LiquidReport { liquid_cells: self.motion.liquid_cells(), ..LiquidReport::default() };
        FlowAccount::start_frame(&mut self.motion.sources, around.sources.len());
        FlowAccount::start_frame(&mut self.motion.sinks, around.sinks.len());
        self.motion.outflow.clear();
        let mut left = seconds;
        let mut kept = None;
        let beginnings = u32::from(self.rates_change(around, seconds) && !(around.cancelled)());
        if beginnings > 0 {
            left = seconds - BEGINNING * seconds;
            let next_seconds = self.plan(around, [seconds - left, seconds], self.settings.max_substeps).step;
            let span = Span { times: [0.0, seconds - left], next_seconds, ends_frame: false };
            // Unless it was at rest: what moves then does so by what began.
            let is_new = self.motion.is_new && self.motion.largest_speed() > 0.0;
            report.add(&self.substep(around, span, seconds, &mut kept));
            // What begins at once is no acceleration that goes on.
            (self.motion.gain, self.motion.is_new) = (None, is_new);
        }
        while left > 0.0 && !(around.cancelled)() {
            let allowed = self.settings.max_substeps.saturating_sub(report.substeps - beginnings);
            let Plan { step, count, is_capped } = self.plan(around, [seconds - left, seconds], allowed);
            let after = if count > 1.0 { left - step } else { 0.0 };
            let times = [seconds - left, seconds - after];
            let span = Span { times, next_seconds: step, ends_frame: after == 0.0 };
            let mut done = self.substep(around, span, seconds, &mut kept);
            done.caps_hit = u32::from(is_capped);
            report.add(&done);
            left = after;
        }
        let accounts = self.motion.sources.iter_mut().chain(&mut self.motion.sinks);
        accounts.for_each(FlowAccount::end_frame);
        Outflow::merge(&mut self.motion.outflow);
        let moved = |accounts: &[FlowAccount]| accounts.iter().map(|account| account.moved).sum();
        (report.sourced, report.sunk) = (moved(self.sources()), moved(self.sinks()));
        report
    }

    /// The next of at most `allowed` substeps between two times.
    fn plan(&self, around: &Surroundings<'_>, [from, to]: [f64; 2], allowed: u32) -> Plan {
        let (left, allowed) = (to - from, f64::from(allowed.max(1)));
        let solid_speed = around.solid.map_or(0.0, |solid| solid.speed);
        let solid_longest = self.settings.cfl.min(SOLID_WAY) * self.settings.cell / solid_speed;
        let longest = self.longest_substep((around.gravity)(from)).min(solid_longest);
        let wanted = (left / longest).ceil().max(1.0);
        let is_capped = wanted > allowed;
        let count = if is_capped { allowed } else { wanted };
        Plan { step: left / count, count, is_capped }
    }

    /// A substep of a frame of `seconds`. `kept`: what the substeps of the frame hand on.
    fn substep(
        &mut self,
        around: &Surroundings<'_>,
        span: Span,
        seconds: f64,
        kept: &mut Option<Kept>,
    ) -> LiquidReport {
        let mut done = substep::substep(&self.settings, &mut self.surface, &mut self.motion, around, span, kept);
        done.solid_force = done.solid_force.map(|force| force * (span.times[1] - span.times[0]) / seconds);
        done
    }

    /// Whether a source or a sink within the liquid begins or ends with the frame, or its rate jumps.
    fn rates_change(&self, around: &Surroundings<'_>, seconds: f64) -> bool {
        let solid = around.solid.map(|solid| solid.at(0.0));
        let span = Span { times: [0.0, seconds], next_seconds: seconds, ends_frame: true };
        let frame = Exchange { settings: &self.settings, around, solid, span };
        seconds > 0.0 && frame.changes(&self.surface, &self.motion)
    }

    /// What each source gave in the last frame.
    pub fn sources(&self) -> &[FlowAccount] {
        &self.motion.sources
    }

    /// What each sink took in the last frame.
    pub fn sinks(&self) -> &[FlowAccount] {
        &self.motion.sinks
    }

    /// What flowed out through open walls in the last frame.
    pub fn outflow(&self) -> &[Outflow] {
        &self.motion.outflow
    }

    /// The time in which fast liquid moves `cfl` cells, where gravity makes it faster meanwhile.
    fn longest_substep(&self, gravity: [f64; 3]) -> f64 {
        let way = self.settings.cfl * self.settings.cell;
        let speed = self.motion.usual_speed(RARE, FASTER);
        let pull = gravity.iter().fold(0.0_f64, |most, g| most.max(g.abs()));
        // speed·t + pull·t² = way.
        let by_speed = 2.0 * way / (speed + (speed * speed + 4.0 * pull * way).sqrt());
        // Waves two cells long have frequency √(π·pull ÷ cell); two steps a radian keep them from growing.
        let by_waves = (self.settings.cell / pull).sqrt();
        by_speed.min(by_waves)
    }

    /// The cells that are stored between frames.
    pub fn stored_rows(&self) -> &CellRows {
        self.motion.rows()
    }
}
