//! The README's figures: `cargo bench --bench figures`.
//!
//! Each figure is the minimum of several runs, interleaved with a fixed calibration loop; ratios to that loop can be
//! compared between machines and days.

use std::convert::Infallible;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

mod timing;

use engine::cook::{Delivered, Engine, Report, Settings};
use engine::geometry::{Component, Geometry};
use engine::graph::{Body, Graph, GraphNode, GraphOutput, Link, Scene, probe};
use engine::param::Source;
use engine::plan::Request;
use engine::prelude::*;
use engine::time::Frame;
use timing::Figures;

/// The program's own.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

const ROUNDS: usize = 7;

fn main() {
    convect::allocator::keep_freed_pages();
    let mut figures = Figures::default();
    let engine = Engine::new(&Settings::default()).expect("threads");
    timing::print_machine(&engine);
    let bear = bear_wind();
    let small = wind_on(10_000, 5);
    let large = wind_on(1_000_000, 5);
    let chain = trivial_chain(100);
    for _ in 0..ROUNDS {
        figures.calibrate();
        figures.add("bear_wind, a frame", 48, cook(&engine, &bear, 48).cooking);
        figures.add("Curve_Wind, 10,000 × 5, a frame", 48, node_time(&cook(&engine, &small, 48)));
        figures.add("Curve_Wind, 1,000,000 × 5, a frame", 4, node_time(&cook(&engine, &large, 4)));
        figures.add("a trivial node, a frame (100 × 1,000)", 100_000, cook(&engine, &chain, 1000).cooking);
    }
    figures.print();
    let linear = figures.least("Curve_Wind, 1,000,000 × 5, a frame") / figures.least("Curve_Wind, 10,000 × 5, a frame");
    println!("1,000,000 curves cost {linear:.1} times 10,000");
    let fresh = || Engine::new(&Settings::default()).expect("threads");
    let [short, long] = [100, 1000].map(|frames| cook(&fresh(), &chain, frames).peak_bytes);
    println!("peak of results, 100 trivial nodes: {short} bytes for 100 frames, {long} for 1,000");
}

fn cook(engine: &Engine, graph: &Graph, frames: i64) -> Report {
    let request =
        Request { outputs: (0..graph.outputs.len()).collect(), frames: (1..=frames).map(Frame::whole).collect() };
    let mut nothing = |_: &[Delivered]| -> std::result::Result<(), Infallible> { Ok(()) };
    engine.cook(graph, &request, None, &AtomicBool::new(false), &mut nothing).expect("it cooks")
}

fn node_time(report: &Report) -> Duration {
    report.nodes.iter().find(|node| node.type_name == "Curve_Wind").map(|node| node.wall).unwrap_or_default()
}

fn bear_wind() -> Graph {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/bear_wind/bear_wind.json");
    let text = std::fs::read_to_string(&path).expect("the example graph");
    Graph::load(&text, path.parent().expect("a folder"), convect::CATALOGUE, &[], &probe).expect("a sound graph")
}

/// Curve_Wind with its defaults on upright curves spread over a square.
fn wind_on(curves: usize, cvs: usize) -> Graph {
    let side = (curves as f64).sqrt().ceil() as usize;
    let cv = |i: usize, k: usize| [(i % side) as f32 * 0.01, k as f32 * 0.02, (i / side) as f32 * 0.01];
    let points: Vec<[f32; 3]> = (0..curves).flat_map(|i| (0..cvs).map(move |k| cv(i, k))).collect();
    let given = Geometry::from(Component::curves(vec![cvs as u32; curves], points).expect("curves"));
    let node = convect::CATALOGUE.get("Curve_Wind").expect("it is in the catalogue");
    chain_of(given, &[node])
}

const CURVES: Input = Input::one("curves", Kind::Curves, "Curves.");
const SHIFT: Param<f64> = Param::double("shift", 0.0, "Does nothing.");
const OUT: Output = Output::like("curves", &CURVES, "The curves.");

/// Depends on the frame; passes its input on.
static TRIVIAL: Node = Node::new(
    "Trivial",
    1,
    "Hands on what it got.",
    Cook::Frame {
        cook: |cx| {
            std::hint::black_box(cx.get(SHIFT));
            Ok(OUT.with(cx.input(CURVES).clone()))
        },
        reads_clock: |_| true,
    },
)
.inputs(&[&CURVES])
.params(&[&SHIFT])
.outputs(&[&OUT]);

fn trivial_chain(nodes: usize) -> Graph {
    let one = Component::curves(vec![2], vec![[0.0; 3], [0.0, 1.0, 0.0]]).expect("a curve");
    chain_of(one.into(), &vec![&TRIVIAL; nodes])
}

/// Nodes one after the other, each with its defaults, on given curves.
fn chain_of(given: Geometry, types: &[&'static Node]) -> Graph {
    let mut nodes = vec![GraphNode {
        id: "given".into(),
        body: Body::Given { at: Arc::new(move |_| given.clone()), moves: false },
    }];
    for node in types {
        let before = Link { node: nodes.len() - 1, port: 0 };
        let specs: Arc<[_]> = node.param_specs().into();
        let params: Arc<[_]> = specs.iter().map(|spec| Source::Constant(spec.default.clone())).collect();
        let body = Body::Node { node, specs, params, inputs: vec![vec![before]] };
        nodes.push(GraphNode { id: format!("n{}", nodes.len()).into(), body });
    }
    let from = Link { node: nodes.len() - 1, port: 0 };
    let outputs = vec![GraphOutput { name: "out".into(), from, attributes: None, v: false }];
    Graph { scene: Scene { last: 48, ..Scene::default() }, nodes, outputs, ..Graph::default() }
}
