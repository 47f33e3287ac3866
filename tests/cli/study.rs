//! `study`: errors with known orders and values, the contract of its JSON, tuned graphs, failures, interruptions.

use serde_json::{Value, json};

use super::bench::Bench;
#[cfg(unix)]
use super::{bench::Ran, stopped::signal, stopped::wait_for};
#[cfg(unix)]
use std::process::Stdio;

/// Upright hairs of one segment that the wind turns into a wall: each stops at its first contact, so what steps get wrong is
/// a part of one step.
pub(crate) const WALL: &str = r#"// A wall in the wind.
{
  "convect": 1,
  "scene": { "frames": [1, 2] },
  "nodes": {
    "ground": { "type": "Mesh_Primitive", "params": { "shape": "grid", "size": [0.4, 0, 0.4], "divisions": 1 } },
    "blades": { "type": "Curve_Scatter", "inputs": { "skin": "ground" }, "params": { "density": 2000, "cvs": 2, "lean": 0, "length": [0.2, 0.3] } },
    "wind": { "type": "Curve_Wind", "inputs": { "curves": "blades" }, "params": { "wind_dir": [1, 0, 0], "global_rotate": { "expr": "0.8 + 0.02*frame" }, "noise": "none" } },
    "wall": { "type": "Mesh_Primitive", "params": { "shape": "box", "size": [0.1, 1, 1] } },
    "put": { "type": "Transform", "inputs": { "geometry": "wall" }, "params": { "translate": [0.3, 0, 0] } },
    // Turned in steps.
    "bent": {
      "type": "Curve_Wind_Collision", "inputs": { "curves": "wind", "rest": "blades", "colliders": ["ground", "put"] },
      "params": { "rotation_steps": 3 /* few */, "offset_root": 0.001 },
    },
  },
  "outputs": { "grass": "bent" },
}
"#;

/// Hairs that swing in a wind of two frequencies.
const SWING: &str = r#"{
  "convect": 1,
  "scene": { "frames": [1, 100] },
  "nodes": {
    "ball": { "type": "Mesh_Primitive", "params": { "shape": "sphere", "size": [0.2, 0.2, 0.2], "divisions": 6 } },
    "fur": { "type": "Curve_Scatter", "inputs": { "skin": "ball" }, "params": { "density": 500, "cvs": 4 } },
    "wind": { "type": "Curve_Wind", "inputs": { "curves": "fur" }, "params": { "wind_dir": [-1, 0.2, 0], "noise": "none",
              "global_rotate": { "expr": "0.4 + 0.3*sin(7*time) + 0.2*sin(17*time)" } } },
    "jiggle": { "type": "Curve_Jiggle", "inputs": { "curves": "wind" }, "params": { "frequency": 6, "damping": 0.15 } }
  },
  "outputs": { "fur": "jiggle" }
}"#;

/// A soft block that sways gently from a pinned side: smooth motion, without contact.
pub(crate) const SWAY: &str = r#"{
  "convect": 1,
  "scene": { "frames": [1, 12] },
  "nodes": {
    "block": { "type": "Mesh_Primitive", "params": { "shape": "box", "size": [0.2, 0.2, 0.2], "divisions": 2 } },
    "body": { "type": "Tetrahedralize", "inputs": { "surface": "block" } },
    "wall": { "type": "Point_In", "params": { "points": [[-0.1, 0, 0]] } },
    "pin": { "type": "Softbody_Pin", "inputs": { "targets": "wall" }, "params": { "radius": 0.12 } },
    "soft": { "type": "Softbody", "inputs": { "bodies": "body", "pins": "pin" },
              "params": { "stiffness": 20000, "damping": 0, "volume": 0, "gravity": [0, -0.5, 0] } }
  },
  "outputs": { "soft": "soft" }
}"#;

pub(crate) const STEPS: &str = "bent.rotation_steps=4,8,16,32";

fn study(bench: &Bench, more: &[&str]) -> Value {
    let args = ["study", "g.json", "--json", "-", "--quiet", "--repeats", "1", "--fresh"];
    bench.json(&[&args[..], more].concat())
}

