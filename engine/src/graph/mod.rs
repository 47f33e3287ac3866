//! Graphs: nodes of a catalogue with their params and wires, and the outputs to write.

mod catalogue;
mod dag;
pub mod fault;
mod json;
mod load;
mod positions;
mod schema;
mod syntax;
mod text;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use crate::files::existing_files;
use crate::geometry::{Geometry, Kind, Name};
use crate::node::{Carries, Node, Output};
use crate::note::Note;
use crate::param::{Clock, ParamSpec, Source};
use crate::time::Frame;

pub use catalogue::Catalogue;
pub(crate) use dag::Dag;
pub use fault::{Fault, FaultClass};
pub use load::{FileProbe, probe};
pub use positions::{Part, Positions};
pub use schema::schema;

/// Settings of the whole graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// First frame.
    pub first: i64,
    /// Last frame, inclusive.
    pub last: i64,
    /// Frames per second.
    pub fps: f64,
    /// Mixed into every node's seed.
    pub seed: i64,
    /// The point that positions are relative to, in metres.
    pub origin: [f64; 3],
}

impl Default for Scene {
    fn default() -> Self {
        Self { first: 1, last: 1, fps: 24.0, seed: 0, origin: [0.0; 3] }
    }
}

impl Scene {
    /// What expressions read of the scene.
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
    /// Index of the node in [`Graph::nodes`].
    pub node: usize,
    /// Index of the output in the node's declaration.
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
        /// Where each param's value comes from. Nodes of one type that set none share them.
        params: Arc<[Source]>,
        /// Wires of each input.
        inputs: Vec<Vec<Link>>,
    },
    /// Geometry supplied by the calling program as a function of the frame. One output.
    Given {
        /// The function.
        at: Arc<dyn Fn(Frame) -> Geometry + Send + Sync>,
        /// Whether the geometry changes with the frame.
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

/// An output to write.
#[derive(Clone, Debug, PartialEq)]
pub struct GraphOutput {
    /// Its name, which is also the name of its file; `FILE/PRIM` where the file, a USD stage, has a prim for each of
    /// several outputs. These follow each other.
    pub name: Name,
    /// The node output that is written.
    pub from: Link,
    /// The attributes to write; `None` for all.
    pub attributes: Option<Vec<Name>>,
    /// Whether to write velocities.
    pub v: bool,
}

impl GraphOutput {
    /// The name of its file.
    pub fn file(&self) -> &str {
        self.name.split_once('/').map_or(&self.name, |(file, _)| file)
    }

    /// The name of its prim, if it shares its file with other outputs.
    pub fn prim(&self) -> Option<&str> {
        self.name.split_once('/').map(|(_, prim)| prim)
    }
}

/// A checked graph: ids and names are unique, wires connect compatible ports without a cycle, params are in range.
#[derive(Clone, Default)]
pub struct Graph {
    /// Settings of the whole graph.
    pub scene: Scene,
    /// The nodes, each after all nodes that it reads.
    pub nodes: Vec<GraphNode>,
    /// The outputs to write, in the order of the file.
    pub outputs: Vec<GraphOutput>,
    /// The folder that relative paths are resolved against.
    pub folder: PathBuf,
    /// Line and column of its parts in the graph file.
    pub positions: Positions,
    /// The ids of bypassed nodes. No wire comes from them: what read them reads what they pass.
    pub bypassed: BTreeSet<Name>,
    /// What is probably not as it was meant, found without cooking.
    pub notes: Vec<Note>,
}

impl Graph {
    /// How a person finds a wire of a node: the node that it comes from and the input. `inputs`: those that it is counted
    /// through, with `+` between them; `number`: from 0.
    pub(crate) fn wire_name(&self, node: &GraphNode, inputs: &str, number: usize) -> Option<String> {
        let Body::Node { node, inputs: wires, .. } = &node.body else { return None };
        let of_input = |name: &str| node.inputs.iter().position(|input| input.spec().name == name);
        let counted = inputs.split('+').filter_map(|name| Some((name, &wires[of_input(name)?])));
        let (name, link) = counted.flat_map(|(name, links)| links.iter().map(move |link| (name, link))).nth(number)?;
        Some(format!("`{}` at `{name}`", self.nodes[link.node].id))
    }

    /// The files that the nodes may read. Of a sequence these are all that exist, whatever frames are cooked.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files = Vec::new();
        for node in &self.nodes {
            let Body::Node { params, .. } = &node.body else { continue };
            for source in params.iter() {
                match source {
                    Source::File { path, numbered: false } => files.push(path.to_path_buf()),
                    Source::File { path, numbered: true } => files.extend(existing_files(path)),
                    _ => {}
                }
            }
        }
        files
    }

    /// The components that a node's output carries, according to its declaration; empty for [`Body::Given`].
    pub fn carries(&self, link: Link) -> Vec<Kind> {
        let mut carried: Vec<Vec<Vec<Kind>>> = Vec::with_capacity(link.node + 1);
        for node in &self.nodes[..=link.node] {
            let outputs = node.node().map_or(&[][..], |declared| declared.outputs);
            let of_input = |name: &str| {
                let inputs = node.node().map_or(&[][..], |declared| declared.inputs);
                let index = inputs.iter().position(|input| input.spec().name == name);
                let links = index.map_or(&[][..], |index| &node.inputs()[index]);
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
    /// The declaration of the node type; `None` for [`Body::Given`].
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

    /// The name of the node type; `given` for [`Body::Given`].
    pub fn type_name(&self) -> &'static str {
        self.node().map_or("given", |node| node.name)
    }
}

#[cfg(test)]
mod tests;
