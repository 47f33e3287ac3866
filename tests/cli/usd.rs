//! USD in: `stats`, `diff`, `convert` and the node Usd_In.

use serde_json::json;

use crate::bench::Bench;

#[test]
fn what_was_cooked_as_usd_is_measured_compared_and_converted() {
    let bench = Bench::new();
    bench.done(&["cook", "g.json"]);
    let stats = bench.json(&["stats", "out/grass.usdc", "--json"]);
    assert_eq!((&stats["format"], &stats["frame"], &stats["frames"]), (&json!("usdc"), &json!(1.0), &json!(4)));
    assert_eq!((&stats["curves"]["curves"], &stats["curves"]["points"]), (&json!(60), &json!(300)));
    assert!(bench.done(&["stats", "out/grass.usdc", "--frame", "3"]).contains("frame          3, of 4 with samples\n"));
    assert_eq!(bench.done(&["diff", "out/grass.usdc", "out/grass.usdc"]), "the same\n");

    bench.done(&["convert", "out/grass.usdc", "a.####.json"]);
    assert_eq!(bench.read_json("a.0004.json")["time"], json!(4.0 / 24.0));
    assert_eq!(bench.done(&["diff", "out/grass.usdc", "a.####.json"]), "the same\n");
    bench.done(&["convert", "a.####.json", "b.usda"]);
    assert_eq!(bench.done(&["diff", "b.usda", "out/grass.usdc"]), "the same\n");
    bench.done(&["convert", "b.usda", "c.usdc"]);
    assert_eq!(bench.done(&["diff", "c.usdc", "out/grass.usdc"]), "the same\n");

    std::fs::remove_file(bench.path("a.0002.json")).unwrap();
    let ran = bench.run(&["diff", "out/grass.usdc", "a.####.json"]);
    let expected = "out/grass.usdc at frame 2: no such frame in the other\ndifferent: 1 of 4 pairs\n";
    assert_eq!((ran.code, ran.stdout.as_str()), (Some(1), expected));
}

#[test]
fn a_graph_reads_usd_at_each_frame_and_between() {
    let bench = Bench::new();
    bench.done(&["cook", "g.json"]);
    bench.write(
        "in.json",
        r#"{"convect": 1, "scene": {"frames": [1, 4]}, "nodes": {
            "moving": {"type": "Usd_In", "params": {"file": "out/grass.usdc"}},
            "still": {"type": "Usd_In", "params": {"file": "out/still.usdc"}}
        }, "outputs": {"moving": "moving", "still": "still.curves"}}"#,
    );
    bench.done(&["cook", "in.json", "--out", "again", "--report", "report.json"]);
    assert_eq!(bench.done(&["diff", "out/grass.usdc", "again/moving.usdc"]), "the same\n");
    assert_eq!(bench.done(&["diff", "out/still.usdc", "again/still.usdc"]), "the same\n");
    let report = bench.read_json("report.json");
    // Sources are checked at the first frame, and that is kept. What does not move is not cooked again.
    let cooks = |node: &str| {
        report["nodes"][node]["cooks"].as_u64().unwrap() + report["nodes"][node]["from_cache"].as_u64().unwrap()
    };
    assert_eq!((cooks("moving"), cooks("still")), (4, 1));
    // Between two samples, halfway.
    bench.done(&["cook", "in.json", "--frames", "1.5", "--out", "half", "--format", "json", "--output", "moving"]);
    bench.done(&["convert", "out/grass.usdc", "a.####.json"]);
    let y = |file: &str| bench.read_json(file)["curves"]["points"][4][1].as_f64().unwrap();
    let [low, high, half] = ["a.0001.json", "a.0002.json", "half/moving.0001_5.json"].map(y);
    assert!((half - (low + high) / 2.0).abs() < 1e-6 && low != high);
}

#[test]
fn a_wire_that_the_file_does_not_have_is_refused() {
    let bench = Bench::new();
    bench.done(&["cook", "g.json"]);
    bench.write(
        "in.json",
        r#"{"convect": 1, "nodes": {
            "usd": {"type": "Usd_In", "params": {"file": "out/still.usdc"}},
            "tets": {"type": "Tetrahedralize", "inputs": {"surface": "usd.mesh"}}
        }, "outputs": {"body": "tets"}}"#,
    );
    let ran = bench.run(&["cook", "in.json"]);
    let expected = "the geometry of the input `surface` has no mesh; `convect stats FILE` prints what a file has";
    assert!(ran.stderr.contains(expected), "{}", ran.stderr);
    assert_eq!(ran.code, Some(4));
    let ran = bench.run(&["stats", "grass.obj", "--prim", "/a"]);
    assert_eq!(
        (ran.code, ran.stderr.as_str()),
        (Some(2), "`grass.obj` is no USD file, and only those have frames and prims\n")
    );
}

#[test]
fn usd_that_is_not_read_is_refused_with_what_to_type() {
    let bench = Bench::new();
    bench.write("a.usda", "#usda 1.0\ndef Scope \"a\" (inherits = </b>) {}\n");
    let line = "`a.usda`: `/a` has inherited classes, which are not read; flatten it first: usdcat --flatten -o out.usdc in.usd\n";
    for (args, code) in
        [(&["stats", "a.usda"][..], 1), (&["convert", "a.usda", "a.json"], 1), (&["diff", "a.usda", "a.usda"], 2)]
    {
        let ran = bench.run(args);
        assert_eq!((ran.code, ran.stderr.as_str()), (Some(code), line), "{args:?}");
    }
    bench.write("b.usda", "#usda 1.0\ndef Points \"p\" { point3f[] points = [(1, 2, 3)] }\ndef Cube \"c\" {}\n");
    let ran = bench.run(&["stats", "b.usda"]);
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(0), "note: `/c` is a Cube, which is not read\n"));
}

