//! Properties of the sources as a whole: where nodes are listed, what they may use, README's table of nodes, and that
//! no two public types share a name.

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

mod nodes;
mod paths;
mod readme;
mod tokens;
mod type_names;
mod vectors;

use std::fs;
use std::path::{Path, PathBuf};

use tokens::{Token, tokens};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All Rust files under a folder, or the file itself, in order.
fn sources(path: &Path) -> Vec<(PathBuf, String)> {
    if path.is_dir() {
        let mut entries: Vec<PathBuf> = fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()).collect();
        entries.sort();
        return entries.iter().flat_map(|entry| sources(entry)).collect();
    }
    let rust = path.extension().is_some_and(|extension| extension == "rs");
    rust.then(|| (path.to_owned(), fs::read_to_string(path).unwrap())).into_iter().collect()
}

/// The node of docs/writing_nodes.md.
#[path = "../../docs/examples/curve_helix.rs"]
mod curve_helix;

/// Nodes written by `cargo xtask new-node`; xtask's tests check that these are its texts.
#[path = "../new_nodes/curve_free.rs"]
mod curve_free;
#[path = "../new_nodes/curve_full.rs"]
mod curve_full;
#[path = "../new_nodes/curve_plain.rs"]
mod curve_plain;

#[test]
fn the_guide_for_authors_shows_the_node_that_is_compiled() {
    let guide = fs::read_to_string(root().join("docs/writing_nodes.md")).unwrap();
    let node = fs::read_to_string(root().join("docs/examples/curve_helix.rs")).unwrap();
    let (production, _) = node.split_once("#[cfg(test)]").unwrap();
    assert!(
        guide.contains(production.trim_end()),
        "the node in docs/writing_nodes.md differs from docs/examples/curve_helix.rs"
    );
}

/// Nodes and kernels compute the same wherever they run.
#[test]
fn no_result_depends_on_the_environment() {
    let is_part = |name: &str| name == "tests" || name == "tests.rs" || name == "examples";
    let is_other = |file: &Path| file.components().any(|part| part.as_os_str().to_str().is_some_and(is_part));
    for folder in ["kernels", "nodes"] {
        for (file, source) in sources(&root().join(folder)).into_iter().filter(|(file, _)| !is_other(file)) {
            let reads = |tokens: &[Token]| tokens[0].is("env") && tokens[1] == Token::Colons;
            assert!(!tokens(&source).windows(2).any(reads), "{} reads the environment", file.display());
        }
    }
}
