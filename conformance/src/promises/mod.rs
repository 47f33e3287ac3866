//! One file per promise. Each has a `check` that adds to the [`Findings`](crate::suite::Findings) whatever breaks it.

pub(crate) mod attributes;
pub(crate) mod checkpoints;
pub(crate) mod declaration;
pub(crate) mod determinism;
pub(crate) mod errors;
pub(crate) mod frames;
pub(crate) mod inputs;
pub(crate) mod left_out;
pub(crate) mod neutral;
pub(crate) mod outputs;
pub(crate) mod params;
pub(crate) mod pass_through;
pub(crate) mod ranges;