/// The measured order in the table.
fn order(table: &str) -> f64 {
    let line = table.lines().find(|line| line.starts_with("order of ")).unwrap_or_else(|| panic!("{table}"));
    line.split_once(": ").unwrap().1.split_whitespace().next().unwrap().parse().unwrap()
}

fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value.as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

#[test]
fn the_json_has_the_documented_keys_and_the_table_goes_to_stderr() {
    let bench = Bench::with_graph(WALL);
    let ran = bench.run(&["study", "g.json", "--knob", STEPS, "--output", "grass", "--json", "-", "--repeats", "1"]);
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert!(ran.stderr.contains("floor: mean ") && ran.stderr.contains("declared 1"), "{}", ran.stderr);
    let found: Value = serde_json::from_str(&ran.stdout).unwrap();
    let expected =
        ["floor", "frames", "front", "graph", "knobs", "norm", "output", "pick", "reference", "runs", "study", "unit"];
    assert_eq!(keys(&found), expected);
    assert_eq!((&found["study"], &found["norm"], &found["unit"]), (&json!(1), &json!("points"), &json!("m")));
    assert_eq!((&found["frames"], &found["knobs"]), (&json!([1, 2]), &json!(["bent.rotation_steps"])));
    assert_eq!(found["reference"]["settings"]["bent.method"], json!("exact"));
    assert_eq!((keys(&found["floor"]), &found["pick"]), (vec!["max", "mean", "p99"], &Value::Null));
    let runs = found["runs"].as_array().unwrap();
    let expected = ["cpu_ms", "error", "failed", "ms", "nodes", "peak_bytes", "settings"];
    assert!(runs.len() == 4 && runs.iter().all(|run| keys(run) == expected), "{runs:?}");
    assert_eq!(runs[3]["settings"], json!({"bent.rotation_steps": 32}));
    assert!(runs.iter().all(|run| run["ms"].as_f64().unwrap() > 0.0 && run["nodes"]["bent"].as_f64().unwrap() > 0.0));
    assert_eq!(runs[0]["nodes"]["ground"], json!(0.0), "a still source is read before the cook");
    let svg = String::from_utf8(bench.files("out").remove("grass.svg").unwrap()).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n") && svg.contains("time per frame (ms)"), "{svg}");
    assert_eq!(bench.names("out"), ["grass.study", "grass.svg"]);
}

#[test]
fn errors_are_those_of_separate_cooks() {
    let bench = Bench::with_graph(WALL);
    let found = study(&bench, &["--knob", "bent.rotation_steps=4,8"]);
    let points = |set: &str| -> Vec<f64> {
        bench.done(&["cook", "g.json", "--set", set, "--set", "bent.rotation_steps=4", "--format", "json", "--quiet"]);
        let frames = ["grass.0001.json", "grass.0002.json"].map(|name| bench.files("out").remove(name).unwrap());
        let rows = frames.iter().flat_map(|bytes| {
            let frame: Value = serde_json::from_slice(bytes).unwrap();
            frame["curves"]["points"].as_array().unwrap().clone()
        });
        rows.flat_map(|row| row.as_array().unwrap().clone()).map(|x| f64::from(x.as_f64().unwrap() as f32)).collect()
    };
    let (a, b) = (points("bent.method=steps"), points("bent.method=exact"));
    let distance = |(a, b): (&[f64], &[f64])| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
    let distances: Vec<f64> = a.chunks(3).zip(b.chunks(3)).map(distance).collect();
    let mean = distances.iter().sum::<f64>() / distances.len() as f64;
    let stated = found["runs"][0]["error"]["mean"].as_f64().unwrap();
    assert!((stated - mean).abs() <= 1e-6 * mean && mean > 1e-3, "{stated} {mean}");
}

