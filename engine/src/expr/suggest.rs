//! Suggestions: the known name most similar to an unknown one.
//!
//! Promise: the same result for the same candidates in the same order; the first of equals wins. Limit: names longer
//! than 64 characters and candidates after the first 1000 are not compared, so that the cost is bounded.

use std::cmp::Reverse;

use strsim::osa_distance;

/// Names with more characters are not compared.
const LONGEST: usize = 64;
/// The number of candidates that are compared.
pub(crate) const MOST_CANDIDATES: usize = 1000;

/// The candidate with the fewest edits from `name`, if there are at most a third as many edits as characters, or one.
/// Of equals it is the one with the longest common prefix. Case is ignored; swapping two neighbours is one edit.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = folded(name)?;
    let allowed = (wanted.length / 3).max(1);
    candidates
        .into_iter()
        .take(MOST_CANDIDATES)
        .filter_map(|candidate| {
            let candidate_folded = folded(candidate)?;
            // Every letter is one edit from every other letter, which is not a similarity.
            let alike = wanted.length > 1 || wanted == candidate_folded;
            if !alike || wanted.length.abs_diff(candidate_folded.length) > allowed {
                return None;
            }
            let edits = osa_distance(&wanted.text, &candidate_folded.text);
            let start = wanted.text.chars().zip(candidate_folded.text.chars()).take_while(|(a, b)| a == b).count();
            (edits <= allowed).then_some((edits, Reverse(start), candidate))
        })
        .min_by_key(|(edits, start, _)| (*edits, *start))
        .map(|(_, _, candidate)| candidate)
}

/// `` `a`, `b` ``: the names, if there are few enough to list.
pub(super) fn listed(names: &[&str]) -> Option<String> {
    const LISTED: usize = 24;
    let names: Vec<String> = names.iter().map(|name| shortened(name)).collect();
    (1..=LISTED).contains(&names.len()).then(|| format!("`{}`", names.join("`, `")))
}

/// A name in lower case, and its length in characters.
#[derive(PartialEq)]
struct Folded {
    text: String,
    length: usize,
}

fn folded(name: &str) -> Option<Folded> {
    let text: String = name.chars().take(LONGEST + 1).flat_map(char::to_lowercase).collect();
    let length = text.chars().count();
    (1..=LONGEST).contains(&length).then_some(Folded { text, length })
}

/// At most the first 24 characters, so that a message stays readable.
pub(super) fn shortened(text: &str) -> String {
    const SHOWN: usize = 24;
    let mut shown: String = text.chars().take(SHOWN).collect();
    if shown.len() < text.len() {
        shown.push('…');
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_name_is_found() {
        let known = ["time", "frame", "smoothstep", "envelope"];
        assert_eq!(nearest("tme", known), Some("time"));
        assert_eq!(nearest("TIME", known), Some("time"));
        assert_eq!(nearest("mitme", known), None);
        assert_eq!(nearest("tiem", known), Some("time"));
        assert_eq!(nearest("Curve_Win", ["Curve_In", "Curve_Wind"]), Some("Curve_Wind"));
        assert_eq!(nearest("smothstp", known), Some("smoothstep"));
        assert_eq!(nearest("kitten", ["sitting"]), None, "three edits");
        assert_eq!(nearest("ÉCLAT", ["éclta"]), Some("éclta"), "a swap is one edit, a change of case none");
    }

    #[test]
    fn an_unlike_name_finds_nothing() {
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
}
