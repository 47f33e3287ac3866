//! `convect completions`: completions for a shell.

use std::io::Write as _;

use clap_complete::Shell;

use crate::failure::Failure;

/// What `completions` takes.
#[derive(Debug, clap::Args)]
pub struct CompletionsArgs {
    /// bash, elvish, fish, powershell or zsh
    shell: Shell,
}

/// Prints them.
///
/// # Errors
/// Where stdout cannot be written.
pub fn run<C: clap::CommandFactory>(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut C::command(), "convect", &mut text);
    std::io::stdout().write_all(&text)?;
    Ok(())
}
