//! docs/stability.md: a line for each row of NUMERICS B and each scene of it, with its outcome and its figure.
//!
//! Every scene records its line. With `BLESS` set, or in `cargo bench --bench laws`, scenes run in full and the page is
//! written from what was recorded; otherwise they run in a coarse form, and an outcome worse than the page's fails.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{LazyLock, Mutex, PoisonError};

/// What came of a scene, the best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Outcome {
    /// Finite, and every guarantee of its part is kept.
    Finite,
    /// Finite, but something could not be met, which a metric says.
    Capped,
    /// There is a message that says what is wrong.
    Refused,
}

impl Outcome {
    fn word(self) -> &'static str {
        match self {
            Self::Finite => "finite",
            Self::Capped => "capped",
            Self::Refused => "refused",
        }
    }

    fn of(word: &str) -> Option<Self> {
        [Self::Finite, Self::Capped, Self::Refused].into_iter().find(|outcome| outcome.word() == word)
    }
}

/// The parts of the page, in its order.
const PARTS: [(&str, &str); 4] = [
    (
        "Every node",
        "Each node of the catalogue with ordinary inputs, changed as the row says. A message names a refused input by the \
         node that it comes from; \"(given)\" stands for geometry that the test gives in place of that node's.",
    ),
    (
        "Wind",
        "Fur on a ball: gusts, shielding, wind, jiggle, collision, and the nodes that attach and interpolate curves. Segments \
         keep their lengths to 1e-5 of the curve's, roots stay, envelopes are in 0…1, and every crossing is counted (`crossings_left`).",
    ),
    (
        "Soft bodies",
        "A block of 27 particles with each of the three integrators, over 24 frames. Every particle is checked, not the skin \
         alone; tets inside out, overlaps and lost volume are not more than the metrics say. A figure is the worst of the three \
         integrators.",
    ),
    (
        "Liquids",
        "A box of 12³ cells over 24 frames. Surface, particles and volume are finite and stay in the box; the volume is what was \
         there and added, minus what was removed. \"Notes\" are metrics that a note is about; `liquid_outside` \
         alone does not make a scene capped, as most fill the box from a mesh that reaches out of it.",
    ),
];

/// A line of the page.
#[derive(Clone, Debug)]
struct Line {
    outcome: Outcome,
    figure: String,
}

/// Its part; the first row of NUMERICS B, for the order; all of them; what the scene is.
type Key = (usize, u32, String, String);

static RECORDED: Mutex<BTreeMap<Key, Line>> = Mutex::new(BTreeMap::new());
static FULL: AtomicBool = AtomicBool::new(false);

/// Whether scenes run in full.
pub(crate) fn is_full() -> bool {
    FULL.load(Ordering::Relaxed) || std::env::var_os("BLESS").is_some()
}

/// From now on scenes run in full, and nothing is compared until [`text`] is.
#[allow(dead_code, reason = "of `cargo bench --bench laws`")]
pub(crate) fn run_in_full() {
    FULL.store(true, Ordering::Relaxed);
}

/// Frames of a scene with a solver: these in the coarse form, 24 in full.
pub(crate) fn frames(coarse: i64) -> i64 {
    if is_full() { 24 } else { coarse }
}

/// Records a scene of a part. `rows` are numbers of NUMERICS B, such as `24` or `34, 42`.
///
/// # Panics
/// If the page has no such line, or a better outcome.
pub(crate) fn record(part: &str, rows: &str, case: &str, outcome: Outcome, figure: &str) {
    let place = PARTS.iter().position(|(name, _)| *name == part).expect("a part of the page");
    let first = rows.split(',').next().and_then(|first| first.trim().parse().ok()).expect("rows of NUMERICS B");
    let key = (place, first, rows.to_owned(), cell(case));
    if is_full() {
        let mut recorded = RECORDED.lock().unwrap_or_else(PoisonError::into_inner);
        let before = recorded.insert(key, Line { outcome, figure: cell(figure) });
        assert!(before.is_none(), "{part}: two scenes are called `{case}`");
        if !FULL.load(Ordering::Relaxed) {
            fs::write(path(), rendered(&recorded)).unwrap();
        }
        return;
    }
    static STORED: LazyLock<BTreeMap<(usize, String, String), Outcome>> =
        LazyLock::new(|| parsed(&fs::read_to_string(path()).unwrap_or_default()));
    let bless = "`cargo xtask bless stability` writes the page";
    match STORED.get(&(place, key.2.clone(), key.3.clone())) {
        None => panic!("docs/stability.md has no line `{case}` in row {rows} of {part}; {bless}"),
        Some(stored) => assert!(
            outcome <= *stored,
            "{part}, row {rows}, {case}: {} is worse than {} on docs/stability.md: {figure}",
            outcome.word(),
            stored.word()
        ),
    }
}

