//! Builds graphs in code, cooks them, and gives access to the results.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Once};

use engine::cook::{Delivered, DiskCache, Engine, NodeReport, Report, Settings};
use engine::geometry::{Component, Geometry};
use engine::graph::{Body, Graph, GraphNode, GraphOutput, Link, Positions, Scene};
use engine::node::Node;
use engine::param::{Keyframes, ParamType, Source};
use engine::plan::Request;
use engine::time::Frame;
use numerics::ramp::Interpolation;

/// A graph under construction.
#[derive(Clone)]
pub(crate) struct TestGraph(pub(crate) Graph);

/// A node under construction.
pub(crate) struct NodeBuilder<'n> {
    graph: &'n mut TestGraph,
    id: &'static str,
    node: &'static Node,
    params: Vec<Source>,
    inputs: Vec<Vec<Link>>,
}

impl TestGraph {
    /// A graph with these frames, at 24 frames per second.
    pub(crate) fn new(first: i64, last: i64) -> Self {
        let scene = Scene { first, last, ..Scene::default() };
        Self(Graph {
            scene,
            nodes: Vec::new(),
            outputs: Vec::new(),
            folder: PathBuf::new(),
            positions: Positions::default(),
            bypassed: std::collections::BTreeSet::new(),
            notes: Vec::new(),
        })
    }

    pub(crate) fn add(&mut self, id: &'static str, node: &'static Node) -> NodeBuilder<'_> {
        let params = node.param_specs().iter().map(|spec| Source::Constant(spec.default.clone())).collect();
        let inputs = vec![Vec::new(); node.inputs.len()];
        NodeBuilder { graph: self, id, node, params, inputs }
    }

    /// Adds geometry supplied by the test that depends on the frame.
    pub(crate) fn given(&mut self, id: &'static str, at: impl Fn(Frame) -> Geometry + Send + Sync + 'static) -> Link {
        self.push(id, Body::Given { at: Arc::new(at), moves: true })
    }

    /// Adds geometry supplied by the test that is the same at all frames.
    pub(crate) fn still(&mut self, id: &'static str, geometry: Geometry) -> Link {
        self.push(id, Body::Given { at: Arc::new(move |_| geometry.clone()), moves: false })
    }

    fn push(&mut self, id: &'static str, body: Body) -> Link {
        self.0.nodes.push(GraphNode { id: id.into(), body });
        Link { node: self.0.nodes.len() - 1, port: 0 }
    }

    /// Adds an output, named after its node.
    pub(crate) fn output(&mut self, from: Link) -> &mut GraphOutput {
        let name = self.0.nodes[from.node].id.clone();
        self.0.outputs.push(GraphOutput { name, from, attributes: None, v: false });
        self.0.outputs.last_mut().expect("just pushed")
    }

    /// This graph with a param replaced.
    #[must_use]
    pub(crate) fn with(mut self, id: &str, param: &str, source: Source) -> Self {
        let index = self.index(id);
        let Body::Node { node, params, .. } = &mut self.0.nodes[index].body else { panic!("`{id}` is given") };
        std::sync::Arc::make_mut(params)[param_index(node, param)] = source;
        self
    }

    pub(crate) fn index(&self, id: &str) -> usize {
        self.0.nodes.iter().position(|node| &*node.id == id).unwrap_or_else(|| panic!("no node `{id}`"))
    }

    /// Cooks whole frames of all outputs in a new engine.
    pub(crate) fn cook(&self, frames: impl IntoIterator<Item = i64>) -> Cooked {
        self.cook_in(&engine(2, 1 << 30), frames)
    }

    pub(crate) fn cook_in(&self, engine: &Engine, frames: impl IntoIterator<Item = i64>) -> Cooked {
        let frames: Vec<Frame> = frames.into_iter().map(Frame::whole).collect();
        self.cook_with(engine, &frames, None)
    }

    /// Cooks frames of all outputs, including fractional ones.
    pub(crate) fn cook_with(&self, engine: &Engine, frames: &[Frame], disk: Option<&mut DiskCache>) -> Cooked {
        let request = Request { outputs: (0..self.0.outputs.len()).collect(), frames: frames.to_vec().into() };
        let mut found = BTreeMap::new();
        let mut sink = |finished: &[Delivered]| -> Result<(), std::convert::Infallible> {
            found.extend(finished.iter().map(|one| ((one.output, one.frame), one.geometry.clone())));
            Ok(())
        };
        let cancel = AtomicBool::new(false);
        let report = engine.cook(&self.0, &request, disk, &cancel, &mut sink).unwrap_or_else(|stop| panic!("{stop:?}"));
        let ids = self.0.nodes.iter().map(|node| node.id.to_string()).collect();
        Cooked { found, report, ids }
    }
}

