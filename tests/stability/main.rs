//! Stability at extremes: every row of NUMERICS B for every node that it fits, with its outcome on docs/stability.md.
//!
//! Here a coarse form runs, which fails where an outcome is worse than on the page; `cargo bench --bench laws -- stability`
//! runs all of it. `cargo xtask bless stability` writes the page.

#![allow(clippy::unwrap_used, reason = "a test's helpers")]

mod animated;
#[path = "../cooked/mod.rs"]
mod cooked;
mod every_node;
mod liquid;
#[allow(dead_code, reason = "the tables use part of it")]
#[path = "../softbody/measure.rs"]
mod measure;
mod page;
mod random;
#[allow(dead_code, reason = "the tables use part of it")]
#[path = "../softbody/scene.rs"]
mod scene;
#[allow(dead_code, reason = "the tables use part of it")]
#[path = "../softbody/shapes.rs"]
mod shapes;
mod softbody;
mod wind;
