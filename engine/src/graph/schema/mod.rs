//! The JSON Schema of graph files, for editors. It is derived from a catalogue, so that it agrees with `check`.
//!
//! Promise: a graph that loads is valid under the schema, except for keyframes with a single value on a param that
//! cannot be animated. Limit: a schema cannot check relations between parts (wires to missing nodes, cycles, order of
//! keys), expressions and files. `allowComments` and `allowTrailingCommas` are read by some editors only.

mod param;

use serde_json::{Map, Value, json};

use self::param::{any_of, described};
use super::Catalogue;
use crate::expr::RESERVED;
use crate::node::{Arity, InputSpec, Node};
use crate::time::Frame;

/// The pattern of ids and names.
const NAME: &str = "^[A-Za-z_][A-Za-z0-9_-]*$";
/// The pattern of an id with an optional output.
const LINK: &str = "^[A-Za-z_][A-Za-z0-9_-]*(\\.[A-Za-z0-9_]+)?$";

const BYPASS: &str = "Whether the node is skipped: it passes on the first input that has the components of its output.";

/// The schema (draft 2020-12) of graphs whose nodes are of the catalogue's types.
pub fn schema(catalogue: Catalogue) -> Value {
    let mut definitions = shared_definitions();
    for node in catalogue.nodes() {
        definitions.insert(node.name.into(), node_schema(node));
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "convect graph",
        // Read by editors that use the schema for plain JSON files.
        "allowComments": true,
        "allowTrailingCommas": true,
        "description": "Nodes that make geometry move, their wires, and the outputs to write.",
        "type": "object",
        "required": ["convect", "nodes", "outputs"],
        "additionalProperties": false,
        "properties": {
            "$schema": {"type": "string"},
            "convect": described(json!({"const": 1}), "The format number."),
            "scene": scene(),
            "controls": {
                "description": "Named values, which params and expressions read.",
                "type": "object",
                "propertyNames": {"pattern": NAME, "not": {"enum": RESERVED}},
                "additionalProperties": {"$ref": "#/$defs/control-value"},
            },
            "nodes": {
                "description": "The nodes, by id.",
                "type": "object",
                "propertyNames": {"pattern": NAME},
                "additionalProperties": {"$ref": "#/$defs/node"},
            },
            "outputs": {
                "description": "The outputs to write, by the name of their file.",
                "type": "object",
                "minProperties": 1,
                "propertyNames": {"pattern": NAME},
                "additionalProperties": {"$ref": "#/$defs/output"},
            },
        },
        "$defs": with_node(definitions, catalogue),
    })
}

/// Settings of the whole graph.
fn scene() -> Value {
    let frame = json!({"type": "integer", "minimum": -Frame::LIMIT, "maximum": Frame::LIMIT});
    json!({
        "description": "Settings of the whole graph.",
        "type": "object",
        "additionalProperties": false,
        "properties": {
            "frames": {
                "description": "First and last frame.",
                "type": "array", "items": frame, "minItems": 2, "maxItems": 2, "default": [1, 1],
            },
            "fps": {"description": "Frames per second.", "type": "number", "exclusiveMinimum": 0, "default": 24},
            "seed": {"description": "Mixed into every node's seed.", "type": "integer", "default": 0},
            "origin": {
                "description": "The point that positions are relative to, in metres.",
                "type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3, "default": [0, 0, 0],
            },
        },
    })
}

