//! Where the parts of a graph stand in its file, so that what is found out after the load can be placed too.

use std::collections::BTreeMap;

use super::Graph;
use super::fault::{Fault, FaultClass};
use super::json::member_path;
use super::text::{Place, Text};

/// A part of a graph that something may be wrong with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part<'a> {
    /// The node of that id.
    Node(&'a str),
    /// A node's param.
    Param(&'a str, &'a str),
    /// A node's input.
    Input(&'a str, &'a str),
    /// The output of that name.
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

/// Line, column and, for a `--set`, its key.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Spot {
    line: u32,
    column: u32,
    set: Option<Box<str>>,
}

/// Places by path. Empty for a graph that was not read from a text.
#[derive(Clone, Debug, Default)]
pub struct Places(BTreeMap<String, Spot>);

impl Places {
    /// Remembers that what has that path stands at byte `offset` of the text.
    pub(super) fn note(&mut self, path: String, text: &Text<'_>, offset: usize) {
        let Place { line, column } = text.place(offset);
        self.0.insert(path, Spot { line, column, set: text.set.map(Into::into) });
    }

    /// The place of `path`, or of what it is in.
    fn of(&self, path: &str) -> Option<&Spot> {
        let parents = path.rmatch_indices('.').map(|(dot, _)| &path[..dot]);
        std::iter::once(path).chain(parents).find_map(|path| self.0.get(path))
    }
}

impl Graph {
    /// A fault of a part of this graph, found after the load: a file that a node cannot make sense of, an output that a
    /// format cannot hold. What the file does not set is placed at what it would be in.
    pub fn fault_at(&self, part: Part<'_>, code: &'static str, class: FaultClass, fact: impl Into<String>) -> Fault {
        let path = part.path();
        let (line, column, set) = match self.places.of(&path) {
            Some(spot) => (spot.line, spot.column, spot.set.clone()),
            None => (0, 0, None),
        };
        Fault { code, line, column, path, fact: fact.into(), hint: None, class, set }
    }
}
