//! `convect diff`: whether two geometries are the same, and how much they differ.

mod compare;
mod pairs;
mod show;

use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};

use engine::geometry::Geometry;
use numerics::parallel;

use crate::failure::{Exit, Failure};
use crate::geometry_file::read;
use crate::usd_file::{UsdFile, is_usd};
use compare::{Finding, compare};
use pairs::{DiffSide, Pair, pairs, usd_pairs};

/// The arguments of `diff`.
#[derive(Debug, clap::Args)]
pub struct DiffArgs {
    /// An obj, ply, json or USD file, a folder of them, or a numbered sequence: fur.####.json. A USD file is compared
    /// at each of its time samples, even when compared with a sequence
    a: PathBuf,
    /// The file, folder or sequence to compare it with; the formats may differ
    b: PathBuf,
    /// Floats that differ by at most this much, in the attribute's unit (metres for `P`), count as equal; without it
    /// all bits are compared. Integers are always compared exactly
    #[arg(long, value_name = "T", value_parser = tolerance)]
    tolerance: Option<f64>,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

fn tolerance(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite() && *number >= 0.0);
    number.ok_or_else(|| format!("`{text}` is not a tolerance, expected a number that is 0 or greater"))
}

/// Two files and their differences.
struct Compared {
    pair: Pair,
    findings: Vec<Finding>,
}

impl Compared {
    fn differs(&self) -> bool {
        self.pair.a.is_none() || self.pair.b.is_none() || self.findings.iter().any(Finding::differs)
    }
}

fn side<'a>(stage: Option<&'a UsdFile>, path: &'a Path) -> DiffSide<'a> {
    match stage {
        Some(stage) => DiffSide::Usd(path, &stage.times),
        None => DiffSide::Files(path),
    }
}

/// Compares, and prints the differences.
///
/// # Errors
/// With [`Exit::File`] if something differs, with [`Exit::CommandLine`] for any error.
pub fn run(args: &DiffArgs) -> Result<(), Failure> {
    let as_error = |failure: Failure| Failure { exit: Exit::CommandLine, ..failure };
    let opened = |path: &Path| is_usd(path).then(|| UsdFile::open(path, "")).transpose().map_err(as_error);
    let stages = [opened(&args.a)?, opened(&args.b)?];
    let pairs = match &stages {
        [None, None] => pairs(&args.a, &args.b),
        [a, b] => usd_pairs(&side(a.as_ref(), &args.a), &side(b.as_ref(), &args.b)),
    };
    let geometry = |stage: &Option<UsdFile>, path: &Path, time: Option<f64>| -> Result<Geometry, Failure> {
        match stage {
            Some(stage) => Ok(stage.read(time.unwrap_or(stage.first()))?.geometry),
            None => Ok(read(path)?.geometry),
        }
    };
    let compared = |pair: Pair| -> Result<Compared, Failure> {
        let [first, second] = &stages;
        let findings = match (&pair.a, &pair.b) {
            (Some(a), Some(b)) => {
                compare(&geometry(first, a, pair.time)?, &geometry(second, b, pair.time)?, args.tolerance)
            }
            _ => Vec::new(),
        };
        Ok(Compared { pair, findings })
    };
    let all = parallel::map(pairs.map_err(as_error)?, |_, pair| compared(pair));
    // In the order of the pairs, so that always the same of several errors is reported.
    let all = all.into_iter().collect::<Result<Vec<_>, _>>().map_err(as_error)?;
    let text = match args.json {
        true => show::json(&all, args.tolerance),
        false => show::text(&all, args.tolerance),
    };
    let written = std::io::stdout().write_all(text.as_bytes());
    // A closed stdout does not change the exit code.
    if let Err(error) = written.as_ref().map_err(std::io::Error::kind)
        && error != ErrorKind::BrokenPipe
    {
        return written.map_err(|error| as_error(error.into()));
    }
    if all.iter().any(Compared::differs) { Err(Failure::reported(Exit::File)) } else { Ok(()) }
}
