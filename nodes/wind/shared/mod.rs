//! What several wind nodes need.

pub(crate) mod surface;
