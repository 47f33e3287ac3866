//! `convect schema`: the JSON Schema of graph files, for editors.

use std::io::Write as _;

use crate::CATALOGUE;
use crate::failure::Failure;

/// Prints the schema.
///
/// # Errors
/// If stdout cannot be written.
pub fn run() -> Result<(), Failure> {
    let schema = engine::graph::schema(CATALOGUE);
    writeln!(std::io::stdout(), "{}", serde_json::to_string_pretty(&schema).unwrap_or_default())?;
    Ok(())
}