/// Definitions that all catalogues share. Their names start with a small letter, so no node type has the same name.
fn shared_definitions() -> Map<String, Value> {
    let expression = json!({"type": "string", "minLength": 1});
    let expressions = |count: usize| {
        let items = json!({"anyOf": [expression, {"type": "number"}]});
        let list = json!({"type": "array", "items": items, "minItems": count, "maxItems": count});
        let exprs = match count {
            1 => expression.clone(),
            2 => list,
            _ => any_of(vec![expression.clone(), list]),
        };
        param::form("expr", exprs, "", &[])
    };
    let pair = json!({"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2});
    let interpolation = json!({
        "oneOf": [
            {"const": "linear", "description": "Straight lines between keys."},
            {"const": "smooth", "description": "A smoothstep between keys."},
            {"const": "constant", "description": "Constant until the next key."},
        ],
        "default": "linear",
    });
    let key = param::key(&json!(true));
    let list = json!({
        "link": {"description": "A node, or one of its outputs.", "type": "string", "pattern": LINK},
        "expressions-1": expressions(1),
        "expressions-2": expressions(2),
        "expressions-3": expressions(3),
        "control": param::form("control", json!({"type": "string", "pattern": NAME}), "The control's value.", &[]),
        "interpolation": interpolation,
        "ramp-keys": {"description": "[[x, y], …], x increasing.", "type": "array", "items": pair, "minItems": 1},
        "ramp": param::form("ramp", json!({"$ref": "#/$defs/ramp-keys"}), "A curve over 0…1.", &["interpolation"]),
        "control-value": any_of(vec![
            json!({"type": ["number", "string", "boolean", "array"]}),
            param::keyframes(&key),
            json!({"$ref": "#/$defs/expressions-3"}),
            json!({"$ref": "#/$defs/ramp"}),
        ]),
        "written": any_of(vec![
            json!({"$ref": "#/$defs/link"}),
            json!({
                "type": "object",
                "required": ["from"],
                "additionalProperties": false,
                "properties": {
                    "from": {"$ref": "#/$defs/link"},
                    "attributes": {
                        "description": "The attributes to write; all if left out.",
                        "type": "array", "items": {"type": "string", "minLength": 1},
                    },
                    "v": {
                        "description": "Whether to write velocities `v`: those of the node where it has some, otherwise \
                            the difference between a moment before and one after, divided by the time between. They are \
                            whole frames apart behind a solver, and the frame after the last is cooked too.",
                        "type": "boolean", "default": false,
                    },
                },
            }),
        ]),
        "output": any_of(vec![
            json!({"$ref": "#/$defs/written"}),
            json!({
                "description": "Outputs in one USD stage, each a prim of its own.",
                "type": "array", "items": {"$ref": "#/$defs/written"}, "minItems": 1, "uniqueItems": true,
            }),
        ]),
    });
    match list {
        Value::Object(list) => list,
        _ => Map::new(),
    }
}

/// The definitions, and that of a node of any type, which selects one of them by the node's `type`.
fn with_node(mut definitions: Map<String, Value>, catalogue: Catalogue) -> Map<String, Value> {
    let types: Vec<Value> =
        catalogue.nodes().map(|node| json!({"const": node.name, "description": node.summary()})).collect();
    let by_type: Vec<Value> = catalogue
        .nodes()
        .map(|node| {
            json!({
                "if": {"required": ["type"], "properties": {"type": {"const": node.name}}},
                "then": {"$ref": format!("#/$defs/{}", node.name)},
            })
        })
        .collect();
    let node = json!({
        "type": "object",
        "required": ["type"],
        "properties": {"type": {"oneOf": types}, "inputs": {"type": "object"}, "params": {"type": "object"}},
        "allOf": by_type,
    });
    definitions.insert("node".into(), node);
    definitions
}

/// A node of one type.
fn node_schema(node: &Node) -> Value {
    let params: Map<String, Value> =
        node.param_specs().iter().map(|spec| (spec.name.into(), param::param(spec))).collect();
    let inputs = node.input_specs();
    let needed: Vec<&str> = inputs.iter().filter(|input| is_required(input)).map(|input| input.name).collect();
    let required = if needed.is_empty() { json!(["type"]) } else { json!(["type", "inputs"]) };
    let inputs: Map<String, Value> = inputs.iter().map(|spec| (spec.name.into(), input(spec))).collect();
    json!({
        "description": node.help,
        "type": "object",
        "required": required,
        "additionalProperties": false,
        "properties": {
            "type": {"const": node.name},
            "inputs": {"type": "object", "required": needed, "additionalProperties": false, "properties": inputs},
            "params": {"type": "object", "additionalProperties": false, "properties": params},
            "bypass": described(json!({"type": "boolean", "default": false}), BYPASS),
            "note": described(json!({"type": "string"}), "A note, which convect does not read."),
        },
    })
}

fn is_required(input: &InputSpec) -> bool {
    matches!(input.arity, Arity::One | Arity::Many { least: 1.. })
}

fn input(spec: &InputSpec) -> Value {
    let link = json!({"$ref": "#/$defs/link"});
    let schema = match spec.arity {
        Arity::One | Arity::Optional => link,
        Arity::Many { least } => any_of(vec![link.clone(), json!({"type": "array", "items": link, "minItems": least})]),
    };
    described(schema, spec.help)
}
