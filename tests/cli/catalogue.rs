//! `nodes`, `check`, `explain` and `completions`.

use serde_json::{Value, json};

use crate::bench::{Bench, CALM_AT_2, GRAPH};

fn names(bench: &Bench) -> Vec<String> {
    let nodes = bench.json(&["nodes", "--json"]);
    nodes.as_array().unwrap().iter().map(|node| node["name"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn every_node_is_listed_and_has_a_help_page() {
    let bench = Bench::new();
    let list = bench.done(&["nodes"]);
    let names = names(&bench);
    assert!(names.contains(&"Curve_In".to_owned()));
    let listed: Vec<&str> = list.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(listed, names);
    for name in &names {
        let page = bench.done(&["nodes", name]);
        assert!(page.starts_with(name.as_str()) && page.lines().count() > 5, "{name}: {page}");
        let only = bench.json(&["nodes", name, "--json"]);
        assert_eq!((&only[0]["name"], only.as_array().unwrap().len()), (&json!(name), 1));
    }
}

#[test]
fn nodes_as_json_say_what_outputs_carry() {
    let bench = Bench::new();
    let outputs = |node: &str| bench.json(&["nodes", node, "--json"])[0]["outputs"].clone();
    let softbody = outputs("Softbody");
    assert_eq!((&softbody[0]["name"], &softbody[0]["carries"]), (&json!("surface"), &json!(["mesh"])));
    assert_eq!((&softbody[1]["carries"], &softbody[1]["like"]), (&json!(["tets"]), &Value::Null));
    let merged = outputs("Merge");
    assert_eq!((&merged[0]["carries"], &merged[0]["like"]), (&Value::Null, &json!("geometry")));
}

#[test]
fn a_valid_graph_has_no_faults() {
    let bench = Bench::new();
    assert_eq!(bench.done(&["check", "g.json"]), "");
    assert_eq!(bench.json(&["check", "g.json", "--json"]), json!([]));
}

#[test]
fn faults_as_json_are_printed_only_to_stdout() {
    let bench = Bench::with_graph(&CALM_AT_2.replace("\"wind_dir\"", "\"wind_dirr\""));
    let ran = bench.run(&["check", "g.json", "--json"]);
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(3), ""));
    let faults: Value = serde_json::from_str(&ran.stdout).unwrap();
    let expected = json!([{
        "code": "unknown-param", "line": 8, "column": 19, "path": "nodes.wind.params.wind_dirr",
        "fact": "`Curve_Wind` has no param `wind_dirr`", "hint": "did you mean `wind_dir`?",
    }]);
    assert_eq!(faults, expected);
}

#[test]
fn explain_shows_how_often_each_node_cooks_and_what_is_left_out() {
    let bench = Bench::new();
    let text = bench.done(&["explain", "g.json", "--output", "still"]);
    assert!(text.contains("no requested output depends on it"), "{text}");
    let plan = bench.json(&["explain", "g.json", "--json"]);
    assert_eq!(plan["frames"], json!(4));
    let cooks: Vec<(&Value, &Value)> =
        plan["nodes"].as_array().unwrap().iter().map(|node| (&node["id"], &node["cooks"])).collect();
    assert_eq!(cooks, [(&json!("blades"), &json!(1)), (&json!("wind"), &json!(4))]);
    assert_eq!(plan["nodes"][0]["inputs"], json!({}));
    assert_eq!(plan["nodes"][1]["inputs"], json!({"curves": ["blades"]}));
    assert_eq!(bench.names("out").len(), 0, "nothing is cooked");
}

#[test]
fn explain_prints_what_a_solver_says_of_itself() {
    let bench = Bench::with_graph(
        r#"{ "convect": 1, "scene": { "frames": [1, 4] },
             "nodes": {
               "block": { "type": "Mesh_Primitive", "params": { "size": [0.4, 0.4, 0.4] } },
               "water": { "type": "FluidSolve", "inputs": { "liquid": "block" }, "params": { "viscosity": 0 } } },
             "outputs": { "water": "water" } }"#,
    );
    let text = bench.done(&["explain", "g.json"]);
    assert!(text.contains("\n                 the box has 50 × 50 × 50 cells, up to [0.5, 1.0, 0.5]\n"), "{text}");
    assert!(
        text.contains("in none, pressure alone acts") && text.contains("left out viscous stress: `viscosity`"),
        "{text}"
    );
    let plan = bench.json(&["explain", "g.json", "--json"]);
    let lines = plan["nodes"][1]["explained"].as_array().unwrap();
    assert!(lines.len() == 2 && lines.iter().all(|line| text.contains(line.as_str().unwrap())), "{plan}");
}

