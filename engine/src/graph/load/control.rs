//! Controls: named values, which params can refer to and expressions read as numbers and vectors.

use std::sync::Arc;

use jsonc_parser::ast::Value as Ast;

use super::expression;
use super::form::not_a_form;
use super::keyframes::{Keys, keys};
use crate::expr::{RESERVED, Width};
use crate::graph::Scene;
use crate::graph::fault::{Fault, code};
use crate::graph::json::{Entry, Json, find, keep, refuse_unknown, shown};
use crate::param::{ControlTable, ControlValue, Keyframes, Shape, Source, Value};

/// The controls of a graph.
pub(super) struct Controls<'a> {
    all: Vec<Control<'a>>,
    /// Names and widths of the controls that expressions may read.
    pub(super) scope: Vec<(&'a str, Width)>,
    /// Their values, in the same order.
    pub(super) table: Arc<ControlTable>,
    /// Those that are not read yet, the one that is being read first.
    unread: Vec<&'a str>,
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
    pub(super) fn read(entries: &[Entry<'a>], scene: &Scene, faults: &mut Vec<Fault>) -> Self {
        let unread = entries.iter().rev().map(|entry| entry.name).collect();
        let mut read = Self { all: Vec::new(), scope: Vec::new(), table: Arc::default(), unread };
        let mut table = ControlTable::default();
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
            let numeric = numeric(json, &read, &table, scene, faults);
            let (is_valid, is_numeric) = (faults.len() == before, numeric.is_some());
            read.all.push(Control { name, json: json.clone(), is_valid, is_numeric });
            if let Some((width, value)) = numeric {
                read.scope.push((*name, width));
                table.push(value, width);
            }
            read.unread.pop();
        }
        read.table = Arc::new(table);
        read
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

    /// What is wrong, and why, where an expression's `unknown name` is that of a control.
    pub(super) fn why_unreadable(&self, fact: &str) -> Option<(String, String)> {
        let is_named = |name: &&str| fact == format!("unknown name `{name}`");
        let mut others = self.all.iter().filter(|control| !control.is_numeric);
        let (name, why) = match others.find(|control| is_named(&control.name)) {
            Some(control) if control.is_valid => (control.name, "it is neither a number nor a vector".into()),
            Some(control) => (control.name, "it has a fault of its own".into()),
            None => {
                let name = self.unread.iter().rfind(|name| is_named(name))?;
                let why = match self.unread.last() == Some(name) {
                    true => "a control can use the controls before it, not itself".into(),
                    false => format!("a control can use the controls before it; move `{}` up", shown(name)),
                };
                (*name, why)
            }
        };
        Some((format!("the control `{}` cannot be used here", shown(name)), why))
    }
}

/// The control as expressions read it: a scalar or a vector. `None` if it is something else or has a fault.
fn numeric<'a>(
    json: &Json<'a>,
    before: &Controls<'_>,
    table: &ControlTable,
    scene: &Scene,
    faults: &mut Vec<Fault>,
) -> Option<(Width, ControlValue)> {
    let Ast::Object(_) = json.value else {
        if matches!(json.value, Ast::NullKeyword(_)) {
            faults.push(json.unexpected("a value, or {\"keyframes\": [[frame, value], …]}"));
        }
        let value = number_or_vector(json, faults)?;
        return Some((width(&value), ControlValue::Source(Source::Constant(value))));
    };
    let members = json.members("", faults);
    let entries = keep(members, faults)?;
    let forms: Vec<&Entry<'a>> = entries.iter().filter(|entry| FORMS.contains(&entry.name)).collect();
    match forms[..] {
        [] => faults.push(not_a_form(json, &entries, "a literal", &FORMS)),
        [form] if form.name == "keyframes" => return keyed(form, &entries, faults),
        [form] if form.name == "expr" => {
            refuse_unknown(&entries, &["expr"], "allowed keys", faults);
            return expression::control(&form.json, before, table, scene, faults);
        }
        // Ramps and what is wrong with them are left to the params that read them.
        _ => {}
    }
    None
}

/// The forms of a control that is an object.
const FORMS: [&str; 3] = ["keyframes", "expr", "ramp"];

/// Keyframes of numbers or vectors.
fn keyed<'a>(list: &Entry<'a>, entries: &[Entry<'a>], faults: &mut Vec<Fault>) -> Option<(Width, ControlValue)> {
    refuse_unknown(entries, &["keyframes", "interpolation"], "allowed keys", faults);
    let Keys { keys, interpolation } = keys(&list.json, find(entries, "interpolation"), faults)?;
    let values: Vec<Option<Value>> = keys.iter().map(|(_, json)| number_or_vector(json, faults)).collect();
    let values: Vec<Value> = values.into_iter().collect::<Option<_>>()?;
    let width = width(values.first()?);
    let shape = if width == Width::Vec3 { Shape::Vec3 } else { Shape::Float };
    if values.iter().any(|value| matches!(value, Value::Vec3(_)) != (width == Width::Vec3)) {
        return None;
    }
    let keys = keys.iter().zip(values).map(|((frame, _), value)| (*frame, value)).collect();
    Some((width, ControlValue::Source(Source::Keys(Arc::new(Keyframes { keys, interpolation }), shape))))
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
