//! Laws, how well they are met and how well they have to be: a table, printed, checked, and held equal to the docs' own.

#![allow(dead_code, reason = "each suite takes what it needs")]

/// A law, how well it was met, and how well it has to be.
pub(crate) struct Figure {
    law: &'static str,
    measured: String,
    limit: String,
    holds: bool,
    missed: bool,
}

impl Figure {
    fn new(law: &'static str, measured: String, limit: String, holds: bool) -> Self {
        Self { law, measured, limit, holds, missed: false }
    }

    /// The largest error found, of at most `limit`.
    pub(crate) fn error(law: &'static str, worst: f64, limit: f64, unit: &str) -> Self {
        Self::new(law, format!("{worst:.1e}{unit}"), format!("{limit:.0e}{unit}"), worst <= limit)
    }

    /// Errors, each of at most `limit` and what storing positions takes beside it: shows the one that comes nearest.
    pub(crate) fn stored(
        law: &'static str,
        errors: impl IntoIterator<Item = [f64; 2]>,
        limit: f64,
        unit: &str,
    ) -> Self {
        let share = |[error, storage]: [f64; 2]| error / (limit + storage);
        let nearest = |a: [f64; 2], b: [f64; 2]| if share(b) > share(a) { b } else { a };
        let [error, storage] = errors.into_iter().reduce(nearest).expect("a law is tried");
        let limits = format!("{limit:.0e} + {storage:.1e}{unit}");
        Self::new(law, format!("{error:.1e}{unit}"), limits, error <= limit + storage)
    }

    /// Numbers that all lie within `limits`.
    pub(crate) fn within(law: &'static str, found: &[f64], [low, high]: [f64; 2]) -> Self {
        let least = found.iter().copied().fold(f64::INFINITY, f64::min);
        let most = found.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let holds = found.iter().all(|x| (low..=high).contains(x));
        let measured = if found.len() == 1 { format!("{least:.2}") } else { format!("{least:.2}…{most:.2}") };
        Self::new(law, measured, format!("{low}…{high}"), holds)
    }

    /// What must not happen at all, of so many times that it could.
    pub(crate) fn never(law: &'static str, count: usize, of: usize) -> Self {
        Self::new(law, format!("{count} of {of}"), "0".into(), count == 0 && of > 0)
    }

    /// A law that is known not to be met: said in the table, and refused there once it is.
    pub(crate) fn missed(self) -> Self {
        Self { missed: true, ..self }
    }

    fn row(&self) -> String {
        let missed = if self.missed { ", missed" } else { "" };
        format!("| {} | {} | {}{missed} |\n", self.law, self.measured, self.limit)
    }
}

/// Prints the table, and holds every law to its limit and `docs`, the text of the page of this name, to the table.
pub(crate) fn hold(figures: &[Figure], page: &str, docs: &str) {
    let table =
        format!("| law | measured | limit |\n|---|---|---|\n{}", figures.iter().map(Figure::row).collect::<String>());
    print!("{table}");
    let broken: String = figures.iter().filter(|figure| figure.holds == figure.missed).map(Figure::row).collect();
    assert!(broken.is_empty(), "these laws are broken, or said to be missed and are not:\n{broken}");
    assert!(docs.contains(&table), "{page} shows another table than this one:\n{table}");
}

/// The distance of a position this large from the next, four times: what storing positions may move a point by.
pub(crate) fn storage(points: &[[f32; 3]]) -> f64 {
    let largest = points.as_flattened().iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    4.0 * (f64::from(largest.next_up()) - f64::from(largest))
}
