//! A parsed text: nodes in one flat list, each behind the nodes it is made of.
//!
//! So every pass is a loop from the first node to the last, and no depth of a text can exhaust the
//! stack after parsing.

use super::code::{Binary, Input, Unary};
use super::error::Place;
use super::functions::Function;

/// Names a node by its position in the list.
pub(super) type NodeId = u32;

/// A parsed text.
#[derive(Clone, Debug, Default)]
pub(super) struct Ast {
    pub(super) nodes: Vec<Node>,
    /// Where each node's name, number or operator stands.
    pub(super) places: Vec<Place>,
    /// The arguments of all calls in a row.
    pub(super) arguments: Vec<NodeId>,
    pub(super) statements: Vec<Statement>,
    /// Names of attributes; nodes name them by position.
    pub(super) attributes: Vec<String>,
    /// Names of `let` values.
    pub(super) locals: Vec<String>,
}

/// One step of evaluation.
#[derive(Clone, Debug)]
pub(super) enum Node {
    Number(f64),
    Input(Input),
    Control(u32),
    Attribute(u32),
    /// The value of an earlier `let`.
    Local(NodeId),
    Unary(Unary, NodeId),
    Binary(Operator, NodeId, NodeId),
    Select(NodeId, NodeId, NodeId),
    Component(NodeId, u32),
    /// A function and where its arguments stand in `Ast::arguments`.
    Call(&'static Function, u32, u32),
}

/// An operator between two values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Operator {
    pub(super) text: &'static str,
    pub(super) op: Binary,
    /// `a > b` is `b < a`.
    pub(super) swapped: bool,
    /// Works component by component; comparisons and logic take scalars only.
    pub(super) on_vectors: bool,
}

/// One assignment, or the whole of an expression.
#[derive(Clone, Debug)]
pub(super) struct Statement {
    pub(super) target: Target,
    /// Where the target stands.
    pub(super) place: Place,
    /// The node that makes the value; every node up to it belongs to this or earlier statements.
    pub(super) value: NodeId,
}

/// Where the value of a statement goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Target {
    /// The value of an expression.
    Result,
    /// A `let`; nodes refer to its value directly.
    Local,
    Attribute {
        attribute: u32,
        component: Option<u32>,
    },
}

/// Names of components, in order.
pub(super) const COMPONENTS: [&str; 4] = ["x", "y", "z", "w"];
