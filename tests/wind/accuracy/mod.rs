//! How well each law of the wind chain is met, beside how well it has to be: one table, printed, checked, and the one
//! that docs/wind.md shows.
//!
//! Laws are closed forms, worked in f64 by code that shares nothing with the kernels.

mod bend;
mod contact;
mod envelope;
mod noise;
mod swing;
mod symmetry;

/// A law, how well it was met, and how well it has to be.
struct Figure {
    law: &'static str,
    measured: String,
    limit: String,
    holds: bool,
}

impl Figure {
    /// The largest error found, of at most `limit`.
    fn error(law: &'static str, worst: f64, limit: f64, unit: &str) -> Self {
        let holds = worst <= limit;
        Self { law, measured: format!("{worst:.1e}{unit}"), limit: format!("{limit:.0e}{unit}"), holds }
    }

    /// Errors, each of at most `limit` and what storing positions takes beside it: shows the one that comes nearest.
    fn stored(law: &'static str, errors: impl IntoIterator<Item = [f64; 2]>, limit: f64, unit: &str) -> Self {
        let share = |[error, storage]: [f64; 2]| error / (limit + storage);
        let nearest = |a: [f64; 2], b: [f64; 2]| if share(b) > share(a) { b } else { a };
        let [error, storage] = errors.into_iter().reduce(nearest).expect("a law is tried");
        let holds = error <= limit + storage;
        Self { law, measured: format!("{error:.1e}{unit}"), limit: format!("{limit:.0e} + {storage:.1e}{unit}"), holds }
    }

    /// Numbers that all lie within `limits`.
    fn within(law: &'static str, found: &[f64], [low, high]: [f64; 2]) -> Self {
        let least = found.iter().copied().fold(f64::INFINITY, f64::min);
        let most = found.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let holds = found.iter().all(|x| (low..=high).contains(x));
        let measured = if found.len() == 1 { format!("{least:.2}") } else { format!("{least:.2}…{most:.2}") };
        Self { law, measured, limit: format!("{low}…{high}"), holds }
    }

    /// What must not happen at all, of so many times that it could.
    fn never(law: &'static str, count: usize, of: usize) -> Self {
        Self { law, measured: format!("{count} of {of}"), limit: "0".into(), holds: count == 0 && of > 0 }
    }
}

/// The distance of a position this large from the next, four times: what storing positions may move a point by.
fn storage(points: &[[f32; 3]]) -> f64 {
    let largest = points.as_flattened().iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    4.0 * (f64::from(largest.next_up()) - f64::from(largest))
}

#[test]
fn every_law_of_the_chain_holds_within_its_limit_and_is_in_the_docs() {
    let figures = [
        bend::figures(),
        symmetry::figures(),
        noise::figures(),
        envelope::figures(),
        swing::figures(),
        contact::figures(),
    ];
    let figures: Vec<Figure> = figures.into_iter().flatten().collect();
    let row = |figure: &Figure| format!("| {} | {} | {} |\n", figure.law, figure.measured, figure.limit);
    let table = format!("| law | measured | limit |\n|---|---|---|\n{}", figures.iter().map(row).collect::<String>());
    print!("{table}");
    let broken: String = figures.iter().filter(|figure| !figure.holds).map(row).collect();
    assert!(broken.is_empty(), "these laws are broken:\n{broken}");
    let shown = include_str!("../../../docs/wind.md");
    assert!(shown.contains(&table), "docs/wind.md shows another table than this one:\n{table}");
}
