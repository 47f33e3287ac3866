//! The engine's own cost in time and memory.

use std::process::Command;
use std::time::Duration;

use crate::builder::{TestGraph, engine};
use crate::nodes::{CLOCK, FOLLOW, SOURCE};

/// A chain of `nodes` nodes that read the clock.
fn row(nodes: usize, frames: i64) -> TestGraph {
    let mut graph = TestGraph::new(1, frames);
    let mut last = graph.add("source", &SOURCE).done();
    for _ in 0..nodes {
        last = graph.add("clock", &CLOCK).set("amount", 1e-3_f32).wire("points", last).done();
    }
    graph.add("follow", &FOLLOW).wire("points", last).out();
    graph
}

/// Ten times the limit of an optimised build, to allow for slow machines and builds with checks.
const MOST: Duration = Duration::from_micros(50);

#[test]
fn a_trivial_node_costs_little() {
    let cooked = row(100, 200).cook_in(&engine(1, 1 << 30), 1..=200);
    let each = cooked.report.cooking / (100 * 200);
    assert!(each < MOST, "{each:?} per node and frame");
}

/// The environment variable with the number of frames of the child process, which does nothing if it is not set.
const FRAMES: &str = "CONVECT_TEST_FRAMES";

/// The child: cooks, discards the results, and prints its peak memory.
#[test]
fn child() {
    let Some(frames) = std::env::var(FRAMES).ok().and_then(|text| text.parse().ok()) else { return };
    let graph =
        row(20, frames).with("source", "count", engine::param::Source::Constant(engine::param::Value::Int(5_000)));
    let mut sink = |_: &[engine::cook::Delivered]| -> Result<(), std::convert::Infallible> { Ok(()) };
    let request = engine::plan::Request::everything(&graph.0);
    let cancel = std::sync::atomic::AtomicBool::new(false);
    let cooked = engine(1, 1 << 24).cook(&graph.0, &request, None, &cancel, &mut sink);
    assert!(cooked.is_ok_and(|report| report.errors.is_empty()));
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    println!("peak{}", peak.unwrap_or(" 0 kB"));
}

/// The peak memory in kB of a process that cooks `frames` frames; `None` if the system does not report it.
fn peak(frames: i64) -> Option<u64> {
    let child = Command::new(std::env::current_exe().expect("this program"))
        .args(["overhead::child", "--exact", "--nocapture", "--test-threads=1"])
        .env(FRAMES, frames.to_string())
        .output()
        .expect("a process");
    assert!(child.status.success());
    let output = String::from_utf8_lossy(&child.stdout).into_owned();
    let peak = output.lines().find_map(|line| line.split_once("peak")).map(|(_, rest)| rest.replace("kB", ""));
    peak.and_then(|kilobytes| kilobytes.trim().parse().ok()).filter(|kilobytes| *kilobytes > 0)
}

#[test]
fn a_process_that_cooks_ten_times_the_frames_needs_no_more_memory() {
    let (Some(few), Some(many)) = (peak(100), peak(1_000)) else { return };
    // The report has one number per frame for each of 20 metrics.
    assert!(many < few + 2_000, "{few} kB for 100 frames, {many} kB for 1,000");
}
