//! `{"expr": …}`, with one expression for each component of the param or one whose value is a vector, and code, which
//! is assignments in the same language. Expressions that do not depend on time become constants.

use std::sync::Arc;

use jsonc_parser::ast::Value as Ast;

use super::control::Controls;
use crate::expr::{Expr, ExprError, Program, Scope, Width};
use crate::graph::Scene;
use crate::graph::fault::{Fault, code};
use crate::graph::json::{Json, keep};
use crate::note::kind;
use crate::param::{CodeSource, ControlTable, ControlValue, ParamSpec, Shape, Source, Value};

/// The source for a param's expressions, constant if they do not depend on time. `None` after a fault, and for a shape
/// that cannot be an expression.
pub(super) fn read(
    spec: &ParamSpec,
    json: &Json<'_>,
    controls: &Controls<'_>,
    scene: &Scene,
    faults: &mut Vec<Fault>,
) -> Option<Source> {
    let parts = match spec.shape.expressions()? {
        1 => vec![scalar(json, controls, faults)?],
        3 if json.string().is_some() => vector(json, controls, faults)?,
        count => listed(json, count, controls, faults)?,
    };
    let mut valid = true;
    for (text, expr) in &parts {
        let number = Source::Exprs(Arc::new(vec![expr.clone()]), Shape::Float, controls.table.clone());
        if let (false, Value::Float(x)) = (number.is_animated(), number.at(scene.first as f64, scene.clock()))
            && !x.is_finite()
        {
            faults.push(not_finite(text, x));
            valid = false;
        }
    }
    if spec.is_in_degrees() {
        let mut remarked = None;
        for (text, _) in parts.iter().filter(|(_, expr)| expr.has_pi_as_term()) {
            // The components of one vector have one text.
            if remarked.replace(text.path()) == Some(text.path()) {
                continue;
            }
            let fact = format!("the expression is a multiple of `pi`, but `{}` is in degrees", spec.name);
            let hint = "Write 180 instead of `pi`, or degrees(…) around an angle in radians.";
            faults.push(text.fault(kind::PI_IN_DEGREES, fact).hint(hint).into_remark());
        }
    }
    let exprs = parts.into_iter().map(|(_, expr)| expr).collect();
    let source = Source::Exprs(Arc::new(exprs), spec.shape, controls.table.clone());
    let source =
        if source.is_animated() { source } else { Source::Constant(source.at(scene.first as f64, scene.clock())) };
    valid.then_some(source)
}

/// The value of a control from its expressions, which read the controls `before` it, with their values in `table`:
/// constant if it does not depend on time. `None` after a fault.
pub(super) fn control(
    json: &Json<'_>,
    before: &Controls<'_>,
    table: &ControlTable,
    scene: &Scene,
    faults: &mut Vec<Fault>,
) -> Option<(Width, ControlValue)> {
    let parts = match json.string() {
        Some(_) => components(json, before, faults)?,
        None => listed(json, 3, before, faults)?,
    };
    let width = match parts.len() {
        1 => Width::Scalar,
        3 => Width::Vec3,
        _ => {
            let fault = json.fault(code::EXPRESSION, "the value of the expression is a 4-vector");
            faults.push(fault.hint("a control is a number or a vector of three"));
            return None;
        }
    };
    let value = ControlValue::Exprs(parts.iter().map(|(_, expr)| expr.clone()).collect());
    if table.varies(&value) {
        return Some((width, value));
    }
    let numbers = table.evaluate(&value, scene.first as f64, scene.clock());
    if let Some((x, (text, _))) = numbers.iter().zip(&parts).find(|(x, _)| !x.is_finite()) {
        faults.push(not_finite(text, *x));
        return None;
    }
    let constant = match numbers[..] {
        [x, y, z] => Value::Vec3([x, y, z]),
        _ => Value::Float(numbers[0]),
    };
    Some((width, ControlValue::Source(Source::Constant(constant))))
}

fn not_finite(text: &Json<'_>, x: f64) -> Fault {
    text.fault(code::ILLEGAL_VALUE, format!("the value of the expression is {x}")).hint("expected a finite number")
}

