//! Which end of a knob's values is the fine one, where its node does not declare that.
//!
//! Decided by what is the same in each run where that shows it: the size of the node's result, and whether errors fall
//! towards the last value. Else by the least CPU time of several cooks, which must differ clearly.

use super::bench::Run;

/// The result at an end has this many times the bytes of the other's, or more, where it is finer.
const CLEARLY_MORE: f64 = 1.5;

/// The last value errs by this share of what the first errs, or less, where values converge to the last. Against a reference
/// one beyond the last, values that double from fine to coarse, or that do not converge, err by about a half.
const CONVERGES: f64 = 0.4;

/// Times that differ less, or that are shorter (milliseconds a frame), say nothing.
const CLEARLY_LONGER: f64 = 1.5;
const NOISE: f64 = 0.2;

/// What is known of a knob's first or last value, the other knobs at their best.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// The size of the node's result.
    pub(super) bytes: usize,
    /// The difference from the reference; `None` where the last value is the reference.
    pub(super) error: Option<f64>,
    /// The least CPU time of the node, in milliseconds a frame.
    pub(super) cpu_ms: f64,
}

impl End {
    /// What a run shows of a node; `None` if it failed.
    pub(super) fn of(run: &Run, node: &str, is_beyond: bool) -> Option<Self> {
        let (cost, errors) = run.result.as_ref().ok()?;
        let node = cost.nodes.iter().find(|found| found.id == *node)?;
        Some(Self { bytes: node.bytes, error: is_beyond.then_some(errors.mean), cpu_ms: node.cpu_ms })
    }
}

/// Whether the first value is the finer one, by what is the same in each run; `None` where that does not show it.
pub(super) fn is_reversed(first: &End, last: &End) -> Option<bool> {
    let is_more = |a: &End, b: &End| a.bytes as f64 >= CLEARLY_MORE * b.bytes as f64 && a.bytes > b.bytes;
    if is_more(first, last) || is_more(last, first) {
        return Some(is_more(first, last));
    }
    let converges = first.error.zip(last.error).is_some_and(|(first, last)| last <= CONVERGES * first && first > 0.0);
    converges.then_some(false)
}

/// Whether the first value takes clearly longer.
pub(super) fn takes_longer(first: &End, last: &End) -> bool {
    first.cpu_ms > NOISE && first.cpu_ms >= CLEARLY_LONGER * last.cpu_ms
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from 0 to 1, the same in each run of the test.
    fn noise(seed: u64) -> f64 {
        let mut x = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d;
        x = (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((x ^ (x >> 29)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// What is decided when each cook takes up to half as long again as it needs, for a hundred draws: the least of three.
    fn decisions(first: End, last: End) -> Vec<bool> {
        let disturbed = |end: End, seed: u64| {
            let longer = (0..3).map(|k| 1.0 + 0.5 * noise(10 * seed + k)).fold(f64::INFINITY, f64::min);
            End { cpu_ms: end.cpu_ms * longer, ..end }
        };
        let decide = |seed: u64| {
            let (first, last) = (disturbed(first, 2 * seed), disturbed(last, 2 * seed + 1));
            is_reversed(&first, &last).unwrap_or_else(|| takes_longer(&first, &last))
        };
        let mut found: Vec<bool> = (0..100).map(decide).collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    #[test]
    fn noisy_times_do_not_change_which_end_is_fine() {
        let end = |bytes, error: f64, cpu_ms| End { bytes, error: Some(error), cpu_ms };
        // Times that alone would say one thing or the other, as the noise is.
        let near = [1.5, 1.0];
        assert_eq!(decisions(end(4000, 1.0, near[0]), end(1000, 0.5, near[1])), [true], "more points");
        assert_eq!(decisions(end(1000, 1.0, near[0]), end(4000, 0.5, near[1])), [false], "fewer points");
        assert_eq!(decisions(end(1000, 1.0, near[0]), end(1000, 0.1, near[1])), [false], "errors fall");
        // What neither shows is decided by times, which differ clearly or not at all.
        assert_eq!(decisions(end(1000, 1.0, 4.0), end(1000, 0.6, 1.0)), [true]);
        assert_eq!(decisions(end(1000, 1.0, 1.0), end(1000, 0.6, 1.0)), [false]);
        assert_eq!(decisions(end(1000, 1.0, 0.1), end(1000, 0.6, 0.01)), [false], "too short to tell");
    }

    #[test]
    fn without_a_reference_beyond_the_last_errors_show_nothing() {
        let end = |cpu_ms| End { bytes: 1000, error: None, cpu_ms };
        assert_eq!(is_reversed(&end(4.0), &end(1.0)), None);
    }
}
