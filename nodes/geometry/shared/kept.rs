//! Keys of values that nodes cache with a component; see [`Component::kept`].

use engine::prelude::*;

/// The roots of curves; equal if their bits are.
#[derive(Clone, Debug)]
pub(crate) struct Roots(pub(crate) Vec<[f32; 3]>);

/// A column; equal if it is the same array. It keeps the array alive, so that its address is not reused.
#[derive(Clone, Debug)]
pub(crate) struct Array(Option<Column>);

impl Roots {
    /// The first CV of each curve.
    pub(crate) fn of(curves: &Component) -> Self {
        Self(curves.runs().ranges().map(|cvs| curves.positions()[cvs.start]).collect())
    }
}

impl PartialEq for Roots {
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&f32, &f32)| a.to_bits() == b.to_bits();
        self.0.len() == other.0.len() && self.0.as_flattened().iter().zip(other.0.as_flattened()).all(same)
    }
}

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
    fn roots_are_the_same_where_their_bits_are() {
        let roots = |x: f32| Roots(vec![[x; 3]]);
        assert!(roots(f32::NAN) == roots(f32::NAN) && roots(1.0) == roots(1.0));
        assert!(roots(0.0) != roots(-0.0) && roots(1.0) != Roots(Vec::new()));
    }

    #[test]
    fn arrays_are_the_same_where_they_are_one() {
        let part = Component::points(vec![[0.0; 3]]);
        let of = |part: &Component, name: &str| Array::of(part, name);
        assert!(of(&part, "P") == of(&part.clone(), "P") && of(&part, "x") == of(&part, "x"));
        assert!(of(&part, "P") != of(&Component::points(vec![[0.0; 3]]), "P") && of(&part, "P") != of(&part, "x"));
    }
}
