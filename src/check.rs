//! `convect check`: reports every fault of a graph without cooking it.

use std::io::Write as _;
use std::path::PathBuf;

use engine::graph::Fault;
use formats::Format;
use serde_json::Value;

use crate::args::Setting;
use crate::failure::{Failure, exit_of_faults};
use crate::{load, memory};

/// The arguments of `check`.
#[derive(Debug, clap::Args)]
pub struct CheckArgs {
    /// The graph file; - reads it from stdin
    graph: PathBuf,
    /// Override a param (node.param=VALUE) or a control (name=VALUE): JSON or a bare word, such as wind.noise=billow; repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Setting>,
    /// Also check that this format can hold the outputs
    #[arg(long, value_name = "FORMAT", value_parser = ["usdc", "usda", "obj", "ply", "json"])]
    format: Option<String>,
    /// Exit with code 4 if there are notes
    #[arg(long)]
    strict: bool,
    /// Print the faults as JSON
    #[arg(long)]
    json: bool,
}

/// Checks a graph. Faults are printed to stderr, or as JSON to stdout; notes to stderr.
///
/// # Errors
/// If there is a fault.
pub fn run(args: &CheckArgs) -> Result<(), Failure> {
    let engine = load::engine(0, memory::ceiling(None))?;
    let format: Option<Format> = args.format.as_deref().and_then(|name| name.parse().ok());
    let found = load::checked_graph(&args.graph, &args.set, &engine, format)?;
    let (notes, faults) = match found {
        Ok(graph) => (graph.notes, Vec::new()),
        Err(faults) => (Vec::new(), faults),
    };
    if args.json {
        let list: Vec<Value> = faults.iter().map(Fault::to_json).collect();
        let text = serde_json::to_string_pretty(&list).unwrap_or_default();
        writeln!(std::io::stdout(), "{text}")?;
    }
    match faults.is_empty() {
        true => {
            notes.iter().for_each(|note| crate::say!("note: {note}"));
            load::strict(args.strict, &notes)
        }
        false if args.json => Err(Failure::reported(exit_of_faults(&faults))),
        false => Err(load::faulty(&args.graph, &faults)),
    }
}