/// The source for code: assignments, with the controls in scope. `None` after a fault.
pub(super) fn code(json: &Json<'_>, controls: &Controls<'_>, faults: &mut Vec<Fault>) -> Option<Source> {
    let Some(text) = json.string() else {
        faults.push(json.unexpected(&Shape::Code.describe()));
        return None;
    };
    match Program::parse(text, &Scope { controls: &controls.scope }) {
        Ok(program) => Some(Source::Code(CodeSource::new(text, program, controls.table.clone()))),
        Err(errors) => {
            faults.extend(errors.into_iter().map(|error| explain(json, text, "code", controls, error)));
            None
        }
    }
}

/// An expression and where it is written.
type Part<'a> = (Json<'a>, Expr);

/// One expression whose value is a number.
fn scalar<'a>(json: &Json<'a>, controls: &Controls<'_>, faults: &mut Vec<Fault>) -> Option<Part<'a>> {
    let Some(text) = json.string() else {
        faults.push(json.unexpected("an expression in quotes"));
        return None;
    };
    let parsed = Expr::parse(text, &Scope { controls: &controls.scope });
    let expr = keep(parsed.map_err(|error| explain(json, text, "expression", controls, error)), faults)?;
    Some((json.clone(), expr))
}

/// The components of one expression of any width.
fn components<'a>(json: &Json<'a>, controls: &Controls<'_>, faults: &mut Vec<Fault>) -> Option<Vec<Part<'a>>> {
    let text = json.string()?;
    let parsed = Expr::parse_components(text, &Scope { controls: &controls.scope });
    let exprs = keep(parsed.map_err(|error| explain(json, text, "expression", controls, error)), faults)?;
    Some(exprs.into_iter().map(|expr| (json.clone(), expr)).collect())
}

/// The components of one expression whose value is a vector of three.
fn vector<'a>(json: &Json<'a>, controls: &Controls<'_>, faults: &mut Vec<Fault>) -> Option<Vec<Part<'a>>> {
    let parts = components(json, controls, faults)?;
    let (found, hint) = match parts.len() {
        1 => ("a scalar", "write vec(x, y, z), or a list of three expressions and numbers"),
        4 => ("a 4-vector", "write vec(x, y, z)"),
        _ => return Some(parts),
    };
    faults.push(json.fault(code::EXPRESSION, format!("expected a 3-vector, found {found}")).hint(hint));
    None
}

/// A list of expressions and numbers.
fn listed<'a>(
    json: &Json<'a>,
    count: usize,
    controls: &Controls<'_>,
    faults: &mut Vec<Fault>,
) -> Option<Vec<Part<'a>>> {
    let Some(items) = json.elements().filter(|items| items.len() == count) else {
        let list = vec!["\"…\""; count].join(", ");
        let expected = match count {
            3 => format!("an expression \"vec(x, y, z)\", or {count} expressions [{list}]"),
            _ => format!("{count} expressions [{list}]"),
        };
        faults.push(json.unexpected(&expected));
        return None;
    };
    let parts = items.iter().enumerate().map(|(index, item)| {
        let item = json.item(item, index);
        match item.value {
            Ast::NumberLit(_) => {
                let number = keep(item.number("a number"), faults)?;
                Some((item, Expr::number(number)))
            }
            Ast::StringLit(_) => scalar(&item, controls, faults),
            _ => {
                faults.push(item.unexpected("a number, or an expression in quotes"));
                None
            }
        }
    });
    // Collected first, so that the faults of all are reported.
    parts.collect::<Vec<_>>().into_iter().collect()
}

/// The fault of an invalid expression or code (`noun`), at the character where the error is.
fn explain(json: &Json<'_>, text: &str, noun: &str, controls: &Controls<'_>, error: ExprError) -> Fault {
    let ExprError { line, column, fact, hint } = error;
    let skipped: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(|line| line.chars().count()).sum();
    let offset = json.offset_in_string(skipped + column.saturating_sub(1));
    if text.trim().is_empty() {
        return Fault { hint, ..json.fault(code::EXPRESSION, fact) };
    }
    let position = if line > 1 { format!("line {line}, column {column}") } else { format!("column {column}") };
    let (fact, hint) = match controls.why_unreadable(&fact) {
        Some((fact, why)) => (fact, Some(why)),
        None => (fact, hint),
    };
    Fault { hint, ..json.fault_at(offset, code::EXPRESSION, format!("{fact}, at {position} of the {noun}")) }
}
