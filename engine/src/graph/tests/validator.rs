//! A validator of JSON Schema (draft 2020-12) for the keywords that the schema of graphs uses. Any other keyword, and a
//! keyword's value that is not of its kind, is an error of the schema itself.
//!
//! `tools/schema_check.py` checks the same schema with an implementation that knows all of JSON Schema.

use regex_lite::Regex;
use serde_json::{Map, Value};

/// What is wrong with `schema`: each of its keywords has a value of its kind, and what it refers to is there.
pub(super) fn faults(schema: &Value) -> Vec<String> {
    let mut faults = Vec::new();
    visit(schema, schema, "#", &mut faults);
    faults
}

/// What `schema` refuses in `value`, each with the place in `value`.
pub(super) fn refused(schema: &Value, value: &Value) -> Vec<String> {
    let mut found = Vec::new();
    Validator { root: schema }.check(schema, value, "", &mut found);
    found
}

/// The names of the types of JSON, those of schemas.
const TYPES: [&str; 7] = ["array", "boolean", "integer", "null", "number", "object", "string"];

fn visit(root: &Value, schema: &Value, at: &str, faults: &mut Vec<String>) {
    let Some(object) = schema.as_object() else {
        if !schema.is_boolean() {
            faults.push(format!("{at} is not a schema"));
        }
        return;
    };
    for (keyword, value) in object {
        let at = format!("{at}/{keyword}");
        let right = match keyword.as_str() {
            "$schema" => *value == "https://json-schema.org/draft/2020-12/schema",
            "$ref" => value.as_str().is_some_and(|name| target(root, name).is_some()),
            "title" | "description" => value.is_string(),
            "default" | "const" => true,
            "allowComments" | "allowTrailingCommas" | "uniqueItems" => value.is_boolean(),
            "type" => match value {
                Value::Array(names) => !names.is_empty() && unique(names) && names.iter().all(is_type),
                name => is_type(name),
            },
            "enum" => value.as_array().is_some_and(|options| !options.is_empty() && unique(options)),
            "required" => value.as_array().is_some_and(|names| unique(names) && names.iter().all(Value::is_string)),
            "pattern" => value.as_str().is_some_and(|pattern| Regex::new(pattern).is_ok()),
            "minItems" | "maxItems" | "minLength" | "minProperties" => value.is_u64(),
            "minimum" | "maximum" | "exclusiveMinimum" => value.is_number(),
            "not" | "if" | "then" | "items" | "additionalProperties" | "propertyNames" => {
                visit(root, value, &at, faults);
                true
            }
            "anyOf" | "oneOf" | "allOf" | "prefixItems" => value.as_array().is_some_and(|schemas| {
                schemas.iter().enumerate().for_each(|(i, schema)| visit(root, schema, &format!("{at}/{i}"), faults));
                !schemas.is_empty()
            }),
            "properties" | "$defs" => value.as_object().is_some_and(|schemas| {
                schemas.iter().for_each(|(name, schema)| visit(root, schema, &format!("{at}/{name}"), faults));
                true
            }),
            _ => {
                faults.push(format!("{at} is a keyword that this validator does not know"));
                true
            }
        };
        if !right {
            faults.push(format!("{at} cannot be {value}"));
        }
    }
}

fn is_type(name: &Value) -> bool {
    name.as_str().is_some_and(|name| TYPES.contains(&name))
}

/// The schema to which `$ref` refers: one of the same document.
fn target<'a>(root: &'a Value, name: &str) -> Option<&'a Value> {
    root.pointer(name.strip_prefix('#')?)
}

struct Validator<'a> {
    root: &'a Value,
}

