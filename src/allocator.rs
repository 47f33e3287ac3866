//! The allocator: how long it keeps what is freed.

use std::ffi::{c_int, c_long};

/// `mi_option_purge_delay` of mimalloc 2, which its bindings do not name.
const PURGE_DELAY: c_int = 15;

/// Milliseconds after which freed pages go back to the system. A frame frees what the next one asks for: with the 10 ms that
/// are usual, pages of grooms of a million curves went back and were cleared again in each frame, which took a fifth of its time.
const KEPT: c_long = 1000;

/// Keeps freed pages from frame to frame; `MIMALLOC_PURGE_DELAY` in the environment counts instead where it is set.
#[expect(unsafe_code, reason = "a call of C, which takes any option and value")]
pub fn keep_freed_pages() {
    // SAFETY: the option exists in version 2, which is linked; it may be set at any time.
    unsafe { libmimalloc_sys::mi_option_set_default(PURGE_DELAY, KEPT) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(unsafe_code, reason = "a call of C")]
    fn the_option_is_that_of_the_delay() {
        // SAFETY: as above.
        let delay = || unsafe { libmimalloc_sys::mi_option_get(PURGE_DELAY) };
        let before = delay();
        keep_freed_pages();
        let own = std::env::var("MIMALLOC_PURGE_DELAY").is_ok();
        assert!(own || (before, delay()) == (10, KEPT), "{before}, {}", delay());
    }
}
