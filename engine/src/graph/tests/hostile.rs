//! Hostile texts: none may cause a panic, a stack overflow or a long run.

use std::path::Path;

use proptest::prelude::*;

use super::super::Graph;
use super::super::fault::code;
use super::{CATALOGUE, load, probe};

/// A graph with every construct, from which mutations start.
pub(super) const WHOLE: &str = r#"{ // every form
  "convect": 1, "$schema": "graph.schema.json",
  "scene": { "frames": [1, 48], "fps": 24, "seed": 7, "origin": [1e6, 0, 0] },
  "controls": { "dir": [1, 0, 0], "up": {"keyframes": [[1, 0], [24, 1]], "interpolation": "smooth"}, "word": "perlin", },
  "nodes": {
    "fur": { "type": "Curve_In", "params": { "file": "assets/fur.####.obj", "scale": 0.01 } },
    "inline": { "type": "Curve_In", "params": { "points": [[0, 0, 0], [0, 1, 0]], "counts": [2],
                "attributes": { "width": [0.1, 0.2], "tag": [1, 2], "Cd": [[1, 0, 0.5], [0, 1, 0]] } } },
    "skin": { "type": "Mesh_In", "params": { "file": "bear.obj" } },
    "both": { "type": "Merge", "inputs": { "geometry": ["fur", "inline.curves"] } },
    "wind": { "type": "Curve_Wind", "inputs": { "curves": "both" },
              "params": { "wind_dir": { "control": "dir" }, "noise": { "control": "word" }, "amplitude": { "expr": "up*2 + dir.x" },
                          "global_rotate": { "value": { "expr": "0.6 + 0.1*sin(2*pi*time)" }, "attribute": "mask" },
                          "ramp_rotate": { "ramp": [[0, 0.2], [1, 1]], "interpolation": "smooth" },
                          "blend": 0.5, "seed": 3, "frequency": { "keyframes": [[1, 1], [9.5, 2]] } } },
    "free": { "type": "Curve_Wind_Collision", "inputs": { "curves": "wind", "rest": "both", "colliders": ["skin"] } },
    "all": { "type": "Every_Shape", "params": { "vec3": { "expr": ["0", "time", "\u00e9" ] }, "rotate": [0, 90, 0],
             "span": [0.1, 0.2], "int3": [1, 2, 3], "bool": true, "text": "é\n", "texts": ["a", "b"], "tets": [[0, 1, 2, 3]] } }
  },
  "outputs": { "fur": "free", "lit": { "from": "free.curves", "attributes": ["P", "shielded"], "v": true } }
}"#;

#[test]
fn a_file_of_a_single_token_is_refused() {
    for text in
        ["[", "{", "]", "}", "\"", "/*", "//", "-", ",", ":", "\\", "\u{0}", "null", "{}", "[]", "1e999", "\u{feff}"]
    {
        assert!(load(text).is_err(), "{text:?}");
    }
}

#[test]
fn nesting_100_000_deep_is_one_fault() {
    for (open, close) in [("[", "]"), ("{\"a\":", "}"), ("{\"convect\":1,\"nodes\":{\"a\":{\"params\":", "")] {
        let faults = load(&(open.repeat(100_000) + &close.repeat(100_000))).err().unwrap_or_default();
        assert_eq!(faults.iter().map(|fault| fault.code).collect::<Vec<_>>(), [code::NESTING]);
    }
}

#[test]
fn every_truncation_of_a_graph_is_refused() {
    for (end, _) in WHOLE.char_indices() {
        assert!(load(&WHOLE[..end]).is_err(), "{end}");
    }
}

