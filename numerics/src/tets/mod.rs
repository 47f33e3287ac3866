//! Tets.

mod closed;
mod cross;
mod delaunay;
mod fault;
mod interior;
pub mod lattice;
mod order;
mod predicates;
mod quality;
mod repair;
mod shells;
mod solid;
mod winding;

pub use closed::Closed;
pub use delaunay::{Delaunay, NONE, delaunay};
pub use fault::Fault;
pub use repair::{Changes, Surface};
pub use solid::{Fill, Measured, SLIVER, Side, Solid};

#[cfg(test)]
mod tests;
pub fn quality_of(c: &[[f64; 3]; 4]) -> f64 { quality::measure(c).quality }
