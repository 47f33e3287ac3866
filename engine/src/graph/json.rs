//! JSON values with their source text and path, and readers whose faults name what was found and what was expected.
//!
//! Promise: every number that is read is finite. Limit: whole numbers beyond ±2⁶³ are refused.

use std::collections::BTreeMap;
use std::rc::Rc;

use jsonc_parser::ast::Value;
use jsonc_parser::common::{Range, Ranged};

use super::fault::{Fault, code};
use super::text::Text;
use crate::expr::suggest::{MOST_CANDIDATES, nearest};

/// A JSON value, the text that it is part of, and its path.
#[derive(Clone)]
pub(super) struct Json<'a> {
    pub(super) value: &'a Value<'a>,
    pub(super) text: &'a Text<'a>,
    /// Path without the list indices in `items`.
    base: Rc<str>,
    /// Indices in nested lists, outermost first. They become a path only in a fault, so a list of a million items makes
    /// no million strings.
    items: [u32; NESTED],
    depth: u32,
}

/// Depth of nested lists whose indices are kept in `items`. A vector in a keyframe has three.
const NESTED: usize = 3;

/// Members of an object up to which names are compared one by one: a node has few, a graph may have a million nodes.
const SMALL: usize = 8;

/// A member of an object.
#[derive(Clone)]
pub(super) struct Entry<'a> {
    pub(super) name: &'a str,
    /// Where its name is in the text.
    pub(super) key: Range,
    pub(super) json: Json<'a>,
}

/// `1 number`, `2 numbers`.
pub(super) fn counted(count: usize, noun: &str) -> String {
    if count == 1 { format!("1 {noun}") } else { format!("{count} {noun}s") }
}

/// The path of member `name` of the object at `path`.
pub(super) fn member_path(path: &str, name: &str) -> String {
    // `$schema` needs no quotes.
    match (is_name(name.strip_prefix('$').unwrap_or(name)), path.is_empty()) {
        (true, true) => name.to_owned(),
        (true, false) => format!("{path}.{name}"),
        (false, _) => format!("{path}[\"{}\"]", shown(name)),
    }
}

/// Whether `name` is a valid id: `[A-Za-z_][A-Za-z0-9_-]*`.
pub(super) fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-')
}

/// A user's text as messages show it: shortened, and with control characters escaped.
pub(super) fn shown(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut short = String::new();
    for c in text.chars().take(LONGEST) {
        match c {
            // Harmless to a terminal, and escaped they would make paths unreadable.
            '\\' | '"' | '\'' => short.push(c),
            _ => short.extend(c.escape_debug()),
        }
    }
    if text.chars().nth(LONGEST).is_some() {
        short.push('…');
    }
    short
}

/// `did you mean …?` if a candidate is similar, else the candidates if they are few, else `None`. After many faults
/// there are no suggestions any more: nobody reads them, and each compares a name with all others.
pub(super) fn did_you_mean<'n>(
    before: &[Fault],
    name: &str,
    candidates: impl IntoIterator<Item = &'n str>,
    what: &str,
) -> Option<String> {
    const LISTED: usize = 24;
    /// The number of faults with suggestions.
    const SUGGESTED: usize = 1000;
    if before.len() >= SUGGESTED {
        return None;
    }
    let candidates: Vec<&str> = candidates.into_iter().take(MOST_CANDIDATES + 1).collect();
    match nearest(name, candidates.iter().copied()) {
        Some(near) => Some(format!("did you mean `{}`?", shown(near))),
        None if candidates.is_empty() => Some(format!("there are no {what}")),
        None if candidates.len() <= LISTED => {
            let names: Vec<String> = candidates.into_iter().map(shown).collect();
            Some(format!("{what}: `{}`", names.join("`, `")))
        }
        None => None,
    }
}

impl<'a> Entry<'a> {
    /// A fault of the key.
    pub(super) fn fault(&self, code: &'static str, fact: impl Into<String>) -> Fault {
        self.json.text.fault(self.key.start, &self.json.path(), code, fact)
    }

    /// The entry that a `--set` makes; its position is that of the value.
    pub(super) fn of_set(name: &'a str, json: Json<'a>) -> Self {
        Self { name, key: json.value.range(), json }
    }
}

impl<'a> Json<'a> {
    /// The root value of a text.
    pub(super) fn root(value: &'a Value<'a>, text: &'a Text<'a>) -> Self {
        Self::with_path(value, text, "")
    }

    fn with_path(value: &'a Value<'a>, text: &'a Text<'a>, path: &str) -> Self {
        Self { value, text, base: path.into(), items: [0; NESTED], depth: 0 }
    }

    /// Its path.
    pub(super) fn path(&self) -> String {
        let items = self.items[..self.depth as usize].iter().map(|index| format!("[{index}]"));
        std::iter::once(self.base.to_string()).chain(items).collect()
    }

    /// The number of bytes of its path, but for indices.
    pub(super) fn path_bytes(&self) -> usize {
        self.base.len()
    }

