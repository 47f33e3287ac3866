//! `{"expr": …}`, with one expression for each component of the param, and code, which is assignments in the same
//! language. Expressions that do not depend on time become constants.

use std::sync::Arc;

use super::control::Controls;
use crate::expr::{Expr, ExprError, Program, Scope};
use crate::graph::Scene;
use crate::graph::fault::{Fault, code};
use crate::graph::json::{Json, keep, shown};
use crate::note::kind;
use crate::param::{CodeSource, ParamSpec, Shape, Source, Value};

/// The source for a param's expressions, constant if they do not depend on time. `None` after a fault, and for a shape
/// that cannot be an expression.
pub(super) fn read(
    spec: &ParamSpec,
    json: &Json<'_>,
    controls: &Controls<'_>,
    scene: &Scene,
    faults: &mut Vec<Fault>,
) -> Option<Source> {
    let texts = texts(json, spec.shape.expressions()?, faults)?;
    let parsed: Vec<Option<Expr>> = texts.iter().map(|text| parse(text, controls, faults)).collect();
    let exprs: Vec<Expr> = parsed.into_iter().collect::<Option<_>>()?;

    let frame = scene.first as f64;
    let mut valid = true;
    for (text, expr) in texts.iter().zip(&exprs) {
        let number = Source::Exprs(Arc::new(vec![expr.clone()]), Shape::Float, controls.sources.clone());
        if let (false, Value::Float(x)) = (number.is_animated(), number.at(frame, scene.clock()))
            && !x.is_finite()
        {
            let fault = text.fault(code::ILLEGAL_VALUE, format!("the value of the expression is {x}"));
            faults.push(fault.hint("expected a finite number"));
            valid = false;
        }
    }
    if spec.is_in_degrees() {
        for (text, _) in texts.iter().zip(&exprs).filter(|(_, expr)| expr.has_pi_as_term()) {
            let fact = format!("the expression is a multiple of `pi`, but `{}` is in degrees", spec.name);
            let hint = "Write 180 instead of `pi`, or degrees(…) around an angle in radians.";
            faults.push(text.fault(kind::PI_IN_DEGREES, fact).hint(hint).into_remark());
        }
    }
    let source = Source::Exprs(Arc::new(exprs), spec.shape, controls.sources.clone());
    let source = if source.is_animated() { source } else { Source::Constant(source.at(frame, scene.clock())) };
    valid.then_some(source)
}

/// The source for code: assignments, with the controls in scope. `None` after a fault.
pub(super) fn code(json: &Json<'_>, controls: &Controls<'_>, faults: &mut Vec<Fault>) -> Option<Source> {
    let Some(text) = json.string() else {
        faults.push(json.unexpected(&Shape::Code.describe()));
        return None;
    };
    match Program::parse(text, &Scope { controls: &controls.scope }) {
        Ok(program) => Some(Source::Code(CodeSource::new(text, program, controls.sources.clone()))),
        Err(errors) => {
            faults.extend(errors.into_iter().map(|error| explain(json, text, "code", controls, error)));
            None
        }
    }
}

/// The JSON strings of the expressions.
fn texts<'a>(json: &Json<'a>, count: usize, faults: &mut Vec<Fault>) -> Option<Vec<Json<'a>>> {
    if count == 1 {
        if json.string().is_none() {
            faults.push(json.unexpected("an expression in quotes"));
        }
        return json.string().map(|_| vec![json.clone()]);
    }
    let Some(items) = json.elements().filter(|items| items.len() == count) else {
        let expressions = vec!["\"…\""; count].join(", ");
        faults.push(json.unexpected(&format!("{count} expressions [{expressions}]")));
        return None;
    };
    let texts: Vec<Json<'a>> = items.iter().enumerate().map(|(index, item)| json.item(item, index)).collect();
    let no_text = |text: &&Json<'a>| text.string().is_none();
    let before = faults.len();
    faults.extend(texts.iter().filter(no_text).map(|text| text.unexpected("an expression in quotes")));
    (faults.len() == before).then_some(texts)
}

fn parse(json: &Json<'_>, controls: &Controls<'_>, faults: &mut Vec<Fault>) -> Option<Expr> {
    let text = json.string()?;
    let parsed = Expr::parse(text, &Scope { controls: &controls.scope });
    keep(parsed.map_err(|error| explain(json, text, "expression", controls, error)), faults)
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
    let hint = match controls.unreadable_in(&fact) {
        Some(name) => Some(format!(
            "the control `{}` is neither a number nor a vector, so expressions cannot read it",
            shown(name)
        )),
        None => hint,
    };
    Fault { hint, ..json.fault_at(offset, code::EXPRESSION, format!("{fact}, at {position} of the {noun}")) }
}
