//! A gate on what the nodes cost: `cargo bench --bench instructions`.
//!
//! Counts the instructions with which the program cooks each case, with valgrind's callgrind, on one thread with AVX2, less
//! those with which it starts and cooks what the node reads. A count that differs by more than 3 % from that in
//! `benches/instructions.txt` fails. Unlike times, counts hardly vary between runs and machines; they do between compilers,
//! so they are compared only where the compiler is the one they were stored with.
//!
//! Then it compares cooks of whole graphs without and with a feature that changes nothing: the feature may cost 1 %, and no
//! bit.
//!
//! `-- --bless` stores the counts, `-- WORD` runs the cases whose name has the word in it; `-- neutral` the pairs alone.

mod cases;
mod counts;
mod neutral;
mod program;

use std::process::{Command, ExitCode};

use cases::{CASES, Case};
use neutral::{NEUTRAL, Neutral};
use numerics::parallel;
use program::{Run, Written};

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let bless = words.iter().any(|word| word == "--bless");
    let filter: Vec<&String> = words.iter().filter(|word| *word != "--bless").collect();
    let is_asked = |name: &str| filter.is_empty() || filter.iter().any(|word| name.contains(*word));
    let asked: Vec<&Case> = CASES.iter().filter(|case| is_asked(case.name)).collect();
    let pairs: &[Neutral] = if is_asked("neutral") { NEUTRAL } else { &[] };
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("skipped: valgrind is not installed");
        return ExitCode::SUCCESS;
    }
    let judged = counts_of_nodes(&asked).and_then(|counts| {
        let names: Vec<&str> = asked.iter().map(|case| case.name).collect();
        let judged = counts::judge(&names, &counts, bless);
        judge_pairs(pairs)?;
        Ok(judged)
    });
    judged.unwrap_or_else(|fault| {
        eprintln!("{fault}");
        ExitCode::FAILURE
    })
}

/// Instructions of each case's node: those of the whole case, less those of what the node reads.
fn counts_of_nodes(cases: &[&Case]) -> Result<Vec<u64>, String> {
    let runs: Vec<Run> = cases.iter().flat_map(|case| [Run::whole(case, Written::All), Run::read(case)]).collect();
    let counts = instructions(&runs)?;
    Ok(counts.as_chunks().0.iter().map(|[whole, read]| whole.saturating_sub(*read)).collect())
}

/// Instructions of each run, several counted at a time.
fn instructions(runs: &[Run]) -> Result<Vec<u64>, String> {
    parallel::map(runs, |_, run| run.instructions()).into_iter().collect()
}

/// The most that a feature may cost that changes nothing, as a share of the instructions.
const NEUTRAL_COST: f64 = 0.01;

/// Prints what each feature costs that changes nothing; an error where that is too much, or a position differs.
fn judge_pairs(pairs: &[Neutral]) -> Result<(), String> {
    let mut wrong = Vec::new();
    if !pairs.is_empty() {
        println!("\n{:<40} {:>15} {:>15} {:>9}", "features that change nothing", "without", "with", "cost");
    }
    let run = |case| Run::whole(case, Written::Positions);
    let runs: Vec<Run> = pairs.iter().flat_map(|pair| [run(&pair.without), run(&pair.with)]).collect();
    let counts = instructions(&runs)?;
    for ((Neutral { with, missed, .. }, [without_run, with_run]), [before, after]) in
        pairs.iter().zip(runs.as_chunks().0).zip(counts.as_chunks().0)
    {
        let cost = *after as f64 / *before as f64 - 1.0;
        let known = if *missed { "  missed" } else { "" };
        println!("{:<40} {before:>15} {after:>15} {:>+7.2} %{known}", with.name, 100.0 * cost);
        if *missed && cost <= NEUTRAL_COST {
            wrong.push(format!("{} is marked as missed, but costs {:.2} %", with.name, 100.0 * cost));
        }
        if cost > NEUTRAL_COST && !missed {
            wrong.push(format!("{} costs {:.2} %, more than {:.0} %", with.name, 100.0 * cost, 100.0 * NEUTRAL_COST));
        }
        if without_run.result()? != with_run.result()? {
            wrong.push(format!("{} changes bits of positions", with.name));
        }
    }
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("\n")) }
}
