//! How accurately each law of liquids is met, with its limit: one table, printed, checked, and compared with
//! docs/liquid.md.
//!
//! Laws are closed forms or published measurements; the solver steps as FluidSolve does, with its surface of markers.

mod creep;
mod flows;
mod moving;
mod spread;
mod stokes;

use liquid::marked::MarkedSurface;
use liquid::step::{Domain, Liquid, LiquidReport, LiquidSettings, Surroundings, Wall};
use numerics::vector::Vec3;

use crate::accuracy_table::{Effort, Figure};

#[test]
fn liquids_meet_their_laws_and_the_docs_show_the_table() {
    crate::accuracy_table::check(&figures(Effort::Coarse), "docs/liquid.md", include_str!("../../../docs/liquid.md"));
}

/// The rows of the table, in the order of the docs.
pub(crate) fn figures(effort: Effort) -> Vec<Figure> {
    [creep::figures(), stokes::figures(effort), moving::figures(effort), spread::figures(effort)]
        .into_iter()
        .flatten()
        .collect()
}

const GRAVITY: f64 = 9.81;
const FRAME: f64 = 1.0 / 24.0;

const REPEATS: [Wall; 2] = [Wall::Periodic; 2];
const SHUT: [Wall; 2] = [Wall::Closed; 2];
const SMOOTH: [Wall; 2] = [Wall::FreeSlip; 2];
const OPEN: [Wall; 2] = [Wall::Open; 2];

fn domain(high: [i32; 3], walls: [[Wall; 2]; 3]) -> Domain {
    Domain { walls, ..Domain::closed([0; 3], high) }
}

/// A liquid at rest, from a distance at places in cells.
fn at_rest(settings: LiquidSettings, distance: impl Fn(Vec3) -> f32 + Sync) -> Liquid<MarkedSurface> {
    let surface = MarkedSurface::new(settings.domain, 1, distance, 0, 1);
    Liquid::new(settings, surface)
}

/// Steps through `frames` frames; the report of the last.
fn frames(liquid: &mut Liquid<MarkedSurface>, around: &Surroundings<'_>, count: u32, seconds: f64) -> LiquidReport {
    (0..count).map(|_| liquid.step_frame(around, seconds)).last().unwrap_or_default()
}

/// The velocity of the low face of a cell along an axis, m/s; 0 where there is none.
fn face(liquid: &Liquid<MarkedSurface>, axis: usize, cell: [i32; 3]) -> f64 {
    let motion = liquid.motion();
    motion.rows().find(cell).map_or(0.0, |at| f64::from(motion.velocity().faces()[axis][at]))
}

/// The largest distance of `found` from `exact`, ÷ the largest of `exact`.
fn error(found: &[f64], exact: &[f64]) -> f64 {
    let largest = exact.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    found.iter().zip(exact).fold(0.0_f64, |most, (found, exact)| most.max((found - exact).abs())) / largest
}

/// The distance from a box.
fn block(low: Vec3, high: Vec3) -> impl Fn(Vec3) -> f32 {
    move |p| (0..3).map(|axis| (low[axis] - p[axis]).max(p[axis] - high[axis])).fold(f32::NEG_INFINITY, f32::max)
}
