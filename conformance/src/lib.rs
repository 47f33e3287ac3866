//! What every node is held to, derived from its declaration alone, and a bench to try one node on.

mod bench;
mod panics;
mod promises;
mod samples;
mod suite;
#[cfg(test)]
mod tests;
mod trial;
mod values;

pub use bench::{Bench, BenchResult, bench, cook_all};
pub use panics::quietly;
pub use suite::{Conformance, conformance, conforms, faults};
