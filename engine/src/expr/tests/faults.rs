//! Faults of expressions: positions, facts and hints.

use super::super::parser::{MAX_DEPTH, MAX_NODES, MAX_TEXT};
use super::*;

#[track_caller]
fn check(text: &str, column: usize, fact: &str, hint: Option<&str>) {
    let found = fault(text);
    assert_eq!((found.line, found.column), (1, column), "{text}: {found}");
    assert_eq!(found.fact, fact, "{text}");
    assert_eq!(found.hint.as_deref(), hint, "{text}");
}

#[test]
fn similar_names_are_suggested_for_unknown_ones() {
    check("1 + tme", 5, "unknown name `tme`", Some("did you mean `time`?"));
    check("strenght", 1, "unknown name `strenght`", Some("did you mean `strength`?"));
    check("sine(1)", 1, "there is no function `sine`", Some("did you mean `sin`?"));
    check("lerp(1, 2, 0)", 1, "there is no function `lerp`", Some("write `mix`"));
    check("true", 1, "unknown name `true`", Some("write `1`"));
    let known = "known names: `frame`, `time`, `fps`, `seed`, `pi`, `strength`, `wind`";
    let attributes = Some("attributes, `i` and `count` can only be used in Attribute_Expr");
    check("P.x", 1, "unknown name `P`", attributes);
    check("2*i", 3, "unknown name `i`", attributes);
    check("zebra", 1, "unknown name `zebra`", Some(known));
    let masks =
        "only Attribute_Expr reads attributes; a param can be masked by one: {\"value\": …, \"attribute\": \"…\"}";
    check("@P.x", 1, "the attribute `P` cannot be read here", Some(masks));
}

#[test]
fn functions_and_values_are_distinguished() {
    check("2*sin", 3, "`sin` is a function", Some("write `sin(x)`"));
    let times = Some("to multiply, write `time*(…)`");
    check("time(2)", 1, "`time` is a value, not a function", times);
    let write = Some("write `clamp(x, low, high)`");
    check("1 + clamp(1, 2)", 5, "`clamp` takes 3 arguments, not 2", write);
    check("sin()", 1, "`sin` takes 1 argument, not 0", Some("write `sin(x)`"));
    check("rand()", 1, "`rand` takes 1 to 2 arguments, not 0", Some("write `rand(i)` or `rand(i, j)`"));
    check("vec(1, 2)", 1, "`vec` takes 1, 3 or 4 arguments, not 2", Some("write `vec(x, y, z)`"));
}

#[test]
fn incomplete_texts_and_trailing_tokens_are_refused() {
    check("", 1, "the expression is empty", None);
    check(" // nothing", 1, "the expression is empty", None);
    check("1 +", 4, "expected a value, found the end", None);
    check("(1 + 2", 7, "expected an operator or `)`, found the end", Some("the `(` at column 1 is not closed"));
    check("1)", 2, "expected an operator or the end, found `)`", None);
    let times = Some("to multiply, write `*`");
    check("2 pi", 3, "expected an operator or the end, found `pi`", times);
    check("2(3)", 2, "expected an operator or the end, found `(`", times);
    check("1 = 1", 3, "expected an operator or the end, found `=`", Some("to compare, write `==`"));
    check("1 ? 2", 6, "expected `:`, found the end", Some("write `condition ? yes : no`"));
    check("min(1 2)", 7, "expected `,` or `)`, found `2`", Some("the `(` at column 4 is not closed"));
    check("*2", 1, "expected a value, found `*`", None);
    check("2**3", 2, "`**` is not an operator", Some("write a power as `^`"));
    check("1 & 1", 3, "`&` is not an operator", Some("write a logical and as `&&`"));
    check("“1”", 1, "unexpected character `“`", None);
    check("é + $", 1, "unexpected character `é`", None);
    check("0 < time < 1", 10, "comparisons cannot be chained", Some("write `a < b && b < c`"));
    check("1e999", 1, "the number `1e999` is too large", None);
}

