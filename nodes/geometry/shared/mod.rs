//! What several nodes of the family need, and none of them is.

pub(crate) mod faces;
pub(crate) mod kept;
pub(crate) mod planting;
pub(crate) mod source;
