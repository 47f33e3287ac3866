//! Stored messages: invalid graphs with all their faults as a user sees them, in `faults.txt`.
//!
//! A case is `=== name`, optional lines `--set KEY=JSON`, the graph, `---`, and the faults: code, then the message.
//! `BLESS=1 cargo test -p engine stored_messages` stores the current messages; read the difference before committing
//! it.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::super::fault::{FaultClass, code};
use super::{good, load_with};

const STORED: &str = include_str!("faults.txt");

pub(super) struct Case<'a> {
    pub(super) name: &'a str,
    pub(super) set: Vec<(&'a str, &'a str)>,
    pub(super) graph: &'a str,
    pub(super) expected: &'a str,
}

pub(super) fn cases() -> Vec<Case<'static>> {
    let cases = STORED.split("=== ").skip(1).map(|case| {
        let (name, rest) = case.split_once('\n').expect("a name and a line break");
        let (mut graph, expected) = rest.split_once("---\n").expect("a graph and its faults");
        let mut set = Vec::new();
        while let Some(line) = graph.strip_prefix("--set ") {
            let (line, rest) = line.split_once('\n').expect("a line break");
            set.push(line.split_once('=').expect("a key and a value"));
            graph = rest;
        }
        Case { name, set, graph: graph.strip_suffix('\n').unwrap_or(graph), expected: expected.trim_end() }
    });
    cases.collect()
}

impl Case<'_> {
    fn found(&self) -> String {
        let faults = load_with(self.graph, &self.set).err().unwrap_or_default();
        let lines: Vec<String> =
            faults.iter().map(|fault| format!("{}: {}", fault.code, fault.in_file("graph.json"))).collect();
        lines.join("\n")
    }
}

#[test]
fn stored_messages_are_those_of_invalid_graphs() {
    let mut blessed = STORED.split("=== ").next().unwrap_or_default().to_owned();
    let mut changed = Vec::new();
    for case in cases() {
        let found = case.found();
        if found != case.expected {
            changed.push(format!("{}\nstored:\n{}\nfound:\n{found}\n", case.name, case.expected));
        }
        let set: String = case.set.iter().map(|(key, value)| format!("--set {key}={value}\n")).collect();
        let graph = case.graph;
        let _ = write!(blessed, "=== {}\n{set}{graph}\n---\n{found}\n\n", case.name);
    }
    if std::env::var_os("BLESS").is_some() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/graph/tests/faults.txt");
        std::fs::write(path, blessed.trim_end().to_owned() + "\n").expect("the table can be written");
    }
    assert!(changed.is_empty(), "{}", changed.join("\n"));
}

#[test]
fn every_case_has_a_fault_and_every_kind_of_fault_has_a_case() {
    let mut seen = BTreeSet::new();
    for case in cases() {
        assert!(!case.expected.is_empty(), "{}", case.name);
        seen.extend(case.expected.lines().filter_map(|line| Some(line.split_once(": ")?.0)));
    }
    // Bytes that are not UTF-8 cannot be stored in a text file.
    let mut known: BTreeSet<&str> = code::ALL.iter().copied().collect();
    known.remove(code::ENCODING);
    assert_eq!(seen, known);
}

#[test]
fn messages_follow_the_style() {
    for case in cases() {
        for fault in load_with(case.graph, &case.set).err().unwrap_or_default() {
            for sentence in std::iter::once(&fault.fact).chain(&fault.hint) {
                let name = case.name;
                assert!(!sentence.ends_with(['.', '!', ' ']) && !sentence.is_empty(), "{name}: {sentence}");
                assert!(!sentence.starts_with(char::is_uppercase), "{name}: {sentence}");
                assert!(sentence.chars().count() < 200, "{name}: {sentence}");
            }
        }
    }
}

#[test]
fn only_unreadable_files_are_faults_of_class_file() {
    for case in cases() {
        for fault in load_with(case.graph, &case.set).err().unwrap_or_default() {
            let is_file = [code::FILE_MISSING, code::FILE_UNREADABLE].contains(&fault.code);
            assert_eq!(fault.class == FaultClass::File, is_file, "{}", case.name);
        }
    }
}

#[test]
fn faults_found_after_the_load_have_positions_too() {
    use super::super::{Fault, Part};
    let text = "{\"convect\": 1,\n\"nodes\": {\"fur\": {\"type\": \"Curve_In\",\n  \"params\": {\"file\": \"a.obj\"}}},\n\"outputs\": {\"fur\": \"fur\"}}";
    let graph = good(text);
    let at = |graph: &super::Graph, part| {
        let Fault { line, column, path, .. } = graph.fault_at(part, code::FILE_UNREADABLE, FaultClass::File, "");
        (line, column, path)
    };
    assert_eq!(at(&graph, Part::Param("fur", "file")), (3, 22, "nodes.fur.params.file".into()));
    assert_eq!(
        at(&graph, Part::Param("fur", "scale")),
        (2, 11, "nodes.fur.params.scale".into()),
        "not set: position of the node"
    );
    assert_eq!(at(&graph, Part::Node("fur")), (2, 11, "nodes.fur".into()));
    assert_eq!(at(&graph, Part::Output("fur")), (4, 13, "outputs.fur".into()));
    assert_eq!(at(&graph, Part::Node("other")), (0, 0, "nodes.other".into()));

    let graph = load_with(text, &[("fur.file", "\"b.obj\"")]).expect("a graph without faults");
    let fault = graph.fault_at(Part::Param("fur", "file"), code::FILE_UNREADABLE, FaultClass::File, "not an obj");
    assert_eq!(fault.in_file("graph.json"), "--set fur.file:1:1: nodes.fur.params.file: not an obj");
}
