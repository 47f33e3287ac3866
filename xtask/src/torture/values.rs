//! Random values of params: extremes, expressions, and every form that a graph knows.

use serde_json::{Value, json};

use super::bytes::NUMBERS;
use super::dice::Dice;

/// Marks a text that is written into the graph without its quotes, such as `NaN`.
const RAW: [&str; 2] = ["\"@raw:", "@\""];

/// Attributes and names that expressions and masks may find.
const NAMES: [&str; 16] = [
    "P", "P.y", "envelope", "width", "Cd", "Cd.x", "uvw", "frame", "time", "fps", "seed", "pi", "curve_id", "nothing",
    "id", "N",
];

/// Names that expressions of params may use, and one that they may not.
const OF_PARAMS: [&str; 7] = ["frame", "time", "fps", "seed", "pi", "time", "P"];

/// The text of a graph, marked texts without quotes.
pub(crate) fn text_of(graph: &Value) -> String {
    let text = serde_json::to_string_pretty(graph).unwrap_or_default();
    let mut out = String::new();
    let mut rest = &text[..];
    while let Some((before, after)) = rest.split_once(RAW[0]) {
        out.push_str(before);
        let (raw, after) = after.split_once(RAW[1]).unwrap_or((after, ""));
        out.push_str(raw);
        rest = after;
    }
    out + rest
}

/// A number of [`NUMBERS`], as it is written there.
pub(crate) fn number(dice: &mut Dice) -> Value {
    json!(format!("@raw:{}@", NUMBERS[dice.below(NUMBERS.len())]))
}

/// A value that no param expects.
pub(crate) fn extreme(dice: &mut Dice) -> Value {
    match dice.below(20) {
        0..8 => number(dice),
        8 => Value::Null,
        9 => json!([]),
        10 => json!({}),
        11 => json!(dice.one_in(2)),
        12 => json!("#".repeat(1 << dice.below(17))),
        13 => json!(dice.of(&[
            "",
            "\u{0}",
            "../..",
            "/dev/zero",
            "in",
            "in/bear.obj",
            "in/####.obj",
            "\u{1f43b}",
            "NaN",
            "g.json"
        ])),
        14 => Value::Array((0..dice.below(5)).map(|_| number(dice)).collect()),
        15 => (0..1 + dice.below(300)).fold(json!(0), |inner, _| json!([inner])),
        16 => Value::Array(vec![number(dice); 1 << dice.below(15)]),
        17 => json!({"a": number(dice), "value": number(dice)}),
        18 => json!([[number(dice), number(dice), number(dice)], [number(dice), number(dice), number(dice)]]),
        _ => form(dice, &json!(1)),
    }
}

/// Multiplies every number in `value` by one that keeps its sign.
pub(crate) fn resize(value: &mut Value, dice: &mut Dice) {
    scale_by(value, &[0.5, 2.0, 1e-3, 10.0, 1e-6, 100.0, 1.5, 0.0], dice);
}

/// Multiplies every number in `value`.
pub(crate) fn scale(value: &mut Value, dice: &mut Dice) {
    scale_by(value, &[0.0, -1.0, 0.5, 2.0, 1e-3, 10.0, 1e-6, 1e4], dice);
}

fn scale_by(value: &mut Value, factors: &[f64; 8], dice: &mut Dice) {
    match value {
        Value::Number(old) => {
            let factor = factors[dice.below(8)];
            let new = old.as_f64().unwrap_or(0.0) * factor;
            *value = if old.is_i64() && new.abs() < 1e15 { json!(new as i64) } else { json!(new) };
        }
        Value::Array(all) => all.iter_mut().for_each(|one| scale_by(one, factors, dice)),
        Value::Bool(flag) => *flag = !*flag,
        _ => {}
    }
}

/// One of the forms of a param, with `value` where the form has one.
pub(crate) fn form(dice: &mut Dice, value: &Value) -> Value {
    match dice.below(7) {
        0 => json!({"expr": expression(dice, 3)}),
        1 => json!({"expr": [expression(dice, 2), expression(dice, 2), expression(dice, 2)]}),
        2 => {
            let mut keys: Vec<Value> = Vec::new();
            let mut frame = -2.0;
            for _ in 0..1 + dice.below(5) {
                let mut at = value.clone();
                scale(&mut at, dice);
                keys.push(json!([frame, at]));
                frame += [1.0, 0.5, 0.0, 3.0, 1e6, 1e18][dice.below(6)];
            }
            let interpolation = dice.of(&["linear", "smooth", "constant", "cubic"]);
            json!({"keyframes": keys, "interpolation": interpolation})
        }
        3 => json!({"control": dice.of(&["wind_dir", "strength", "none", "frame"])}),
        4 => json!({"value": value, "attribute": NAMES[dice.below(NAMES.len())]}),
        5 => {
            let mut ramp: Vec<Value> = Vec::new();
            for at in 0..dice.below(5) {
                let height = [0.0, 1.0, -1.0, 1e30, 0.3][dice.below(5)];
                ramp.push(json!([at as f64 / 4.0, height]));
            }
            json!({"ramp": ramp, "interpolation": dice.of(&["linear", "smooth", "constant"])})
        }
        _ => json!([value, value, value]),
    }
}