impl Validator<'_> {
    fn accepts(&self, schema: &Value, value: &Value) -> bool {
        let mut found = Vec::new();
        self.check(schema, value, "", &mut found);
        found.is_empty()
    }

    fn check(&self, schema: &Value, value: &Value, at: &str, found: &mut Vec<String>) {
        let Some(keywords) = schema.as_object() else {
            if *schema == false {
                found.push(format!("{at}: nothing may be here"));
            }
            return;
        };
        for (keyword, rule) in keywords {
            if !self.keeps(keywords, keyword, rule, value, at, found) {
                found.push(format!("{at}: {value} is against `{keyword}`: {rule}"));
            }
        }
    }

    /// Whether a value keeps one rule. What is wrong inside the value goes to `found` instead.
    fn keeps(
        &self,
        keywords: &Map<String, Value>,
        keyword: &str,
        rule: &Value,
        value: &Value,
        at: &str,
        found: &mut Vec<String>,
    ) -> bool {
        let number = |holds: fn(f64, f64) -> bool| value.as_f64().zip(rule.as_f64()).is_none_or(|(x, y)| holds(x, y));
        let count = |count: Option<usize>, holds: fn(u64, u64) -> bool| {
            count.zip(rule.as_u64()).is_none_or(|(count, limit)| holds(count as u64, limit))
        };
        let accepting = || schemas(rule).filter(|schema| self.accepts(schema, value)).count();
        let (list, object) = (value.as_array(), value.as_object());
        match keyword {
            "type" => match rule {
                Value::Array(names) => names.iter().any(|name| is_of(value, name)),
                name => is_of(value, name),
            },
            "const" => same(value, rule),
            "enum" => schemas(rule).any(|option| same(value, option)),
            "minimum" => number(|x, least| x >= least),
            "maximum" => number(|x, most| x <= most),
            "exclusiveMinimum" => number(|x, least| x > least),
            "minLength" => count(value.as_str().map(|text| text.chars().count()), |count, least| count >= least),
            "minItems" => count(list.map(Vec::len), |count, least| count >= least),
            "maxItems" => count(list.map(Vec::len), |count, most| count <= most),
            "minProperties" => count(object.map(Map::len), |count, least| count >= least),
            "uniqueItems" => *rule == false || list.is_none_or(|list| unique(list)),
            "pattern" => value.as_str().is_none_or(|text| Regex::new(rule.as_str().unwrap()).unwrap().is_match(text)),
            "not" => !self.accepts(rule, value),
            "anyOf" => accepting() > 0,
            "oneOf" => accepting() == 1,
            "$ref" => {
                self.check(target(self.root, rule.as_str().unwrap()).unwrap(), value, at, found);
                true
            }
            "allOf" => {
                schemas(rule).for_each(|schema| self.check(schema, value, at, found));
                true
            }
            "if" => {
                if let Some(then) = keywords.get("then").filter(|_| self.accepts(rule, value)) {
                    self.check(then, value, at, found);
                }
                true
            }
            "required" => {
                object.is_none_or(|object| schemas(rule).all(|name| object.contains_key(name.as_str().unwrap())))
            }
            "propertyNames" => {
                object.is_none_or(|object| object.keys().all(|name| self.accepts(rule, &Value::String(name.clone()))))
            }
            "properties" => {
                for (name, schema) in rule.as_object().into_iter().flatten() {
                    if let Some(value) = object.and_then(|object| object.get(name)) {
                        self.check(schema, value, &format!("{at}/{name}"), found);
                    }
                }
                true
            }
            "additionalProperties" => {
                let known = |name: &str| keywords.get("properties").is_some_and(|known| known.get(name).is_some());
                for (name, value) in object.into_iter().flatten().filter(|(name, _)| !known(name)) {
                    self.check(rule, value, &format!("{at}/{name}"), found);
                }
                true
            }
            "prefixItems" => {
                for (i, (schema, value)) in schemas(rule).zip(list.into_iter().flatten()).enumerate() {
                    self.check(schema, value, &format!("{at}/{i}"), found);
                }
                true
            }
            "items" => {
                let before = keywords.get("prefixItems").map_or(0, |before| schemas(before).count());
                for (i, value) in list.into_iter().flatten().enumerate().skip(before) {
                    self.check(rule, value, &format!("{at}/{i}"), found);
                }
                true
            }
            _ => true,
        }
    }
}

/// The elements of a list in a schema.
fn schemas(list: &Value) -> impl Iterator<Item = &Value> {
    list.as_array().into_iter().flatten()
}

/// Whether a value is of the type of that name.
fn is_of(value: &Value, name: &Value) -> bool {
    match value {
        Value::Null => name == "null",
        Value::Bool(_) => name == "boolean",
        Value::String(_) => name == "string",
        Value::Array(_) => name == "array",
        Value::Object(_) => name == "object",
        Value::Number(x) => {
            let whole = x.is_i64() || x.is_u64() || x.as_f64().is_some_and(|x| x.fract() == 0.0);
            name == "number" || name == "integer" && whole
        }
    }
}

/// Whether two values are equal: 1 and 1.0 are.
fn same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(x), Value::Number(y)) => x == y || (x.is_f64() || y.is_f64()) && x.as_f64() == y.as_f64(),
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b)),
        (Value::Object(a), Value::Object(b)) => {
            a.len() == b.len() && a.iter().all(|(name, a)| b.get(name).is_some_and(|b| same(a, b)))
        }
        _ => a == b,
    }
}

