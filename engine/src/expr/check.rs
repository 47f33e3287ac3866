//! Checks widths: scalars, 3-vectors and 4-vectors.
//!
//! Promise: what passes with all attributes known can be lowered. Limit: what depends on an unknown attribute passes,
//! and is checked again when the columns are known.

use super::Width;
use super::ast::{Ast, COMPONENTS, Node, NodeId, Statement, Target};
use super::code::Unary;
use super::error::{ExprError, Position};
use super::functions::{Function, FunctionKind};
use super::suggest::{listed, shortened};
use crate::geometry::ColumnType;

/// What is known about an attribute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum AttributeState {
    /// It exists, or an assignment has created it.
    Typed(ColumnType),
    /// It does not exist. An assignment creates it with this type, or else with that of the value.
    Absent(Option<ColumnType>),
    /// The columns are not known yet.
    Unknown,
}

/// `None` if it depends on an unknown attribute.
type MaybeWidth = Option<Width>;

/// Checks every statement and updates `attributes` by its assignments. `controls` are the widths of the controls,
/// `others` further names to suggest for an unknown one.
///
/// # Errors
/// The first fault of each statement, in the order of the text.
pub(super) fn check(
    ast: &Ast,
    controls: &[Width],
    others: &[&str],
    attributes: &mut [AttributeState],
) -> Result<(), Vec<ExprError>> {
    let mut checker = Checker { ast, controls, others, attributes, widths: Vec::new() };
    let faults: Vec<ExprError> =
        ast.statements.iter().filter_map(|statement| checker.statement(statement).err()).collect();
    if faults.is_empty() { Ok(()) } else { Err(faults) }
}

struct Checker<'a> {
    ast: &'a Ast,
    controls: &'a [Width],
    others: &'a [&'a str],
    attributes: &'a mut [AttributeState],
    widths: Vec<MaybeWidth>,
}

impl Checker<'_> {
    fn statement(&mut self, statement: &Statement) -> Result<(), ExprError> {
        let end = statement.value as usize + 1;
        let value = self.value(end);
        // After a fault all widths of the statement are unknown.
        self.widths.resize(end, None);
        let value = value?;
        match statement.target {
            Target::Local | Target::Components => Ok(()),
            Target::Result => match value {
                Some(width) if width != Width::Scalar => {
                    let fault = statement.position.fault(format!("expected a scalar, found {width}"));
                    Err(fault.hint("take a component, such as `.x`"))
                }
                _ => Ok(()),
            },
            Target::Attribute { attribute, component } => {
                self.assign(attribute as usize, component, value, statement.position)
            }
        }
    }

    fn value(&mut self, end: usize) -> Result<MaybeWidth, ExprError> {
        for k in self.widths.len()..end {
            let width = self.node(&self.ast.nodes[k], self.ast.positions[k])?;
            self.widths.push(width);
        }
        Ok(self.widths[end - 1])
    }

    fn assign(
        &mut self,
        attribute: usize,
        component: Option<u32>,
        value: MaybeWidth,
        position: Position,
    ) -> Result<(), ExprError> {
        let name = shortened(&self.ast.attributes[attribute]);
        let state = self.attributes[attribute];
        if let Some(component) = component {
            let width = match state {
                AttributeState::Typed(kind) => Some(Width::of(kind)),
                AttributeState::Unknown => None,
                AttributeState::Absent(_) => {
                    let fault = position.fault(format!("the attribute `{name}` does not exist yet"));
                    return Err(fault.hint(format!("assign all its components first: `{name} = vec(x, y, z)`")));
                }
            };
            check_component(width, component, position)?;
            return match value {
                Some(width) if width != Width::Scalar => {
                    let component = COMPONENTS[component as usize];
                    Err(position.fault(format!("cannot assign {width} to `{name}.{component}`, which is a scalar")))
                }
                _ => Ok(()),
            };
        }
        let becomes = match state {
            AttributeState::Typed(kind) | AttributeState::Absent(Some(kind)) => Some(kind),
            AttributeState::Absent(None) | AttributeState::Unknown => value.map(Width::single),
        };
        if let (Some(kind), Some(value)) = (becomes, value)
            && Width::of(kind) != value
        {
            let fault = position.fault(format!("cannot assign {value} to `{name}`, which is {}", Width::of(kind)));
            return Err(match (Width::of(kind), value) {
                (Width::Vec3, Width::Scalar) => fault.hint("`vec(x)` fills a 3-vector"),
                (Width::Scalar, _) => fault.hint("take a component, such as `.x`, or `length(v)`"),
                _ => fault,
            });
        }
        if let Some(kind) = becomes {
            self.attributes[attribute] = AttributeState::Typed(kind);
        }
        Ok(())
    }

    fn node(&self, node: &Node, position: Position) -> Result<MaybeWidth, ExprError> {
        let width = |id: &NodeId| self.widths[*id as usize];
        match node {
            Node::Number(_) | Node::Input(_) => Ok(Some(Width::Scalar)),
            Node::Control(control) => Ok(Some(self.controls[*control as usize])),
            Node::Attribute(attribute) => match self.attributes[*attribute as usize] {
                AttributeState::Typed(kind) => Ok(Some(Width::of(kind))),
                AttributeState::Unknown => Ok(None),
                AttributeState::Absent(_) => Err(self.absent(*attribute as usize, position)),
            },
            Node::Local(value) => Ok(width(value)),
            Node::Unary(op, a) => {
                if *op == Unary::Not {
                    check_scalar(width(a), "`!`", position)?;
                }
                Ok(width(a))
            }
            Node::Binary(operator, a, b) => {
                if !operator.on_vectors {
                    let text = format!("`{}`", operator.text);
                    check_scalar(width(a), &text, position)?;
                    check_scalar(width(b), &text, position)?;
                }
                joined(width(a), width(b), operator.text, position)
            }
            Node::Select(condition, yes, no) => {
                check_scalar(width(condition), "the condition of `?`", position)?;
                joined(width(yes), width(no), "?:", position)
            }
            Node::Component(of, component) => {
                check_component(width(of), *component, position)?;
                Ok(Some(Width::Scalar))
            }
            Node::Call(function, first, count) => {
                let arguments = &self.ast.arguments[*first as usize..][..*count as usize];
                let widths: Vec<MaybeWidth> = arguments.iter().map(width).collect();
                call(function, &widths, position)
            }
        }
    }

    fn absent(&self, attribute: usize, position: Position) -> ExprError {
        let name = &self.ast.attributes[attribute];
        let existing = self.ast.attributes.iter().zip(&*self.attributes);
        let existing = existing.filter(|(_, state)| matches!(state, AttributeState::Typed(_))).map(|(name, _)| name);
        let own = ["frame", "time", "fps", "seed", "count"];
        let named = existing.chain(&self.ast.locals).map(String::as_str);
        let candidates = named.chain(self.others.iter().copied()).chain(own);
        let fault = position.fault(format!("there is no attribute, control or `let` value `{}`", shortened(name)));
        fault.suggest(name, candidates, || listed(self.others).map(|names| format!("available: {names}")))
    }
}

