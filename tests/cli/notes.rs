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
    let list = report["notes"].as_array().unwrap();
    assert_eq!(list.len(), printed.len(), "{list:?}");
    for (note, printed) in list.iter().zip(&printed) {
        assert!(printed.starts_with(note["text"].as_str().unwrap()), "{note} {printed}");
        assert!(printed.ends_with(note["hint"].as_str().unwrap_or_default()), "{note} {printed}");
        assert!(note["kind"].is_string() && note["frames"].is_array(), "{note}");
    }
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
    let bench = two_curves(r#""width": 0.1, "element_attributes": {"envelope": [0.0, 1.0]}"#, r#""wind""#);
    let expected = "`wind` (Curve_Wind) does not read `envelope` of the curves, which is one float for each curve; \
                    it reads one float for each CV";
    assert_eq!(notes(&bench, &[]), [expected]);
    let bench = two_curves(r#""width": 0.1, "attributes": {"envelope": [0.0, 1.0, 0.0, 1.0]}"#, r#""wind""#);
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
    assert_eq!(notes(&bench, &["--format", "json"]), expected);
    assert_eq!(notes(&bench, &["--format", "json", "--cache", "cache"]), expected);
    let warm = notes(&bench, &["--format", "json", "--cache", "cache"]);
    assert_eq!(warm[1], expected[1], "also for frames from disk");
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
        "output `o` was written without the curves without a point, which ply cannot hold; usdc and json can";
    assert_eq!(notes(&bench, &["--format", "ply"])[1], expected);
}

#[test]
fn what_is_probably_not_meant_is_noted_by_check_and_by_cook() {
    let bench = Bench::with_graph(
        r#"{"convect": 1, "nodes": {
            "grass": {"type": "Curve_In", "params": {"points": [[0, 0, 0], [0, 1, 0]], "width": 0.01}},
            "spare": {"type": "Transform", "inputs": {"geometry": "grass"}},
            "turn": {"type": "Transform", "inputs": {"geometry": "grass"},
                "params": {"rotate": {"expr": ["0", "pi/2", "30*sin(2*pi*time)"]}}}
        }, "outputs": {"d": "turn", "D": "turn", "other": "grass"}}"#,
    );
    let expected = [
        "line 5: nodes.turn.params.rotate.expr[1]: the expression is a multiple of `pi`, but `rotate` is in degrees. \
         Write 180 instead of `pi`, or degrees(…) around an angle in radians.",
        "no output needs `spare` (Transform). Connect it, or remove it; it is not cooked.",
        "the outputs `d` and `D` differ only in case. Their files replace each other on file systems that ignore case, \
         as on Windows and macOS; rename one.",
    ];
    assert_eq!(notes(&bench, &[]), expected);
    let checked = bench.run(&["check", "g.json"]);
    let lines: Vec<String> = expected.iter().map(|text| format!("note: {text}\n")).collect();
    assert_eq!((checked.code, checked.stderr), (Some(0), lines.concat()));
}

#[test]
fn a_note_on_a_control_does_not_keep_it_from_the_nodes_that_read_it() {
    let bench = Bench::with_graph(
        r#"{"convect": 1, "scene": {"frames": [1, 3]}, "controls": {"turn": {"expr": "vec(0, pi*time, 0)"}}, "nodes": {
            "skin": {"type": "Mesh_Primitive"},
            "one": {"type": "Transform", "inputs": {"geometry": "skin"}, "params": {"rotate": {"control": "turn"}}},
            "two": {"type": "Transform", "inputs": {"geometry": "skin"}, "params": {"rotate": {"control": "turn"}}}
        }, "outputs": {"one": "one", "two": "two"}}"#,
    );
    let found = notes(&bench, &["--format", "json"]);
    assert!(found.len() == 1 && found[0].contains("a multiple of `pi`"), "{found:?}");
    assert_eq!(bench.read_json("out/one.0003.json"), bench.read_json("out/two.0003.json"));
}

