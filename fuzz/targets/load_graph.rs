//! Arbitrary bytes as a graph file with some `--set`: loading never panics, and gives a graph whose params have values,
//! or faults with positions.

#![no_main]

// The catalogue of the engine's tests calls the engine `crate`.
use engine::{Error, Result, choice, files, geometry, graph, inputs, node, param, params};
use libfuzzer_sys::fuzz_target;

#[path = "../../engine/src/graph/tests/catalogue.rs"]
mod catalogue;
#[path = "graph.rs"]
mod loading;

fuzz_target!(|bytes: &[u8]| loading::check(catalogue::CATALOGUE, bytes));
