//! Faults in a text, with their positions.
//!
//! Promise: every fault of a text is an [`ExprError`] with the position at which it was noticed. Limit: positions are
//! relative to the text; the engine adds node, param and file.

use std::fmt;

/// A position in a text: line, and column in characters, both from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Position {
    pub(super) line: u32,
    pub(super) column: u32,
}

impl Position {
    pub(super) const START: Position = Position { line: 1, column: 1 };

    pub(super) fn fault(self, fact: impl Into<String>) -> ExprError {
        ExprError { line: self.line as usize, column: self.column as usize, fact: fact.into(), hint: None }
    }
}

/// A fault in the text of an expression or a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExprError {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// What is wrong, without the position.
    pub fact: String,
    /// How to fix it.
    pub hint: Option<String>,
}

impl ExprError {
    pub(super) fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// Adds a hint: the candidate most similar to `name`, or else what `otherwise` returns.
    pub(super) fn suggest<'a>(
        self,
        name: &str,
        candidates: impl IntoIterator<Item = &'a str>,
        otherwise: impl FnOnce() -> Option<String>,
    ) -> Self {
        let hint = match super::suggest::nearest(name, candidates) {
            Some(near) => Some(format!("did you mean `{near}`?")),
            None => otherwise(),
        };
        ExprError { hint, ..self }
    }
}

impl fmt::Display for ExprError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}: {}", self.line, self.column, self.fact)?;
        match &self.hint {
            Some(hint) => write!(f, "; {hint}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for ExprError {}
