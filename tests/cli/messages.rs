//! Complete messages on stderr. The wording of each fault is tested in the engine; these tests check that the program
//! prints all faults at once, with position and hint, and nothing else.

use crate::bench::{Bench, CALM_AT_2};

fn stderr(graph: &str, args: &[&str]) -> String {
    let bench = Bench::with_graph(graph);
    let ran = bench.run(args);
    assert_eq!(ran.stdout, "");
    ran.stderr
}

#[test]
fn the_message_for_a_truncated_file_names_what_was_open() {
    let expected =
        "g.json:1:26: the file ends inside the object that starts at line 1, column 25; is the rest missing?\n";
    assert_eq!(stderr(r#"{"convect": 1, "nodes": {"#, &["check", "g.json"]), expected);
}

#[test]
fn all_faults_are_reported_at_once_each_with_position_and_hint() {
    let graph = r#"{
  "convect": 1,
  "nodes": {
    "fur": { "type": "Curve_In", "params": { "file": "fur.obj" } },
    "wind": { "type": "Curve_Wind", "inputs": { "curves": "furr" },
              "params": { "amplitud": 1, "wind_dir": [0, 0, 0], "scroll": "fast" } }
  },
  "outputs": { "o": "wnd" }
}"#;
    let expected = r#"g.json:4:54: nodes.fur.params.file: `fur.obj` does not exist; paths are relative to the graph file
g.json:5:59: nodes.wind.inputs.curves: there is no node `furr`; did you mean `fur`?
g.json:6:27: nodes.wind.params.amplitud: `Curve_Wind` has no param `amplitud`; did you mean `amplitude`?
g.json:6:54: nodes.wind.params.wind_dir: `wind_dir` is [0, 0, 0], which has no direction; use a vector that is not zero, such as [1, 0, 0]
g.json:6:75: nodes.wind.params.scroll: found the string "fast", expected a number
g.json:8:21: outputs.o: there is no node `wnd`; did you mean `wind`?
6 faults
"#;
    assert_eq!(stderr(graph, &["check", "g.json"]), expected);
    assert_eq!(stderr(graph, &["cook", "g.json"]), expected, "cook and check print the same");
}

#[test]
fn a_cycle_is_reported_node_by_node() {
    let graph = r#"{"convect": 1, "nodes": {
  "a": {"type": "Curve_Wind", "inputs": {"curves": "b"}}, "b": {"type": "Curve_Wind", "inputs": {"curves": "a"}}},
  "outputs": {"o": "a"}}"#;
    let expected =
        "g.json:2:52: nodes.a.inputs.curves: the wires form a cycle: a → b → a; remove one wire of the cycle\n";
    assert_eq!(stderr(graph, &["check", "g.json"]), expected);
}

#[test]
fn a_broken_file_is_reported_with_its_line() {
    let bench = Bench::new();
    bench.write("grass.obj", "v 0 0 0\nv 0 nan 0\n");
    let expected = "g.json:7:57: nodes.blades.params.file: `grass.obj`: line 2: `nan` is not a finite number\n";
    assert_eq!(bench.run(&["cook", "g.json"]).stderr, expected);
}

#[test]
fn a_failed_node_is_reported_with_its_frame_and_its_output() {
    let expected = "g.json:8:31: `wind` (Curve_Wind) at frame 2: `wind_dir` is [0, 0, 0], which has no direction; \
                    use a vector that is not zero, such as [1, 0, 0]\n";
    let cook = |format| stderr(CALM_AT_2, &["cook", "g.json", "-q", "--format", format]);
    assert_eq!(cook("json"), format!("{expected}output `grass` lacks the frames that failed\n"));
    assert_eq!(cook("usdc"), format!("{expected}output `grass` was not written\n"));
}

#[test]
fn a_wrong_set_is_reported_by_its_key() {
    let graph = crate::bench::GRAPH;
    assert_eq!(
        stderr(graph, &["cook", "g.json", "--set", "wind.nois=1"]),
        "--set wind.nois:1:1: nodes.wind.params.nois: `Curve_Wind` has no param `nois`; did you mean `noise`?\n"
    );
    assert_eq!(
        stderr(graph, &["cook", "g.json", "--set", "wind.noise=[perlin]"]),
        "--set wind.noise:1:2: found `perlin`, expected a value; a string in a list or an object needs double quotes that the \
         shell must not remove: 'wind.noise=…\"perlin\"…'\n"
    );
}

#[test]
fn an_obstacle_to_writing_a_file_is_reported() {
    let graph = crate::bench::GRAPH;
    assert_eq!(stderr(graph, &["cook", "none.json"]), "the graph `none.json` does not exist\n");
    assert_eq!(
        stderr(graph, &["cook", "g.json", "--output", "fur"]),
        "the graph has no output `fur`; outputs: `grass`, `still`\n"
    );
    assert_eq!(
        stderr(graph, &["cook", "g.json", "--out", "g.json"]),
        "`g.json` could not be created: a file with that name already exists\n"
    );
    assert_eq!(stderr(graph, &["stats", "shot.usdc"]), "`shot.usdc` could not be read: no such file or folder\n");
}
