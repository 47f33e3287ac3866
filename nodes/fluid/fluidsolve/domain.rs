//! The box of the liquid: its cells, its walls, and what is refused of it.

use engine::prelude::*;
use liquid::rows::Cell;
use liquid::step::{Domain, LiquidSettings, Wall};

use super::{
    CELL, CFL, DENSITY, DOMAIN_FROM, DOMAIN_TO, FLIP, FOLLOW, MAX_SUBSTEPS, METHOD, Method, PARTICLES_PER_CELL,
    RESOLUTION, SLIP, STOKES, SURFACE_TENSION, TOLERANCE, WALL_X_MAX, WALL_X_MIN, WALL_Y_MAX, WALL_Y_MIN, WALL_Z_MAX,
    WALL_Z_MIN,
};
use crate::shared::volume::Lattice;

choice! {
    /// A side of the box.
    pub(super) enum Walls {
        Open = "open": "liquid leaves, and is gone; beyond it is air, which comes in where liquid moves away",
        Closed = "closed": "liquid stays in; `slip` says how freely it slides along",
        FreeSlip = "free_slip": "liquid stays in and slides along without friction",
        Periodic = "periodic": "liquid that leaves comes in on the other side, which must be periodic too; shapes and colliders do not repeat",
    }
}

pub(super) const CLOSED: Walls = Walls::Closed;

/// Most cells along a side: beyond, single precision loses where in a cell a surface lies.
const MOST_CELLS: f64 = 1_048_576.0;

/// Share of a cell by which a side may miss a multiple of it and still be one.
const NEARLY: f64 = 1e-3;

/// Where the solver's cells lie.
pub(super) fn lattice(cx: &Cx) -> Lattice {
    Lattice { origin: cx.get(DOMAIN_FROM), cell: cx.get(CELL) }
}

/// The walls, by axis: at the lowest, at the highest coordinate.
fn walls(params: &Params) -> [[(&'static str, Walls); 2]; 3] {
    let wall = |param: Param<Walls>| (param.name(), params.get(param));
    [[wall(WALL_X_MIN), wall(WALL_X_MAX)], [wall(WALL_Y_MIN), wall(WALL_Y_MAX)], [wall(WALL_Z_MIN), wall(WALL_Z_MAX)]]
}

/// Cells along a side of that many.
fn whole(cells: f64) -> f64 {
    if (cells - cells.round()).abs() <= NEARLY { cells.round().max(1.0) } else { cells.ceil() }
}

/// Cells along each side of the box.
pub(super) fn cells(params: &Params) -> [f64; 3] {
    let (from, to, cell) = (params.get(DOMAIN_FROM), params.get(DOMAIN_TO), params.get(CELL));
    [0, 1, 2].map(|k| whole((to[k] - from[k]) / cell))
}

/// Refuses what is not available yet, and boxes that cannot be.
pub(super) fn checks(params: &Params) -> Result<()> {
    let not_yet = |name: &'static str, value: String| {
        let fact = format!("`{name}` is {value}, which is not available yet");
        Err(Error::refused(fact).hint("leave it at its default").of(name))
    };
    if params.get(METHOD) != Method::LevelSet {
        return not_yet(METHOD.name(), "\"particles\"".into());
    }
    for (param, default) in
        [(SURFACE_TENSION.name(), params.get(SURFACE_TENSION)), (FLIP.name(), params.get(FLIP).into())]
    {
        if default != 0.0 {
            return not_yet(param, default.to_string());
        }
    }
    if params.get(PARTICLES_PER_CELL) != 8 {
        return not_yet(PARTICLES_PER_CELL.name(), params.get(PARTICLES_PER_CELL).to_string());
    }
    if params.get(FOLLOW) {
        return Ok(());
    }
    for [(low, low_wall), (high, high_wall)] in walls(params) {
        if (low_wall == Walls::Periodic) != (high_wall == Walls::Periodic) {
            let (one, other) = if low_wall == Walls::Periodic { (low, high) } else { (high, low) };
            let fact =
                format!("`{one}` is \"periodic\" and `{other}` is not: liquid that leaves has nowhere to come in");
            let hint = format!("set `{other}` to \"periodic\" too, or `{one}` to another wall");
            return Err(Error::refused(fact).hint(hint).of(other));
        }
    }
    let (from, to) = (params.get(DOMAIN_FROM), params.get(DOMAIN_TO));
    if let Some(k) = (0..3).find(|k| to[*k] <= from[*k]) {
        let axis = ["x", "y", "z"][k];
        let fact = format!("`domain_to` is {} along {axis}, which is not above `domain_from`, {}", to[k], from[k]);
        return Err(Error::refused(fact).hint("make the box larger than 0 along every axis").of(DOMAIN_TO.name()));
    }
    let cells = cells(params);
    if let Some(most) = cells.iter().copied().reduce(f64::max).filter(|most| *most > MOST_CELLS) {
        let fact = format!("the box is {most:.3e} cells long, more than {MOST_CELLS:.0}");
        return Err(Error::refused(fact).hint("use larger cells, or a smaller box").of(CELL.name()));
    }
    Ok(())
}

/// The box in cells; the first is [0, 0, 0].
pub(super) fn domain(cx: &Cx) -> Domain {
    if cx.get(FOLLOW) {
        let half = (MOST_CELLS / 2.0) as i32;
        return Domain { low: [-half; 3], high: [half; 3], walls: [[Wall::Open; 2]; 3] };
    }
    let high: Cell = cells(cx.params()).map(|n| n as i32);
    let wall = |(_, wall): (&str, Walls)| match wall {
        Walls::Open => Wall::Open,
        Walls::FreeSlip => Wall::FreeSlip,
        Walls::Periodic => Wall::Periodic,
        Walls::Closed => Wall::Closed,
    };
    Domain { low: [0; 3], high, walls: walls(cx.params()).map(|sides| sides.map(wall)) }
}

/// What the solver does not change in a frame.
pub(super) fn settings(cx: &Cx) -> LiquidSettings {
    LiquidSettings {
        density: cx.get(DENSITY),
        coupling: cx.get(STOKES),
        slip: cx.get(SLIP),
        cfl: cx.get(CFL),
        max_substeps: cx.get(MAX_SUBSTEPS) as u32,
        tolerance: cx.get(TOLERANCE),
        ..LiquidSettings::new(domain(cx), cx.get(CELL))
    }
}

/// Surface cells along a side of a solver cell.
pub(super) fn resolution(cx: &Cx) -> u32 {
    cx.get(RESOLUTION) as u32
}
