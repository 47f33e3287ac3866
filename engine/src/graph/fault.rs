//! Faults: errors in a graph file, each with its position, the fact, and a hint on how to fix it.
//!
//! Promise: [`Fault::code`] of every fault found by a load is one of [`code::ALL`], and codes do not change between
//! versions, so scripts may test them. Limit: the wording of facts and hints may change.

use std::fmt;

use serde_json::{Value, json};

use crate::note::Note;

/// What is at fault; it determines the program's exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FaultClass {
    /// A file that the graph names cannot be read.
    File,
    /// The graph itself.
    Graph,
    /// No fault, but probably not what was meant: becomes a [`Note`] of the graph.
    Note,
}

/// One error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Its kind, one of [`code::ALL`].
    pub code: &'static str,
    /// Line, from 1; 0 if the graph was not read from a text.
    pub line: u32,
    /// Column in characters, from 1; 0 if the graph was not read from a text.
    pub column: u32,
    /// JSON path: `nodes.wind.params.wind_dir`. Empty for the file as a whole.
    pub path: String,
    /// What is wrong.
    pub fact: String,
    /// How to fix it.
    pub hint: Option<String>,
    /// What is at fault: a file or the graph.
    pub class: FaultClass,
    /// The key of the `--set` whose value is wrong; line and column are then positions in that value.
    pub set: Option<Box<str>>,
}

impl Fault {
    /// Adds a hint.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// Marks it as the fault of a file that cannot be read.
    #[must_use]
    pub(super) fn of_file(mut self) -> Self {
        self.class = FaultClass::File;
        self
    }

    /// Marks it as no fault, only probably not what was meant.
    #[must_use]
    pub(super) fn into_remark(mut self) -> Self {
        self.class = FaultClass::Note;
        self
    }

    /// It as a note of that kind, with its line and JSON path.
    pub(super) fn into_note(self) -> Note {
        let text = match &self.set {
            Some(_) => format!("--set {}: {}", self.path, self.fact),
            None => format!("line {}: {}: {}", self.line, self.path, self.fact),
        };
        Note { hint: self.hint, ..Note::new(self.code, text) }
    }

    /// The fault as a terminal shows it, `file` being the graph's name there:
    /// `` graph.json:12:7: nodes.wind.params.amplitude: `amplitude` is -1; expected at least 0 ``
    pub fn in_file(&self, file: &str) -> String {
        match &self.set {
            Some(key) => format!("--set {key}:{self}"),
            None if self.line == 0 => format!("{file}: {self}"),
            None => format!("{file}:{self}"),
        }
    }

    /// The object that `--json` prints in a list. Faults of a `--set` also have its key as `set`.
    pub fn to_json(&self) -> Value {
        let mut fault = json!({
            "code": self.code, "line": self.line, "column": self.column,
            "path": self.path, "fact": self.fact, "hint": self.hint,
        });
        if let Some(key) = &self.set {
            fault["set"] = json!(key);
        }
        fault
    }

    /// The sort key: faults of the file before those of `--set`, each by position.
    pub(super) fn order(&self) -> (bool, Option<&str>, u32, u32, &str) {
        (self.set.is_some(), self.set.as_deref(), self.line, self.column, &self.path)
    }
}

/// Shows position, path, fact and hint, without the file's name.
impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.line > 0 {
            write!(f, "{}:{}: ", self.line, self.column)?;
        }
        if !self.path.is_empty() {
            write!(f, "{}: ", self.path)?;
        }
        write!(f, "{}", self.fact)?;
        self.hint.as_ref().map_or(Ok(()), |hint| write!(f, "; {hint}"))
    }
}

impl std::error::Error for Fault {}

