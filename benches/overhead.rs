//! Overhead of the engine: the time per node and frame of a chain of nodes that do nothing.
//!
//! `cargo bench --bench overhead -- [NODES] [FRAMES] [THREADS]`

use std::sync::atomic::AtomicBool;

use engine::clock::Stopwatch;
use engine::cook::{Delivered, Engine, Settings};
use engine::geometry::{Component, Geometry, Kind};
use engine::graph::{Body, Graph, GraphNode, GraphOutput, Link, Scene};
use engine::node::{Chain, Cook, FrameCx, Input, Node, Output, Outputs, Past, StepCx};
use engine::plan::Request;

const POINTS: Input = Input::one("points", Kind::Points, "Points.");
const OUT: Output = Output::like("points", &POINTS, "The same points.");
const MADE: Output = Output::new("points", &[Kind::Points], "A point.");

static SOURCE: Node = Node::new(
    "Source",
    1,
    "A point.",
    Cook::Pure(|_| Ok(MADE.with(Geometry::from(Component::points(vec![[0.0; 3]]))))),
)
.outputs(&[&MADE]);

/// Depends on the frame; passes its input on.
static FRAME: Node = Node::new(
    "Frame",
    1,
    "Hands points on.",
    Cook::Frame { cook: |cx| Ok(OUT.with(cx.input(POINTS).clone())), reads_clock: |_| true },
)
.inputs(&[&POINTS])
.outputs(&[&OUT]);

struct Nothing;

impl Chain for Nothing {
    fn start(_: &FrameCx) -> engine::Result<Self> {
        Ok(Self)
    }
    fn step(&mut self, _: &StepCx) -> engine::Result<()> {
        Ok(())
    }
    fn output(&self, cx: &FrameCx) -> engine::Result<Outputs> {
        Ok(OUT.with(cx.input(POINTS).clone()))
    }
}

/// Reads eight past frames; passes its input on.
static WINDOW: Node = Node::new("Window", 1, "Hands points on.", Cook::window::<Nothing>(|_, _| Past::frames(8)))
    .inputs(&[&POINTS])
    .outputs(&[&OUT]);

/// `count` nodes in a row, the first over a frame node over a still source.
fn graph(node: &'static Node, count: usize, frames: i64) -> Graph {
    let body =
        |node: &'static Node, inputs| Body::Node { node, specs: node.param_specs().into(), params: [].into(), inputs };
    let mut nodes = vec![GraphNode { id: "source".into(), body: body(&SOURCE, Vec::new()) }];
    for place in 0..=count {
        let kind = if place == 0 { &FRAME } else { node };
        let inputs = vec![vec![Link { node: place, port: 0 }]];
        nodes.push(GraphNode { id: format!("node{place}").into(), body: body(kind, inputs) });
    }
    let from = Link { node: count + 1, port: 0 };
    let outputs = vec![GraphOutput { name: "out".into(), from, attributes: None, v: false }];
    Graph { scene: Scene { last: frames, ..Scene::default() }, nodes, outputs, ..Graph::default() }
}

/// Microseconds per node and frame.
fn cost(node: &'static Node, count: usize, frames: i64, threads: usize) -> Result<f64, String> {
    let graph = graph(node, count, frames);
    let engine = Engine::new(&Settings { threads, ..Settings::default() })?;
    let mut delivered = 0;
    let mut sink = |finished: &[Delivered]| -> Result<(), String> {
        delivered += finished.len();
        Ok(())
    };
    let watch = Stopwatch::start();
    let report = engine.cook(&graph, &Request::everything(&graph), None, &AtomicBool::new(false), &mut sink);
    let wall = watch.wall();
    report.map_err(|stopped| format!("{stopped:?}"))?;
    assert_eq!(delivered as i64, frames, "every frame is delivered");
    Ok(wall.as_secs_f64() * 1e6 / (count as f64 * frames as f64))
}

fn main() -> Result<(), String> {
    let mut numbers =
        std::env::args().skip(1).map(|text| text.parse::<usize>().map_err(|error| format!("`{text}`: {error}")));
    let mut next = |default| numbers.next().unwrap_or(Ok(default));
    let (count, frames, threads) = (next(100)?, next(1_000)? as i64, next(2)?);
    for node in [&FRAME, &WINDOW] {
        let cost = cost(node, count, frames, threads)?;
        println!("{}: {cost:.2} µs a node and frame ({count} nodes, {frames} frames, {threads} threads)", node.name);
    }
    Ok(())
}