fn call(function: &Function, arguments: &[MaybeWidth], position: Position) -> Result<MaybeWidth, ExprError> {
    let name = function.name;
    let joined_all =
        || arguments[1..].iter().try_fold(arguments[0], |width, next| joined(width, *next, name, position));
    let scalars = || arguments.iter().try_for_each(|width| check_scalar(*width, &format!("`{name}`"), position));
    let usage = |fact: String| position.fault(fact).hint(format!("write `{}`", function.usage));
    match function.kind {
        FunctionKind::Each(_) => joined_all(),
        FunctionKind::Noise => {
            if !matches!(arguments, [None | Some(Width::Vec3)]) {
                scalars()?;
            }
            Ok(Some(Width::Scalar))
        }
        FunctionKind::Rand => scalars().map(|()| Some(Width::Scalar)),
        FunctionKind::Vector => {
            scalars()?;
            match arguments.len() {
                1 | 3 => Ok(Some(Width::Vec3)),
                4 => Ok(Some(Width::Vec4)),
                count => Err(usage(format!("`vec` takes 1, 3 or 4 arguments, not {count}"))),
            }
        }
        FunctionKind::Length => Ok(Some(Width::Scalar)),
        FunctionKind::Distance | FunctionKind::Dot => {
            // A scalar is not extended to a vector here, because it is probably a mistake.
            if let [Some(a), Some(b)] = arguments
                && a != b
            {
                return Err(position.fault(format!("`{name}` cannot combine {a} and {b}")));
            }
            Ok(Some(Width::Scalar))
        }
        FunctionKind::Cross => {
            for width in arguments.iter().flatten() {
                if *width != Width::Vec3 {
                    return Err(position.fault(format!("`cross` takes 3-vectors, not {width}")));
                }
            }
            Ok(Some(Width::Vec3))
        }
        FunctionKind::Normalize => {
            if arguments[0] == Some(Width::Scalar) {
                let fault = position.fault("`normalize` takes a vector, not a scalar");
                return Err(fault.hint("for a scalar use `sign(x)`"));
            }
            Ok(arguments[0])
        }
    }
}

/// The width of two values combined component by component.
fn joined(a: MaybeWidth, b: MaybeWidth, by: &str, position: Position) -> Result<MaybeWidth, ExprError> {
    match (a, b) {
        (Some(a), Some(b)) if a == b || b == Width::Scalar => Ok(Some(a)),
        (Some(Width::Scalar), b) => Ok(b),
        (a, Some(Width::Scalar)) => Ok(a),
        (Some(a), Some(b)) => Err(position.fault(format!("`{by}` cannot combine {a} and {b}"))),
        (a, b) => Ok(a.or(b)),
    }
}

fn check_scalar(width: MaybeWidth, what: &str, position: Position) -> Result<(), ExprError> {
    match width {
        Some(width) if width != Width::Scalar => {
            let fault = position.fault(format!("{what} takes scalars, not {width}"));
            Err(fault.hint("take a component, such as `.x`, or `length(v)`"))
        }
        _ => Ok(()),
    }
}

fn check_component(of: MaybeWidth, component: u32, position: Position) -> Result<(), ExprError> {
    match of {
        Some(Width::Scalar) => Err(position.fault("a scalar has no components")),
        Some(width) if component as usize >= width.count() => {
            let name = COMPONENTS[component as usize];
            Err(position.fault(format!("{width} has no component `.{name}`")))
        }
        _ => Ok(()),
    }
}