#[test]
fn measured_orders_are_those_declared() {
    let table = Bench::with_graph(WALL).done(&["study", "g.json", "--knob", STEPS, "--repeats", "1", "--quiet"]);
    assert!((order(&table) - 1.0).abs() < 0.2, "{table}");
    let tolerance = "jiggle.tolerance=1e-1,3e-2,1e-2,3e-3,1e-3";
    let args = ["study", "g.json", "--knob", tolerance, "--repeats", "1", "--quiet", "--frames", "80-100"];
    let table = Bench::with_graph(SWING).done(&args);
    assert!((order(&table) - 1.0).abs() < 0.2, "{table}");
}

#[test]
fn a_method_of_lower_order_than_declared_is_caught() {
    let bench = Bench::with_graph(SWAY);
    let args = ["study", "g.json", "--knob", "soft.substeps=2,4,8,16", "--repeats", "1", "--quiet", "--fresh"];
    let table = bench.done(&args);
    assert!((order(&table) - 2.0).abs() < 0.2 && !table.contains("lower than declared"), "{table}");
    let euler = bench.done(&[&args[..], &["--set", "soft.integrator=euler", "--set", "soft.damping=0.02"]].concat());
    assert!(order(&euler) < 1.2 && euler.contains("declared 2: lower than declared"), "{euler}");
}

/// A block of thick liquid that slumps.
pub(crate) const SLUMP: &str = r#"{
  "convect": 1,
  "scene": { "frames": [1, 3], "fps": 6 },
  "nodes": {
    "block": { "type": "Mesh_Primitive", "params": { "shape": "box", "size": [0.4, 0.4, 0.4], "divisions": 1 } },
    "solve": { "type": "FluidSolve", "inputs": { "liquid": ["block"] }, "params": { "cell": 0.05, "viscosity": 300,
               "domain_from": [-0.7, -0.2, -0.7], "domain_to": [0.7, 0.4, 0.7] } }
  },
  "outputs": { "drop": "solve" }
}"#;

/// FluidSolve declares no order: the surface is as good as its cells, and what a substep errs is not a pure power of its length.
#[test]
fn the_error_of_a_liquid_falls_with_its_cells_and_its_substeps() {
    let bench = Bench::with_graph(SLUMP);
    // Of first order in the cells: e = C·(h − h of the reference).
    let cells = study(&bench, &["--norm", "surface", "--knob", "solve.cell=0.1,0.07,0.05,0.035"]);
    assert_eq!(cells["reference"]["settings"]["solve.cell"], json!(0.0245));
    let share = |(run, cell): (usize, f64)| cells["runs"][run]["error"]["mean"].as_f64().unwrap() / (cell - 0.0245);
    let shares = [(0, 0.1), (1, 0.07), (2, 0.05)].map(share);
    assert!(shares.iter().all(|share| (0.7..1.4).contains(&(share / shares[1]))), "{shares:?}");
    let more = ["--norm", "surface", "--set", "solve.viscosity=100", "--knob", "solve.cfl=2,1,0.5,0.25"];
    let found = study(&bench, &more);
    let means: Vec<f64> = (0..4).map(|run| found["runs"][run]["error"]["mean"].as_f64().unwrap()).collect();
    assert!(means.windows(2).all(|pair| pair[1] < pair[0]) && means[3] < 0.6 * means[0], "{means:?}");
}

#[test]
fn one_level_finer_moves_no_error_by_more_than_the_floor() {
    let bench = Bench::with_graph(SWING);
    let means = |values: &str| -> (Vec<f64>, f64) {
        let knob = format!("jiggle.tolerance={values}");
        let found = study(&bench, &["--knob", &knob, "--frames", "90-100"]);
        let mean = |run: &Value| run["error"]["mean"].as_f64().unwrap();
        (found["runs"].as_array().unwrap().iter().map(mean).collect(), found["floor"]["mean"].as_f64().unwrap())
    };
    let ((coarse, floor), (fine, _)) = (means("1e-1,3e-2,1e-2"), means("1e-1,3e-2,1e-2,3.3333333333e-3"));
    assert!(floor > 0.0 && coarse[2] == floor, "the best's error is the floor");
    assert!(coarse.iter().zip(&fine).all(|(a, b)| (a - b).abs() <= floor), "{coarse:?} {fine:?}");
}

