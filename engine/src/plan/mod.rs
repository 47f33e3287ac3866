//! Plans: what must be cooked for what is asked, found from declarations alone.
//!
//! A plan looks at a graph once: which nodes anything asked depends on, which of them stand still, which attributes
//! anything downstream takes. What it finds is per node; frames are planned slice by slice while cooking, so a plan's
//! memory does not grow with the number of frames.

mod keys;
mod live;
mod resolve;
mod result_keys;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

pub use keys::Window;
pub(crate) use keys::{Keys, Stretch};
pub(crate) use resolve::{Resolver, numbered_path};
pub use result_keys::result_keys;

use crate::cook::CookError;
use crate::error::Error;
use crate::files::Files;
use crate::geometry::Name;
use crate::graph::{Body, Graph, Link};
use crate::node::{Cook, LeftOut, Node, Times, Wires};
use crate::param::Params;
use crate::time::Frame;

/// What is asked of a graph.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Places in [`Graph::outputs`].
    pub outputs: Vec<usize>,
    /// Frames, in any order; each is cooked once.
    pub frames: Vec<Frame>,
}

impl Request {
    /// All outputs at all frames of the scene.
    pub fn everything(graph: &Graph) -> Self {
        let frames = (graph.scene.first..=graph.scene.last).map(Frame::whole).collect();
        Self { outputs: (0..graph.outputs.len()).collect(), frames }
    }
}

/// What a plan knows of one node.
pub(crate) struct Planned {
    /// Whether anything asked depends on it.
    pub(crate) needed: bool,
    /// Whether its result may change with the frame.
    pub(crate) varies: bool,
    /// Whether it is a solver or anything above it is: whole frames only, in order.
    pub(crate) has_solver: bool,
    /// Whether equal keys may come again at a later frame: it varies by params and files alone.
    pub(crate) may_hold: bool,
    /// Whether a reader asks for its result at the scene's start.
    pub(crate) read_at_start: bool,
    /// Attributes of its result that anything takes; `None`: all.
    pub(crate) live: Option<Vec<Name>>,
    /// Nodes that read it, each once.
    pub(crate) readers: Vec<usize>,
    /// Whether a window or solver depends on it, so that it is asked for frame after frame.
    pub(crate) feeds_chain: bool,
    pub(crate) resolver: Resolver,
}

/// What must be cooked for a request.
pub struct Plan<'g> {
    pub(crate) graph: &'g Graph,
    pub(crate) request: Request,
    pub(crate) nodes: Vec<Planned>,
    pub(crate) files: Arc<Files>,
    /// Tells plans of one process apart: geometry that a program gives is known by its place in one plan alone.
    pub(crate) number: u64,
}

impl<'g> Plan<'g> {
    /// Plans a request.
    ///
    /// # Errors
    /// Where a sub-frame is asked of something that a solver is part of.
    pub fn new(graph: &'g Graph, request: &Request, files: Arc<Files>) -> Result<Self, Arc<CookError>> {
        let mut request = request.clone();
        request.frames.sort_unstable();
        request.frames.dedup();
        let needed = needed(graph, &request);
        let mut nodes: Vec<Planned> = Vec::with_capacity(graph.nodes.len());
        for (place, node) in graph.nodes.iter().enumerate() {
            let above =
                |test: &dyn Fn(&Planned) -> bool| node.inputs().iter().flatten().any(|link| test(&nodes[link.node]));
            // What is not needed is not looked at: neither its params nor its files are anyone's business.
            let resolver = match needed[place] {
                true => Resolver::new(node, graph, &files),
                false => Resolver::unasked(node, graph, &files),
            };
            let (varies, may_hold, has_solver) = match &node.body {
                _ if !needed[place] => (false, false, false),
                Body::Given { moves, .. } => (*moves, false, false),
                Body::Node { node: declared, inputs, .. } => {
                    let solver = matches!(declared.cook, Cook::Solver(..));
                    let start = resolver.at(graph.scene.start());
                    // Where params are refused at the start, the error comes out when that frame is cooked.
                    let clock = match (&declared.cook, &start) {
                        (Cook::Pure(_) | Cook::Window(..), _) => false,
                        (Cook::Frame { reads_clock, .. }, Ok(params)) => reads_clock(params),
                        (Cook::Frame { .. }, Err(_)) => true,
                        (Cook::Solver(..), _) => true,
                    };
                    let moving_input = declared.inputs.iter().zip(inputs).any(|(input, links)| {
                        let times = start.as_ref().map_or(Times::NOW, |params| (input.spec().times)(params));
                        (times.now || times.steps > 0) && links.iter().any(|link| nodes[link.node].varies)
                    });
                    let plain = matches!(declared.cook, Cook::Pure(_));
                    let hold = plain && !above(&|up| up.varies && !up.may_hold);
                    (clock || resolver.is_animated() || moving_input, hold, solver || above(&|up| up.has_solver))
                }
            };
            nodes.push(Planned {
                needed: needed[place],
                varies,
                has_solver,
                may_hold,
                read_at_start: false,
                live: None,
                readers: Vec::new(),
                feeds_chain: false,
                resolver,
            });
        }
        for (place, node) in graph.nodes.iter().enumerate().filter(|(place, _)| needed[*place]) {
            for link in node.inputs().iter().flatten() {
                let readers = &mut nodes[link.node].readers;
                if readers.last() != Some(&place) {
                    readers.push(place);
                }
            }
        }
        for (place, node) in graph.nodes.iter().enumerate().filter(|(place, _)| needed[*place]) {
            let (Some(declared), Ok(params)) = (node.node(), nodes[place].resolver.at(graph.scene.start())) else {
                continue;
            };
            for (input, links) in declared.inputs.iter().zip(node.inputs()) {
                if (input.spec().times)(&params).start {
                    links.iter().for_each(|link| nodes[link.node].read_at_start = true);
                }
            }
        }
        for place in (0..nodes.len()).rev() {
            let chain = |reader: usize| {
                nodes[reader].feeds_chain || graph.nodes[reader].node().is_some_and(|node| node.cook.is_chain())
            };
            nodes[place].feeds_chain = nodes[place].readers.iter().any(|reader| chain(*reader));
        }
        live::find(graph, &request, &mut nodes);
        static PLANS: AtomicU64 = AtomicU64::new(0);
        let plan = Self { graph, request, nodes, files, number: PLANS.fetch_add(1, Ordering::Relaxed) };
        plan.check_sub_frames()?;
        Ok(plan)
    }

