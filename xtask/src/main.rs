//! Chores of the repository: `cargo xtask new-node NAME`, `cargo xtask bless [EXPECTATION]…`.

mod bless;
mod new_node;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

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
    /// Store the expectations of tests and benches anew, and show what changed
    Bless {
        /// Which; all if none is named
        expectations: Vec<bless::Expectation>,
    },
}

fn main() -> ExitCode {
    let result = match Chore::parse() {
        Chore::NewNode { name, family } => new_node::write(&root(), &name, &family),
        Chore::Bless { expectations } => bless::store(&root(), &expectations),
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

/// The repository's root.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().map_or_else(PathBuf::new, Path::to_owned)
}
