//! For tests of nodes: a bench to try one node on, and the conformance suite that every node passes.

mod bench;

pub use bench::{Bench, Tasted, bench, cook_all};
