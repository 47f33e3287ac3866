//! Faults that `check` finds without cooking: inline geometry, files of a sequence, animated params.

use crate::bench::{Bench, CALM_AT_2, Ran};

fn check(bench: &Bench) -> Ran {
    bench.run(&["check", "g.json"])
}

/// The exit code and first message of `check` for one node with these params.
fn checked(kind: &str, params: &str) -> (Option<i32>, String) {
    let graph = format!(
        r#"{{"convect": 1, "nodes": {{"a": {{"type": "{kind}", "params": {{{params}}}}}}}, "outputs": {{"o": "a"}}}}"#
    );
    let ran = check(&Bench::with_graph(&graph));
    let line = ran.stderr.lines().next().unwrap_or_default();
    (ran.code, line.split_once(": ").map_or("", |(_, rest)| rest).to_owned())
}

#[test]
fn a_frame_number_of_any_width_is_a_missing_file() {
    for width in [300, 65_535, 65_536] {
        let (code, message) = checked("Curve_In", &format!(r#""file": "{}""#, "#".repeat(width)));
        assert_eq!(code, Some(1), "{width}: {message}");
        assert!(message.starts_with("nodes.a.params.file: "), "{message}");
    }
}

/// The exit code and first message of `check` for nodes after curves with a float, a vector and a number for each curve.
fn checked_chain(nodes: &str) -> (Option<i32>, String) {
    let graph = format!(
        r#"{{"convect": 1, "nodes": {{
            "fur": {{"type": "Curve_In", "params": {{"points": [[0, 0, 0], [0, 1, 0]], "counts": [2],
                "attributes": {{"soft": [0.5, 1.0], "Cd": [[1, 0, 0.5], [0, 1, 0]]}}}}}},
            "same": {{"type": "Transform", "inputs": {{"geometry": "fur"}}}},
            {nodes}}}, "outputs": {{"o": "a"}}}}"#
    );
    let bench = Bench::with_graph(&graph);
    let ran = check(&bench);
    let cooked = bench.run(&["cook", "g.json"]);
    assert_eq!(ran.code == Some(0), cooked.code == Some(0), "check and cook differ: {} {}", ran.stderr, cooked.stderr);
    let line = ran.stderr.lines().next().unwrap_or_default();
    (ran.code, line.split_once(": ").map_or("", |(_, rest)| rest).to_owned())
}

