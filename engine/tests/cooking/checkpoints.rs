//! The cache on disk: a resumed cook has the same bits as an uninterrupted one.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use engine::cook::{Delivered, DiskCache};
use engine::geometry::Kind;
use engine::node::{Cook, Node, Output};
use engine::note::Note;
use engine::param::{Source, Value};
use engine::plan::Request;
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
    let mut disk = DiskCache::open(folder, u64::MAX);
    let frames: Vec<Frame> = frames.map(Frame::whole).collect();
    graph.cook_with(&engine(2, 1 << 30), &frames, Some(&mut disk))
}

/// The subfolder of the cache that this version of convect owns.
pub(crate) fn own(cache: &Path) -> PathBuf {
    let entries = fs::read_dir(cache).expect("a folder").map(|entry| entry.expect("an entry").path());
    let mut own = entries.filter(|path| path.to_string_lossy().ends_with("-cache-5"));
    own.next().expect("a subfolder")
}

fn files(folder: &Path, kind: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(own(folder)).expect("a folder").map(|entry| entry.expect("an entry").path());
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
    // On a busy machine a step may take long enough for its result, or its state, to be kept too.
    for kind in ["frame", "result"] {
        files(folder.path(), kind).iter().for_each(|path| fs::remove_file(path).expect("a file"));
    }
    // Every eighth is kept, and the last two: 8, 16, 24, 29, 30.
    let kept = files(folder.path(), "checkpoint").len();
    let alone = cook(&graph, 21..=21, folder.path());
    assert_eq!(alone.x(21.0).to_bits(), graph.cook([21]).x(21.0).to_bits());
    let cooks = alone.cooks("bounce");
    assert!(
        (kept, cooks) == (5, 5) || (kept > 5 && cooks <= 5),
        "{kept} states; {cooks} steps, not from that of frame 16"
    );
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
fn a_cache_of_another_version_is_ignored_with_a_note_and_stays() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = solver();
    cook(&graph, 1..=10, folder.path());
    let other = folder.path().join("convect-0.0.1-cache-0");
    fs::rename(own(folder.path()), &other).expect("a folder");
    let entries = || fs::read_dir(&other).expect("a folder").count();
    let before = entries();
    let cooked = cook(&graph, 1..=10, folder.path());
    assert_eq!(cooked.report.from_disk, 0);
    let note: String = cooked.report.notes.iter().map(Note::to_string).collect();
    assert!(note.contains("was made by another version (`convect-0.0.1-cache-0`), which is not used"), "{note}");
    assert_eq!(entries(), before, "the other version may be in use");
    let again = cook(&graph, 1..=10, folder.path());
    assert!(again.report.notes.is_empty() && again.report.from_disk == 10);
}

/// What may lie in a cache beside convect's own files or in place of them.
#[cfg(unix)]
mod hostile {
    use super::*;

    #[test]
    fn files_of_other_programs_stay_whatever_their_names() {
        let folder = tempfile::tempdir().expect("a folder");
        let graph = solver();
        let key = "0123456789abcdef0123456789abcdef";
        let names =
            ["version", "a.checkpoint", "a.frame", "a.part", &format!("{key}.frame"), "b.frame.4294967294.part"];
        let put = |into: &Path| names.iter().for_each(|name| fs::write(into.join(name), "mine").expect("a file"));
        let stay = |into: &Path| names.iter().all(|name| fs::read(into.join(name)).is_ok_and(|text| text == b"mine"));
        put(folder.path());
        cook(&graph, 1..=10, folder.path());
        assert!(stay(folder.path()));
        let mut disk = DiskCache::open(folder.path(), 0);
        let frames: Vec<Frame> = (1..=10).map(Frame::whole).collect();
        graph.cook_with(&engine(2, 1 << 30), &frames, Some(&mut disk));
        assert!(stay(folder.path()), "with a limit too");
        for name in ["a.checkpoint", "a.frame", "a.part", "b.frame.4294967294.part", "notes.txt"] {
            fs::write(own(folder.path()).join(name), "mine").expect("a file");
        }
        DiskCache::open(folder.path(), 0);
        assert_eq!(
            fs::read_dir(own(folder.path())).expect("a folder").count(),
            5,
            "not convect's, though in its folder"
        );
    }

