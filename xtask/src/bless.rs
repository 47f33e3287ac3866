//! `bless`: rewrites stored expectations.

use std::path::Path;
use std::process::Command;

use clap::ValueEnum;

/// A stored expectation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Expectation {
    /// Bits of the example graphs' first frames: tests/graphs.txt
    Graphs,
    /// Messages of faults in graphs: engine/src/graph/tests/faults.txt
    Messages,
    /// What `cargo xtask new-node` writes: tests/new_nodes
    Nodes,
    /// README's table of nodes
    Readme,
    /// Tables of laws in docs/, and bits of the last frames of scenes with a solver: benches/graphs.txt
    Laws,
    /// Outcomes of scenes at extremes: docs/stability.md
    Stability,
    /// Counts of instructions, where valgrind is installed: benches/instructions.txt
    Instructions,
}

impl Expectation {
    /// Arguments of the cargo command that writes it.
    fn command(self) -> &'static [&'static str] {
        match self {
            Self::Graphs => &["test", "--test", "graphs", "every_example_has_the_stored_bits"],
            Self::Messages => &["test", "-p", "engine", "--lib", "stored_messages"],
            Self::Nodes => &["test", "-p", "xtask", "rendered_nodes"],
            Self::Readme => &["test", "--test", "catalogue", "readme_lists_the_catalogue"],
            Self::Laws => &["bench", "--bench", "laws", "--", "--bless"],
            Self::Stability => &["test", "--test", "stability", "tables"],
            Self::Instructions => &["bench", "--bench", "instructions", "--", "--bless"],
        }
    }

    /// The files it is stored in.
    fn files(self) -> &'static [&'static str] {
        match self {
            Self::Graphs => &["tests/graphs.txt"],
            Self::Messages => &["engine/src/graph/tests/faults.txt"],
            Self::Nodes => &["tests/new_nodes"],
            Self::Readme => &["README.md"],
            Self::Laws => &["docs/wind.md", "docs/softbody.md", "docs/liquid.md", "benches/graphs.txt"],
            Self::Stability => &["docs/stability.md"],
            Self::Instructions => &["benches/instructions.txt"],
        }
    }
}

/// Rewrites the named expectations, or all of them if none is named, and shows the difference.
///
/// # Errors
/// If a command fails; the other expectations are written nevertheless.
pub(crate) fn store(root: &Path, named: &[Expectation]) -> Result<String, String> {
    let all = if named.is_empty() { Expectation::value_variants() } else { named };
    let run = |program: &str, arguments: &[&str]| {
        let status = Command::new(program).args(arguments).current_dir(root).env("BLESS", "1").status();
        status.map_err(|error| format!("`{program}` could not be run: {error}"))
    };
    let mut failed = Vec::new();
    for expectation in all {
        if !run("cargo", expectation.command())?.success() {
            failed.push(format!("`cargo {}` failed", expectation.command().join(" ")));
        }
    }
    let files: Vec<&str> = all.iter().flat_map(|expectation| expectation.files()).copied().collect();
    run("git", &[&["--no-pager", "diff", "--stat", "--patch", "--"], &files[..]].concat())?;
    if failed.is_empty() {
        Ok("stored; what changed since the last commit is above".into())
    } else {
        Err(failed.join("\n"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_expectation_has_an_existing_folder() {
        for expectation in Expectation::value_variants() {
            for file in expectation.files() {
                let folder = crate::root().join(file).parent().map(Path::to_owned);
                assert!(folder.is_some_and(|folder| folder.is_dir()), "{expectation:?}: {file}");
            }
        }
    }
}
