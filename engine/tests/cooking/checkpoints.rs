//! The cache on disk: a resumed cook has the same bits as an uninterrupted one.

use std::fs;
use std::path::{Path, PathBuf};

use engine::cook::DiskCache;
use engine::param::{Source, Value};
use engine::time::Frame;

use crate::builder::{Cooked, TestGraph, engine, keyed};
use crate::nodes::{ADD, BOUNCE, CLOCK, FOLLOW, SOURCE};

pub(crate) fn solver() -> TestGraph {
    let mut graph = TestGraph::new(1, 60);
    let a = graph.add("a", &SOURCE).set("amount", 2.0_f32).set("count", 50_i64).done();
    let clock = graph.add("clock", &CLOCK).set("amount", 0.01_f32).wire("points", a).done();
    let floor = graph.add("floor", &FOLLOW).set("frames", 9_i64).wire("points", clock).done();
    let bounce = graph.add("bounce", &BOUNCE).wire("points", a).wire("floor", floor).done();
    graph.add("add", &ADD).wire("points", bounce).out();
    graph
}

fn cook(graph: &TestGraph, frames: std::ops::RangeInclusive<i64>, folder: &Path) -> Cooked {
    let mut disk = DiskCache::open(folder, u64::MAX).expect("a folder");
    let frames: Vec<Frame> = frames.map(Frame::whole).collect();
    graph.cook_with(&engine(2, 1 << 30), &frames, Some(&mut disk))
}

fn files(folder: &Path, kind: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|e| e == kind)).collect();
    files.sort();
    files
}

#[test]
fn a_resumed_cook_has_the_same_bits_and_cooks_only_the_rest() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = solver();
    let whole = graph.cook(1..=40).bits();
    cook(&graph, 1..=23, folder.path());
    let resumed = cook(&graph, 1..=40, folder.path());
    assert!(resumed.bits() == whole);
    assert_eq!(resumed.report.from_disk, 23);
    assert_eq!(resumed.cooks("bounce"), 17);
    assert_eq!(resumed.node("bounce").from_cache, 1);
    let again = cook(&graph, 1..=40, folder.path());
    assert!(again.bits() == whole);
    assert_eq!((again.report.from_disk, again.cooks("bounce"), again.cooks("clock")), (40, 0, 0));
}

#[test]
fn a_single_frame_starts_from_the_last_checkpoint_before_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = solver();
    cook(&graph, 1..=30, folder.path());
    files(folder.path(), "frame").iter().for_each(|path| fs::remove_file(path).expect("a file"));
    // Every eighth is kept, and the last two: 8, 16, 24, 29, 30.
    assert_eq!(files(folder.path(), "checkpoint").len(), 5);
    let alone = cook(&graph, 21..=21, folder.path());
    assert_eq!(alone.x(21.0).to_bits(), graph.cook([21]).x(21.0).to_bits());
    assert_eq!(alone.cooks("bounce"), 5, "from the state of frame 16");
}

#[test]
fn results_with_another_param_upstream_are_not_restored() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = solver();
    cook(&graph, 1..=20, folder.path());
    let other = graph.clone().with("clock", "amount", Source::Constant(Value::Float(0.02)));
    let cooked = cook(&other, 1..=20, folder.path());
    assert_eq!((cooked.report.from_disk, cooked.cooks("bounce")), (0, 20));
    assert!(cooked.bits() == other.cook(1..=20).bits());
}

#[test]
fn a_change_from_a_frame_on_keeps_earlier_checkpoints() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = solver();
    cook(&graph, 1..=20, folder.path());
    let other = graph.clone().with("bounce", "gravity", keyed(&[(17.0, -9.81), (18.0, 0.0)]));
    let cooked = cook(&other, 1..=20, folder.path());
    assert_eq!(cooked.report.from_disk, 17);
    assert_eq!(cooked.cooks("bounce"), 4, "from the state of frame 16");
    assert!(cooked.bits() == other.cook(1..=20).bits());
}

#[test]
fn damaged_files_are_ignored() {
    let graph = solver();
    let whole = graph.cook(1..=30).bits();
    let damages: [fn(&Path); 4] = [
        |path| fs::write(path, b"").expect("a file"),
        |path| fs::write(path, b"no cache at all, but longer than a checksum is").expect("a file"),
        |path| {
            let mut bytes = fs::read(path).expect("a file");
            let middle = bytes.len() / 2;
            bytes[middle] ^= 1;
            fs::write(path, bytes).expect("a file");
        },
        |path| {
            let bytes = fs::read(path).expect("a file");
            fs::write(path, &bytes[..bytes.len() - 3]).expect("a file");
        },
    ];
    for damage in damages {
        let folder = tempfile::tempdir().expect("a folder");
        cook(&graph, 1..=20, folder.path());
        for kind in ["frame", "checkpoint"] {
            files(folder.path(), kind).iter().for_each(|path| damage(path));
        }
        let cooked = cook(&graph, 1..=30, folder.path());
        assert!(cooked.bits() == whole);
        assert_eq!((cooked.report.from_disk, cooked.cooks("bounce")), (0, 30));
    }
}

#[test]
fn a_cache_of_another_version_is_ignored_with_a_note() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = solver();
    cook(&graph, 1..=10, folder.path());
    fs::write(folder.path().join("version"), "convect 0.0.1 cache 0").expect("a file");
    let cooked = cook(&graph, 1..=10, folder.path());
    assert_eq!(cooked.report.from_disk, 0);
    let note = cooked.report.notes.join("");
    assert!(note.ends_with("was made by another version and is not used"), "{note}");
    assert!(cook(&graph, 1..=10, folder.path()).report.notes.is_empty());
}

#[test]
fn a_limited_cache_stays_below_its_limit() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = solver();
    let limit = 5_000;
    let mut disk = DiskCache::open(folder.path(), limit).expect("a folder");
    let frames: Vec<Frame> = (1..=40).map(Frame::whole).collect();
    let cooked = graph.cook_with(&engine(1, 1 << 30), &frames, Some(&mut disk));
    assert!(cooked.bits() == graph.cook(1..=40).bits());
    let bytes =
        |kind| files(folder.path(), kind).iter().map(|path| fs::metadata(path).expect("a file").len()).sum::<u64>();
    let total = bytes("frame") + bytes("checkpoint");
    assert!(total <= limit && total > 0, "{total}");
    assert!(cook(&graph, 1..=40, folder.path()).bits() == cooked.bits());
}

#[test]
fn geometry_of_the_calling_program_is_not_cached_on_disk() {
    let folder = tempfile::tempdir().expect("a folder");
    for x in [1.0_f32, 2.0] {
        let mut graph = TestGraph::new(1, 10);
        let given = graph.given("given", move |_| crate::builder::row(&[x]));
        graph.add("bounce", &BOUNCE).wire("points", given).out();
        let cooked = cook(&graph, 1..=10, folder.path());
        assert_eq!(cooked.x(1.0), x);
        assert_eq!(cooked.cooks("bounce"), 10);
    }
}