#[test]
fn notes_with_strict_exit_with_4_and_files_are_written() {
    let bench = two_curves(r#""width": 0.1"#, r#""wind""#);
    let strict = |args: &[&str]| bench.run(&[args, &["--strict"]].concat());
    assert_eq!(strict(&["cook", "g.json"]).code, Some(0));
    assert_eq!(strict(&["check", "g.json"]).code, Some(0));
    let ran = strict(&["cook", "g.json", "--frames", "2-5", "--format", "json", "--out", "late"]);
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
    assert!(ran.stderr.ends_with("1 note, with --strict\n"), "{}", ran.stderr);
    assert!(bench.path("late/o.0005.json").exists());
    let bench = Bench::with_graph(
        r#"{"convect": 1, "nodes": {"a": {"type": "Curve_In", "params": {"points": [[0, 0, 0]], "width": 1}},
            "b": {"type": "Transform", "inputs": {"geometry": "a"}}}, "outputs": {"o": "a"}}"#,
    );
    let ran = bench.run(&["check", "g.json", "--strict"]);
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
}

#[test]
fn frames_outside_the_scene_are_noted() {
    let bench = two_curves(r#""width": 0.1"#, r#""wind""#);
    let hint = "Keyframes hold their first and last value there, and solvers start at the scene's first frame. Extend \
                `scene.frames` if that is not meant.";
    let expected = format!("2 frames are outside the scene, whose frames are 1-3 (frames 4-5). {hint}");
    assert_eq!(notes(&bench, &["--frames", "2-5"]), [expected]);
    let expected = format!("frame 0.5 is outside the scene, whose frames are 1-3. {hint}");
    assert_eq!(notes(&bench, &["--frames", "0.5,1"]), [expected]);
}

#[test]
fn an_output_without_geometry_is_noted_if_no_frame_has_any() {
    let graph = |density: &str| {
        Bench::with_graph(&format!(
            r#"{{"convect": 1, "scene": {{"frames": [1, 3]}}, "nodes": {{
                "ball": {{"type": "Mesh_Primitive", "params": {{"shape": "sphere"}}}},
                "fur": {{"type": "Curve_Scatter", "inputs": {{"skin": "ball"}}, "params": {{"density": {density}}}}}
            }}, "outputs": {{"o": "fur"}}}}"#
        ))
    };
    let expected = "output `o` has no geometry at any frame (frames 1-3). Look at what `fur` (Curve_Scatter) returns, and \
                    what it is given.";
    assert_eq!(notes(&graph("0"), &["--format", "json"]), [expected]);
    assert_eq!(notes(&graph("10"), &["--format", "json"]), [""; 0]);
}

#[test]
fn a_mask_that_is_zero_everywhere_is_noted() {
    let graph = |code: &str| {
        Bench::with_graph(&format!(
            r#"{{"convect": 1, "scene": {{"frames": [1, 3]}}, "nodes": {{
                "two": {{"type": "Curve_In", "params": {{"points": [[0, 0, 0], [0, 1, 0]], "width": 0.1}}}},
                "mask": {{"type": "Attribute_Expr", "inputs": {{"geometry": "two"}}, "params": {{"code": "m = {code}"}}}},
                "wind": {{"type": "Curve_Wind", "inputs": {{"curves": "mask"}},
                    "params": {{"global_rotate": {{"value": 1, "attribute": "m"}}}}}}
            }}, "outputs": {{"o": "wind"}}}}"#
        ))
    };
    let expected = "`wind` (Curve_Wind): the mask `m` of `global_rotate` is 0 everywhere (frames 1-3). `global_rotate` has \
                    no effect. Look at where the attribute `m` is made.";
    assert_eq!(notes(&graph("0*frame"), &[]), [expected]);
    assert_eq!(notes(&graph("max(frame - 2, 0)"), &[]), [""; 0]);
    let bench = graph("1");
    let text = std::fs::read_to_string(bench.path("g.json")).unwrap();
    bench.write("misspelt.json", &text.replace(r#""attribute": "m""#, r#""attribute": "mm""#));
    let ran = bench.run(&["cook", "misspelt.json"]);
    assert!(ran.stderr.contains("which the curves do not have; did you mean `m`?"), "{}", ran.stderr);
    assert!(ran.stderr.starts_with("misspelt.json:5:"), "{}", ran.stderr);
}

#[test]
fn a_mask_that_leaves_the_range_of_its_param_is_noted_once() {
    let graph = |code: &str, param: &str| {
        Bench::with_graph(&format!(
            r#"{{"convect": 1, "scene": {{"frames": [1, 3]}}, "nodes": {{
                "two": {{"type": "Curve_In", "params": {{"points": [[0, 0, 0], [0, 1, 0], [0, 2, 0]], "width": 0.1}}}},
                "mask": {{"type": "Attribute_Expr", "inputs": {{"geometry": "two"}}, "params": {{"code": "m = {code}"}}}},
                "wind": {{"type": "Curve_Wind", "inputs": {{"curves": "mask"}},
                    "params": {{"{param}": {{"value": 0.5, "attribute": "m"}}}}}}
            }}, "outputs": {{"o": "wind"}}}}"#
        ))
    };
    // Half of −1, 2 and 5; at frame 1 nothing is outside.
    let expected = "`wind` (Curve_Wind): 2 of 3 values of `blend`, masked by `m`, are outside of its range (0…1): they go \
                    from -0.5 to 2.5 (frames 2-3). They are clamped to the range. The values are `value` times the \
                    attribute: look at where `m` is made.";
    let bench = graph("frame < 2 ? 1 : P.y*3 - 1", "blend");
    for _ in 0..2 {
        assert_eq!(notes(&bench, &["--cache", "cache"]), [expected], "from the cache too");
    }
    let below = notes(&graph("-P.y", "amplitude"), &[]);
    assert!(below.len() == 1 && below[0].contains("2 of 3 values of `amplitude`"), "{below:?}");
    assert!(
        below[0].contains("(at least 0): they go from -1 to 0") && below[0].contains("would be refused"),
        "{below:?}"
    );
    // A factor that rounding makes a little larger than 2, and a param without a range.
    assert_eq!(notes(&graph("2.0000001", "blend"), &[]), [""; 0]);
    assert_eq!(notes(&graph("-9", "waviness"), &[]), [""; 0]);
}