#[test]
fn attributes_that_no_input_can_have_are_faults() {
    let wind = |params: &str| {
        format!(r#""a": {{"type": "Curve_Wind", "inputs": {{"curves": "same"}}, "params": {{{params}}}}}"#)
    };
    let code = |text: &str| {
        format!(
            r#""a": {{"type": "Attribute_Expr", "inputs": {{"geometry": "same"}}, "params": {{"code": "{text}"}}}}"#
        )
    };
    let mask = |name: &str| wind(&format!(r#""blend": {{"value": 1, "attribute": "{name}"}}"#));
    let made = format!(
        r#""made": {{"type": "Attribute_Expr", "inputs": {{"geometry": "same"}}, "params": {{"code": "made = P.y"}}}}, {}"#,
        mask("made").replace("same", "made")
    );
    for nodes in [mask("soft"), code("soft = soft*2; b = Cd.x"), made] {
        assert_eq!(checked_chain(&nodes), (Some(0), String::new()), "{nodes}");
    }
    for (nodes, expected) in [
        (
            mask("sofft"),
            "nodes.a.params.blend: `blend` is masked by `sofft`, which the curves do not have; did you mean \
             `soft`?",
        ),
        (
            mask("Cd"),
            "nodes.a.params.blend: `blend` is masked by `Cd`, which is one float3 for each CV; expected one float for \
             each CV",
        ),
        (code("b = sofft"), "nodes.a.params.code: line 1, column 5: "),
        (code("b = soft.y"), "nodes.a.params.code: line 1, column 9: a scalar has no components"),
        (code("Cd = 1"), "nodes.a.params.code: line 1, column 1: "),
    ] {
        let (exit, message) = checked_chain(&nodes);
        assert_eq!(exit, Some(3), "{nodes}: {message}");
        assert!(message.starts_with(expected), "{nodes}: {message}");
    }
}

#[test]
fn lists_whose_length_changes_are_faults() {
    let offsets = |first: usize, last: usize, interpolation: &str| {
        let vectors = |count: usize| format!("[{}]", vec!["[0, 0.1, 0]"; count].join(", "));
        let keys = format!("[[1, {}], [5, {}]]", vectors(first), vectors(last));
        let graph = format!(
            r#"{{"convect": 1, "scene": {{"frames": [1, 9]}}, "nodes": {{"box": {{"type": "Mesh_Primitive"}},
            "a": {{"type": "Lattice_Deform", "inputs": {{"geometry": "box"}},
                "params": {{"offsets": {{"keyframes": {keys}, "interpolation": "{interpolation}"}}}}}}}}, "outputs": {{"o": "a"}}}}"#
        );
        check(&Bench::with_graph(&graph))
    };
    assert_eq!(offsets(8, 8, "linear").code, Some(0));
    let ran = offsets(8, 7, "linear");
    assert_eq!(ran.code, Some(3), "{}", ran.stderr);
    assert!(ran.stderr.contains("the list has length 7, that of the key at frame 1 length 8"), "{}", ran.stderr);
    let ran = offsets(8, 7, "constant");
    assert_eq!(ran.code, Some(3), "{}", ran.stderr);
    assert!(ran.stderr.contains("nodes.a.params.offsets: `offsets` has 7 vectors"), "{}", ran.stderr);
    let always = offsets(1, 7, "constant");
    assert_eq!(always.stderr.lines().count(), 1, "one fault, over time and at the start: {}", always.stderr);
}

#[test]
fn names_of_outputs_leave_room_for_the_rest_of_file_names() {
    let graph = |length: usize| {
        let name = "o".repeat(length);
        Bench::with_graph(&format!(
            r#"{{"convect": 1, "nodes": {{"a": {{"type": "Mesh_Primitive"}}}}, "outputs": {{"{name}": "a"}}}}"#
        ))
    };
    let ran = graph(128).run(&["cook", "g.json", "--format", "json", "--frames", "-999999999.0001984126984127"]);
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    for length in [129, 252] {
        let ran = check(&graph(length));
        assert_eq!(ran.code, Some(3), "{}", ran.stderr);
        assert!(ran.stderr.contains("; its files are named after it; expected at most 128"), "{}", ran.stderr);
    }
}