/// The page of what was recorded.
#[allow(dead_code, reason = "of `cargo bench --bench laws`")]
pub(crate) fn text() -> String {
    rendered(&RECORDED.lock().unwrap_or_else(PoisonError::into_inner))
}

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/stability.md")
}

/// A text as a cell of a table.
fn cell(text: &str) -> String {
    text.replace('|', "/").replace('\n', " ")
}

/// The rows of NUMERICS B that a scene's name begins with, as in `#24: under the ground`, or `numbers`; and the rest of its name.
pub(crate) fn split<'a>(numbers: &'a str, name: &'a str) -> (&'a str, &'a str) {
    name.strip_prefix('#').and_then(|named| named.split_once(": ")).unwrap_or((numbers, name))
}

/// A test for each of these functions, and `GROUPS`, which lists them all.
macro_rules! groups {
    ($($module:ident::$name:ident,)*) => {
        /// All tables of this module.
        #[allow(dead_code, reason = "of `cargo bench --bench laws`")]
        pub(crate) const GROUPS: &[fn()] = &[$($module::$name),*];

        #[cfg(test)]
        mod tables {
            $(#[test]
            fn $name() {
                super::$module::$name();
            })*
        }
    };
}
pub(crate) use groups;

const HEAD: &str = "# Stability at extremes

Written by `cargo xtask bless stability`. Each scene is finite, or finite with a metric that says what could not be met (capped), or
refused with a message; it has the same bits on one thread and on several, and takes a bounded number of iterations. `cargo test --test
stability` runs a coarse form, with fewer frames, and fails where an outcome is worse than here; `cargo bench --bench laws -- stability`
runs all of it. B is the number in the project's list of extremes, by which rows are sorted: 1-9 numbers, 10-20 empty and degenerate input,
21-30 wind, 31-44 soft bodies, 45-54 liquids.

Random graphs of all nodes, with params in and out of their ranges, broken files and command lines: `cargo xtask torture`
([torture.md](torture.md)). Your own graph: `convect study GRAPH --extremes` ([study.md](study.md)).
";

fn rendered(recorded: &BTreeMap<Key, Line>) -> String {
    let mut text = HEAD.to_owned();
    for (place, (part, about)) in PARTS.iter().enumerate() {
        let _ =
            write!(text, "\n## {part}\n\n{about}\n\n| B | case | outcome | figure or message |\n|---|---|---|---|\n");
        for ((_, _, rows, case), line) in recorded.iter().filter(|((of, ..), _)| *of == place) {
            let _ = writeln!(text, "| {rows} | {case} | {} | {} |", line.outcome.word(), line.figure);
        }
    }
    text
}

/// Outcomes by part, rows and case.
fn parsed(text: &str) -> BTreeMap<(usize, String, String), Outcome> {
    let (mut place, mut found) = (0, BTreeMap::new());
    for line in text.lines() {
        if let Some(name) = line.strip_prefix("## ") {
            place = PARTS.iter().position(|(part, _)| *part == name).unwrap_or(0);
        }
        let mut cells = line.trim_start_matches("| ").split(" | ");
        if let (Some(rows), Some(case), Some(outcome)) = (cells.next(), cells.next(), cells.next())
            && let Some(outcome) = Outcome::of(outcome)
        {
            found.insert((place, rows.to_owned(), case.to_owned()), outcome);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    #[allow(unused_imports, reason = "`cargo bench --bench laws` has no tests")]
    use super::*;

    #[test]
    fn a_page_is_read_as_it_is_written() {
        let line = |outcome| Line { outcome, figure: "1e-6 m".into() };
        let key = |place, rows: &str, case: &str| (place, 3, rows.to_owned(), cell(case));
        let recorded = BTreeMap::from([
            (key(1, "3", "a | b"), line(Outcome::Capped)),
            (key(2, "3, 4", "c"), line(Outcome::Refused)),
        ]);
        let read = parsed(&rendered(&recorded));
        let expected = BTreeMap::from([
            ((1, "3".to_owned(), "a / b".to_owned()), Outcome::Capped),
            ((2, "3, 4".to_owned(), "c".to_owned()), Outcome::Refused),
        ]);
        assert_eq!(read, expected);
    }

    #[test]
    fn the_page_has_every_row() {
        let stored = parsed(&fs::read_to_string(path()).unwrap_or_default());
        let rows: Vec<u32> =
            stored.keys().flat_map(|(_, rows, _)| rows.split(", ")).map(|row| row.parse().unwrap()).collect();
        let missing: Vec<u32> = (1..=54).filter(|row| !rows.contains(row)).collect();
        assert_eq!(missing, [0; 0], "rows of NUMERICS B without a scene");
    }
}
