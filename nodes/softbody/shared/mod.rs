//! Helpers shared by the family's nodes.

pub(crate) mod attributes;
