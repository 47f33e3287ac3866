//! No two public types of the workspace share a name, so that a name means one thing everywhere.

use std::collections::BTreeMap;

use super::tokens::{Token, tokens};
use super::{root, sources};

/// Folders with the sources of the workspace's libraries and programs; their `tests` are ignored.
const FOLDERS: [&str; 8] =
    ["conformance/src", "engine/src", "formats/src", "kernels", "nodes", "numerics/src", "preview/src", "src"];

/// The public types that a source declares.
fn declared(source: &str) -> Vec<String> {
    let is_kind = |token: &Token| ["struct", "enum", "trait", "type", "union"].iter().any(|kind| token.is(kind));
    let tokens = tokens(source);
    let found = tokens.windows(3).filter(|three| three[0].is("pub") && is_kind(&three[1]));
    found.filter_map(|three| three[2].word().map(str::to_owned)).collect()
}

#[test]
fn no_two_public_types_share_a_name() {
    let mut places: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (file, source) in FOLDERS.iter().flat_map(|folder| sources(&root().join(folder))) {
        let file = file.strip_prefix(root()).unwrap().display().to_string();
        let is_test = file.split('/').any(|part| ["tests", "tests.rs", "examples", "benches"].contains(&part));
        for name in declared(&source).into_iter().filter(|_| !is_test) {
            places.entry(name).or_default().push(file.clone());
        }
    }
    assert!(places.len() > 100, "the sources were not found");
    let doubled: Vec<String> = places
        .iter()
        .filter(|(_, files)| files.len() > 1)
        .map(|(name, files)| format!("`{name}`: {}", files.join(", ")))
        .collect();
    assert!(doubled.is_empty(), "public types that share a name:\n  {}", doubled.join("\n  "));
}

#[test]
fn only_public_types_are_found() {
    let source =
        "pub struct A; pub(crate) struct B; enum C {} pub enum D {} pub trait E { type F; } pub type G<T> = Vec<T>;
        // pub struct H;
        pub unsafe trait I {} pub fn j() {}";
    assert_eq!(declared(source), ["A", "D", "E", "G"]);
}
