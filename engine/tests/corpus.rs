//! Replays the corpora of the fuzz targets, as a regression test.

#![allow(clippy::unwrap_used, reason = "a missing value fails the test")]

use std::path::Path;

// The catalogue of the unit tests calls the engine `crate`.
use engine::{Error, Result, choice, files, geometry, graph, inputs, node, param, params};

#[path = "../src/graph/tests/catalogue.rs"]
mod catalogue;
#[path = "../../fuzz/targets/language.rs"]
mod language;
#[path = "../../fuzz/targets/graph.rs"]
mod loading;

/// Name and bytes of every file of a target's corpus.
fn corpus(target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(target);
    let mut files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|file| file.unwrap().path()).collect();
    files.sort();
    assert!(!files.is_empty(), "{} has no file", folder.display());
    let named = files.iter().map(|file| {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        (name, std::fs::read(file).unwrap())
    });
    named.collect()
}

#[test]
fn every_graph_of_the_corpus_loads_or_is_refused() {
    for (_, bytes) in corpus("load_graph") {
        loading::check(catalogue::CATALOGUE, &bytes);
    }
}

#[test]
fn every_text_of_the_corpus_has_a_value_or_faults() {
    for (name, bytes) in corpus("expression") {
        language::check(std::str::from_utf8(&bytes).unwrap_or_else(|error| panic!("{name}: {error}")));
    }
}