#[test]
fn a_bypassed_node_is_left_out_and_what_reads_it_reads_its_input() {
    let bench =
        Bench::with_graph(&GRAPH.replace(r#""type": "Curve_Wind","#, r#""type": "Curve_Wind", "bypass": true,"#));
    let text = bench.done(&["explain", "g.json"]);
    assert!(text.contains("left out: `bypass` is true"), "{text}");
    assert_eq!(bench.run(&["check", "g.json", "--strict"]).code, Some(0));
    bench.done(&["cook", "g.json", "--format", "json", "--frames", "2"]);
    assert_eq!(bench.files("out")["grass.0002.json"], bench.files("out")["still.0002.json"]);
}

#[test]
fn explain_shows_how_far_back_a_window_reads_and_its_cost() {
    let bench = Bench::with_graph(
        r#"{ "convect": 1, "scene": { "frames": [1, 96] },
             "nodes": {
               "hair": { "type": "Curve_In", "params": { "counts": [2], "points": [[0, 0, 0], [0, 1, 0]] } },
               "wind": { "type": "Curve_Wind", "inputs": { "curves": "hair" } },
               "jiggle": { "type": "Curve_Jiggle", "inputs": { "curves": "wind" }, "params": { "frequency": 12 } } },
             "outputs": { "hair": "jiggle" } }"#,
    );
    // ln((1 + 1.3·1.05)·1000) ÷ (0.3·2π·12) = 0.344 s: 9 frames. Eleven anchors, each but the first with 9 steps before
    // it.
    let text = bench.done(&["explain", "g.json"]);
    assert!(text.contains("186 steps for 96 frames: window of 9 frames, restarted every 9"), "{text}");
    let plan = bench.json(&["explain", "g.json", "--json"]);
    assert_eq!(plan["nodes"][2]["window"], json!({"frames": 9, "every": 9}));
    assert_eq!(plan["nodes"][1]["window"], Value::Null);
}

#[test]
fn the_schema_is_json_that_names_every_node() {
    let bench = Bench::new();
    let schema = bench.json(&["schema"]).to_string();
    assert!(names(&bench).iter().all(|name| schema.contains(&format!("\"{name}\""))));
}

#[test]
fn the_expression_language_is_printed() {
    let text = Bench::new().done(&["functions"]);
    assert!(text.starts_with("Expressions\n") && text.contains("smoothstep(low, high, x)"), "{text}");
}

#[test]
fn every_shell_has_completions() {
    let bench = Bench::new();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let text = bench.done(&["completions", shell]);
        assert!(text.contains("convect") && text.contains("completions"), "{shell}");
    }
}

#[test]
fn help_and_version_exit_with_0() {
    let bench = Bench::new();
    let help = bench.done(&["--help"]);
    for verb in ["cook", "check", "explain", "nodes", "stats", "diff", "convert", "functions", "schema", "completions"]
    {
        assert!(help.contains(&format!("\n  {verb} ")), "{verb} in {help}");
        let page = bench.done(&[verb, "--help"]);
        assert!(page.contains(&format!("Usage: convect {verb}")), "{page}");
    }
    assert_eq!(bench.done(&["--version"]), concat!("convect ", env!("CARGO_PKG_VERSION"), "\n"));
}
