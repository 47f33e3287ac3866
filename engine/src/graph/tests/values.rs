//! Valid graphs: order of nodes, wires, and the sources of params.

use std::io::ErrorKind;

use super::super::{Body, Graph, Link, Part, Scene, probe};
use super::{good, load_with};
use crate::geometry::Column;
use crate::param::{Source, Value, euler_to_turn};

/// A graph of one `Every_Shape` node with these params and controls.
fn shapes(controls: &str, params: &str) -> Graph {
    good(&format!(
        r#"{{"convect": 1, "scene": {{"frames": [10, 20], "seed": 7}}, "controls": {{{controls}}},
            "nodes": {{"all": {{"type": "Every_Shape", "params": {{{params}}}}}}}, "outputs": {{"a": "all"}}}}"#
    ))
}

fn source<'g>(graph: &'g Graph, id: &str, param: &str) -> &'g Source {
    let node = graph.nodes.iter().find(|node| &*node.id == id).expect("the node is there");
    let Body::Node { specs, params, .. } = &node.body else { panic!("not a node of the catalogue") };
    &params[specs.iter().position(|spec| spec.name == param).expect("the param is declared")]
}

/// The constant value of a param.
fn constant(graph: &Graph, param: &str) -> Value {
    match source(graph, "all", param) {
        Source::Constant(value) => value.clone(),
        other => panic!("{param} is {other:?}"),
    }
}

/// The param's value at a frame.
fn at(graph: &Graph, param: &str, frame: f64) -> Value {
    source(graph, "all", param).at(frame, graph.scene.clock())
}

#[test]
fn a_minimal_graph_has_the_documented_defaults() {
    let graph = good(r#"{"convect": 1, "nodes": {"a": {"type": "Mesh_In"}}, "outputs": {"a": "a"}}"#);
    assert_eq!(graph.scene, Scene { first: 1, last: 1, fps: 24.0, seed: 0, origin: [0.0; 3] });
    assert!(matches!(source(&graph, "a", "frame"), Source::CurrentFrame));
    assert!(matches!(source(&graph, "a", "file"), Source::Constant(Value::File(None))));
}

#[test]
fn nodes_are_sorted_after_their_sources_and_links_are_renumbered() {
    let graph = good(
        r#"{"convect": 1, "outputs": {"o": {"from": "soft.tets", "attributes": ["P"], "v": true}}, "nodes": {
            "soft": {"type": "Softbody", "inputs": {"bodies": ["b", "a.mesh"]}},
            "b": {"type": "Mesh_In"}, "a": {"type": "Mesh_In"}}}"#,
    );
    let ids: Vec<&str> = graph.nodes.iter().map(|node| &*node.id).collect();
    assert_eq!(ids, ["b", "a", "soft"]);
    assert_eq!(graph.nodes[2].inputs(), [[Link { node: 0, port: 0 }, Link { node: 1, port: 0 }]]);
    let output = &graph.outputs[0];
    assert_eq!((output.from, output.v), (Link { node: 2, port: 1 }, true));
    assert_eq!(output.attributes.as_deref(), Some(&["P".into()][..]));
}

#[test]
fn outputs_of_a_list_share_a_file() {
    let graph = good(
        r#"{"convect": 1, "outputs": {"one": "b", "set": ["b", {"from": "soft.tets", "attributes": ["P"], "v": true}]}, "nodes": {
            "soft": {"type": "Softbody", "inputs": {"bodies": ["b"]}}, "b": {"type": "Mesh_In"}}}"#,
    );
    let names: Vec<(&str, Option<&str>)> = graph.outputs.iter().map(|output| (output.file(), output.prim())).collect();
    assert_eq!(names, [("one", None), ("set", Some("b")), ("set", Some("soft.tets"))]);
    assert_eq!((&graph.outputs[1].from, graph.outputs[2].v), (&graph.outputs[0].from, true));
    let place = graph.place("graph.json", Part::Output("set/b"));
    assert_eq!(place, "graph.json:1:40", "that of the list");
}

#[test]
fn a_list_input_takes_a_single_wire_without_the_list() {
    let graph = good(
        r#"{"convect": 1, "nodes": {"a": {"type": "Mesh_In"}, "m": {"type": "Merge", "inputs": {"geometry": "a"}}},
            "outputs": {"o": "m"}}"#,
    );
    assert_eq!(graph.nodes[1].inputs(), [[Link { node: 0, port: 0 }]]);
}

