//! Graphs: nodes of a catalogue, wired and with their params set, and what is to come out.

mod catalogue;
mod dag;
pub mod fault;
mod json;
mod load;
mod places;
mod schema;
mod syntax;
mod text;

use std::path::PathBuf;
use std::sync::Arc;

use crate::files::numbered_path;
use crate::geometry::{Geometry, Kind, Name};
use crate::node::{Carries, Node, Output};
use crate::param::{Clock, ParamSpec, Source};
use crate::time::Frame;

pub use catalogue::Catalogue;
pub(crate) use dag::Dag;
pub use fault::{Fault, FaultClass};
pub use load::{FileProbe, probe};
pub use places::{Part, Places};
pub use schema::schema;

/// What holds for the whole graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// First frame.
    pub first: i64,
    /// Last frame, itself included.
    pub last: i64,
    /// Frames a second.
    pub fps: f64,
    /// Mixed into every node's seed.
    pub seed: i64,
    /// Where positions are relative to, metres.
    pub origin: [f64; 3],
}

impl Default for Scene {
    fn default() -> Self {
        Self { first: 1, last: 1, fps: 24.0, seed: 0, origin: [0.0; 3] }
    }
}

impl Scene {
    /// What expressions know of it.
    pub fn clock(&self) -> Clock {
        Clock { fps: self.fps, seed: self.seed }
    }

    /// The first frame.
    pub fn start(&self) -> Frame {
        Frame::whole(self.first)
    }

    /// The last frame.
    pub fn end(&self) -> Frame {
        Frame::whole(self.last)
    }
}

/// One end of a wire: an output of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Link {
    /// Place of the node in [`Graph::nodes`].
    pub node: usize,
    /// Place of the output in the node's declaration.
    pub port: usize,
}

/// What a node of a graph does.
#[derive(Clone)]
pub enum Body {
    /// A node of the catalogue: its params in the order of the declaration, wires in the order of its inputs.
    Node {
        /// The declaration.
        node: &'static Node,
        /// The declaration's params.
        specs: Arc<[ParamSpec]>,
        /// Where each param's value comes from.
        params: Vec<Source>,
        /// Wires of each input.
        inputs: Vec<Vec<Link>>,
    },
    /// Geometry given by the program that holds the graph, a function of the frame. One output.
    Given {
        /// The function.
        at: Arc<dyn Fn(Frame) -> Geometry + Send + Sync>,
        /// Whether it changes with the frame.
        moves: bool,
    },
}

/// A node of a graph.
#[derive(Clone)]
pub struct GraphNode {
    /// Its id.
    pub id: Name,
    /// What it does.
    pub body: Body,
}

/// Something that is to come out.
#[derive(Clone, Debug, PartialEq)]
pub struct GraphOutput {
    /// Its name, and its file's.
    pub name: Name,
    /// Where it comes from.
    pub from: Link,
    /// The attributes to write; all where `None`.
    pub attributes: Option<Vec<Name>>,
    /// Whether velocities are to be written.
    pub v: bool,
}

/// A graph that was checked: ids and names are unique, wires fit and make no cycle, params are in range.
#[derive(Clone, Default)]
pub struct Graph {
    /// What holds for the whole.
    pub scene: Scene,
    /// The nodes, each after all it is wired to.
    pub nodes: Vec<GraphNode>,
    /// What is to come out, in the order of the file.
    pub outputs: Vec<GraphOutput>,
    /// The folder that relative paths start from.
    pub folder: PathBuf,
    /// Where its parts stand in the file.
    pub places: Places,
}

impl Graph {
    /// The files the nodes read at some frames, as the params name them; numbered ones at the whole frames.
    pub fn files(&self, frames: &[Frame]) -> Vec<PathBuf> {
        let mut files = Vec::new();
        for node in &self.nodes {
            let Body::Node { params, .. } = &node.body else { continue };
            for source in params {
                match source {
                    Source::File { path, numbered: false } => files.push(path.to_path_buf()),
                    Source::File { path, numbered: true } => {
                        files.extend(frames.iter().map(|frame| numbered_path(path, frame.floor_number())));
                    }
                    _ => {}
                }
            }
        }
        files
    }

    /// The components that come out at an output of a node, as its declaration says; nothing of given geometry.
    pub fn carries(&self, link: Link) -> Vec<Kind> {
        let mut carried: Vec<Vec<Vec<Kind>>> = Vec::with_capacity(link.node + 1);
        for node in &self.nodes[..=link.node] {
            let outputs = node.node().map_or(&[][..], |declared| declared.outputs);
            let of_input = |name: &str| {
                let inputs = node.node().map_or(&[][..], |declared| declared.inputs);
                let place = inputs.iter().position(|input| input.spec().name == name);
                let links = place.map_or(&[][..], |place| &node.inputs()[place]);
                let mut kinds: Vec<Kind> =
                    links.iter().flat_map(|link| carried[link.node][link.port].clone()).collect();
                kinds.sort_unstable();
                kinds.dedup();
                kinds
            };
            carried.push(if node.node().is_none() {
                vec![Vec::new()]
            } else {
                let carries = |output: &&Output| match output.carries {
                    Carries::Kinds(kinds) => kinds.to_vec(),
                    Carries::Like(input) | Carries::Union(input) => of_input(input),
                };
                outputs.iter().map(carries).collect()
            });
        }
        carried.swap_remove(link.node).swap_remove(link.port)
    }
}

impl GraphNode {
    /// The declaration, where there is one.
    pub fn node(&self) -> Option<&'static Node> {
        match &self.body {
            Body::Node { node, .. } => Some(node),
            Body::Given { .. } => None,
        }
    }

    /// Wires of each input.
    pub fn inputs(&self) -> &[Vec<Link>] {
        match &self.body {
            Body::Node { inputs, .. } => inputs,
            Body::Given { .. } => &[],
        }
    }

    /// The type's name; `given` where the program gives the geometry.
    pub fn type_name(&self) -> &'static str {
        self.node().map_or("given", |node| node.name)
    }
}

#[cfg(test)]
mod tests;
