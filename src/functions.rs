//! `convect functions`: the reference of the expression language.

use std::io::Write as _;

use crate::failure::Failure;

/// Prints the reference.
///
/// # Errors
/// If stdout cannot be written.
pub fn run() -> Result<(), Failure> {
    std::io::stdout().write_all(engine::expr::HELP.as_bytes())?;
    Ok(())
}
