//! A promise a file.

pub(crate) mod bits;
pub(crate) mod declaration;
pub(crate) mod passes;
pub(crate) mod reads;
