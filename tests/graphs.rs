//! Every example graph loads without a fault and cooks, with the bits that are stored, whatever the threads, the order of
//! frames and the cache. `cargo xtask bless` stores them anew and shows what changed.

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use engine::cook::{Delivered, DiskCache, Engine, Settings};
use engine::geometry::Geometry;
use engine::graph::{Graph, probe};
use engine::key::{Hasher, Key};
use engine::node::Cook;
use engine::plan::Request;
use engine::time::Frame;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// graphs/NAME/NAME.json, by name.
fn graphs() -> Vec<PathBuf> {
    let folders = fs::read_dir(root().join("graphs")).unwrap().map(|entry| entry.unwrap().path());
    let mut found: Vec<PathBuf> = folders
        .map(|folder| folder.join(folder.file_name().unwrap()).with_extension("json"))
        .filter(|path| path.exists())
        .collect();
    found.sort();
    found
}

fn load(path: &Path) -> Graph {
    let text = fs::read_to_string(path).unwrap();
    Graph::load(&text, path.parent().unwrap(), convect::CATALOGUE, &[], &probe)
        .unwrap_or_else(|faults| panic!("{}: {}", path.display(), faults[0]))
}

/// First, middle and last frame of the scene; the first few where a solver has to run up to them.
fn frames(graph: &Graph) -> Vec<Frame> {
    let scene = &graph.scene;
    let runs = graph.nodes.iter().filter_map(|node| node.node()).any(|node| matches!(node.cook, Cook::Solver(..)));
    let last = if runs { scene.last.min(scene.first + 4) } else { scene.last };
    [scene.first, scene.first.midpoint(last), last].map(Frame::whole).to_vec()
}

/// Everything in a geometry, as one key.
fn key(geometry: &Geometry) -> Key {
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

type Keys = BTreeMap<(String, Frame), Key>;

fn cook(graph: &Graph, frames: &[Frame], threads: usize, disk: Option<&mut DiskCache>) -> Keys {
    let engine = Engine::new(&Settings { threads, memory: 1 << 28 }).unwrap();
    let request = Request { outputs: (0..graph.outputs.len()).collect(), frames: frames.to_vec() };
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

#[test]
fn every_example_has_the_bits_that_are_stored() {
    let mut text = String::new();
    for path in graphs() {
        let graph = load(&path);
        assert!(Engine::new(&Settings::default()).unwrap().verify(&graph, None).is_empty(), "{}", path.display());
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        for ((output, frame), key) in cook(&graph, &frames(&graph), 0, None) {
            writeln!(text, "{name} {output} {frame} {key}").unwrap();
        }
    }
    let stored = root().join("tests/graphs.txt");
    if std::env::var_os("BLESS").is_some() {
        fs::write(&stored, &text).unwrap();
    }
    let expected = fs::read_to_string(&stored).unwrap_or_default();
    assert_eq!(text, expected, "bits changed: if they should, raise the node's version and run `cargo xtask bless`");
}

#[test]
fn bits_depend_on_neither_threads_nor_order_nor_cache() {
    for path in graphs() {
        let graph = load(&path);
        let frames = frames(&graph);
        let expected = cook(&graph, &frames, 2, None);
        let reversed: Vec<Frame> = frames.iter().rev().copied().collect();
        assert_eq!(cook(&graph, &reversed, 1, None), expected, "{}: reversed, 1 thread", path.display());
        assert_eq!(cook(&graph, &frames, 7, None), expected, "{}: 7 threads", path.display());
        let last = [frames[2]];
        let alone: Keys =
            expected.iter().filter(|((_, frame), _)| *frame == last[0]).map(|(at, key)| (at.clone(), *key)).collect();
        assert_eq!(cook(&graph, &last, 2, None), alone, "{}: the last frame alone", path.display());
        let folder = tempfile::tempdir().unwrap();
        for state in ["cold", "warm"] {
            let mut cache = DiskCache::open(folder.path(), u64::MAX).unwrap();
            assert_eq!(cook(&graph, &frames, 2, Some(&mut cache)), expected, "{}: {state} cache", path.display());
        }
    }
}
