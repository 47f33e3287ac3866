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

pub mod allocator;
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
pub mod unread;
pub mod usd_file;

use engine::graph::Catalogue;
use engine::node::Node;

/// All nodes: the families' lists, joined.
pub static CATALOGUE: Catalogue = Catalogue(FAMILIES);

/// The families that the program can be built without: their feature, whether it is on, and their nodes, which messages name
/// where it is off.
pub const OPTIONAL: [(&str, bool, &[&str]); 3] = [
    ("fluid", cfg!(feature = "fluid"), &["FluidSolve", "Fluid_Sink", "Fluid_Source", "Fluid_Surface", "Surface_Tag"]),
    ("softbody", cfg!(feature = "softbody"), &["Softbody", "Softbody_Goal", "Softbody_Pin", "Tetrahedralize"]),
    (
        "wind",
        cfg!(feature = "wind"),
        &[
            "Curve_Jiggle",
            "Curve_Wind",
            "Curve_Wind_Collision",
            "Curve_Wind_Gusts",
            "Curve_Wind_Shielding",
            "Gust_Control",
        ],
    ),
];

/// What to do about a node type that is not in the catalogue because its family was left out; `None` for any other.
pub fn left_out(node_type: &str) -> Option<String> {
    let (feature, ..) = OPTIONAL.iter().find(|(_, is_on, nodes)| !is_on && nodes.contains(&node_type))?;
    Some(format!("this convect was built without the feature `{feature}`; build it with `--features {feature}`"))
}

static FAMILIES: &[&[&Node]] = &[
    #[cfg(feature = "fluid")]
    fluid::NODES,
    geometry::NODES,
    #[cfg(feature = "softbody")]
    softbody::NODES,
    #[cfg(feature = "wind")]
    wind::NODES,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn optional_families_list_their_nodes() {
        let lists: &[(&str, &[&Node])] = &[
            #[cfg(feature = "fluid")]
            ("fluid", fluid::NODES),
            #[cfg(feature = "softbody")]
            ("softbody", softbody::NODES),
            #[cfg(feature = "wind")]
            ("wind", wind::NODES),
        ];
        for (family, nodes) in lists.iter().copied() {
            let (_, is_on, names) = OPTIONAL.iter().find(|(feature, ..)| *feature == family).unwrap();
            let mut own: Vec<&str> = nodes.iter().map(|node| node.name).collect();
            own.sort_unstable();
            assert!(*is_on && own == *names, "{family}: {own:?}");
            assert_eq!(left_out(own[0]), None, "what is there was not left out");
        }
        assert_eq!(left_out("Curve_Wnd"), None);
    }
}
