//! `torture`: runs the program on mutated graphs, files and command lines, and reports what must never happen: a panic,
//! an abort, a hang, a lost file, a half-written file, other bits on a repeat.

mod bytes;
mod call;
mod case;
mod dice;
mod file_cases;
mod generate;
mod graph_cases;
mod graphs;
mod judge;
mod kill_cases;
mod params;
mod stock;
mod values;

use std::collections::BTreeMap;
use std::fs;
use std::hash::{BuildHasher as _, RandomState};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use call::{Outcome, Patience};
use case::{Call, Case, Step};
use dice::Dice;
use stock::Stock;

/// What is asked of a torture.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Options {
    /// For how long; the stored seeds are run first, and completely
    #[arg(long, value_name = "N", default_value_t = 1.0)]
    minutes: f64,
    /// Repeat the case of this seed alone, and keep its folder
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// The first seed; cases take it and those after it [default: another one every time]
    #[arg(long, value_name = "S")]
    from: Option<u64>,
    /// Build and torture the release profile
    #[arg(long)]
    release: bool,
    /// Torture this program instead of building one
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
}

/// As many seeds of slow cases are printed.
const MOST_SLOW: usize = 30;

/// A call is asked to stop after ten seconds, and hangs if it then takes until a minute has passed.
const PATIENCE: Patience = Patience { asks: Duration::from_secs(10), hangs: Duration::from_secs(60) };

/// Tortures the program.
///
/// # Errors
/// If it finds anything, or the program cannot be built or run.
#[allow(clippy::disallowed_methods, reason = "ends after the time that was asked for; no result depends on it")]
pub(crate) fn run(root: &Path, options: &Options) -> Result<String, String> {
    let program = program(root, options)?;
    let stock = Stock::load(root, &program)?;
    let folder = root.join("target/torture");
    let mut torture = Torture { program, stock, folder, patience: PATIENCE, tally: Tally::default() };
    if let Some(seed) = options.seed {
        torture.case(seed, true)?;
        return torture.tally.verdict();
    }
    for seed in stored_seeds(&fs::read_to_string(root.join("xtask/torture_seeds.txt")).unwrap_or_default())? {
        torture.case(seed, false)?;
    }
    let first = options.from.unwrap_or_else(|| RandomState::new().hash_one("torture") >> 16);
    println!("seeds from {first}");
    let (start, time) = (Instant::now(), Duration::from_secs_f64(options.minutes.clamp(0.0, 1e6) * 60.0));
    let mut seed = first;
    while start.elapsed() < time {
        torture.case(seed, false)?;
        seed = seed.wrapping_add(1);
    }
    torture.tally.verdict()
}

/// The program to torture, built first if none is given.
fn program(root: &Path, options: &Options) -> Result<PathBuf, String> {
    if let Some(program) = &options.program {
        return program.canonicalize().map_err(|error| format!("{}: {error}", program.display()));
    }
    let mut build = Command::new("cargo");
    build.args(["build", "--quiet", "--bin", "convect"]).args(options.release.then_some("--release")).current_dir(root);
    let status = build.status().map_err(|error| format!("`cargo build` could not be run: {error}"))?;
    let profile = if options.release { "release" } else { "debug" };
    status
        .success()
        .then(|| root.join("target").join(profile).join("convect"))
        .ok_or_else(|| "`cargo build` failed".into())
}

/// Seeds of the stored list: one per line, with a comment after `#`.
fn stored_seeds(text: &str) -> Result<Vec<u64>, String> {
    let lines =
        text.lines().map(|line| line.split('#').next().unwrap_or_default().trim()).filter(|line| !line.is_empty());
    lines.map(|line| line.parse().map_err(|_| format!("torture_seeds.txt: `{line}` is not a seed"))).collect()
}

/// A torture under way.
struct Torture {
    program: PathBuf,
    stock: Stock,
    /// Folders of cases are made here.
    folder: PathBuf,
    patience: Patience,
    tally: Tally,
}

/// What came of the cases so far.
#[derive(Default)]
struct Tally {
    /// Of each kind the number of cases, and of their calls by how they ended.
    kinds: BTreeMap<&'static str, (usize, BTreeMap<String, usize>)>,
    /// The case under way.
    seed: u64,
    /// Seeds of cases with calls that were stopped because they took long.
    slow: Vec<u64>,
    /// Cooks of graphs with nothing else wrong: all, and those that wrote all they were asked for.
    graphs: [usize; 2],
    findings: usize,
}

