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
    used: u64,
}

/// An array of kept results.
#[derive(Default)]
struct Array {
    bytes: usize,
    /// How often results have it.
    holders: usize,
}

/// Results by key; the least recently used go first. Arrays that several of them share count once.
#[derive(Default)]
pub(crate) struct Store {
    entries: BTreeMap<ContentKey, Entry>,
    /// Their arrays, by address, which entries keep alive.
    arrays: BTreeMap<usize, Array>,
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
        for (address, bytes) in cooked.iter().flat_map(|geometry| geometry.arrays()) {
            let array = self.arrays.entry(address).or_default();
            if array.holders == 0 {
                array.bytes = bytes;
                self.bytes += bytes;
            }
            array.holders += 1;
        }
        let entry = Entry { cooked: cooked.clone(), metrics, used: self.clock };
        if let Some(old) = self.entries.insert(key, entry) {
            self.release(&old);
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
            self.release(&entry);
        }
    }

    /// Counts the arrays of an entry that is no longer kept.
    fn release(&mut self, entry: &Entry) {
        for (address, _) in entry.cooked.iter().flat_map(|geometry| geometry.arrays()) {
            let Some(array) = self.arrays.get_mut(&address) else { continue };
            array.holders -= 1;
            if array.holders == 0 {
                self.bytes -= array.bytes;
                self.arrays.remove(&address);
            }
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
    fn an_array_that_results_share_counts_once() {
        let mut store = Store::new(1000);
        let [a, b, c] = [1, 2, 3].map(|k| ContentKey([k; 16]));
        let shared = points(50);
        store.keep(a, &shared, Vec::new());
        store.keep(b, &Arc::from([shared[0].clone(), points(5)[0].clone()]), Vec::new());
        assert_eq!(store.bytes(), 660);
        store.keep(a, &points(10), Vec::new());
        assert_eq!(store.bytes(), 780);
        store.keep(c, &shared, Vec::new());
        store.drop(b);
        assert_eq!(store.bytes(), 720);
        store.make_room(0);
        assert!(store.bytes() == 0 && store.arrays.is_empty());
    }

    #[test]
    fn what_is_larger_than_the_budget_is_not_kept() {
        let mut store = Store::new(100);
        store.keep(ContentKey::default(), &points(1000), Vec::new());
        assert_eq!(store.bytes(), 0);
    }
}
