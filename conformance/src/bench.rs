//! A bench for one node: inputs and params from a test, cooked as in a graph.
//!
//! ```ignore
//! let out = bench(&NODE).input(CURVES, curves).set(SHIELD, 0.5).cook();
//! assert_eq!(out.curves().get(SHIELDED), Some(&[0.5][..]));
//! ```

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use numerics::ramp::Interpolation;

use engine::cook::{Delivered, Engine, Report, Settings};
use engine::error::{CookError, Error};
use engine::geometry::{Component, Geometry, Kind};
use engine::graph::{Body, Graph, GraphNode, GraphOutput, Link, Scene};
use engine::node::{Input, Node};
use engine::param::{Keyframes, Param, ParamType, Shape, Source, Unset, Value};
use engine::plan::Request;
use engine::time::Frame;

/// A bench for `node`, with default params and no inputs.
pub fn bench(node: &'static Node) -> Bench {
    let specs: Arc<[_]> = node.param_specs().into();
    let scene = Scene { last: 48, ..Scene::default() };
    let params = specs.iter().map(|spec| match spec.facts.unset {
        Unset::Default => Source::Constant(spec.default.clone()),
        Unset::CurrentFrame => Source::CurrentFrame,
        Unset::CurrentTime => Source::CurrentTime,
        Unset::SceneStart => Source::Constant(Value::Int(scene.first)),
    });
    Bench {
        node,
        params: params.collect(),
        inputs: node.inputs.iter().map(|_| Vec::new()).collect(),
        changes: vec![None; node.inputs.len()],
        scene,
        frame: Frame::whole(1),
        threads: 2,
    }
}

type Moving = Arc<dyn Fn(Frame) -> Geometry + Send + Sync>;
/// Turns the geometry of a wire, given its index in its input, into another.
type Change = fn(usize, Geometry) -> Geometry;

/// One node with the inputs and params of a test.
#[derive(Clone)]
pub struct Bench {
    node: &'static Node,
    params: Vec<Source>,
    inputs: Vec<Vec<(Moving, bool)>>,
    changes: Vec<Option<Change>>,
    scene: Scene,
    frame: Frame,
    threads: usize,
}

impl Bench {
    /// Adds a wire to an input.
    ///
    /// # Panics
    /// If the node has no such input.
    #[must_use]
    pub fn input<A>(self, input: Input<A>, geometry: impl Into<Geometry>) -> Self {
        let geometry = geometry.into();
        self.wire(input.name(), Arc::new(move |_| geometry.clone()), false)
    }

    /// Adds a wire whose geometry moves.
    ///
    /// # Panics
    /// If the node has no such input.
    #[must_use]
    pub fn moving<A>(self, input: Input<A>, at: impl Fn(Frame) -> Geometry + Send + Sync + 'static) -> Self {
        self.wire(input.name(), Arc::new(at), true)
    }

    /// Changes the geometry of every wire of an input, whether added before or after this call: for inputs that accept
    /// only the output of a certain node.
    ///
    /// # Panics
    /// If the node has no such input.
    #[must_use]
    pub fn changed<A>(mut self, input: Input<A>, change: Change) -> Self {
        let place = self.node.inputs.iter().position(|declared| declared.spec().name == input.name());
        let place = place.unwrap_or_else(|| panic!("{} has no input `{}`", self.node.name, input.name()));
        self.changes[place] = Some(change);
        self
    }

    /// The source of each param's value, in the order of the declaration.
    pub(crate) fn sources(&self) -> &[Source] {
        &self.params
    }

    pub(crate) fn wire(mut self, input: &str, at: Moving, moves: bool) -> Self {
        let place = self.node.inputs.iter().position(|declared| declared.spec().name == input);
        let place = place.unwrap_or_else(|| panic!("{} has no input `{input}`", self.node.name));
        self.inputs[place].push((at, moves));
        self
    }

    /// Sets a param.
    ///
    /// # Panics
    /// If the node has no such param.
    #[must_use]
    pub fn set<T: ParamType>(self, param: Param<T>, value: T::Value) -> Self {
        self.source(param.name(), Source::Constant(T::erase(value)))
    }

    /// Animates a param with keys at frames, interpolated linearly.
    ///
    /// # Panics
    /// If the node has no such param.
    #[must_use]
    pub fn keyed<T: ParamType>(self, param: Param<T>, keys: &[(f64, T::Value)]) -> Self {
        let keys = keys.iter().map(|(frame, value)| (*frame, T::erase(value.clone()))).collect();
        let keys = Keyframes { keys, interpolation: Interpolation::Linear };
        self.source(param.name(), Source::Keys(Arc::new(keys), T::shape()))
    }

    /// Sets the source of a param's value.
    ///
    /// # Panics
    /// If the node has no such param.
    #[must_use]
    pub fn source(mut self, param: &str, source: Source) -> Self {
        let place = self.node.params.iter().position(|declared| declared.spec().name == param);
        let place = place.unwrap_or_else(|| panic!("{} has no param `{param}`", self.node.name));
        debug_assert!(!matches!(&source, Source::Keys(_, Shape::File)), "a file is not keyed");
        self.params[place] = source;
        self
    }

    /// The scene of the node; by default 48 frames at 24 frames per second.
    #[must_use]
    pub fn scene(mut self, scene: Scene) -> Self {
        self.scene = scene;
        self
    }

