//! Successful cooks: files and their names, frames, settings, the report.

use std::fs;

use serde_json::json;

use crate::bench::{Bench, GRAPH, Ran};

fn cooked(args: &[&str]) -> Vec<String> {
    let bench = Bench::new();
    bench.done(&[&["cook", "g.json", "--output", "grass"], args].concat());
    bench.names("out")
}

#[test]
fn by_default_all_outputs_are_written_as_usdc_to_out() {
    let bench = Bench::new();
    let ran = bench.run(&["cook", "g.json"]);
    assert_eq!((ran.code, ran.stdout.as_str()), (Some(0), ""), "stdout carries data only");
    assert!(ran.stderr.contains("wrote out/grass.usdc: 4 frames"), "{}", ran.stderr);
    assert_eq!(bench.names("out"), ["grass.usdc", "still.usdc"]);
    assert_eq!(&bench.files("out")["grass.usdc"][..8], b"PXR-USDC");
    assert_eq!(bench.names(""), ["g.json", "grass.obj", "out"]);
}

#[test]
fn every_format_has_its_files() {
    assert_eq!(cooked(&["--format", "usda"]), ["grass.usda"]);
    for format in ["obj", "ply", "json"] {
        let expected: Vec<String> = (1..=4).map(|frame| format!("grass.000{frame}.{format}")).collect();
        assert_eq!(cooked(&["--format", format]), expected);
    }
}

#[test]
fn frames_are_ranges_steps_and_fractions() {
    let files = |frames: &str| cooked(&["--format", "json", "--frames", frames]).join(" ").replace(".json", "");
    assert_eq!(files("3"), "grass.0003");
    assert_eq!(files("1-4x2"), "grass.0001 grass.0003");
    assert_eq!(files("10.5"), "grass.0010_5");
    assert_eq!(files("1-2x0.25"), "grass.0001 grass.0001_25 grass.0001_5 grass.0001_75 grass.0002");
    assert_eq!(files("-1-1"), "grass.-0001 grass.0000 grass.0001");
    assert_eq!(files("4,1-2"), "grass.0001 grass.0002 grass.0004");
    assert_eq!(files("12345"), "grass.12345");
    assert_eq!(files("3-"), "grass.0003 grass.0004");
}

#[test]
fn a_json_file_contains_its_frame_and_time() {
    let bench = Bench::new();
    bench.done(&["cook", "g.json", "--format", "json", "--frames", "10.5"]);
    let file = bench.read_json("out/grass.0010_5.json");
    assert_eq!((&file["frame"], &file["time"]), (&json!(10.5), &json!(0.4375)));
    assert_eq!(file["curves"]["counts"], json!(vec![5; 60]));
}

#[test]
fn outputs_are_selected_by_name_and_folders_are_created() {
    let bench = Bench::new();
    bench.done(&["cook", "g.json", "--output", "still", "--out", "a/b", "--format", "obj", "--frames", "1"]);
    assert_eq!(bench.names("a/b"), ["still.0001.obj"]);
}

#[test]
fn quiet_prints_nothing_and_verbose_more() {
    let bench = Bench::new();
    assert_eq!(bench.run(&["cook", "g.json", "-q"]).stderr, "");
    assert!(bench.run(&["cook", "g.json", "-v"]).stderr.contains("wind (Curve_Wind): 4 cooked"));
}

#[test]
fn params_and_controls_are_set_from_the_command_line() {
    let bench = Bench::new();
    let cook = |out: &str, set: &[&str]| {
        let args = ["cook", "g.json", "--format", "json", "--frames", "2", "--out", out];
        bench.done(&[&args, set].concat());
        bench.read_json(&format!("{out}/grass.0002.json"))["curves"].clone()
    };
    let plain = cook("plain", &[]);
    assert_eq!(cook("same", &["--set", "wind_dir=[1, 0, 0.2]"]), plain);
    assert_ne!(cook("control", &["--set", "wind_dir=[0, 0, -1]"]), plain);
    let still = cook("still", &["--set", "wind.global_rotate=0", "--set", "blades.scale=2"]);
    assert_eq!(still["points"][4], json!([0.0, 0.5, 0.0]), "no wind, twice as long");
}

