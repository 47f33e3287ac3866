//! For tests of nodes: a bench to try one node on, and the conformance suite that every node passes.

mod bench;
mod keys;

pub use bench::{Bench, Tasted, bench, cook_all};
pub use keys::keys;
