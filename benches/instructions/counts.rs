//! Stored counts: a line a case, and the compiler they hold for.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// How far a count may be from the stored one.
const TOLERANCE: f64 = 0.03;

/// How far a count may be in any case: it is the difference of two runs of the program, each of which varies by some ten
/// thousand instructions. Softbody_Goal, two million, was within 3.3 % in runs of one program.
const NOISE: u64 = 100_000;

/// What `benches/instructions.txt` holds.
struct Stored {
    compiler: String,
    counts: Vec<(String, u64)>,
}

/// Prints counts beside the stored ones; fails where one moved, or stores them all.
pub(crate) fn judge(names: &[&str], counts: &[u64], bless: bool) -> ExitCode {
    let compiler = compiler();
    let mut stored = read();
    let known =
        |stored: &Stored, name: &str| stored.counts.iter().find(|(known, _)| known == name).map(|found| found.1);
    let mut moved = 0;
    println!("{:<36} {:>15} {:>15} {:>9}", "instructions", "stored", "now", "change");
    for (name, count) in names.iter().zip(counts) {
        let before = known(&stored, name);
        let change = before.map(|before| *count as f64 / before as f64 - 1.0);
        let off = before.is_none_or(|before| {
            let moved = count.abs_diff(before);
            moved > NOISE && moved as f64 > TOLERANCE * before as f64
        });
        moved += usize::from(off);
        let before = before.map_or("none".to_owned(), |count| count.to_string());
        let change = change.map_or(String::new(), |change| format!("{:+.2} %", 100.0 * change));
        println!("{name:<36} {before:>15} {count:>15} {change:>9}{}", if off { "  moved" } else { "" });
    }
    if bless {
        // A run of a few cases keeps the counts of the others.
        for (name, count) in names.iter().zip(counts) {
            match stored.counts.iter_mut().find(|(known, _)| known == name) {
                Some((_, known)) => *known = *count,
                None => stored.counts.push(((*name).to_owned(), *count)),
            }
        }
        stored.compiler = compiler;
        return write(&stored);
    }
    if stored.compiler != compiler {
        println!("not compared: counts are stored for `{}`, this is `{compiler}`", stored.compiler);
        return ExitCode::SUCCESS;
    }
    if moved > 0 {
        eprintln!(
            "{moved} counts are more than {:.0} % off: store them with `cargo bench --bench instructions -- --bless` and \
             say in CHANGELOG.md why, or find what got slower",
            100.0 * TOLERANCE
        );
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/instructions.txt")
}

/// The first line is the compiler, each other one a count and a case; empty where there is no file.
fn read() -> Stored {
    let text = std::fs::read_to_string(path()).unwrap_or_default();
    let mut lines = text.lines();
    let compiler = lines.next().unwrap_or_default().to_owned();
    let count = |line: &str| {
        let (count, name) = line.trim().split_once(' ')?;
        Some((name.to_owned(), count.parse().ok()?))
    };
    Stored { compiler, counts: lines.filter_map(count).collect() }
}

fn write(stored: &Stored) -> ExitCode {
    let mut text = format!("{}\n", stored.compiler);
    for (name, count) in &stored.counts {
        writeln!(text, "{count:>12} {name}").expect("memory");
    }
    match std::fs::write(path(), text) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}: {error}", path().display());
            ExitCode::FAILURE
        }
    }
}

/// `rustc 1.95.0 (…)`: the compiler that cargo would use now.
fn compiler() -> String {
    let output = Command::new(std::env::var_os("RUSTC").unwrap_or("rustc".into())).arg("--version").output();
    output.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned()).unwrap_or_default()
}
