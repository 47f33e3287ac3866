//! The schema of one param: its literals with their ranges, and the other forms of its value.

use serde_json::{Map, Value as Json, json};

use crate::geometry::Name;
use crate::param::{Bounds, ParamSpec, Shape, Unit, Unset, Value};

/// A schema with a description.
pub(super) fn described(mut schema: Json, text: &str) -> Json {
    if !text.is_empty() {
        schema["description"] = json!(text);
    }
    schema
}

/// A schema that accepts what one of `schemas` accepts.
pub(super) fn any_of(mut schemas: Vec<Json>) -> Json {
    if schemas.len() == 1 { schemas.swap_remove(0) } else { json!({"anyOf": schemas}) }
}

/// An object that sets a value by the key `key`, with optional keys beside it.
pub(super) fn form(key: &str, value: Json, help: &str, beside: &[&str]) -> Json {
    let mut properties = Map::from_iter([(key.to_owned(), value)]);
    properties.extend(beside.iter().map(|name| ((*name).to_owned(), json!({"$ref": format!("#/$defs/{name}")}))));
    let object = json!({"type": "object", "required": [key], "additionalProperties": false, "properties": properties});
    described(object, help)
}

/// One key of keyframes, given the schema of its value.
pub(super) fn key(value: &Json) -> Json {
    json!({"type": "array", "prefixItems": [{"type": "number"}, value], "minItems": 2, "items": false})
}

/// Keyframes, given the schema of a key.
pub(super) fn keyframes(key: &Json) -> Json {
    let list =
        json!({"description": "[[frame, value], …], frames increasing.", "type": "array", "items": key, "minItems": 1});
    form("keyframes", list, "", &["interpolation"])
}

/// The schema of a param.
pub(super) fn param(spec: &ParamSpec) -> Json {
    let literal = literal(spec);
    // Attributes are an object themselves, so it could not be distinguished from a form.
    let schema = match spec.shape {
        Shape::Columns => literal,
        _ => any_of(with_forms(spec, literal)),
    };
    let mut schema = described(schema, &help(spec));
    if let (Unset::Default, Some(default)) = (spec.facts.unset, default(spec)) {
        schema["default"] = default;
    }
    schema
}

/// The literal and the other forms of the value.
fn with_forms(spec: &ParamSpec, literal: Json) -> Vec<Json> {
    let mut moving = Vec::new();
    if !spec.facts.fixed && !matches!(spec.shape, Shape::File | Shape::Code) {
        let value = match spec.shape {
            Shape::Ramp => any_of(vec![json!({"$ref": "#/$defs/ramp-keys"}), literal.clone()]),
            _ => literal.clone(),
        };
        moving.push(keyframes(&key(&value)));
    }
    if let Some(count) = spec.shape.expressions() {
        moving.push(json!({"$ref": format!("#/$defs/expressions-{count}")}));
    }
    moving.push(json!({"$ref": "#/$defs/control"}));
    let mut forms = vec![literal];
    forms.append(&mut moving);
    if spec.shape == Shape::Masked {
        let mask = json!({
            "description": "A number scaled by a point attribute.",
            "type": "object",
            "required": ["value", "attribute"],
            "additionalProperties": false,
            "properties": {"value": any_of(forms.clone()), "attribute": {"type": "string", "minLength": 1}},
        });
        forms.push(mask);
    }
    forms
}

/// Help, unit, usual range, and a default that depends on the scene.
fn help(spec: &ParamSpec) -> String {
    let mut text = spec.help.to_owned();
    // A frame number is not an amount.
    if !matches!(spec.facts.unit, Unit::None | Unit::Frame) {
        text += &format!(" In {}.", spec.facts.unit.sign());
    }
    if let Some([low, high]) = spec.facts.soft {
        text += &format!(" Usually {low}…{high}.");
    }
    if spec.facts.unset != Unset::Default {
        text += &format!(" Default: {}.", spec.default_text());
    }
    text
}

