//! A parsed text: nodes in one flat list, each after its operands.
//!
//! So every pass is a loop from the first node to the last, and deep nesting cannot overflow the stack after parsing.

use super::code::{Binary, Input, Unary};
use super::error::Position;
use super::functions::Function;

/// The index of a node in the list.
pub(super) type NodeId = u32;

/// A parsed text.
#[derive(Clone, Debug, Default)]
pub(super) struct Ast {
    pub(super) nodes: Vec<Node>,
    /// The position of each node's name, number or operator in the text.
    pub(super) positions: Vec<Position>,
    /// The arguments of all calls, concatenated.
    pub(super) arguments: Vec<NodeId>,
    pub(super) statements: Vec<Statement>,
    /// Names of attributes; nodes refer to them by index.
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
    /// A function, and the first index and number of its arguments in `Ast::arguments`.
    Call(&'static Function, u32, u32),
}

/// An operator between two values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Operator {
    pub(super) text: &'static str,
    pub(super) op: Binary,
    /// Whether the operands are swapped: `a > b` is `b < a`.
    pub(super) swapped: bool,
    /// Whether it works component by component; comparisons and logic accept only scalars.
    pub(super) on_vectors: bool,
}

/// One assignment, or a whole expression.
#[derive(Clone, Debug)]
pub(super) struct Statement {
    pub(super) target: Target,
    /// The position of the target in the text.
    pub(super) position: Position,
    /// The node of the value; all nodes up to it belong to this or earlier statements.
    pub(super) value: NodeId,
}

/// What the value of a statement is assigned to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Target {
    /// The value of an expression, a scalar.
    Result,
    /// The value of an expression, of any width.
    Components,
    /// A `let`; nodes refer to its value directly.
    Local,
    Attribute {
        attribute: u32,
        component: Option<u32>,
    },
}

/// Names of components, in order.
pub(super) const COMPONENTS: [&str; 4] = ["x", "y", "z", "w"];
