//! Exit codes: 0 success, 1 file, 2 command line, 3 graph, 4 cook; of several classes the lowest.

use std::fs;

use crate::bench::{Bench, CALM_AT_2};

fn code(graph: &str, args: &[&str]) -> Option<i32> {
    Bench::with_graph(graph).run(args).code
}

fn graph(nodes: &str) -> String {
    format!(r#"{{"convect": 1, "nodes": {{{nodes}}}, "outputs": {{"o": "a"}}}}"#)
}

const CURVE: &str = r#""a": {"type": "Curve_In", "params": {"points": [[0, 0, 0], [0, 1, 0]]}}"#;
const MISSING: &str = r#""a": {"type": "Curve_In", "params": {"file": "missing.obj"}}"#;

#[test]
fn an_unreadable_graph_exits_with_1_and_an_unparsable_one_with_3() {
    for verb in ["cook", "check", "explain"] {
        assert_eq!(code("", &[verb, "missing.json"]), Some(1), "{verb}");
        assert_eq!(code("", &[verb, "."]), Some(1), "{verb} of a folder");
        assert_eq!(code("{\"convect\": 1", &[verb, "g.json"]), Some(3), "{verb}");
        assert_eq!(code("", &[verb, "g.json"]), Some(3), "{verb} of nothing");
    }
}

#[test]
fn a_wrong_command_line_exits_with_2() {
    let graph = graph(CURVE);
    for args in [
        &["cook"][..],
        &["fly"],
        &["cook", "g.json", "--fast"],
        &["cook", "g.json", "--frames", "5-1"],
        &["cook", "g.json", "--format", "abc"],
        &["cook", "g.json", "--output", "none"],
        &["cook", "g.json", "--memory", "much"],
        &["cook", "g.json", "--threads", "some"],
        &["cook", "g.json", "--set", "scale"],
        &["cook", "g.json", "--preview", "--preview-size", "0x0"],
        &["cook", "g.json", "--clip", "x"],
        &["nodes", "Curve_Wnd"],
        &["completions", "csh"],
        &["convert", "g.json", "g.abc"],
        &["convert", "g.json", "h.obj", "--scale", "0"],
        &["diff", "g.json", "g.json", "--tolerance", "-1"],
    ] {
        assert_eq!(code(&graph, args), Some(2), "{args:?}");
    }
}

#[test]
fn an_unknown_simd_path_exits_with_2() {
    let bench = Bench::new();
    let output = bench.command(&["cook", "g.json"]).env("CONVECT_SIMD", "mmx").output().unwrap();
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn an_invalid_graph_exits_with_3() {
    for nodes in [
        r#""a": {"type": "Curve_Inn"}"#,
        r#""a": {"type": "Curve_Wind"}"#,
        r#""a": {"type": "Curve_Wind", "inputs": {"curves": "a"}}"#,
        r#""a": {"type": "Curve_In", "params": {"scale": "big"}}"#,
        r#""a": {"type": "Curve_Wind", "inputs": {"curves": "b"}, "params": {"wind_dir": [0, 0, 0]}},
           "b": {"type": "Curve_In", "params": {"points": [[0, 0, 0]]}}"#,
    ] {
        assert_eq!(code(&graph(nodes), &["cook", "g.json"]), Some(3), "{nodes}");
    }
    assert_eq!(code(&graph(CURVE), &["cook", "g.json", "--set", "a.scale=two"]), Some(3));
}

#[test]
fn a_format_that_cannot_hold_an_output_exits_with_3_before_cooking() {
    let tets = r#""a": {"type": "Tet_In", "params": {
        "points": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "tets": [[0, 1, 2, 3]]}}"#;
    let bench = Bench::with_graph(&graph(tets));
    let ran = bench.run(&["cook", "g.json", "--format", "obj"]);
    assert_eq!((ran.code, bench.names("out").len()), (Some(3), 0), "{}", ran.stderr);
    assert_eq!(bench.run(&["cook", "g.json", "--format", "usda"]).code, Some(0));
}

#[test]
fn a_missing_or_broken_input_file_exits_with_1() {
    assert_eq!(code(&graph(MISSING), &["cook", "g.json"]), Some(1));
    for obj in ["v 0 nan 0\nl 1 1\n", "v 0 0 0\nl 1 9999999999\n", "f 1 2 3\n", "\0\u{1}\u{2}", ""] {
        let bench = Bench::with_graph(&graph(&MISSING.replace("missing", "hostile")));
        bench.write("hostile.obj", obj);
        let ran = bench.run(&["cook", "g.json"]);
        assert_eq!((ran.code, bench.names("out").len()), (Some(1), 0), "{obj:?}: {}", ran.stderr);
    }
}