    #[test]
    fn what_lies_in_place_of_an_entry_is_a_note_and_not_a_hang() {
        let graph = solver();
        let whole = graph.cook(1..=12).bits();
        let elsewhere = tempfile::tempdir().expect("a folder");
        let precious = elsewhere.path().join("precious");
        type Put<'a> = Box<dyn Fn(&Path) + 'a>;
        let things: [(&str, Put<'_>); 6] = [
            ("folder", Box::new(|path| fs::create_dir(path).expect("a folder"))),
            (
                "pipe",
                Box::new(|path| {
                    let made = std::process::Command::new("mkfifo").arg(path).status().expect("mkfifo");
                    assert!(made.success());
                }),
            ),
            ("socket", Box::new(|path| drop(std::os::unix::net::UnixListener::bind(path).expect("a socket")))),
            ("endless", Box::new(|path| std::os::unix::fs::symlink("/dev/zero", path).expect("a link"))),
            ("link", Box::new(|path| std::os::unix::fs::symlink(&precious, path).expect("a link"))),
            ("sparse", Box::new(|path| fs::File::create(path).and_then(|file| file.set_len(6 << 30)).expect("a file"))),
        ];
        for (name, put) in &things {
            fs::write(&precious, "mine").expect("a file");
            let folder = tempfile::tempdir().expect("a folder");
            cook(&graph, 1..=12, folder.path());
            for path in [files(folder.path(), "frame"), files(folder.path(), "checkpoint")].concat() {
                // Its address may be too long for a socket.
                fs::remove_file(&path).expect("a file");
                let short = elsewhere.path().join("thing");
                put(&short);
                fs::rename(short, path).expect("a thing");
            }
            for _ in 0..2 {
                let cooked = cook(&graph, 1..=12, folder.path());
                assert!(cooked.bits() == whole, "{name}");
                let notes: String = cooked.report.notes.iter().map(Note::to_string).collect();
                let again = notes.is_empty() && *name == "sparse" && cooked.report.from_disk == 12;
                assert!(again || notes.contains("could not be used; cooked again instead: `"), "{name}: {notes}");
            }
            assert_eq!(fs::read(&precious).expect("a file"), b"mine", "{name}");
        }
    }

    #[test]
    fn a_cache_that_is_no_folder_is_a_note() {
        let folder = tempfile::tempdir().expect("a folder");
        let graph = solver();
        let place = folder.path().join("place");
        for name in ["file", "link", "subfolder"] {
            match name {
                "file" => fs::write(&place, "mine").expect("a file"),
                "link" => std::os::unix::fs::symlink("nowhere/at/all", &place).expect("a link"),
                _ => {
                    let cache = folder.path().join("cache");
                    cook(&graph, 1..=2, &cache);
                    let own = own(&cache);
                    fs::remove_dir_all(&own).expect("a folder");
                    fs::write(folder.path().join("precious"), "mine").expect("a file");
                    std::os::unix::fs::symlink(folder.path(), own).expect("a link");
                    fs::rename(cache, &place).expect("a folder");
                }
            }
            let cooked = cook(&graph, 1..=4, &place);
            let notes: String = cooked.report.notes.iter().map(Note::to_string).collect();
            assert!(
                notes.contains("could not be written") && notes.ends_with("continues without it"),
                "{name}: {notes}"
            );
            assert_eq!(cooked.bits().len(), 4);
            match name {
                "subfolder" => assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 2),
                _ => fs::remove_file(&place).expect("a file"),
            }
        }
    }

    #[test]
    fn left_overs_of_any_process_go_by_age_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        DiskCache::open(folder.path(), u64::MAX);
        let own = own(folder.path());
        let part = |number: u32| own.join(format!(".{number:032x}.frame.0badcafe-4294967294-{number:016x}.part"));
        for number in 0..2 {
            fs::write(part(number), "half").expect("a file");
        }
        let old = fs::metadata(part(0)).and_then(|about| about.modified()).expect("a time")
            - std::time::Duration::from_secs(7200);
        fs::File::options().append(true).open(part(0)).and_then(|file| file.set_modified(old)).expect("a time");
        DiskCache::open(folder.path(), u64::MAX);
        assert!(!part(0).exists(), "nobody has written to it for two hours");
        assert!(part(1).exists(), "another machine may be writing it");
    }
}

#[test]
fn a_change_cooks_only_what_comes_after_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let cook = |graph: &TestGraph, frames: std::ops::RangeInclusive<i64>| {
        let mut disk = DiskCache::open(folder.path(), u64::MAX).keeping_all();
        let frames: Vec<Frame> = frames.map(Frame::whole).collect();
        graph.cook_with(&engine(2, 1 << 30), &frames, Some(&mut disk))
    };
    let graph = solver();
    cook(&graph, 1..=20);
    let other = graph.clone().with("add", "amount", Source::Constant(Value::Float(3.0)));
    let changed = cook(&other, 1..=20);
    let fresh = other.cook(1..=20);
    assert!(changed.bits() == fresh.bits() && changed.bits() != graph.cook(1..=20).bits());
    assert_eq!((changed.cooks("clock"), changed.cooks("floor"), changed.cooks("bounce")), (0, 0, 0));
    assert_eq!((changed.cooks("add"), changed.node("bounce").from_cache), (20, 20));
    for id in ["a", "clock", "floor", "bounce", "add"] {
        for (name, values) in &fresh.node(id).metrics {
            // Half a step further on, inputs are read beyond the frames asked.
            let asked = values.iter().filter(|(frame, _)| **frame <= Frame::whole(20));
            assert!(asked.eq(&changed.node(id).metrics[name]), "{id}: {name}");
        }
    }
}

/// The output of [`SLOW`].
const OUT: Output = Output::new("points", &[Kind::Points], "A point.");

