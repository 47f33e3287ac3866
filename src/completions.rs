//! `convect completions`: completion scripts for shells.

use std::io::Write as _;

use clap_complete::Shell;

use crate::failure::Failure;

/// The arguments of `completions`.
#[derive(Debug, clap::Args)]
pub struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

/// Prints the completion script.
///
/// # Errors
/// If stdout cannot be written.
pub fn run<C: clap::CommandFactory>(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut C::command(), "convect", &mut text);
    std::io::stdout().write_all(&text)?;
    Ok(())
}