/// The schema of a literal.
fn literal(spec: &ParamSpec) -> Json {
    let number = || ranged("number", spec.facts.hard);
    let whole = || ranged("integer", spec.facts.hard);
    let tuple =
        |items: Json, count: usize| json!({"type": "array", "items": items, "minItems": count, "maxItems": count});
    let list = |items: Json| json!({"type": "array", "items": items});
    match spec.shape {
        Shape::Float | Shape::Masked => number(),
        Shape::Int | Shape::Seed => whole(),
        Shape::Bool => json!({"type": "boolean"}),
        Shape::Vec2 | Shape::Span => tuple(number(), 2),
        Shape::Vec3 | Shape::Turn => {
            let mut vector = tuple(number(), 3);
            if spec.facts.direction {
                vector["not"] = json!({"items": {"const": 0}});
            }
            vector
        }
        Shape::Int3 => tuple(whole(), 3),
        Shape::Choice(options) => {
            let words: Vec<Json> =
                options.iter().map(|option| json!({"const": option.word, "description": option.help})).collect();
            json!({"oneOf": words})
        }
        Shape::Ramp => json!({"$ref": "#/$defs/ramp"}),
        Shape::Text | Shape::Code => json!({"type": "string"}),
        Shape::Texts => list(json!({"type": "string"})),
        Shape::File => json!({"type": "string", "minLength": 1}),
        Shape::Vec3s => list(tuple(json!({"type": "number"}), 3)),
        Shape::Ints => list(json!({"type": "integer", "minimum": i32::MIN, "maximum": i32::MAX})),
        Shape::Tets => list(tuple(json!({"type": "integer", "minimum": 0, "maximum": u32::MAX}), 4)),
        Shape::Columns => {
            let vector = json!({"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 4});
            json!({"type": "object", "additionalProperties": list(any_of(vec![json!({"type": "number"}), vector]))})
        }
    }
}

/// A number within its hard range.
fn ranged(kind: &str, bounds: Bounds) -> Json {
    let mut schema = json!({"type": kind});
    if bounds.low.is_finite() {
        schema[if bounds.open { "exclusiveMinimum" } else { "minimum" }] = number(bounds.low);
    }
    if bounds.high.is_finite() {
        schema["maximum"] = number(bounds.high);
    }
    schema
}

/// The default as written in a graph file; `None` if it cannot be written.
fn default(spec: &ParamSpec) -> Option<Json> {
    let numbers = |values: &[f64]| Json::from_iter(values.iter().copied().map(number));
    let texts = |texts: &[Name]| Json::from_iter(texts.iter().map(|text| text.to_string()));
    Some(match (&spec.default, spec.shape) {
        (Value::Float(x) | Value::Masked(x, _), _) => number(*x),
        (Value::Int(i), _) => json!(i),
        (Value::Bool(b), _) => json!(b),
        (Value::Vec2(v) | Value::Span(v), _) => numbers(v),
        (Value::Vec3(v), _) => numbers(v),
        (Value::Int3(v), _) => json!(v),
        // The default of a rotation is always the identity.
        (Value::Turn(_), _) => json!([0, 0, 0]),
        (Value::Choice(index), Shape::Choice(options)) => json!(options.get(*index)?.word),
        (Value::Text(text), _) => json!(&**text),
        (Value::Texts(list), _) => texts(list),
        (Value::Code(code), _) => json!(code.text()),
        (Value::Ramp(ramp), _) => {
            let keys = ramp.keys().iter().map(|key| numbers(&key.map(shortest)));
            json!({"ramp": Json::from_iter(keys), "interpolation": interpolation_word(ramp.interpolation())})
        }
        _ => return None,
    })
}

fn interpolation_word(interpolation: numerics::ramp::Interpolation) -> &'static str {
    use numerics::ramp::Interpolation as I;
    match interpolation {
        I::Linear => "linear",
        I::Smooth => "smooth",
        I::Constant => "constant",
    }
}

/// A number; whole ones are written without a decimal point.
fn number(x: f64) -> Json {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    if x.fract() == 0.0 && x.abs() < EXACT { json!(x as i64) } else { json!(x) }
}

/// The f64 that prints like the f32.
fn shortest(x: f32) -> f64 {
    x.to_string().parse().unwrap_or(f64::from(x))
}
