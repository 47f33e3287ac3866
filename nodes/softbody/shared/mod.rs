//! What several nodes of the family need, and none of them is.

pub(crate) mod attributes;
