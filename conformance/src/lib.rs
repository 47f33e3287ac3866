//! What every node promises, checked from its declaration alone, and a bench for the tests of one node.
//!
//! A node's test calls [`conforms`]. The suite reads the declaration, tries the node with sample geometry and values of its
//! params, and reports every broken promise. There is one file per promise:
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
//! | Bits depend on what the node is given and on nothing else. | `determinism` |
//! | The bits of a frame do not depend on which other frames are cooked. | `frames` |
//! | A solver's checkpoint holds its whole state. | `checkpoints` |
//!
//! The suite is a search, not a proof. It may miss what a node does only with more than a few hundred rows or with a rare
//! pair of values. It cannot see an undeclared attribute that no sample has, nor whether a stage that is left out costs
//! time. What it cannot invent (files, texts in a language) a test supplies through [`Conformance::with`].

mod bench;
mod panics;
mod promises;
mod samples;
mod suite;
#[cfg(test)]
mod tests;
mod trial;
mod values;

pub use bench::{Bench, BenchResult, bench, cook_all};
pub use panics::quietly;
pub use suite::{Conformance, conformance, conforms, faults};
pub use values::{RangeEnd, range_ends};