    /// The same value under another path.
    pub(super) fn at_path(&self, path: &str) -> Self {
        Self::with_path(self.value, self.text, path)
    }

    /// Item `index` of this list.
    pub(super) fn item(&self, value: &'a Value<'a>, index: usize) -> Self {
        let mut item = match (self.depth as usize) < NESTED {
            true => Self { value, ..self.clone() },
            false => Self::with_path(value, self.text, &self.path()),
        };
        item.items[item.depth as usize] = index as u32;
        item.depth += 1;
        item
    }

    /// A fault at the start of this value.
    pub(super) fn fault(&self, code: &'static str, fact: impl Into<String>) -> Fault {
        self.fault_at(self.value.start(), code, fact)
    }

    /// A fault of this value at byte `offset` of the text.
    pub(super) fn fault_at(&self, offset: usize, code: &'static str, fact: impl Into<String>) -> Fault {
        self.text.fault(offset, &self.path(), code, fact)
    }

    /// The fault of a value of the wrong type.
    pub(super) fn unexpected(&self, expected: &str) -> Fault {
        let fault = self.fault(code::WRONG_KIND, format!("found {}, expected {expected}", self.found()));
        match self.value {
            Value::NullKeyword(_) if self.depth == 0 => fault.hint("instead of `null`, leave the key out"),
            _ => fault,
        }
    }

    /// What this value is, in words.
    fn found(&self) -> String {
        match self.value {
            Value::StringLit(text) => format!("the string \"{}\"", shown(&text.value)),
            Value::NumberLit(number) => format!("the number {}", shown(number.value)),
            Value::BooleanLit(word) => format!("`{}`", word.value),
            Value::NullKeyword(_) => "`null`".into(),
            Value::Object(_) => "an object".into(),
            Value::Array(list) if list.elements.is_empty() => "an empty list".into(),
            Value::Array(list) => format!("a list of {}", counted(list.elements.len(), "item")),
        }
    }

    /// The members of an object, without duplicates.
    ///
    /// # Errors
    /// If this is not an object. A duplicate key is added to `faults`, and its first value is used.
    pub(super) fn members(&self, expected: &str, faults: &mut Vec<Fault>) -> Result<Vec<Entry<'a>>, Fault> {
        let Value::Object(object) = self.value else { return Err(self.unexpected(expected)) };
        let is_small = object.properties.len() <= SMALL;
        let mut firsts: BTreeMap<&str, usize> = BTreeMap::new();
        let mut entries: Vec<Entry<'a>> = Vec::with_capacity(object.properties.len());
        let path = self.path();
        for member in &object.properties {
            let (name, key) = (member.name.as_str(), member.name.range());
            let json = Json::with_path(&member.value, self.text, &member_path(&path, name));
            let entry = Entry { name, key, json };
            let first = match is_small {
                true => find(&entries, name).map(|entry| entry.key.start),
                false => firsts.get(name).copied(),
            };
            match first {
                Some(first) => {
                    let line = self.text.position(first).line;
                    let fact = format!("duplicate key `{}`, first set on line {line}", shown(name));
                    faults.push(entry.fault(code::DUPLICATE_KEY, fact).hint("keep one of them"));
                }
                None => {
                    if !is_small {
                        firsts.insert(name, key.start);
                    }
                    entries.push(entry);
                }
            }
        }
        Ok(entries)
    }

    /// Whether it is an object.
    pub(super) fn is_object(&self) -> bool {
        matches!(self.value, Value::Object(_))
    }

    /// The values of a list; `None` for anything else.
    pub(super) fn elements(&self) -> Option<&'a [Value<'a>]> {
        match self.value {
            Value::Array(list) => Some(&list.elements),
            _ => None,
        }
    }

    /// The content of a string; `None` for anything else.
    pub(super) fn string(&self) -> Option<&'a str> {
        match self.value {
            Value::StringLit(text) => Some(&text.value),
            _ => None,
        }
    }

    /// A finite number.
    pub(super) fn number(&self, expected: &str) -> Result<f64, Fault> {
        let Value::NumberLit(number) = self.value else { return Err(self.unexpected(expected)) };
        match number.value.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(x),
            _ => {
                let fault = self.fault(code::NUMBER_SIZE, format!("{} is too large", shown(number.value)));
                Err(fault.hint("expected a number within ±1.7e308"))
            }
        }
    }

    /// A whole number; 3.0 counts as one.
    pub(super) fn whole(&self, expected: &str) -> Result<i64, Fault> {
        let x = self.number(expected)?;
        let Value::NumberLit(number) = self.value else { return Err(self.unexpected(expected)) };
        match exact_whole(number.value) {
            Some(whole) => Ok(whole),
            None if x.fract() != 0.0 => Err(self.unexpected(expected).hint(format!("the nearest is {}", x.round()))),
            None => Err(self
                .fault(code::NUMBER_SIZE, format!("{} is too large", shown(number.value)))
                .hint("expected a whole number within ±9.2e18")),
        }
    }

    /// `true` or `false`.
    pub(super) fn bool(&self) -> Result<bool, Fault> {
        match self.value {
            Value::BooleanLit(word) => Ok(word.value),
            _ => Err(self.unexpected("`true` or `false`")),
        }
    }

    /// The byte offset in the text of character `skip` of this string; an escape sequence counts as one character.
    pub(super) fn offset_in_string(&self, skip: usize) -> usize {
        let range = self.value.range();
        let inner = &self.text.content[range.start + 1..range.end.saturating_sub(1).max(range.start + 1)];
        let mut at = 0;
        for _ in 0..skip {
            at += match inner.as_bytes().get(at..) {
                // A pair of surrogates is one character.
                Some([b'\\', b'u', b'd' | b'D', b'8' | b'9' | b'a' | b'b' | b'A' | b'B', ..]) => 12,
                Some([b'\\', b'u', ..]) => 6,
                Some([b'\\', ..]) => 2,
                _ => inner.get(at..).and_then(|rest| rest.chars().next()).map_or(0, char::len_utf8),
            };
        }
        range.start + 1 + at
    }
}

