//! The command line: its subcommands and exit codes.

use std::io::Write as _;
use std::process::ExitCode;

use clap::Parser;
use convect::allocator::keep_freed_pages;
use convect::failure::{Exit, Failure, too_large_files_are_errors};
use convect::say;
use convect::{check, completions, convert, cook, diff, explain, functions, job, merge, nodes, schema, stats, study};

/// Keeps the pages of large arrays between frames, as [`keep_freed_pages`] says. The system's allocator returns them at once, and
/// requesting them again costs a third of the time of a frame of a million curves.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Cooks node graphs that make geometry move: wind on fur and grass, soft dough, viscous sauces.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true, max_term_width = 100)]
enum Verb {
    /// Cook a graph and write its outputs
    Cook(Box<cook::CookArgs>),
    /// Report every fault of a graph; only its sources are cooked
    Check(check::CheckArgs),
    /// Show what a cook would do: nodes, number of calls, what is left out and why
    Explain(explain::ExplainArgs),
    /// List the nodes, or print the help of one
    Nodes(nodes::NodesArgs),
    /// Measure a geometry file: counts, bounds, lengths, areas, volumes, attributes
    Stats(stats::StatsArgs),
    /// Compare two geometries: exit code 0 if they are the same, 1 if they differ, 2 on errors
    Diff(diff::DiffArgs),
    /// Plot error against run time over the values of params, and write the graph with the best settings
    Study(Box<study::StudyArgs>),
    /// Convert geometry files from one format to another
    Convert(convert::ConvertArgs),
    /// Cut a cook into tasks for Open Job Description, Slurm, or anything that runs commands
    Job(job::JobArgs),
    /// Join the parts of a job into whole outputs
    Merge(merge::MergeArgs),
    /// Print the reference of the expression language: names, operators, functions
    Functions,
    /// Print the JSON Schema of graph files, for editors
    Schema,
    /// Print a shell's completion script
    Completions(completions::CompletionsArgs),
}

fn main() -> ExitCode {
    keep_freed_pages();
    quiet_panics();
    too_large_files_are_errors();
    let verb = match Verb::try_parse() {
        Ok(verb) => verb,
        Err(error) => {
            // Help and version are not errors, but they are what was asked for.
            let printed = error.print().and_then(|()| std::io::stdout().flush());
            return match printed {
                _ if error.use_stderr() => Exit::CommandLine.into(),
                Ok(()) => Exit::Done.into(),
                Err(error) => ended(Err(error.into())),
            };
        }
    };
    let result = std::panic::catch_unwind(|| run(&verb)).unwrap_or_else(|_| {
        Err(Failure::new(Exit::Cook, "convect failed unexpectedly; this is a bug in convect, please report it"))
    });
    ended(result)
}

fn ended(result: Result<(), Failure>) -> ExitCode {
    match result {
        Ok(()) => Exit::Done.into(),
        Err(failure) => {
            failure.lines.iter().for_each(|line| say!("{line}"));
            failure.exit.into()
        }
    }
}

fn run(verb: &Verb) -> Result<(), Failure> {
    match verb {
        Verb::Cook(args) => cook::run(args),
        Verb::Check(args) => check::run(args),
        Verb::Explain(args) => explain::run(args),
        Verb::Nodes(args) => nodes::run(args),
        Verb::Stats(args) => stats::run(args),
        Verb::Diff(args) => diff::run(args),
        Verb::Study(args) => study::run(args),
        Verb::Convert(args) => convert::run(args),
        Verb::Job(args) => job::run(args),
        Verb::Merge(args) => merge::run(args),
        Verb::Functions => functions::run(),
        Verb::Schema => schema::run(),
        Verb::Completions(args) => completions::run::<Verb>(args),
    }
}

/// Panics of nodes are reported as errors with node and frame; their position in the code is printed only if
/// RUST_BACKTRACE is set.
fn quiet_panics() {
    if std::env::var_os("RUST_BACKTRACE").is_none() {
        std::panic::set_hook(Box::new(|_| {}));
    }
}