impl<'n> NodeBuilder<'n> {
    pub(crate) fn set<T: ParamType<Value = T>>(self, param: &str, value: T) -> Self {
        self.source(param, Source::Constant(T::erase(value)))
    }

    pub(crate) fn keyed(self, param: &str, keys: &[(f64, f32)]) -> Self {
        self.source(param, keyed(keys))
    }

    pub(crate) fn source(mut self, param: &str, source: Source) -> Self {
        self.params[param_index(self.node, param)] = source;
        self
    }

    pub(crate) fn wire(mut self, input: &str, link: Link) -> Self {
        let index = self.node.input_specs().iter().position(|spec| spec.name == input);
        self.inputs[index.unwrap_or_else(|| panic!("no input `{input}`"))].push(link);
        self
    }

    pub(crate) fn done(self) -> Link {
        let Self { graph, id, node, params, inputs } = self;
        graph.push(id, Body::Node { node, specs: node.param_specs().into(), params: params.into(), inputs })
    }

    /// Adds the node and an output of it.
    pub(crate) fn out(self) -> Link {
        let Self { graph, id, node, params, inputs } = self;
        let link = graph.push(id, Body::Node { node, specs: node.param_specs().into(), params: params.into(), inputs });
        graph.output(link);
        link
    }
}

fn param_index(node: &Node, param: &str) -> usize {
    let index = node.param_specs().iter().position(|spec| spec.name == param);
    index.unwrap_or_else(|| panic!("{} has no param `{param}`", node.name))
}

/// Keyframes of numbers with linear interpolation.
pub(crate) fn keyed(keys: &[(f64, f32)]) -> Source {
    let keys = keys.iter().map(|(frame, number)| (*frame, f32::erase(*number))).collect();
    Source::Keys(Arc::new(Keyframes { keys, interpolation: Interpolation::Linear }), f32::shape())
}

pub(crate) fn engine(threads: usize, memory: usize) -> Engine {
    Engine::new(&Settings { threads, memory, ..Settings::default() }).expect("threads")
}

/// Runs `work`, which panics on purpose. From then on panics of cooking threads are not printed; those of tests are.
pub(crate) fn quietly<T>(work: impl FnOnce() -> T) -> T {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let print = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !std::thread::current().name().is_some_and(|name| name.starts_with("convect ")) {
                print(panic);
            }
        }));
    });
    work()
}

pub(crate) fn at(frame: f64) -> Frame {
    Frame::exactly(frame).expect("a frame")
}

/// Points on the x axis.
pub(crate) fn row(xs: &[f32]) -> Geometry {
    Component::points(xs.iter().map(|x| [*x, 0.0, 0.0]).collect()).into()
}

/// The results of a cook.
pub(crate) struct Cooked {
    pub(crate) found: BTreeMap<(usize, Frame), Arc<Geometry>>,
    pub(crate) report: Report,
    ids: Vec<String>,
}

impl Cooked {
    /// The geometry of the first output at a frame.
    pub(crate) fn geometry(&self, frame: f64) -> &Geometry {
        self.found.get(&(0, at(frame))).unwrap_or_else(|| panic!("no frame {frame}: {:?}", self.report.errors))
    }

    /// x of the first output's first point at a frame.
    pub(crate) fn x(&self, frame: f64) -> f32 {
        self.geometry(frame).points().expect("points").positions()[0][0]
    }

    /// x of the first output's first point at all delivered frames, ascending.
    pub(crate) fn xs(&self) -> Vec<f32> {
        let first = self.found.keys().filter(|(output, _)| *output == 0);
        first.map(|(_, frame)| self.x(frame.number())).collect()
    }

    /// The bits of all delivered geometry.
    pub(crate) fn bits(&self) -> BTreeMap<(usize, Frame), Vec<u8>> {
        self.found.iter().map(|(index, geometry)| (*index, bits(geometry))).collect()
    }

    pub(crate) fn node(&self, id: &str) -> &NodeReport {
        let index = self.ids.iter().position(|other| other == id).unwrap_or_else(|| panic!("no node `{id}`"));
        &self.report.nodes[index]
    }

    pub(crate) fn cooks(&self, id: &str) -> u64 {
        self.node(id).cooks
    }

    /// The first error as shown on a terminal.
    pub(crate) fn error(&self) -> String {
        self.report.errors.first().expect("an error").1.to_string()
    }
}

/// The bits of a geometry of points and curves.
pub(crate) fn bits(geometry: &Geometry) -> Vec<u8> {
    let mut bits = Vec::new();
    for part in geometry.parts() {
        bits.push(part.kind() as u8);
        bits.extend(part.runs().starts().iter().flat_map(|start| start.to_le_bytes()));
        for (owner, name, column) in part.columns() {
            bits.push(owner as u8);
            bits.extend(name.bytes());
            bits.extend(column.to_bytes());
        }
    }
    bits
}
