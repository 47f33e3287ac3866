//! `study --extremes`: a line for each end of each param, with the outcome, its message and its figure.

use serde_json::{Value, json};

use super::bench::Bench;

/// A blade of 2 m in wind without noise.
const BLADE: &str = r#"{
  "convect": 1,
  "scene": { "frames": [1, 40] },
  "nodes": {
    "blade": { "type": "Curve_In", "params": { "points": [[0, 0, 0], [0, 1, 0], [0, 2, 0]] } },
    "wind": { "type": "Curve_Wind", "inputs": { "curves": "blade" }, "params": { "noise": "none", "global_rotate": 0.5 } }
  },
  "outputs": { "grass": "wind" }
}"#;

fn row<'a>(found: &'a Value, param: &str, value: &Value) -> &'a Value {
    let rows = found["rows"].as_array().unwrap();
    let is = |row: &&Value| row["param"] == param && row["value"] == *value;
    rows.iter().find(is).unwrap_or_else(|| panic!("{param} {value}: {found}"))
}

#[test]
fn each_param_is_cooked_at_both_ends_of_its_range_in_a_line_each() {
    let bench = Bench::with_graph(BLADE);
    let ran = bench.run(&["study", "g.json", "--extremes", "--json", "rows.json"]);
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let found = bench.read_json("rows.json");
    assert_eq!(
        (&found["extremes"], &found["outputs"], &found["frames"][23]),
        (&json!(1), &json!(["grass"]), &json!(24))
    );
    assert_eq!(found["frames"].as_array().unwrap().len(), 24, "the first frames of the scene");
    let rows = found["rows"].as_array().unwrap();
    assert_eq!(ran.stdout.lines().count(), 1 + rows.len(), "{}", ran.stdout);
    assert!(ran.stdout.starts_with("as it is") && ran.stderr.contains(&format!("{} values: ", rows.len())));
    // Without any of the wind the curve of 2 m stands upright.
    let at = |value: Value| row(&found, "wind.blend", &value);
    assert_eq!((&at(json!(0))["outcome"], &at(json!(0))["largest"]), (&json!("finite"), &json!(2.0)));
    assert_eq!(at(json!(0))["frames"], json!(24));
    let octaves = row(&found, "wind.octaves", &json!(1));
    assert_eq!(octaves["message"], "not read: the other params leave it out");
    let words: Vec<&Value> = rows.iter().filter(|row| row["param"] == "wind.noise").map(|row| &row["value"]).collect();
    assert_eq!(words, ["perlin", "billow", "wavelet"].map(|word| json!(word)).iter().collect::<Vec<_>>());
    assert!(rows.iter().all(|row| ["finite", "refused", "capped"].contains(&row["outcome"].as_str().unwrap())));
}

#[test]
fn refusals_and_what_nodes_could_not_meet_have_their_messages() {
    let pool = r#"{ "convect": 1, "scene": { "frames": [1, 3] }, "nodes": {
        "block": { "type": "Mesh_In", "params": {
            "points": [[-0.2, -0.4, -0.2], [0.2, -0.4, -0.2], [-0.2, 0.4, -0.2], [0.2, 0.4, -0.2],
                       [-0.2, -0.4, 0.2], [0.2, -0.4, 0.2], [-0.2, 0.4, 0.2], [0.2, 0.4, 0.2]],
            "counts": [4, 4, 4, 4, 4, 4],
            "indices": [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5] } },
        "solve": { "type": "FluidSolve", "inputs": { "liquid": ["block"] },
                   "params": { "cell": 0.1, "domain_from": [-0.4, -0.4, -0.4], "domain_to": [0.4, 0.4, 0.4] } } },
        "outputs": { "liquid": "solve.surface" } }"#;
    let bench = Bench::with_graph(pool);
    let set = "--set=solve.max_substeps=4";
    let found = bench.json(&["study", "g.json", "--extremes", set, "--json", "-", "--quiet", "--limit", "5s"]);
    let fine = found["rows"].as_array().unwrap().iter().find(|row| row["param"] == "solve.cell").unwrap();
    assert_eq!(fine["outcome"], "refused", "{fine}");
    assert!(fine["message"].as_str().unwrap().contains("cells"), "{fine}");
    let far = found["rows"].as_array().unwrap().iter().rfind(|row| row["param"] == "solve.gravity").unwrap();
    assert!(far["outcome"] == "capped" && far["frames"] == 3, "{far}");
    let names = ["cell", "gravity", "viscosity", "method", "follow", "wall_x_min", "initial_spin"];
    for name in names {
        let key = format!("solve.{name}");
        assert!(found["rows"].as_array().unwrap().iter().any(|row| row["param"] == *key), "{key}");
    }
}

#[test]
fn what_takes_longer_than_the_limit_is_stopped_and_said() {
    let bench = Bench::with_graph(&BLADE.replace(r#""grass": "wind""#, r#""grass": "blade""#));
    let args = ["study", "g.json", "--extremes", "--frames", "1-1000000", "--json", "-", "--quiet"];
    let found = bench.json(&[&args[..], &["--limit", "300ms"]].concat());
    let scale = row(&found, "blade.scale", &json!(1e9));
    assert_eq!(scale["outcome"], "capped", "{scale}");
    assert!(scale["message"].as_str().unwrap().contains("in 0.3 s"), "{scale}");
}

/// Its process is ended before it listens to signals.
#[test]
fn a_limit_too_short_to_start_within_is_said() {
    let args = ["study", "g.json", "--extremes", "--limit", "0.001ms"];
    let ended = Bench::with_graph(BLADE).run(&args);
    assert_eq!(ended.code, Some(4), "{}", ended.stderr);
    assert!(ended.stderr.contains("no frame cooked within 1e-6 s; set a longer --limit"), "{}", ended.stderr);
}

#[test]
fn a_graph_that_cannot_be_cooked_as_it_is_ends_with_its_code() {
    let code =
        |graph: &str, args: &[&str]| Bench::with_graph(graph).run(&[&["study", "g.json", "--extremes"], args].concat());
    assert_eq!(code("{", &[]).code, Some(3));
    let missing = BLADE.replace("\"points\": [[0, 0, 0], [0, 1, 0], [0, 2, 0]]", "\"file\": \"none.obj\"");
    assert_eq!(code(&missing, &[]).code, Some(1));
    assert_eq!(code(BLADE, &["--output", "fur"]).code, Some(2));
    assert_eq!(code(BLADE, &["--knob", "wind.octaves=1,2"]).code, Some(2));
    assert_eq!(code(BLADE, &["--json", "g.json"]).code, Some(2));
    let calm = code(super::bench::CALM_AT_2, &["--output", "grass"]);
    assert_eq!(calm.code, Some(4), "{}", calm.stderr);
    assert!(
        calm.stderr.contains("the graph cannot be cooked as it is: `wind` (Curve_Wind) at frame 2"),
        "{}",
        calm.stderr
    );
}

#[test]
fn a_graph_from_stdin_is_handed_on() {
    let bench = Bench::with_graph(BLADE);
    let mut command = bench.command(&["study", "-", "--extremes", "--json", "-", "--quiet", "--frames", "1-2"]);
    let file = std::fs::File::open(bench.path("g.json")).unwrap();
    let ran = super::bench::Ran::of(&command.stdin(file).output().unwrap());
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let found: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(found["graph"], "stdin");
    assert!(found["rows"].as_array().unwrap().len() > 20);
}
