//! Values computed from a component and a key, cached with the component for the next frame.
//!
//! Promise: the value is the one that `make` would return; it stays cached as long as neither the component's positions
//! nor the key change. Limit: only the [`KEPT`] most recently used values of each type are kept.

use std::sync::{Arc, Mutex, PoisonError};

use super::Component;
use crate::Result;

/// Several nodes may use one component, each with its own key: for example several grooms on one skin.
const KEPT: usize = 4;

/// Values by key, the most recently used one last.
struct Slots<K, T>(Mutex<Vec<(K, Arc<T>)>>);

impl Component {
    /// The cached value for `key`, else the result of `make`, which may depend on this component's topology, its
    /// positions and `key` only. No lock is held while `make` runs: a thread that waits for work of its own pool could
    /// deadlock.
    ///
    /// # Errors
    /// Errors of `make`.
    pub fn kept<K, T>(&self, key: K, make: impl FnOnce() -> Result<T>) -> Result<Arc<T>>
    where
        K: PartialEq + Send + Sync + 'static,
        T: Send + Sync + 'static,
    {
        let slots = self.derived(|_| Slots::<K, T>(Mutex::new(Vec::new())));
        let cached = || slots.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = cached().iter().find(|(cached_key, _)| *cached_key == key).map(|(_, value)| value.clone());
        let value = match found {
            Some(value) => value,
            None => Arc::new(make()?),
        };
        let mut cached = cached();
        // If another thread has made it meanwhile, all use that one.
        let now = cached.iter().position(|(cached_key, _)| *cached_key == key);
        let value = now.map_or(value, |at| cached.remove(at).1);
        if cached.len() == KEPT {
            cached.remove(0);
        }
        cached.push((key, value.clone()));
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;
    use crate::geometry::P;

    #[test]
    fn a_value_is_computed_again_only_after_a_change() {
        let mut part = Component::points(vec![[0.0; 3]]);
        let cached = |part: &Component, key: f32, value: u32| *part.kept(key.to_bits(), || Ok(value)).unwrap();
        assert_eq!(cached(&part, 1.0, 1), 1);
        assert_eq!(cached(&part.clone(), 1.0, 2), 1);
        assert_eq!(cached(&part, -1.0, 3), 3);
        assert_eq!(cached(&part, f32::NAN, 4), 4);
        part.edit(P).unwrap()[0][0] = 2.0;
        assert_eq!(cached(&part, 1.0, 6), 6);
    }

    #[test]
    fn the_least_recently_used_value_is_dropped() {
        let part = Component::points(vec![[0.0; 3]]);
        let cached = |key: usize, value: usize| *part.kept(key, || Ok(value)).unwrap();
        (0..KEPT).for_each(|key| assert_eq!(cached(key, key), key));
        assert_eq!(cached(0, 99), 0, "used again");
        assert_eq!(cached(KEPT, KEPT), KEPT);
        assert_eq!((cached(0, 99), cached(1, 99)), (0, 99));
    }

    #[test]
    fn a_value_made_meanwhile_is_shared() {
        let part = Component::points(vec![[0.0; 3]]);
        let slower = || {
            assert_eq!(*part.kept(7_u8, || Ok(1)).unwrap(), 1);
            Ok(2)
        };
        assert_eq!(*part.kept(7_u8, slower).unwrap(), 1);
        assert_eq!(*part.kept(7_u8, || Ok(3)).unwrap(), 1);
    }

    #[test]
    fn a_failure_is_not_kept() {
        let part = Component::points(vec![[0.0; 3]]);
        assert!(part.kept(7_u8, || Err::<(), _>(Error::refused("no"))).is_err());
        assert!(part.kept(7_u8, || Ok(())).is_ok());
    }
}
