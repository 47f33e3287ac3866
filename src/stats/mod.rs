//! `convect stats`: measurements of a geometry file, which a pipeline can assert on.

mod measure;
mod show;
pub(crate) mod surface;

use std::io::Write as _;
use std::path::PathBuf;

use crate::failure::{Exit, Failure};
use crate::geometry_file::{read, read_usd};
use crate::usd_file::is_usd;

/// The arguments of `stats`.
#[derive(Debug, clap::Args)]
pub struct StatsArgs {
    /// An obj, ply, json or USD file (usdc, usda, usdz)
    file: PathBuf,
    /// The time code at which a USD file is read; its first sample by default
    #[arg(long, value_name = "F")]
    frame: Option<f64>,
    /// The prim of a USD file to read, with its descendants: /set/fur
    #[arg(long, value_name = "PATH")]
    prim: Option<String>,
    /// Print as JSON, with all digits (text has six)
    #[arg(long)]
    json: bool,
}

/// Prints the measurements.
///
/// # Errors
/// If the file cannot be read or stdout cannot be written.
pub fn run(args: &StatsArgs) -> Result<(), Failure> {
    let file = match is_usd(&args.file) {
        true => read_usd(&args.file, args.prim.as_deref().unwrap_or_default(), args.frame)?,
        false if args.frame.is_some() || args.prim.is_some() => {
            let line = format!("`{}` is no USD file, and only those have frames and prims", args.file.display());
            return Err(Failure::new(Exit::CommandLine, line));
        }
        false => read(&args.file)?,
    };
    let stats = measure::stats(&file.geometry);
    let name = args.file.display().to_string();
    let text = match args.json {
        true => show::json(&name, &file, &stats),
        false => show::text(&name, &file, &stats),
    };
    file.notes.iter().for_each(|note| crate::say!("note: {note}"));
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}