#[test]
fn frames_beyond_the_samples_of_a_file_are_noted() {
    let bench = Bench::new();
    bench.done(&["cook", "g.json", "--output", "grass"]);
    bench.write(
        "in.json",
        r#"{"convect": 1, "scene": {"frames": [1, 7]}, "nodes": {
            "fur": {"type": "Usd_In", "params": {"file": "out/grass.usdc"}}}, "outputs": {"fur": "fur"}}"#,
    );
    let ran = bench.run(&["cook", "in.json", "--out", "again"]);
    let note = "note: `fur` (Usd_In): `held` is 3 frame at frame 7 (frames 5-7). The file has no samples there, so its first or \
                last pose is held. `convect stats FILE` says how many it has. Set `frame`, or cook other frames.\n";
    assert_eq!((ran.code, ran.stderr.matches("`held`").count()), (Some(0), 1), "{}", ran.stderr);
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    let ran = bench.run(&["cook", "in.json", "--frames", "1-4", "--strict"]);
    assert!(!ran.stderr.contains("`held`"), "{}", ran.stderr);
}

#[test]
fn components_that_no_node_reads_are_noted() {
    let both = r#"{"frame": 1, "time": 0, "curves": {"counts": [2], "points": [[0, 0, 0], [0, 1, 0]]},
        "mesh": {"counts": [3], "indices": [0, 1, 2], "points": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}}"#;
    let said = |nodes: &str, outputs: &str| {
        let bench = Bench::with_graph(&format!(r#"{{"convect": 1, "nodes": {{{nodes}}}, "outputs": {{{outputs}}}}}"#));
        bench.write("both.json", both);
        bench.done(&["convert", "both.json", "both.usdc"]);
        let ran = bench.run(&["cook", "g.json", "--no-write"]);
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        ran.stderr.lines().find(|line| line.contains("components")).map(str::to_owned)
    };
    let fur = r#""fur": {"type": "Curve_In", "params": {"file": "both.json"}}"#;
    let skin = r#""skin": {"type": "Mesh_In", "params": {"file": "both.json"}}"#;
    let usd = r#""usd": {"type": "Usd_In", "params": {"file": "both.usdc"}}"#;
    let expected = "note: `fur` (Curve_In): `both.json` has 2 components, of which curves is read. `convect stats both.json` lists \
                    them. Curve_In, Mesh_In, Point_In and Tet_In read one each; Usd_In has an output for each, and reads less with \
                    `prim`.";
    assert_eq!(said(fur, r#""fur": "fur""#).as_deref(), Some(expected));
    assert_eq!(said(&format!("{fur}, {skin}"), r#""fur": "fur", "skin": "skin""#), None);
    let note = said(usd, r#""skin": "usd.mesh""#).unwrap();
    assert!(note.starts_with("note: `usd` (Usd_In): `both.usdc` has 2 components, of which mesh is read."), "{note}");
    assert_eq!(said(usd, r#""set": ["usd.mesh", "usd.curves"]"#), None);
}

#[test]
fn what_a_file_hides_at_times_is_nothing_there() {
    let bench = Bench::with_graph(
        r#"{"convect": 1, "scene": {"frames": [1, 6]}, "nodes": {"a": {"type": "Usd_In", "params": {"file": "in.usda"}}},
            "outputs": {"a": "a"}}"#,
    );
    bench.write(
        "in.usda",
        "#usda 1.0\n(\n metersPerUnit = 1\n upAxis = \"Y\"\n)\ndef BasisCurves \"fur\" {\n uniform token type = \"linear\"\n \
         token visibility.timeSamples = { 1: \"inherited\", 3: \"invisible\", 5: \"inherited\" }\n \
         int[] curveVertexCounts = [2]\n point3f[] points = [(0, 0, 0), (0, 1, 0)]\n float[] widths = [0.1, 0.1]\n}\n",
    );
    let ran = bench.run(&["cook", "g.json", "--format", "json"]);
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert!(ran.stderr.contains("`left_out` is 1 at frame 3 (frames 3-4)"), "{}", ran.stderr);
    let has_curves = |frame: u32| bench.read_json(&format!("out/a.000{frame}.json")).get("curves").is_some();
    assert_eq!([1, 2, 3, 4, 5, 6].map(has_curves), [true, true, false, false, true, true]);
    let stats = bench.run(&["stats", "in.usda", "--frame", "3"]);
    assert_eq!(stats.stderr, "note: `/fur` is invisible at this time, so it is not read here\n");
}

#[test]
fn a_number_that_is_not_finite_is_refused_by_file_attribute_and_row() {
    let bench = Bench::with_graph(
        r#"{"convect": 1, "nodes": {"a": {"type": "Usd_In", "params": {"file": "in.usda"}}}, "outputs": {"a": "a"}}"#,
    );
    let text =
        "#usda 1.0\n(\n metersPerUnit = 1\n)\ndef Points \"p\" {\n point3f[] points = [(0, 0, 0), (0, nan, 0)]\n}\n";
    bench.write("in.usda", text);
    let ran = bench.run(&["cook", "g.json"]);
    let expected = "g.json:1:69: nodes.a.params.file: `in.usda` has a NaN or infinity: `P` of the points at index 1, counted from 0; \
                    `convect stats FILE --frame F` counts NaNs and infinities by attribute; repair the file, or name a `prim` without any\n";
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(1), expected));
}
