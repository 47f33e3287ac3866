//! Guarantees of loading a graph from arbitrary bytes.

use std::path::Path;

use engine::graph::fault::code;
use engine::graph::{Body, Catalogue, Fault, Graph};

/// The longest fact or hint, in characters: messages stay readable for any file.
const LONGEST: usize = 2_000;

/// Loads `bytes`, any number of lines `--set KEY=JSON` followed by a graph, as if all files that it names existed.
///
/// # Panics
/// If a fault cannot be shown to a user, or a loaded graph has params without values or outputs without components.
pub(crate) fn check(catalogue: Catalogue, bytes: &[u8]) {
    let (set, text) = settings(bytes);
    match Graph::load_bytes(text, Path::new("scene"), catalogue, &set, &|_| Ok(())) {
        Ok(graph) => check_graph(&graph),
        Err(faults) => {
            assert!(!faults.is_empty(), "a graph that does not load has faults");
            faults.iter().for_each(|fault| check_fault(fault, text, &set));
        }
    }
}

/// The keys and values of the leading lines `--set KEY=JSON`, and the bytes after them.
fn settings(mut bytes: &[u8]) -> (Vec<(String, String)>, &[u8]) {
    let mut set = Vec::new();
    while let Some(rest) = bytes.strip_prefix(b"--set ") {
        let end = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
        let setting = String::from_utf8_lossy(&rest[..end]);
        let (key, value) = setting.split_once('=').unwrap_or((&setting, ""));
        set.push((key.to_owned(), value.to_owned()));
        bytes = rest.get(end + 1..).unwrap_or_default();
    }
    (set, bytes)
}

fn check_graph(graph: &Graph) {
    let (first, last) = (graph.scene.first as f64, graph.scene.last as f64);
    for node in &graph.nodes {
        let Body::Node { specs, params, .. } = &node.body else { continue };
        for (spec, source) in specs.iter().zip(params.iter()) {
            for frame in [first, 0.5 * (first + last), last] {
                let _ = spec.refuses(&source.at(frame, graph.scene.clock()));
            }
        }
    }
    for output in &graph.outputs {
        let _ = graph.carries(output.from);
    }
}

fn check_fault(fault: &Fault, text: &[u8], set: &[(String, String)]) {
    assert!(code::ALL.contains(&fault.code), "{fault:?}");
    for sentence in std::iter::once(&fault.fact).chain(&fault.hint) {
        assert!(!sentence.contains(char::is_control), "control character in {sentence:?}");
        assert!(sentence.chars().count() <= LONGEST, "too long: {sentence:?}");
    }
    let value = fault.set.as_ref().and_then(|key| set.iter().rfind(|(set, _)| **set == **key));
    assert_eq!(fault.set.is_some(), value.is_some(), "{fault:?}");
    // If a key is set several times, a fault does not identify the value.
    let is_unique = fault.set.as_ref().is_none_or(|key| set.iter().filter(|(set, _)| **set == **key).count() == 1);
    let text = value.map_or(String::from_utf8_lossy(text), |(_, value)| value.into());
    assert!(!is_unique || holds(&text, fault.line, fault.column), "{fault:?}");
}

/// Whether a text has that position, its end included.
fn holds(text: &str, line: u32, column: u32) -> bool {
    let text = text.replace("\r\n", "\n").replace('\r', "\n");
    let found = text.split('\n').nth((line as usize).wrapping_sub(1));
    found.is_some_and(|line| (1..=line.chars().count() + 1).contains(&(column as usize)))
}
