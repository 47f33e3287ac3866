//! Graphs on the assets of `graphs/`, cooked in memory.

#![allow(dead_code, reason = "each suite takes what it needs")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use conformance::cook_all;
use engine::cook::{Engine, Report, Settings};
use engine::geometry::Geometry;
use engine::graph::{Graph, GraphOutput, Link, probe};
use engine::time::Frame;

/// The bear, and its fur.
pub(crate) const BEAR: &str = r#"
    "fur": { "type": "Curve_In", "params": { "file": "../assets/fur_bear_10k_curves.obj" } },
    "skin": { "type": "Mesh_In", "params": { "file": "../assets/bear.obj" } },"#;

/// Frames of each output.
type Frames = Vec<Vec<Geometry>>;

/// Metrics by node, name and frame.
pub(crate) type Metrics = BTreeMap<String, BTreeMap<String, BTreeMap<Frame, f64>>>;

/// A graph of these nodes, over frames 1…`frames`, with these outputs.
pub(crate) fn graph(nodes: &str, outputs: &[&str], frames: i64) -> Graph {
    load(&text(nodes, outputs, frames), outputs, &[]).unwrap_or_else(|fault| panic!("{fault}"))
}

/// The first fault of such a graph.
pub(crate) fn fault(nodes: &str, output: &str) -> Option<String> {
    load(&text(nodes, &[output], 1), &[output], &[]).err()
}

fn text(nodes: &str, outputs: &[&str], frames: i64) -> String {
    format!(
        r#"{{ "convect": 1, "scene": {{ "frames": [1, {frames}], "seed": 7 }},
              "nodes": {{ {nodes} }}, "outputs": {{ "out": "{}" }} }}"#,
        outputs[0]
    )
}

/// Cooks every output of these nodes at frames 1…`frames`.
pub(crate) fn cook(nodes: &str, outputs: &[&str], frames: i64) -> Frames {
    cook_graph(&graph(nodes, outputs, frames), frames).0
}

/// As [`cook`], of an example's nodes; and all metrics.
pub(crate) fn cook_file(example: &str, outputs: &[&str], frames: i64) -> (Frames, Metrics) {
    cook_file_with(example, outputs, frames, &[])
}

/// The same with other values of some params.
pub(crate) fn cook_file_with(example: &str, outputs: &[&str], frames: i64, set: &[(&str, &str)]) -> (Frames, Metrics) {
    let path = graphs().join(example).join(example).with_extension("json");
    let graph = load(&fs::read_to_string(path).unwrap(), outputs, set).unwrap_or_else(|fault| panic!("{fault}"));
    cook_graph(&graph, frames)
}

/// The first output at `frames`, cooked in that order on `threads` threads.
pub(crate) fn cook_in_order(graph: &Graph, frames: &[i64], threads: usize) -> Vec<Arc<Geometry>> {
    let engine = Engine::new(&Settings { threads, ..Settings::default() }).unwrap();
    let frames: Vec<Frame> = frames.iter().copied().map(Frame::whole).collect();
    let (found, report) = cook_all(&engine, graph, &frames);
    assert!(report.errors.is_empty(), "{}", report.errors[0].1);
    frames.iter().map(|frame| found[&(0, *frame)].clone()).collect()
}

fn graphs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs")
}

fn load(text: &str, outputs: &[&str], set: &[(&str, &str)]) -> Result<Graph, String> {
    let folder = graphs().join("bear_wind");
    let set: Vec<(String, String)> = set.iter().map(|(key, json)| (key.to_string(), json.to_string())).collect();
    let graph = Graph::load(text, &folder, convect::CATALOGUE, &set, &probe);
    let mut graph = graph.map_err(|faults| faults[0].to_string())?;
    graph.outputs = outputs.iter().map(|name| output(&graph, name)).collect();
    Ok(graph)
}

/// The result of a node, or of `"node.port"`.
fn output(graph: &Graph, name: &str) -> GraphOutput {
    let (id, port) = name.split_once('.').unwrap_or((name, ""));
    let node = graph.nodes.iter().position(|node| &*node.id == id).unwrap();
    let ports = graph.nodes[node].node().map_or(&[][..], |node| node.outputs);
    let port = ports.iter().position(|output| output.name == port).unwrap_or(0);
    GraphOutput { name: name.into(), from: Link { node, port }, attributes: None, v: false }
}

fn cook_graph(graph: &Graph, frames: i64) -> (Frames, Metrics) {
    let engine = Engine::new(&Settings::default()).unwrap();
    let asked: Vec<Frame> = (1..=frames).map(Frame::whole).collect();
    let (found, report) = cook_all(&engine, graph, &asked);
    assert!(report.errors.is_empty(), "{}", report.errors[0].1);
    let of_output =
        |output: usize| asked.iter().map(|frame| (*found[&(output, *frame)]).clone()).collect::<Vec<Geometry>>();
    ((0..graph.outputs.len()).map(of_output).collect(), metrics(graph, report))
}

/// All published metrics.
pub(crate) fn metrics(graph: &Graph, report: Report) -> Metrics {
    let metrics = graph.nodes.iter().zip(report.nodes).map(|(node, report)| {
        let named = report.metrics.into_iter().map(|(name, values)| (name.to_string(), values));
        (node.id.to_string(), named.collect())
    });
    metrics.collect()
}
