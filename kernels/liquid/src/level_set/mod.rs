//! The level set of a liquid's surface.

pub(crate) mod cubic;
mod view;

pub use view::PhiView;
pub(crate) use view::RowBlocks;
