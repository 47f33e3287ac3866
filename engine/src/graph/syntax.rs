//! Parses JSON. Comments and trailing commas are allowed, other extensions of JSON5 are not.
//!
//! Promise: any text gives a value or its first fault with a position; deep nesting does not overflow the stack.
//! Limit: lists and objects nest at most [`DEEPEST`] deep, and only the first syntax fault is reported.

use jsonc_parser::ast::{Object, ObjectProp, Value};
use jsonc_parser::errors::{ParseError, ParseErrorKind};
use jsonc_parser::{CollectOptions, ParseOptions, ParseStringErrorKind, parse_to_ast};

use super::fault::{Fault, code};
use super::json::shown;
use super::text::Text;

/// Deepest nesting of lists and objects. A graph needs eight.
pub(super) const DEEPEST: usize = 64;

/// Spellings of non-finite numbers in other languages.
const NOT_FINITE: [&str; 5] = ["NaN", "nan", "Infinity", "inf", "Inf"];

const STRICT: ParseOptions = ParseOptions {
    allow_comments: true,
    allow_trailing_commas: true,
    allow_loose_object_property_names: false,
    allow_missing_commas: false,
    allow_single_quoted_strings: false,
    allow_hexadecimal_numbers: false,
    allow_unary_plus_numbers: false,
    allow_bare_decimal_point_numbers: false,
    allow_non_finite_numbers: false,
    allow_extended_string_escapes: false,
};

/// Parses a text.
///
/// # Errors
/// The first syntax fault.
pub(super) fn parse<'a>(text: &'a Text<'_>) -> Result<Value<'a>, Fault> {
    let end = brackets(text)?;
    let parsed = parse_to_ast(text.content, &CollectOptions::default(), &STRICT);
    match (parsed, end) {
        (Ok(parsed), _) => parsed.value.map(tight).ok_or_else(|| empty(text)),
        (Err(error), Some(end)) if ends_early(text, &error) => Err(end),
        (Err(error), _) => Err(explain(text, &error)),
    }
}

