//! The engine: geometry, params, node declarations, graphs, plans and cooking. It knows no node.

pub mod clock;
pub mod cook;
pub mod error;
pub mod expr;
pub mod files;
pub mod geometry;
pub mod graph;
pub mod key;
pub mod node;
pub mod param;
pub mod plan;
pub mod time;

pub use error::{Error, ErrorKind, Result};
