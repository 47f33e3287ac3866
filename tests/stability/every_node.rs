//! Every node of the catalogue with ordinary inputs, changed as the rows on numbers and emptiness say.
//!
//! The result is finite, with the same bits on one thread and on three, or it is refused with a message. Params accept
//! both ends of their ranges, or refuse them with a message, and refuse what lies just outside.

use std::sync::Arc;

use conformance::{RangeEnd, cook_all, range_ends};
use engine::cook::{Engine, Settings};
use engine::error::ErrorKind;
use engine::geometry::{Component, Geometry, Kind, P, Topology, UVW};
use engine::graph::{Body, Graph, GraphOutput, Link, probe};
use engine::node::{Arity, Cook, Node};
use engine::param::{ParamSpec, Value};
use engine::time::Frame;
use formats::usd::{Flavour, UsdWriter};

use crate::page::{self, Outcome};
use crate::shapes::{block, cuboid};

const PART: &str = "Every node";

/// A change of every position.
type Move = fn([f32; 3]) -> [f32; 3];

/// What a row does to the inputs.
#[derive(Clone, Copy)]
pub(crate) enum Change {
    Nothing,
    /// The last point of every input.
    Last(f32),
    All(Move),
    /// Inputs without rows.
    Empty,
    /// Frames a second.
    Rate(f64),
    /// All curves have these CVs.
    Curves(&'static [[f32; 3]]),
    /// All meshes have these points, and a triangle of every three.
    Mesh(&'static [[f32; 3]]),
    /// All bodies are one tet.
    Tet([[f32; 3]; 4]),
}

/// Rows of NUMERICS B, what they do, and to which component; `None` for any.
const ROWS: [(&str, &str, Option<Kind>, Change); 19] = [
    ("1", "NaN in a position", None, Change::Last(f32::NAN)),
    ("2", "infinity in a position", None, Change::Last(f32::INFINITY)),
    ("3", "denormal positions", None, Change::All(|p| p.map(|x| x * 1e-40))),
    ("4", "positions × 1e30", None, Change::All(|p| p.map(|x| x * 1e30))),
    ("4", "positions × 1e-30", None, Change::All(|p| p.map(|x| x * 1e-30))),
    ("5", "1e7 m away", None, Change::All(|p| p.map(|x| x + 1e7))),
    ("6", "positions × 1e6, params as they are", None, Change::All(|p| p.map(|x| x * 1e6))),
    ("6", "positions × 1e-6, params as they are", None, Change::All(|p| p.map(|x| x * 1e-6))),
    ("9", "frames of 1,000 s", None, Change::Rate(1e-3)),
    ("9", "frames of 1 µs", None, Change::Rate(1e6)),
    ("10", "empty inputs", None, Change::Empty),
    ("11", "curves of one CV", Some(Kind::Curves), Change::Curves(&[[0.0, 0.2, 0.0]])),
    ("12", "two equal CVs", Some(Kind::Curves), Change::Curves(&[[0.0, 0.2, 0.0], [0.0, 0.2, 0.0], [0.0, 0.4, 0.0]])),
    ("13", "all CVs equal", Some(Kind::Curves), Change::Curves(&[[0.0, 0.2, 0.0]; 5])),
    ("15", "a mesh without faces", Some(Kind::Mesh), Change::Mesh(&[])),
    (
        "16",
        "a mesh of one triangle",
        Some(Kind::Mesh),
        Change::Mesh(&[[-0.2, 0.2, -0.2], [0.0, 0.2, 0.2], [0.2, 0.2, -0.2]]),
    ),
    (
        "17",
        "triangles without area",
        Some(Kind::Mesh),
        Change::Mesh(&[[-0.2, 0.2, 0.0], [0.0, 0.2, 0.0], [0.2, 0.2, 0.0]]),
    ),
    (
        "42",
        "a body of one tet",
        Some(Kind::Tets),
        Change::Tet([[0.0; 3], [0.0, 0.0, 0.2], [0.2, 0.0, 0.0], [0.0, 0.2, 0.0]]),
    ),
    ("34", "a flat tet", Some(Kind::Tets), Change::Tet([[0.0; 3], [0.0, 0.0, 0.2], [0.2, 0.0, 0.0], [0.1, 0.0, 0.1]])),
];

/// The inputs, which are given; and the nodes that some inputs need.
pub(crate) const SOURCES: &str = r#"
    "curves": { "type": "Curve_In", "params": { "points": [[0, 0, 0], [0, 1, 0]] } },
    "mesh": { "type": "Mesh_Primitive" },
    "tets": { "type": "Tet_In", "params": { "points": [[0, 0, 0]] } },
    "points": { "type": "Point_In", "params": { "points": [[0, 0, 0]] } },
    "lump": { "type": "Tetrahedralize", "inputs": { "surface": "mesh" } },
    "pinned": { "type": "Softbody_Pin", "inputs": { "targets": "points" } },
    "gust": { "type": "Gust_Control" },
    "source": { "type": "Fluid_Source", "inputs": { "shape": "mesh" } },
    "sink": { "type": "Fluid_Sink", "inputs": { "shape": "mesh" } },
    "pool": { "type": "FluidSolve", "inputs": { "liquid": ["mesh"] },
              "params": { "cell": 0.1, "domain_from": [-0.4, -0.4, -0.4], "domain_to": [0.4, 0.4, 0.4] } },"#;

/// The wire of each input of a node.
pub(crate) fn wire(node: &str, input: &str) -> &'static str {
    match input {
        // Goals are for the body of a surface.
        "body" if node == "Softbody_Goal" => "lump",
        "curves" | "guides" | "rest_guides" | "rest" | "geometry" => "curves",
        "points" | "targets" | "tracers" | "reference" => "points",
        "body" | "bodies" => "tets",
        "pins" => "pinned",
        "controls" => "gust",
        "sources" => "source",
        "sinks" => "sink",
        "volume" => "pool.volume",
        _ => "mesh",
    }
}

/// Params without which a node has nothing to do.
pub(crate) fn needed(node: &str) -> &'static str {
    match node {
        "Curve_In" => r#""points": [[0, 0, 0], [0, 1, 0], [0, 2, 0]]"#,
        "Point_In" => r#""points": [[0, 0, 0], [0, 1, 0]]"#,
        "Mesh_In" => r#""points": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "indices": [0, 1, 2]"#,
        "Tet_In" => r#""points": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "tets": [[0, 1, 2, 3]]"#,
        "Attribute_Expr" => r#""component": "curves", "code": "P.y += 0.1*sin(P.x)""#,
        "Fluid_Source" => r#""rate": 0.001"#,
        "FluidSolve" => r#""cell": 0.1, "domain_from": [-0.4, -0.4, -0.4], "domain_to": [0.4, 0.4, 0.4]"#,
        "Curve_Scatter" | "Curve_Interpolate" => r#""density": 20"#,
        _ => "",
    }
}

