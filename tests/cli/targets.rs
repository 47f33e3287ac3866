//! No command overwrites what it reads, or writes one file twice, under whatever name the file is given.

use std::fs;
use std::path::Path;

use crate::bench::Bench;

/// Reads two frames of a numbered file and writes an output of the same name.
const NUMBERED: &str = r#"{"convect": 1, "scene": {"frames": [1, 2]}, "nodes": {
    "c": {"type": "Curve_In", "params": {"file": "hair.####.obj", "frame": {"expr": "frame + 7"}}}
    }, "outputs": {"hair": "c"}}"#;

fn bench() -> Bench {
    let bench = Bench::with_graph(NUMBERED);
    for frame in 1..10 {
        bench.write(&format!("hair.{frame:04}.obj"), "v 0 0 0\nv 0 1 0\nl 1 2\n");
    }
    fs::create_dir(bench.path("d")).unwrap();
    bench
}

/// Runs a command that must be refused and leave every file as it is, without new ones.
fn refused(bench: &Bench, args: &[&str], code: i32, says: &str) {
    let before = bench.tree();
    let ran = bench.run(args);
    assert_eq!(ran.code, Some(code), "{args:?}: {}", ran.stderr);
    assert!(ran.stderr.contains(says), "{args:?}: {}", ran.stderr);
    assert!(bench.tree() == before, "{args:?} wrote something");
}

#[test]
fn what_the_graph_reads_is_not_overwritten_by_outputs() {
    let bench = bench();
    let reads = "would be overwritten, but the graph reads it; choose another --out\n";
    for out in [".", "d/..", "./none/../."] {
        refused(&bench, &["cook", "g.json", "--out", out, "--format", "obj"], 1, reads);
    }
    // Also a frame that this cook does not read: another will.
    refused(&bench, &["cook", "g.json", "--out", ".", "--format", "obj", "--frames", "1"], 1, reads);
    assert_eq!(bench.run(&["cook", "g.json", "--out", ".", "--format", "ply"]).code, Some(0));
}

#[test]
fn a_report_replaces_nothing_that_the_cook_reads_or_writes() {
    let bench = bench();
    let report = |path: &str, says: &str| {
        let args = ["cook", "g.json", "--preview", "--preview-size", "64x48", "--report", path];
        refused(&bench, &args, 2, says);
    };
    report("hair.0008.obj", "`hair.0008.obj` would be overwritten, but the graph reads it; choose another --report");
    report("d/../g.json", "would be overwritten, but it is the graph; choose another --report");
    fs::create_dir(bench.path("out")).unwrap();
    report("out/hair.usdc", "--report and --out would both write `out/hair.usdc`; choose another name\n");
    report("d/../out/./hair.usdc", "--report and --out would both write");
    report("out/g.preview.png", "--report and --preview would both write");
    let args = ["cook", "g.json", "--format", "obj", "--report", "out/hair.0002.obj"];
    refused(&bench, &args, 2, "--report and --out would both write `out/hair.0002.obj`");
    bench.done(&["cook", "g.json", "--format", "obj", "--report", "out/hair.0003.obj"]);
}

#[cfg(unix)]
#[test]
fn links_do_not_hide_what_a_path_is() {
    use std::os::unix::fs::symlink;
    let bench = bench();
    let hard = |from: &str, to: &str| fs::hard_link(bench.path(from), bench.path(to)).unwrap();
    symlink("../hair.0008.obj", bench.path("d/soft.json")).unwrap();
    hard("hair.0008.obj", "d/hard.json");
    symlink(".", bench.path("here")).unwrap();
    symlink("out/hair.usdc", bench.path("dangling.json")).unwrap();
    let cook = |report: &str, code: i32, says: &str| {
        refused(&bench, &["cook", "g.json", "--report", report], code, says);
    };
    for report in ["d/soft.json", "d/hard.json", "here/hair.0008.obj"] {
        cook(report, 2, "would be overwritten, but the graph reads it");
    }
    cook("dangling.json", 2, "--report and --out would both write");
    refused(&bench, &["cook", "here/g.json", "--out", "here", "--format", "obj"], 1, "but the graph reads it");
    bench.done(&["cook", "g.json"]);
    hard("out/hair.usdc", "linked.json");
    cook("linked.json", 2, "--report and --out would both write");
    fs::remove_file(bench.path("linked.json")).unwrap();
    // Files of one kind may be links to each other, as a program that saves space makes them: each is replaced.
    bench.done(&["cook", "g.json", "--format", "json"]);
    fs::remove_file(bench.path("out/hair.0002.json")).unwrap();
    hard("out/hair.0001.json", "out/hair.0002.json");
    bench.done(&["cook", "g.json", "--format", "json"]);
    assert_eq!([1, 2].map(|k| bench.read_json(&format!("out/hair.000{k}.json"))["frame"].clone()), [1, 2]);
}

#[test]
fn a_conversion_does_not_replace_what_it_reads() {
    let bench = bench();
    let says = "would be overwritten, but it is to be converted; choose another target";
    refused(&bench, &["convert", "grass.obj", "./d/../grass.obj", "--scale", "0.01"], 2, says);
    refused(&bench, &["convert", "hair.####.obj", "hair.####.obj"], 2, says);
    // One of another frame's: 0001 becomes 01, which is nobody's, but 10000 stays what it is.
    bench.write("hair.10000.obj", "v 0 0 0\nv 0 1 0\nl 1 2\n");
    refused(&bench, &["convert", "hair.####.obj", "hair.##.obj"], 2, says);
    if cfg!(unix) {
        #[cfg(unix)]
        std::os::unix::fs::symlink("grass.obj", bench.path("link.obj")).unwrap();
        refused(&bench, &["convert", "grass.obj", "link.obj"], 2, says);
        refused(&bench, &["convert", "link.obj", "grass.obj"], 2, says);
    }
    bench.done(&["convert", "grass.obj", "grass.ply"]);
}

#[test]
fn temporaries_of_a_killed_report_go_with_the_next_one() {
    let bench = Bench::new();
    fs::create_dir(bench.path("d")).unwrap();
    let mut child =
        bench.command(&["cook", "g.json", "--frames", "1-1000000", "--report", "d/r.json"]).spawn().unwrap();
    let is_left = |name: &String| name.starts_with(".r.json.tmp-");
    let left = |folder: &Path| crate::bench::names(folder).iter().any(is_left);
    while !left(&bench.path("d")) && child.try_wait().unwrap().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(left(&bench.path("d")));
    bench.done(&["cook", "g.json", "--report", "d/other.json", "--out", "elsewhere"]);
    assert_eq!(bench.names("d"), ["other.json"]);
}
