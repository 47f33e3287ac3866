//! Every example graph loads without a fault and cooks to the bits stored in tests/graphs.txt, on any number of threads, in
//! any order of frames, with and without a cache. `cargo xtask bless graphs` stores the bits and shows what changed.
//!
//! Scenes with a solver are cooked to their fifth frame here, and to their last by `cargo bench --bench laws`.

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

mod bits;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::thread;

use bits::{Keys, cook, frames, graphs, has_chain, has_solver, lines, load};
use engine::cook::{DiskCache, Engine, Settings};
use engine::graph::Graph;
use engine::time::Frame;

/// The last frame to cook.
fn last(graph: &Graph) -> i64 {
    let scene = &graph.scene;
    if has_solver(graph) { scene.last.min(scene.first + 4) } else { scene.last }
}

/// Cooks an example in each of these ways, and returns the lines of its bits.
fn cook_in_all_ways(path: &Path) -> String {
    let graph = load(path);
    assert!(Engine::new(&Settings::default()).unwrap().verify(&graph, None).is_empty(), "{}", path.display());
    let frames = frames(&graph, last(&graph));
    let folder = tempfile::tempdir().unwrap();
    let cached = |state: &str| {
        let mut cache = DiskCache::open(folder.path(), u64::MAX);
        (cook(&graph, &frames, 1, Some(&mut cache)), format!("{}: {state} cache", path.display()))
    };
    let (expected, _) = cached("cold");
    let (warm, what) = cached("warm");
    assert_eq!(warm, expected, "{what}");
    let reversed: Vec<Frame> = frames.iter().rev().copied().collect();
    assert_eq!(cook(&graph, &reversed, 7, None), expected, "{}: reversed, 7 threads", path.display());
    // Behind a chain the last frame takes as long as all of them; engine/tests cook frames of chains alone.
    if !has_chain(&graph) {
        let last = [frames[2]];
        let alone: Keys =
            expected.iter().filter(|((_, frame), _)| *frame == last[0]).map(|(at, key)| (at.clone(), *key)).collect();
        assert_eq!(cook(&graph, &last, 2, None), alone, "{}: the last frame alone, 2 threads", path.display());
    }
    lines(path, &expected)
}

#[test]
fn every_example_has_the_stored_bits_however_it_is_cooked() {
    let texts = two_at_a_time(&graphs(), cook_in_all_ways);
    let text = texts.concat();
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

/// What `cook` returns for each of `paths`, in their order.
fn two_at_a_time(paths: &[PathBuf], cook: impl Fn(&Path) -> String + Sync) -> Vec<String> {
    let left = Mutex::new(paths.iter().enumerate());
    let cooked = Mutex::new(vec![String::new(); paths.len()]);
    let next = || left.lock().unwrap().next();
    thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some((index, path)) = next() {
                    let text = cook(path);
                    cooked.lock().unwrap()[index] = text;
                }
            });
        }
    });
    cooked.into_inner().unwrap()
}
