//! Results that may be asked for again: what stands still, and what was last, up to a bound on memory.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::geometry::Geometry;
use crate::key::ContentKey;

/// The geometries of a node's outputs.
pub(crate) type Cooked = Arc<[Arc<Geometry>]>;

/// What a node published when it made a result.
pub(crate) type Metrics = Vec<(&'static str, f64)>;

struct Entry {
    cooked: Cooked,
    metrics: Metrics,
    bytes: usize,
    used: u64,
}

/// Results by key; the least recently used go first.
#[derive(Default)]
pub(crate) struct Store {
    entries: BTreeMap<ContentKey, Entry>,
    bytes: usize,
    budget: usize,
    clock: u64,
}

impl Store {
    pub(crate) fn new(budget: usize) -> Self {
        Self { budget, ..Self::default() }
    }

    pub(crate) fn get(&mut self, key: ContentKey) -> Option<(Cooked, Metrics)> {
        self.clock += 1;
        let entry = self.entries.get_mut(&key)?;
        entry.used = self.clock;
        Some((entry.cooked.clone(), entry.metrics.clone()))
    }

    pub(crate) fn contains(&self, key: ContentKey) -> bool {
        self.entries.contains_key(&key)
    }

    pub(crate) fn keep(&mut self, key: ContentKey, cooked: &Cooked, metrics: Metrics) {
        self.clock += 1;
        let bytes = cooked.iter().map(|geometry| geometry.bytes()).sum();
        let entry = Entry { cooked: cooked.clone(), metrics, bytes, used: self.clock };
        self.bytes += bytes;
        if let Some(old) = self.entries.insert(key, entry) {
            self.bytes -= old.bytes;
        }
        self.make_room(self.budget);
    }

    /// Drops what was used least recently until no more than `bytes` are left.
    pub(crate) fn make_room(&mut self, bytes: usize) {
        while self.bytes > bytes {
            let Some(oldest) = self.entries.iter().min_by_key(|(_, entry)| entry.used).map(|(key, _)| *key) else {
                return;
            };
            self.drop(oldest);
        }
    }

    pub(crate) fn drop(&mut self, key: ContentKey) {
        if let Some(entry) = self.entries.remove(&key) {
            self.bytes -= entry.bytes;
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Component;

    fn points(n: usize) -> Cooked {
        Arc::from([Arc::new(Geometry::from(Component::points(vec![[0.0; 3]; n])))])
    }

    #[test]
    fn what_was_used_least_recently_goes_first() {
        let mut store = Store::new(2 * 12 * 10);
        let [a, b, c] = [1, 2, 3].map(|k| ContentKey([k; 16]));
        store.keep(a, &points(10), Vec::new());
        store.keep(b, &points(10), Vec::new());
        assert!(store.get(a).is_some());
        store.keep(c, &points(10), Vec::new());
        assert!(store.contains(a) && !store.contains(b) && store.contains(c));
        assert_eq!(store.bytes(), 240);
    }

    #[test]
    fn what_is_larger_than_the_budget_is_not_kept() {
        let mut store = Store::new(100);
        store.keep(ContentKey::default(), &points(1000), Vec::new());
        assert_eq!(store.bytes(), 0);
    }
}
