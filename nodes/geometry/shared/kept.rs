//! What is computed from a component and something else, kept with the component for the next frame.
//!
//! Promise: the value is what `make` would give again; it is found as long as neither the component's positions nor the
//! key change. Limit: of each type, the last [`KEPT`] alone are kept.

use engine::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// Several nodes may ask the same of one component, each with its own key: coats of one skin.
const KEPT: usize = 4;

/// Where curves are rooted, equal where the bits are.
#[derive(Clone, Debug)]
pub(crate) struct Roots(pub(crate) Vec<[f32; 3]>);

/// A column, equal where it is the very same array, which it keeps alive: no other can come to lie at its address.
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
    /// The attribute a point of that name, where there is one.
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

/// Values by key, the last one asked for at the end.
struct Slots<K, T>(Mutex<Vec<(K, Arc<T>)>>);

/// What `make` gives, or gave when the same was asked of `part` before. Nothing is locked while it is made: a thread
/// that waits for its own pool's work would else wait for itself.
///
/// # Errors
/// Those of `make`.
pub(crate) fn kept<K, T>(part: &Component, key: K, make: impl FnOnce() -> Result<T>) -> Result<Arc<T>>
where
    K: PartialEq + Send + Sync + 'static,
    T: Send + Sync + 'static,
{
    let slots = part.derived(|_| Slots::<K, T>(Mutex::new(Vec::new())));
    let known = || slots.0.lock().unwrap_or_else(PoisonError::into_inner);
    let found = known().iter().find(|(asked, _)| *asked == key).map(|(_, value)| value.clone());
    let value = match found {
        Some(value) => value,
        None => Arc::new(make()?),
    };
    let mut known = known();
    known.retain(|(asked, _)| *asked != key);
    if known.len() == KEPT {
        known.remove(0);
    }
    known.push((key, value.clone()));
    Ok(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_made_again_only_where_something_changed() {
        let mut part = Component::points(vec![[0.0; 3]]);
        let made = |part: &Component, key: f32, value: u32| *kept(part, Roots(vec![[key; 3]]), || Ok(value)).unwrap();
        assert_eq!(made(&part, 1.0, 1), 1);
        assert_eq!(made(&part.clone(), 1.0, 2), 1);
        assert_eq!(made(&part, -1.0, 3), 3);
        assert_eq!(made(&part, f32::NAN, 4), 4);
        assert_eq!(made(&part, f32::NAN, 5), 4, "the bits count");
        part.edit(P).unwrap()[0][0] = 2.0;
        assert_eq!(made(&part, 1.0, 6), 6);
    }

    #[test]
    fn a_few_are_kept_and_the_one_not_asked_for_longest_goes() {
        let part = Component::points(vec![[0.0; 3]]);
        let made = |key: usize, value: usize| *kept(&part, key, || Ok(value)).unwrap();
        (0..KEPT).for_each(|key| assert_eq!(made(key, key), key));
        assert_eq!(made(0, 99), 0, "asked for again");
        assert_eq!(made(KEPT, KEPT), KEPT);
        assert_eq!((made(0, 99), made(1, 99)), (0, 99));
    }

    #[test]
    fn arrays_are_the_same_where_they_are_one() {
        let part = Component::points(vec![[0.0; 3]]);
        let of = |part: &Component, name: &str| Array::of(part, name);
        assert!(of(&part, "P") == of(&part.clone(), "P") && of(&part, "x") == of(&part, "x"));
        assert!(of(&part, "P") != of(&Component::points(vec![[0.0; 3]]), "P") && of(&part, "P") != of(&part, "x"));
    }

    #[test]
    fn a_failure_is_not_kept() {
        let part = Component::points(vec![[0.0; 3]]);
        assert!(kept(&part, 7_u8, || Err::<(), _>(Error::refused("no"))).is_err());
        assert!(kept(&part, 7_u8, || Ok(())).is_ok());
    }
}
