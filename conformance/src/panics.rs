//! Keeps panics that a test expects off the terminal.
//!
//! Panics outside [`quietly`] are printed as usual. Limit: while any thread is inside, panics of cooking threads are
//! not printed, whichever test they cook for.

use std::cell::Cell;
use std::sync::Once;
use std::sync::atomic::{AtomicUsize, Ordering};

thread_local! { static HERE: Cell<bool> = const { Cell::new(false) }; }

/// Number of threads inside [`quietly`].
static INSIDE: AtomicUsize = AtomicUsize::new(0);

/// Runs `work`; panics in it, and in the threads that cook for it, are not printed.
///
/// The panic hook is set once and stays: it belongs to the whole process, and tests that run in parallel would remove
/// each other's.
pub fn quietly<T>(work: impl FnOnce() -> T) -> T {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let shown = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            let cooks = std::thread::current().name().is_some_and(|name| name.starts_with("convect "));
            let hidden = HERE.get() || cooks && INSIDE.load(Ordering::Relaxed) > 0;
            if !hidden {
                shown(panic);
            }
        }));
    });
    let _inside = Inside::enter();
    work()
}

/// Marks a thread as inside; dropped on exit, also when `work` panics.
struct Inside(bool);

impl Inside {
    fn enter() -> Self {
        INSIDE.fetch_add(1, Ordering::Relaxed);
        Self(HERE.replace(true))
    }
}

impl Drop for Inside {
    fn drop(&mut self) {
        INSIDE.fetch_sub(1, Ordering::Relaxed);
        HERE.set(self.0);
    }
}