/// What a node that reads one kind of geometry from a file reads.
fn read_from_file(node: &Node) -> Option<Kind> {
    Some(match node.name {
        "Curve_In" => Kind::Curves,
        "Mesh_In" => Kind::Mesh,
        "Point_In" => Kind::Points,
        "Tet_In" => Kind::Tets,
        _ => return None,
    })
}

/// The graph of a node with these params beside those that it needs; a file, or another value of the first, takes their place.
pub(crate) fn graph(node: &Node, extra: &str) -> Result<Graph, String> {
    // Goals have scenes of their own; of a liquid inside its collider or sink nothing is left.
    let is_left_out = |input: &str| match node.name {
        "FluidSolve" => ["colliders", "sinks", "sources"].contains(&input),
        "Softbody" => input == "goals",
        _ => false,
    };
    let inputs = node.input_specs().into_iter().filter(|input| !is_left_out(input.name)).map(|input| {
        let (name, from) = (input.name, wire(node.name, input.name));
        if matches!(input.arity, Arity::Many { .. }) {
            format!(r#""{name}": ["{from}"]"#)
        } else {
            format!(r#""{name}": "{from}""#)
        }
    });
    let needed = needed(node.name);
    let key = needed.split(':').next().unwrap_or_default();
    let is_replaced = extra.contains(r#""file""#) || (!key.is_empty() && extra.contains(key));
    let needed = if is_replaced { "" } else { needed };
    let params: Vec<&str> = [needed, extra].into_iter().filter(|params| !params.is_empty()).collect();
    let text = format!(
        r#"{{ "convect": 1, "scene": {{ "frames": [1, 24], "seed": 7 }}, "outputs": {{ "out": "n" }},
              "nodes": {{ {SOURCES} "n": {{ "type": "{}", "inputs": {{ {} }}, "params": {{ {} }} }} }} }}"#,
        node.name,
        inputs.collect::<Vec<_>>().join(", "),
        params.join(", ")
    );
    let graph = Graph::load(&text, std::path::Path::new("."), convect::CATALOGUE, &[], &probe);
    let mut graph = graph.map_err(|faults| faults[0].to_string())?;
    let n = graph.nodes.iter().position(|node| &*node.id == "n").unwrap();
    let output = |port: usize| GraphOutput {
        name: format!("out{port}").as_str().into(),
        from: Link { node: n, port },
        attributes: None,
        v: false,
    };
    graph.outputs = (0..node.outputs.len()).map(output).collect();
    Ok(graph)
}

/// The params of a node that reads a file, and the folder where that is: the inputs of the others, as a row changes them.
pub(crate) fn files(node: &Node, change: Change) -> (Option<tempfile::TempDir>, String) {
    if let Some(kind) = read_from_file(node) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("inputs.json");
        let (.., part) = inputs().into_iter().find(|(_, of, _)| *of == kind).unwrap();
        std::fs::write(&path, text_of(&changed(part, kind, change))).unwrap();
        return (Some(folder), format!(r#""file": {:?}"#, path.display().to_string()));
    }
    if node.name != "Usd_In" {
        return (None, String::new());
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("inputs.usdc");
    let mut writer = UsdWriter::create(&path, Flavour::Usdc, "inputs", 24.0, [0.0; 3]).unwrap();
    let parts = inputs().into_iter().map(|(_, kind, part)| changed(part, kind, change));
    let geometry = parts.fold(Geometry::default(), Geometry::with);
    writer.frame(1.0, &geometry).unwrap();
    writer.finish().unwrap();
    (Some(folder), format!(r#""file": {:?}"#, path.display().to_string()))
}

/// A component as convect's json, whose writer would refuse what is not finite.
fn text_of(part: &Component) -> String {
    let (points, kind) = (part.positions(), part.kind());
    let more = match part.topology() {
        Topology::Curves(runs) => format!(r#""counts": {:?}, "#, runs.counts().collect::<Vec<_>>()),
        Topology::Mesh(faces) => {
            format!(r#""counts": {:?}, "indices": {:?}, "#, faces.runs.counts().collect::<Vec<_>>(), faces.corners)
        }
        Topology::Points => String::new(),
        Topology::Tets(tets) => format!(r#""indices": {tets:?}, "#),
    };
    format!(r#"{{ "{kind}": {{ {more}"points": {points:?} }} }}"#)
}

/// A component as a row changes it.
fn changed(mut part: Component, kind: Kind, change: Change) -> Component {
    match change {
        Change::Nothing | Change::Rate(_) => {}
        Change::Last(bad) => {
            let last = part.point_count() - 1;
            part.edit(P).unwrap()[last][1] = bad;
        }
        Change::All(to) => part.edit(P).unwrap().iter_mut().for_each(|p| *p = to(*p)),
        Change::Empty => part = with_points(kind, &[]),
        Change::Curves(points) if kind == Kind::Curves => return with_points(kind, points),
        Change::Mesh(points) if kind == Kind::Mesh => return with_points(kind, points),
        Change::Tet(points) if kind == Kind::Tets => return with_points(kind, &points),
        Change::Curves(_) | Change::Mesh(_) | Change::Tet(_) => {}
    }
    part
}

/// Three curves, a triangle of every three points, a tet of every four, or the points.
fn with_points(kind: Kind, points: &[[f32; 3]]) -> Component {
    let corners: Vec<u32> = (0..points.len() as u32).collect();
    match kind {
        Kind::Curves if points.is_empty() => Component::curves(vec![], vec![]).unwrap(),
        Kind::Curves => Component::curves(vec![points.len() as u32; 3], [points, points, points].concat()).unwrap(),
        Kind::Mesh => Component::mesh(vec![3; points.len() / 3], corners, points.to_vec()).unwrap(),
        Kind::Tets => {
            Component::tets(corners.chunks_exact(4).map(|t| [t[0], t[1], t[2], t[3]]).collect(), points.to_vec())
                .unwrap()
        }
        _ => {
            let mut part = Component::points(points.to_vec());
            part.set(UVW, points.to_vec()).unwrap();
            part
        }
    }
}

/// The inputs, by the node that gives them.
fn inputs() -> [(&'static str, Kind, Component); 4] {
    let hair = |k: u32| -> Vec<[f32; 3]> { (0..5).map(|cv| [0.05 * k as f32, 0.2 + 0.05 * cv as f32, 0.0]).collect() };
    let curves = Component::curves(vec![5; 4], (0..4).flat_map(hair).collect()).unwrap();
    let mesh = cuboid([-0.2, -0.3, -0.2], [0.2, 0.2, 0.2]).mesh().unwrap().clone();
    let mut points = Component::points(vec![[0.0, 0.1, 0.0], [0.1, 0.1, 0.0], [0.0, 0.0, 0.1]]);
    points.set(UVW, points.positions().to_vec()).unwrap();
    [
        ("curves", Kind::Curves, curves),
        ("mesh", Kind::Mesh, mesh),
        ("tets", Kind::Tets, block([2; 3], 0.05, [0.0, 0.1, 0.0])),
        ("points", Kind::Points, points),
    ]
}

/// What came of a graph.
#[derive(PartialEq)]
pub(crate) struct Cooked {
    results: Vec<Option<Arc<Geometry>>>,
    pub(crate) errors: Vec<(ErrorKind, String)>,
    /// What nodes say of their metrics.
    notes: Vec<String>,
}

pub(crate) fn cook(graph: Graph, node: &Node, change: Change, threads: usize) -> Cooked {
    let last = match node.cook {
        Cook::Pure(_) => 1,
        Cook::Solver(..) => page::frames(3),
        _ => 3,
    };
    cook_for(graph, node, change, threads, last)
}

/// Cooks frames 1…`last` of a graph with changed inputs; notes are those of `node`.
pub(crate) fn cook_for(mut graph: Graph, node: &Node, change: Change, threads: usize, last: i64) -> Cooked {
    for (id, kind, part) in inputs() {
        let geometry: Geometry = changed(part, kind, change).into();
        let place = graph.nodes.iter().position(|node| *node.id == *id).unwrap();
        graph.nodes[place].body = Body::Given { at: Arc::new(move |_| geometry.clone()), moves: false };
    }
    if let Change::Rate(fps) = change {
        graph.scene.fps = fps;
    }
    let frames: Vec<Frame> = (1..=last).map(Frame::whole).collect();
    let engine = Engine::new(&Settings { threads, ..Settings::default() }).unwrap();
    let (found, report) = cook_all(&engine, &graph, &frames);
    let places = (0..graph.outputs.len()).flat_map(|output| frames.iter().map(move |frame| (output, *frame)));
    let results = places.map(|place| found.get(&place).cloned()).collect();
    let errors = report.errors.iter().map(|(_, error, _)| (error.error.kind, error.to_string())).collect();
    let is_of_metric = |kind: &str| node.metrics.iter().any(|metric| metric.name == kind);
    let notes = report.notes.iter().filter(|note| is_of_metric(note.kind)).map(|note| note.text.clone()).collect();
    Cooked { results, errors, notes }
}

/// The outcome and its figure, or what is wrong.
pub(crate) fn judged(cooked: &Cooked) -> Result<(Outcome, String), String> {
    for (kind, said) in &cooked.errors {
        // A file with such values is refused as it is read.
        if !matches!(kind, ErrorKind::Refused | ErrorKind::NotFinite | ErrorKind::File) {
            return Err(said.clone());
        }
    }
    if let Some((_, said)) = cooked.errors.first() {
        return Ok((Outcome::Refused, said.clone()));
    }
    let parts = cooked.results.iter().flatten().flat_map(|geometry| geometry.parts());
    let mut largest = 0.0_f32;
    for x in parts.flat_map(|part| part.positions().as_flattened().iter().copied()) {
        if !x.is_finite() {
            return Err("a position is not finite".into());
        }
        largest = largest.max(x.abs());
    }
    Ok(match cooked.notes.first() {
        Some(note) => (Outcome::Capped, note.clone()),
        None => (Outcome::Finite, format!("largest coordinate {largest:.2e} m")),
    })
}

/// Whether a node reads a component, or depends on any input where `kind` is `None`.
fn reads(node: &Node, kind: Option<Kind>) -> bool {
    let of = |name: &str| match wire(node.name, name) {
        "curves" => Kind::Curves,
        "mesh" | "lump" | "source" | "sink" | "pool.volume" => Kind::Mesh,
        "tets" => Kind::Tets,
        _ => Kind::Points,
    };
    node.input_specs().iter().any(|input| kind.is_none_or(|kind| of(input.name) == kind))
}

fn rows() {
    let mut wrong = Vec::new();
    for node in convect::CATALOGUE.nodes() {
        let (_folder, params) = files(node, Change::Nothing);
        let plain = graph(node, &params).map(|graph| cook(graph, node, Change::Nothing, 1));
        match plain.as_ref().map(judged) {
            Ok(Ok((Outcome::Finite | Outcome::Capped, _))) => {}
            Ok(Ok((_, said)) | Err(said)) => wrong.push(format!("{} as it is: {said}", node.name)),
            Err(said) => wrong.push(format!("{} as it is: {said}", node.name)),
        }
        for (number, what, kind, change) in ROWS {
            let is_rate = matches!(change, Change::Rate(_));
            let (folder, params) = files(node, change);
            let of_file =
                folder.is_some() && kind.is_none_or(|kind| read_from_file(node).is_none_or(|own| own == kind));
            if !(reads(node, kind) || is_rate || of_file) {
                continue;
            }
            let Ok(graph) = graph(node, &params) else { continue };
            let case = format!("{}: {what}", node.name);
            let cooked = cook(graph.clone(), node, change, 1);
            if cooked != cook(graph, node, change, 3) {
                wrong.push(format!("{case}: other bits on three threads than on one"));
            }
            match judged(&cooked) {
                Ok((outcome, figure)) => {
                    // The page is the same wherever it is made.
                    let place = folder.as_ref().map(|folder| format!("{}/", folder.path().display()));
                    let figure = place.iter().fold(figure, |figure, place| figure.replace(place, ""));
                    page::record(PART, number, &case, outcome, &figure);
                }
                Err(said) => wrong.push(format!("{case}: {said}")),
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A number as a graph writes it.
pub(crate) fn json(value: &Value) -> Option<String> {
    match value {
        Value::Float(x) | Value::Masked(x, _) => Some(format!("{x:?}")),
        Value::Int(x) => Some(x.to_string()),
        Value::Span([a, b]) | Value::Vec2([a, b]) => Some(format!("[{a:?}, {b:?}]")),
        Value::Vec3([a, b, c]) => Some(format!("[{a:?}, {b:?}, {c:?}]")),
        Value::Int3([a, b, c]) => Some(format!("[{a}, {b}, {c}]")),
        _ => None,
    }
}

/// Ends that take seconds: as many steps, faces or cells.
fn is_dear(spec: &ParamSpec, end: &Value) -> bool {
    ["rotation_steps", "divisions", "max_substeps"].contains(&spec.name) && end.number() > 64.0
        || matches!(end, Value::Int3([many, ..]) if *many > 64)
}

fn ends() {
    let mut wrong = Vec::new();
    for node in convect::CATALOGUE.nodes() {
        let (_folder, file) = files(node, Change::Nothing);
        let (mut accepted, mut refused) = (0, Vec::new());
        for spec in node.param_specs().iter().filter(|spec| !needed(node.name).contains(spec.name)) {
            for RangeEnd { inside, outside } in range_ends(spec) {
                let (Some(at_end), Some(beyond)) = (json(&inside), json(&outside)) else { continue };
                let more = if file.is_empty() { String::new() } else { format!("{file}, ") };
                let set = |text: &str| graph(node, &format!(r#"{more}"{}": {text}"#, spec.name));
                if set(&beyond).is_ok() {
                    wrong.push(format!("{}: `{}` takes {beyond}, which is out of range", node.name, spec.name));
                }
                if is_dear(spec, &inside) {
                    continue;
                }
                let outcome = set(&at_end).map(|graph| judged(&cook(graph, node, Change::Nothing, 2)));
                match outcome {
                    Ok(Ok((Outcome::Refused, said))) | Err(said) => refused.push((spec.name, at_end, said)),
                    Ok(Ok(_)) => accepted += 1,
                    Ok(Err(said)) => wrong.push(format!("{}: `{}` at {at_end}: {said}", node.name, spec.name)),
                }
            }
        }
        let said: Vec<String> = refused.iter().map(|(name, at, said)| format!("`{name}` {at}: {said}")).collect();
        let outcome = if refused.is_empty() { Outcome::Finite } else { Outcome::Refused };
        let figure =
            format!("finite ends: {accepted}{}{}", if said.is_empty() { "" } else { "; refused: " }, said.join("; "));
        if accepted + refused.len() > 0 {
            page::record(
                PART,
                "7",
                &format!("{}: each param at both ends of its range, and just outside", node.name),
                outcome,
                &figure,
            );
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// All tables of this module.
#[allow(dead_code, reason = "of `cargo bench --bench laws`")]
pub(crate) const GROUPS: &[fn()] = &[rows, ends];

#[cfg(test)]
mod tables {
    #[test]
    fn rows() {
        super::rows();
    }

    #[test]
    fn ends() {
        super::ends();
    }
}
