//! Errors of nodes: the fact alone. The engine adds node and frame, the program the rest.

use crate::geometry::{GeometryError, Name};
use crate::time::Frame;

/// What kind of trouble a node met; the program's exit code follows from it.
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
    /// The node broke its own declaration: a fault of convect, not of the graph.
    Contract,
    /// The cook was cancelled.
    Cancelled,
}

/// A fact and perhaps a hint, both without place: `` `wind_dir` is [0, 0, 0], which has no direction ``.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{fact}{}", hint.as_ref().map(|hint| format!("; {hint}")).unwrap_or_default())]
pub struct Error {
    /// What kind of trouble.
    pub kind: ErrorKind,
    /// What is so.
    pub fact: String,
    /// What to do about it.
    pub hint: Option<String>,
    /// The param that is to blame, where it is one.
    pub param: Option<&'static str>,
}

impl Error {
    /// An error of any kind.
    pub fn new(kind: ErrorKind, fact: impl Into<String>) -> Self {
        Self { kind, fact: fact.into(), hint: None, param: None }
    }

    /// The node refuses what it was given.
    pub fn refused(fact: impl Into<String>) -> Self {
        Self::new(ErrorKind::Refused, fact)
    }

    /// A file could not be read.
    pub fn file(fact: impl Into<String>) -> Self {
        Self::new(ErrorKind::File, fact)
    }

    /// The node broke its declaration.
    pub fn contract(fact: impl Into<String>) -> Self {
        Self::new(ErrorKind::Contract, fact)
    }

    /// Of a param: in a graph file the fault stands there.
    #[must_use]
    pub fn of(mut self, param: &'static str) -> Self {
        self.param = Some(param);
        self
    }

    /// With a hint.
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
    /// Which node.
    pub node: Name,
    /// Its type.
    pub type_name: &'static str,
    /// At which frame.
    pub frame: Frame,
    /// What went wrong.
    pub error: Error,
}

/// What a node returns.
pub type Result<T> = std::result::Result<T, Error>;