/// A point at x = frame, which takes 20 ms.
static SLOW: Node = Node::new(
    "Slow",
    1,
    "A point that takes its time.",
    Cook::Frame {
        cook: |cx| {
            std::thread::sleep(std::time::Duration::from_millis(20));
            Ok(OUT.with(crate::builder::row(&[cx.frame().number() as f32])))
        },
        reads_clock: |_| true,
    },
)
.outputs(&[&OUT]);

/// With a cache, frames are finished a few at a time, so that an interrupted cook has lost little.
#[test]
fn a_cook_with_a_cache_finishes_few_frames_at_a_time() {
    let mut graph = TestGraph::new(1, 40);
    graph.add("slow", &SLOW).out();
    let most_at_once = |disk: Option<&mut DiskCache>| {
        let mut most = 0;
        let mut sink = |finished: &[Delivered]| -> Result<(), std::convert::Infallible> {
            most = most.max(finished.len());
            Ok(())
        };
        let cancel = AtomicBool::new(false);
        let request = Request::everything(&graph.0);
        let cooked = engine(2, 1 << 30).cook(&graph.0, &request, disk, &cancel, &mut sink);
        assert_eq!(cooked.unwrap_or_else(|stop| panic!("{stop:?}")).delivered[&0], 40);
        most
    };
    let folder = tempfile::tempdir().expect("a folder");
    let with = most_at_once(Some(&mut DiskCache::open(folder.path(), u64::MAX)));
    let without = most_at_once(None);
    assert!(with <= 6 && without > 6, "{with} with a cache, {without} without");
}

/// A window over another, both relative to a point at the scene's start.
fn windows() -> TestGraph {
    let mut graph = TestGraph::new(1, 60);
    let a = graph.add("a", &SOURCE).set("amount", 2.0_f32).set("count", 50_i64).done();
    let clock = graph.add("clock", &CLOCK).set("amount", 0.01_f32).wire("points", a).done();
    let near = graph.add("near", &FOLLOW).set("frames", 9_i64).wire("points", clock).wire("anchor", clock).done();
    graph.add("far", &FOLLOW).set("frames", 12_i64).wire("points", near).wire("anchor", a).out();
    graph
}

/// Cooks `frames` with a cache that keeps whatever it may.
fn cook_keeping(graph: &TestGraph, frames: std::ops::RangeInclusive<i64>, folder: &Path) -> Cooked {
    let mut disk = DiskCache::open(folder, u64::MAX).keeping_all();
    let frames: Vec<Frame> = frames.map(Frame::whole).collect();
    graph.cook_with(&engine(2, 1 << 30), &frames, Some(&mut disk))
}

#[test]
fn a_resumed_window_goes_on_from_where_it_stood() {
    let graph = windows();
    let whole = graph.cook(1..=60);
    for until in [5, 18, 23, 24, 25, 40] {
        let folder = tempfile::tempdir().expect("a folder");
        let first = cook_keeping(&graph, 1..=until, folder.path());
        let resumed = cook_keeping(&graph, 1..=60, folder.path());
        assert!(resumed.bits() == whole.bits(), "after frame {until}");
        for node in ["near", "far"] {
            // Fewer where a state or result on disk serves twice.
            assert!(resumed.cooks(node) <= whole.cooks(node) - first.cooks(node), "{node} after frame {until}");
        }
    }
}

#[test]
fn damaged_and_foreign_states_of_windows_are_ignored() {
    let graph = windows();
    let whole = graph.cook(1..=40).bits();
    let damages: [fn(&Path, &[u8]); 4] = [
        |path, _| fs::write(path, b"").expect("a file"),
        |path, other| fs::write(path, other).expect("a file"),
        |path, other| fs::write(path, &other[..other.len() - 1]).expect("a file"),
        |path, _| fs::remove_file(path).expect("a file"),
    ];
    for damage in damages {
        let folder = tempfile::tempdir().expect("a folder");
        cook_keeping(&graph, 1..=23, folder.path());
        let states = files(folder.path(), "checkpoint");
        assert!((2..=8).contains(&states.len()), "{}", states.len());
        let bytes: Vec<Vec<u8>> = states.iter().map(|path| fs::read(path).expect("a file")).collect();
        for (path, other) in states.iter().zip(bytes.iter().cycle().skip(1)) {
            damage(path, other);
        }
        let cooked = cook_keeping(&graph, 1..=40, folder.path());
        assert!(cooked.bits() == whole);
        // The last window before frame 24 starts at frame 10.
        assert!(cooked.cooks("near") > 30, "{}", cooked.cooks("near"));
    }
}

#[test]
fn a_changed_window_does_not_take_the_old_state() {
    let graph = windows();
    let folder = tempfile::tempdir().expect("a folder");
    cook_keeping(&graph, 1..=23, folder.path());
    let other = graph.with("near", "rate", Source::Constant(Value::Float(0.25)));
    assert!(cook_keeping(&other, 1..=40, folder.path()).bits() == other.cook(1..=40).bits());
}

#[test]
fn a_limited_cache_stays_below_its_limit() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = solver();
    let limit = 5_000;
    let mut disk = DiskCache::open(folder.path(), limit);
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
