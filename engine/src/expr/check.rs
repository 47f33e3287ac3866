//! Are widths used as they may be? A scalar, a vector of three and one of four are not the same.
//!
//! Promise: what passes with every attribute known can be lowered. Limit: what hangs on an
//! attribute that is not known yet is let through, to be looked at again when it is.

use super::Width;
use super::ast::{Ast, COMPONENTS, Node, NodeId, Statement, Target};
use super::code::Unary;
use super::error::{ExprError, Place};
use super::functions::{Does, Function};
use super::suggest::{listed, shortened};
use crate::geometry::ColumnType;

/// What is known of an attribute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Known {
    /// It is there, or an assignment has made it.
    Is(ColumnType),
    /// It is not there; made by an assignment it becomes this, or what the value is.
    Absent(Option<ColumnType>),
    /// The columns have not been seen.
    Maybe,
}

/// `None`: hangs on an attribute that may be anything.
type MaybeWidth = Option<Width>;

/// Checks every statement, and leaves in `attributes` what the program makes of them. `controls` are
/// the widths of the controls, `others` names that exist besides, to propose for one that does not.
///
/// # Errors
/// The first fault of each statement, in the order of the text.
pub(super) fn check(
    ast: &Ast,
    controls: &[Width],
    others: &[&str],
    attributes: &mut [Known],
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
    attributes: &'a mut [Known],
    widths: Vec<MaybeWidth>,
}

impl Checker<'_> {
    fn statement(&mut self, statement: &Statement) -> Result<(), ExprError> {
        let end = statement.value as usize + 1;
        let value = self.value(end);
        // Behind a fault everything of the statement may be anything.
        self.widths.resize(end, None);
        let value = value?;
        match statement.target {
            Target::Local => Ok(()),
            Target::Result => match value {
                Some(width) if width != Width::Scalar => {
                    let fault = statement.place.fault(format!("expected a scalar, found {width}"));
                    Err(fault.hint("take a component, such as `.x`; a vector is three expressions"))
                }
                _ => Ok(()),
            },
            Target::Attribute { attribute, component } => {
                self.assign(attribute as usize, component, value, statement.place)
            }
        }
    }

    fn value(&mut self, end: usize) -> Result<MaybeWidth, ExprError> {
        for k in self.widths.len()..end {
            let width = self.node(&self.ast.nodes[k], self.ast.places[k])?;
            self.widths.push(width);
        }
        Ok(self.widths[end - 1])
    }

    fn assign(
        &mut self,
        attribute: usize,
        component: Option<u32>,
        value: MaybeWidth,
        place: Place,
    ) -> Result<(), ExprError> {
        let name = shortened(&self.ast.attributes[attribute]);
        let known = self.attributes[attribute];
        if let Some(component) = component {
            let width = match known {
                Known::Is(kind) => Some(Width::of(kind)),
                Known::Maybe => None,
                Known::Absent(_) => {
                    let fault = place.fault(format!("there is no attribute `{name}` yet"));
                    return Err(fault.hint(format!("make it whole first: `{name} = vec(x, y, z)`")));
                }
            };
            check_component(width, component, place)?;
            return match value {
                Some(width) if width != Width::Scalar => {
                    let component = COMPONENTS[component as usize];
                    Err(place.fault(format!("`{name}.{component}` is a scalar, its value {width}")))
                }
                _ => Ok(()),
            };
        }
        let becomes = match known {
            Known::Is(kind) | Known::Absent(Some(kind)) => Some(kind),
            Known::Absent(None) | Known::Maybe => value.map(Width::single),
        };
        if let (Some(kind), Some(value)) = (becomes, value)
            && Width::of(kind) != value
        {
            let fault = place.fault(format!("`{name}` is {}, its value {value}", Width::of(kind)));
            return Err(match (Width::of(kind), value) {
                (Width::Vec3, Width::Scalar) => fault.hint("`vec(x)` fills a 3-vector"),
                (Width::Scalar, _) => fault.hint("take a component, such as `.x`, or `length(v)`"),
                _ => fault,
            });
        }
        if let Some(kind) = becomes {
            self.attributes[attribute] = Known::Is(kind);
        }
        Ok(())
    }

    fn node(&self, node: &Node, place: Place) -> Result<MaybeWidth, ExprError> {
        let width = |id: &NodeId| self.widths[*id as usize];
        match node {
            Node::Number(_) | Node::Input(_) => Ok(Some(Width::Scalar)),
            Node::Control(control) => Ok(Some(self.controls[*control as usize])),
            Node::Attribute(attribute) => match self.attributes[*attribute as usize] {
                Known::Is(kind) => Ok(Some(Width::of(kind))),
                Known::Maybe => Ok(None),
                Known::Absent(_) => Err(self.absent(*attribute as usize, place)),
            },
            Node::Local(value) => Ok(width(value)),
            Node::Unary(op, a) => {
                if *op == Unary::Not {
                    check_scalar(width(a), "`!`", place)?;
                }
                Ok(width(a))
            }
            Node::Binary(operator, a, b) => {
                if !operator.on_vectors {
                    let text = format!("`{}`", operator.text);
                    check_scalar(width(a), &text, place)?;
                    check_scalar(width(b), &text, place)?;
                }
                joined(width(a), width(b), operator.text, place)
            }
            Node::Select(condition, yes, no) => {
                check_scalar(width(condition), "the condition of `?`", place)?;
                joined(width(yes), width(no), "?:", place)
            }
            Node::Component(of, component) => {
                check_component(width(of), *component, place)?;
                Ok(Some(Width::Scalar))
            }
            Node::Call(function, first, count) => {
                let arguments = &self.ast.arguments[*first as usize..][..*count as usize];
                let widths: Vec<MaybeWidth> = arguments.iter().map(width).collect();
                call(function, &widths, place)
            }
        }
    }

    fn absent(&self, attribute: usize, place: Place) -> ExprError {
        let name = &self.ast.attributes[attribute];
        let made = self.ast.attributes.iter().zip(&*self.attributes);
        let made = made.filter(|(_, known)| matches!(known, Known::Is(_))).map(|(name, _)| name);
        let own = ["frame", "time", "fps", "seed", "count"];
        let named = made.chain(&self.ast.locals).map(String::as_str);
        let candidates = named.chain(self.others.iter().copied()).chain(own);
        let fault = place.fault(format!("there is no attribute, control or value `{}`", shortened(name)));
        fault.suggest(name, candidates, || listed(self.others).map(|names| format!("there are {names}")))
    }
}

