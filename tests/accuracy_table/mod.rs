//! A table of laws with the accuracy at which each is met, and its limit. The table is printed, checked, and compared
//! with the one in docs/.

#![allow(dead_code, reason = "each suite uses part of it")]

/// How much is computed: `cargo test` runs coarse forms of laws that take long, `cargo bench --bench laws` the full
/// forms.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Effort {
    Coarse,
    Full,
}

impl Effort {
    pub(crate) fn choose<T>(self, coarse: T, full: T) -> T {
        match self {
            Self::Coarse => coarse,
            Self::Full => full,
        }
    }
}

/// A law, the accuracy at which it was met, and the limit.
pub(crate) struct Figure {
    law: &'static str,
    measured: String,
    limit: String,
    holds: bool,
    /// Whether the law is known not to hold.
    missed: bool,
    /// Whether it was measured in a coarse form, so that docs/ has another figure.
    coarse: bool,
}

impl Figure {
    fn new(law: &'static str, measured: String, limit: String, holds: bool) -> Self {
        Self { law, measured, limit, holds, missed: false, coarse: false }
    }

    /// The largest error found; it must be at most `limit`.
    pub(crate) fn error(law: &'static str, worst: f64, limit: f64, unit: &str) -> Self {
        Self::new(law, format!("{worst:.1e}{unit}"), format!("{limit:.0e}{unit}"), worst <= limit)
    }

    /// Pairs of an error and the rounding of stored positions; each error must be at most `limit` plus that rounding.
    /// Shows the pair closest to its limit.
    pub(crate) fn stored(
        law: &'static str,
        errors: impl IntoIterator<Item = [f64; 2]>,
        limit: f64,
        unit: &str,
    ) -> Self {
        let share = |[error, storage]: [f64; 2]| error / (limit + storage);
        let closest = |a: [f64; 2], b: [f64; 2]| if share(b) > share(a) { b } else { a };
        let [error, storage] = errors.into_iter().reduce(closest).expect("at least one error");
        let limits = format!("{limit:.0e} + {storage:.1e}{unit}");
        Self::new(law, format!("{error:.1e}{unit}"), limits, error <= limit + storage)
    }

    /// Numbers that must all lie within `limits`.
    pub(crate) fn within(law: &'static str, found: &[f64], [low, high]: [f64; 2]) -> Self {
        let least = found.iter().copied().fold(f64::INFINITY, f64::min);
        let most = found.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let holds = found.iter().all(|x| (low..=high).contains(x));
        let measured = if found.len() == 1 { format!("{least:.2}") } else { format!("{least:.2}…{most:.2}") };
        Self::new(law, measured, format!("{low}…{high}"), holds)
    }

    /// Something that must not happen: `count` is the number of times it did, out of `of` cases.
    pub(crate) fn never(law: &'static str, count: usize, of: usize) -> Self {
        Self::new(law, format!("{count} of {of}"), "0".into(), count == 0 && of > 0)
    }

    /// Marks a law that is known not to hold; the check fails if it does.
    pub(crate) fn missed(self) -> Self {
        Self { missed: true, ..self }
    }

    /// Marks a law that has a coarse form, whose figure is not compared with docs/.
    pub(crate) fn has_coarse_form(self, effort: Effort) -> Self {
        Self { coarse: effort == Effort::Coarse, ..self }
    }

    fn row(&self) -> String {
        let missed = if self.missed { ", missed" } else { "" };
        format!("| {} | {} | {}{missed} |", self.law, self.measured, self.limit)
    }

    /// Whether docs show this row; for a coarse form the figure may differ.
    fn is_shown_as(&self, shown: &str) -> bool {
        let ends = |row: &str| -> Option<(String, String)> {
            let mut cells = row.split(" | ");
            Some((cells.next()?.to_owned(), cells.nth(1)?.split(" + ").next()?.trim_end_matches(" |").to_owned()))
        };
        if self.coarse { ends(&self.row()) == ends(shown) } else { self.row() == shown }
    }
}

/// The table of a page of docs/.
pub(crate) const HEAD: &str = "| law | measured | limit |\n|---|---|---|\n";

/// The whole table, as docs/ show it.
pub(crate) fn table(figures: &[Figure]) -> String {
    figures.iter().fold(HEAD.to_owned(), |table, figure| table + &figure.row() + "\n")
}

/// The range of bytes that the table takes up in the text of a page.
pub(crate) fn table_range(docs: &str) -> std::ops::Range<usize> {
    let start = docs.find(HEAD).expect("the page has a table of laws");
    let rest = &docs[start..];
    start..start + rest.find("\n\n").map_or(rest.len(), |end| end + 1)
}

/// Prints the table and returns the rows of laws that do not hold, or that hold although they are marked as missed.
pub(crate) fn broken(figures: &[Figure]) -> Vec<String> {
    print!("{}", table(figures));
    figures.iter().filter(|figure| figure.holds == figure.missed).map(Figure::row).collect()
}

/// Prints the table and checks it: every law against its limit, and every row against `docs`, the text of `page`.
pub(crate) fn check(figures: &[Figure], page: &str, docs: &str) {
    let broken = broken(figures);
    assert!(
        broken.is_empty(),
        "these laws do not hold, or are marked as missed although they do:\n{}",
        broken.join("\n")
    );
    let shown: Vec<&str> = docs[table_range(docs)].lines().skip(2).collect();
    let same = figures.len() == shown.len() && figures.iter().zip(&shown).all(|(figure, row)| figure.is_shown_as(row));
    assert!(same, "the table in {page} differs from this one; `cargo xtask bless laws` writes it:\n{}", table(figures));
}

/// Four units in the last place of the largest coordinate: an upper bound on the rounding of positions to f32.
pub(crate) fn storage(points: &[[f32; 3]]) -> f64 {
    let largest = points.as_flattened().iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    4.0 * (f64::from(largest.next_up()) - f64::from(largest))
}