    /// The frame that [`Bench::cook`] cooks; by default 1.
    #[must_use]
    pub fn at(mut self, frame: f64) -> Self {
        self.frame = Frame::exactly(frame).expect("a test asks for frames in range, in whole ticks");
        self
    }

    /// The number of threads that cook; by default 2.
    #[must_use]
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// Cooks one frame of the first output.
    ///
    /// # Panics
    /// If the node refuses.
    pub fn cook(&self) -> BenchResult {
        self.try_cook().unwrap_or_else(|error| panic!("{error}"))
    }

    /// Cooks one frame of the first output.
    ///
    /// # Errors
    /// If the node refuses.
    pub fn try_cook(&self) -> Result<BenchResult, Error> {
        let mut frames = self.try_frames(&[self.frame]).map_err(|error| error.error.clone())?;
        Ok(frames.remove(0))
    }

    /// Cooks whole frames of the first output, in the order given.
    ///
    /// # Panics
    /// If the node refuses.
    pub fn frames(&self, frames: impl IntoIterator<Item = i64>) -> Vec<BenchResult> {
        let frames: Vec<Frame> = frames.into_iter().map(Frame::whole).collect();
        self.try_frames(&frames).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Cooks frames of the first output, in the order given.
    ///
    /// # Errors
    /// If the node refuses one of them.
    pub fn try_frames(&self, frames: &[Frame]) -> Result<Vec<BenchResult>, Arc<CookError>> {
        let graph = self.graph();
        let engine = Engine::new(&Settings { threads: self.threads, ..Settings::default() })
            .expect("the system starts a few threads");
        let engine = engine.comparing_samples(true);
        let (found, report) = cook_all(&engine, &graph, frames);
        if let Some((_, error, _)) = report.errors.into_iter().next() {
            return Err(error);
        }
        let metrics = |frame: Frame| {
            let of_node = report.nodes.last().map(|node| &node.metrics);
            let at = |(name, values): (&&'static str, &BTreeMap<Frame, f64>)| {
                values.get(&frame).map(|value| (*name, *value))
            };
            of_node.into_iter().flatten().filter_map(at).collect()
        };
        let result = |frame: &Frame| BenchResult {
            geometry: found.get(&(0, *frame)).expect("every frame was delivered").clone(),
            metrics: metrics(*frame),
        };
        Ok(frames.iter().map(result).collect())
    }

    /// The graph: the inputs, then the node, with an output for each output of the node.
    pub fn graph(&self) -> Graph {
        let mut nodes = Vec::new();
        let mut inputs = Vec::new();
        for ((declared, wires), change) in self.node.inputs.iter().zip(&self.inputs).zip(&self.changes) {
            let mut links = Vec::new();
            for (wire, (at, moves)) in wires.iter().enumerate() {
                links.push(Link { node: nodes.len(), port: 0 });
                let id = format!("{}{}", declared.spec().name, links.len()).into();
                let at: Moving = match *change {
                    Some(change) => {
                        let given = at.clone();
                        Arc::new(move |frame| change(wire, given(frame)))
                    }
                    None => at.clone(),
                };
                nodes.push(GraphNode { id, body: Body::Given { at, moves: *moves } });
            }
            inputs.push(links);
        }
        let outputs = self.node.outputs.iter().enumerate().map(|(port, output)| GraphOutput {
            name: output.name.into(),
            from: Link { node: nodes.len(), port },
            attributes: None,
            v: false,
        });
        let outputs = outputs.collect();
        let specs = self.node.param_specs().into();
        let body = Body::Node { node: self.node, specs, params: self.params.as_slice().into(), inputs };
        nodes.push(GraphNode { id: "node".into(), body });
        Graph { scene: self.scene.clone(), nodes, outputs, ..Graph::default() }
    }
}

/// Cooks all outputs of a graph at some frames: results by output and frame, and the report.
///
/// # Panics
/// If the request cannot be cooked at all.
pub fn cook_all(engine: &Engine, graph: &Graph, frames: &[Frame]) -> (BTreeMap<(usize, Frame), Arc<Geometry>>, Report) {
    let request = Request { outputs: (0..graph.outputs.len()).collect(), frames: frames.to_vec().into() };
    let mut found = BTreeMap::new();
    let mut sink = |finished: &[Delivered]| -> Result<(), std::convert::Infallible> {
        found.extend(finished.iter().map(|one| ((one.output, one.frame), one.geometry.clone())));
        Ok(())
    };
    let report = engine
        .cook(graph, &request, None, &AtomicBool::new(false), &mut sink)
        .unwrap_or_else(|stopped| panic!("{stopped:?}"));
    (found, report)
}

/// The result of a node at one frame.
#[derive(Clone, Debug)]
pub struct BenchResult {
    /// The first output.
    pub geometry: Arc<Geometry>,
    /// The published metrics, by name.
    pub metrics: BTreeMap<&'static str, f64>,
}

impl BenchResult {
    /// The component of a kind.
    ///
    /// # Panics
    /// If it is absent.
    pub fn part(&self, kind: Kind) -> &Component {
        self.geometry.part(kind).unwrap_or_else(|| panic!("the result has no {kind}"))
    }

    /// The curves.
    ///
    /// # Panics
    /// If there are none.
    pub fn curves(&self) -> &Component {
        self.part(Kind::Curves)
    }

    /// The mesh.
    ///
    /// # Panics
    /// If there is none.
    pub fn mesh(&self) -> &Component {
        self.part(Kind::Mesh)
    }
}