/// Finer cells give the liquid more vertices, beside those of a table that stays as it is: neither may count for more by that.
#[test]
fn one_level_finer_moves_no_error_of_a_surface_by_more_than_the_floor() {
    let table = r#""nodes": {
    "table": { "type": "Mesh_Primitive", "params": { "shape": "grid", "size": [2, 0, 2], "divisions": 24 } },
    "both": { "type": "Merge", "inputs": { "geometry": ["solve.surface", "table"] } },"#;
    let graph = SLUMP.replace("\"nodes\": {", table).replace("\"drop\": \"solve\"", "\"drop\": \"both\"");
    let bench = Bench::with_graph(&graph);
    let means = |values: &str| -> (Vec<f64>, f64) {
        let found = study(&bench, &["--norm", "surface", "--knob", &format!("solve.cell={values}")]);
        let mean = |run: &Value| run["error"]["mean"].as_f64().unwrap();
        (found["runs"].as_array().unwrap().iter().map(mean).collect(), found["floor"]["mean"].as_f64().unwrap())
    };
    let ((coarse, floor), (fine, finer)) = (means("0.1,0.07,0.05"), means("0.1,0.07,0.05,0.0357142857"));
    assert!(floor > 0.0 && finer < floor && coarse[0] > 2.0 * floor, "{coarse:?} {floor} {finer}");
    assert!(coarse.iter().zip(&fine).all(|(a, b)| (a - b).abs() <= floor), "{coarse:?} {fine:?} {floor}");
}

#[test]
fn values_that_are_refused_stay_as_failures() {
    let bench = Bench::with_graph(WALL);
    let found = study(&bench, &["--knob", "bent.rotation_steps=-1,4,8"]);
    let failed = &found["runs"][0];
    assert_eq!(
        (&failed["error"], &failed["ms"], &failed["settings"]),
        (&Value::Null, &Value::Null, &json!({"bent.rotation_steps": -1}))
    );
    assert!(failed["failed"].as_str().unwrap().contains("`rotation_steps` is -1; expected"), "{failed}");
    assert!(!found["front"].as_array().unwrap().contains(&json!(0)));
    let svg = String::from_utf8(bench.files("out").remove("grass.svg").unwrap()).unwrap();
    assert!(svg.contains("failed: 1"), "{svg}");
    let none = bench.run(&["study", "g.json", "--knob", "bent.gap=-1,-2", "--json", "-", "--quiet"]);
    let failed: Value = serde_json::from_str(&none.stdout).unwrap();
    assert_eq!((none.code, failed["runs"].as_array().unwrap().len()), (Some(4), 2));
    assert!(none.stderr.contains("no setting could be cooked"), "{}", none.stderr);
    // A setting beyond which nothing is: the finest that can be cooked is the reference, and the floor is unknown.
    let words = study(&bench, &["--knob", "bent.method=steps,exact"]);
    assert_eq!((&words["floor"]["mean"], &words["runs"][1]["error"]["max"]), (&Value::Null, &json!(0.0)));
}

#[test]
fn a_tuned_graph_keeps_comments_loads_and_errs_by_what_was_said() {
    let bench = Bench::with_graph(&WALL.replace(
        "\"type\": \"Mesh_Primitive\", \"params\": { \"shape\": \"box\", \"size\": [0.1, 1, 1] }",
        "\"type\": \"Mesh_In\", \"params\": { \"file\": \"wall.obj\" }",
    ));
    bench.write("wall.obj", "v 0 -1 -1\nv 0 1 -1\nv 0 1 1\nv 0 -1 1\nf 1 2 3 4\n");
    let found = study(&bench, &["--knob", STEPS, "--tolerance", "4e-3"]);
    let pick = &found["runs"][found["pick"].as_u64().unwrap() as usize];
    let error = pick["error"]["mean"].as_f64().unwrap();
    assert!(error <= 4e-3, "{found}");
    let tuned = String::from_utf8(bench.files("out").remove("grass.tuned.jsonc").unwrap()).unwrap();
    let kept = [
        "// A wall in the wind.",
        "// Turned in steps.",
        "/* few */",
        "/* convect study: cheapest within 0.004 m: mean points error ",
    ];
    assert!(kept.iter().all(|part| tuned.contains(part)), "{tuned}");
    assert!(tuned.contains("\"method\": \"steps\"") && tuned.contains("\"file\": \"../wall.obj\""), "{tuned}");
    bench.done(&["check", "out/grass.tuned.jsonc"]);
    // The tuned setting alone, against the same reference.
    let steps = pick["settings"]["bent.rotation_steps"].to_string();
    let knob = format!("bent.rotation_steps={steps}");
    let again = bench.json(&["study", "out/grass.tuned.jsonc", "--knob", &knob, "--json", "-", "-q", "--out", "again"]);
    assert_eq!(again["runs"][0]["error"], pick["error"]);
}