/// An expression of `depth` levels.
pub(crate) fn expression(dice: &mut Dice, depth: usize) -> String {
    expression_of(&OF_PARAMS, dice, depth)
}

fn expression_of(names: &[&str], dice: &mut Dice, depth: usize) -> String {
    if depth == 0 || dice.one_in(6) {
        return match dice.below(3) {
            0 => dice.of(names).to_owned(),
            1 => NUMBERS[dice.below(NUMBERS.len())].to_owned(),
            _ => dice.of(&["0.5", "2", "frame", "time", "1"]).to_owned(),
        };
    }
    let mut inner = || expression_of(names, dice, depth - 1);
    let (a, b, c) = (inner(), inner(), inner());
    match dice.below(9) {
        0..4 => {
            let operator = dice.of(&["+", "-", "*", "/", "%", "^", "<", "==", "&&", "||"]);
            format!("{a} {operator} {b}")
        }
        4 => format!("({a} ? {b} : {c})"),
        5 => {
            let name = dice
                .of(&["sin", "cos", "tan", "sqrt", "exp", "log", "abs", "floor", "ceil", "noise", "rand", "length"]);
            format!("{name}({a})")
        }
        6 => {
            let name = dice.of(&["atan2", "pow", "min", "max", "dot", "rand", "noise"]);
            format!("{name}({a}, {b})")
        }
        7 => {
            let name = dice.of(&["clamp", "mix", "smoothstep", "vec", "noise", "cross"]);
            format!("{name}({a}, {b}, {c})")
        }
        _ => format!("-({a})"),
    }
}

/// A program of Attribute_Expr.
pub(crate) fn program(dice: &mut Dice) -> String {
    let mut code = String::new();
    for line in 0..1 + dice.below(4) {
        let depth = 1 + dice.below(4);
        let right = expression_of(&NAMES, dice, depth);
        let left = dice.of(&["P", "P.y", "envelope", "width", "Cd", "let a", "x", "P.x", "id", "let P", "N"]);
        code += if line > 0 { "\n" } else { "" };
        code += &format!("{left} = {right}");
    }
    code
}

/// An expression with one piece of it changed.
pub(crate) fn edit(text: &str, dice: &mut Dice) -> String {
    let chars: Vec<char> = text.chars().collect();
    let Some(at) = dice.index(chars.len()) else { return expression(dice, 2) };
    let (before, after): (String, String) = (chars[..at].iter().collect(), chars[at..].iter().collect());
    match dice.below(7) {
        0 => before,
        1 => before + &expression(dice, 1) + &after,
        2 => before + dice.of(&["(", ")", "*", "^", "\n", "?", ":", ",", "@", "\"", ".", "é", "="]) + &after,
        3 => format!("{}{text}{}", "(".repeat(1 << dice.below(13)), ")".repeat(1 << dice.below(13))),
        4 => format!("{text} + {}", vec!["1"; 1 << dice.below(13)].join("+")),
        5 => format!("({text})*{}", NUMBERS[dice.below(NUMBERS.len())]),
        _ => text.replacen(char::is_numeric, NUMBERS[dice.below(NUMBERS.len())], 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marked_texts_lose_their_quotes() {
        assert_eq!(text_of(&json!(["@raw:NaN@", "a"])), "[\n  NaN,\n  \"a\"\n]");
    }

    #[test]
    fn values_of_all_kinds_appear() {
        let mut dice = Dice::new(11);
        let values: Vec<Value> = (0..300).map(|_| extreme(&mut dice)).collect();
        assert!(values.iter().any(Value::is_object) && values.iter().any(Value::is_array));
        assert!(values.iter().any(|value| value.as_str().is_some_and(|text| text.len() > 1 << 14)));
        assert!(values.iter().any(|value| value == &json!("@raw:1e999@")));
    }

    #[test]
    fn edited_expressions_differ() {
        let changed = (0..100).filter(|seed| edit("0.5*sin(time)", &mut Dice::new(*seed)) != "0.5*sin(time)").count();
        assert!(changed > 90);
    }
}