    fn check_sub_frames(&self) -> Result<(), Arc<CookError>> {
        let Some(frame) = self.request.frames.iter().find(|frame| !frame.is_whole()) else { return Ok(()) };
        for output in self.request.outputs.iter().map(|place| &self.graph.outputs[*place]) {
            if self.nodes[output.from.node].has_solver {
                let fact = format!("output `{}` comes from a solver, which knows whole frames only", output.name);
                let error = Error::refused(fact).hint("ask for whole frames");
                return Err(Arc::new(self.error(output.from.node, *frame, error)));
            }
        }
        Ok(())
    }

    /// The params of a node (its index in [`Graph::nodes`]) at a frame, as a cook would resolve them.
    ///
    /// # Errors
    /// Where a value is refused or a file cannot be read.
    pub fn params(&self, node: usize, frame: Frame) -> crate::Result<Params> {
        self.nodes[node].resolver.at(frame)
    }

    pub(crate) fn error(&self, node: usize, frame: Frame, error: Error) -> CookError {
        let node = &self.graph.nodes[node];
        CookError { node: node.id.clone(), type_name: node.type_name(), frame, error }
    }

    /// Stages of `node` that are left out at every frame asked.
    pub fn left_out(&self, node: usize) -> Vec<LeftOut> {
        let resolver = &self.nodes[node].resolver;
        let at = |frame: Frame| resolver.at(frame).map(|params| self.left_out_with(node, &params)).unwrap_or_default();
        let mut stages =
            at(self.canonical(node, self.request.frames.first().copied().unwrap_or(self.graph.scene.start())));
        if resolver.is_animated() {
            for frame in &self.request.frames {
                if stages.is_empty() {
                    break;
                }
                let here = at(*frame);
                stages.retain(|stage| here.contains(stage));
            }
        }
        stages
    }

    pub(crate) fn left_out_with(&self, node: usize, params: &Params) -> Vec<LeftOut> {
        let Body::Node { node: declared, inputs, .. } = &self.graph.nodes[node].body else { return Vec::new() };
        let wires = |name: &str| {
            let place = declared.inputs.iter().position(|input| input.spec().name == name);
            place.map_or(0, |place| inputs[place].len())
        };
        declared.left_out(params, &Wires(&wires))
    }

    /// The frame that stands for `frame` where `node` does not vary.
    pub(crate) fn canonical(&self, node: usize, frame: Frame) -> Frame {
        if self.nodes[node].varies { frame } else { self.graph.scene.start() }
    }

    /// The frame at which a chain whose state starts at `frame` reads what it reads at the start: a solver where its
    /// state starts, a window at the scene's start, wherever its anchors are.
    pub(crate) fn start_of(&self, declared: &Node, frame: Frame) -> Frame {
        if matches!(declared.cook, Cook::Window(..)) { self.graph.scene.start() } else { frame }
    }

    /// The whole frames at which a window must be known for `frame`: itself, or two neighbours each way. Inside the
    /// scene none lies past its end, where inputs may have nothing more to give.
    pub(crate) fn neighbours(&self, frame: Frame) -> Vec<i64> {
        let floor = frame.floor_number();
        if frame.is_whole() {
            return vec![floor];
        }
        let last = self.graph.scene.last;
        let after = if floor < last { last.min(floor + 2) } else { floor + 2 };
        vec![floor - 1, floor, floor + 1, after]
    }

    /// A node and all that it depends on, in the order of the graph.
    pub(crate) fn ancestors(&self, node: usize) -> Vec<usize> {
        let mut above = vec![false; node + 1];
        above[node] = true;
        for place in (0..=node).rev() {
            if above[place] {
                self.graph.nodes[place].inputs().iter().flatten().for_each(|link| above[link.node] = true);
            }
        }
        (0..=node).filter(|place| above[*place]).collect()
    }

    /// The wires of an input.
    pub(crate) fn links(&self, node: usize, input: usize) -> &[Link] {
        &self.graph.nodes[node].inputs()[input]
    }
}

/// Which nodes anything asked depends on.
fn needed(graph: &Graph, request: &Request) -> Vec<bool> {
    let mut needed = vec![false; graph.nodes.len()];
    for output in &request.outputs {
        needed[graph.outputs[*output].from.node] = true;
    }
    for place in (0..graph.nodes.len()).rev() {
        if needed[place] {
            for link in graph.nodes[place].inputs().iter().flatten() {
                needed[link.node] = true;
            }
        }
    }
    needed
}
