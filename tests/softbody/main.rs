//! Soft bodies: how accurately they meet their laws, extreme scenes, and the figures of docs/softbody.md for dough and
//! the egg of paper R. All checked figures are printed: `cargo test --test softbody -- --nocapture`.

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

mod accuracy;
#[path = "../accuracy_table/mod.rs"]
mod accuracy_table;
mod cage_goal;
#[path = "../cooked/mod.rs"]
mod cooked;
mod egg;
mod measure;
mod pound;
mod rolling;
#[allow(dead_code, reason = "tests/stability uses the rest of it")]
mod scene;
mod shapes;
