//! Identifiers for names that USD would refuse.
//!
//! One bad name in a path makes a whole file unreadable, so every name is made an ASCII identifier; letters beyond ASCII
//! are legal since USD 24.03, but not in the programs built on earlier ones. Deterministic: the result depends on the
//! names alone. The limit: a name cannot be read back from its identifier, so the file keeps it as `displayName`.

use std::collections::BTreeSet;

/// `name` with everything but ASCII letters, digits and `_` replaced by `_`, and a `_` before a leading digit.
///
/// `:` goes too: USD would read namespaces into it, and `x:indices` as the indices of `x`.
pub(super) fn identifier(name: &str) -> String {
    let body = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' });
    match name.chars().next() {
        Some(first) if !first.is_ascii_digit() => body.collect(),
        _ => std::iter::once('_').chain(body).collect(),
    }
}

/// One identifier for each of `names`, all different: a name that is an identifier is kept (of equal ones the first); the
/// rest follow in order, with `_2`, `_3` … where theirs is taken.
pub(super) fn distinct(names: &[&str]) -> Vec<String> {
    let mut given: Vec<Option<String>> = vec![None; names.len()];
    let mut taken = BTreeSet::new();
    for (name, given) in names.iter().zip(&mut given) {
        let same = identifier(name);
        if same == *name && taken.insert(same.clone()) {
            *given = Some(same);
        }
    }
    let mut free = |name: &str| {
        let stem = identifier(name);
        let numbered = (2_u64..).map(|n| format!("{stem}_{n}"));
        std::iter::once(stem.clone()).chain(numbered).find(|name| taken.insert(name.clone())).unwrap_or(stem)
    };
    names.iter().zip(given).map(|(name, given)| given.unwrap_or_else(|| free(name))).collect()
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
    fn clashing_names_are_numbered_and_the_exact_one_is_kept() {
        assert_eq!(distinct(&["a-b", "a_b", "a.b"]), ["a_b_2", "a_b", "a_b_3"]);
        assert_eq!(distinct(&["mask", "mask", "mask_2"]), ["mask", "mask_3", "mask_2"]);
        assert_eq!(distinct(&["-", ".", "_"]), ["__2", "__3", "_"]);
        assert_eq!(distinct(&[]), [""; 0]);
    }
}