#[test]
fn of_two_classes_of_faults_the_lowest_exit_code_is_used() {
    let both = format!(r#"{MISSING}, "b": {{"type": "Curve_Inn"}}"#);
    let ran = Bench::with_graph(&graph(&both)).run(&["check", "g.json"]);
    assert_eq!(ran.code, Some(1));
    assert!(ran.stderr.ends_with("2 faults\n"), "both are reported: {}", ran.stderr);
}

#[test]
fn a_node_that_fails_at_a_frame_exits_with_4_and_affects_only_its_output() {
    let bench = Bench::with_graph(CALM_AT_2);
    let ran = bench.run(&["cook", "g.json", "--format", "json"]);
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
    let (grass, still) = (["grass.0001.json", "grass.0003.json"], [1, 2, 3].map(|k| format!("still.000{k}.json")));
    assert_eq!(bench.names("out"), [&grass.map(str::to_owned)[..], &still].concat());
    let ran = bench.run(&["cook", "g.json", "--out", "usd"]);
    assert_eq!(
        (ran.code, bench.names("usd")),
        (Some(4), vec!["still.usdc".into()]),
        "an incomplete USD file is not written"
    );
    assert_eq!(bench.run(&["cook", "g.json", "--frames", "1,3", "--out", "usd"]).code, Some(0));
}

#[test]
fn an_output_that_cannot_be_written_exits_with_1() {
    let graph = graph(CURVE);
    let bench = Bench::with_graph(&graph);
    bench.write("file", "");
    for out in ["file", "file/out"] {
        let ran = bench.run(&["cook", "g.json", "--out", out]);
        assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    }
    for (format, name) in [("json", "o.0001.json"), ("usdc", "o.usdc")] {
        fs::create_dir_all(bench.path("taken").join(name)).unwrap();
        let ran = bench.run(&["cook", "g.json", "--out", "taken", "--format", format]);
        assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    }
    assert_eq!(bench.names("taken"), ["o.0001.json", "o.usdc"], "no temporary file is left");
    let ran = bench.run(&["cook", "g.json", "--report", "none/report.json"]);
    assert_eq!((ran.code, bench.names("out").len()), (Some(1), 0), "before it cooks: {}", ran.stderr);
    let ran = bench.run(&["cook", "g.json", "--cache", "file"]);
    let note = "note: the cache `file` could not be written: it is not a folder; cooking continues without it\n";
    assert!(ran.code == Some(0) && ran.stderr.contains(note), "a cook can do without: {}", ran.stderr);
}

#[cfg(unix)]
#[test]
fn a_folder_without_permission_exits_with_1() {
    use std::os::unix::fs::PermissionsExt;
    let bench = Bench::new();
    fs::create_dir(bench.path("locked")).unwrap();
    fs::set_permissions(bench.path("locked"), fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(bench.path("locked/probe"), "").is_ok() {
        eprintln!("skipped: this user may write anywhere");
        return;
    }
    let ran = bench.run(&["cook", "g.json", "--out", "locked"]);
    assert_eq!(ran.code, Some(1));
    assert!(ran.stderr.contains("permission denied; choose a folder you may write to"), "{}", ran.stderr);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_stdout_exits_with_1() {
    let bench = Bench::new();
    for args in [&["nodes"][..], &["explain", "g.json"], &["stats", "grass.obj"], &["completions", "bash"], &["schema"]]
    {
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let output = bench.command(args).stdout(full).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{args:?}");
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(text.starts_with("stdout could not be written: "), "{args:?}: {text}");
    }
    for args in [&["--help"][..], &["--version"], &["cook", "--help"], &["help", "check"]] {
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let output = bench.command(args).stdout(full).output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{args:?}: {text}");
        assert!(text.starts_with("stdout could not be written: "), "{args:?}: {text}");
    }
}

#[test]
fn a_closed_stderr_changes_no_exit_code() {
    let bench = Bench::new();
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let mut program = std::process::Command::new(env!("CARGO_BIN_EXE_convect"));
    let status = program.current_dir(bench.path("")).args(["cook", "nope.json"]).stderr(full).status().unwrap();
    assert_eq!(status.code(), Some(1));
}

#[test]
fn an_absurd_number_of_threads_is_a_wrong_command_line() {
    let bench = Bench::new();
    let mut program = std::process::Command::new(env!("CARGO_BIN_EXE_convect"));
    let ended = program.current_dir(bench.path("")).args(["cook", "g.json", "--threads", "100000"]).output().unwrap();
    assert_eq!(ended.status.code(), Some(2));
}
