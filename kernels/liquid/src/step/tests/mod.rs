//! The laws that a liquid keeps, on small grids; `examples/dam_break.rs` has them on larger ones.

mod dam;
mod force;
mod materials;
mod periodic;
mod plain;
mod pushed;
mod rest;
mod runs;
mod sources;
mod spin;
mod viscous;

use super::*;
use crate::level_set::PhiView;
use crate::velocity::Site;
use numerics::vector::Vec3;
use plain::PlainLevelSet;

const WEIGHTLESS: Surroundings<'_> = Surroundings::new(&|_| [0.0; 3], &|_| 0.0);
const FALLING: Surroundings<'_> = Surroundings::new(&|_| [0.0, -9.81, 0.0], &|_| 0.0);

/// The distance from a box.
fn block(low: Vec3, high: Vec3) -> impl Fn(Vec3) -> f32 {
    move |p| (0..3).map(|axis| (low[axis] - p[axis]).max(p[axis] - high[axis])).fold(f32::NEG_INFINITY, f32::max)
}

/// Mass, ÷ density · cell³, by cells cut straight.
fn volume(view: &PhiView<'_>, domain: &Domain) -> f64 {
    let share =
        |(at, cell): (usize, [i32; 3])| if domain.contains(cell) { (0.5 - view.phi[at]).clamp(0.0, 1.0) } else { 0.0 };
    view.rows.iter().enumerate().map(|cell| f64::from(share(cell))).sum()
}

/// The largest speed on a face, m/s.
fn largest<S: Surface>(liquid: &Liquid<S>) -> f64 {
    liquid.motion().largest_speed()
}