#[test]
fn a_tolerance_below_the_floor_or_out_of_reach_is_not_claimed() {
    let bench = Bench::with_graph(WALL);
    let ran = bench.run(&["study", "g.json", "--knob", STEPS, "--tolerance", "1e-9", "--repeats", "1"]);
    assert_eq!(ran.code, Some(4));
    assert!(
        ran.stderr.contains("the tolerance 1e-9 m is below the floor")
            && ran.stderr.contains("the rounding of stored positions, which no value lowers"),
        "{}",
        ran.stderr
    );
    let ran = bench.run(&["study", "g.json", "--knob", STEPS, "--tolerance", "1e-5", "--repeats", "1"]);
    assert_eq!(ran.code, Some(4));
    assert!(ran.stderr.contains("no setting has a mean of at most 1e-5 m; the best is run 3"), "{}", ran.stderr);
    assert!(!bench.path("out/grass.tuned.jsonc").exists());
    let found = study(&bench, &["--knob", STEPS, "--budget", "60s"]);
    assert_eq!(found["pick"], json!(3), "within a budget that all meet the most accurate is picked");
}

#[test]
fn a_tuned_graph_of_an_earlier_study_does_not_stay_beside_one_that_found_none() {
    let bench = Bench::with_graph(WALL);
    let run = |more: &[&str]| bench.run(&[&["study", "g.json", "--knob", STEPS, "--repeats", "1"], more].concat());
    let tuned = bench.path("out/grass.tuned.jsonc");
    assert_eq!(run(&["--tolerance", "4e-3"]).code, Some(0));
    assert!(tuned.exists());
    let plain = run(&[]);
    assert!(
        plain.stderr.contains("note: `out/grass.tuned.jsonc` is not of this study") && tuned.exists(),
        "{}",
        plain.stderr
    );
    let none = run(&["--tolerance", "1e-5"]);
    assert_eq!(none.code, Some(4));
    assert!(none.stderr.contains("removed `out/grass.tuned.jsonc`, which was of an earlier study"), "{}", none.stderr);
    assert!(!tuned.exists());
    // A file that no study wrote is left alone.
    bench.write("out/grass.tuned.jsonc", WALL);
    let none = run(&["--tolerance", "1e-5"]);
    assert!(none.stderr.contains("is not of this study; it was there before") && tuned.exists(), "{}", none.stderr);
}

