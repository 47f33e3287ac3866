//! The schema: it accepts every graph that loads and refuses the faults that a schema can express.

use std::sync::LazyLock;

use jsonc_parser::ast::Value as Ast;
use serde_json::{Value, json};

use super::super::fault::code;
use super::super::schema;
use super::super::syntax::parse;
use super::super::text::Text;
use super::CATALOGUE;
use super::faults::cases;
use super::validator;

static SCHEMA: LazyLock<Value> = LazyLock::new(|| schema(CATALOGUE));

/// Plain JSON of JSON with comments; of duplicate keys the first counts.
fn plain(value: &Ast<'_>) -> Value {
    match value {
        Ast::StringLit(text) => json!(text.value),
        Ast::NumberLit(number) => number.value.parse().map_or(Value::Null, Value::Number),
        Ast::BooleanLit(word) => json!(word.value),
        Ast::NullKeyword(_) => Value::Null,
        Ast::Array(list) => list.elements.iter().map(plain).collect(),
        Ast::Object(object) => {
            let members = object.properties.iter().rev();
            Value::Object(members.map(|member| (member.name.as_str().to_owned(), plain(&member.value))).collect())
        }
    }
}

/// The schema's errors for a JSON text.
pub(super) fn refused(text: &str) -> Vec<String> {
    let text = Text::new(text, None);
    let value = plain(&parse(&text).expect("JSON with comments"));
    validator::refused(&SCHEMA, &value)
}

#[test]
fn the_schema_is_a_valid_schema() {
    assert_eq!(validator::faults(&SCHEMA), Vec::<String>::new());
}

#[test]
fn the_schema_refuses_the_faults_that_a_schema_can_express() {
    let seen = [
        code::UNKNOWN_KEY,
        code::MISSING_KEY,
        code::FORMAT,
        code::BAD_NAME,
        code::RESERVED_NAME,
        code::UNKNOWN_TYPE,
        code::UNKNOWN_PARAM,
        code::UNKNOWN_INPUT,
        code::MISSING_INPUT,
        code::TOO_MANY_WIRES,
        code::UNKNOWN_WORD,
        code::PARAM_FORM,
        code::KEYFRAMES_EMPTY,
        code::NO_OUTPUTS,
        code::WRONG_KIND,
        code::ILLEGAL_VALUE,
    ];
    // A schema cannot check values of expressions, the params that read a control, and the order of a range's ends.
    let beyond = [
        "a range with its ends reversed",
        "constant expressions with illegal values",
        "a control that does not fit the params that read it",
        "expressions that are not whole for integer params",
        "a control by an expression that does not fit the params that read it",
    ];
    for case in cases().iter().filter(|case| case.set.is_empty() && !beyond.contains(&case.name)) {
        let codes = case.expected.lines().filter_map(|line| Some(line.split_once(": ")?.0));
        if codes.into_iter().any(|code| seen.contains(&code)) {
            assert!(!refused(case.graph).is_empty(), "{}", case.name);
        }
    }
}

#[test]
fn editors_accept_comments_and_trailing_commas() {
    let schema = schema(CATALOGUE);
    assert_eq!((&schema["allowComments"], &schema["allowTrailingCommas"]), (&json!(true), &json!(true)));
}

#[test]
fn a_param_has_help_unit_range_and_default() {
    let schema = schema(CATALOGUE);
    let wind = &schema["$defs"]["Curve_Wind"]["properties"]["params"]["properties"];
    assert_eq!(wind["frequency"]["description"], "How fine the noise is. In 1/m.");
    assert_eq!(wind["frequency"]["default"], 2);
    assert_eq!(wind["frequency"]["anyOf"][0], json!({"type": "number", "exclusiveMinimum": 0}));
    assert_eq!(wind["octaves"]["anyOf"][0], json!({"type": "integer", "minimum": 1, "maximum": 16}));
    assert_eq!(wind["noise"]["anyOf"][0]["oneOf"][1], json!({"const": "perlin", "description": "gradient noise"}));
    assert_eq!(wind["noise"]["default"], "perlin");
    assert_eq!(wind["ramp_rotate"]["default"], json!({"ramp": [[0, 1]], "interpolation": "linear"}));
    let reader = &schema["$defs"]["Curve_In"]["properties"]["params"]["properties"];
    assert_eq!(reader["frame"]["description"], "Which frame of the files. Default: the current frame.");
    assert_eq!(reader["frame"]["default"], Value::Null);
    let shapes = &schema["$defs"]["Every_Shape"]["properties"]["params"]["properties"];
    assert_eq!(shapes["float"]["description"], "A number. Usually 0…1.");
    assert_eq!(shapes["float"]["default"], 0.1);
}

#[test]
fn every_default_is_valid_under_its_own_schema() {
    let schema = schema(CATALOGUE);
    for node in CATALOGUE.nodes() {
        let params = &schema["$defs"][node.name]["properties"]["params"]["properties"];
        for (name, param) in params.as_object().expect("params are an object") {
            let Some(default) = param.get("default") else { continue };
            let alone = json!({"$defs": schema["$defs"], "anyOf": [param]});
            assert_eq!(validator::refused(&alone, default), Vec::<String>::new(), "{}.{name} = {default}", node.name);
        }
    }
}
