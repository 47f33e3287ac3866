//! Soft bodies: how accurately they meet their laws, extreme scenes, and the figures of docs/softbody.md for dough and
//! the egg of paper R. All checked figures are printed: `cargo test --test softbody -- --nocapture`.

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

mod accuracy;
#[path = "../accuracy_table/mod.rs"]
mod accuracy_table;
#[path = "../cooked/mod.rs"]
mod cooked;
mod egg;
mod extremes;
mod measure;
mod pound;
mod rolling;
mod scene;
mod shapes;
