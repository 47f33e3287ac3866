//! Plans: what must be cooked for a request, found from declarations alone.
//!
//! A plan looks at a graph once: which nodes the request depends on, which of them are the same at all frames, which
//! attributes are used downstream. What it finds is per node; frames are planned slice by slice while cooking, so a
//! plan's memory does not grow with the number of frames.

mod history;
mod keys;
mod live;
mod reads;
mod resolve;
mod result_keys;
mod segments;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

pub(crate) use history::Integrals;
pub(crate) use keys::{Keys, ResolvedFrame};
pub(crate) use reads::{Moment, OutputFrames, Read, Reads};
pub(crate) use resolve::Resolver;
pub use result_keys::result_keys;
pub(crate) use segments::ChainSegment;
pub use segments::Window;

use crate::error::{CookError, Error};
use crate::files::Files;
use crate::frames::FrameSet;
use crate::geometry::Name;
use crate::graph::{Body, Dag, Graph, GraphNode};
use crate::node::{Cook, LeftOut, Wires};
use crate::param::Params;
use crate::time::Frame;
use reads::read_spans;

/// Animated params are evaluated at no more frames than this to see what a request leaves out.
const MOST_FRAMES: usize = 10_000;

/// What is asked of a graph.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Indices in [`Graph::outputs`].
    pub outputs: Vec<usize>,
    /// Frames; each is cooked once.
    pub frames: FrameSet,
}

impl Request {
    /// All outputs at all frames of the scene.
    pub fn everything(graph: &Graph) -> Self {
        let outputs = (0..graph.outputs.len()).collect();
        Self { outputs, frames: FrameSet::whole(graph.scene.first, graph.scene.last) }
    }
}

/// What a plan knows of one node.
pub(crate) struct PlannedNode<'g> {
    /// Whether the request depends on it.
    pub(crate) needed: bool,
    /// Whether it is requested itself.
    pub(crate) requested: bool,
    /// Whether its result may change with the frame.
    pub(crate) varies: bool,
    /// Whether it is a solver or depends on one: cooked at whole frames only, in order.
    pub(crate) has_solver: bool,
    /// Whether it is a source that reads a sequence of files: between whole frames it goes from one to the next.
    pub(crate) reads_sequence: bool,
    /// Whether a later frame may have the same key: it varies by params and files alone.
    pub(crate) may_hold: bool,
    /// Whether a reader asks for its result at the scene's first frame.
    pub(crate) read_at_start: bool,
    /// Attributes of its result that are used downstream; `None`: all.
    pub(crate) live: Option<Vec<Name>>,
    /// Those of them that need not be there: all who read them take a missing one for neutral.
    pub(crate) if_there: Vec<Name>,
    /// Which of its outputs are used; a solver or window keeps no others. Empty: all.
    pub(crate) outputs_used: Vec<bool>,
    /// Whether a window or solver depends on it, which asks for every frame in turn.
    pub(crate) feeds_chain: bool,
    pub(crate) resolver: Resolver<'g>,
}

/// What must be cooked for a request.
pub struct Plan<'g> {
    pub(crate) graph: &'g Graph,
    pub(crate) request: Request,
    pub(crate) nodes: Vec<PlannedNode<'g>>,
    pub(crate) dag: Dag,
    pub(crate) files: Arc<Files>,
    /// Distinguishes the plans of one process: given geometry has no recipe, so its key is its node in this plan.
    pub(crate) number: u64,
}

impl<'g> Plan<'g> {
    /// Plans a request.
    ///
    /// # Errors
    /// Where a sub-frame is asked of an output that depends on a solver.
    pub fn new(graph: &'g Graph, request: &Request, files: Arc<Files>) -> Result<Self, Arc<CookError>> {
        let request = request.clone();
        let dag = Dag::of(graph);
        let needed = dag.upstream(request.outputs.iter().map(|output| graph.outputs[*output].from.node));
        let mut nodes: Vec<PlannedNode<'g>> = Vec::with_capacity(graph.nodes.len());
        for (node, needed) in graph.nodes.iter().zip(&needed) {
            // Of a node that is not needed, neither params nor files are looked at.
            let planned = match needed {
                true => plan_node(node, graph, &files, &mut nodes),
                false => PlannedNode::not_needed(node, graph, &files),
            };
            nodes.push(planned);
        }
        request.outputs.iter().for_each(|output| nodes[graph.outputs[*output].from.node].requested = true);
        for index in (0..nodes.len()).rev() {
            let chain = |reader: usize| {
                nodes[reader].feeds_chain || graph.nodes[reader].node().is_some_and(|node| node.cook.is_chain())
            };
            nodes[index].feeds_chain = dag.readers(index).any(|reader| needed[reader] && chain(reader));
        }
        live::find(graph, &request, &mut nodes);
        static PLANS: AtomicU64 = AtomicU64::new(0);
        let plan = Self { graph, request, nodes, dag, files, number: PLANS.fetch_add(1, Ordering::Relaxed) };
        plan.check_sub_frames()?;
        Ok(plan)
    }

    /// The same plan, with all outputs of every node kept: results on disk are for cooks of other outputs, too.
    #[must_use]
    pub(crate) fn keeping_all_outputs(mut self) -> Self {
        self.nodes.iter_mut().for_each(|node| node.outputs_used.clear());
        self
    }

