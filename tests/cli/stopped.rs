//! Interrupted cooks: Ctrl-C, a kill, a full disk, a closed pipe, little memory.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use engine::clock::Stopwatch;

use crate::bench::{Bench, Ran, names};

/// More frames than any test waits for.
const LONG: &str = "1-1000000";

pub(crate) fn signal(name: &str, child: &Child) {
    let status = Command::new("sh").args(["-c", &format!("kill -{name} {}", child.id())]).status().unwrap();
    assert!(status.success());
}

/// Waits until `folder` contains at least `count` files, including hidden ones.
pub(crate) fn wait_for(count: usize, folder: &Path) {
    for _ in 0..12_000 {
        if names(folder).len() >= count {
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    panic!("{} has only {:?} after a minute", folder.display(), names(folder));
}

fn start(bench: &Bench, args: &[&str]) -> Child {
    bench.command(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn ended(child: Child) -> Ran {
    Ran::of(&child.wait_with_output().unwrap())
}

#[test]
fn ctrl_c_leaves_complete_frames_and_no_temporary() {
    let bench = Bench::new();
    let args = ["cook", "g.json", "--frames", LONG, "--format", "json", "--output", "grass", "--report", "report.json"];
    let child = start(&bench, &args);
    wait_for(5, &bench.path("out"));
    signal("INT", &child);
    let ran = ended(child);
    assert_eq!(ran.code, Some(130), "{}", ran.stderr);
    let files = bench.names("out");
    let expected: Vec<String> = (1..=files.len()).map(|frame| format!("grass.{frame:04}.json")).collect();
    assert_eq!(files, expected, "frames without gaps, and no hidden files");
    for (index, name) in files.iter().enumerate() {
        assert_eq!(bench.read_json(&format!("out/{name}"))["frame"], index + 1);
    }
    assert!(
        ran.stderr.contains(&format!("interrupted; {} complete frames were written", files.len())),
        "{}",
        ran.stderr
    );
    assert_eq!(bench.read_json("report.json")["total"]["interrupted"], true);
}

#[test]
fn sigterm_acts_like_ctrl_c_and_nohup_survives_its_terminal() {
    let bench = Bench::new();
    let cook = bench.command(&["cook", "g.json", "--frames", LONG, "--format", "json", "--output", "grass"]);
    let mut nohup = Command::new("nohup");
    nohup.arg(cook.get_program()).args(cook.get_args()).current_dir(bench.path("")).stdin(Stdio::null());
    let child = nohup.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for(5, &bench.path("out"));
    signal("HUP", &child);
    wait_for(bench.names("out").len() + 20, &bench.path("out"));
    signal("TERM", &child);
    let ran = ended(child);
    assert_eq!(ran.code, Some(130), "{}", ran.stderr);
    let files = bench.names("out");
    let expected: Vec<String> = (1..=files.len()).map(|frame| format!("grass.{frame:04}.json")).collect();
    assert_eq!(files, expected, "frames without gaps, and no hidden files");
}

#[test]
fn ctrl_c_finishes_a_sequence_with_the_frames_cooked_so_far() {
    let bench = Bench::new();
    let child = start(&bench, &["cook", "g.json", "--frames", LONG, "--format", "usda", "--output", "grass"]);
    wait_for(1, &bench.path("out"));
    signal("INT", &child);
    let ran = ended(child);
    assert_eq!(ran.code, Some(130), "{}", ran.stderr);
    assert_eq!(bench.names("out"), ["grass.usda"]);
    let text = fs::read_to_string(bench.path("out/grass.usda")).unwrap();
    assert!(text.starts_with("#usda 1.0") && text.ends_with("}\n"), "whole");
}

#[test]
fn ctrl_c_stops_a_conversion_between_two_files() {
    let bench = Bench::new();
    for frame in 0..3000 {
        bench.write(&format!("in/a.{frame:04}.json"), r#"{"points": {"points": [[0, 0, 0]]}}"#);
    }
    fs::create_dir(bench.path("out")).unwrap();
    let child = start(&bench, &["convert", "in/a.####.json", "out/a.####.ply"]);
    wait_for(5, &bench.path("out"));
    signal("INT", &child);
    let ran = ended(child);
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(130), "interrupted; the files written so far are complete\n"));
    assert!(bench.names("out").iter().all(|name| name.starts_with("a.")), "no temporary is left");
}

#[test]
fn the_next_cook_removes_the_temporaries_of_a_killed_one() {
    let bench = Bench::new();
    let mut child = start(&bench, &["cook", "g.json", "--frames", LONG, "--output", "grass"]);
    wait_for(1, &bench.path("out"));
    child.kill().unwrap();
    assert_eq!(child.wait().unwrap().code(), None);
    let left = bench.names("out");
    assert!(left.iter().all(|name| name.starts_with(".grass.usdc.tmp-")), "nothing under a final name: {left:?}");
    assert_eq!(left.len(), 1);
    bench.done(&["cook", "g.json", "--frames", "1", "--format", "json", "--output", "grass"]);
    assert_eq!(bench.names("out"), ["grass.0001.json"]);
}

#[test]
fn a_killed_cook_resumes_from_its_cache_with_the_same_bits() {
    let bench = Bench::new();
    let cook = |out, frames| {
        [
            "cook", "g.json", "--format", "json", "--output", "grass", "--cache", "cache", "--out", out, "--frames",
            frames,
        ]
    };
    let mut child = start(&bench, &cook("out", LONG));
    wait_for(8, &bench.path("out"));
    child.kill().unwrap();
    child.wait().unwrap();
    bench.done(&cook("out", "1-12"));
    bench.done(&["cook", "g.json", "--format", "json", "--output", "grass", "--frames", "1-12", "--out", "fresh"]);
    let resumed = bench.files("out");
    assert!(bench.files("fresh").iter().all(|(name, file)| resumed[name] == *file));
    assert!(resumed.keys().all(|name| name.starts_with("grass.")), "no temporary is left: {:?}", resumed.keys());
}

#[test]
fn a_closed_pipe_on_stdout_is_not_an_error() {
    let bench = Bench::new();
    bench.write("other.obj", "v 0 0 0\n");
    for (args, code) in [
        (&["nodes"][..], 0),
        (&["nodes", "--json"], 0),
        (&["nodes", "Curve_Wind"], 0),
        (&["completions", "zsh"], 0),
        (&["explain", "g.json"], 0),
        (&["check", "g.json", "--json"], 0),
        (&["stats", "grass.obj"], 0),
        (&["diff", "grass.obj", "grass.obj"], 0),
        (&["diff", "grass.obj", "other.obj"], 1),
        (&["--help"], 0),
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let ran = Ran::of(&bench.command(args).stdout(writer).output().unwrap());
        assert_eq!((ran.code, ran.stderr.as_str()), (Some(code), ""), "{args:?}");
    }
}

/// A file system of 64 kB, unmounted when dropped.
struct TinyDisk<'a>(&'a Path);

impl<'a> TinyDisk<'a> {
    fn at(folder: &'a Path) -> Option<Self> {
        fs::create_dir(folder).unwrap();
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", "size=64k", "tmpfs"]).arg(folder).stderr(Stdio::null());
        mount.status().is_ok_and(|status| status.success()).then_some(Self(folder))
    }
}

impl Drop for TinyDisk<'_> {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.0).status();
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_reported_and_leaves_no_partial_file() {
    let bench = Bench::new();
    let disk = bench.path("disk");
    let Some(_mounted) = TinyDisk::at(&disk) else {
        eprintln!("skipped: this user may not mount a small disk");
        return;
    };
    for format in ["json", "usdc", "usda"] {
        let args = ["cook", "g.json", "--frames", "1-100", "--format", format, "--out", "disk", "--output", "grass"];
        let ran = bench.run(&args);
        assert_eq!(ran.code, Some(1), "{format}: {}", ran.stderr);
        assert!(ran.stderr.contains("the disk is full; free some space"), "{format}: {}", ran.stderr);
        for name in bench.names("disk") {
            assert_eq!(bench.read_json(&format!("disk/{name}"))["curves"]["counts"].as_array().unwrap().len(), 60);
            fs::remove_file(disk.join(name)).unwrap();
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_under_the_cache_is_reported_once_and_does_not_stop_the_cook() {
    let bench = Bench::new();
    let disk = bench.path("disk");
    let Some(_mounted) = TinyDisk::at(&disk) else {
        eprintln!("skipped: this user may not mount a small disk");
        return;
    };
    let args = ["cook", "g.json", "--frames", "1-40", "--format", "json", "--cache", "disk", "--output", "grass"];
    for _ in 0..2 {
        let ran = bench.run(&args);
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        let note = "note: the cache `disk` could not be written: the disk is full; cooking continues without it\n";
        assert_eq!(ran.stderr.matches(note).count(), 1, "{}", ran.stderr);
        assert_eq!(bench.names("out").len(), 40);
        let names: Vec<String> =
            bench.names("disk").iter().flat_map(|own| bench.names(&format!("disk/{own}"))).collect();
        assert!(names.iter().all(|name| !name.ends_with(".part")), "{names:?}");
    }
    fs::write(disk.join("filler"), vec![0; 1 << 16]).unwrap_err();
    let ran = bench.run(&[&args[..7], &["disk/new", "--output", "grass"]].concat());
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert!(ran.stderr.contains("the disk is full; cooking continues without it"), "{}", ran.stderr);
}

/// Cooks `graph` with `arguments` in a shell with a limited address space.
fn within(kilobytes: u64, graph: &str, arguments: &str) -> Ran {
    let bench = Bench::with_graph(graph);
    let script = format!("ulimit -v {kilobytes} && exec \"$0\" cook g.json {arguments}");
    let mut command = Command::new("sh");
    command.args(["-c", &script, env!("CARGO_BIN_EXE_convect")]).current_dir(bench.path(""));
    Ran::of(&command.output().unwrap())
}

/// A box joined with itself again and again.
fn doubled(times: usize) -> String {
    let mut text = r#"{"convect": 1, "nodes": {"n0": {"type": "Mesh_Primitive"}"#.to_owned();
    for n in 1..=times {
        text += &format!(r#", "n{n}": {{"type": "Merge", "inputs": {{"geometry": ["n{0}", "n{0}"]}}}}"#, n - 1);
    }
    format!(r#"{text}}}, "outputs": {{"o": "n{times}", "first": "n0"}}}}"#)
}

#[test]
fn a_result_larger_than_the_memory_is_refused_with_its_size() {
    let ran = within(4_194_304, &doubled(28), "--memory 100M");
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
    let expected = "(Merge) at frame 1: the result would take 165.1 MiB with its inputs, but --memory allows 100.0 MiB; \
                    merge fewer geometries, or raise --memory";
    assert!(ran.stderr.contains(expected), "{}", ran.stderr);
    assert!(ran.stderr.contains("wrote out/first.usdc"), "other outputs are written: {}", ran.stderr);
}

/// Making each of two boxes fits under the ceiling, but not beside the other.
#[test]
fn the_results_of_a_frame_count_together() {
    let graph = r#"{"convect": 1, "nodes": {
        "a": {"type": "Mesh_Primitive", "params": {"divisions": 200}},
        "b": {"type": "Mesh_Primitive", "params": {"divisions": 195}}
    }, "outputs": {"a": "a", "b": "b"}}"#;
    let ran = within(4_194_304, graph, "--memory 62M --no-write");
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
    assert!(ran.stderr.contains("with the other results of the frame, but --memory allows 62.0 MiB"), "{}", ran.stderr);
    let ran = within(4_194_304, graph, "--memory 80M --no-write");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
}

#[test]
fn a_picture_larger_than_the_memory_is_refused_with_its_size() {
    let graph = r#"{"convect": 1, "nodes": {"o": {"type": "Mesh_Primitive", "params": {"divisions": 100}}},
        "outputs": {"o": "o"}}"#;
    let ran = within(4_194_304, graph, "--preview --preview-size 32x32 --memory 40M");
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    assert!(ran.stderr.contains("a picture of frame 1 would take 58.6 MiB besides"), "{}", ran.stderr);
    assert!(ran.stderr.contains("wrote out/o.usdc"), "the geometry is written: {}", ran.stderr);
    let ran = within(4_194_304, graph, "--preview --preview-size 32x32 --memory 80M");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
}

#[cfg(unix)]
#[test]
fn ctrl_c_while_a_movie_is_drawn_ends_it_at_once() {
    let graph = crate::bench::GRAPH.replace("[1, 4]", "[1, 200]");
    let bench = Bench::with_graph(&graph);
    let args = ["cook", "g.json", "--output", "grass", "--movie", "--preview-size", "900x900", "--report", "r.json"];
    let mut child = start(&bench, &args);
    // The movie's file is started once all frames are cooked.
    for _ in 0..6_000 {
        if names(&bench.path("out")).iter().any(|name| name.contains(".apng")) {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(child.try_wait().unwrap().is_none(), "the movie is still drawn");
    signal("INT", &child);
    let watch = Stopwatch::start();
    let ran = Ran::of(&child.wait_with_output().unwrap());
    assert!(watch.wall() < Duration::from_secs(5), "{:?}", watch.wall());
    assert_eq!(ran.code, Some(130), "{}", ran.stderr);
    assert_eq!(bench.names("out"), ["grass.usdc"], "all frames, and no movie");
    assert_eq!(bench.read_json("r.json")["outputs"]["grass"]["frames"], 200);
}

#[test]
fn the_limits_of_the_process_are_kept_too() {
    let ran = within(1_500_000, &doubled(28), "--memory 100G --threads 1");
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
    assert!(ran.stderr.contains("but the limit on the process's address space leaves "), "{}", ran.stderr);
}

#[test]
fn a_billion_frames_take_no_memory_before_they_are_cooked() {
    let graph = doubled(1).replace(r#"{"convect": 1,"#, r#"{"convect": 1, "scene": {"frames": [1, 1000000000]},"#);
    let bench = Bench::with_graph(&graph);
    let limited = |verb: &str| {
        let script = format!("ulimit -v 2000000 && exec timeout 20 \"$0\" {verb}");
        let mut command = Command::new("sh");
        command.args(["-c", &script, env!("CARGO_BIN_EXE_convect")]).current_dir(bench.path(""));
        Ran::of(&command.output().unwrap())
    };
    let ran = limited("explain g.json");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert!(ran.stdout.starts_with("1000000000 frames, of which the first 10000 are planned\n"), "{}", ran.stdout);
    let far = Bench::with_graph(
        &FAR_BACK.replace("FIRST", "1").replace("START", "").replace("OUTPUT", "body").replace("NODE", "body"),
    );
    let ran = far.run(&["explain", "g.json", "--frames", "1000000000"]);
    assert_eq!(ran.code, Some(2), "{}", ran.stderr);
    assert!(ran.stderr.starts_with("frame 1000000000 is 1000000000 frames away from"), "{}", ran.stderr);
    let ran = limited("check g.json");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let ran = limited("cook g.json --format json --frames 1,999999999-1000000000 --preview");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let ran = limited("cook g.json --format json");
    assert_eq!(ran.code, Some(2), "{}", ran.stderr);
    assert!(ran.stderr.starts_with("the results of 1000000000 frames would take 238.4 GiB"), "{}", ran.stderr);
    let many = ["cook", "g.json", "--frames", "1-10000000", "--memory", "3G", "--format", "json", "--out", "all"];
    let mut child = bench.command(&many).stderr(Stdio::piped()).spawn().unwrap();
    wait_for(4, &bench.path("all"));
    signal("INT", &child);
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[test]
fn four_gigabytes_of_address_space_are_enough() {
    let bench = Bench::new();
    let mut command = Command::new("sh");
    let script = "ulimit -v 4194304 && exec \"$0\" cook g.json --threads 8 --cache cache";
    command.args(["-c", script, env!("CARGO_BIN_EXE_convect")]).current_dir(bench.path(""));
    let ran = Ran::of(&command.output().unwrap());
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
}

/// Falls for a billion frames before the first that is written.
const FAR_BACK: &str = r#"{
  "convect": 1, "scene": { "frames": [FIRST, 4] },
  "nodes": {
    "ball": { "type": "Mesh_Primitive", "params": { "shape": "sphere" } },
    "tets": { "type": "Tetrahedralize", "inputs": { "surface": "ball" } },
    "body": { "type": "Softbody", "inputs": { "bodies": "tets" }, "params": { START } },
    "blades": { "type": "Curve_In", "params": { "file": "grass.obj" } },
    "wind": {
      "type": "Curve_Wind", "inputs": { "curves": "blades" },
      "params": { "amplitude": 0.1, "scroll": { "keyframes": [[1, 1], [3, 2]] } },
    },
  },
  "outputs": { "OUTPUT": "NODE" },
}"#;

#[test]
fn a_signal_is_heard_while_frames_long_past_are_gone_through() {
    let graph = |first: &str, start: &str, node: &str| {
        let named = FAR_BACK.replace("FIRST", first).replace("START", start);
        named.replace("OUTPUT", node).replace("NODE", node)
    };
    for (name, graph) in [
        ("INT", graph("1", r#""start_frame": -1000000000"#, "body")),
        ("TERM", graph("-1000000000", "", "body")),
        ("TERM", graph("-1000000000", "", "wind")),
    ] {
        let bench = Bench::with_graph(&graph);
        let child = start(&bench, &["cook", "g.json", "--frames", "1-4", "--cache", "cache", "--report", "r.json"]);
        wait_for(4, &bench.path(""));
        std::thread::sleep(Duration::from_millis(200));
        signal(name, &child);
        let asked = engine::clock::Stopwatch::start();
        let ran = ended(child);
        assert_eq!(ran.code, Some(130), "{}", ran.stderr);
        assert!(asked.wall() < Duration::from_secs(5), "{:?}", asked.wall());
        assert!(bench.names("out").is_empty() && bench.names("").iter().all(|name| !name.contains(".tmp-")));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_limit_on_the_size_of_files_is_an_error_without_temporaries() {
    let bench = Bench::new();
    for (format, limit) in [("usdc", 4), ("usda", 4), ("json", 1)] {
        let mut command = Command::new("sh");
        let script =
            format!("ulimit -f {limit} && exec \"$0\" cook g.json --frames 1-200 --report r.json --format {format}");
        command.args(["-c", &script, env!("CARGO_BIN_EXE_convect")]).current_dir(bench.path(""));
        let ran = Ran::of(&command.output().unwrap());
        assert_eq!(ran.code, Some(1), "{format}: {}", ran.stderr);
        assert!(ran.stderr.contains("it is larger than the system lets a file be; raise the limit"), "{}", ran.stderr);
        assert_eq!(
            (bench.names(""), bench.names("out")),
            (vec!["g.json".into(), "grass.obj".into(), "out".into()], vec![])
        );
    }
}

#[cfg(target_os = "linux")]
#[test]
fn after_a_failure_of_a_file_it_is_said_which_outputs_were_written() {
    let graph = r#"{"convect": 1, "scene": {"frames": [1, 3]}, "nodes": {
        "small": {"type": "Mesh_Primitive", "params": {"shape": "box", "divisions": 1}},
        "large": {"type": "Mesh_Primitive", "params": {"shape": "sphere", "divisions": 64}}
    }, "outputs": {"large": "large", "small": "small"}}"#;
    // The first is larger than a file may be.
    for (format, of_large) in [("usda", "was not written"), ("json", "was not written")] {
        let bench = Bench::with_graph(graph);
        let script = format!("ulimit -f 60 && exec \"$0\" cook g.json --report r.json --format {format}");
        let mut command = Command::new("sh");
        command.args(["-c", &script, env!("CARGO_BIN_EXE_convect")]).current_dir(bench.path(""));
        let ran = Ran::of(&command.output().unwrap());
        assert_eq!(ran.code, Some(1), "{format}: {}", ran.stderr);
        assert!(ran.stderr.contains(&format!("output `large` {of_large}\n")), "{format}: {}", ran.stderr);
        let is_there = bench.names("out").iter().any(|name| name.starts_with("small"));
        let is_said = !ran.stderr.contains("output `small` was not written");
        assert_eq!(is_there, is_said, "{format}: {}", ran.stderr);
    }
    // The report is larger; outputs are written, and said.
    let bench = Bench::with_graph(&graph.replace(r#""large": "large", "#, ""));
    let name = "x".repeat(120);
    let inner = format!(
        "mkdir -p out; ulimit -f 1 && exec \"$0\" cook g.json --set small.size=[1,1,1] --report {name} --no-write"
    );
    let mut command = Command::new("sh");
    command.args(["-c", &inner, env!("CARGO_BIN_EXE_convect")]).current_dir(bench.path(""));
    let ran = Ran::of(&command.output().unwrap());
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    assert!(ran.stderr.contains("cooked 3 frames in "), "what was done is said: {}", ran.stderr);
    assert!(ran.stderr.contains(&format!("`{name}` could not be written: ")), "{}", ran.stderr);
}
