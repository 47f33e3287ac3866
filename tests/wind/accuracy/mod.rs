//! How accurately each law of the wind chain is met, with its limit: one table, printed, checked, and compared with
//! docs/wind.md.
//!
//! Laws are closed forms, computed in f64 by code that shares nothing with the kernels.

mod bend;
mod contact;
mod envelope;
mod noise;
mod swing;
mod symmetry;

use crate::accuracy_table::{Figure, storage};

#[test]
fn the_wind_chain_meets_its_laws_and_the_docs_show_the_table() {
    crate::accuracy_table::check(&figures(), "docs/wind.md", include_str!("../../../docs/wind.md"));
}

/// The rows of the table, in the order of the docs.
pub(crate) fn figures() -> Vec<Figure> {
    let figures = [
        bend::figures(),
        symmetry::figures(),
        noise::figures(),
        envelope::figures(),
        swing::figures(),
        contact::figures(),
    ];
    figures.into_iter().flatten().collect()
}
