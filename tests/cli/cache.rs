//! One cache folder for several programs at once.

use std::fs;
use std::process::{Child, Stdio};

use crate::bench::{Bench, Ran};

/// A body that falls: its checkpoints, its results and its finished frames are in the cache.
const FALLING: &str = r#"{
  "convect": 1,
  "scene": { "frames": [1, 12] },
  "nodes": {
    "ball": { "type": "Mesh_Primitive", "params": { "shape": "sphere", "size": [0.1, 0.1, 0.1], "divisions": 4 } },
    "tets": { "type": "Tetrahedralize", "inputs": { "surface": "ball" } },
    "body": { "type": "Softbody", "inputs": { "bodies": ["tets"] }, "params": { "ground": true, "ground_height": -0.2 } }
  },
  "outputs": { "ball": "body.surface" }
}"#;

fn start(bench: &Bench, out: &str) -> Child {
    let args = ["cook", "g.json", "--format", "json", "--cache", "cache", "--out", out];
    bench.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn done(child: Child) {
    let ran = Ran::of(&child.wait_with_output().unwrap());
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert!(!ran.stderr.contains("note: the cache"), "{}", ran.stderr);
}

#[test]
fn two_programs_share_a_cache_while_a_third_is_killed() {
    let bench = Bench::with_graph(FALLING);
    bench.done(&["cook", "g.json", "--format", "json", "--out", "alone"]);
    let alone = bench.files("alone");
    let mut killed = start(&bench, "killed");
    let both = ["first", "second"].map(|out| start(&bench, out));
    killed.kill().unwrap();
    killed.wait().unwrap();
    both.into_iter().for_each(done);
    for out in ["first", "second"] {
        assert_eq!(bench.files(out), alone, "{out}");
    }
    done(start(&bench, "third"));
    assert_eq!(bench.files("third"), alone);
}

#[test]
fn files_of_others_and_of_other_versions_stay_and_are_not_used() {
    let bench = Bench::with_graph(FALLING);
    bench.done(&["cook", "g.json", "--format", "json", "--out", "alone"]);
    done(start(&bench, "first"));
    let own = bench.names("cache");
    assert_eq!(own.len(), 1, "one subfolder: {own:?}");
    // As another version of the program would leave it, with entries of the same names but other bytes.
    fs::rename(bench.path("cache").join(&own[0]), bench.path("cache/convect-0.0.9-cache-1")).unwrap();
    let entries = bench.names("cache/convect-0.0.9-cache-1");
    for name in &entries {
        bench.write(&format!("cache/convect-0.0.9-cache-1/{name}"), "other bytes");
    }
    for name in ["version", "scene.checkpoint", "take.frame", "half.part"] {
        bench.write(&format!("cache/{name}"), "mine");
    }
    let ran =
        bench.run(&["cook", "g.json", "--format", "json", "--cache", "cache", "--cache-limit", "1K", "--out", "next"]);
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert_eq!(bench.files("next"), bench.files("alone"));
    assert_eq!(bench.names("cache/convect-0.0.9-cache-1"), entries);
    for name in ["version", "scene.checkpoint", "take.frame", "half.part"] {
        assert_eq!(fs::read_to_string(bench.path("cache").join(name)).unwrap(), "mine", "{name}");
    }
}