#[test]
fn of_thousands_of_faults_the_first_are_shown_and_the_rest_counted() {
    let nodes: Vec<String> = (0..5_000).map(|n| format!(r#""n{n}": {{"type": "Transfrom"}}"#)).collect();
    let graph = format!(r#"{{"convect": 1, "nodes": {{{}}}, "outputs": {{"o": "n1"}}}}"#, nodes.join(", "));
    let bench = Bench::with_graph(&graph);
    let ran = check(&bench);
    assert_eq!((ran.code, ran.stderr.lines().count()), (Some(3), 201));
    assert!(ran.stderr.contains("nodes.n7.type: there is no node type `Transfrom`; did you mean `Transform`?"));
    assert!(ran.stderr.ends_with("5000 faults, of which the first 200 are shown; `check --json` lists all\n"));
    let all = bench.run(&["check", "g.json", "--json"]);
    assert_eq!(all.stdout.matches("\"unknown-type\"").count(), 5_000);
}

#[test]
fn inline_geometry_is_checked() {
    let curve = r#""points": [[0, 0, 0], [0, 1, 0]]"#;
    let square = r#""points": [[0, 0, 0], [1, 0, 0], [1, 0, 1]]"#;
    let tet = r#""points": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]"#;
    for (kind, params, expected) in [
        (
            "Curve_In",
            format!(r#"{curve}, "counts": [2, -1]"#),
            "nodes.a.params.counts: `counts` has -1 at index 1, counted from 0; expected at least 1",
        ),
        (
            "Curve_In",
            format!(r#"{curve}, "counts": [3]"#),
            "nodes.a.params.counts: `counts` adds up to 3 CVs, but `points` has 2",
        ),
        (
            "Curve_In",
            format!(r#"{curve}, "attributes": {{"mask": [0.5]}}"#),
            "nodes.a.params.attributes: `mask` has 1 row, expected 2",
        ),
        (
            "Mesh_In",
            format!(r#"{square}, "indices": [0, 1, -1]"#),
            "nodes.a.params.indices: `indices` has -1 at index 2, counted from 0; expected at least 0",
        ),
        (
            "Mesh_In",
            format!(r#"{square}, "indices": [0, 1, 3]"#),
            "nodes.a.params.indices: `indices` has 3 at index 2, but there are 3 `points`; points and indices are \
             counted from 0",
        ),
        (
            "Tet_In",
            format!(r#"{tet}, "tets": [[0, 1, 2, 7]]"#),
            "nodes.a.params.tets: `tets` has 7 at index 3, but there are 4 `points`; points and indices are counted \
             from 0",
        ),
        (
            "Point_In",
            format!(r#"{curve}, "attributes": {{"id": [1, 2, 3]}}"#),
            "nodes.a.params.attributes: `id` has 3 rows, expected 2",
        ),
    ] {
        assert_eq!(checked(kind, &params), (Some(3), expected.to_owned()), "{kind} {params}");
    }
    assert_eq!(checked("Tet_In", &format!(r#"{tet}, "tets": [[0, 1, 2, 3]]"#)).0, Some(0));
}

#[test]
fn a_gap_in_a_sequence_is_found_before_cooking() {
    let graph = r#"{"convect": 1, "scene": {"frames": [1, 6]},
"nodes": {"a": {"type": "Curve_In", "params": {"file": "in.####.obj"}}}, "outputs": {"o": "a"}}"#;
    let bench = Bench::with_graph(graph);
    for frame in [1, 2, 5, 6] {
        bench.write(&format!("in.000{frame}.obj"), "v 0 0 0\nv 0 1 0\nl 1 2\n");
    }
    let expected = "g.json:2:56: nodes.a.params.file: `in.0003.obj` does not exist, at frame 3 and at 1 more frame; \
                    paths are relative to the graph file\n";
    let ran = check(&bench);
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(1), expected));
    let ran = bench.run(&["cook", "g.json"]);
    assert_eq!((ran.code, ran.stderr.as_str(), bench.names("out").len()), (Some(1), expected, 0));
    bench.done(&["cook", "g.json", "--frames", "5-6", "--format", "json"]);
    assert_eq!(bench.names("out").len(), 2, "files of frames that are not requested may be missing");
}

/// The hint is what to write: with it, frames before the first file and after the last are cooked.
#[test]
fn frames_beyond_a_sequence_are_told_how_to_hold_its_ends() {
    let graph = |frames: &str, frame: &str| {
        format!(
            r#"{{"convect": 1, "scene": {{"frames": {frames}}},
"nodes": {{"a": {{"type": "Mesh_In", "params": {{"file": "in.####.obj"{frame}}}}}}}, "outputs": {{"o": "a"}}}}"#
        )
    };
    let bench = Bench::with_graph("");
    for frame in [3, 4] {
        bench.write(&format!("in.000{frame}.obj"), "v 0 0 0\nv 0 1 0\nv 1 0 0\nf 1 2 3\n");
    }
    for (frames, frame, expected) in [
        (
            "[1, 4]",
            "",
            r#"`in.0001.obj` does not exist, at frame 1 and at 1 more frame; the sequence starts at 3; the node's param `"frame": { "expr": "max(frame, 3)" }` holds that file before it"#,
        ),
        (
            "[3, 5]",
            "",
            r#"`in.0005.obj` does not exist, at frame 5; the sequence ends at 4; the node's param `"frame": { "expr": "min(frame, 4)" }` holds that file after it"#,
        ),
        (
            "[3, 4]",
            r#", "frame": {"expr": "2*frame"}"#,
            "`in.0006.obj` does not exist, at frame 3 and at 1 more frame; the sequence ends at 4; its param `frame`, put into `min(…, 4)`, holds that file after it",
        ),
    ] {
        bench.write("g.json", &graph(frames, frame));
        let ran = check(&bench);
        assert_eq!((ran.code, ran.stderr), (Some(1), format!("g.json:2:55: nodes.a.params.file: {expected}\n")));
    }
    for (frames, frame) in [
        ("[-9, 4]", r#", "frame": { "expr": "max(frame, 3)" }"#),
        ("[3, 5]", r#", "frame": { "expr": "min(frame, 4)" }"#),
        ("[3, 4]", r#", "frame": { "expr": "min(2*frame, 4)" }"#),
    ] {
        bench.write("g.json", &graph(frames, frame));
        assert_eq!(check(&bench).code, Some(0), "{frame}");
    }
}

/// Frames before the scene, which Curve_Jiggle's `preroll` reads, are no frames of the scene: the cook finds what is missing.
#[test]
fn a_preroll_before_the_first_file_is_told_how_to_hold_it() {
    let graph = |frame: &str| {
        format!(
            r#"{{"convect": 1, "scene": {{"frames": [1, 2]}},
"nodes": {{"a": {{"type": "Curve_In", "params": {{"file": "in.####.obj"{frame}}}}},
"wind": {{"type": "Curve_Wind", "inputs": {{"curves": "a"}}}},
"j": {{"type": "Curve_Jiggle", "inputs": {{"curves": "wind"}}, "params": {{"preroll": 10}}}}}}, "outputs": {{"o": "j"}}}}"#
        )
    };
    let bench = Bench::with_graph(&graph(""));
    for frame in [1, 2] {
        bench.write(&format!("in.000{frame}.obj"), "v 0 0 0\nv 0 1 0\nl 1 2\n");
    }
    let ran = bench.run(&["cook", "g.json"]);
    let expected = "g.json:2:11: `a` (Curve_In) at frame -9: `in.-0009.obj` does not exist; the sequence starts at 1; the node's param \
                    `\"frame\": { \"expr\": \"max(frame, 1)\" }` holds that file before it (and at 1 more frame)\n\
                    output `o` was not written\n";
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(1), expected));
    bench.write("g.json", &graph(r#", "frame": { "expr": "max(frame, 1)" }"#));
    bench.done(&["cook", "g.json"]);
}

#[test]
fn animated_params_that_leave_their_range_are_found() {
    let bench = Bench::with_graph(CALM_AT_2);
    let ran = check(&bench);
    let expected = "g.json:8:31: nodes.wind.params.wind_dir: `wind_dir` is [0, 0, 0], which has no direction, \
                    at frame 2; use a vector that is not zero, such as [1, 0, 0]\n";
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(3), expected));
    assert_eq!(bench.run(&["cook", "g.json", "--frames", "1"]).code, Some(0), "a cook checks only its frames");

    let graph = CALM_AT_2.replace(r#""keyframes": [[1, [1, 0, 0]], [3, [-1, 0, 0]]]"#, r#""expr": ["1", "0", "0"]"#);
    let octaves =
        graph.replace(r#""params": { "wind_dir""#, r#""params": { "octaves": {"expr": "frame/2"}, "wind_dir""#);
    let ran = check(&Bench::with_graph(&octaves));
    let line = "nodes.wind.params.octaves: `octaves` is 0.5, at frame 1 and at 1 more frame; expected a whole number; \
                floor(…), ceil(…) and round(…) give whole numbers\n";
    assert!(ran.stderr.ends_with(line), "{}", ran.stderr);
    let floored = octaves.replace("frame/2", "1 + floor(frame/2)");
    assert_eq!(check(&Bench::with_graph(&floored)).stderr, "");
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused_without_waiting() {
    let bench = Bench::new();
    let made = std::process::Command::new("mkfifo").arg(bench.path("pipe")).status();
    if !made.is_ok_and(|status| status.success()) {
        eprintln!("skipped: there is no mkfifo");
        return;
    }
    for verb in ["check", "cook", "explain"] {
        let ran = bench.run(&[verb, "pipe"]);
        let expected = "the graph `pipe` could not be read: it is a pipe or a device, not a file\n";
        assert_eq!((ran.code, ran.stderr.as_str()), (Some(1), expected), "{verb}");
    }
    bench.write("g.json", &crate::bench::GRAPH.replace("grass.obj", "pipe"));
    let ran = check(&bench);
    assert_eq!(ran.code, Some(1));
    assert!(ran.stderr.contains("`pipe` could not be read: it is a pipe or a device, not a file"), "{}", ran.stderr);
    assert_eq!(bench.run(&["stats", "pipe"]).code, Some(1));
}

#[cfg(target_os = "linux")]
#[test]
fn a_graph_from_stdin_has_paths_relative_to_the_working_directory() {
    let bench = Bench::new();
    let graph = std::fs::File::open(bench.path("g.json")).unwrap();
    let output = bench.command(&["check", "/dev/stdin"]).stdin(graph).output().unwrap();
    assert_eq!(Ran::of(&output).code, Some(0), "{output:?}");
}

#[test]
fn a_compressed_graph_is_recognised_and_refused() {
    let bench = Bench::new();
    std::fs::write(bench.path("g.json"), b"\x1f\x8b\x08\0\0\0\0\0\0\x03").unwrap();
    assert_eq!(
        check(&bench).stderr,
        "g.json:1:1: the file looks like gzip, expected a text file; decompress it first\n"
    );
}

#[test]
fn names_in_a_list_are_checked_against_what_comes_in() {
    let graph = r#"{ "convect": 1, "scene": { "frames": [1, 2] },
        "nodes": {
          "ball": { "type": "Mesh_Primitive", "params": { "shape": "sphere" } },
          "dots": { "type": "Point_In", "params": { "points": [[0, 0, 0]], "attributes": { "heat": [0.5] } } },
          "tag": { "type": "Surface_Tag", "inputs": { "surface": "ball", "reference": "dots" },
                   "params": { "attributes": ["heatt"] } } },
        "outputs": { "ball": "tag" } }"#;
    let ran = Bench::with_graph(graph).run(&["check", "g.json"]);
    let fact = "nodes.tag.params.attributes: `attributes` names `heatt`, which `reference` does not have; did you mean `heat`?";
    assert!(ran.code == Some(3) && ran.stderr.contains(fact), "{:?}: {}", ran.code, ran.stderr);
    let right = Bench::with_graph(&graph.replace("heatt", "heat")).run(&["check", "g.json"]);
    assert_eq!((right.code, right.stderr.as_str()), (Some(0), ""));
}

#[test]
fn a_list_of_outputs_needs_usd() {
    let bench = Bench::with_graph(
        r#"{"convect": 1, "nodes": {"a": {"type": "Mesh_Primitive"}, "b": {"type": "Mesh_Primitive"}}, "outputs": {
            "one": "a", "set": ["a", "b"]}}"#,
    );
    bench.done(&["check", "g.json", "--format", "usda"]);
    let line = "g.json:2:25: outputs.set: `set` is a list of outputs, and ply files hold one each; use --format usdc or \
                usda, or name each output\n";
    for command in [&["check", "g.json", "--format", "ply"][..], &["cook", "g.json", "--format", "ply"]] {
        let ran = bench.run(command);
        assert_eq!((ran.code, ran.stderr.as_str()), (Some(3), line));
    }
    bench.done(&["cook", "g.json", "--format", "ply", "--output", "one"]);
    let ran = bench.run(&["cook", "g.json", "--output", "set/a"]);
    assert_eq!(ran.stderr, "the graph has no output `set/a`; outputs: `one`, `set`\n");
    let ran = bench.run(&["cook", "g.json", "--format", "usda", "--output", "set"]);
    assert!(ran.stderr.starts_with("wrote out/set.usda: 1 frame, "), "{}", ran.stderr);
    assert!(!bench.path("out/one.usda").exists());
}
