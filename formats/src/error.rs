//! Errors of reading and writing geometry: position, fact and hint.

use std::io;

use engine::geometry::{GeometryError, Kind, Name};

use crate::Format;

/// A position in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilePosition {
    /// The file as a whole.
    File,
    /// A line, counted from 1.
    Line(usize),
    /// A line and a column, counted from 1.
    Column(usize, usize),
    /// A byte, counted from 0.
    Byte(usize),
}

impl std::fmt::Display for FilePosition {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Line(line) => write!(f, "line {line}: "),
            Self::Column(line, column) => write!(f, "line {line}, column {column}: "),
            Self::Byte(byte) => write!(f, "byte {byte}: "),
        }
    }
}

/// Why a geometry could not be read or written. The caller adds the path.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    /// The file holds something that is not geometry in this format.
    #[error("{position}{fact}")]
    Content {
        /// Where it is.
        position: FilePosition,
        /// What was found, and what was expected.
        fact: String,
        /// How to fix it.
        hint: Option<&'static str>,
    },
    /// No format has this name or extension.
    #[error("`{name}` is not a geometry format, expected one of {}", names(&Format::ALL))]
    Unknown {
        /// The name or extension.
        name: String,
    },
    /// USD is read by prim and time, see [`crate::usd::UsdStage`].
    #[error("it is USD, whose prims and times this does not select")]
    UsdIsAStage,
    /// The format keeps all frames in one file, which [`write`](crate::write) does not make.
    #[error("{format} keeps all frames in one file, expected a format with one file per frame")]
    OneFile {
        /// The format.
        format: Format,
    },
    /// The format has no way to store a component.
    #[error("{format} cannot hold {kind}")]
    CannotHold {
        /// The format.
        format: Format,
        /// The component.
        kind: Kind,
    },
    /// A NaN or infinity, which the format cannot hold or its reader refuses.
    #[error("`{name}` of {kind} is not finite in row {row}")]
    NotFinite {
        /// The component.
        kind: Kind,
        /// The attribute.
        name: Name,
        /// The first such row, from 0.
        row: usize,
    },
    /// Two components share a table of the file, but have different types for an attribute.
    #[error("`{name}` has different types on {first} and {second}, and ply has one table for both")]
    TypesDiffer {
        /// The attribute.
        name: Name,
        /// A component.
        first: Kind,
        /// The other.
        second: Kind,
    },
    /// A frame or time that is not finite.
    #[error("the frame is {frame} and its time {seconds} s, expected finite numbers")]
    Stamp {
        /// The frame.
        frame: f64,
        /// Its time, seconds.
        seconds: f64,
    },
    /// The bytes could not be written.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl FormatError {
    /// A fault of the content at `position`.
    pub(crate) fn at(position: FilePosition, fact: impl Into<String>) -> Self {
        Self::Content { position, fact: fact.into(), hint: None }
    }

    /// The same with a hint.
    pub(crate) fn with_hint(position: FilePosition, fact: impl Into<String>, hint: &'static str) -> Self {
        Self::Content { position, fact: fact.into(), hint: Some(hint) }
    }

    /// How to fix it, if known.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Content { hint, .. } => hint.map(str::to_owned),
            Self::UsdIsAStage => Some("read it by the node Usd_In".into()),
            Self::CannotHold { kind, .. } => Some(format!("formats that can: {}", names(&Format::holding([*kind])))),
            Self::NotFinite { .. } => Some("a NaN or infinity comes from the node that made this attribute".into()),
            Self::TypesDiffer { .. } => {
                Some("use json, write each component to its own file, or rename one of the attributes".into())
            }
            _ => None,
        }
    }
}

/// An inconsistent geometry, found after the whole file has been read.
impl From<GeometryError> for FormatError {
    fn from(error: GeometryError) -> Self {
        Self::at(FilePosition::File, error.to_string())
    }
}

fn names(formats: &[Format]) -> String {
    formats.iter().map(|format| format.name()).collect::<Vec<_>>().join(", ")
}
