//! Differences of two results, and their statistics.

use super::norms::Statistic;

/// Statistics of differences.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Errors {
    pub(super) mean: f64,
    pub(super) p99: f64,
    pub(super) max: f64,
}

/// Differences of two results with their weights.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Differences {
    rows: Vec<(f64, f64)>,
    /// How many points or elements only one of two results has, which are not compared; and how many there are in both.
    pub(super) unmatched: [usize; 2],
}

impl Extend<f64> for Differences {
    /// Adds differences that count the same.
    fn extend<I: IntoIterator<Item = f64>>(&mut self, numbers: I) {
        self.rows.extend(numbers.into_iter().map(|number| (number, 1.0)));
    }
}

impl Differences {
    /// Adds those of both ways between two shapes, each with the length or area that its point stands for. Both ways together
    /// weigh 1, each half of that: how finely a shape is cut must not change how much a part of it counts.
    pub(super) fn extend_both_ways(&mut self, ways: [Vec<(f64, f64)>; 2]) {
        for way in ways {
            let size: f64 = way.iter().map(|(_, size)| size).sum();
            let count = way.len() as f64;
            let weight = |own: f64| if size > 0.0 { 0.5 * own / size } else { 0.5 / count };
            self.rows.extend(way.into_iter().map(|(number, own)| (number, weight(own))));
        }
    }

    /// Counts the rows of two results of which these many were paired.
    pub(super) fn count(&mut self, rows: usize, pairs: usize) {
        self.unmatched[0] += rows - 2 * pairs;
        self.unmatched[1] += rows;
    }

    /// The differences alone.
    #[cfg(test)]
    pub(super) fn numbers(&self) -> Vec<f64> {
        self.rows.iter().map(|(number, _)| *number).collect()
    }
}

impl Errors {
    /// The statistics of differences; `None` if there are none, or one is not finite.
    pub(super) fn of(Differences { mut rows, .. }: Differences) -> Option<Self> {
        if rows.is_empty() || !rows.iter().all(|(x, _)| x.is_finite()) {
            return None;
        }
        let total: f64 = rows.iter().map(|(_, weight)| weight).sum();
        let mean = rows.iter().map(|(x, weight)| x * weight).sum::<f64>() / total;
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        // The smallest number that 99 of 100 do not exceed, up to the rounding of the sum.
        let most = 0.99 * total * (1.0 - 1e-12);
        let mut sum = 0.0;
        let rank = rows.iter().position(|(_, weight)| {
            sum += weight;
            sum >= most
        });
        let max = rows[rows.len() - 1].0;
        Some(Self { mean, p99: rank.map_or(max, |rank| rows[rank].0), max })
    }

    pub(super) fn get(&self, statistic: Statistic) -> f64 {
        match statistic {
            Statistic::Mean => self.mean,
            Statistic::P99 => self.p99,
            Statistic::Max => self.max,
        }
    }

    /// As JSON.
    pub(super) fn to_json(self) -> serde_json::Value {
        serde_json::json!({"mean": self.mean, "p99": self.p99, "max": self.max})
    }
}