/// Whole numbers and numbers per curve are masks too, and frames from the cache count as those that are cooked.
#[test]
fn masks_of_any_kind_are_noted_from_the_cache_too() {
    let graph = |attributes: &str| {
        let bench = Bench::with_graph(
            r#"{"convect": 1, "scene": {"frames": [1, 3]}, "nodes": {
                "two": {"type": "Curve_In", "params": {"file": "c.json", "width": 0.1}},
                "wind": {"type": "Curve_Wind", "inputs": {"curves": "two"}, "params": {
                    "wind_dir": {"expr": ["cos(time)", 0, "sin(time)"]},
                    "global_rotate": {"value": 1, "attribute": "m"}}}
            }, "outputs": {"o": "wind"}}"#,
        );
        let curves = r#""counts": [2], "points": [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]"#;
        bench.write("c.json", &format!(r#"{{"frame": 1, "curves": {{{curves}, {attributes}}}}}"#));
        bench
    };
    let zero = "`wind` (Curve_Wind): the mask `m` of `global_rotate` is 0 everywhere (frames 1-3). ";
    let cases = [
        (r#""point_attributes": {"m": [0, 0]}"#, true),
        (r#""point_attributes": {"m": [0, 1]}"#, false),
        (r#""element_attributes": {"m": [0.0]}"#, true),
        (r#""element_attributes": {"m": [0]}"#, true),
        (r#""element_attributes": {"m": [0.5]}"#, false),
    ];
    for (attributes, noted) in cases {
        let bench = graph(attributes);
        for _ in 0..2 {
            let found = notes(&bench, &["--cache", "cache"]);
            assert_eq!(found.len(), usize::from(noted), "{attributes}: {found:?}");
            assert!(found.iter().all(|note| note.starts_with(zero)), "{attributes}: {found:?}");
        }
    }
}

#[test]
fn roots_far_from_their_skin_are_noted() {
    let graph = |scale: &str| {
        Bench::with_graph(&format!(
            r#"{{"convect": 1, "nodes": {{
                "ball": {{"type": "Mesh_Primitive", "params": {{"shape": "sphere", "size": [1, 1, 1]}}}},
                "fur": {{"type": "Curve_Scatter", "inputs": {{"skin": "ball"}},
                    "params": {{"density": 20, "length": [0.1, 0.1]}}}},
                "big": {{"type": "Transform", "inputs": {{"geometry": "ball"}}, "params": {{"scale": {scale}}}}},
                "on": {{"type": "Curve_Attach", "inputs": {{"curves": "fur", "rest_skin": "big", "skin": "big"}}}}
            }}, "outputs": {{"o": "on"}}}}"#
        ))
    };
    let found = notes(&graph("[2, 2, 2]"), &["--format", "json"]);
    assert!(matches!(&found[..], [one] if one.starts_with("`on` (Curve_Attach): `far_roots` is ")), "{found:?}");
    assert_eq!(notes(&graph("[1.05, 1.05, 1.05]"), &["--format", "json"]), [""; 0]);
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
    // One frame after the other on one thread: frames 5 and 6, and half a frame before, between and after them. On a busy machine
    // results take long enough to be kept on disk, from which those of the first cook are then read.
    let more = cook("more.json", &["--cache", "cache", "--frames", "3-6", "--threads", "1"]);
    assert_eq!(of(&more, "wind", "from_disk"), 2, "{more}");
    let count = |what: &str| of(&more, "wind", what).as_u64().unwrap();
    assert_eq!(count("cooks") + count("from_cache"), 5, "{more}");
    let fresh = cook("fresh.json", &["--frames", "3-6"]);
    assert_eq!(of(&more, "wind", "metrics"), of(&fresh, "wind", "metrics"));
}

#[test]
fn curves_that_get_a_width_in_a_usd_file_are_noted() {
    let bench = two_curves("", r#""wind""#);
    let expected = |format: &str| {
        [format!(
            "output `o`: its curves have no `width`, so {format} got 0.001 m for them (frames 1-3). Set `width` in \
             Curve_Scatter or Curve_In, or make it with Attribute_Expr: `width = 0.002`."
        )]
    };
    for format in ["usdc", "usda"] {
        assert_eq!(notes(&bench, &["--format", format]), expected(format));
    }
    let text = std::fs::read_to_string(bench.path("out/o.usda")).unwrap();
    assert!(text.contains("float[] widths = [0.001] ("), "{text}");
    assert_eq!(notes(&bench, &["--format", "json"]), [""; 0], "json has curves without widths");
    let bench = two_curves(r#""width": 0.1"#, r#""wind""#);
    assert_eq!(notes(&bench, &["--format", "usda"]), [""; 0]);
    let bench = two_curves(r#""width": 0.1"#, r#"{"from": "wind", "attributes": ["P"]}"#);
    let left_out = &notes(&bench, &[])[0];
    assert!(left_out.ends_with("(frames 1-3). Add `width` to the output's `attributes`."), "{left_out}");
    let bench = two_curves("", r#""wind""#);
    bench.done(&["cook", "g.json", "--format", "json"]);
    let ran = bench.run(&["convert", "out/o.0001.json", "o.usdc"]);
    assert!(ran.stderr.contains("note: there are curves without `width`, so the file got 0.001 m for them\n"));
}

/// A ball that is simulated as a soft body, with a collider, a pin and a goal. Each of `changes` replaces a text.
fn soft_ball(changes: &[[&str; 2]]) -> Bench {
    let mut graph = r#"{"convect": 1, "scene": {"frames": [1, 6]}, "nodes": {
        "ball": {"type": "Mesh_Primitive", "params": {"shape": "sphere", "size": [0.1, 0.1, 0.1], "divisions": 4}},
        "body": {"type": "Tetrahedralize", "inputs": {"surface": "ball"}},
        "brick": {"type": "Mesh_Primitive", "params": {"shape": "box", "size": [0.1, 0.1, 0.1]}},
        "wall": {"type": "Transform", "inputs": {"geometry": "brick"}, "params": {"translate": [0.2, 0, 0]}},
        "hook": {"type": "Point_In", "params": {"points": [[0, 0.05, 0]]}},
        "pin": {"type": "Softbody_Pin", "inputs": {"targets": "hook"}, "params": {"radius": 0.01}},
        "egg": {"type": "Transform", "inputs": {"geometry": "ball"}, "params": {"scale": [0.9, 1.1, 1]}},
        "goal": {"type": "Softbody_Goal", "inputs": {"body": "body", "shape": "egg"},
            "params": {"frame": 4, "strength": 1e4, "hold": 1}},
        "later": {"type": "Softbody_Goal", "inputs": {"body": "body", "shape": "egg"},
            "params": {"frame": 6, "strength": 1e4}},
        "soft": {"type": "Softbody", "inputs": {"bodies": "body", "colliders": "wall", "pins": "pin",
            "goals": ["goal", "later"]}, "params": {"gravity": [0, 0, 0]}}
    }, "outputs": {"o": "soft.surface"}}"#
        .to_owned();
    for [from, to] in changes {
        assert!(graph.contains(from), "{from}");
        graph = graph.replace(from, to);
    }
    Bench::with_graph(&graph)
}

#[test]
fn a_soft_body_that_is_set_up_well_has_no_notes() {
    assert_eq!(notes(&soft_ball(&[]), &[]), [""; 0]);
}

#[test]
fn what_goes_wrong_with_a_soft_body_is_noted() {
    let only = |changes: &[[&str; 2]], start: &str, part: &str| {
        let found = notes(&soft_ball(changes), &[]);
        assert!(matches!(&found[..], [one] if one.starts_with(start) && one.contains(part)), "{changes:?} {found:#?}");
    };
    let inside = ["[0.2, 0, 0]", "[0.08, 0, 0]"];
    only(&[inside], "`soft` (Softbody): `started_in_colliders` is 1", "Move them apart at `start_frame`.");
    let press = ["[0.2, 0, 0]", r#"{"keyframes": [[1, [0, 0.11, 0]], [5, [0, -0.02, 0]]]}"#];
    let ground = [r#""gravity": [0, 0, 0]"#, r#""ground": true, "ground_height": -0.051"#];
    let found = notes(&soft_ball(&[press, ground]), &[]);
    let crushed = |note: &&String| note.starts_with("`soft` (Softbody): `deepest_penetration` is ");
    assert_eq!(found.iter().filter(crushed).count(), 1, "{found:#?}");
    // Through the pinned middle of the body, which cannot give way.
    let pierce = ["[0.2, 0, 0]", r#"{"keyframes": [[1, [0.1, 0, 0]], [3, [0, 0, 0]], [6, [-0.1, 0, 0]]]}"#];
    let found = notes(&soft_ball(&[pierce]), &[]);
    let capped = |note: &&String| note.starts_with("`soft` (Softbody): `caps_hit` is ");
    assert_eq!(found.iter().filter(capped).count(), 1, "{found:#?}");
    let far = ["[[0, 0.05, 0]]", "[[0, 0.05, 0], [0, 1, 0]]"];
    let idle = "the first is point 1 (from 0) of `pin` at `pins`.";
    only(&[far], "`soft` (Softbody): `idle_pins` is 1 at frame 1 (frames 1-6)", idle);
    let doubled = [r#""frame": 6"#, r#""frame": 4"#];
    only(
        &[doubled],
        "`soft` (Softbody): `doubled_goals` is 1 at frame 1",
        "At the `frame` of `later` at `goals` its body",
    );
    let early = [r#""frame": 6"#, r#""frame": -6"#];
    only(&[early], "`soft` (Softbody): `early_goals` is 1 at frame 1", "`later` at `goals` is over when the");
    let hollow = [r#"{"surface": "ball"}"#, r#"{"surface": "ball"}, "params": {"interior": false}"#];
    let found = notes(&soft_ball(&[hollow]), &[]);
    let [slivers, idle] = &found[..] else { panic!("{found:#?}") };
    assert!(slivers.starts_with("`body` (Tetrahedralize): `sliver_share` is ") && slivers.contains("Set `interior`"));
    assert!(idle.starts_with("`soft` (Softbody): `idle_goals` is 2 at frame 1"), "{idle}");
    assert!(idle.contains("`goal` at `goals` has no effect"), "{idle}");
    let weak = [r#""strength": 1e4"#, r#""strength": 1e-3"#];
    let away = [r#""scale": [0.9, 1.1, 1]"#, r#""scale": [0.9, 1.1, 1], "translate": [0, 0.2, 0]"#];
    only(&[weak, away], "`soft` (Softbody): `goal_miss` is ", "Raise `strength` of Softbody_Goal");
    let second = [r#""frame": 6, "strength": 1e4"#, r#""frame": 6, "start_frame": 5, "strength": 1e-3"#];
    let named = "`body` at `bodies` never comes near `later` at `goals`: ";
    let elsewhere = [
        r#""later": {"type": "Softbody_Goal", "inputs": {"body": "body", "shape": "egg"}"#,
        r#""away": {"type": "Transform", "inputs": {"geometry": "ball"}, "params": {"translate": [0, 0.2, 0]}},
        "later": {"type": "Softbody_Goal", "inputs": {"body": "body", "shape": "away"}"#,
    ];
    only(&[elsewhere, second], "`soft` (Softbody): `goal_miss` is ", named);
    let late = [r#""frame": 6"#, r#""frame": 6, "start_frame": 6"#];
    only(&[late], "`later` (Softbody_Goal): `late_start` is 1 at frame 1", "Set `start_frame` before `frame`.");
    let never = [r#""frame": 6, "strength": 1e4"#, r#""frame": 6, "strength": 0"#];
    only(
        &[never],
        "`later` (Softbody_Goal): `idle` is 1 at frame 1",
        "Raise `strength`, paint its mask, or remove the goal.",
    );
    let late = [r#""frame": 6"#, r#""frame": 60"#];
    let text = "`frame` is 60, after the last frame of the scene, whose frames are 1-6. ";
    only(&[late], &format!("`later` (Softbody_Goal): {text}"), "extend `scene.frames`");
    let exact = [r#""gravity": [0, 0, 0]"#, r#""integrator": "accurate", "tolerance": 1e-12"#];
    only(&[exact], "`soft` (Softbody): `tolerance_missed` is ", "Raise `tolerance`");
}

#[test]
fn tets_with_another_volume_than_their_surface_are_noted() {
    let twisted = |divisions: u32| {
        let bench = Bench::with_graph(&format!(
            r#"{{"convect": 1, "nodes": {{
                "plate": {{"type": "Mesh_Primitive",
                    "params": {{"shape": "box", "size": [1, 0.1, 0.3], "divisions": {divisions}}}}},
                "twisted": {{"type": "Attribute_Expr", "inputs": {{"geometry": "plate"}},
                    "params": {{"component": "mesh", "code": "@P.y += @P.x*@P.z"}}}},
                "body": {{"type": "Tetrahedralize", "inputs": {{"surface": "twisted"}}}}
            }}, "outputs": {{"o": "body"}}}}"#
        ));
        notes(&bench, &[])
    };
    let coarse = twisted(3);
    let start = "`body` (Tetrahedralize): `volume_error` is 0.0123 at frame 1. The tets cut corners of the surface";
    assert!(matches!(&coarse[..], [one] if one.starts_with(start)), "{coarse:#?}");
    assert_eq!(twisted(12), [""; 0], "smaller faces, as the note advises");
}

#[test]
fn pieces_of_a_surface_that_get_no_tets_are_noted() {
    let graph = |size: &str| {
        Bench::with_graph(&format!(
            r#"{{"convect": 1, "nodes": {{
                "ball": {{"type": "Mesh_Primitive", "params": {{"shape": "sphere", "size": [1, 1, 1]}}}},
                "crumb": {{"type": "Mesh_Primitive", "params": {{"shape": "sphere", "size": {size}}}}},
                "aside": {{"type": "Transform", "inputs": {{"geometry": "ball"}}, "params": {{"translate": [1, 0, 0]}}}},
                "both": {{"type": "Merge", "inputs": {{"geometry": ["aside", "crumb"]}}}},
                "body": {{"type": "Tetrahedralize", "inputs": {{"surface": "both"}}}}
            }}, "outputs": {{"o": "body"}}}}"#
        ))
    };
    assert_eq!(notes(&graph("[0.5, 0.5, 0.5]"), &[]), [""; 0]);
    let found = notes(&graph("[1e-9, 1e-9, 1e-9]"), &[]);
    assert!(
        matches!(&found[..], [one] if one.starts_with("`body` (Tetrahedralize): `lost_pieces` is 1 at")),
        "{found:?}"
    );
}

/// At 131 km single precision steps by 1/128 m, 0.1 of a segment of 8 cm.
#[test]
fn shapes_that_single_precision_rounds_are_noted() {
    let graph = r#"{"convect": 1, "scene": {"frames": [1, 2]}, "nodes": {
        "fur": {"type": "Curve_In", "params": {"points": [[0, 0, 0], [0, 0.08, 0], [0, 0.16, 0]], "counts": [3]}},
        "far": {"type": "Transform", "inputs": {"geometry": "fur"}, "params": {"translate": [131000, 0, 0]}}
        }, "outputs": {"o": "far"}}"#;
    let bench = Bench::with_graph(graph);
    let expected = "note: output `o`: positions of its curves step by 0.00781 m, and its edges are 0.0800 m long on average. \
                    So far from the origin single precision rounds their shape";
    let found = bench.run(&["cook", "g.json", "--no-write"]).stderr;
    assert!(found.contains(expected), "{found}");
    bench.write("g.json", &graph.replace("131000", "13100"));
    assert!(!bench.run(&["cook", "g.json", "--no-write"]).stderr.contains("note: output"));
}
