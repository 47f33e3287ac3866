//! Notes on stderr and in the report: conditions that are not errors but are easy to miss.

use serde_json::Value;

use crate::bench::{Bench, GRAPH};

/// The notes of a cook, which must be the same on stderr and in the report.
fn notes(bench: &Bench, args: &[&str]) -> Vec<String> {
    let ran = bench.run(&[&["cook", "g.json", "--report", "report.json"], args].concat());
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let printed: Vec<String> =
        ran.stderr.lines().filter_map(|line| line.strip_prefix("note: ").map(str::to_owned)).collect();
    let report = bench.read_json("report.json");
    let list = report["total"]["notes"].as_array().unwrap();
    assert_eq!(list.iter().map(|note| note.as_str().unwrap()).collect::<Vec<_>>(), printed);
    printed
}

/// Two curves with these params, bent by wind.
fn two_curves(params: &str, output: &str) -> Bench {
    Bench::with_graph(&format!(
        r#"{{"convect": 1, "scene": {{"frames": [1, 3]}}, "nodes": {{
            "two": {{"type": "Curve_In", "params": {{
                "points": [[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]], "counts": [2, 2], {params}}}}},
            "wind": {{"type": "Curve_Wind", "inputs": {{"curves": "two"}}}}
        }}, "outputs": {{"o": {output}}}}}"#
    ))
}

#[test]
fn an_attribute_of_the_wrong_owner_or_type_is_noted() {
    let bench = two_curves(r#""element_attributes": {"envelope": [0.0, 1.0]}"#, r#""wind""#);
    let expected = "`wind` (Curve_Wind) does not read `envelope` of the curves, which is one float for each curve; \
                    it reads one float for each CV";
    assert_eq!(notes(&bench, &[]), [expected]);
    let bench = two_curves(r#""attributes": {"envelope": [0.0, 1.0, 0.0, 1.0]}"#, r#""wind""#);
    assert_eq!(notes(&bench, &[]), [""; 0]);
}

#[test]
fn a_requested_attribute_that_no_frame_has_is_noted() {
    let attributes = r#""attributes": {"clumps": [0.0, 1.0, 2.0, 3.0], "gain": [0.0, 1.0, 2.0, 3.0]}"#;
    let bench = two_curves(attributes, r#"{"from": "wind", "attributes": ["P", "clump", "gain", "zebra"]}"#);
    let expected = [
        "output `o` requests the attribute `clump`, which it has at no frame; did you mean `clumps`?",
        "output `o` requests the attribute `zebra`, which it has at no frame",
    ];
    assert_eq!(notes(&bench, &[]), expected);
    assert_eq!(notes(&bench, &["--cache", "cache"]), expected);
    assert_eq!(notes(&bench, &["--cache", "cache"])[1], expected[1], "also for frames from disk");
}

#[test]
fn data_that_a_format_drops_is_noted_once_per_output() {
    let bench = two_curves(r#""attributes": {"gain": [0.0, 1.0, 2.0, 3.0]}, "width": 0.1"#, r#""wind""#);
    let expected = [
        "output `o` was written without `gain` of curves, `width` of curves, which obj cannot hold; usdc and json can",
    ];
    assert_eq!(notes(&bench, &["--format", "obj"]), expected);
    for format in ["ply", "json", "usdc"] {
        assert_eq!(notes(&bench, &["--format", format]), [""; 0], "{format}");
    }
    let bench = Bench::with_graph(
        r#"{"convect": 1, "nodes": {"none": {"type": "Curve_In", "params": {"points": []}}}, "outputs": {"o": "none"}}"#,
    );
    let expected =
        ["output `o` was written without the curves without a point, which ply cannot hold; usdc and json can"];
    assert_eq!(notes(&bench, &["--format", "ply"]), expected);
}

#[test]
fn a_warm_report_has_the_metrics_of_a_cold_one() {
    let graph = GRAPH.replace(r#""grass": "wind""#, r#""grass": { "from": "wind", "v": true }"#);
    let bench = Bench::with_graph(&graph);
    let cook = |name: &str, cache: &[&str]| {
        bench.done(&[&["cook", "g.json", "--output", "grass", "--report", name], cache].concat());
        bench.read_json(name)
    };
    let plain = cook("plain.json", &[]);
    let cold = cook("cold.json", &["--cache", "cache"]);
    let warm = cook("warm.json", &["--cache", "cache"]);
    let of = |report: &Value, node: &str, what: &str| report["nodes"][node][what].clone();
    for node in ["wind", "blades"] {
        assert_eq!(of(&cold, node, "metrics"), of(&plain, node, "metrics"));
        assert_eq!(of(&warm, node, "metrics"), of(&plain, node, "metrics"));
        assert_eq!((of(&cold, node, "from_disk"), of(&warm, node, "from_disk")), (0.into(), 4.into()));
    }
    assert_eq!((of(&warm, "wind", "cooks"), of(&warm, "wind", "from_cache")), (0.into(), 0.into()));
    assert_eq!(warm["total"]["from_disk"], 4);
    let more = cook("more.json", &["--cache", "cache", "--frames", "3-6"]);
    assert_eq!((of(&more, "wind", "from_disk"), of(&more, "wind", "cooks")), (2.into(), 6.into()), "{more}");
}