#[test]
fn words_are_set_without_quotes() {
    let bench = Bench::new();
    let cook = |out: &str, noise: &str| {
        let set = format!("wind.noise={noise}");
        bench.done(&["cook", "g.json", "--format", "json", "--frames", "2", "--out", out, "--set", &set]);
        bench.read_json(&format!("{out}/grass.0002.json"))["curves"].clone()
    };
    assert_eq!(cook("bare", "billow"), cook("quoted", "\"billow\""));
    assert_ne!(cook("bare", "billow"), cook("none", "none"));
    let ran = bench.run(&["check", "g.json", "--set", "wind.noise=bilow"]);
    assert!(ran.stderr.contains("unknown option \"bilow\"; did you mean \"billow\"?"), "{}", ran.stderr);
    let ran = bench.run(&["check", "g.json", "--set", "wind.wind_dir=[1, 0"]);
    assert_eq!(ran.code, Some(3), "a list that does not end is not a word: {}", ran.stderr);
}

#[test]
fn a_graph_is_read_from_stdin_and_a_report_written_to_stdout() {
    let bench = Bench::new();
    let run = |args: &[&str]| {
        let graph = std::fs::File::open(bench.path("g.json")).unwrap();
        Ran::of(&bench.command(args).stdin(graph).output().unwrap())
    };
    let ran = run(&["cook", "-", "--no-write", "--report", "-"]);
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let report: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!((&report["graph"], &report["outputs"]["grass"]["frames"]), (&json!("stdin"), &json!(4)));
    assert_eq!(report["outputs"]["grass"]["files"], json!([]));
    assert_eq!(bench.names(""), ["g.json", "grass.obj"], "nothing is written");
    assert!(ran.stderr.contains("cooked 4 frames"), "{}", ran.stderr);
    assert_eq!(run(&["check", "-"]).code, Some(0));
    for verb in ["check", "cook", "explain"] {
        let ran = run(&[verb, "-", "--set", "blades.file=none.obj"]);
        let expected = "`none.obj` does not exist; paths of a graph from stdin are relative to the current folder\n";
        assert!(ran.code == Some(1) && ran.stderr.ends_with(expected), "{verb}: {}", ran.stderr);
    }
    let ran = run(&["check", "-", "--set", "wind.nose=1"]);
    assert!(ran.stderr.starts_with("--set wind.nose:1:1: "), "{}", ran.stderr);
    bench.write("g.json", "{");
    assert!(run(&["explain", "-"]).stderr.starts_with("stdin:1:"));
}

#[test]
fn without_writing_pictures_are_drawn_and_errors_found() {
    let bench = Bench::with_graph(crate::bench::CALM_AT_2);
    let ran = bench.run(&["cook", "g.json", "--no-write", "--frames", "1-2", "--format", "obj"]);
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
    assert!(!ran.stderr.contains("written"), "no file was to be written: {}", ran.stderr);
    assert_eq!(bench.names(""), ["g.json", "grass.obj"]);
    bench.done(&["cook", "g.json", "--no-write", "--frames", "1", "--preview"]);
    assert_eq!(bench.names("out"), ["g.preview.png"]);
}

