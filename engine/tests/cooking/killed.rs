//! A cook that is killed at any moment can be resumed, and its files have the same bits as without interruption.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use engine::cook::{Delivered, DiskCache};
use engine::plan::Request;
use numerics::random;

use crate::builder::{bits, engine};
use crate::checkpoints::solver;

/// The environment variable with the folder of the child process, which does nothing if it is not set.
const FOLDER: &str = "CONVECT_TEST_KILLED";

/// Number of times that the child is killed.
const KILLS: usize = 50;

/// The child: cooks with a cache and writes one file per frame.
#[test]
fn child() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else { return };
    let graph = solver();
    let mut disk = DiskCache::open(&folder.join("cache"), u64::MAX);
    let mut sink = |finished: &[Delivered]| -> std::io::Result<()> {
        for one in finished {
            let part = folder.join("part");
            fs::write(&part, bits(&one.geometry))?;
            fs::rename(part, folder.join(format!("{}.bits", one.frame)))?;
        }
        Ok(())
    };
    let request = Request::everything(&graph.0);
    let cooked = engine(2, 1 << 30).cook(&graph.0, &request, Some(&mut disk), &AtomicBool::new(false), &mut sink);
    cooked.unwrap_or_else(|stopped| panic!("{stopped:?}"));
    fs::write(folder.join("done"), "").expect("a file");
}

fn start(folder: &Path) -> Child {
    Command::new(std::env::current_exe().expect("this program"))
        .args(["killed::child", "--exact", "--test-threads=1"])
        .env(FOLDER, folder)
        .stdout(Stdio::null())
        .spawn()
        .expect("a process")
}

fn written(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let frames = entries.filter(|path| path.extension().is_some_and(|extension| extension == "bits"));
    frames.map(|path| (path.display().to_string(), fs::read(&path).expect("a file"))).collect()
}

#[test]
fn a_cook_killed_at_random_moments_ends_with_the_same_bits() {
    let graph = solver();
    let whole = graph.cook(1..=60).bits();
    let check = |folder: &Path, complete: bool| {
        let written = written(folder);
        assert!(!complete || written.len() == 60, "{} files", written.len());
        for ((_, frame), bits) in &whole {
            let name = folder.join(format!("{frame}.bits")).display().to_string();
            if let Some(found) = written.get(&name) {
                assert!(found == bits, "frame {frame}");
            }
        }
    };
    let moment = random::Key::new(1);
    let mut folder = tempfile::tempdir().expect("a folder");
    let (mut kills, mut resumed) = (0, 0);
    for run in 0.. {
        let before = written(folder.path()).len();
        let mut child = start(folder.path());
        if kills == KILLS {
            assert!(child.wait().expect("its end").success());
            check(folder.path(), true);
            break;
        }
        std::thread::sleep(Duration::from_micros(2_000 + moment.of(run).u64() % 40_000));
        child.kill().expect("to kill it");
        let killed = !child.wait().expect("its end").success();
        check(folder.path(), folder.path().join("done").exists());
        if killed {
            kills += 1;
            resumed += usize::from(before > 0);
        }
        if folder.path().join("done").exists() {
            folder = tempfile::tempdir().expect("a folder");
        }
    }
    assert!(resumed >= 5, "only {resumed} of {KILLS} killed cooks had something to resume from");
}
