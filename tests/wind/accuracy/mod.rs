//! How well each law of the wind chain is met, beside how well it has to be: one table, printed, checked, and the one
//! that docs/wind.md shows.
//!
//! Laws are closed forms, worked in f64 by code that shares nothing with the kernels.

mod bend;
mod contact;
mod envelope;
mod noise;
mod swing;
mod symmetry;

use super::laws::{Figure, hold, storage};

#[test]
fn every_law_of_the_chain_holds_within_its_limit_and_is_in_the_docs() {
    let figures = [
        bend::figures(),
        symmetry::figures(),
        noise::figures(),
        envelope::figures(),
        swing::figures(),
        contact::figures(),
    ];
    let figures: Vec<Figure> = figures.into_iter().flatten().collect();
    hold(&figures, "docs/wind.md", include_str!("../../../docs/wind.md"));
}