/// Curves of a file sequence of which only the later files have widths: every part declares them alike, so that a clip of
/// one can follow that of another.
#[test]
fn parts_of_which_some_have_widths_declare_them_alike() {
    let bench = Bench::with_graph(
        r#"{"convect": 1, "scene": {"frames": [1, 4]}, "nodes": {
            "in": {"type": "Curve_In", "params": {"file": "c.####.json", "frame": {"expr": "frame"}}}
        }, "outputs": {"o": "in"}}"#,
    );
    for frame in 1..=4 {
        let width = if frame < 3 { "" } else { r#", "point_attributes": {"width": [0.5, 0.25]}"# };
        let curves = format!(r#""counts": [2], "points": [[0.0, 0.0, 0.0], [0.0, 1.0, {frame}.0]]{width}"#);
        bench.write(&format!("c.{frame:04}.json"), &format!(r#"{{"frame": {frame}, "curves": {{{curves}}}}}"#));
    }
    let part = |frames: &str| {
        bench.done(&["cook", "g.json", "--format", "usda", "--part", frames]);
        std::fs::read_to_string(bench.path("out/o.usda")).unwrap()
    };
    let widths = |text: &str| {
        let from = text.find("float[] widths.timeSamples").unwrap_or_else(|| panic!("{text}"));
        let end = text[from..].find('}').unwrap() + from;
        text[from..end].split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let interpolation = |text: &str| {
        text[text.find("float[] widths").unwrap()..]
            .lines()
            .take(4)
            .any(|line| line.contains(r#"interpolation = "vertex""#))
    };
    let (bare, mixed, wide) = (part("1-2"), part("2-3"), part("3-4"));
    assert_eq!(widths(&bare), "float[] widths.timeSamples = { 1: [0.001, 0.001], 2: [0.001, 0.001],");
    assert_eq!(widths(&mixed), "float[] widths.timeSamples = { 2: [0.001, 0.001], 3: [0.5, 0.25],");
    assert_eq!(widths(&wide), "float[] widths.timeSamples = { 3: [0.5, 0.25], 4: [0.5, 0.25],");
    assert!([&bare, &mixed, &wide].into_iter().all(|text| interpolation(text)), "{bare}");
}

/// What is constant in a part but not in the scene has time samples; what is still has none.
#[test]
fn a_part_samples_whatever_varies_over_the_scene() {
    let bench = Bench::new();
    let graph = GRAPH.replace(
        r#""global_rotate": { "expr": "0.4 + 0.1*sin(2*pi*time)" }"#,
        r#""global_rotate": { "keyframes": [[2, 0.1], [3, 1]] }, "amplitude": 0"#,
    );
    bench.write("g.json", &graph);
    let text = |file: &str| String::from_utf8(bench.files("out")[file].clone()).unwrap();
    bench.done(&["cook", "g.json", "--format", "usda", "--frames", "1-2"]);
    assert!(!text("grass.usda").contains("points.timeSamples"), "constant in these frames");
    bench.done(&["cook", "g.json", "--format", "usda", "--part", "1-2"]);
    let part = text("grass.usda");
    assert!(part.contains("points.timeSamples") && part.contains("curveVertexCounts.timeSamples"), "{part}");
    assert!(!text("still.usda").contains("timeSamples"));
    let ran = bench.run(&["cook", "g.json", "--part", "1-2", "--frames", "1"]);
    assert_eq!(ran.code, Some(2));
}

#[test]
fn the_report_is_as_documented() {
    let bench = Bench::new();
    let set = ["--set", "wind.amplitude=0", "--report", "report.json"];
    bench.done(&[&["cook", "g.json", "--format", "json", "--output", "grass", "--frames", "1-2"], &set[..]].concat());
    let report = bench.read_json("report.json");
    let keys = |value: &serde_json::Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(keys(&report), ["report", "graph", "recipe", "frames", "nodes", "outputs", "notes", "total"]);
    assert_eq!((&report["report"], &report["frames"]), (&json!(1), &json!([1, 2])));
    let wind = &report["nodes"]["wind"];
    let documented = ["type", "time", "cooks", "from_cache", "left_out", "wall_ms", "cpu_ms", "peak_bytes", "metrics"];
    documented.iter().for_each(|key| assert!(!wind[key].is_null(), "`{key}` in {wind}"));
    assert_eq!((&wind["type"], &wind["time"], &wind["cooks"]), (&json!("Curve_Wind"), &json!("frame"), &json!(2)));
    assert_eq!(keys(&wind["metrics"]["max_angle"]), ["1", "2"], "one value per frame");
    assert!(keys(&wind["left_out"][0]).iter().eq(&["stage", "why"]), "{wind}");
    let grass = &report["outputs"]["grass"];
    assert_eq!((&grass["from"], &grass["frames"], &grass["errors"]), (&json!("wind"), &json!(2), &json!([])));
    assert_eq!(grass["files"], json!(["out/grass.0001.json", "out/grass.0002.json"]));
    let bytes: u64 = bench.files("out").values().map(|file| file.len() as u64).sum();
    assert_eq!(grass["bytes"], json!(bytes));
    assert_eq!(bench.names("out"), ["grass.0001.json", "grass.0002.json"]);
    // Frame 10 comes after frame 2.
    bench.done(&[&["cook", "g.json", "--no-write", "--output", "grass", "--frames", "1-11"], &set[..]].concat());
    let angles = &bench.read_json("report.json")["nodes"]["wind"]["metrics"]["max_angle"];
    assert_eq!(keys(angles), (1..=11).map(|frame| frame.to_string()).collect::<Vec<_>>());
}

/// A tool that reads a metric at a frame finds it at every frame: under the frame, or under `still`.
#[test]
fn metrics_of_a_still_node_are_not_those_of_one_frame() {
    let bench = Bench::with_graph(
        r#"{"convect": 1, "scene": {"frames": [1, 3]}, "nodes": {
            "ball": {"type": "Mesh_Primitive", "params": {"shape": "sphere", "divisions": 6}},
            "tets": {"type": "Tetrahedralize", "inputs": {"surface": "ball"}}}, "outputs": {"o": "tets"}}"#,
    );
    for frames in ["1-3", "2"] {
        bench.done(&["cook", "g.json", "--frames", frames, "--report", "r.json"]);
        let tets = bench.read_json("r.json")["nodes"]["tets"].clone();
        assert_eq!(tets["varies"], json!(false));
        let counts = tets["metrics"]["tets"].as_object().unwrap();
        assert_eq!(counts.keys().collect::<Vec<_>>(), ["still"], "{counts:?}");
        assert!(counts["still"].as_f64().unwrap() > 10.0);
    }
}

#[test]
fn existing_files_are_replaced() {
    let bench = Bench::new();
    bench.write("out/grass.usdc", "old");
    bench.write("out/other.txt", "kept");
    bench.done(&["cook", "g.json", "--output", "grass"]);
    assert_eq!(bench.names("out"), ["grass.usdc", "other.txt"]);
    assert!(fs::read(bench.path("out/grass.usdc")).unwrap().starts_with(b"PXR-USDC"));
}

#[test]
fn code_reads_controls_and_its_faults_have_line_and_column() {
    let graph = r#"{
  "convect": 1,
  "scene": { "frames": [1, 3] },
  "controls": { "gain": { "keyframes": [[1, 1], [3, 3]] } },
  "nodes": {
    "one": { "type": "Curve_In", "params": { "points": [[0, 0, 0], [0, 2, 0]] } },
    "code": { "type": "Attribute_Expr", "inputs": { "geometry": "one" },
              "params": { "code": "let h = P.y\nP.x = gain*h" } }
  },
  "outputs": { "o": "code" }
}"#;
    let bench = Bench::with_graph(graph);
    bench.done(&["cook", "g.json", "--format", "json"]);
    let tip = |frame: u32| bench.read_json(&format!("out/o.000{frame}.json"))["curves"]["points"][1][0].clone();
    assert_eq!([tip(1), tip(2), tip(3)], [json!(2.0), json!(4.0), json!(6.0)]);
    bench.write("g.json", &graph.replace("gain*h", "gan*h + "));
    let expected =
        "g.json:8:63: nodes.code.params.code: expected a value, found the end, at line 2, column 15 of the code\n";
    assert_eq!(bench.run(&["check", "g.json"]).stderr, expected);
}

#[test]
fn curves_on_a_moving_skin_have_velocities() {
    let bench = Bench::with_graph(
        r#"{"convect": 1, "scene": {"frames": [1, 3], "fps": 10}, "nodes": {
        "ground": {"type": "Mesh_Primitive", "params": {"shape": "grid", "size": [1, 1, 1]}},
        "moved": {"type": "Transform", "inputs": {"geometry": "ground"},
                  "params": {"translate": {"keyframes": [[1, [0, 0, 0]], [3, [2, 0, 0]]]}}},
        "hair": {"type": "Curve_Scatter", "inputs": {"skin": "moved"}, "params": {"density": 10}}
        }, "outputs": {"o": {"from": "hair", "v": true}}}"#,
    );
    bench.done(&["cook", "g.json", "--format", "json"]);
    let v = bench.read_json("out/o.0002.json")["curves"]["point_attributes"]["v"][0].clone();
    assert!((v[0].as_f64().unwrap() - 10.0).abs() < 1e-4, "1 m per frame, 10 frames per second: {v}");
}

/// y = f² ÷ 100 at whole frames and on a line between them, so (f + 1)² − (f − 1)² ÷ 2 = 2f a frame, at 10 frames per second;
/// 4 − 1 and 16 − 9 at the ends.
#[test]
fn points_of_a_sequence_of_files_go_evenly_from_frame_to_frame() {
    let graph = r#"{"convect": 1, "scene": {"frames": [1, 4], "fps": 10}, "nodes": {
        "in": {"type": "Mesh_In", "params": {"file": "m.####.obj"}},
        "moved": {"type": "Transform", "inputs": {"geometry": "in"}, "params": {"translate": [1, 0, 0]}}
        }, "outputs": {"o": {"from": "moved", "v": true}}}"#;
    let bench = Bench::with_graph(graph);
    let write = |frame: i32, faces: &str| {
        let y = f64::from(frame * frame) / 100.0;
        bench.write(&format!("m.{frame:04}.obj"), &format!("v 0 {y} 0\nv 1 {y} 0\nv 0 {y} 1\n{faces}\n"));
    };
    (1..=4).for_each(|frame| write(frame, "f 1 2 3"));
    let y = |file: &str, attribute: &str| {
        let mesh = &bench.read_json(file)["mesh"];
        let rows = if attribute == "P" { &mesh["points"] } else { &mesh["point_attributes"]["v"] };
        rows[0][1].as_f64().unwrap()
    };
    bench.done(&["cook", "g.json", "--format", "json"]);
    for (frame, expected) in [(1, 0.3), (2, 0.4), (3, 0.6), (4, 0.7)] {
        let v = y(&format!("out/o.000{frame}.json"), "v");
        assert!((v - expected).abs() < 1e-5, "frame {frame}: {v}");
    }
    bench.done(&["cook", "g.json", "--format", "json", "--frames", "2-4x0.25", "--out", "sub"]);
    for (file, expected) in [("2", 0.04), ("2_25", 0.0525), ("2_5", 0.065), ("3_75", 0.1425), ("4", 0.16)] {
        let found = y(&format!("sub/o.000{file}.json"), "P");
        assert!((found - expected).abs() < 1e-6, "frame {file}: {found}");
    }
    // Other faces are another mesh: until its frame the one before it stays.
    write(3, "f 1 3 2");
    let args = ["cook", "g.json", "--format", "json", "--frames", "2.5", "--out", "held"];
    assert!(bench.run(&args).stderr.contains("its mesh: other points or faces half a frame away"));
    bench.write("g.json", &graph.replace(r#", "v": true"#, ""));
    bench.done(&args);
    assert!((y("held/o.0002_5.json", "P") - 0.04).abs() < 1e-6);
}