#[test]
fn wrong_names_are_refused_with_what_was_meant() {
    let bench = Bench::with_graph(&WALL.replace("\"grass\": \"bent\"", "\"grass\": \"bent\", \"still\": \"put\""));
    let refused = |code: i32, args: &[&str], text: &str| {
        let output = if args.contains(&"--output") { &[][..] } else { &["--output", "grass"] };
        let ran = bench.run(&[&["study", "g.json"], args, output].concat());
        assert_eq!(ran.code, Some(code), "{}", ran.stderr);
        assert!(ran.stderr.contains(text), "{}", ran.stderr);
        assert!(!bench.path("out").join("grass.svg").exists());
    };
    refused(3, &["--knob", "bnt.rotation_steps=1,2"], "there is no node `bnt`; did you mean `bent`?");
    refused(3, &["--knob", "bent.rotatoin_steps=1,2"], "did you mean `rotation_steps`?");
    refused(2, &["--knob", "bent=1,2"], "`bent=1,2` is not a knob; write node.param=VALUE");
    refused(2, &["--knob", "blades.cvs=2,4", "--output", "still"], "the output `still` does not depend on `blades`");
    refused(2, &["--knob", STEPS, "--output", "fur"], "the graph has no output `fur`");
    refused(2, &["--knob", STEPS, "--norm", "bent.nothing"], "has no metric `nothing`; it has `");
    refused(2, &["--knob", STEPS, "--norm", "wind.max_angle"], "`wind.max_angle` does not depend on `bent`");
    refused(2, &["--knob", STEPS, "--norm", "heat"], "the output has no attribute `heat`");
    refused(2, &["--knob", STEPS, "--norm", "volum"], "no attribute `volum`; did you mean `volume`?");
    refused(
        3,
        &["--knob", "bent.rotation_steps=4,x"],
        "--knob bent.rotation_steps:1:1: nodes.bent.params.rotation_steps: found",
    );
    refused(3, &["--knob", "bent.rotation_steps=4,4.5"], "--knob bent.rotation_steps");
    refused(3, &["--knob", "bent.method=steps,exat"], "did you mean \"exact\"?");
    refused(2, &["--knob", "blades.cvs=2,4"], "use --norm surface");
}

#[test]
fn norms_of_surfaces_attributes_and_metrics_have_their_units() {
    let bench = Bench::with_graph(WALL);
    let surface = study(&bench, &["--knob", "blades.cvs=2,3", "--norm", "surface,max", "--tolerance", "9"]);
    assert_eq!(
        (&surface["norm"], &surface["unit"], surface["pick"].is_number()),
        (&json!("surface"), &json!("m"), true)
    );
    let metric = study(&bench, &["--knob", STEPS, "--norm", "bent.length_error"]);
    assert_eq!((&metric["norm"], &metric["unit"]), (&json!("bent.length_error"), &json!("")));
    let (attribute, points) = (study(&bench, &["--knob", STEPS, "--norm", "P"]), study(&bench, &["--knob", STEPS]));
    assert_eq!((&attribute["runs"][0]["error"], &attribute["floor"]), (&points["runs"][0]["error"], &points["floor"]));
}

#[test]
fn hairs_that_only_one_of_two_results_has_are_noted() {
    let bench = Bench::with_graph(WALL);
    let ran = bench.run(&["study", "g.json", "--knob", "blades.density=500,1000", "--repeats", "1"]);
    // The reference has a density of 2000: all of 1000 hairs, and half of 2000.
    let note = "note: only what both results have is compared, matched by its id: with blades.density=1000 that is ";
    let share = ran.stderr.split_once(note).unwrap_or_else(|| panic!("{}", ran.stderr)).1.split(' ').next().unwrap();
    assert!((share.parse::<f64>().unwrap() - 200.0 / 3.0).abs() < 3.0, "{share}");
    let ran = bench.run(&["study", "g.json", "--knob", STEPS, "--repeats", "1"]);
    assert!(!ran.stderr.contains("only what both"), "{}", ran.stderr);
}

#[test]
fn a_path_for_the_json_that_cannot_be_written_is_reported_before_the_runs() {
    let bench = Bench::with_graph(WALL);
    let ran = bench.run(&["study", "g.json", "--knob", STEPS, "--json", "missing/runs.json"]);
    assert!(ran.code == Some(1) && ran.stderr.contains("`missing/runs.json` could not be created"), "{}", ran.stderr);
    assert_eq!(bench.names("out"), [""; 0], "nothing was cooked");
}

#[test]
fn errors_do_not_depend_on_the_number_of_threads() {
    let bench = Bench::with_graph(WALL);
    let errors = |threads: &str| -> Vec<Value> {
        let found = study(&bench, &["--knob", STEPS, "--norm", "surface", "--threads", threads]);
        found["runs"]
            .as_array()
            .unwrap()
            .iter()
            .map(|run| run["error"].clone())
            .chain([found["floor"].clone()])
            .collect()
    };
    assert_eq!(errors("1"), errors("3"));
}

