//! Positions of a graph's parts in its file, so that faults found after the load have a line and column too.

use std::collections::BTreeMap;

use super::Graph;
use super::fault::{Fault, FaultClass};
use super::json::member_path;
use super::text::{Position, Text};

/// A part of a graph that a fault can refer to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part<'a> {
    /// The node with that id.
    Node(&'a str),
    /// A node's param.
    Param(&'a str, &'a str),
    /// A node's input.
    Input(&'a str, &'a str),
    /// The output with that name.
    Output(&'a str),
}

impl Part<'_> {
    fn path(self) -> String {
        let of = |list: &str, name: &str| member_path(list, name);
        match self {
            Self::Node(id) => of("nodes", id),
            Self::Param(id, name) => of(&(of("nodes", id) + ".params"), name),
            Self::Input(id, name) => of(&(of("nodes", id) + ".inputs"), name),
            Self::Output(name) => of("outputs", name),
        }
    }
}

/// Line and column in the graph file, or in the value of a `--set` with its key.
#[derive(Clone, Debug, PartialEq, Eq)]
struct FilePosition {
    line: u32,
    column: u32,
    set: Option<Box<str>>,
}

/// Positions by JSON path. Empty for a graph that was not read from a text.
#[derive(Clone, Debug, Default)]
pub struct Positions(BTreeMap<String, FilePosition>);

impl Positions {
    /// Records that the value at `path` starts at byte `offset` of the text.
    pub(super) fn record(&mut self, path: String, text: &Text<'_>, offset: usize) {
        let Position { line, column } = text.position(offset);
        self.0.insert(path, FilePosition { line, column, set: text.set.map(Into::into) });
    }

    /// The position of `path`, or of the innermost parent that has one.
    fn of(&self, path: &str) -> Option<&FilePosition> {
        let parents = path.rmatch_indices('.').map(|(dot, _)| &path[..dot]);
        std::iter::once(path).chain(parents).find_map(|path| self.0.get(path))
    }
}

impl Graph {
    /// A fault of a part of this graph, found after the load: a file that a node cannot parse, an output that a format
    /// cannot hold. A part that the graph file does not set has the position of the object that it would be in.
    pub fn fault_at(&self, part: Part<'_>, code: &'static str, class: FaultClass, fact: impl Into<String>) -> Fault {
        let path = part.path();
        let (line, column, set) = match self.positions.of(&path) {
            Some(found) => (found.line, found.column, found.set.clone()),
            None => (0, 0, None),
        };
        Fault { code, line, column, path, fact: fact.into(), hint: None, class, set }
    }
}