impl Tally {
    fn count(&mut self, kind: &'static str, call: &Call, outcome: &Outcome) {
        let code = match (outcome.code, outcome.signal) {
            (Some(code), _) => code.to_string(),
            (None, signal) => format!("signal {}", signal.unwrap_or(0)),
        };
        *self.kinds.entry(kind).or_default().1.entry(code).or_default() += 1;
        if outcome.slow {
            self.slow.push(self.seed);
        }
        if call.args.first().is_some_and(|verb| verb == "cook") && matches!(kind, "mutated" | "generated") {
            let has_cooked = outcome.code == Some(0) || outcome.slow || outcome.stderr.contains("with --strict");
            self.graphs[0] += 1;
            self.graphs[1] += usize::from(has_cooked);
        }
    }

    fn verdict(&self) -> Result<String, String> {
        let mut lines = String::new();
        let (mut cases, mut calls) = (0, 0);
        for (kind, (count, codes)) in &self.kinds {
            let listed: Vec<String> = codes.iter().map(|(code, count)| format!("{code}: {count}")).collect();
            lines += &format!("{kind:>14}: {count} cases; calls by exit code {}\n", listed.join(", "));
            cases += count;
            calls += codes.values().sum::<usize>();
        }
        lines += &format!(
            "{cases} cases, {calls} calls, {} of them stopped after {} s; ",
            self.slow.len(),
            PATIENCE.asks.as_secs()
        );
        if !self.slow.is_empty() {
            let seeds: Vec<String> = self.slow.iter().take(MOST_SLOW).map(u64::to_string).collect();
            lines += &format!("of seeds {}; ", seeds.join(" "));
        }
        let [all, cooked] = self.graphs;
        lines += &format!("{cooked} of {all} cooks of changed and generated graphs cooked; {} findings", self.findings);
        if self.findings == 0 { Ok(lines) } else { Err(lines) }
    }
}

impl Torture {
    /// Runs the case of `seed`; its folder is kept if something is found, or if `keep`.
    fn case(&mut self, seed: u64, keep: bool) -> Result<(), String> {
        let case = Case::of(seed, &self.stock);
        self.tally.kinds.entry(case.kind).or_default().0 += 1;
        self.tally.seed = seed;
        let folder = self.folder.join(seed.to_string());
        let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
        if folder.exists() {
            fs::remove_dir_all(&folder).map_err(failed)?;
        }
        set_up(&case, &folder).map_err(failed)?;
        let found = self.steps(&case, &folder)?;
        if let Some((found, command)) = &found {
            self.tally.findings += 1;
            println!("seed {seed} ({}): {found}\n  in {}\n  {command}", case.kind, folder.display());
        } else if !keep {
            fs::remove_dir_all(&folder).map_err(failed)?;
        } else {
            println!("seed {seed} ({}): nothing found\n  in {}", case.kind, folder.display());
        }
        Ok(())
    }

    /// Takes the steps of a case until something is found: what, and the command that led there.
    fn steps(&mut self, case: &Case, folder: &Path) -> Result<Option<(String, String)>, String> {
        let mut command = String::new();
        // Of the cooks that were not stopped the exit code, by the folder that they wrote to.
        let mut ended: BTreeMap<String, Option<i32>> = BTreeMap::new();
        for step in &case.steps {
            let found = match step {
                Step::Calls(calls) => {
                    command = calls.iter().map(shown).collect::<Vec<_>>().join(" & ");
                    self.calls(case, calls, folder, &mut ended)?
                }
                Step::Damage(below, seed) => {
                    damage(&folder.join(below), *seed, case);
                    None
                }
                Step::Same(a, b) => match (ended.get(*a), ended.get(*b)) {
                    (Some(one), Some(other)) if one != other => {
                        Some(format!("the cook into `{a}` ends with {one:?}, that into `{b}` with {other:?}"))
                    }
                    (Some(_), Some(_)) => judge::difference(&folder.join(a), &folder.join(b)),
                    _ => None,
                },
            };
            if let Some(found) = found {
                return Ok(Some((found, command)));
            }
        }
        Ok(None)
    }

