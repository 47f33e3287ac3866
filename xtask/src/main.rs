//! Chores of the repository: `cargo xtask new-node NAME`, `cargo xtask bless [EXPECTATION]…`,
//! `cargo xtask torture --minutes N`.

mod bless;
mod new_node;
mod template;
#[cfg(unix)]
mod torture;

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
        /// Whether its result depends on the time of the frame: windows and solvers start from docs/writing_nodes.md
        #[arg(long, value_enum, default_value = "pure")]
        time: Time,
        /// Name of a param that a point attribute may mask
        #[arg(long)]
        mask: Option<String>,
        /// Name of a ramp along the curve
        #[arg(long)]
        ramp: Option<String>,
        /// Give each curve random numbers
        #[arg(long)]
        seed: bool,
        /// Give each curve its shape at rest, whose directions it is moved across
        #[arg(long)]
        rest: bool,
        /// Let segments change their lengths; without it the node restores them and measures how well
        #[arg(long)]
        free_lengths: bool,
    },
    /// Rewrite the stored expectations of tests and benches, and show what changed
    Bless {
        /// Which; all if none is named
        expectations: Vec<bless::Expectation>,
    },
    /// Run the program on mutated graphs, files and command lines; report panics, aborts, hangs and lost files
    #[cfg(unix)]
    Torture(torture::Options),
}

/// Whether a node depends on time.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Time {
    /// Its inputs and params alone.
    Pure,
    /// The clock too.
    Frame,
}

fn main() -> ExitCode {
    let result = match Chore::parse() {
        Chore::NewNode { name, family, time, mask, ramp, seed, rest, free_lengths } => {
            let options = template::Options { reads_clock: time == Time::Frame, mask, ramp, seed, rest, free_lengths };
            new_node::write(&root(), &name, &family, &options)
        }
        Chore::Bless { expectations } => bless::store(&root(), &expectations),
        #[cfg(unix)]
        Chore::Torture(options) => torture::run(&root(), &options),
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