#[test]
fn literals_of_every_shape_are_read() {
    let graph = shapes(
        "",
        r#""float": -2.5e-1, "int": 3.0, "bool": false, "vec2": [1, 2], "vec3": [1, 2, 3], "int3": [1, 2, 3e0],
           "span": [0.5, 0.5], "rotate": [0, 90, 0], "choice": "wavelet", "falloff": {"ramp": [[0, 1], [0.5, 0]]},
           "text": "a\n", "texts": ["P", "v"], "offsets": [[0, 0, 0.5]], "tets": [[0, 1, 2, 3]], "masked": 2,
           "columns": {"mask": [1, 0.5], "id2": [1, 2], "width": [1], "Cd": [[1, 0, 0]], "q": [[0, 0, 0, 1.0]]}"#,
    );
    for (param, expected) in [
        ("float", Value::Float(-0.25)),
        ("int", Value::Int(3)),
        ("bool", Value::Bool(false)),
        ("vec2", Value::Vec2([1.0, 2.0])),
        ("vec3", Value::Vec3([1.0, 2.0, 3.0])),
        ("int3", Value::Int3([1, 2, 3])),
        ("span", Value::Span([0.5, 0.5])),
        ("rotate", euler_to_turn([0.0, 90.0, 0.0])),
        ("choice", Value::Choice(2)),
        ("text", Value::Text("a\n".into())),
        ("masked", Value::Masked(2.0, None)),
    ] {
        assert_eq!(constant(&graph, param), expected, "{param}");
    }
    let Value::Columns(columns) = constant(&graph, "columns") else { panic!() };
    assert_eq!(columns[0], ("mask".into(), Column::new(vec![1.0_f32, 0.5])));
    assert_eq!(columns[1], ("id2".into(), Column::new(vec![1, 2])), "numbers without a point are integers");
    assert_eq!(columns[2], ("width".into(), Column::new(vec![1.0_f32])), "a well-known name has its type");
    assert_eq!(columns[3], ("Cd".into(), Column::new(vec![[1, 0, 0]])));
    assert_eq!(columns[4], ("q".into(), Column::new(vec![[0.0_f32, 0.0, 0.0, 1.0]])));
}

#[test]
fn keyframes_of_every_kind_of_value_are_read() {
    let graph = shapes(
        "",
        r#""float": {"keyframes": [[0, 0], [10, 1]]}, "vec3": {"keyframes": [[0, [0, 0, 0]], [10, [0, 2, 0]]], "interpolation": "constant"},
           "rotate": {"keyframes": [[0, [0, 0, 0]], [10, [0, 720, 0]]]}, "choice": {"keyframes": [[0, "none"], [10, "perlin"]]},
           "falloff": {"keyframes": [[0, [[0, 0]]], [10, {"ramp": [[0, 1]]}]]}"#,
    );
    assert_eq!(at(&graph, "float", 5.0), Value::Float(0.5));
    assert_eq!(at(&graph, "vec3", 9.0), Value::Vec3([0.0; 3]));
    assert_eq!(at(&graph, "rotate", 2.5), euler_to_turn([0.0, 180.0, 0.0]), "whole turns are kept");
    assert_eq!((at(&graph, "choice", 9.9), at(&graph, "choice", 10.0)), (Value::Choice(0), Value::Choice(1)));
    let Value::Ramp(ramp) = at(&graph, "falloff", 5.0) else { panic!() };
    assert_eq!(ramp.keys(), [[0.0, 0.5]]);
}

#[test]
fn keyframes_with_one_value_are_constant() {
    let text = r#"{"convect": 1, "nodes": {"all": {"type": "Every_Shape", "params": {
        "fixed": {"keyframes": [[0, 2], [10, 2]]}}}}, "outputs": {"a": "all"}}"#;
    let graph = load_with(text, &[]).unwrap_or_else(|faults| panic!("{faults:#?}"));
    assert_eq!(constant(&graph, "fixed"), Value::Float(2.0));
}

