//! The example graphs, and the bits that they cook to.

#![allow(dead_code, reason = "each suite uses part of it")]

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use engine::cook::{Delivered, DiskCache, Engine, Settings};
use engine::geometry::Geometry;
use engine::graph::{Graph, probe};
use engine::key::{ContentKey, Hasher};
use engine::node::Cook;
use engine::plan::Request;
use engine::time::Frame;

/// For each output and frame a hash of the whole geometry.
pub(crate) type Keys = BTreeMap<(String, Frame), ContentKey>;

/// graphs/NAME/NAME.json, by name.
pub(crate) fn graphs() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs");
    let folders = fs::read_dir(root).unwrap().map(|entry| entry.unwrap().path());
    let mut found: Vec<PathBuf> = folders
        .map(|folder| folder.join(folder.file_name().unwrap()).with_extension("json"))
        .filter(|path| path.exists())
        .collect();
    found.sort();
    found
}

pub(crate) fn load(path: &Path) -> Graph {
    let text = fs::read_to_string(path).unwrap();
    Graph::load(&text, path.parent().unwrap(), convect::CATALOGUE, &[], &probe)
        .unwrap_or_else(|faults| panic!("{}: {}", path.display(), faults[0]))
}

/// Whether a frame depends on all frames before it.
pub(crate) fn has_solver(graph: &Graph) -> bool {
    graph.nodes.iter().filter_map(|node| node.node()).any(|node| matches!(node.cook, Cook::Solver(..)))
}

/// Whether a frame depends on frames before it.
pub(crate) fn has_chain(graph: &Graph) -> bool {
    let chain = |cook: &Cook| matches!(cook, Cook::Solver(..) | Cook::Window(..));
    graph.nodes.iter().filter_map(|node| node.node()).any(|node| chain(&node.cook))
}

/// The scene's first frame, `last`, and the one in the middle.
pub(crate) fn frames(graph: &Graph, last: i64) -> [Frame; 3] {
    let first = graph.scene.first;
    [first, first.midpoint(last), last].map(Frame::whole)
}

/// A line for each output and frame: graph, output, frame, hash.
pub(crate) fn lines(path: &Path, keys: &Keys) -> String {
    let name = path.file_stem().unwrap().to_string_lossy();
    keys.iter().fold(String::new(), |mut text, ((output, frame), key)| {
        writeln!(text, "{name} {output} {frame} {key}").unwrap();
        text
    })
}

pub(crate) fn cook(graph: &Graph, frames: &[Frame], threads: usize, disk: Option<&mut DiskCache>) -> Keys {
    let engine = Engine::new(&Settings { threads, memory: 1 << 28, ..Settings::default() }).unwrap();
    let request = Request { outputs: (0..graph.outputs.len()).collect(), frames: frames.to_vec().into() };
    let mut keys = Keys::new();
    let mut sink = |finished: &[Delivered]| -> Result<(), Infallible> {
        keys.extend(
            finished.iter().map(|one| ((graph.outputs[one.output].name.to_string(), one.frame), key(&one.geometry))),
        );
        Ok(())
    };
    let report = engine.cook(graph, &request, disk, &AtomicBool::new(false), &mut sink).unwrap();
    assert!(report.errors.is_empty(), "{}", report.errors[0].1);
    keys
}

fn key(geometry: &Geometry) -> ContentKey {
    let mut hasher = Hasher::default();
    for part in geometry.parts() {
        hasher.text(part.kind().name()).i64(part.element_count() as i64).i64(part.point_count() as i64);
        part.runs().starts().iter().for_each(|start| {
            hasher.i64(i64::from(*start));
        });
        for corner in part.faces().iter().flat_map(|faces| &faces.corners) {
            hasher.i64(i64::from(*corner));
        }
        for corner in part.tet_corners().as_flattened() {
            hasher.i64(i64::from(*corner));
        }
        for (owner, name, column) in part.columns() {
            hasher.i64(owner as i64).text(name).bytes(&column.to_bytes());
        }
    }
    hasher.finish()
}
