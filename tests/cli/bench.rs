//! A temporary folder with a scene, in which the program is run.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;

/// Grass in wind; the output `still` is the grass at rest.
pub(crate) const GRAPH: &str = r#"// grass.json
{
  "convect": 1,
  "scene": { "frames": [1, 4], "fps": 24, "seed": 3 },
  "controls": { "wind_dir": [1, 0, 0.2] },
  "nodes": {
    "blades": { "type": "Curve_In", "params": { "file": "grass.obj" } },
    "wind": {
      "type": "Curve_Wind", "inputs": { "curves": "blades" },
      "params": { "wind_dir": { "control": "wind_dir" }, "global_rotate": { "expr": "0.4 + 0.1*sin(2*pi*time)" } },
    },
  },
  "outputs": { "grass": "wind", "still": "blades" },
}
"#;

/// The wind direction is zero at frame 2, which is an error; the output `still` does not depend on it.
pub(crate) const CALM_AT_2: &str = r#"{
  "convect": 1,
  "scene": { "frames": [1, 3] },
  "nodes": {
    "blades": { "type": "Curve_In", "params": { "points": [[0, 0, 0], [0, 1, 0]] } },
    "wind": {
      "type": "Curve_Wind", "inputs": { "curves": "blades" },
      "params": { "wind_dir": { "keyframes": [[1, [1, 0, 0]], [3, [-1, 0, 0]]] } }
    }
  },
  "outputs": { "grass": "wind", "still": "blades" }
}"#;

/// A temporary folder for one test.
pub(crate) struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    /// Contains the graph [`GRAPH`] as `g.json`, and 60 blades as `grass.obj`.
    pub(crate) fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        bench.write("g.json", GRAPH);
        bench.write("grass.obj", &blades(60));
        bench
    }

    /// With another graph as `g.json`.
    pub(crate) fn with_graph(graph: &str) -> Self {
        let bench = Self::new();
        bench.write("g.json", graph);
        bench
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    /// A command that runs the program in the folder.
    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_convect"));
        command.args(args).current_dir(self.folder.path()).stdin(Stdio::null());
        command.env_remove("RUST_BACKTRACE").env_remove("CONVECT_SIMD");
        command
    }

    pub(crate) fn run(&self, args: &[&str]) -> Ran {
        Ran::of(&self.command(args).output().unwrap())
    }

    /// Runs the program, which must succeed; returns stdout.
    pub(crate) fn done(&self, args: &[&str]) -> String {
        let ran = self.run(args);
        assert_eq!(ran.code, Some(0), "{args:?}: {}", ran.stderr);
        ran.stdout
    }

    /// The same, with stdout parsed as JSON.
    pub(crate) fn json(&self, args: &[&str]) -> Value {
        let text = self.done(args);
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{args:?}: {error} in {text}"))
    }

    /// File names in a folder, including hidden ones, sorted.
    pub(crate) fn names(&self, folder: &str) -> Vec<String> {
        names(&self.path(folder))
    }

    /// All files in a folder.
    pub(crate) fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        let file = |name: String| {
            let bytes = fs::read(self.path(folder).join(&name)).unwrap();
            (name, bytes)
        };
        self.names(folder).into_iter().map(file).collect()
    }

    /// Every path in the folder with what a file contains.
    pub(crate) fn tree(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut tree = BTreeMap::new();
        let mut folders = vec![self.path("")];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if fs::symlink_metadata(&path).unwrap().is_dir() {
                    folders.push(path.clone());
                }
                let bytes = fs::read(&path).unwrap_or_default();
                tree.insert(path, bytes);
            }
        }
        tree
    }

    pub(crate) fn read_json(&self, name: &str) -> Value {
        serde_json::from_slice(&fs::read(self.path(name)).unwrap()).unwrap()
    }
}

/// File names in a folder, including hidden ones, sorted; empty if the folder does not exist.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The result of a run.
#[derive(Debug)]
pub(crate) struct Ran {
    /// `None` if a signal ended the process.
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Ran {
    pub(crate) fn of(output: &Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        let ran = Self { code: output.status.code(), stdout: text(&output.stdout), stderr: text(&output.stderr) };
        for word in ["panicked", "backtrace", "unwrap()", ".rs:"] {
            assert!(!ran.stderr.contains(word), "a user sees `{word}`: {}", ran.stderr);
        }
        ran
    }
}

/// An obj file of upright curves with five CVs, 0.25 m tall and 0.125 m apart.
pub(crate) fn blades(count: usize) -> String {
    let mut text = String::new();
    for blade in 0..count {
        let (x, z) = ((blade % 10) as f32 / 8.0, (blade / 10) as f32 / 8.0);
        (0..5).for_each(|cv| _ = writeln!(text, "v {x} {} {z}", cv as f32 / 16.0));
        let first = blade * 5 + 1;
        let _ = writeln!(text, "l {} {} {} {} {}", first, first + 1, first + 2, first + 3, first + 4);
    }
    text
}
