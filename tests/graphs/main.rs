//! Every example graph loads without a fault and cooks to the bits stored in tests/graphs.txt, on any number of threads, in
//! any order of frames, with and without a cache. `cargo xtask bless graphs` stores the bits and shows what changed.
//!
//! Scenes with a solver are cooked to their fifth frame here, and to their last by `cargo bench --bench laws`.

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

mod bits;

use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::thread;

use bits::{Keys, cook, frames, graphs, has_solver, lines, load};
use engine::cook::{DiskCache, Engine, Settings};
use engine::graph::Graph;
use engine::time::Frame;

/// The last frame to cook.
fn last(graph: &Graph) -> i64 {
    let scene = &graph.scene;
    if has_solver(graph) { scene.last.min(scene.first + 4) } else { scene.last }
}

#[test]
fn every_example_has_the_stored_bits() {
    let mut text = String::new();
    for path in graphs() {
        let graph = load(&path);
        assert!(Engine::new(&Settings::default()).unwrap().verify(&graph, None).is_empty(), "{}", path.display());
        text += &lines(&path, &cook(&graph, &frames(&graph, last(&graph)), 0, None));
    }
    let stored = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/graphs.txt");
    if std::env::var_os("BLESS").is_some() {
        fs::write(&stored, &text).unwrap();
    }
    let expected = fs::read_to_string(&stored).unwrap_or_default();
    assert_eq!(
        text, expected,
        "bits changed: if intended, raise the node's version and run `cargo xtask bless graphs`"
    );
}

/// Checks all examples, two at a time.
fn for_each_graph(check: impl Fn(&Path) + Sync) {
    let left = Mutex::new(graphs().into_iter());
    let next = || left.lock().unwrap().next();
    thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(path) = next() {
                    check(&path);
                }
            });
        }
    });
}

#[test]
fn bits_do_not_depend_on_threads_order_or_cache() {
    for_each_graph(|path| {
        let graph = load(path);
        let frames = frames(&graph, last(&graph));
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
            let mut cache = DiskCache::open(folder.path(), u64::MAX);
            assert_eq!(cook(&graph, &frames, 2, Some(&mut cache)), expected, "{}: {state} cache", path.display());
        }
    });
}