#[test]
fn a_graph_of_ten_thousand_nodes_loads() {
    let mut text = String::from(r#"{"convect": 1, "outputs": {"end": "n9999"}, "nodes": {"n0": {"type": "Curve_In"}"#);
    for n in 1..10_000 {
        text += &format!(r#", "n{n}": {{"type": "Curve_Wind", "inputs": {{"curves": "n{}"}}}}"#, n - 1);
    }
    assert_eq!(super::good(&(text + "}}")).nodes.len(), 10_000);
}

#[test]
fn thousands_of_faults_among_thousands_of_names_are_reported() {
    let mut text = String::from(r#"{"convect": 1, "outputs": {"end": "n1"}, "controls": {"end": 1"#);
    (0..2_000).for_each(|n| text += &format!(r#", "c{n}": 1"#));
    text += r#"}, "nodes": {"n": {"type": "Curve_In"}"#;
    for n in 0..2_000 {
        let params = format!(r#"{{"float": {{"expr": "control_{n}"}}, "double": {{"control": "control_{n}"}}}}"#);
        text += &format!(r#", "n{n}": {{"type": "Every_Shape", "params": {params}}}"#);
    }
    assert_eq!(load(&(text + "}}")).err().unwrap_or_default().len(), 4_000);
}

#[test]
fn nodes_of_one_type_share_the_source_read_from_a_control() {
    use crate::graph::Body;
    use crate::param::{Source, Value};
    let mut text =
        String::from(r#"{"convect": 1, "outputs": {"end": "n1"}, "controls": {"list": [[0, 0, 0]]}, "nodes": {"#);
    let nodes: Vec<String> = (0..3)
        .map(|n| format!(r#""n{n}": {{"type": "Every_Shape", "params": {{"offsets": {{"control": "list"}}}}}}"#))
        .collect();
    text += &(nodes.join(", ") + "}}");
    let graph = load(&text).unwrap_or_else(|faults| panic!("{faults:#?}"));
    let lists: Vec<_> = graph
        .nodes
        .iter()
        .filter_map(|node| match &node.body {
            Body::Node { params, .. } => params.iter().find_map(|source| match source {
                Source::Constant(Value::Vec3s(rows)) if !rows.is_empty() => Some(rows.clone()),
                _ => None,
            }),
            Body::Given { .. } => None,
        })
        .collect();
    assert_eq!(lists.len(), 3);
    assert!(lists.iter().all(|list| std::sync::Arc::ptr_eq(list, &lists[0])));

    let faults = load(&text.replace("[[0, 0, 0]]", "[1, 2]")).err().unwrap_or_default();
    let paths: Vec<&str> = faults.iter().map(|fault| &*fault.path).collect();
    let first = "nodes.n0.params.offsets[0]";
    assert_eq!(paths, [first, "nodes.n1.params.offsets", "nodes.n2.params.offsets"], "each node reports it");
}

#[test]
fn messages_contain_no_control_characters() {
    let broken = [
        ("{\"convect\": 1, \"outputs\"\u{1b}[2J: {}}", "a key"),
        (r#"{"convect": 1, "nodes": {"\u001b[2J": {"type": "Curve_In"}}, "outputs": {"a": "b"}}"#, "a suggested node"),
        (
            r#"{"convect": 1, "controls": {"\u001b": "x"}, "outputs": {"a": "a"}, "nodes": {"a": {"type": "Every_Shape",
            "params": {"float": {"control": "\u001b"}, "double": {"expr": "x"}}}}}"#,
            "a control",
        ),
        (
            "{\"convect\": 1, \"outputs\": {\"a\": \"a\"}, \"nodes\": {\"a\": {\"type\": \"Every_Shape\",
            \"params\": {\"falloff\": [[0, /*\u{1b}[2J*/ 1]]}}}}",
            "a ramp",
        ),
    ];
    for (text, what) in broken {
        let faults = load(text).err().unwrap_or_default();
        let has_control_character = |fault: &crate::graph::Fault| fault.to_string().contains(char::is_control);
        assert!(!faults.is_empty() && !faults.iter().any(has_control_character), "{what}: {faults:?}");
    }
    let faults = super::load_with(WHOLE, &[("\u{1b}[2J", ""), ("\u{1b}[2J", "word")]).err().unwrap_or_default();
    assert!(!faults.iter().any(|fault| fault.to_string().contains(char::is_control)), "{faults:?}");
}

#[test]
fn a_cycle_of_thousands_of_nodes_is_shortened() {
    let nodes = (0..5_000).map(|n| {
        let next = (n + 1) % 5_000;
        format!(r#""n{n}": {{"type": "Curve_Wind", "inputs": {{"curves": "n{next}"}}}}"#)
    });
    let nodes = nodes.collect::<Vec<_>>().join(", ");
    let text = format!(r#"{{"convect": 1, "outputs": {{"end": "n0"}}, "nodes": {{{nodes}}}}}"#);
    let faults = load(&text).err().unwrap_or_default();
    let shortened =
        "the wires form a cycle: n0 → n4999 → n4998 → n4997 → n4996 → n4995 → … → n5 → n4 → n3 → n2 → n1 → n0";
    assert_eq!(faults.iter().map(|fault| &*fault.fact).collect::<Vec<_>>(), [shortened]);
}

#[test]
fn bytes_that_are_not_utf_8_are_refused() {
    for bytes in [&b"\xff\xfe{\0}\0"[..], b"{\"a\": \"\xc3\x28\"}", b"\x1f\x8b\x08\x00", b"\0\0\0\0"] {
        let faults = Graph::load_bytes(bytes, Path::new(""), CATALOGUE, &[], &probe).err().unwrap_or_default();
        assert_eq!(faults.iter().map(|fault| fault.code).collect::<Vec<_>>(), [code::ENCODING], "{bytes:?}");
    }
    let with_mark = [b"\xef\xbb\xbf", WHOLE.replace("\\u00e9", "1").as_bytes()].concat();
    assert!(Graph::load_bytes(&with_mark, Path::new(""), CATALOGUE, &[], &probe).is_ok());
}

proptest! {
    #[test]
    fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let _ = Graph::load_bytes(&bytes, Path::new(""), CATALOGUE, &[], &probe);
    }

    #[test]
    fn arbitrary_json_like_texts_never_panic(text in r#"[\[\]{}:,"\\ \n/*a-z0-9.eE+-]{0,80}"#, key in "[a-z.]{0,6}") {
        let _ = load(&text);
        let set = [(key, text.clone()), ("wind.amplitude".into(), text)];
        let _ = Graph::load(WHOLE, Path::new(""), CATALOGUE, &set, &probe);
    }

    #[test]
    fn arbitrary_changes_of_a_graph_never_panic(changes in proptest::collection::vec((0..WHOLE.len(), 0..40_usize, any::<u8>()), 1..4)) {
        // The replacement is a piece of the graph itself or an arbitrary byte.
        let mut bytes = WHOLE.as_bytes().to_vec();
        for (at, length, byte) in changes {
            let at = at.min(bytes.len());
            let end = (at + length % 8).min(bytes.len());
            let from = usize::from(byte) * WHOLE.len() / 256;
            let piece = &WHOLE.as_bytes()[from..(from + length).min(WHOLE.len())];
            bytes.splice(at..end, if length % 2 == 0 { piece.to_vec() } else { vec![byte] });
        }
        if let Ok(text) = std::str::from_utf8(&bytes) {
            let _ = load(text);
        }
    }
}
