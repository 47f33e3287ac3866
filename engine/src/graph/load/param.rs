//! Params: the form in which a value is written, and the source made from it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use crate::param::mixed_seed;
use jsonc_parser::ast::Value as Ast;
use jsonc_parser::common::Ranged;

use super::FileProbe;
use super::control::{Controls, Lookup};
use super::document::missing;
use super::expression;
use super::form::not_a_form;
use super::keyframes::{Keys, interpolation, keys};
use super::literal::{literal, ramp};
use crate::files::unreadable;
use crate::graph::Scene;
use crate::graph::fault::{Fault, FaultClass, code};
use crate::graph::json::{Entry, Json, did_you_mean, find, keep, refuse_unknown, shown};
use crate::node::Node;
use crate::param::{Keyframes, ParamSpec, Shape, Source, Unset, Value, euler_to_turn};
use numerics::ramp::Interpolation;

/// The forms of a value that is an object: it has exactly one of these keys.
const FORMS: [&str; 5] = ["keyframes", "expr", "control", "ramp", "value"];

/// Reads params.
pub(super) struct Reader<'a, 'r> {
    pub(super) scene: &'r Scene,
    pub(super) controls: &'r Controls<'a>,
    pub(super) folder: &'r Path,
    pub(super) files: &'r FileProbe,
    pub(super) faults: &'r mut Vec<Fault>,
    /// Sources read from controls, or their first fault, by control, node type and param. Nodes of one type share them:
    /// with a copy for each node, a small file could require any amount of memory.
    pub(super) read: BTreeMap<(&'a str, &'static str, &'static str), Result<Source, Fault>>,
    /// The type of the node whose params are read.
    pub(super) kind: &'static str,
}

/// Where a value is written; it determines the forms that are allowed.
#[derive(Clone, Copy, PartialEq)]
enum Within {
    /// In a param: all forms.
    Param,
    /// In a control: literals, keyframes, expressions and ramps.
    Control,
    /// In a mask's `value`: all but another mask.
    Mask,
    /// In a key: literals and ramps.
    Key,
}

impl<'a> Reader<'a, '_> {
    /// The sources of a node's params, in the order of its declaration.
    pub(super) fn params(&mut self, node: &Node, specs: &[ParamSpec], entries: &[Entry<'a>]) -> Vec<Source> {
        self.kind = node.name;
        for entry in entries.iter().filter(|entry| !specs.iter().any(|spec| spec.name == entry.name)) {
            let fact = format!("`{}` has no param `{}`", node.name, shown(entry.name));
            let hint = match node.inputs.iter().any(|input| input.spec().name == entry.name) {
                true => Some("it is an input; write it under `inputs`".into()),
                false => did_you_mean(self.faults, entry.name, specs.iter().map(|spec| spec.name), "params"),
            };
            self.faults.push(Fault { hint, ..entry.fault(code::UNKNOWN_PARAM, fact) });
        }
        let source = |spec: &ParamSpec| match find(entries, spec.name) {
            // After a fault the default is used, so that the rest can be checked.
            Some(entry) => self.source(spec, &entry.json).unwrap_or_else(|| self.unset(spec)),
            None => self.unset(spec),
        };
        specs.iter().map(source).collect()
    }

    /// The source of a param that the graph does not set.
    fn unset(&self, spec: &ParamSpec) -> Source {
        match (spec.facts.unset, spec.shape) {
            (Unset::CurrentFrame, _) => Source::CurrentFrame,
            (Unset::CurrentTime, _) => Source::CurrentTime,
            (Unset::SceneStart, Shape::Float) => Source::Constant(Value::Float(self.scene.first as f64)),
            (Unset::SceneStart, _) => Source::Constant(Value::Int(self.scene.first)),
            (Unset::Default, _) => Source::Constant(self.finished(spec.shape, spec.default.clone())),
        }
    }

    /// The source of a param that the graph sets.
    fn source(&mut self, spec: &ParamSpec, json: &Json<'a>) -> Option<Source> {
        let source = self.written(spec, json, Within::Param)?;
        if spec.facts.fixed && source.is_animated() {
            let fault = json.fault(code::NOT_ANIMATED, format!("`{}` cannot be animated", spec.name));
            self.faults.push(fault.hint(format!(
                "expected {} that stays the same: no keyframes, and no expression that reads the time",
                spec.shape.describe()
            )));
            return None;
        }
        Some(source)
    }

    fn written(&mut self, spec: &ParamSpec, json: &Json<'a>, within: Within) -> Option<Source> {
        match (json.value, spec.shape) {
            (_, Shape::Columns) => self.constant(spec, json),
            (Ast::Object(_), _) => self.form(spec, json, within),
            (_, Shape::Code) => expression::code(json, self.controls, self.faults),
            (_, Shape::File) => self.file(json),
            (_, Shape::Ramp) => {
                self.faults.push(bare_ramp(json));
                None
            }
            _ => self.constant(spec, json),
        }
    }

    /// A literal.
    fn constant(&mut self, spec: &ParamSpec, json: &Json<'a>) -> Option<Source> {
        let value = literal(spec.shape, json, self.faults)?;
        let value = self.legal(spec, json, value)?;
        Some(Source::Constant(self.finished(spec.shape, value)))
    }

    /// The value; a fault if the declaration does not allow it.
    fn legal(&mut self, spec: &ParamSpec, json: &Json<'a>, value: Value) -> Option<Value> {
        match spec.refuses(&value) {
            None => Some(value),
            Some((fact, hint)) => {
                self.faults.push(json.fault(code::ILLEGAL_VALUE, fact).hint(hint));
                None
            }
        }
    }

    /// Converts a value as written to what nodes get: rotations from degrees, seeds mixed with the scene's.
    fn finished(&self, shape: Shape, value: Value) -> Value {
        match (shape, value) {
            (Shape::Turn, Value::Vec3(degrees)) => euler_to_turn(degrees),
            (Shape::Seed, Value::Int(seed)) => Value::Int(mixed_seed(self.scene.seed, seed)),
            (_, value) => value,
        }
    }

    /// The source of an object in one of the forms.
    fn form(&mut self, spec: &ParamSpec, json: &Json<'a>, within: Within) -> Option<Source> {
        let members = json.members("", self.faults);
        let entries = keep(members, self.faults)?;
        let form = self.form_among(spec, json, &entries, within)?;
        match form.name {
            "keyframes" => self.keyed(spec, &form.json, find(&entries, "interpolation")),
            "ramp" => {
                let between = interpolation(find(&entries, "interpolation"), self.faults);
                let ramp = ramp(&form.json, between.unwrap_or_default(), self.faults)?;
                let value = self.legal(spec, &form.json, Value::Ramp(Arc::new(ramp)))?;
                between.map(|_| Source::Constant(value))
            }
            "value" => self.mask(spec, json, &form.json, find(&entries, "attribute")),
            "control" => self.controlled(spec, &form.json, json),
            _ => {
                let source = expression::read(spec, &form.json, self.controls, self.scene, self.faults)?;
                let Source::Constant(value) = source else { return Some(source) };
                let value = self.legal(spec, &form.json, value)?;
                Some(Source::Constant(self.finished(spec.shape, value)))
            }
        }
    }

    /// The one member that sets the value; a fault if there is none or more than one, or if other keys do not belong
    /// beside it.
    fn form_among<'e>(
        &mut self,
        spec: &ParamSpec,
        json: &Json<'a>,
        entries: &'e [Entry<'a>],
        within: Within,
    ) -> Option<&'e Entry<'a>> {
        let forms: Vec<&Entry<'a>> = entries.iter().filter(|entry| FORMS.contains(&entry.name)).collect();
        let form = match forms[..] {
            [form] => form,
            [] => {
                let forms: Vec<&str> = FORMS.into_iter().filter(|form| accepts(spec.shape, form, within)).collect();
                self.faults.push(not_a_form(json, entries, &spec.shape.describe(), &forms));
                return None;
            }
            [first, second, ..] => {
                let fact = format!("both `{}` and `{}` set the value", first.name, second.name);
                self.faults.push(second.fault(code::PARAM_FORM, fact).hint("remove one of them"));
                return None;
            }
        };
        if !accepts(spec.shape, form.name, within) {
            let is_mask = form.name == "value" && find(entries, "attribute").is_some();
            let fact = match is_mask {
                true => format!("`{}` cannot be masked by an attribute", spec.name),
                false => format!("`{}` cannot be set by `{}`", spec.name, form.name),
            };
            let fault = form.fault(code::PARAM_FORM, fact);
            self.faults.push(match spec.shape {
                Shape::File => fault.hint("expected a path, in which `####` is replaced by the frame number"),
                shape => fault.hint(format!("expected {}", shape.describe())),
            });
            return None;
        }
        if accepts(spec.shape, "value", within)
            && form.name != "value"
            && let Some(attribute) = find(entries, "attribute")
        {
            let fact = format!("`attribute` cannot be combined with `{}`", form.name);
            let hint = format!("write a mask as {{\"value\": {{\"{}\": …}}, \"attribute\": \"…\"}}", form.name);
            self.faults.push(attribute.fault(code::PARAM_FORM, fact).hint(hint));
            return None;
        }
        let partner = match form.name {
            "keyframes" | "ramp" => Some("interpolation"),
            "value" => Some("attribute"),
            _ => None,
        };
        let known: Vec<&str> = std::iter::once(form.name).chain(partner).collect();
        refuse_unknown(entries, &known, "allowed keys", self.faults);
        Some(form)
    }

    /// Keyframes. If all have the same value, the source is constant.
    fn keyed(&mut self, spec: &ParamSpec, json: &Json<'a>, between: Option<&Entry<'a>>) -> Option<Source> {
        let Keys { keys, interpolation } = keys(json, between, self.faults)?;
        let values: Vec<Option<(f64, Value)>> =
            keys.iter().map(|(frame, json)| Some((*frame, self.key(spec, json)?))).collect();
        let values: Vec<(f64, Value)> = values.into_iter().collect::<Option<_>>()?;
        // Seeds cannot be interpolated.
        let interpolation = if spec.shape == Shape::Seed { Interpolation::Constant } else { interpolation };
        if interpolation != Interpolation::Constant {
            for (pair, (_, json)) in values.windows(2).zip(&keys[1..]) {
                let Some([before, own]) = pair[0].1.different_lengths(&pair[1].1) else { continue };
                let fact = format!("the list has length {own}, that of the key at frame {} length {before}", pair[0].0);
                let hint = "rows are interpolated one by one: write as many in each key, or set `interpolation` to \"constant\"";
                self.faults.push(json.fault(code::KEYFRAMES_LENGTHS, fact).hint(hint));
                return None;
            }
        }
        let keys = values;
        let source = Source::Keys(Arc::new(Keyframes { keys, interpolation }), spec.shape);
        match source.is_animated() {
            true => Some(source),
            false => Some(Source::Constant(source.at(self.scene.first as f64, self.scene.clock()))),
        }
    }

    /// The value of one key. Rotations stay in degrees, so that keys can be more than a full turn apart.
    fn key(&mut self, spec: &ParamSpec, json: &Json<'a>) -> Option<Value> {
        if spec.shape == Shape::Ramp && json.is_object() {
            return match self.form(spec, json, Within::Key)? {
                Source::Constant(value) => Some(value),
                _ => None,
            };
        }
        let value = literal(spec.shape, json, self.faults)?;
        let value = self.legal(spec, json, value)?;
        Some(if spec.shape == Shape::Seed { self.finished(spec.shape, value) } else { value })
    }

    /// A number scaled by an attribute.
    fn mask(
        &mut self,
        spec: &ParamSpec,
        json: &Json<'a>,
        value: &Json<'a>,
        attribute: Option<&Entry<'a>>,
    ) -> Option<Source> {
        let source = self.written(spec, value, Within::Mask);
        let Some(attribute) = attribute else {
            self.faults.push(missing(json, "attribute", "add it, or write the value without the object"));
            return None;
        };
        let Some(name) = attribute.json.string().filter(|name| !name.is_empty()) else {
            self.faults.push(attribute.json.unexpected("the name of an attribute"));
            return None;
        };
        Some(match source? {
            Source::Constant(value) => Source::Constant(Value::Masked(value.number(), Some(name.into()))),
            source => Source::Masked(Box::new(source), name.into()),
        })
    }

    /// The value of a control, read as if it were written here.
    fn controlled(&mut self, spec: &ParamSpec, name: &Json<'a>, reader: &Json<'a>) -> Option<Source> {
        let Some(text) = name.string() else {
            self.faults.push(name.unexpected("the name of a control"));
            return None;
        };
        match self.controls.get(text) {
            Lookup::Value(value) => {
                let key = (text, self.kind, spec.name);
                match self.read.get(&key) {
                    Some(Ok(source)) => return Some(source.clone()),
                    Some(Err(fault)) => {
                        self.faults.push(Fault { path: reader.path(), ..fault.clone() });
                        return None;
                    }
                    None => {}
                }
                let value = value.at_path(&reader.path());
                let before = self.faults.len();
                let source = self.written(spec, &value, Within::Control);
                self.faults[before..]
                    .iter_mut()
                    .for_each(|fault| fault.fact += &format!(", in the control `{}`", shown(text)));
                // A remark is no reason to do without the value.
                let read = match self.faults[before..].iter().find(|fault| fault.class != FaultClass::Note) {
                    Some(fault) => Err(fault.clone()),
                    None => Ok(source.clone()?),
                };
                self.read.insert(key, read);
                source
            }
            Lookup::Faulty => None,
            Lookup::Nothing => {
                let fault = name.fault(code::UNKNOWN_CONTROL, format!("there is no control `{}`", shown(text)));
                let hint = match self.controls.names().next() {
                    Some(_) => did_you_mean(self.faults, text, self.controls.names(), "controls"),
                    None => Some("add it to `controls`".into()),
                };
                self.faults.push(Fault { hint, ..fault });
                None
            }
        }
    }

    /// A path. A file without `#` must be readable at load; numbered files are opened at their frames.
    fn file(&mut self, json: &Json<'a>) -> Option<Source> {
        let Some(text) = json.string() else {
            self.faults.push(json.unexpected("a path, relative to the graph file"));
            return None;
        };
        if text.is_empty() {
            self.faults
                .push(json.fault(code::ILLEGAL_VALUE, "the path is empty").hint("to read no file, leave the key out"));
            return None;
        }
        let (path, numbered) = (self.folder.join(text), text.contains('#'));
        if let (false, Err(error)) = (numbered, (self.files)(&path)) {
            let missing = error.kind() == std::io::ErrorKind::NotFound;
            let code = if missing { code::FILE_MISSING } else { code::FILE_UNREADABLE };
            let error = unreadable(&path, &error);
            self.faults.push(Fault { hint: error.hint, ..json.fault(code, error.fact).of_file() });
            return None;
        }
        Some(Source::File { path: path.into(), numbered })
    }
}

/// Whether a param of that shape accepts a form there.
fn accepts(shape: Shape, form: &str, within: Within) -> bool {
    match form {
        "keyframes" => !matches!(shape, Shape::File | Shape::Code) && within != Within::Key,
        "ramp" => shape == Shape::Ramp,
        "value" => shape == Shape::Masked && within == Within::Param,
        "expr" => shape.expressions().is_some() && within != Within::Key,
        _ => matches!(within, Within::Param | Within::Mask),
    }
}

/// The fault of ramp keys that are not in an object.
fn bare_ramp(json: &Json<'_>) -> Fault {
    let fault = json.unexpected(&Shape::Ramp.describe());
    let range = json.value.range();
    match &json.text.content[range.start..range.end] {
        _ if !matches!(json.value, Ast::Array(_) | Ast::NumberLit(_)) => fault,
        text if json.elements().is_none() => {
            fault.hint(format!("write a constant ramp as {{\"ramp\": [[0, {}]]}}", shown(text)))
        }
        text if text.len() <= 60 && !text.contains(char::is_control) => {
            fault.hint(format!("write {{\"ramp\": {text}}}"))
        }
        _ => fault.hint("put the keys into an object: {\"ramp\": …}"),
    }
}
