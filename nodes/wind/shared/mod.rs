//! What several nodes of the family need, and none of them is.

pub(crate) mod direction;
pub(crate) mod gust_control;
pub(crate) mod surface;
