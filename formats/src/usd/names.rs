//! Identifiers for names that are not valid in USD.
//!
//! One invalid name in a path makes the whole file unreadable, so every name is converted to an ASCII identifier. Other
//! letters are valid since USD 24.03, but not in programs that use earlier versions. The result depends only on the
//! names. Limit: a name cannot be recovered from its identifier, so the file stores it as `displayName`.

use std::collections::BTreeSet;

/// `name` with everything but ASCII letters, digits and `_` replaced by `_`, and a `_` before a leading digit.
///
/// `:` is replaced too: in USD it separates namespaces, and `x:indices` would be the indices of `x`.
pub(super) fn identifier(name: &str) -> String {
    let body = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' });
    match name.chars().next() {
        Some(first) if !first.is_ascii_digit() => body.collect(),
        _ => std::iter::once('_').chain(body).collect(),
    }
}

/// A unique identifier for each of `names`: a name that is an identifier is kept (of equal ones the first); the others
/// are numbered in order with `_2`, `_3` … if theirs is taken.
pub(super) fn distinct(names: &[&str]) -> Vec<String> {
    let mut identifiers: Vec<Option<String>> = vec![None; names.len()];
    let mut taken = BTreeSet::new();
    for (name, slot) in names.iter().zip(&mut identifiers) {
        let same = identifier(name);
        if same == *name && taken.insert(same.clone()) {
            *slot = Some(same);
        }
    }
    let mut free = |name: &str| {
        let stem = identifier(name);
        let numbered = (2_u64..).map(|n| format!("{stem}_{n}"));
        std::iter::once(stem.clone()).chain(numbered).find(|name| taken.insert(name.clone())).unwrap_or(stem)
    };
    names.iter().zip(identifiers).map(|(name, kept)| kept.unwrap_or_else(|| free(name))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_becomes_an_identifier() {
        for (name, expected) in [
            ("fur", "fur"),
            ("fur-2", "fur_2"),
            ("_x", "_x"),
            ("2nd", "_2nd"),
            ("", "_"),
            ("a:b", "a_b"),
            ("größe", "gr__e"),
            ("a\"b\n", "a_b_"),
            ("-", "_"),
        ] {
            assert_eq!(identifier(name), expected, "{name:?}");
        }
    }

    #[test]
    fn conflicting_names_are_numbered_and_an_exact_one_is_kept() {
        assert_eq!(distinct(&["a-b", "a_b", "a.b"]), ["a_b_2", "a_b", "a_b_3"]);
        assert_eq!(distinct(&["mask", "mask", "mask_2"]), ["mask", "mask_3", "mask_2"]);
        assert_eq!(distinct(&["-", ".", "_"]), ["__2", "__3", "_"]);
        assert_eq!(distinct(&[]), [""; 0]);
    }
}
