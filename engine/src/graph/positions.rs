//! Positions of a graph's parts in its file, so that faults found after the load have a line and column too.

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
    /// The output with that name; of several in one file, their list.
    Output(&'a str),
}

impl Part<'_> {
    fn path(self) -> String {
        let of = |list: &str, name: &str| member_path(list, name);
        match self {
            Self::Node(id) => of("nodes", id),
            Self::Param(id, name) => of(&(of("nodes", id) + ".params"), name),
            Self::Input(id, name) => of(&(of("nodes", id) + ".inputs"), name),
            Self::Output(name) => of("outputs", name.split_once('/').map_or(name, |(file, _)| file)),
        }
    }
}

/// Line and column in the graph file, or in the value of a `--set`.
#[derive(Clone, Copy, Debug)]
struct FilePosition {
    /// Where its JSON path starts and ends in [`Positions::paths`]. A graph file is far smaller than 4 GiB.
    path: [u32; 2],
    line: u32,
    column: u32,
    /// Index of its `--set`, or [`NO_SET`].
    set: u32,
}

/// The `set` of a position in the file.
const NO_SET: u32 = u32::MAX;

/// Positions by JSON path. Empty for a graph that was not read from a text. All paths are in one string, because a graph
/// may have millions.
#[derive(Clone, Debug, Default)]
pub struct Positions {
    paths: String,
    /// Ascending by path once they are [sorted](Self::sort).
    all: Vec<FilePosition>,
    sets: Vec<Box<str>>,
    /// The last position in the file that was recorded, and its offset.
    last: Option<(usize, Position)>,
}

impl Positions {
    /// With room for that many positions whose paths have that many bytes.
    pub(super) fn with_capacity(count: usize, bytes: usize) -> Self {
        Self { paths: String::with_capacity(bytes), all: Vec::with_capacity(count), ..Self::default() }
    }

    /// Records that the value at `path` starts at byte `offset` of the text.
    pub(super) fn record(&mut self, path: &str, text: &Text<'_>, offset: usize) {
        let known = self.last.filter(|_| text.set.is_none());
        let position = known.map_or_else(|| text.position(offset), |last| text.position_after(last, offset));
        if text.set.is_none() {
            self.last = Some((offset, position));
        }
        let Position { line, column } = position;
        let set = text.set.map_or(NO_SET, |set| {
            let known = self.sets.iter().position(|known| **known == *set);
            known.unwrap_or_else(|| {
                self.sets.push(set.into());
                self.sets.len() - 1
            }) as u32
        });
        let start = self.paths.len() as u32;
        self.paths.push_str(path);
        self.all.push(FilePosition { path: [start, self.paths.len() as u32], line, column, set });
    }

    /// Makes positions findable, after the last was recorded.
    pub(super) fn sort(&mut self) {
        let paths = &self.paths;
        self.all.sort_by(|a, b| a.path_in(paths).cmp(b.path_in(paths)));
        self.all.shrink_to_fit();
        self.paths.shrink_to_fit();
    }

    /// The position of `path`, or of the innermost parent that has one.
    fn of(&self, path: &str) -> Option<&FilePosition> {
        let parents = path.rmatch_indices('.').map(|(dot, _)| &path[..dot]);
        let find = |path: &str| {
            let found = self.all.binary_search_by(|known| known.path_in(&self.paths).cmp(path));
            found.ok().map(|index| &self.all[index])
        };
        std::iter::once(path).chain(parents).find_map(find)
    }
}

impl FilePosition {
    fn path_in<'p>(&self, paths: &'p str) -> &'p str {
        &paths[self.path[0] as usize..self.path[1] as usize]
    }
}

impl Graph {
    /// Where a part stands in the graph's file, `file` being its name on a terminal: `graph.json:12:7`. As precise as is
    /// known: a part that the file does not set has the position of the object that it would be in.
    pub fn place(&self, file: &str, part: Part<'_>) -> String {
        let Some(FilePosition { line, column, set, .. }) = self.positions.of(&part.path()) else {
            return file.to_owned();
        };
        match self.positions.sets.get(*set as usize) {
            Some(key) => format!("--set {key}:{line}:{column}"),
            None => format!("{file}:{line}:{column}"),
        }
    }

    /// A fault of a part of this graph, found after the load: a file that a node cannot parse, an output that a format
    /// cannot hold. A part that the graph file does not set has the position of the object that it would be in.
    pub fn fault_at(&self, part: Part<'_>, code: &'static str, class: FaultClass, fact: impl Into<String>) -> Fault {
        let path = part.path();
        let (line, column, set) = match self.positions.of(&path) {
            Some(found) => (found.line, found.column, self.positions.sets.get(found.set as usize).cloned()),
            None => (0, 0, None),
        };
        Fault { code, line, column, path, fact: fact.into(), hint: None, class, set }
    }
}
