//! Times of the wind chain: `cargo bench --bench wind`.
//!
//! Chains of Curve_Wind_Shielding, Curve_Wind_Gusts, Curve_Wind, Curve_Jiggle and Curve_Wind_Collision, on upright fur
//! on a sphere of 20,480 triangles, on guides that Curve_Deform lets it follow, and on the bear of `graphs/`; frames in
//! order, no cache, nothing written. Then collision's two methods by their error.

use std::convert::Infallible;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use engine::cook::{Delivered, Engine, Report, Settings};
use engine::geometry::{Component, Geometry, Kind, P};
use engine::graph::{Body, Graph, probe};
use engine::plan::Request;
use engine::time::Frame;
use numerics::shapes::icosphere;
use numerics::vector::to_f64;
use timing::Figures;

mod timing;

/// The program's own.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

const ROUNDS: usize = 5;

/// Of the fur on the unit sphere.
const LENGTH: f64 = 0.1;

/// Which nodes the chain has.
#[derive(Clone, Copy)]
struct Chain<'p> {
    name: &'p str,
    /// Params of shielding, if the chain has it.
    shielding: Option<&'p str>,
    /// Whether the wind turns, so that shielding is computed at every frame.
    turns: bool,
    /// Params of collision, if the chain has it.
    collision: Option<&'p str>,
}

