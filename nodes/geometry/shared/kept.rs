//! What is computed from a component and something else, kept with the component for the next frame.
//!
//! Promise: the value is what `make` would give again; it is found as long as neither the component's positions nor the
//! key change. Limit: the last one for each pair of types alone is kept.

use engine::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// Topology and positions of a component, equal where they are the very same arrays. It keeps these alive, so that no
/// others can come to lie at their addresses.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    topology: Topology,
    positions: Array,
}

/// A column, equal where it is the very same array.
#[derive(Clone, Debug)]
pub(crate) struct Array(pub(crate) Option<Column>);

impl Shape {
    pub(crate) fn of(part: &Component) -> Self {
        Self { topology: part.topology().clone(), positions: Array::of(part, P.name) }
    }
}

impl PartialEq for Shape {
    fn eq(&self, other: &Self) -> bool {
        self.topology.same(&other.topology) && self.positions == other.positions
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

struct Slot<K, T>(Mutex<Option<(K, Arc<T>)>>);

/// What `make` gives, or gave when the same was asked of `part` last. Nothing is locked while it is made: a thread that
/// waits for its own pool's work would else wait for itself.
///
/// # Errors
/// Those of `make`.
pub(crate) fn kept<K, T>(part: &Component, key: K, make: impl FnOnce() -> Result<T>) -> Result<Arc<T>>
where
    K: PartialEq + Send + Sync + 'static,
    T: Send + Sync + 'static,
{
    let slot = part.derived(|_| Slot::<K, T>(Mutex::new(None)));
    let known = || slot.0.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, value)) = known().as_ref().filter(|(last, _)| *last == key) {
        return Ok(value.clone());
    }
    let value = Arc::new(make()?);
    *known() = Some((key, value.clone()));
    Ok(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_made_again_only_where_something_changed() {
        let mut part = Component::points(vec![[0.0; 3]]);
        let other = Component::points(vec![[1.0; 3]]);
        let made = |part: &Component, key: &Component, value: u32| *kept(part, Shape::of(key), || Ok(value)).unwrap();
        assert_eq!(made(&part, &other, 1), 1);
        assert_eq!(made(&part.clone(), &other.clone(), 2), 1);
        // Equal, and another array.
        assert_eq!(made(&part, &Component::points(vec![[1.0; 3]]), 3), 3);
        part.edit(P).unwrap()[0][0] = 2.0;
        assert_eq!(made(&part, &other, 4), 4);
        assert!(kept(&part, 7_u8, || Err::<(), _>(Error::refused("no"))).is_err());
        assert!(kept(&part, 7_u8, || Ok(())).is_ok());
    }
}
