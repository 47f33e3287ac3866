//! Tets.

mod delaunay;
pub mod lattice;
mod order;
mod predicates;

pub use delaunay::{Delaunay, NONE, delaunay};

#[cfg(test)]
mod tests;
