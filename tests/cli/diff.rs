//! `diff`: exit code 0 for the same, 1 for different, 2 for an error.

use serde_json::json;

use crate::bench::Bench;

fn points(rows: &str) -> String {
    format!(r#"{{"points": {{"points": {rows}}}}}"#)
}

fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("a.json", &points("[[0, 0, 0], [1, 2, 3]]"));
    bench.write("b.json", &points("[[0, 0, 0], [1, 2.5, 3]]"));
    bench
}

fn ran(bench: &Bench, args: &[&str]) -> (Option<i32>, String) {
    let ran = bench.run(&[&["diff"], args].concat());
    assert!(ran.code == Some(2) || ran.stderr.is_empty(), "{}", ran.stderr);
    (ran.code, ran.stdout)
}

#[test]
fn a_geometry_is_the_same_as_itself_in_any_format_that_holds_it() {
    let bench = bench();
    for name in ["a.ply", "a.obj", "copy.json"] {
        bench.done(&["convert", "a.json", name]);
        assert_eq!(ran(&bench, &["a.json", name]), (Some(0), "the same\n".into()), "{name}");
    }
}

#[test]
fn differences_are_counted_measured_and_located() {
    let bench = bench();
    let line = "points: `P`: 1 of 6 numbers differ, by at most 0.5 (point 1) and 0.0833333 on average; \
                the first is point 1[1]: 2.0 and 2.5\ndifferent\n";
    assert_eq!(ran(&bench, &["a.json", "b.json"]), (Some(1), line.into()));
    let json = bench.run(&["diff", "a.json", "b.json", "--json"]);
    assert_eq!(json.code, Some(1));
    let json: serde_json::Value = serde_json::from_str(&json.stdout).unwrap();
    let finding = json!({
        "component": "points", "attribute": "P", "of": "point", "same": false, "numbers": 6, "differing": 1,
        "not_finite": 0, "largest": 0.5, "largest_row": 1, "mean": 0.5 / 6.0,
        "first": {"row": 1, "axis": 1, "values": [2.0, 2.5]},
    });
    let pair = json!({"a": "a.json", "b": "b.json", "same": false, "findings": [finding]});
    assert_eq!(json, json!({"same": false, "tolerance": null, "pairs": [pair]}));
}

#[test]
fn differences_within_the_tolerance_pass_and_are_still_reported() {
    let bench = bench();
    let same = "the same within 0.5; `P` of points differs by at most 0.5\n";
    assert_eq!(ran(&bench, &["a.json", "b.json", "--tolerance", "0.5"]), (Some(0), same.into()));
    assert_eq!(ran(&bench, &["a.json", "b.json", "--tolerance", "0.4"]).0, Some(1));
    let json = bench.json(&["diff", "a.json", "b.json", "--tolerance", "0.5", "--json"]);
    assert_eq!((&json["same"], &json["pairs"][0]["findings"][0]["largest"]), (&json!(true), &json!(0.5)));
}

#[test]
fn counts_and_components_and_attributes_of_one_side_are_reported() {
    let bench = bench();
    bench.write(
        "c.json",
        r#"{"points": {"points": [[0, 0, 0]], "point_attributes": {"id": [1]}},
        "curves": {"counts": [1], "points": [[0, 0, 0]]}}"#,
    );
    let lines = "curves: only in c.json\npoints: 2 points and 1\npoints: `id`: only in c.json\ndifferent\n";
    assert_eq!(ran(&bench, &["a.json", "c.json"]), (Some(1), lines.into()));
}

#[test]
fn folders_are_compared_file_by_file() {
    let bench = bench();
    for (folder, files) in [("x", ["f.0001.json", "f.0002.json"]), ("y", ["f.0001.json", "f.0003.json"])] {
        files.iter().for_each(|file| bench.write(&format!("{folder}/{file}"), &points("[[0, 0, 0]]")));
    }
    bench.write("y/preview.png", "no geometry");
    let lines = "x/f.0002.json: no file to compare it with\ny/f.0003.json: no file to compare it with\n\
                 different: 2 of 3 pairs\n";
    assert_eq!(ran(&bench, &["x", "y"]), (Some(1), lines.into()));
    assert_eq!(ran(&bench, &["x", "x"]), (Some(0), "the same\n".into()));
}

#[test]
fn two_cooks_are_compared_frame_by_frame_in_any_format() {
    let bench = Bench::new();
    for format in ["json", "ply"] {
        bench.done(&["cook", "g.json", "--format", format, "--out", format, "--output", "grass"]);
    }
    assert_eq!(ran(&bench, &["json/grass.####.json", "ply/grass.####.ply"]), (Some(0), "the same\n".into()));
}

#[test]
fn errors_of_diff_exit_with_2() {
    let bench = bench();
    bench.write("broken.obj", "v 0 0\n");
    for args in [["a.json", "missing.json"], ["broken.obj", "a.json"], ["a.json", "."], ["a.txt", "a.json"]] {
        let ran = bench.run(&["diff", args[0], args[1]]);
        assert_eq!((ran.code, ran.stdout.as_str()), (Some(2), ""), "{args:?}");
        assert_eq!(ran.stderr.lines().count(), 1, "{args:?}: {}", ran.stderr);
    }
}