    fn check_sub_frames(&self) -> Result<(), Arc<CookError>> {
        let Some(frame) = self.request.frames.fraction() else { return Ok(()) };
        for output in self.request.outputs.iter().map(|output| &self.graph.outputs[*output]) {
            if self.nodes[output.from.node].has_solver {
                let fact = format!("output `{}` comes from a solver, which has only whole frames", output.name);
                let error = Error::refused(fact).hint("request whole frames");
                return Err(Arc::new(self.error(output.from.node, frame, error)));
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

    /// Stages of `node` that are left out at every frame of the request, of which the first [`MOST_FRAMES`] are looked at.
    pub fn left_out(&self, node: usize) -> Vec<LeftOut> {
        let resolver = &self.nodes[node].resolver;
        let at = |frame: Frame| resolver.at(frame).map(|params| self.left_out_with(node, &params)).unwrap_or_default();
        let mut stages = at(self.canonical(node, self.request.frames.first().unwrap_or(self.graph.scene.start())));
        if resolver.is_animated() {
            for frame in self.request.frames.iter().take(MOST_FRAMES) {
                if stages.is_empty() {
                    break;
                }
                let here = at(frame);
                stages.retain(|stage| here.contains(stage));
            }
        }
        stages
    }

    /// What a node says of itself with its params at the frame where it starts; nothing where those are refused.
    pub fn explained(&self, node: usize) -> Vec<String> {
        let (scene, resolver) = (&self.graph.scene, &self.nodes[node].resolver);
        let Some(explains) = self.graph.nodes[node].node().and_then(|declared| declared.explains) else {
            return Vec::new();
        };
        let start = self.graph.nodes[node].node().zip(resolver.at(scene.start()).ok());
        let start =
            start.and_then(|(declared, params)| declared.start_frame(&params)).map_or(scene.start(), Frame::whole);
        resolver.at(start).map(|params| explains(&params, scene.clock())).unwrap_or_default()
    }

    fn left_out_with(&self, node: usize, params: &Params) -> Vec<LeftOut> {
        let Body::Node { node: declared, inputs, .. } = &self.graph.nodes[node].body else { return Vec::new() };
        let wires = |name: &str| {
            let index = declared.inputs.iter().position(|input| input.spec().name == name);
            index.map_or(0, |index| inputs[index].len())
        };
        declared.left_out(params, &Wires(&wires))
    }

    /// The needed nodes that read `node`, each once, in the order of the graph.
    pub(crate) fn readers(&self, node: usize) -> impl Iterator<Item = usize> {
        self.dag.readers(node).filter(|reader| self.nodes[*reader].needed)
    }

    /// A node and all that it depends on, in the order of the graph.
    pub(crate) fn ancestors(&self, node: usize) -> Vec<usize> {
        let upstream = self.dag.upstream([node]);
        (0..=node).filter(|index| upstream[*index]).collect()
    }
}

impl<'g> PlannedNode<'g> {
    fn not_needed(node: &'g GraphNode, graph: &Graph, files: &Arc<Files>) -> Self {
        Self {
            needed: false,
            requested: false,
            varies: false,
            has_solver: false,
            reads_sequence: false,
            may_hold: false,
            read_at_start: false,
            live: None,
            if_there: Vec::new(),
            outputs_used: Vec::new(),
            feeds_chain: false,
            resolver: Resolver::lazy(node, graph, files),
        }
    }
}

/// Plans a needed node; `before` are the nodes before it, among them all that it reads.
fn plan_node<'g>(
    node: &'g GraphNode,
    graph: &Graph,
    files: &Arc<Files>,
    before: &mut [PlannedNode<'g>],
) -> PlannedNode<'g> {
    let resolver = Resolver::new(node, graph, files);
    let (varies, may_hold, has_solver) = match &node.body {
        Body::Given { moves, .. } => (*moves, false, false),
        Body::Node { node: declared, inputs, .. } => {
            let start = resolver.at(graph.scene.start());
            // Where params are refused at the start, the error comes out when that frame is cooked.
            let clock = match (&declared.cook, &start) {
                (Cook::Pure(_) | Cook::Window(..), _) => false,
                (Cook::Frame { reads_clock, .. }, Ok(params)) => reads_clock(params),
                (Cook::Frame { .. }, Err(_)) => true,
                (Cook::Solver(..), _) => true,
            };
            let spans = read_spans(declared, start.as_ref().ok());
            let mut moving_input = false;
            for (span, link) in spans.iter().zip(inputs).flat_map(|(span, links)| links.iter().map(move |l| (span, l)))
            {
                moving_input |= span.moves && before[link.node].varies;
                before[link.node].read_at_start |= span.start;
            }
            let reads =
                |test: &dyn Fn(&PlannedNode<'_>) -> bool| inputs.iter().flatten().any(|link| test(&before[link.node]));
            let pure = matches!(declared.cook, Cook::Pure(_));
            let may_hold = pure && !reads(&|source| source.varies && !source.may_hold);
            let has_solver = matches!(declared.cook, Cook::Solver(..)) || reads(&|source| source.has_solver);
            (clock || resolver.is_animated() || moving_input, may_hold, has_solver)
        }
    };
    PlannedNode {
        varies,
        has_solver,
        reads_sequence: node.node().is_some_and(|declared| declared.inputs.is_empty()) && resolver.reads_sequence(),
        may_hold,
        resolver,
        needed: true,
        requested: false,
        read_at_start: false,
        live: None,
        if_there: Vec::new(),
        outputs_used: Vec::new(),
        feeds_chain: false,
    }
}
