//! For tests of nodes: a bench to try one node on, and the conformance suite that every node passes.

mod bench;
mod conform;
mod keys;
mod quiet;
mod samples;
mod settings;

pub use bench::{Bench, Tasted, bench, cook_all};
pub use conform::{Conformance, conformance, conforms, faults};
pub use keys::keys;
pub use quiet::quietly;
