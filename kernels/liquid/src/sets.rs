//! Which of many things are connected.

/// Disjoint sets; the first of a set is its smallest member, whatever the order of joins.
pub(crate) struct Sets(Vec<u32>);

impl Sets {
    /// `n` members, each in a set of its own.
    pub(crate) fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    /// The first member of the set of `n`.
    pub(crate) fn first(&mut self, mut n: u32) -> u32 {
        while self.0[n as usize] != n {
            let parent = self.0[n as usize];
            self.0[n as usize] = self.0[parent as usize];
            n = parent;
        }
        n
    }

    /// Makes the sets of `a` and `b` one.
    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.first(a), self.first(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