#[test]
fn widths_must_fit() {
    let part = Some("take a component, such as `.x`");
    check("wind", 1, "expected a scalar, found a 3-vector", part);
    let part = Some("take a component, such as `.x`, or `length(v)`");
    check("wind < 1", 6, "`<` takes scalars, not a 3-vector", part);
    check("!wind ? 1 : 0", 1, "`!` takes scalars, not a 3-vector", part);
    check("wind ? 1 : 0", 6, "the condition of `?` takes scalars, not a 3-vector", part);
    check("rand(wind)", 1, "`rand` takes scalars, not a 3-vector", part);
    check("noise(wind, 1)", 1, "`noise` takes scalars, not a 3-vector", part);
    check("vec(wind).x", 1, "`vec` takes scalars, not a 3-vector", part);
    check("(wind + vec(1, 2, 3, 4)).x", 7, "`+` cannot combine a 3-vector and a 4-vector", None);
    check("dot(wind, 1)", 1, "`dot` cannot combine a 3-vector and a scalar", None);
    check("cross(wind, 1).x", 1, "`cross` takes 3-vectors, not a scalar", None);
    check("time.x", 5, "a scalar has no components", None);
    check("wind.w", 5, "a 3-vector has no component `.w`", None);
    let hint = Some("components are `.x`, `.y`, `.z`, `.w`, or `.r`, `.g`, `.b`, `.a`");
    check("wind.q", 6, "expected a component, found `q`", hint);
}

#[test]
fn columns_count_characters() {
    assert_eq!(fault("1 /* é */ + 2").column, 4);
    assert_eq!(fault("\u{2003}\u{2003}tme").column, 3);
    let second = fault("1 +\n  tme");
    assert_eq!((second.line, second.column), (2, 3));
}

#[test]
fn any_depth_of_nesting_is_handled() {
    let deep = 100_000;
    for text in [
        "(".repeat(deep),
        "-".repeat(deep),
        "!".repeat(deep),
        "2^".repeat(deep),
        "1?".repeat(deep),
        "1?1:".repeat(deep),
        "sin(".repeat(deep),
        "1+(".repeat(deep),
    ] {
        let found = fault(&text);
        assert_eq!(found.fact, format!("nested deeper than {MAX_DEPTH} levels"), "{}", &text[..4]);
    }
    let deepest = MAX_DEPTH - 1;
    assert_eq!(eval(&format!("{}1{}", "(".repeat(deepest), ")".repeat(deepest))), 1.0);
}

#[test]
fn the_deepest_text_needs_little_stack() {
    let deep = |text: &str| text.repeat(100_000);
    let run = move || ["sin(", "2^", "1?1:", "-"].map(|text| fault(&deep(text)).fact.len());
    let thread = std::thread::Builder::new().stack_size(1 << 20).spawn(run).unwrap();
    assert!(thread.join().is_ok());
}

#[test]
fn any_size_is_handled() {
    let long = format!("1{}", "+1".repeat(MAX_NODES / 2 - 1));
    assert_eq!(eval(&long), MAX_NODES as f64 / 2.0);
    let fact = format!("the text has more than {MAX_NODES} numbers, names and operators");
    assert_eq!(fault(&format!("{long}+1")).fact, fact);
    assert_eq!(fault(&"x".repeat(MAX_TEXT + 1)).fact, "the text has 1048577 bytes, more than 1048576");
    assert!(fault(&"x".repeat(MAX_TEXT)).fact.len() < 80);
}

#[test]
fn code_with_too_many_instructions_is_refused() {
    let terms: Vec<String> = (0..650).map(|k| format!("normalize(normalize(wind*{k}.5))")).collect();
    let found = fault(&format!("({}).x", terms.join("+")));
    assert_eq!(found.fact, "the text compiles to more than 16384 instructions");
}
