//! Chores of the repository: `cargo xtask new-node NAME`, `cargo xtask bless`.

mod new_node;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use clap::Parser;

/// Chores of the repository.
#[derive(Parser)]
enum Chore {
    /// Write a node that passes its tests, and its line in the family's list
    NewNode {
        /// The node's name, such as Curve_Smooth
        name: String,
        /// The family it belongs to: a folder of nodes/
        #[arg(long, default_value = "geometry")]
        family: String,
    },
    /// Store the expectations of the tests anew, and show what changed
    Bless,
}

fn main() -> ExitCode {
    let result = match Chore::parse() {
        Chore::NewNode { name, family } => new_node::write(&root(), &name, &family),
        Chore::Bless => bless(&root()),
    };
    match result {
        Ok(said) => {
            println!("{said}");
            ExitCode::SUCCESS
        }
        Err(fact) => {
            eprintln!("{fact}");
            ExitCode::FAILURE
        }
    }
}

/// Runs the tests with stored expectations so that they write them, then shows the difference.
fn bless(root: &Path) -> Result<String, String> {
    let run = |program: &str, arguments: &[&str]| {
        let status = Command::new(program).args(arguments).current_dir(root).env("BLESS", "1").status();
        status.map_err(|error| format!("`{program}` could not be run: {error}"))
    };
    for arguments in [&["test", "--test", "graphs"][..], &["test", "-p", "engine", "stored_messages"]] {
        if !run("cargo", arguments)?.success() {
            return Err(format!("`cargo {}` failed", arguments.join(" ")));
        }
    }
    run("git", &["--no-pager", "diff", "--stat", "--patch", "--", "*.txt"])?;
    Ok("stored anew; commit what you meant to change".into())
}

/// The repository's root.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().map_or_else(PathBuf::new, Path::to_owned)
}
