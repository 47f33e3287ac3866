//! Helpers shared by the family's nodes.

pub(crate) mod clump;
pub(crate) mod direction;
pub(crate) mod group;
pub(crate) mod gust_control;
pub(crate) mod surface;
