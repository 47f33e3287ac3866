//! Large graphs: time and memory of the program for chains and for nodes that no output needs.
//!
//! `cargo bench --bench sizes`: the best time and the highest peak of some runs. Linux only: peak memory is that of
//! `/proc/PID/status`, sampled while the program runs.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::time::Duration;

use engine::clock::Stopwatch;

/// A command on a graph, and what it may take.
struct Row {
    what: &'static str,
    verb: &'static [&'static str],
    graph: fn() -> String,
    exit: i32,
    seconds: f64,
    megabytes: u64,
}

const COOK: &[&str] = &["cook", "g.json"];
const CHECK: &[&str] = &["check", "g.json"];

const ROWS: [Row; 7] = [
    Row {
        what: "check 1e5 nodes",
        verb: CHECK,
        graph: || chain(TRANSFORM, 100_000),
        exit: 0,
        seconds: 0.5,
        megabytes: 250,
    },
    Row {
        what: "cook 1e5 Transform",
        verb: COOK,
        graph: || chain(TRANSFORM, 100_000),
        exit: 0,
        seconds: 5.0,
        megabytes: 500,
    },
    Row {
        what: "cook 2e4 Curve_Jiggle",
        verb: COOK,
        graph: || chain(JIGGLE, 20_000),
        exit: 0,
        seconds: 5.0,
        megabytes: 500,
    },
    Row {
        what: "check 1e6, one needed",
        verb: CHECK,
        graph: || needed_first(1_000_000),
        exit: 0,
        seconds: 10.0,
        megabytes: 2_000,
    },
    Row {
        what: "cook 1e6, one needed",
        verb: COOK,
        graph: || needed_first(1_000_000),
        exit: 0,
        seconds: 10.0,
        megabytes: 2_000,
    },
    Row {
        what: "check 2e5 unknown types",
        verb: CHECK,
        graph: || unknown(200_000),
        exit: 3,
        seconds: 2.0,
        megabytes: 1_000,
    },
    Row {
        what: "a Merge doubled 28 times",
        verb: &["cook", "g.json", "--memory", "1G"],
        graph: doubled,
        exit: 4,
        seconds: 20.0,
        megabytes: 1_500,
    },
];

/// A source, and a node that reads the one before: type, input, params.
struct Links {
    source: &'static str,
    kind: &'static str,
    input: &'static str,
}

const TRANSFORM: Links =
    Links { source: r#"{"type": "Mesh_Primitive", "params": {"divisions": 1}}"#, kind: "Transform", input: "geometry" };
const JIGGLE: Links = Links {
    source: r#"{"type": "Curve_In", "params": {"points": [[0, 0, 0], [0, 1, 0], [0, 2, 0]], "counts": [3]}}"#,
    kind: "Curve_Jiggle",
    input: "curves",
};

/// The text of a graph: node 0, then `count - 1` more, and an output.
fn graph(source: &str, count: usize, node: impl Fn(usize, &mut String), output: usize) -> String {
    let mut text = format!(r#"{{"convect": 1, "nodes": {{"n0": {source}"#);
    for n in 1..count {
        text += ",\n";
        node(n, &mut text);
    }
    let _ = write!(text, r#"}}, "outputs": {{"o": "n{output}"}}}}"#);
    text
}

fn link(links: &Links, n: usize, text: &mut String) {
    let Links { kind, input, .. } = links;
    let _ = write!(text, r#""n{n}":{{"type":"{kind}","inputs":{{"{input}":"n{}"}}}}"#, n - 1);
}

fn chain(links: Links, count: usize) -> String {
    graph(links.source, count, |n, text| link(&links, n, text), count - 1)
}

fn needed_first(count: usize) -> String {
    graph(TRANSFORM.source, count, |n, text| link(&TRANSFORM, n, text), 0)
}

fn unknown(count: usize) -> String {
    let node = |n: usize, text: &mut String| {
        let _ = write!(text, r#""n{n}":{{"type":"Transfrom{n}"}}"#);
    };
    graph(TRANSFORM.source, count, node, 0)
}

fn doubled() -> String {
    let node = |n: usize, text: &mut String| {
        let _ = write!(text, r#""n{n}":{{"type":"Merge","inputs":{{"geometry":["n{0}","n{0}"]}}}}"#, n - 1);
    };
    graph(TRANSFORM.source, 29, node, 28)
}

/// Seconds, peak megabytes and exit code of a run in `folder`.
fn run(row: &Row, folder: &Path) -> std::io::Result<(f64, u64, Option<i32>)> {
    let watch = Stopwatch::start();
    let mut child = Command::new(env!("CARGO_BIN_EXE_convect"))
        .args(row.verb)
        .current_dir(folder)
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()?;
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let high =
            text.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse().ok());
        peak = peak.max(high.unwrap_or(0_u64) * 1024 / 1_000_000);
        if let Some(status) = child.try_wait()? {
            return Ok((watch.wall().as_secs_f64(), peak, status.code()));
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn main() -> std::io::Result<ExitCode> {
    let folder = tempfile::tempdir()?;
    let mut missed = 0;
    for row in &ROWS {
        std::fs::write(folder.path().join("g.json"), (row.graph)())?;
        let (mut seconds, mut megabytes, mut exit) = (f64::MAX, 0, None);
        // The first run pays for memory that the machine has not used for long.
        for _ in 0..if row.seconds < 1.0 { 5 } else { 2 } {
            let (wall, peak, code) = run(row, folder.path())?;
            (seconds, megabytes, exit) = (seconds.min(wall), megabytes.max(peak), code);
        }
        let kept = seconds <= row.seconds && megabytes <= row.megabytes && exit == Some(row.exit);
        missed += usize::from(!kept);
        println!(
            "{:<26} {seconds:6.2} s (at most {}) {megabytes:6} MB (at most {}){}",
            row.what,
            row.seconds,
            row.megabytes,
            if kept { String::new() } else { format!("  MISSED, exit code {exit:?}") }
        );
    }
    Ok(if missed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