/// The exact value of a JSON number that is whole: `300`, `300.0`, `3e2`, `1e18`.
fn exact_whole(text: &str) -> Option<i64> {
    let (plain, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    let (whole, fraction) = plain.split_once('.').unwrap_or((plain, ""));
    let fraction = fraction.trim_end_matches('0');
    let exponent = exponent.parse::<i32>().ok()?.checked_sub(i32::try_from(fraction.len()).ok()?)?;
    let digits: i128 = format!("{whole}{fraction}").parse().ok()?;
    let scale = 10_i128.checked_pow(exponent.unsigned_abs());
    match (digits, scale) {
        (0, _) => Some(0),
        (_, Some(scale)) if exponent >= 0 => digits.checked_mul(scale)?.try_into().ok(),
        (_, Some(scale)) if digits % scale == 0 => (digits / scale).try_into().ok(),
        _ => None,
    }
}

/// Adds a fault for every entry whose name is not in `known`; `what` describes those: `keys of a node`.
pub(super) fn refuse_unknown(entries: &[Entry<'_>], known: &[&str], what: &str, faults: &mut Vec<Fault>) {
    for entry in entries.iter().filter(|entry| !known.contains(&entry.name)) {
        let fact = format!("unknown key `{}`", shown(entry.name));
        let hint = did_you_mean(faults, entry.name, known.iter().copied(), what);
        faults.push(Fault { hint, ..entry.fault(code::UNKNOWN_KEY, fact) });
    }
}

/// Whether one of the unknown keys is probably a misspelling of `key`, so that `key` need not be reported as missing.
pub(super) fn is_misspelt<'k>(entries: &[Entry<'_>], known: impl Iterator<Item = &'k str> + Clone, key: &str) -> bool {
    let unknown = entries.iter().filter(|entry| !known.clone().any(|known| known == entry.name));
    unknown.into_iter().any(|entry| nearest(entry.name, known.clone()) == Some(key))
}

/// The entry with that name.
pub(super) fn find<'e, 'a>(entries: &'e [Entry<'a>], name: &str) -> Option<&'e Entry<'a>> {
    entries.iter().find(|entry| entry.name == name)
}

/// The index of a string among `words`; `what` describes them in the fault of a string that is not among them.
pub(super) fn word(json: &Json<'_>, what: &str, words: &[&str]) -> Result<usize, Fault> {
    let listed = || words.iter().map(|word| format!("\"{word}\"")).collect::<Vec<_>>().join(", ");
    let Some(word) = json.string() else { return Err(json.unexpected(&format!("one of {}", listed()))) };
    words.iter().position(|known| *known == word).ok_or_else(|| {
        let fault = json.fault(code::UNKNOWN_WORD, format!("unknown {what} \"{}\"", shown(word)));
        match nearest(word, words.iter().copied()) {
            Some(near) => fault.hint(format!("did you mean \"{near}\"?")),
            None => fault.hint(format!("expected one of {}", listed())),
        }
    })
}

/// The value that was read; a fault is recorded in `faults`.
pub(super) fn keep<T>(read: Result<T, Fault>, faults: &mut Vec<Fault>) -> Option<T> {
    read.map_err(|fault| faults.push(fault)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_exact_in_every_notation() {
        let wholes = ["3", "-3.0", "3e2", "1.5E1", "1e18", "9.223372036854775807e18", "30e-1", "0e99999", "-0"];
        let expected = [3, -3, 300, 15, 1_000_000_000_000_000_000, i64::MAX, 3, 0, 0];
        assert_eq!(wholes.map(exact_whole), expected.map(Some));
        assert_eq!(["0.5", "1e19", "9223372036854775808", "15e-1", "1e99999999999"].map(exact_whole), [None; 5]);
    }

    #[test]
    fn shown_text_is_readable_and_has_no_control_characters() {
        assert_eq!(shown(r#"C:\fur\"a"'s.obj"#), r#"C:\fur\"a"'s.obj"#);
        assert_eq!(shown("\u{1b}[2J\n\u{202e}"), r"\u{1b}[2J\n\u{202e}");
    }
}
