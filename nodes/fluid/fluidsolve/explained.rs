//! What `convect explain` says of a simulation.

use engine::prelude::*;
use liquid::step::{Coupling, LEAST_VISCOSITY};

use super::domain::cells;
use super::{
    CELL, COLLIDERS, DENSITY, DOMAIN_FROM, FOLLOW, MAX_SUBSTEPS, SINKS, SOURCES, STOKES, TIME_SCALE, TRACERS,
    VISCOSITY, VOLUME_CORRECTION,
};

/// The stages that do not run.
pub(super) fn leaves_out(params: &Params, wires: &Wires) -> Vec<LeftOut> {
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
    if params.get(VISCOSITY) == 0.0 {
        without("viscous stress", "`viscosity` is 0; liquid with one of its own keeps it");
    }
    out
}

/// The box, and how viscosity is solved for, with the params at the start.
pub(super) fn explained(params: &Params, clock: Clock) -> Vec<String> {
    let mut lines = vec![solve(params, clock)];
    if !params.get(FOLLOW) {
        lines.insert(0, extent(params));
    }
    lines
}

/// The box in cells, and where it ends.
fn extent(params: &Params) -> String {
    let (cells, from, cell) = (cells(params), params.get(DOMAIN_FROM), params.get(CELL));
    let to = [0, 1, 2].map(|axis| (from[axis] + cells[axis] * cell) as f32);
    format!("the box has {} × {} × {} cells, up to {to:?}", cells[0], cells[1], cells[2])
}

/// Which solve runs.
fn solve(params: &Params, clock: Clock) -> String {
    let (viscosity, cell) = (params.get(VISCOSITY), params.get(CELL));
    let of_frame = viscosity * params.get(TIME_SCALE) / (clock.fps * params.get(DENSITY) * cell * cell);
    let of_shortest = of_frame / params.get(MAX_SUBSTEPS) as f64;
    let coupling = params.get(STOKES);
    let how = match coupling {
        Coupling::Auto | Coupling::On => "pressure and viscosity are solved together",
        Coupling::Off => "pressure, viscosity and pressure again are solved one after the other",
    };
    let bound = match coupling {
        Coupling::On => "above 0".to_owned(),
        Coupling::Auto | Coupling::Off => format!("at least {LEAST_VISCOSITY}"),
    };
    let runs = |value: f64| coupling.runs_viscosity(value);
    let verdict = match (runs(of_frame), runs(of_shortest)) {
        (_, true) => "in every substep".to_owned(),
        (true, false) => format!("in substeps of at least 1/{} frame", (of_frame / LEAST_VISCOSITY).floor()),
        (false, false) => "in none, pressure alone acts on liquid without one of its own".to_owned(),
    };
    format!(
        "{how} where viscosity·dt/(density·cell²) is {bound}. With the values at the start it is {of_shortest:.1e} in the shortest \
         substep, {of_frame:.1e} in one of a whole frame: {verdict}. Liquid from a Fluid_Source with a viscosity of its own is solved with that"
    )
}
