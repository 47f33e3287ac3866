//! `convect stats`: measurements of a geometry file, which a pipeline can assert on.

mod measure;
mod show;
pub(crate) mod surface;

use std::io::Write as _;
use std::path::PathBuf;

use crate::failure::Failure;
use crate::geometry_file::read;

/// The arguments of `stats`.
#[derive(Debug, clap::Args)]
pub struct StatsArgs {
    /// An obj, ply or json file
    file: PathBuf,
    /// Print as JSON, with all digits (text has six)
    #[arg(long)]
    json: bool,
}

/// Prints the measurements.
///
/// # Errors
/// If the file cannot be read or stdout cannot be written.
pub fn run(args: &StatsArgs) -> Result<(), Failure> {
    let file = read(&args.file)?;
    let stats = measure::stats(&file.geometry);
    let name = args.file.display().to_string();
    let text = match args.json {
        true => show::json(&name, &file, &stats),
        false => show::text(&name, &file, &stats),
    };
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}
