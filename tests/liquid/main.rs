//! Liquids: how accurately they meet their laws, and extreme scenes. All checked figures are printed:
//! `cargo test --test liquid -- --nocapture`.

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

mod accuracy;
#[path = "../accuracy_table/mod.rs"]
mod accuracy_table;
#[path = "../cooked/mod.rs"]
mod cooked;