fn call(function: &Function, arguments: &[MaybeWidth], place: Place) -> Result<MaybeWidth, ExprError> {
    let name = function.name;
    let joined_all = || arguments[1..].iter().try_fold(arguments[0], |width, next| joined(width, *next, name, place));
    let scalars = || arguments.iter().try_for_each(|width| check_scalar(*width, &format!("`{name}`"), place));
    let usage = |fact: String| place.fault(fact).hint(format!("write `{}`", function.usage));
    match function.does {
        Does::Each(_) => joined_all(),
        Does::Noise => {
            if !matches!(arguments, [None | Some(Width::Vec3)]) {
                scalars()?;
            }
            Ok(Some(Width::Scalar))
        }
        Does::Rand => scalars().map(|()| Some(Width::Scalar)),
        Does::Vector => {
            scalars()?;
            match arguments.len() {
                1 | 3 => Ok(Some(Width::Vec3)),
                4 => Ok(Some(Width::Vec4)),
                count => Err(usage(format!("`vec` takes 1, 3 or 4 arguments, not {count}"))),
            }
        }
        Does::Length => Ok(Some(Width::Scalar)),
        Does::Distance | Does::Dot => {
            // A scalar does not stand for a vector here: that is a slip far more often than meant.
            if let [Some(a), Some(b)] = arguments
                && a != b
            {
                return Err(place.fault(format!("`{name}` cannot join {a} and {b}")));
            }
            Ok(Some(Width::Scalar))
        }
        Does::Cross => {
            for width in arguments.iter().flatten() {
                if *width != Width::Vec3 {
                    return Err(place.fault(format!("`cross` takes 3-vectors, not {width}")));
                }
            }
            Ok(Some(Width::Vec3))
        }
        Does::Normalize => {
            if arguments[0] == Some(Width::Scalar) {
                let fault = place.fault("`normalize` takes a vector, not a scalar");
                return Err(fault.hint("`sign(x)` is the direction of a scalar"));
            }
            Ok(arguments[0])
        }
    }
}

/// The width of two values joined component by component.
fn joined(a: MaybeWidth, b: MaybeWidth, by: &str, place: Place) -> Result<MaybeWidth, ExprError> {
    match (a, b) {
        (Some(a), Some(b)) if a == b || b == Width::Scalar => Ok(Some(a)),
        (Some(Width::Scalar), b) => Ok(b),
        (a, Some(Width::Scalar)) => Ok(a),
        (Some(a), Some(b)) => Err(place.fault(format!("`{by}` cannot join {a} and {b}"))),
        (a, b) => Ok(a.or(b)),
    }
}

fn check_scalar(width: MaybeWidth, what: &str, place: Place) -> Result<(), ExprError> {
    match width {
        Some(width) if width != Width::Scalar => {
            let fault = place.fault(format!("{what} takes scalars, not {width}"));
            Err(fault.hint("take a component, such as `.x`, or `length(v)`"))
        }
        _ => Ok(()),
    }
}

fn check_component(of: MaybeWidth, component: u32, place: Place) -> Result<(), ExprError> {
    match of {
        Some(Width::Scalar) => Err(place.fault("a scalar has no components")),
        Some(width) if component as usize >= width.count() => {
            let name = COMPONENTS[component as usize];
            Err(place.fault(format!("{width} has no component `.{name}`")))
        }
        _ => Ok(()),
    }
}