/// Without `loft`, as the paper: more curves meet the skin.
const FULL: Chain<'_> = Chain { name: "full chain", shielding: Some(""), turns: true, collision: Some(NO_LOFT) };
const LOFT: Chain<'_> = Chain { name: "full chain, default loft", collision: Some(""), ..FULL };
const NO_LOFT: &str = r#""loft": 0"#;
const STILL: Chain<'_> = Chain { name: "full chain, shielding still", turns: false, ..FULL };
const SMOOTH: Chain<'_> =
    Chain { name: "no collision, shelter with smooth 0.5", shielding: Some(r#""smooth": 0.5, "#), ..NO_COLLISION };
const NO_COLLISION: Chain<'_> = Chain { name: "no collision", collision: None, ..FULL };
const NO_COLLIDERS: Chain<'_> = Chain { name: "gusts + wind + jiggle", shielding: None, ..NO_COLLISION };

/// The curves.
#[derive(Clone, Copy)]
enum Fur {
    /// Number of curves and CVs per curve, on a sphere.
    Sphere(usize, usize),
    /// The same on a sphere through which a swelling runs, so that skin and curves move at every frame.
    Swelling(usize, usize),
    /// The curves on a sphere follow guides: their number, then that of the curves and of the CVs of both.
    Guided(usize, usize, usize),
    Bear,
}

fn main() {
    convect::allocator::keep_freed_pages();
    let two = Engine::new(&Settings { threads: 2, ..Settings::default() }).expect("threads");
    let one = Engine::new(&Settings { threads: 1, ..Settings::default() }).expect("threads");
    timing::print_machine(&two);
    let mut figures = Figures::default();
    let sphere = Fur::Sphere(10_000, 5);
    let small = [FULL, LOFT, STILL, NO_COLLISION, NO_COLLIDERS, SMOOTH].map(|chain| (chain, graph(chain, sphere, 24)));
    let bear = graph(FULL, Fur::Bear, 24);
    let moving = graph(FULL, Fur::Swelling(10_000, 5), 24);
    let guided = graph(FULL, Fur::Guided(500, 10_000, 5), 24);
    let larger =
        [(100_000, 5), (10_000, 32)].map(|(curves, cvs)| (curves, cvs, graph(FULL, Fur::Sphere(curves, cvs), 6)));
    let largest = graph(FULL, Fur::Sphere(1_000_000, 5), 6);
    let mut peak = 0;
    for _ in 0..ROUNDS {
        figures.calibrate();
        for (chain, graph) in &small {
            figures.add(format!("{}, 10,000 × 5", chain.name), 24, cook(&two, graph, 1..=24).cooking);
        }
        let report = cook(&one, &small[0].1, 1..=24);
        figures.add("full chain, 10,000 × 5, 1 thread", 24, report.cooking);
        for node in report.nodes.iter().filter(|node| node.type_name.starts_with("Curve_")) {
            figures.add(format!("    of it {}", node.type_name), 24, node.wall);
        }
        for (engine, threads) in [(&two, ""), (&one, ", 1 thread")] {
            let name = format!("full chain on 500 guides + Curve_Deform, 10,000 × 5{threads}");
            figures.add(name, 24, cook(engine, &guided, 1..=24).cooking);
        }
        figures.add("full chain, 10,000 × 5, frame 24 alone", 1, cook(&two, &small[0].1, 24..=24).cooking);
        figures.add("full chain, bear (10,275 × 5)", 24, cook(&two, &bear, 1..=24).cooking);
        figures.add("full chain, skin that moves, 10,000 × 5", 24, cook(&two, &moving, 1..=24).cooking);
        for (curves, cvs, graph) in &larger {
            figures.add(format!("full chain, {curves} × {cvs}"), 6, cook(&two, graph, 1..=6).cooking);
        }
        // The first frame builds what later ones reuse, so runs that are compared have the same number of frames.
        figures.add("full chain, 10,000 × 5, the first 6 frames", 6, cook(&two, &small[0].1, 1..=6).cooking);
        let report = cook(&two, &largest, 1..=6);
        figures.add("full chain, 1,000,000 × 5", 6, report.cooking);
        peak = peak.max(report.peak_bytes);
    }
    figures.print();
    println!("peak of results, 1,000,000 × 5: {:.2} GB", peak as f64 * 1e-9);
    let linear =
        figures.least("full chain, 1,000,000 × 5") / figures.least("full chain, 10,000 × 5, the first 6 frames");
    println!("1,000,000 curves cost {linear:.1} times 10,000");
    work_and_precision(&one);
}

/// Tips at frames 1…4, and milliseconds of collision per frame.
fn tips(engine: &Engine, collision: Option<&str>) -> (Vec<[f32; 3]>, f64) {
    let graph = graph(Chain { name: "", shielding: None, turns: true, collision }, Fur::Sphere(10_000, 5), 4);
    let (mut tips, mut least) = (Vec::new(), f64::INFINITY);
    for _ in 0..3 {
        tips.clear();
        let mut sink = |finished: &[Delivered]| -> Result<(), Infallible> {
            for one in finished {
                tips.extend(one.geometry.curves().expect("curves").positions().chunks(5).map(|cvs| cvs[4]));
            }
            Ok(())
        };
        let report = cook_into(engine, &graph, 1..=4, &mut sink);
        let node = report.nodes.iter().find(|node| node.type_name == "Curve_Wind_Collision");
        least = least.min(node.map_or(0.0, |node| node.wall.as_secs_f64() * 1e3 / 4.0));
    }
    (tips, least)
}

/// Error of tips ÷ length against exact first contact without a gap, for the curves that touch something.
fn work_and_precision(engine: &Engine) {
    let (free, _) = tips(engine, None);
    let (reference, _) = tips(engine, Some(r#""loft": 0, "gap": 0"#));
    let far = |a: &[f32; 3], b: &[f32; 3]| (to_f64(*a) - to_f64(*b)).norm() / LENGTH;
    let met: Vec<usize> = (0..free.len()).filter(|k| far(&free[*k], &reference[*k]) > 1e-6).collect();
    println!(
        "\ncollision of 10,000 × 5, 1 thread; error of tips ÷ length of the {} tips of 4 frames that meet something",
        met.len()
    );
    println!("{:<12} {:>10} {:>10} {:>9}", "", "mean", "99 of 100", "ms");
    let error = |tips: &[[f32; 3]]| {
        let mut errors: Vec<f64> = met.iter().map(|k| far(&tips[*k], &reference[*k])).collect();
        errors.sort_by(f64::total_cmp);
        (errors.iter().sum::<f64>() / errors.len() as f64, errors[errors.len() * 99 / 100])
    };
    let (found, exact) = tips(engine, Some(NO_LOFT));
    let (mean, most) = error(&found);
    println!("{:<12} {mean:>10.2e} {most:>10.2e} {exact:>9.2}", "exact");
    let mut before: Option<(f64, f64)> = None;
    let mut enough: [Option<f64>; 2] = [None; 2];
    for steps in [8, 32, 64, 128, 512, 2048, 8192] {
        let params = format!(r#""loft": 0, "gap": 0, "method": "steps", "rotation_steps": {steps}"#);
        let (found, time) = tips(engine, Some(&params));
        let (mean, most) = error(&found);
        let slope = |(fewer, error): (f64, f64)| libm::log2(mean / error) / libm::log2(f64::from(steps) / fewer);
        let slope = before.map_or(String::new(), |before| format!("slope {:.2}", slope(before)));
        println!("{steps:<5} steps  {mean:>10.2e} {most:>10.2e} {time:>9.2}  {:>6.1} × exact  {slope}", time / exact);
        before = Some((f64::from(steps), mean));
        for (enough, error) in enough.iter_mut().zip([mean, most]) {
            *enough = enough.or((error <= 1e-3).then_some(time / exact));
        }
    }
    let [mean, most] = enough.map(|ratio| ratio.map_or("more than all".to_owned(), |ratio| format!("{ratio:.0} ×")));
    println!("the fewest of these steps within 1e-3 of the length: mean {mean} exact, 99 of 100 {most} exact");
}

fn cook(engine: &Engine, graph: &Graph, frames: std::ops::RangeInclusive<i64>) -> Report {
    cook_into(engine, graph, frames, &mut |_: &[Delivered]| -> Result<(), Infallible> { Ok(()) })
}

fn cook_into(
    engine: &Engine,
    graph: &Graph,
    frames: std::ops::RangeInclusive<i64>,
    sink: &mut (dyn FnMut(&[Delivered]) -> Result<(), Infallible> + Send),
) -> Report {
    let request = Request { outputs: vec![0], frames: frames.map(Frame::whole).collect() };
    let report = engine.cook(graph, &request, None, &AtomicBool::new(false), &mut { sink }).expect("it cooks");
    assert!(report.errors.is_empty(), "{}", report.errors[0].1);
    report
}

/// A chain on fur.
fn graph(chain: Chain<'_>, fur: Fur, last: i64) -> Graph {
    let mut nodes = String::from(
        r#""fur": { "type": "Curve_In", "params": { "file": "../assets/fur_bear_10k_curves.obj" } },
           "skin": { "type": "Mesh_In", "params": { "file": "../assets/bear.obj" } },"#,
    );
    let wind = match chain.turns {
        false => "[1, 0, 0.2]",
        true => r#"{ "expr": ["cos(0.02*frame)", "0", "sin(0.02*frame)"] }"#,
    };
    let mut before = "fur";
    let mut add = |name: &'static str, inputs: &str, params: &str| {
        writeln!(
            nodes,
            r#""{name}": {{ "type": "{name}", "inputs": {{ "curves": "{before}" {inputs} }}, "params": {{ {params} }} }},"#
        )
        .expect("memory");
        before = name;
    };
    if let Some(params) = chain.shielding {
        add("Curve_Wind_Shielding", r#", "colliders": ["skin"]"#, &format!(r#"{params} "wind_dir": {wind}"#));
    }
    add("Curve_Wind_Gusts", "", &format!(r#""wind_dir": {wind}, "num_gusts": 20, "base": 0.5"#));
    add("Curve_Wind", "", &format!(r#""wind_dir": {wind}, "global_rotate": 0.8"#));
    add("Curve_Jiggle", "", r#""frequency": 4, "damping": 0.3"#);
    if let Some(params) = chain.collision {
        add("Curve_Wind_Collision", r#", "rest": "fur", "colliders": ["skin"]"#, params);
    }
    if let Fur::Guided(..) = fur {
        let inputs = format!(r#""curves": "groom", "rest_guides": "fur", "guides": "{before}", "skin": "skin""#);
        nodes
            .push_str(r#""groom": { "type": "Curve_In", "params": { "file": "../assets/fur_bear_10k_curves.obj" } },"#);
        write!(nodes, r#""hairs": {{ "type": "Curve_Deform", "inputs": {{ {inputs} }} }},"#).expect("memory");
        before = "hairs";
    }
    let text = format!(
        r#"{{ "convect": 1, "scene": {{ "frames": [1, {last}], "seed": 7 }}, "nodes": {{ {nodes} }}, "outputs": {{ "fur": "{before}" }} }}"#
    );
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/bear_wind");
    let mut graph =
        Graph::load(&text, &folder, convect::CATALOGUE, &[], &probe).unwrap_or_else(|faults| panic!("{}", faults[0]));
    match fur {
        Fur::Sphere(curves, cvs) => {
            give(&mut graph, "fur", upright(curves, cvs));
            give(&mut graph, "skin", sphere());
        }
        Fur::Guided(guides, curves, cvs) => {
            give(&mut graph, "fur", upright(guides, cvs));
            give(&mut graph, "groom", upright(curves, cvs));
            give(&mut graph, "skin", sphere());
        }
        Fur::Swelling(curves, cvs) => {
            give_moving(&mut graph, "fur", upright(curves, cvs), Kind::Curves, last);
            give_moving(&mut graph, "skin", sphere(), Kind::Mesh, last);
        }
        Fur::Bear => {}
    }
    graph
}

/// Replaces a node by a geometry that swells; its points are computed before anything is timed.
fn give_moving(graph: &mut Graph, id: &str, geometry: Geometry, kind: Kind, last: i64) {
    let rest = geometry.part(kind).expect("a part").positions();
    let swollen = |frame: i64| -> Vec<[f32; 3]> {
        let grown = |p: [f32; 3]| 1.0 + 0.05 * libm::sin(3.0 * f64::from(p[1]) - 0.3 * frame as f64) as f32;
        rest.iter().map(|p| p.map(|x| x * grown(*p))).collect()
    };
    let frames: Vec<Vec<[f32; 3]>> = (1..=last).map(swollen).collect();
    let at = move |frame: Frame| {
        let mut geometry = geometry.clone();
        let index = (frame.number() as i64).clamp(1, last) - 1;
        geometry.part_mut(kind).expect("a part").set(P, frames[index as usize].clone()).expect("points");
        geometry
    };
    let node = graph.nodes.iter_mut().find(|node| &*node.id == id).expect("a node");
    node.body = Body::Given { at: Arc::new(at), moves: true };
}

/// Replaces a node by a geometry.
fn give(graph: &mut Graph, id: &str, geometry: Geometry) {
    let node = graph.nodes.iter_mut().find(|node| &*node.id == id).expect("a node");
    node.body = Body::Given { at: Arc::new(move |_| geometry.clone()), moves: false };
}

/// A unit sphere of 20,480 triangles.
fn sphere() -> Geometry {
    let sphere = icosphere(1.0, 5);
    let points = sphere.points.iter().map(|p| p.map(|x| x as f32)).collect();
    Component::mesh(sphere.counts, sphere.corners, points).expect("a mesh").into()
}

/// Curves a tenth of the radius long, spread evenly.
fn upright(curves: usize, cvs: usize) -> Geometry {
    let at = |curve: usize, cv: usize| {
        let y = 1.0 - 2.0 * (curve as f64 + 0.5) / curves as f64;
        let (sine, cosine) = libm::sincos(2.399_963 * curve as f64);
        let (side, far) = ((1.0 - y * y).sqrt(), 1.0 + LENGTH * cv as f64 / (cvs - 1) as f64);
        [far * cosine * side, far * y, far * sine * side].map(|x| x as f32)
    };
    let points = (0..curves).flat_map(|curve| (0..cvs).map(move |cv| at(curve, cv))).collect();
    Component::curves(vec![cvs as u32; curves], points).expect("curves").into()
}
