//! Runs of the program on a case's graph.

use std::ffi::OsString;
use std::path::Path;
use std::process::Command;

use crate::cases::Case;

/// What an output has.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Written {
    All,
    /// Positions alone: what no output has need not be cooked.
    Positions,
}

/// A graph to cook.
#[derive(Debug)]
pub(crate) struct Run {
    name: &'static str,
    graph: String,
    frames: i64,
}

impl Run {
    /// All of a case.
    pub(crate) fn whole(case: &Case, written: Written) -> Self {
        Self::of(case, &[("out", case.output)], case.frames, written)
    }

    /// What a case's node reads and is not counted, in the same graph: a frame of it, for it does not change.
    pub(crate) fn read(case: &Case) -> Self {
        let outputs: Vec<(&str, &str)> = case.before.iter().map(|id| (*id, *id)).collect();
        Self::of(case, &outputs, 1, Written::All)
    }

    fn of(case: &Case, outputs: &[(&str, &str)], frames: i64, written: Written) -> Self {
        let attributes = match written {
            Written::All => "",
            Written::Positions => r#", "attributes": ["P"]"#,
        };
        let outputs = outputs.iter().map(|(name, from)| format!(r#""{name}": {{ "from": "{from}"{attributes} }}"#));
        let graph = format!(
            r#"{{ "convect": 1, "scene": {{ "frames": [1, {frames}], "seed": 7 }}, "nodes": {{ {} }}, "outputs": {{ {} }} }}"#,
            case.nodes.concat(),
            outputs.collect::<Vec<_>>().join(", "),
        );
        Self { name: case.name, graph, frames }
    }

    /// Instructions of the whole process.
    pub(crate) fn instructions(&self) -> Result<u64, String> {
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let profile = folder.path().join("profile");
        let mut valgrind = Command::new("valgrind");
        valgrind.args(["--tool=callgrind", &format!("--callgrind-out-file={}", profile.display())]);
        self.cook(valgrind.arg(program()), folder.path(), &["--no-write"])?;
        let text = std::fs::read_to_string(&profile).map_err(|error| format!("{}: {error}", profile.display()))?;
        let total = text.lines().find_map(|line| line.strip_prefix("totals: ")?.trim().parse().ok());
        total.ok_or_else(|| format!("{}: callgrind wrote no total", self.name))
    }

    /// The text of each frame's file. It has the fewest digits that tell two numbers apart, so it is equal where all bits are.
    pub(crate) fn result(&self) -> Result<Vec<String>, String> {
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        self.cook(&mut Command::new(program()), folder.path(), &["--format", "json"])?;
        let read = |frame| {
            let path = folder.path().join(format!("out.{frame:04}.json"));
            std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))
        };
        (1..=self.frames).map(read).collect()
    }

    fn cook(&self, command: &mut Command, folder: &Path, options: &[&str]) -> Result<(), String> {
        let file = folder.join("graph.json");
        std::fs::write(&file, &self.graph).map_err(|error| format!("{}: {error}", file.display()))?;
        command.arg("cook").arg(file).args(["--quiet", "--threads", "1", "--out"]).arg(folder).args(options);
        let output = command.env("CONVECT_SIMD", "avx2").output().map_err(|error| format!("{command:?}: {error}"))?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            return Err(format!("{}: {command:?} ended with {}\n{said}", self.name, output.status));
        }
        Ok(())
    }
}

/// The program as it is shipped: linked for this, and for nothing else, it would take a minute. `CONVECT_PROGRAM` names one
/// that is there already, so that the bench itself need not be compiled as that was.
fn program() -> OsString {
    std::env::var_os("CONVECT_PROGRAM").unwrap_or_else(|| env!("CARGO_BIN_EXE_convect").into())
}
