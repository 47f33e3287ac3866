//! Checks of what every node promises, derived from its declaration alone, and a bench for testing a single node.
//!
//! A node's test calls [`conforms`]. The suite reads the declaration, cooks the node with sample geometry and param
//! values, and reports every broken promise. There is one file per promise:
//!
//! | promise | file |
//! |---|---|
//! | The declaration is complete and consistent. | `declaration` |
//! | Params accept their whole range and refuse everything outside. | `ranges` |
//! | Every param is read and changes the result; so does every mask. | `params` |
//! | Every input changes the result. | `inputs` |
//! | A node reads the attributes it declares, and no others. | `attributes` |
//! | What a node does not write passes through, shared and not copied. | `pass_through` |
//! | Outputs carry the declared components; metrics are published and finite. | `outputs` |
//! | A stage reported as left out has no effect. | `left_out` |
//! | Results are finite and nothing panics, on degenerate and extreme geometry too. | `errors` |
//! | Bits depend on inputs, params and frame only. | `determinism` |
//! | The bits of a frame do not depend on which other frames are cooked. | `frames` |
//! | A solver's checkpoint holds its whole state. | `checkpoints` |
//!
//! The suite is a search, not a proof. It may miss behaviour that occurs only with more than a few hundred rows or with
//! a rare pair of values. It cannot detect an undeclared attribute that no sample has, nor whether a stage that is left
//! out costs time. Values that it cannot invent (files, code) are supplied by the test through [`Conformance::with`].

mod bench;
mod panics;
mod promises;
mod samples;
mod suite;
#[cfg(test)]
mod tests;
mod threads;
mod trial;
mod values;

pub use bench::{Bench, BenchResult, bench, cook_all};
pub use panics::quietly;
pub use suite::{Conformance, conformance, conforms, faults};
pub use values::{RangeEnd, range_ends};
