//! Values computed from a component and a key, cached with the component for the next frame.
//!
//! Promise: the value is what `make` would return again; it is found as long as neither the component's positions nor
//! the key change. Limit: only the [`KEPT`] values of each type that were used last are kept.

use std::sync::{Arc, Mutex, PoisonError};

use super::Component;
use crate::Result;

/// Several nodes may use one component, each with its own key: several coats on one skin.
const KEPT: usize = 4;

/// Values by key, the most recently used one last.
struct Slots<K, T>(Mutex<Vec<(K, Arc<T>)>>);

impl Component {
    /// The cached value for `key`, else the result of `make`, which may depend on this component's topology, its positions
    /// and `key` only. Nothing is locked while `make` runs: a thread waiting for work of its own pool could deadlock.
    ///
    /// # Errors
    /// Errors of `make`.
    pub fn kept<K, T>(&self, key: K, make: impl FnOnce() -> Result<T>) -> Result<Arc<T>>
    where
        K: PartialEq + Send + Sync + 'static,
        T: Send + Sync + 'static,
    {
        let slots = self.derived(|_| Slots::<K, T>(Mutex::new(Vec::new())));
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;
    use crate::geometry::P;

    #[test]
    fn it_is_made_again_only_when_something_changed() {
        let mut part = Component::points(vec![[0.0; 3]]);
        let made = |part: &Component, key: f32, value: u32| *part.kept(key.to_bits(), || Ok(value)).unwrap();
        assert_eq!(made(&part, 1.0, 1), 1);
        assert_eq!(made(&part.clone(), 1.0, 2), 1);
        assert_eq!(made(&part, -1.0, 3), 3);
        assert_eq!(made(&part, f32::NAN, 4), 4);
        part.edit(P).unwrap()[0][0] = 2.0;
        assert_eq!(made(&part, 1.0, 6), 6);
    }

    #[test]
    fn the_least_recently_used_value_is_dropped() {
        let part = Component::points(vec![[0.0; 3]]);
        let made = |key: usize, value: usize| *part.kept(key, || Ok(value)).unwrap();
        (0..KEPT).for_each(|key| assert_eq!(made(key, key), key));
        assert_eq!(made(0, 99), 0, "asked for again");
        assert_eq!(made(KEPT, KEPT), KEPT);
        assert_eq!((made(0, 99), made(1, 99)), (0, 99));
    }

    #[test]
    fn a_failure_is_not_kept() {
        let part = Component::points(vec![[0.0; 3]]);
        assert!(part.kept(7_u8, || Err::<(), _>(Error::refused("no"))).is_err());
        assert!(part.kept(7_u8, || Ok(())).is_ok());
    }
}
