//! convect: evaluates node graphs that make geometry move, and writes geometry that any other program opens.
//!
//! This crate is the program: the catalogue of all nodes, and one file per subcommand. The engine does not depend on
//! nodes, and nodes do not write files; files are written here and in `formats`.

/// Writes a line to stderr; a closed stderr is ignored.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}

pub mod args;
pub mod check;
pub mod completions;
pub mod convert;
pub mod cook;
pub mod diff;
pub mod explain;
pub mod failure;
pub mod functions;
pub mod geometry_file;
pub mod job;
pub mod load;
pub mod memory;
pub mod merge;
pub mod nodes;
pub mod numbers;
pub mod output;
pub mod pictures;
pub mod progress;
pub mod report;
pub mod schema;
pub mod stats;
pub mod study;
pub mod targets;
pub mod usd_file;

use engine::graph::Catalogue;
use engine::node::Node;

/// All nodes: the families' lists, joined.
pub static CATALOGUE: Catalogue = Catalogue(FAMILIES);

static FAMILIES: &[&[&Node]] = &[
    #[cfg(feature = "fluid")]
    fluid::NODES,
    geometry::NODES,
    #[cfg(feature = "softbody")]
    softbody::NODES,
    #[cfg(feature = "wind")]
    wind::NODES,
];
