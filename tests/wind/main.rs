//! The wind chain: how well it meets its laws, what it does at extremes, and figures of its nodes' help on the bear from
//! frame to frame; all are printed as they are checked (`cargo test --test wind -- --nocapture`).

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

mod accuracy;
mod coherence;
#[path = "../cooked/mod.rs"]
mod cooked;
mod extremes;
#[path = "../laws/mod.rs"]
mod laws;
mod pictures;
mod shelter;
mod storm;
