//! Several trials at a time.
//!
//! Not on rayon's threads: one that waits for an engine takes up the next trial meanwhile, inside the last.

use std::panic::resume_unwind;
use std::sync::{Mutex, PoisonError};
use std::thread;

/// Trials cook on one thread each, mostly.
const THREADS: usize = 2;

/// What `work` makes of each item, in their order.
///
/// # Panics
/// Where `work` does.
pub(crate) fn map<I, T: Send>(
    items: impl IntoIterator<Item = I, IntoIter: Send>,
    work: impl Fn(I) -> T + Sync,
) -> Vec<T> {
    let left = Mutex::new(items.into_iter().enumerate());
    let next = || left.lock().unwrap_or_else(PoisonError::into_inner).next();
    let until_done = || {
        let mut made = Vec::new();
        while let Some((n, item)) = next() {
            made.push((n, work(item)));
        }
        made
    };
    let mut made: Vec<(usize, T)> = thread::scope(|scope| {
        let threads = [(); THREADS].map(|()| scope.spawn(until_done));
        threads.into_iter().flat_map(|thread| thread.join().unwrap_or_else(|panic| resume_unwind(panic))).collect()
    });
    made.sort_by_key(|(n, _)| *n);
    made.into_iter().map(|(_, made)| made).collect()
}