#[test]
fn expressions_without_time_are_constants() {
    let graph = shapes(
        r#""gain": 2, "dir": [1, 2, 3], "on": true, "moving": {"keyframes": [[10, 0], [20, 10]]}"#,
        r#""float": {"expr": "gain*dir.y + on"}, "int": {"expr": "floor(7/2)"}, "vec3": {"expr": ["dir.x", "fps", "0"]},
           "rotate": {"expr": ["0", "45*gain", "0"]}, "double": {"expr": "moving + time"}, "fixed": {"expr": "1 + 1"}"#,
    );
    assert_eq!(constant(&graph, "float"), Value::Float(5.0));
    assert_eq!(constant(&graph, "int"), Value::Int(3));
    assert_eq!(constant(&graph, "vec3"), Value::Vec3([1.0, 24.0, 0.0]));
    assert_eq!(constant(&graph, "rotate"), euler_to_turn([0.0, 90.0, 0.0]));
    assert_eq!(constant(&graph, "fixed"), Value::Float(2.0));
    assert_eq!(at(&graph, "double", 12.0), Value::Float(2.5), "2 from the keyframes, and frame 12 is at 0.5 s");
}

#[test]
fn a_vector_is_one_expression_or_a_list_of_expressions_and_numbers() {
    let graph = shapes(
        r#""dir": [1, 2, 3]"#,
        r#""vec3": {"expr": "dir*2"}, "rotate": {"expr": "vec(0, 90, 0)"}, "int3": {"expr": "vec(1, 2, 3) + 1"},
           "span": {"expr": [0.5, "1 + time"]}, "vec2": {"expr": [1, 2e0]}"#,
    );
    assert_eq!(constant(&graph, "vec3"), Value::Vec3([2.0, 4.0, 6.0]));
    assert_eq!(constant(&graph, "rotate"), euler_to_turn([0.0, 90.0, 0.0]));
    assert_eq!(constant(&graph, "int3"), Value::Int3([2, 3, 4]));
    assert_eq!(at(&graph, "span", 12.0), Value::Span([0.5, 1.5]));
    assert_eq!(constant(&graph, "vec2"), Value::Vec2([1.0, 2.0]));
    let turning = shapes("", r#""vec3": {"expr": "vec(cos(time), 0, sin(time))"}"#);
    let listed = shapes("", r#""vec3": {"expr": ["cos(time)", 0, "sin(time)"]}"#);
    assert_eq!(at(&turning, "vec3", 17.0), at(&listed, "vec3", 17.0));
    assert_ne!(at(&turning, "vec3", 17.0), at(&turning, "vec3", 18.0));
}

#[test]
fn a_control_is_computed_from_time_and_the_controls_before_it() {
    let graph = shapes(
        r#""gain": 2, "moving": {"keyframes": [[10, 0], [20, 10]]}, "sum": {"expr": "moving + gain + time*0"},
           "twice": {"expr": "2*sum"}, "still": {"expr": "gain^3"}, "dir": {"expr": ["gain", 0, "still"]}"#,
        r#""float": {"control": "twice"}, "double": {"expr": "twice + 1"}, "int": {"control": "still"},
           "vec3": {"control": "dir"}, "rotate": {"expr": "dir"}, "fixed": {"expr": "still"},
           "masked": {"value": {"control": "sum"}, "attribute": "mask"}, "code": "a = twice*P.y""#,
    );
    assert_eq!(at(&graph, "float", 15.0), Value::Float(14.0));
    assert_eq!(at(&graph, "double", 15.0), Value::Float(15.0));
    assert_eq!(at(&graph, "masked", 15.0), Value::Masked(7.0, Some("mask".into())));
    assert_eq!((constant(&graph, "int"), constant(&graph, "fixed")), (Value::Int(8), Value::Float(8.0)));
    assert_eq!(constant(&graph, "vec3"), Value::Vec3([2.0, 0.0, 8.0]));
    assert_eq!(constant(&graph, "rotate"), euler_to_turn([2.0, 0.0, 8.0]));
    let Value::Code(code) = at(&graph, "code", 15.0) else { panic!("no code") };
    assert_eq!(code.controls()[3], 14.0, "`twice` is the fourth");
    assert!(source(&graph, "all", "code").is_animated());
}

/// Each control reads the one before twice: without a table this would take 2^60 evaluations, or a deep stack.
#[test]
fn a_chain_of_controls_is_evaluated_in_order() {
    let mut controls = r#""c0": {"expr": "time*24"}"#.to_owned();
    (1..=3000).for_each(|k| controls += &format!(r#", "c{k}": {{"expr": "(c{0} + c{0})/2"}}"#, k - 1));
    let graph = shapes(&controls, r#""float": {"expr": "c3000"}"#);
    assert_eq!(at(&graph, "float", 7.0), Value::Float(7.0));
}

#[test]
fn what_reads_a_bypassed_node_reads_what_it_passes() {
    let graph = good(
        r#"{"convect": 1, "nodes": {
            "fur": {"type": "Curve_In"}, "skin": {"type": "Mesh_In"},
            "wind": {"type": "Curve_Wind", "bypass": true, "note": "too strong", "inputs": {"curves": "fur"}},
            "again": {"type": "Curve_Wind", "bypass": true, "inputs": {"curves": "wind"}},
            "last": {"type": "Curve_Wind", "bypass": false, "inputs": {"curves": "again"}},
            "both": {"type": "Merge", "inputs": {"geometry": ["skin", "fur"]}},
            "m": {"type": "Merge", "bypass": true, "inputs": {"geometry": ["both", "skin"]}},
            "soft": {"type": "Softbody", "bypass": true, "inputs": {"bodies": ["both"]}}},
            "outputs": {"a": "last", "b": "m", "c": "again", "s": "soft.surface"}}"#,
    );
    let id = |link: Link| &*graph.nodes[link.node].id;
    let last = graph.nodes.iter().find(|node| &*node.id == "last").expect("the node is there");
    assert_eq!(id(last.inputs()[0][0]), "fur");
    let written: Vec<&str> = graph.outputs.iter().map(|output| id(output.from)).collect();
    assert_eq!(written, ["last", "both", "fur", "both"]);
    assert_eq!(graph.bypassed.iter().map(|id| &**id).collect::<Vec<_>>(), ["again", "m", "soft", "wind"]);
    assert_eq!(graph.notes, [], "what is bypassed is not needed, on purpose");
}

#[test]
fn a_control_is_read_like_a_value_in_the_param() {
    let graph = shapes(
        r#""x": 3, "word": "perlin", "turn": {"keyframes": [[0, [0, 0, 0]], [10, [90, 0, 0]]]}, "soft": {"ramp": [[0, 0], [1, 1]]}"#,
        r#""float": {"control": "x"}, "int": {"control": "x"}, "choice": {"control": "word"}, "rotate": {"control": "turn"},
           "falloff": {"control": "soft"}, "masked": {"value": {"control": "x"}, "attribute": "mask"}"#,
    );
    assert_eq!((constant(&graph, "float"), constant(&graph, "int")), (Value::Float(3.0), Value::Int(3)));
    assert_eq!(constant(&graph, "choice"), Value::Choice(1));
    assert_eq!(at(&graph, "rotate", 10.0), euler_to_turn([90.0, 0.0, 0.0]));
    assert_eq!(constant(&graph, "masked"), Value::Masked(3.0, Some("mask".into())));
}

#[test]
fn a_masked_value_can_be_animated() {
    let graph = shapes("", r#""masked": {"value": {"keyframes": [[0, 0], [10, 1]]}, "attribute": "mask"}"#);
    assert_eq!(at(&graph, "masked", 5.0), Value::Masked(0.5, Some("mask".into())));
}

#[test]
fn seeds_are_mixed_with_the_scenes_and_keyframed_seeds_are_not_interpolated() {
    let Value::Int(three) = constant(&shapes("", r#""seed": 3"#), "seed") else { panic!() };
    let Value::Int(unset) = constant(&shapes("", ""), "seed") else { panic!() };
    let Value::Int(zero) = constant(&shapes("", r#""seed": 0"#), "seed") else { panic!() };
    assert_eq!(three, i64::from(numerics::random::Key::new(7).of(3).u32()));
    assert_eq!(unset, zero);
    assert_ne!(three, zero);
    let graph = shapes("", r#""seed": {"keyframes": [[0, 3], [10, 0]]}"#);
    assert_eq!((at(&graph, "seed", 9.0), at(&graph, "seed", 10.0)), (Value::Int(three), Value::Int(zero)));
}

#[test]
fn paths_are_relative_to_the_folder_and_numbered_files_are_not_probed() {
    let text = r#"{"convect": 1, "outputs": {"o": "a"}, "nodes": {
        "a": {"type": "Mesh_In", "params": {"file": "sub/a.obj"}}, "b": {"type": "Mesh_In", "params": {"file": "missing.####.obj"}}}}"#;
    let graph = good(text);
    let file = |id| match source(&graph, id, "file") {
        Source::File { path, numbered } => (path.to_string_lossy().replace('\\', "/"), *numbered),
        other => panic!("{other:?}"),
    };
    assert_eq!(file("a"), ("scene/sub/a.obj".into(), false));
    assert_eq!(file("b"), ("scene/missing.####.obj".into(), true));
}

#[test]
fn a_start_that_is_not_set_is_the_scenes_first_frame() {
    let graph = good(
        r#"{"convect": 1, "scene": {"frames": [-5, 9]}, "outputs": {"o": "s"}, "nodes": {"s": {"type": "Softbody", "inputs": {"bodies": []}}}}"#,
    );
    assert!(matches!(source(&graph, "s", "start_frame"), Source::Constant(Value::Int(-5))));
    assert!(matches!(source(&graph, "s", "from"), Source::Constant(Value::Float(x)) if *x == -5.0));
}

#[test]
fn sets_replace_add_and_correct_values() {
    let text = r#"{"convect": 1, "controls": {"x": 1}, "outputs": {"o": "all"}, "nodes": {
        "all": {"type": "Every_Shape", "params": {"float": {"control": "x"}, "span": [2, 1]}}}}"#;
    let graph = load_with(text, &[("x", "4"), ("all.span", "[1, 2]"), ("all.int", "{\"expr\": \"x\"}")]);
    let graph = graph.unwrap_or_else(|faults| panic!("{faults:#?}"));
    assert_eq!((constant(&graph, "float"), constant(&graph, "int")), (Value::Float(4.0), Value::Int(4)));
    assert_eq!(constant(&graph, "span"), Value::Span([1.0, 2.0]));
}

#[test]
fn sets_take_words_without_quotes() {
    let text = r#"{"convect": 1, "controls": {"word": "none"}, "outputs": {"o": "all"}, "nodes": {
        "all": {"type": "Every_Shape", "params": {"choice": {"control": "word"}}},
        "mesh": {"type": "Mesh_In", "params": {"file": "a.obj"}}}}"#;
    let set = [("word", "wavelet"), ("all.text", "a \\ \"b\" "), ("mesh.file", "../b.obj"), ("all.bool", " false")];
    let graph = load_with(text, &set).unwrap_or_else(|faults| panic!("{faults:#?}"));
    assert_eq!((constant(&graph, "choice"), constant(&graph, "bool")), (Value::Choice(2), Value::Bool(false)));
    assert_eq!(constant(&graph, "text"), Value::Text("a \\ \"b\"".into()));
    assert!(matches!(source(&graph, "mesh", "file"), Source::File { path, .. } if path.ends_with("../b.obj")));
}

#[test]
fn the_probe_distinguishes_files_folders_and_missing_files() {
    let folder = tempfile::tempdir().expect("a folder for the test");
    let file = folder.path().join("a.obj");
    let kind = |path| probe(path).map_err(|error| error.kind());
    assert_eq!(kind(&file), Err(ErrorKind::NotFound));
    std::fs::write(&file, "v 0 0 0").expect("the file can be written");
    assert_eq!(kind(&file), Ok(()));
    assert_eq!(kind(folder.path()), Err(ErrorKind::IsADirectory));
}

#[test]
fn code_reads_controls_and_is_animated_if_they_are() {
    let code = |controls: &str, code: &str| {
        let graph = shapes(controls, &format!(r#""code": "{code}""#));
        let source = source(&graph, "all", "code");
        let Value::Code(at_5) = at(&graph, "code", 5.0) else { panic!("no code") };
        (source.is_animated(), at_5.controls().to_vec(), at_5.program().is_ok())
    };
    let controls = r#""gain": {"keyframes": [[0, 0], [10, 1]]}, "dir": [1, 2, 3], "word": "perlin""#;
    assert_eq!(code(controls, "a = gain*P.y"), (true, vec![0.5, 0.0, 0.0, 0.0], true));
    assert_eq!(code(controls, "a = dir.z"), (false, vec![0.0, 1.0, 2.0, 3.0], true));
    assert_eq!(code("", "a = gain*P.y"), (false, vec![], true), "a name that is not a control is an attribute");
}
