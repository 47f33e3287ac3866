//! Helpers shared by the family's nodes.

pub(crate) mod faces;
pub(crate) mod kept;
pub(crate) mod planting;
pub(crate) mod samples;
pub(crate) mod skin;
pub(crate) mod source;
pub(crate) mod usd;