/// Kinds of faults.
pub mod code {
    macro_rules! codes {
        ($($(#[$meta:meta])* $name:ident = $code:literal;)*) => {
            $($(#[$meta])* pub const $name: &str = $code;)*
            /// All kinds that a load can give.
            pub const ALL: &[&str] = &[$($name),*];
        };
    }

    codes! {
        /// Bytes that are not UTF-8.
        ENCODING = "encoding";
        /// An empty file.
        EMPTY = "empty-file";
        /// Invalid JSON (comments and trailing commas are allowed).
        SYNTAX = "syntax";
        /// The text ends inside an object, list, string or comment.
        TRUNCATED = "truncated";
        /// Lists and objects nested too deeply.
        NESTING = "nesting";
        /// A key that appears twice in an object.
        DUPLICATE_KEY = "duplicate-key";
        /// A key that is not known there.
        UNKNOWN_KEY = "unknown-key";
        /// A required key that is missing.
        MISSING_KEY = "missing-key";
        /// A value of the wrong JSON type, such as a string for a number.
        WRONG_KIND = "wrong-kind";
        /// An unsupported format number.
        FORMAT = "format-number";
        /// Invalid frames, frame rate or seed.
        SCENE = "scene";
        /// An id or name with characters that are not allowed.
        BAD_NAME = "bad-name";
        /// A control whose name is reserved in expressions.
        RESERVED_NAME = "reserved-name";
        /// No such node type.
        UNKNOWN_TYPE = "unknown-type";
        /// The type has no such param.
        UNKNOWN_PARAM = "unknown-param";
        /// The type has no such input.
        UNKNOWN_INPUT = "unknown-input";
        /// No such node.
        UNKNOWN_NODE = "unknown-node";
        /// The node has no such output.
        UNKNOWN_PORT = "unknown-port";
        /// No such control.
        UNKNOWN_CONTROL = "unknown-control";
        /// A `--set` of a node or control that does not exist.
        UNKNOWN_SET = "unknown-set";
        /// A number that is not finite, or too large for its type.
        NUMBER_SIZE = "number-size";
        /// A value outside the hard range, or otherwise not allowed.
        ILLEGAL_VALUE = "illegal-value";
        /// A word that is not one of the options.
        UNKNOWN_WORD = "unknown-word";
        /// An object that sets a param in no known form, or in two.
        PARAM_FORM = "param-form";
        /// An animated value for a param that cannot be animated.
        NOT_ANIMATED = "not-animated";
        /// An empty list of keyframes.
        KEYFRAMES_EMPTY = "keyframes-empty";
        /// Keyframes that are not in the order of their frames.
        KEYFRAMES_UNORDERED = "keyframes-unordered";
        /// Two keyframes at one frame.
        KEYFRAMES_DOUBLED = "keyframes-doubled";
        /// Keyframes of lists that are not of one length.
        KEYFRAMES_LENGTHS = "keyframes-lengths";
        /// Invalid ramp keys.
        RAMP = "ramp";
        /// An invalid expression.
        EXPRESSION = "expression";
        /// A required input without a wire.
        MISSING_INPUT = "missing-input";
        /// More wires than the input accepts.
        TOO_MANY_WIRES = "too-many-wires";
        /// Nodes that depend on each other.
        CYCLE = "cycle";
        /// A wire that lacks the component that the input needs.
        WRONG_COMPONENT = "wrong-component";
        /// A bypassed node with an output that no input can replace.
        BYPASS = "bypass";
        /// A graph without outputs.
        NO_OUTPUTS = "no-outputs";
        /// An output that its file would hold twice.
        DOUBLED_OUTPUT = "doubled-output";
        /// A file that does not exist.
        FILE_MISSING = "file-missing";
        /// A file that cannot be read.
        FILE_UNREADABLE = "file-unreadable";
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault() -> Fault {
        Fault {
            code: code::ILLEGAL_VALUE,
            line: 12,
            column: 7,
            path: "nodes.wind.params.amplitude".into(),
            fact: "`amplitude` is -1".into(),
            hint: Some("expected at least 0".into()),
            class: FaultClass::Graph,
            set: None,
        }
    }

    #[test]
    fn a_terminal_shows_file_position_path_fact_and_hint() {
        let expected = "graph.json:12:7: nodes.wind.params.amplitude: `amplitude` is -1; expected at least 0";
        assert_eq!(fault().in_file("graph.json"), expected);
        let set = Fault { line: 1, column: 1, set: Some("wind.amplitude".into()), hint: None, ..fault() };
        let expected = "--set wind.amplitude:1:1: nodes.wind.params.amplitude: `amplitude` is -1";
        assert_eq!(set.in_file("graph.json"), expected);
        let whole = Fault { line: 0, column: 0, path: String::new(), hint: None, ..fault() };
        assert_eq!(whole.in_file("graph.json"), "graph.json: `amplitude` is -1");
    }

    #[test]
    fn json_has_exactly_the_documented_keys() {
        let expected = json!({"code": "illegal-value", "line": 12, "column": 7, "path": "nodes.wind.params.amplitude",
            "fact": "`amplitude` is -1", "hint": "expected at least 0"});
        assert_eq!(fault().to_json(), expected);
    }

    #[test]
    fn codes_are_kebab_case_and_unique() {
        for (index, code) in code::ALL.iter().enumerate() {
            assert!(code.bytes().all(|b| b.is_ascii_lowercase() || b == b'-'), "{code}");
            assert!(!code::ALL[..index].contains(code), "{code}");
        }
    }
}
