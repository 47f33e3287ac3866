//! What several of the family's nodes use.

pub(crate) mod attributes;
pub(crate) mod surface;
pub(crate) mod volume;