#[test]
fn several_knobs_make_a_grid_and_a_large_one_is_searched() {
    let bench = Bench::with_graph(WALL);
    let grid = study(&bench, &["--knob", "bent.rotation_steps=4,8", "--knob", "blades.length=[0.2,0.3],[0.2,0.25]"]);
    assert_eq!(grid["runs"].as_array().unwrap().len(), 4);
    assert_eq!(grid["runs"][1]["settings"], json!({"bent.rotation_steps": 4, "blades.length": [0.2, 0.25]}));
    let steps = (1..=13).map(|k| k.to_string()).collect::<Vec<_>>().join(",");
    let (a, b) = (format!("bent.rotation_steps={steps}"), "bent.gap=5e-4,4e-4,3e-4,2e-4,1e-4");
    let searched = study(&bench, &["--knob", &a, "--knob", b, "--frames", "1", "--tolerance", "1"]);
    let runs = searched["runs"].as_array().unwrap().len();
    // The best and the coarsest, which is within so wide a tolerance.
    assert!((2..6).contains(&runs) && searched["pick"].is_number(), "{runs} runs");
    let args = ["study", "g.json", "--knob", &a, "--knob", b, "--frames", "1", "--repeats", "1", "--quiet", "--fresh"];
    assert!(bench.done(&args).contains("a search: 17 of 65 settings were cooked"));
    // With a tolerance that only the best steps meet, a small grid is searched, too.
    let steps = study(&bench, &["--knob", STEPS, "--knob", "bent.gap=1e-4"]);
    let error = |run: usize| steps["runs"][run]["error"]["mean"].as_f64().unwrap();
    let between = (error(2) * error(3)).sqrt().to_string();
    let found = study(&bench, &["--knob", STEPS, "--knob", "bent.gap=5e-4,3e-4,1e-4", "--tolerance", &between]);
    let runs = found["runs"].as_array().unwrap();
    let pick = &runs[found["pick"].as_u64().unwrap() as usize];
    assert!(runs.len() < 8 && pick["error"]["mean"].as_f64().unwrap() <= between.parse().unwrap(), "{found}");
    assert_eq!(pick["settings"]["bent.rotation_steps"], json!(32));
    // Below the floor nothing can be claimed: only what gives the floor is cooked, where both knobs declare their fine end.
    let below = ["--knob", STEPS, "--knob", "blades.cvs=2,3,5", "--norm", "surface", "--tolerance", "1e-12"];
    let args = ["study", "g.json", "--json", "below.json", "--repeats", "1", "--quiet", "--fresh"];
    let ran = bench.run(&[&args[..], &below[..]].concat());
    assert!(ran.code == Some(4) && ran.stderr.contains("is below the floor"), "{}", ran.stderr);
    assert_eq!(bench.read_json("below.json")["runs"].as_array().unwrap().len(), 1);
}

/// The order of the errors e of curves with 2, 4 and 8 segments, against one of 32: e = C·|h² − 32⁻²|.
#[test]
fn the_error_of_curves_with_few_cvs_falls_with_the_square_of_their_segments() {
    let grass = r#"{ "convect": 1, "scene": { "frames": [1, 4] }, "nodes": {
        "ground": { "type": "Mesh_Primitive", "params": { "shape": "grid", "size": [0.4, 0, 0.4], "divisions": 1 } },
        "blades": { "type": "Curve_Scatter", "inputs": { "skin": "ground" },
                    "params": { "density": 200, "lean": 0, "length": [0.2, 0.3] } },
        "wind": { "type": "Curve_Wind", "inputs": { "curves": "blades" }, "params": { "mode": "resolution_free",
                  "wind_dir": [1, 0.1, 0.3], "global_rotate": { "expr": "0.3 + 0.02*frame" }, "noise": "none" } } },
        "outputs": { "grass": "wind" } }"#;
    let bench = Bench::with_graph(grass);
    let found = study(&bench, &["--knob", "blades.cvs=3,5,9,17", "--norm", "surface"]);
    assert_eq!(found["reference"]["settings"]["blades.cvs"], json!(33));
    let error = |run: usize| found["runs"][run]["error"]["mean"].as_f64().unwrap();
    for (run, segments) in [(0, 2.0_f64), (1, 4.0)] {
        let of = |segments: f64, order: f64| libm::pow(segments, -order) - libm::pow(32.0, -order);
        let ratio = error(run) / error(run + 1);
        let expected = [1.8, 2.2].map(|order| of(segments, order) / of(2.0 * segments, order));
        assert!(expected[0] < ratio && ratio < expected[1], "{ratio} {expected:?}");
    }
}