    /// Runs `calls` at once and judges how they ended; `ended` gets the exit codes of cooks.
    fn calls(
        &mut self,
        case: &Case,
        calls: &[Call],
        folder: &Path,
        ended: &mut BTreeMap<String, Option<i32>>,
    ) -> Result<Option<String>, String> {
        let before = judge::temporaries(folder);
        let run = |call| call::run(&self.program, call, folder, self.patience);
        let outcomes: Vec<Outcome> = std::thread::scope(|scope| {
            let running: Vec<_> = calls.iter().map(|call| scope.spawn(|| run(call))).collect();
            let joined = running.into_iter().map(|one| one.join().unwrap_or_else(|_| Err("a call panicked".into())));
            joined.collect::<Result<_, _>>()
        })?;
        for (call, outcome) in calls.iter().zip(&outcomes) {
            self.tally.count(case.kind, call, outcome);
            if let Some(out) = call.args.iter().skip_while(|arg| *arg != "--out").nth(1) {
                match outcome.is_whole() {
                    true => ended.insert(out.clone(), outcome.code),
                    false => ended.remove(out),
                };
            }
        }
        let ending = |(call, outcome)| judge::ending(call, outcome).map(|found| (found, outcome));
        let found = calls.iter().zip(&outcomes).find_map(ending);
        let found = found.or_else(|| {
            let ended_all = outcomes.iter().all(|outcome| outcome.code.is_some());
            let left = || judge::temporaries(folder).into_iter().find(|path| ended_all && !before.contains(path));
            let left = || left().map(|path| format!("the temporary `{}` is left", path.display()));
            let found = judge::lost(case, folder).or_else(left).or_else(|| self.incomplete(case, folder));
            found.map(|found| (found, &outcomes[0]))
        });
        Ok(found.map(|(found, outcome)| format!("{found}{}", first_lines(&outcome.stderr))))
    }

    fn incomplete(&self, case: &Case, folder: &Path) -> Option<String> {
        let mut budget = 3;
        judge::incomplete(case, folder, |path| {
            budget -= 1;
            let call = Call { args: vec!["stats".into(), path.display().to_string()], ..Call::default() };
            let read = || call::run(&self.program, &call, folder, self.patience).is_ok_and(|read| read.code == Some(0));
            budget < 0 || read()
        })
    }
}

/// A call as it can be repeated in the folder by hand.
fn shown(call: &Call) -> String {
    let quoted = call.args.iter().map(|arg| {
        if arg.contains([' ', '"', '*', '#', '\n', '(', '{']) || arg.is_empty() {
            format!("'{arg}'")
        } else {
            arg.clone()
        }
    });
    let mut line = format!("convect {}", quoted.collect::<Vec<_>>().join(" "));
    if line.len() > 2000 {
        let end = line.char_indices().map(|(at, _)| at).take_while(|at| *at < 2000).last().unwrap_or(0);
        line = format!("{}…", &line[..end]);
    }
    if call.full_stdout {
        line += " > /dev/full";
    }
    if let Some(blocks) = call.blocks {
        line = format!("ulimit -f {blocks}; {line}");
    }
    if let Some((signal, after)) = call.signal {
        line += &format!("  # SIG{signal} after {after} ms");
    }
    line
}

fn first_lines(stderr: &str) -> String {
    stderr.lines().take(3).map(|line| format!("\n  | {}", line.chars().take(300).collect::<String>())).collect()
}

/// Makes the files of a case.
fn set_up(case: &Case, folder: &Path) -> std::io::Result<()> {
    fs::create_dir_all(folder)?;
    for (path, bytes) in &case.files {
        let path = folder.join(path);
        fs::create_dir_all(path.parent().unwrap_or(folder))?;
        fs::write(path, bytes)?;
    }
    for pipe in &case.pipes {
        Command::new("mkfifo").arg(folder.join(pipe)).status()?;
    }
    case.links.iter().try_for_each(|(link, target)| std::os::unix::fs::symlink(target, folder.join(link)))
}

/// Damages some of the files below `folder` that are not the case's own.
fn damage(folder: &Path, seed: u64, case: &Case) {
    let mut dice = Dice::new(seed);
    for (path, mut bytes) in judge::files(folder) {
        let is_own =
            case.files.iter().any(|(own, _)| folder.ends_with("cache") && *own == format!("cache/{}", path.display()));
        if !is_own && dice.one_in(2) {
            bytes::mutate(&mut bytes, &mut dice);
            // A file that vanished or cannot be written is damaged enough.
            let _ = fs::write(folder.join(path), bytes);
        }
    }
}

#[cfg(test)]
mod tests;
