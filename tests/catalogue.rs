//! Every node file is in its family's list, and nodes do not call each other.

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Node modules of a family: files and folders beside `lib.rs`, but for `shared`, which holds what no node is.
fn modules(family: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(family).unwrap().map(|entry| entry.unwrap().path());
    entries
        .filter(|path| path.is_dir() || path.extension().is_some_and(|e| e == "rs"))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .filter(|name| !["lib", "shared", "tests"].contains(&name.as_str()))
        .collect()
}

fn families() -> Vec<PathBuf> {
    let nodes = Path::new(env!("CARGO_MANIFEST_DIR")).join("nodes");
    let mut families: Vec<PathBuf> = fs::read_dir(nodes).unwrap().map(|entry| entry.unwrap().path()).collect();
    families.sort();
    families
}

fn sources(path: &Path) -> Vec<(PathBuf, String)> {
    if path.is_dir() {
        return fs::read_dir(path).unwrap().flat_map(|entry| sources(&entry.unwrap().path())).collect();
    }
    let rust = path.extension().is_some_and(|e| e == "rs");
    rust.then(|| (path.to_owned(), fs::read_to_string(path).unwrap())).into_iter().collect()
}

#[test]
fn every_node_file_is_in_its_familys_list() {
    for family in families() {
        let list = fs::read_to_string(family.join("lib.rs")).unwrap();
        for module in modules(&family) {
            let entry = format!("&{module}::NODE");
            assert!(list.contains(&entry), "{}: `{module}` is not in the list: add `{entry}`", family.display());
        }
    }
}

#[test]
fn every_family_is_in_the_catalogue() {
    let named: Vec<&str> = convect::CATALOGUE.names().collect();
    for family in families() {
        let count = modules(&family).len();
        let sources = sources(&family);
        let found =
            named.iter().filter(|name| sources.iter().any(|(_, text)| text.contains(&format!("\"{name}\"")))).count();
        assert!(found >= count, "{}: {found} of {count} nodes are in the catalogue", family.display());
    }
}

#[test]
fn nodes_do_not_call_each_other() {
    for family in families() {
        let modules = modules(&family);
        for (path, text) in sources(&family).into_iter().filter(|(path, _)| !path.ends_with("lib.rs")) {
            let inside = path.strip_prefix(&family).unwrap().components().next().unwrap();
            let own = Path::new(&inside).file_stem().unwrap().to_string_lossy().into_owned();
            for other in modules.iter().filter(|other| **other != own) {
                let calls = [format!("crate::{other}::"), format!("super::{other}::")];
                let called = calls.iter().find(|call| text.contains(*call));
                assert!(
                    called.is_none(),
                    "{} uses {}: what two nodes share lives in shared/ or numerics",
                    path.display(),
                    other
                );
            }
        }
    }
}

#[test]
fn names_are_unique_and_lead_to_their_file() {
    let mut seen = BTreeSet::new();
    for node in convect::CATALOGUE.nodes() {
        assert!(seen.insert(node.name), "{} is there twice", node.name);
        let module = node.name.to_ascii_lowercase();
        let found = families().iter().any(|family| modules(family).contains(&module));
        assert!(found, "{}: no file or folder `{module}` in any family", node.name);
    }
}

/// The node of docs/writing_nodes.md.
#[path = "../docs/examples/curve_helix.rs"]
mod curve_helix;

/// What `cargo xtask new-node` writes; xtask's tests see to it that these are its texts.
#[path = "new_nodes/curve_full.rs"]
mod curve_full;
#[path = "new_nodes/curve_plain.rs"]
mod curve_plain;

#[test]
fn the_guide_for_authors_shows_the_node_that_is_compiled() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let guide = fs::read_to_string(root.join("docs/writing_nodes.md")).unwrap();
    let node = fs::read_to_string(root.join("docs/examples/curve_helix.rs")).unwrap();
    let (production, _) = node.split_once("#[cfg(test)]").unwrap();
    assert!(
        guide.contains(production.trim_end()),
        "docs/writing_nodes.md quotes another node than docs/examples/curve_helix.rs"
    );
}