#[test]
fn finished_runs_are_kept_for_the_same_command_only() {
    let bench = Bench::with_graph(WALL);
    let run = |knob: &str| bench.run(&["study", "g.json", "--knob", knob, "--repeats", "1"]);
    let (first, again) = (run(STEPS), run(STEPS));
    assert!(again.stderr.contains("4 runs are taken from `out/grass.study`"), "{}", again.stderr);
    assert_eq!(first.stdout, again.stdout, "times too");
    assert!(!run("bent.rotation_steps=4,8").stderr.contains("are taken from"));
    bench.write("g.json", &WALL.replace("2000", "1500"));
    assert!(!run("bent.rotation_steps=4,8").stderr.contains("are taken from"));
}

#[cfg(unix)]
#[test]
fn ctrl_c_writes_what_was_measured_and_the_same_command_goes_on() {
    let bench = Bench::with_graph(WALL);
    let args = ["study", "g.json", "--knob", STEPS, "--json", "runs.json", "--repeats", "1000"];
    let child = bench.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for(1, &bench.path("out"));
    signal("INT", &child);
    let ran = Ran::of(&child.wait_with_output().unwrap());
    assert_eq!(ran.code, Some(130), "{}", ran.stderr);
    assert!(ran.stderr.contains("interrupted; 4 runs are kept") && ran.stdout.contains("floor: "), "{}", ran.stderr);
    assert_eq!(bench.read_json("runs.json")["runs"].as_array().unwrap().len(), 4);
    assert_eq!(bench.names("out"), ["grass.study", "grass.svg"], "and no temporaries");
    let ran = bench.run(&["study", "g.json", "--knob", STEPS, "--repeats", "1"]);
    assert!(ran.stderr.contains("4 runs are taken from"), "{}", ran.stderr);
}

#[test]
fn without_knobs_commands_for_those_of_the_graph_are_printed() {
    let bench = Bench::with_graph(WALL);
    let text = bench.done(&["study", "g.json"]);
    let command = text.lines().find(|line| line.contains("bent.rotation_steps=")).unwrap();
    assert!(text.contains("# rotation_steps of Curve_Wind_Collision, order 1\n"), "{text}");
    let asked = bench.run(&["study", "g.json", "--tolerance", "1e-3"]);
    assert_eq!((asked.code, &asked.stdout), (Some(0), &text));
    assert!(asked.stderr.contains("note: nothing is measured without --knob"), "{}", asked.stderr);
    let args: Vec<&str> = command.split(' ').skip(1).chain(["--frames", "1", "--repeats", "1", "--quiet"]).collect();
    assert!(bench.done(&args).contains("declared 1"));
}

#[test]
fn one_of_several_outputs_in_a_stage_is_studied_by_its_name() {
    let bench = Bench::with_graph(
        r#"{"convect": 1, "scene": {"frames": [1, 2]}, "nodes": {
            "grass": {"type": "Curve_In", "params": {"file": "grass.obj"}},
            "wind": {"type": "Curve_Wind", "inputs": {"curves": "grass"}}
        }, "outputs": {"set": ["grass", "wind"]}}"#,
    );
    let knob = ["study", "g.json", "--knob", "wind.octaves=1,2", "--output"];
    let ran = bench.run(&[&knob[..], &["set"]].concat());
    let line = "`set` has several outputs; write --output with one of `set/grass`, `set/wind`\n";
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(2), line));
    bench.done(&[&knob[..], &["set/wind"]].concat());
    assert!(bench.names("out").contains(&"set.wind.svg".to_owned()), "{:?}", bench.names("out"));
}