/// Whether no two elements are equal.
fn unique(list: &[Value]) -> bool {
    list.iter().enumerate().all(|(i, a)| list[..i].iter().all(|b| !same(a, b)))
}

#[test]
fn each_keyword_refuses_what_it_should() {
    use serde_json::json;
    // A schema, what it accepts, and what it refuses.
    let cases = [
        (json!({"type": "integer"}), json!([1, -1, 1.0]), json!([1.5, "1", null, true, [], {}])),
        (json!({"type": ["string", "null"]}), json!(["", null]), json!([0, false, [], {}])),
        (json!({"const": 1}), json!([1, 1.0]), json!([2, "1", [1]])),
        (json!({"const": {"a": [1]}}), json!([{"a": [1.0]}]), json!([{"a": [2]}, {"a": [1], "b": 1}, {}])),
        (json!({"enum": ["a", 1]}), json!(["a", 1]), json!(["b", 2])),
        (json!({"minimum": 1, "maximum": 2}), json!([1, 2, "0"]), json!([0.9, 2.1])),
        (json!({"exclusiveMinimum": 0}), json!([1e-9, []]), json!([0, -1])),
        (json!({"minLength": 2}), json!(["ab", "äö", 1]), json!(["", "ä"])),
        (json!({"minItems": 1, "maxItems": 2}), json!([[1], [1, 2], {}]), json!([[], [1, 2, 3]])),
        (json!({"minProperties": 1}), json!([{"a": 1}, []]), json!([{}])),
        (json!({"uniqueItems": true}), json!([[1, 2], [], "aa"]), json!([[1, 1.0], [[1], [1]]])),
        (json!({"pattern": "^a+$"}), json!(["a", "aa", 1]), json!(["", "ab"])),
        (json!({"not": {"type": "string"}}), json!([1]), json!(["a"])),
        (json!({"anyOf": [{"minimum": 3}, {"maximum": 1}]}), json!([0, 3]), json!([2])),
        (json!({"oneOf": [{"minimum": 1}, {"maximum": 3}]}), json!([0, 4]), json!([2])),
        (json!({"allOf": [{"minimum": 1}, {"maximum": 3}]}), json!([2]), json!([0, 4])),
        (json!({"if": {"minimum": 1}, "then": {"maximum": 3}}), json!([0, 2]), json!([4])),
        (json!({"$ref": "#/$defs/a", "$defs": {"a": {"minimum": 1}}}), json!([1]), json!([0])),
        (json!({"required": ["a"]}), json!([{"a": 1}, []]), json!([{"b": 1}])),
        (json!({"propertyNames": {"minLength": 2}}), json!([{"ab": 1}, {}]), json!([{"a": 1}])),
        (json!({"properties": {"a": {"minimum": 1}}}), json!([{"a": 1}, {"b": 0}]), json!([{"a": 0}])),
        (
            json!({"properties": {"a": {}}, "additionalProperties": {"minimum": 1}}),
            json!([{"a": 0, "b": 1}]),
            json!([{"b": 0}]),
        ),
        (json!({"additionalProperties": false}), json!([{}]), json!([{"a": 1}])),
        (json!({"prefixItems": [{"minimum": 1}], "items": false}), json!([[], [1]]), json!([[0], [1, 1]])),
        (json!({"items": {"minimum": 1}}), json!([[], [1, 2]]), json!([[0], [1, 0]])),
    ];
    for (schema, accepted, not) in &cases {
        assert_eq!(faults(schema), Vec::<String>::new());
        for value in accepted.as_array().unwrap() {
            assert_eq!(refused(schema, value), Vec::<String>::new(), "{schema}");
        }
        for value in not.as_array().unwrap() {
            assert!(!refused(schema, value).is_empty(), "{schema} accepts {value}");
        }
    }
}

#[test]
fn a_schema_with_faults_is_found() {
    use serde_json::json;
    let wrong = [
        json!(1),
        json!({"typo": 1}),
        json!({"type": "float"}),
        json!({"type": []}),
        json!({"enum": []}),
        json!({"required": ["a", "a"]}),
        json!({"pattern": "("}),
        json!({"minItems": -1}),
        json!({"minimum": "1"}),
        json!({"anyOf": []}),
        json!({"oneOf": [1]}),
        json!({"properties": {"a": 1}}),
        json!({"items": {"typo": 1}}),
        json!({"$ref": "#/$defs/a"}),
        json!({"$schema": "https://json-schema.org/draft-07/schema"}),
    ];
    for schema in &wrong {
        assert!(!faults(schema).is_empty(), "{schema}");
    }
}
