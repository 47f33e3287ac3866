//! Controls: named values, which params can refer to and expressions read as numbers and vectors.

use std::sync::Arc;

use jsonc_parser::ast::Value as Ast;

use super::keyframes::{Keys, keys};
use crate::expr::{RESERVED, Width};
use crate::graph::fault::{Fault, code};
use crate::graph::json::{Entry, Json, find, keep, refuse_unknown};
use crate::param::{Keyframes, Shape, Source, Value};

/// The controls of a graph.
pub(super) struct Controls<'a> {
    all: Vec<Control<'a>>,
    /// Names and widths of the controls that expressions may read.
    pub(super) scope: Vec<(&'a str, Width)>,
    /// Their sources, in the same order.
    pub(super) sources: Arc<Vec<Source>>,
}

struct Control<'a> {
    name: &'a str,
    json: Json<'a>,
    is_valid: bool,
    /// Whether expressions may read it.
    is_numeric: bool,
}

/// The result of looking up a control by name.
pub(super) enum Lookup<'c, 'a> {
    /// Its value.
    Value(&'c Json<'a>),
    /// It exists and its fault is already reported.
    Faulty,
    /// It does not exist.
    Nothing,
}

impl<'a> Controls<'a> {
    /// Reads what can be checked without knowing which params read a control; literals are checked again by each of
    /// those.
    pub(super) fn read(entries: &[Entry<'a>], faults: &mut Vec<Fault>) -> Self {
        let (mut all, mut scope, mut sources) = (Vec::new(), Vec::new(), Vec::new());
        for entry in entries {
            let Entry { name, json, .. } = entry;
            let before = faults.len();
            if RESERVED.contains(name) {
                let fact = format!("the name `{name}` is reserved in expressions");
                faults.push(
                    entry
                        .fault(code::RESERVED_NAME, fact)
                        .hint(format!("rename the control, for example to `my_{name}`")),
                );
            }
            let numeric = numeric(json, faults);
            let (is_valid, is_numeric) = (faults.len() == before, numeric.is_some());
            all.push(Control { name, json: json.clone(), is_valid, is_numeric });
            if let Some((width, source)) = numeric {
                scope.push((*name, width));
                sources.push(source);
            }
        }
        Self { all, scope, sources: Arc::new(sources) }
    }

    /// Looks a name up.
    pub(super) fn get(&self, name: &str) -> Lookup<'_, 'a> {
        match self.all.iter().find(|control| control.name == name) {
            Some(control) if control.is_valid => Lookup::Value(&control.json),
            Some(_) => Lookup::Faulty,
            None => Lookup::Nothing,
        }
    }

    /// All names.
    pub(super) fn names(&self) -> impl Iterator<Item = &'a str> {
        self.all.iter().map(|control| control.name)
    }

    /// The control named in `fact` that exists but that expressions cannot read, because it is neither a number nor a
    /// vector.
    pub(super) fn unreadable_in(&self, fact: &str) -> Option<&'a str> {
        let unreadable = self.all.iter().filter(|control| !control.is_numeric).map(|control| control.name);
        unreadable.into_iter().find(|name| fact.contains(&format!("`{name}`")))
    }
}

/// The control as expressions read it: a scalar or a vector. `None` if it is something else or has a fault.
fn numeric<'a>(json: &Json<'a>, faults: &mut Vec<Fault>) -> Option<(Width, Source)> {
    let Ast::Object(_) = json.value else {
        if matches!(json.value, Ast::NullKeyword(_)) {
            faults.push(json.unexpected("a value, or {\"keyframes\": [[frame, value], …]}"));
        }
        let value = number_or_vector(json, faults)?;
        return Some((width(&value), Source::Constant(value)));
    };
    let members = json.members("", faults);
    let entries = keep(members, faults)?;
    if find(&entries, "ramp").is_some() {
        return None;
    }
    let Some(list) = find(&entries, "keyframes") else {
        let fault = json.fault(code::PARAM_FORM, "the object is not a value that a control can have");
        faults.push(fault.hint("expected a literal, or an object with `keyframes` or `ramp`"));
        return None;
    };
    refuse_unknown(&entries, &["keyframes", "interpolation"], "allowed keys", faults);
    let Keys { keys, interpolation } = keys(&list.json, find(&entries, "interpolation"), faults)?;
    let values: Vec<Option<Value>> = keys.iter().map(|(_, json)| number_or_vector(json, faults)).collect();
    let values: Vec<Value> = values.into_iter().collect::<Option<_>>()?;
    let width = width(values.first()?);
    let shape = if width == Width::Vec3 { Shape::Vec3 } else { Shape::Float };
    if values.iter().any(|value| matches!(value, Value::Vec3(_)) != (width == Width::Vec3)) {
        return None;
    }
    let keys = keys.iter().zip(values).map(|((frame, _), value)| (*frame, value)).collect();
    Some((width, Source::Keys(Arc::new(Keyframes { keys, interpolation }), shape)))
}

fn width(value: &Value) -> Width {
    if matches!(value, Value::Vec3(_)) { Width::Vec3 } else { Width::Scalar }
}

/// A number, a boolean or a vector of three numbers; `None` for anything else, which is not a fault by itself.
fn number_or_vector(json: &Json<'_>, faults: &mut Vec<Fault>) -> Option<Value> {
    match json.value {
        Ast::NumberLit(_) => Some(Value::Float(keep(json.number("a number"), faults)?)),
        Ast::BooleanLit(word) => Some(Value::Bool(word.value)),
        Ast::Array(list) if list.elements.len() == 3 => {
            let mut vector = [0.0; 3];
            for (index, item) in list.elements.iter().enumerate() {
                let Ast::NumberLit(_) = item else { return None };
                vector[index] = keep(json.item(item, index).number("a number"), faults)?;
            }
            Some(Value::Vec3(vector))
        }
        _ => None,
    }
}
