//! Graphs on the assets of `graphs/`, cooked in memory.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use engine::cook::{Delivered, Engine, Settings};
use engine::geometry::Geometry;
use engine::graph::{Graph, GraphOutput, Link, probe};
use engine::plan::Request;
use engine::time::Frame;

/// The bear, and its fur.
pub(crate) const BEAR: &str = r#"
    "fur": { "type": "Curve_In", "params": { "file": "../assets/fur_bear_10k_curves.obj" } },
    "skin": { "type": "Mesh_In", "params": { "file": "../assets/bear.obj" } },"#;

/// Frames of each output.
type Frames = Vec<Vec<Geometry>>;

/// What these nodes deliver at frames 1…`frames`: of each output all frames.
pub(crate) fn cook(nodes: &str, outputs: &[&str], frames: i64) -> Frames {
    let text = format!(
        r#"{{ "convect": 1, "scene": {{ "frames": [1, {frames}], "seed": 7 }},
              "nodes": {{ {nodes} }}, "outputs": {{ "out": "{}" }} }}"#,
        outputs[0]
    );
    cook_text(&text, outputs, frames).0
}

/// As [`cook`], of an example's nodes; and all metrics, by node, name and frame.
pub(crate) fn cook_file(example: &str, outputs: &[&str], frames: i64) -> (Frames, Metrics) {
    let path = graphs().join(example).join(example).with_extension("json");
    cook_text(&fs::read_to_string(path).unwrap(), outputs, frames)
}

/// By node, name and frame.
pub(crate) type Metrics = BTreeMap<String, BTreeMap<String, BTreeMap<Frame, f64>>>;

fn graphs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs")
}

fn cook_text(text: &str, outputs: &[&str], frames: i64) -> (Frames, Metrics) {
    let folder = graphs().join("bear_wind");
    let mut graph =
        Graph::load(text, &folder, convect::CATALOGUE, &[], &probe).unwrap_or_else(|faults| panic!("{}", faults[0]));
    graph.outputs = outputs
        .iter()
        .map(|name| {
            let node = graph.nodes.iter().position(|node| &*node.id == *name).unwrap();
            GraphOutput { name: (*name).into(), from: Link { node, port: 0 }, attributes: None, v: false }
        })
        .collect();
    let engine = Engine::new(&Settings::default()).unwrap();
    let request = Request { outputs: (0..outputs.len()).collect(), frames: (1..=frames).map(Frame::whole).collect() };
    let mut found = vec![vec![Geometry::default(); frames as usize]; outputs.len()];
    let mut sink = |finished: &[Delivered]| -> Result<(), Infallible> {
        for one in finished {
            found[one.output][one.frame.number() as usize - 1] = (*one.geometry).clone();
        }
        Ok(())
    };
    let report = engine.cook(&graph, &request, None, &AtomicBool::new(false), &mut sink).unwrap();
    assert!(report.errors.is_empty(), "{}", report.errors[0].1);
    let metrics = graph.nodes.iter().zip(report.nodes).map(|(node, report)| {
        let named = report.metrics.into_iter().map(|(name, values)| (name.to_string(), values.into_iter().collect()));
        (node.id.to_string(), named.collect())
    });
    (found, metrics.collect())
}
