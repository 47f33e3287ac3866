//! The wind chain: how accurately it meets its laws, extreme scenes, and the figures of docs/wind.md for the bear. All
//! checked figures are printed: `cargo test --test wind -- --nocapture`.

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

mod accuracy;
#[path = "../accuracy_table/mod.rs"]
mod accuracy_table;
mod coherence;
#[path = "../cooked/mod.rs"]
mod cooked;
mod pictures;
mod shelter;
mod storm;
