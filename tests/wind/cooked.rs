//! Graphs on the assets of `graphs/`, cooked in memory.

use std::convert::Infallible;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use engine::cook::{Delivered, Engine, Settings};
use engine::geometry::Geometry;
use engine::graph::{Graph, probe};
use engine::plan::Request;
use engine::time::Frame;

/// The bear, and its fur.
pub(crate) const BEAR: &str = r#"
    "fur": { "type": "Curve_In", "params": { "file": "../assets/fur_bear_10k_curves.obj" } },
    "skin": { "type": "Mesh_In", "params": { "file": "../assets/bear.obj" } },"#;

/// What the outputs of these nodes deliver at frames 1…`frames`: of each output all frames.
pub(crate) fn cook(nodes: &str, outputs: &[&str], frames: i64) -> Vec<Vec<Geometry>> {
    let listed: Vec<String> = outputs.iter().map(|name| format!(r#""{name}": "{name}""#)).collect();
    let text = format!(
        r#"{{ "convect": 1, "scene": {{ "frames": [1, {frames}], "seed": 7 }},
              "nodes": {{ {nodes} }}, "outputs": {{ {} }} }}"#,
        listed.join(", ")
    );
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/bear_wind");
    let graph =
        Graph::load(&text, &folder, convect::CATALOGUE, &[], &probe).unwrap_or_else(|faults| panic!("{}", faults[0]));
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
    found
}
