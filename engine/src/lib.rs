//! The engine: geometry, params, node declarations, graphs, plans and cooking. It knows no node.

pub mod clock;
pub mod cook;
pub mod error;
pub mod expr;
pub mod files;
pub mod frames;
pub mod geometry;
pub mod graph;
pub mod host;
pub mod key;
pub mod memory;
pub mod node;
pub mod note;
pub mod param;
pub mod plan;
pub mod time;

#[cfg(test)]
mod structure;

pub use error::{Error, ErrorKind, Result};

/// What a node file needs.
pub mod prelude {
    pub use crate::error::{Error, ErrorKind, Result};
    pub use crate::geometry::{
        Attr, CURVE_ID, Column, Component, ENVELOPE, Faces, Geometry, ID, Item, Kind, N, Name, ORIENT, Owner, P, PREF,
        Runs, SHIELDED, THICKNESS, Topology, UVW, V, Volume, WIDTH,
    };
    pub use crate::node::{
        Accuracy, AttrDecl, AttrNames, Chain, Cook, CurveLoop, Cx, Edited, Fill, FrameCx, Input, LeftOut, Many, Metric,
        MetricValues, Node, Opt, Output, Outputs, Past, Resumable, StepCx, Times, Trials, Wires, point_float_hint,
        point_floats_hint,
    };
    pub use crate::param::{Clock, Code, Maskable, Param, Params, Seed, Span, Turn, Unit};
    pub use crate::time::Frame;
    pub use crate::{choice, inputs, metrics, params};
}
