//! `convert`: single files and sequences.

use serde_json::json;

use crate::bench::Bench;

#[test]
fn geometry_survives_a_round_trip_through_every_readable_format() {
    let bench = Bench::new();
    for (from, to) in [("grass.obj", "a.ply"), ("a.ply", "b.json"), ("b.json", "c.obj")] {
        let ran = bench.run(&["convert", from, to]);
        assert_eq!((ran.code, ran.stdout.as_str()), (Some(0), ""), "{}", ran.stderr);
        assert!(ran.stderr.starts_with(&format!("wrote {to}: 1 frame, ")), "{}", ran.stderr);
    }
    assert_eq!(bench.done(&["diff", "grass.obj", "c.obj"]), "the same\n");
}

#[test]
fn data_that_a_format_drops_is_noted() {
    let bench = Bench::new();
    bench.write("a.json", r#"{"points": {"points": [[0, 0, 0]], "point_attributes": {"heat": [1.5]}}}"#);
    let ran = bench.run(&["convert", "a.json", "a.obj"]);
    assert_eq!(ran.stderr.lines().nth(1), Some("note: written without `heat` of points, which the format cannot hold"));
    assert_eq!(bench.run(&["convert", "a.json", "a.obj", "--quiet"]).stderr, "");
}

#[test]
fn a_component_that_the_target_cannot_hold_is_refused_and_nothing_written() {
    let bench = Bench::new();
    bench.write(
        "t.json",
        r#"{"tets": {"indices": [[0, 1, 2, 3]],
        "points": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]}}"#,
    );
    for target in ["t.obj", "t.ply"] {
        let ran = bench.run(&["convert", "t.json", target]);
        let format = &target[2..];
        let line = format!("`t.json`: {format} cannot hold tets; formats that can: usdc, usda, json\n");
        assert_eq!((ran.code, ran.stderr), (Some(1), line));
    }
    assert_eq!(bench.names(""), ["g.json", "grass.obj", "t.json"]);
    bench.done(&["convert", "t.json", "t.usda"]);
}

#[test]
fn the_frame_is_the_number_in_the_name() {
    let bench = Bench::new();
    bench.write("a.0012_5.json", r#"{"points": {"points": [[0, 0, 0]]}}"#);
    bench.done(&["convert", "a.0012_5.json", "b.json", "--fps", "25"]);
    let file = bench.read_json("b.json");
    assert_eq!((&file["frame"], &file["time"]), (&json!(12.5), &json!(0.5)));
    bench.done(&["convert", "a.0012_5.json", "c.usda"]);
    let text = std::fs::read_to_string(bench.path("c.usda")).unwrap();
    assert!(text.contains("startTimeCode = 12.5") && text.contains("defaultPrim = \"c\""), "{text}");
    bench.done(&["convert", "grass.obj", "d.json"]);
    assert_eq!(bench.read_json("d.json")["frame"], json!(1));
    bench.done(&["convert", "a.0012_5.json", "e.###.obj"]);
    assert!(bench.names("").contains(&"e.012_5.obj".to_owned()));
}

#[test]
fn a_sequence_becomes_one_file_or_one_file_per_frame() {
    let bench = Bench::new();
    bench.done(&["cook", "g.json", "--format", "json", "--output", "grass"]);
    bench.done(&["cook", "g.json", "--format", "usdc", "--output", "grass", "--out", "usd"]);
    bench.done(&["convert", "out/grass.####.json", "grass.usdc"]);
    assert!(
        bench.files("usd")["grass.usdc"] == std::fs::read(bench.path("grass.usdc")).unwrap(),
        "the same as written by cook"
    );
    bench.done(&["convert", "out/grass.####.json", "ply/g_##.ply"]);
    assert_eq!(bench.names("ply"), ["g_01.ply", "g_02.ply", "g_03.ply", "g_04.ply"]);
    assert_eq!(bench.done(&["diff", "out/grass.####.json", "ply/g_##.ply"]), "the same\n");
    bench.done(&["convert", "out/grass.####.json", "each/grass.####.usdc"]);
    assert_eq!(bench.names("each").len(), 4);
}

#[test]
fn a_sequence_without_a_valid_target_or_files_is_refused() {
    let bench = Bench::new();
    bench.done(&["cook", "g.json", "--format", "json", "--output", "grass"]);
    let ran = bench.run(&["convert", "out/grass.####.json", "all.ply"]);
    let line = "cannot convert 4 files to one ply file; write all.####.ply\n";
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(2), line));
    let ran = bench.run(&["convert", "out/fur.####.json", "fur.usdc"]);
    let line = "no file matches `out/fur.####.json`\n";
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(1), line));
    bench.write("file", "");
    let ran = bench.run(&["convert", "out/grass.####.json", "file/grass.####.ply"]);
    assert_eq!(ran.code, Some(1));
    assert!(ran.stderr.starts_with("`file` could not be created: "), "{}", ran.stderr);
}

#[test]
fn conversion_scales_lengths() {
    let bench = Bench::new();
    bench.write(
        "a.json",
        r#"{"points": {"points": [[100, 0, 50]],
        "point_attributes": {"v": [[200, 0, 0]], "width": [10], "heat": [3.5]}}}"#,
    );
    bench.done(&["convert", "a.json", "b.json", "--scale", "0.01"]);
    let points = &bench.read_json("b.json")["points"];
    let expected = json!({"v": [[2.0, 0.0, 0.0]], "width": [0.1], "heat": [3.5]});
    assert_eq!((&points["points"], &points["point_attributes"]), (&json!([[1.0, 0.0, 0.5]]), &expected));
    let ran = bench.run(&["convert", "a.json", "c.usdc", "--scale", "1e37"]);
    let line = "`a.json`: `P` of points scaled by 1e37 is out of the range of f32\n";
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(1), line));
}

#[test]
fn a_folder_is_read_as_the_sequence_in_it() {
    let bench = Bench::new();
    bench.done(&["cook", "g.json", "--format", "json", "--output", "grass"]);
    bench.write("out/notes.txt", "not geometry");
    bench.done(&["convert", "out", "new/folder/g.####.ply"]);
    assert_eq!(bench.names("new/folder"), ["g.0001.ply", "g.0002.ply", "g.0003.ply", "g.0004.ply"]);
    bench.done(&["convert", "out", "grass.usdc"]);
    bench.done(&["convert", "out/grass.####.json", "same/grass.usdc"]);
    assert!(bench.files("same")["grass.usdc"] == std::fs::read(bench.path("grass.usdc")).unwrap());
    bench.write("out/still.obj", "v 0 0 0");
    let ran = bench.run(&["convert", "out", "all.usdc"]);
    let line = "`out` holds several sequences; convert one of `out/grass.####.json`, `out/still.obj`\n";
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(2), line));
    std::fs::create_dir(bench.path("empty")).unwrap();
    let ran = bench.run(&["convert", "empty", "all.usdc"]);
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(1), "`empty` holds no obj, ply or json file\n"));
}