/// Frees what the parser has reserved for more members than an object has: room for four, of which the inputs of a node
/// mostly need one. A graph may have a million nodes.
fn tight(value: Value<'_>) -> Value<'_> {
    let Value::Object(Object { range, properties }) = value else { return value };
    // Not `collect`, which would keep the room.
    let mut members = Vec::with_capacity(properties.len());
    members.extend(properties.into_iter().map(|member| ObjectProp { value: tight(member.value), ..member }));
    Value::Object(Object { range, properties: members })
}

/// Whether the error is that the text ends too early. An error before the end has another cause, which is reported
/// instead.
fn ends_early(text: &Text<'_>, error: &ParseError) -> bool {
    matches!(error.kind(), ParseErrorKind::UnterminatedArray | ParseErrorKind::UnterminatedObject)
        || error.range().start >= text.content.trim_end().len()
}

fn empty(text: &Text<'_>) -> Fault {
    let fault = text.fault(0, "", code::EMPTY, format!("{} is empty", text.noun()));
    match text.set {
        Some(key) => fault.hint(format!("write `{0}=` and the value, such as `{0}=1`", shown(key))),
        None => fault.hint(r#"a graph starts with {"convect": 1, "nodes": {…}, "outputs": {…}}"#),
    }
}

/// Checks brackets, strings and comments without recursion. The error is the fault of nesting that is too deep or of a
/// string or comment that does not end; the value is the fault of a bracket that is still open at the end.
fn brackets(text: &Text<'_>) -> Result<Option<Fault>, Fault> {
    let bytes = text.content.as_bytes();
    let syntax = |at: usize, fact: &str| text.fault(at, "", code::SYNTAX, fact);
    let mut open: Vec<usize> = Vec::new();
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        match (byte, bytes.get(at + 1)) {
            (b'{' | b'[', _) if open.len() == DEEPEST => {
                let fact = format!("lists and objects are nested more than {DEEPEST} deep");
                return Err(text.fault(at, "", code::NESTING, fact).hint("a graph needs fewer than ten levels"));
            }
            (b'{' | b'[', _) => open.push(at),
            (b'}' | b']', _) => match open.pop() {
                // `]` is `[` + 2, `}` is `{` + 2.
                Some(start) if bytes[start] + 2 != byte => {
                    let opened = text.position(start);
                    let fact = format!(
                        "`{}` closes the `{}` of line {}, column {}",
                        byte as char, bytes[start] as char, opened.line, opened.column
                    );
                    return Err(syntax(at, &fact).hint(format!("expected `{}`", (bytes[start] + 2) as char)));
                }
                _ => {}
            },
            (b'"', _) => match string_end(bytes, at) {
                Ok(end) => at = end,
                Err(Unclosed::Line) => {
                    let fault = syntax(at, "the string that starts here does not end on its line");
                    return Err(fault.hint(r#"end it with `"`; a line break in a string is written `\n`"#));
                }
                Err(Unclosed::File) => return Err(truncated(text, "string", at)),
                Err(Unclosed::Control(at)) => {
                    let fault = syntax(at, &format!("a string contains the control character {:#04x}", bytes[at]));
                    return Err(fault.hint(
                        r"write a tab as `\t` and other control characters as `\u` with four hexadecimal digits",
                    ));
                }
            },
            (b'/', Some(b'/')) => {
                at += bytes[at..].iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(bytes.len() - at);
            }
            (b'/', Some(b'*')) => match bytes[at + 2..].windows(2).position(|pair| pair == b"*/") {
                Some(length) => at += length + 3,
                None => return Err(truncated(text, "comment", at)),
            },
            _ => {}
        }
        at += 1;
    }
    Ok(open.last().map(|start| truncated(text, if bytes[*start] == b'{' { "object" } else { "list" }, *start)))
}

enum Unclosed {
    Line,
    File,
    Control(usize),
}

/// The offset of the quote that ends the string whose opening quote is at `start`.
fn string_end(bytes: &[u8], start: usize) -> Result<usize, Unclosed> {
    let mut at = start + 1;
    loop {
        match bytes.get(at) {
            None => return Err(Unclosed::File),
            Some(b'"') => return Ok(at),
            // An escaped quote does not end the string; other escapes are checked by the parser.
            Some(b'\\') if matches!(bytes.get(at + 1), Some(b'"' | b'\\')) => at += 2,
            Some(b'\n' | b'\r') => return Err(Unclosed::Line),
            Some(0..0x20) => return Err(Unclosed::Control(at)),
            Some(_) => at += 1,
        }
    }
}

/// The fault of a text that ends inside the `what` that starts at `start`.
fn truncated(text: &Text<'_>, what: &str, start: usize) -> Fault {
    let opened = text.position(start);
    let fact =
        format!("{} ends inside the {what} that starts at line {}, column {}", text.noun(), opened.line, opened.column);
    text.fault(text.content.trim_end().len(), "", code::TRUNCATED, fact).hint("is the rest missing?")
}

/// The parser's error as a fault in our words.
fn explain(text: &Text<'_>, error: &ParseError) -> Fault {
    use ParseErrorKind as K;
    let start = error.range().start;
    let rest = &text.content[start..];
    let word = word(rest);
    let is_word = matches!(error.kind(), K::UnexpectedWord | K::UnexpectedToken) && !word.is_empty();
    let (fact, hint): (String, Option<&str>) = match error.kind() {
        _ if NOT_FINITE.contains(&word.trim_start_matches(['-', '+'])) => {
            (format!("`{word}` is not allowed"), Some("numbers must be finite"))
        }
        _ if is_word => (format!("found `{word}`, expected a value"), Some(r#"write strings in double quotes"#)),
        K::SingleQuotedStringsNotAllowed => {
            ("found `'`, expected a value or a key".into(), Some(r#"write strings in double quotes"#))
        }
        K::ExpectedStringObjectProperty => {
            (format!("the key `{word}` has no quotes"), Some(r#"write keys in double quotes"#))
        }
        K::ExpectedColonAfterObjectKey => ("expected `:` after the key".into(), None),
        K::ExpectedObjectValue => ("expected a value after `:`".into(), None),
        K::ExpectedComma if rest.starts_with(|c: char| c.is_ascii_digit()) => {
            ("a number has a leading zero".into(), Some("leave the zero out"))
        }
        K::ExpectedComma => ("expected `,`".into(), None),
        K::UnexpectedTokenInObject => match rest.chars().next() {
            Some(c @ ('{' | '[' | ']' | ',' | ':')) => (format!("found `{c}`, expected `,`, a key or `}}`"), None),
            _ => ("expected `,`, a key or `}`".into(), None),
        },
        K::MultipleRootJsonValues => {
            (format!("{} continues after the end of its value", text.noun()), Some("is there one bracket too many?"))
        }
        K::HexadecimalNumbersNotAllowed => (format!("`{word}` is hexadecimal"), Some("numbers are decimal")),
        K::UnaryPlusNumbersNotAllowed => ("a number starts with `+`".into(), Some("leave the `+` out")),
        K::BareDecimalPointNumbersNotAllowed => (
            "a number has no digit before or after its decimal point".into(),
            Some("write digits on both sides: 0.5, 5.0"),
        ),
        K::ExpectedDigit | K::ExpectedDigitFollowingNegativeSign | K::ExpectedPlusMinusOrDigitInNumberLiteral => {
            ("a number is incomplete, expected a digit".into(), None)
        }
        K::String(kind) => (string_fact(kind).into(), Some(r#"`\` itself is written `\\`"#)),
        K::UnexpectedCloseBrace => ("found `}`, expected a value".into(), None),
        K::UnexpectedCloseBracket => ("found `]`, expected a value".into(), None),
        K::UnexpectedColon => ("found `:`, expected a value".into(), None),
        K::UnexpectedComma => ("found `,`, expected a value".into(), None),
        _ => (format!("found `{}`, which is not JSON", rest.chars().next().unwrap_or(' ').escape_debug()), None),
    };
    let fault = text.fault(start, "", code::SYNTAX, fact);
    match text.set {
        Some(key) if is_word => fault.hint(format!(
            r#"a string in a list or an object needs double quotes that the shell must not remove: '{}=…"{word}"…'"#,
            shown(key)
        )),
        _ => Fault { hint: hint.map(Into::into), ..fault },
    }
}

fn string_fact(kind: &ParseStringErrorKind) -> &'static str {
    match kind {
        ParseStringErrorKind::ExpectedFourHexDigits => r"expected four hexadecimal digits after `\u`",
        ParseStringErrorKind::InvalidUnicodeEscapeSequence(_) => r"a `\u` escape is half of a surrogate pair",
        ParseStringErrorKind::UnterminatedStringLiteral => "a string is not closed",
        _ => r#"a string has an unknown `\` escape"#,
    }
}

/// The word at the start of `rest`, shortened, and with control characters escaped.
fn word(rest: &str) -> String {
    let word = rest.chars().take_while(|c| !c.is_whitespace() && !r#"{}[],:"'/"#.contains(*c));
    word.take(40).flat_map(char::escape_debug).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(content: &str) -> String {
        parse(&Text::new(content, None)).unwrap_err().to_string()
    }

    #[test]
    fn comments_and_trailing_commas_are_read() {
        assert!(parse(&Text::new("/* a */ {\"a\": [1, 2,], // b\n}", None)).is_ok());
    }

    #[test]
    fn objects_hold_no_room_for_more_members() {
        let text = Text::new(r#"{"nodes": {"a": {"inputs": {"b": 1}}, "c": {"d": 2}}}"#, None);
        let mut objects = vec![parse(&text).unwrap()];
        let mut members = 0;
        while let Some(Value::Object(object)) = objects.pop() {
            assert_eq!(object.properties.capacity(), object.properties.len());
            members += object.properties.len();
            let values = object.properties.into_iter().map(|member| member.value);
            objects.extend(values.filter(|value| matches!(value, Value::Object(_))));
        }
        assert_eq!(members, 6);
    }

    #[test]
    fn other_extensions_of_json5_are_refused() {
        for (content, expected) in [
            ("{a: 1}", "1:2: the key `a` has no quotes; write keys in double quotes"),
            ("['a']", "1:2: found `'`, expected a value or a key; write strings in double quotes"),
            ("[0x10]", "1:2: `0x10` is hexadecimal; numbers are decimal"),
            ("[+1]", "1:2: a number starts with `+`; leave the `+` out"),
            (
                "[.5]",
                "1:2: a number has no digit before or after its decimal point; write digits on both sides: 0.5, 5.0",
            ),
            (
                "[5.]",
                "1:2: a number has no digit before or after its decimal point; write digits on both sides: 0.5, 5.0",
            ),
            ("[01]", "1:3: a number has a leading zero; leave the zero out"),
            ("[1 2]", "1:3: expected `,`"),
            ("[NaN]", "1:2: `NaN` is not allowed; numbers must be finite"),
            ("[a\0b\u{1b}]", r#"1:2: found `a\0b\u{1b}`, expected a value; write strings in double quotes"#),
            ("[-Infinity]", "1:2: `-Infinity` is not allowed; numbers must be finite"),
            (r#"["\x41"]"#, r"1:3: a string has an unknown `\` escape; `\` itself is written `\\`"),
            (r#"["\ud800"]"#, r"1:3: a `\u` escape is half of a surrogate pair; `\` itself is written `\\`"),
            (
                "[\"a\nb\"]",
                r#"1:2: the string that starts here does not end on its line; end it with `"`; a line break in a string is written `\n`"#,
            ),
            (
                "[\"a\tb\"]",
                r"1:4: a string contains the control character 0x09; write a tab as `\t` and other control characters as `\u` with four hexadecimal digits",
            ),
        ] {
            assert_eq!(fault(content), expected);
        }
    }

    #[test]
    fn a_truncated_text_names_what_was_open() {
        let ends = |what: &str| format!("the file ends inside the {what}; is the rest missing?");
        assert_eq!(fault("{\n  \"a\": [1,\n"), format!("2:11: {}", ends("list that starts at line 2, column 8")));
        assert_eq!(fault("{\"a\""), format!("1:5: {}", ends("object that starts at line 1, column 1")));
        assert_eq!(fault("{\"a"), format!("1:4: {}", ends("string that starts at line 1, column 2")));
        assert_eq!(fault("{ /* "), format!("1:5: {}", ends("comment that starts at line 1, column 3")));
        assert_eq!(fault("{\"a\": 1]"), "1:8: `]` closes the `{` of line 1, column 1; expected `}`");
        assert_eq!(fault("{}}"), "1:3: the file continues after the end of its value; is there one bracket too many?");
    }

    #[test]
    fn deep_nesting_does_not_overflow_the_stack() {
        let deep = |depth: usize| "[".repeat(depth) + &"]".repeat(depth);
        assert!(parse(&Text::new(&deep(DEEPEST), None)).is_ok());
        let expected = "1:65: lists and objects are nested more than 64 deep; a graph needs fewer than ten levels";
        assert_eq!(fault(&deep(DEEPEST + 1)), expected);
        assert_eq!(fault(&deep(100_000)), expected);
        assert_eq!(
            fault(&"{\"a\":".repeat(100_000)),
            "1:321: lists and objects are nested more than 64 deep; a graph needs fewer than ten levels"
        );
    }

    #[test]
    fn an_empty_text_is_reported_as_empty() {
        for content in ["", " \n", "// nothing\n"] {
            assert!(fault(content).contains("the file is empty"), "{content:?}");
        }
    }
}
