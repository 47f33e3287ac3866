//! The wind chain on the bear, from frame to frame: figures of its nodes' help, printed as they are checked
//! (`cargo test --test wind -- --nocapture`).

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

mod coherence;
mod cooked;
mod pictures;
mod shelter;
mod storm;
