//! Errors of nodes. A node states only the fact; the engine adds node and frame, and the program the graph file.

use crate::geometry::{GeometryError, Name};
use crate::time::Frame;

/// The kind of an error; it determines the program's exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// A file could not be read.
    File,
    /// The node refuses its input or params.
    Refused,
    /// A result was NaN or infinite.
    NotFinite,
    /// The node panicked.
    Panic,
    /// The node violated its own declaration: a bug in convect, not a fault of the graph.
    Contract,
    /// The cook was cancelled.
    Cancelled,
}

/// The hint of errors that are not the user's.
pub(crate) const IS_A_BUG: &str = "this is a bug in convect; please report it with the graph";

/// A fact and an optional hint, neither of which names the node: `` `wind_dir` is [0, 0, 0], which has no direction ``.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{fact}{}", hint.as_ref().map(|hint| format!("; {hint}")).unwrap_or_default())]
pub struct Error {
    /// Its kind.
    pub kind: ErrorKind,
    /// What is wrong.
    pub fact: String,
    /// How to fix it.
    pub hint: Option<String>,
    /// The param that caused the error, if one did.
    pub param: Option<&'static str>,
    /// Whether it depends only on which attributes there are and of which type, so that a check can find it.
    pub of_types: bool,
}

impl Error {
    /// An error of that kind.
    pub fn new(kind: ErrorKind, fact: impl Into<String>) -> Self {
        Self { kind, fact: fact.into(), hint: None, param: None, of_types: false }
    }

    /// The node refuses its input or params.
    pub fn refused(fact: impl Into<String>) -> Self {
        Self::new(ErrorKind::Refused, fact)
    }

    /// A file could not be read.
    pub fn file(fact: impl Into<String>) -> Self {
        Self::new(ErrorKind::File, fact)
    }

    /// The node violated its declaration.
    pub fn contract(fact: impl Into<String>) -> Self {
        Self::new(ErrorKind::Contract, fact).hint(IS_A_BUG)
    }

    /// Names the param that caused the error: the fault is reported at its position in the graph file.
    #[must_use]
    pub fn of(mut self, param: &'static str) -> Self {
        self.param = Some(param);
        self
    }

    /// Marks it as depending only on which attributes there are and of which type, whatever their rows.
    #[must_use]
    pub fn of_types(mut self) -> Self {
        self.of_types = true;
        self
    }

    /// Adds a hint.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

impl From<GeometryError> for Error {
    fn from(error: GeometryError) -> Self {
        Self::refused(error.to_string())
    }
}

/// Why a node could not cook.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{node}` ({type_name}) at frame {frame}: {error}")]
pub struct CookError {
    /// The node's id.
    pub node: Name,
    /// Its type.
    pub type_name: &'static str,
    /// The frame.
    pub frame: Frame,
    /// What went wrong.
    pub error: Error,
}

/// What a node returns.
pub type Result<T> = std::result::Result<T, Error>;
