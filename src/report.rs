//! The report of a cook as JSON, as `--report` writes it.

use std::time::Duration;

use engine::cook::{NodeReport, Report};
use engine::frames::FrameSet;
use engine::graph::Graph;
use engine::key::ContentKey;
use engine::note::Note;
use engine::time::Frame;
use serde_json::{Map, Value, json};

use crate::args::Setting;
use crate::output::Written;

/// What a report contains in addition to the engine's measurements.
pub struct Cooked<'a> {
    /// The graph's path.
    pub graph_path: String,
    /// What it was cooked by, as [`recipe`] says it.
    pub recipe: Value,
    /// The graph.
    pub graph: &'a Graph,
    /// Requested frames.
    pub frames: &'a FrameSet,
    /// What was written.
    pub written: &'a [Written],
    /// Number of threads.
    pub threads: usize,
    /// Wall time of writing.
    pub writing: Duration,
    /// The file beside the report that has the tips of the first and the last frame of a part.
    pub tips: Option<&'a str>,
}

/// What a cook is by: the version of the program, a hash of the bytes of the graph's file, and what `--set` changed, by
/// key.
pub fn recipe(graph: &[u8], set: &[Setting]) -> Value {
    let set: Map<String, Value> = set.iter().map(|Setting(key, value)| (key.clone(), json!(value))).collect();
    json!({"version": env!("CARGO_PKG_VERSION"), "graph": ContentKey::of(graph).to_string(), "set": set})
}

/// The report.
pub fn to_json(report: &Report, cooked: &Cooked) -> Value {
    let nodes: Map<String, Value> =
        report.nodes.iter().filter_map(|node| Some((node.id.as_ref()?.to_string(), node_to_json(node)))).collect();
    let outputs: Map<String, Value> = cooked
        .written
        .iter()
        .map(|written| {
            let from = |index: &usize| &*cooked.graph.nodes[cooked.graph.outputs[*index].from.node].id;
            let from: Vec<&str> = written.outputs.iter().map(from).collect();
            let errors = report.errors.iter().filter(|(failed, _, _)| written.outputs.contains(failed));
            let errors: Vec<Value> = errors
                .map(|(_, error, frames)| {
                    json!({
                        "node": *error.node, "frame": error.frame.to_json(), "frames": frames,
                        "fact": error.error.fact, "hint": error.error.hint,
                    })
                })
                .collect();
            let files: Vec<String> = written.files.iter().map(|path| path.display().to_string()).collect();
            let value = json!({
                "from": if let [from] = from[..] { json!(from) } else { json!(from) },
                "frames": written.frames.len(),
                "bytes": written.bytes,
                "files": files,
                "errors": errors,
            });
            (written.name(cooked.graph).to_owned(), value)
        })
        .collect();
    // Of an interrupted cook only those that it reached, because a scene may have a billion.
    let reached = cooked.written.iter().filter_map(|written| written.frames.last()).max();
    let was_reached = |frame: &Frame| !report.cancelled || reached.is_some_and(|reached| frame <= reached);
    let frames: Vec<Value> = cooked.frames.iter().take_while(was_reached).map(Frame::to_json).collect();
    let seconds = report.cooking.as_secs_f64();
    let delivered = report.delivered.values().copied().max().unwrap_or(0);
    let mut json = json!({
        "report": 1,
        "graph": cooked.graph_path,
        "recipe": cooked.recipe,
        "frames": frames,
        "nodes": nodes,
        "outputs": outputs,
        "notes": report.notes.iter().map(Note::to_json).collect::<Vec<Value>>(),
        "total": {
            "cooking_ms": ms(report.cooking),
            "writing_ms": ms(cooked.writing),
            "wall_ms": ms(report.wall),
            "cpu_ms": ms(report.cpu),
            "frames_per_second": if seconds > 0.0 { delivered as f64 / seconds } else { 0.0 },
            "peak_bytes": report.peak_bytes,
            "threads": cooked.threads,
            "simd": numerics::simd::Path::chosen().name(),
            "from_disk": report.from_disk,
            "interrupted": report.cancelled,
        },
    });
    if let Some(tips) = cooked.tips {
        json["tips"] = json!(tips);
    }
    json
}

fn node_to_json(node: &NodeReport) -> Value {
    let left_out: Vec<Value> = match node.needed {
        true => node.left_out.iter().map(|stage| json!({"stage": stage.stage, "why": stage.why})).collect(),
        false => vec![json!({"stage": "all", "why": why_not_needed(node)})],
    };
    let metrics: Map<String, Value> = node
        .metrics
        .iter()
        .map(|(name, values)| {
            let values: Map<String, Value> = match values.values().next() {
                // The same at all frames, not only at the one at which the node was cooked.
                Some(value) if !node.varies => Map::from_iter([(STILL.to_owned(), json!(value))]),
                _ => values.iter().map(|(frame, value)| (frame.to_string(), json!(value))).collect(),
            };
            ((*name).to_owned(), Value::Object(values))
        })
        .collect();
    json!({
        "type": node.type_name,
        "time": node.time,
        "varies": node.varies,
        "cooks": node.cooks,
        "from_cache": node.from_cache,
        "from_disk": node.from_disk,
        "left_out": left_out,
        "wall_ms": ms(node.wall),
        "cpu_ms": ms(node.cpu),
        "peak_bytes": node.peak_bytes,
        "metrics": metrics,
    })
}

/// In place of a frame, of metrics of a node whose result does not vary.
const STILL: &str = "still";

/// Why a node without dependents is left out.
pub fn why_not_needed(node: &NodeReport) -> &'static str {
    if node.bypassed { "`bypass` is true" } else { "no requested output depends on it" }
}

fn ms(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e6).round() / 1e3
}
