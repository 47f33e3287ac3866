//! Did you mean …? The known name nearest to one that is not known.
//!
//! Promise: the same answer for the same candidates in the same order; the first of equals wins.
//! Limit: names longer than 64 characters, and candidates after the first 1000, are not compared, so
//! the cost stays bounded however many a file has.

use std::cmp::Reverse;

use super::lexer::shortened;

/// Longest name that is compared, in characters.
const LONGEST: usize = 64;
/// Most candidates that are compared.
const MOST: usize = 1000;

/// The candidate with the fewest edits from `name`, if they are no more than a third of its
/// characters, or one; of equals the one that begins alike for longest. Case costs nothing, swapped
/// neighbours are one edit.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = folded(name)?;
    let allowed = (wanted.len() / 3).max(1);
    candidates
        .into_iter()
        .take(MOST)
        .filter_map(|candidate| {
            let known = folded(candidate)?;
            // One letter is within one edit of every other letter; that is no likeness.
            let alike = wanted.len() > 1 || wanted == known;
            if !alike || wanted.len().abs_diff(known.len()) > allowed {
                return None;
            }
            let edits = distance(&wanted, &known);
            let start = wanted.iter().zip(&known).take_while(|(a, b)| a == b).count();
            (edits <= allowed).then_some((edits, Reverse(start), candidate))
        })
        .min_by_key(|(edits, start, _)| (*edits, *start))
        .map(|(_, _, candidate)| candidate)
}

/// `` `a`, `b` ``: the names, where they are few enough to read.
pub(super) fn listed(names: &[&str]) -> Option<String> {
    const LISTED: usize = 24;
    let names: Vec<String> = names.iter().map(|name| shortened(name)).collect();
    (1..=LISTED).contains(&names.len()).then(|| format!("`{}`", names.join("`, `")))
}

fn folded(name: &str) -> Option<Vec<char>> {
    let characters: Vec<char> = name.chars().take(LONGEST + 1).flat_map(char::to_lowercase).collect();
    (1..=LONGEST).contains(&characters.len()).then_some(characters)
}

/// Optimal string alignment: insertions, deletions, replacements and swaps of neighbours.
fn distance(a: &[char], b: &[char]) -> usize {
    let mut before = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    let mut row = before.clone();
    for i in 1..=a.len() {
        row[0] = i;
        for j in 1..=b.len() {
            let replaced = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = replaced.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        std::mem::swap(&mut before, &mut last);
        std::mem::swap(&mut last, &mut row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_finds_its_name() {
        let known = ["time", "frame", "smoothstep", "envelope"];
        assert_eq!(nearest("tme", known), Some("time"));
        assert_eq!(nearest("TIME", known), Some("time"));
        assert_eq!(nearest("mitme", known), None);
        assert_eq!(nearest("tiem", known), Some("time"));
        assert_eq!(nearest("Curve_Win", ["Curve_In", "Curve_Wind"]), Some("Curve_Wind"));
        assert_eq!(nearest("smothstp", known), Some("smoothstep"));
    }

    #[test]
    fn what_is_like_nothing_finds_nothing() {
        assert_eq!(nearest("zebra", ["time", "frame"]), None);
        assert_eq!(nearest("q", ["P", "N"]), None);
        assert_eq!(nearest("p", ["P", "N"]), Some("P"));
        assert_eq!(nearest("", ["P"]), None);
        assert_eq!(nearest(&"x".repeat(100_000), ["P"]), None);
    }

    #[test]
    fn only_the_first_thousand_names_are_compared() {
        let far = std::iter::repeat_n("zebra", 999);
        assert_eq!(nearest("tiem", far.clone().chain(["time"])), Some("time"));
        assert_eq!(nearest("tiem", far.chain(["zebra", "time"])), None);
    }

    #[test]
    fn distances_worked_by_hand() {
        let edits = |a: &str, b: &str| distance(&a.chars().collect::<Vec<_>>(), &b.chars().collect::<Vec<_>>());
        assert_eq!(edits("kitten", "sitting"), 3);
        assert_eq!(edits("ab", "ba"), 1);
        assert_eq!(edits("", "abc"), 3);
        assert_eq!(edits("same", "same"), 0);
    }
}
