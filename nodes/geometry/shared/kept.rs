//! Keys of values that nodes cache with a component; see [`Component::kept`].

use engine::prelude::*;

/// A column; equal if it is the same array. It keeps the array alive, so that its address is not reused.
#[derive(Clone, Debug)]
pub(crate) struct Array(Option<Column>);

impl Array {
    /// The point attribute of that name, if there is one.
    pub(crate) fn of(part: &Component, name: &str) -> Self {
        Self(part.table(Owner::Point).column(name).cloned())
    }
}

impl PartialEq for Array {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Some(a), Some(b)) => a.same(b),
            (a, b) => a.is_none() && b.is_none(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_equal_if_they_share_one_array() {
        let part = Component::points(vec![[0.0; 3]]);
        let of = |part: &Component, name: &str| Array::of(part, name);
        assert!(of(&part, "P") == of(&part.clone(), "P") && of(&part, "x") == of(&part, "x"));
        assert!(of(&part, "P") != of(&Component::points(vec![[0.0; 3]]), "P") && of(&part, "P") != of(&part, "x"));
    }
}
