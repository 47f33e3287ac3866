//! A check of what nodes name in their inputs: masks and code whose attributes are missing or of another type.
//!
//! Nodes are called for geometry without rows, which has all attributes that the real one may have, with their types. What
//! a node refuses there, it refuses of the real geometry too. Errors that may have another cause are ignored: only those
//! [of types](Error::of_types) count.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::store::Cooked;
use super::sweep::{Executor, Sweep};
use super::{Delivered, Engine};
use crate::error::{Error, Result};
use crate::frames::FrameSet;
use crate::geometry::{Column, ColumnType, Component, Geometry, Kind, Owner, P};
use crate::graph::{Body, Dag, Graph, GraphNode, GraphOutput, Link, Positions};
use crate::node::{AttrNames, Cook, InputData, Node};
use crate::param::{Params, Source, Value};
use crate::plan::{Request, Resolver};

/// Chains with more frames before the first are left to the cook.
const MOST_CHAIN_FRAMES: i64 = 1000;

/// A graph under construction, with the place of each output of the nodes of another.
struct Typed {
    graph: Graph,
    links: BTreeMap<Link, Link>,
}

impl Typed {
    fn new(graph: &Graph) -> Self {
        let graph = Graph {
            scene: graph.scene.clone(),
            folder: graph.folder.clone(),
            positions: Positions::default(),
            ..Graph::default()
        };
        Self { graph, links: BTreeMap::new() }
    }

    fn push(&mut self, node: GraphNode) -> usize {
        self.graph.nodes.push(node);
        self.graph.nodes.len() - 1
    }

    fn output(&mut self, from: Link) {
        let name = self.graph.nodes[from.node].id.clone();
        self.graph.outputs.push(GraphOutput { name, from, attributes: None, v: false });
    }
}

impl Engine {
    /// Nodes that name attributes which their inputs cannot have, at the scene's first frame.
    pub(super) fn type_faults(&self, graph: &Graph) -> Vec<(usize, Error)> {
        let asking: Vec<usize> = (0..graph.nodes.len()).filter(|node| names_attributes(&graph.nodes[*node])).collect();
        if asking.is_empty() {
            return Vec::new();
        }
        let needed = Dag::of(graph).upstream(asking.iter().copied());
        let needed: Vec<usize> = (0..needed.len()).filter(|node| needed[*node]).collect();
        let mut typed = self.typed_sources(graph, &needed);
        let mut index_of = BTreeMap::new();
        for node in needed {
            let Some(inputs) = rewired(&graph.nodes[node], &typed.links) else { continue };
            let Body::Node { node: declared, specs, params, .. } = &graph.nodes[node].body else { continue };
            let resolved = Resolver::new(&graph.nodes[node], graph, self.files()).at(graph.scene.start());
            let Ok(resolved) = resolved else { continue };
            if starts_far_back(declared, &resolved, graph) {
                continue;
            }
            let body = Body::Node { node: declared, specs: specs.clone(), params: params.clone(), inputs };
            let place = typed.push(GraphNode { id: graph.nodes[node].id.clone(), body });
            index_of.insert(graph.nodes[node].id.clone(), node);
            if !writes_anything(declared, &resolved) {
                let links = (0..declared.outputs.len()).map(|port| (Link { node, port }, Link { node: place, port }));
                typed.links.extend(links);
            }
            if asking.binary_search(&node).is_ok() {
                typed.output(Link { node: place, port: 0 });
            }
        }
        let mut faults = BTreeMap::new();
        for (_, error) in self.cook_first(&typed.graph, Executor::Types).1 {
            if let Some(node) = index_of.get(&error.node).filter(|_| error.error.of_types) {
                faults.entry(*node).or_insert_with(|| error.error.clone());
            }
        }
        faults.into_iter().collect()
    }

    /// The sources among some nodes, as geometry without rows.
    fn typed_sources(&self, graph: &Graph, needed: &[usize]) -> Typed {
        let mut sources = Typed::new(graph);
        let mut links = Vec::new();
        for node in needed.iter().copied().filter(|node| graph.nodes[*node].inputs().iter().all(Vec::is_empty)) {
            let place = sources.push(graph.nodes[node].clone());
            let ports = graph.nodes[node].node().map_or(1, |declared| declared.outputs.len());
            for port in 0..ports {
                sources.output(Link { node: place, port });
                links.push(Link { node, port });
            }
        }
        let mut typed = Typed::new(graph);
        for (output, geometry) in self.cook_first(&sources.graph, Executor::Cook).0 {
            let Ok(empty) = emptied(&geometry) else { continue };
            let body = Body::Given { at: Arc::new(move |_| empty.clone()), moves: false };
            let node = typed.push(GraphNode { id: sources.graph.outputs[output].name.clone(), body });
            typed.links.insert(links[output], Link { node, port: 0 });
        }
        typed
    }

    /// Cooks all outputs of a graph at the scene's first frame: what came out, and the errors.
    fn cook_first(&self, graph: &Graph, executor: Executor) -> FirstFrame {
        let frames = FrameSet::whole(graph.scene.first, graph.scene.first);
        let request = Request { outputs: (0..graph.outputs.len()).collect(), frames };
        let mut found = Vec::new();
        let mut take = |finished: &[Delivered]| -> std::result::Result<(), std::convert::Infallible> {
            found.extend(finished.iter().map(|one| (one.output, one.geometry.clone())));
            Ok(())
        };
        let cancel = AtomicBool::new(false);
        let Ok(plan) = self.plan(graph, &request) else { return FirstFrame::default() };
        let cooked = self.pool.install(|| Sweep::new(self, &plan, executor, None, &cancel).run(&mut take));
        let errors = cooked.map_or_else(|_| Vec::new(), |report| report.errors);
        (found, errors.into_iter().map(|(output, error, _)| (output, error)).collect())
    }
}

/// Results and errors by output.
type FirstFrame = (Vec<(usize, Arc<Geometry>)>, Vec<(usize, Arc<crate::error::CookError>)>);

/// Whether a node has a mask, code, or texts while its params may name attributes.
fn names_attributes(node: &GraphNode) -> bool {
    let Body::Node { node: declared, params, .. } = &node.body else { return false };
    let names = |value: &Value| match value {
        Value::Masked(_, attribute) => attribute.is_some(),
        Value::Text(text) => declared.attributes.is_some() && !text.is_empty(),
        Value::Texts(texts) => declared.attributes.is_some() && !texts.is_empty(),
        _ => false,
    };
    params.iter().any(|source| match source {
        Source::Masked(..) | Source::Code(_) => true,
        Source::Constant(value) => names(value),
        Source::Keys(keys, _) => keys.keys.iter().any(|(_, value)| names(value)),
        _ => false,
    })
}

/// The wires of a node in the new graph; `None` where what comes in is not known, and for sources.
fn rewired(node: &GraphNode, links: &BTreeMap<Link, Link>) -> Option<Vec<Vec<Link>>> {
    let inputs = node.inputs();
    if inputs.iter().all(Vec::is_empty) {
        return None;
    }
    inputs.iter().map(|wires| wires.iter().map(|link| links.get(link).copied()).collect()).collect()
}

/// Whether a node may write attributes of any name.
fn writes_anything(declared: &Node, params: &Params) -> bool {
    declared.attributes.is_some_and(|attributes| matches!(attributes(params), [_, AttrNames::All]))
}

fn starts_far_back(declared: &Node, params: &Params, graph: &Graph) -> bool {
    match declared.cook {
        Cook::Window(_, past) => {
            let past = past(params, graph.scene.clock());
            i64::from(past.frames) + i64::from(past.preroll) > MOST_CHAIN_FRAMES
        }
        Cook::Solver(..) => {
            declared.start_frame(params).is_some_and(|start| start < graph.scene.first - MOST_CHAIN_FRAMES)
        }
        Cook::Pure(_) | Cook::Frame { .. } => false,
    }
}

/// The geometry without points and elements, with all attributes.
fn emptied(geometry: &Geometry) -> Result<Geometry> {
    let mut empty = geometry.clone();
    for part in geometry.parts() {
        let mut none = match part.kind() {
            Kind::Curves => Component::curves(Vec::new(), Vec::new())?,
            Kind::Mesh => Component::mesh(Vec::new(), Vec::new(), Vec::new())?,
            Kind::Points => Component::points(Vec::new()),
            Kind::Tets => Component::tets(Vec::new(), Vec::new())?,
            Kind::Volume => continue,
        };
        for (owner, name, column) in part.columns().filter(|(_, name, _)| ***name != *P.name) {
            let column = if owner == Owner::Once { column.clone() } else { column.gather(&[]) };
            none.set_column(owner, name.clone(), column)?;
        }
        empty.put(none);
    }
    Ok(empty)
}

/// The outputs of a call for geometry without rows, with all that they may have: what the node declares to write, and what
/// its inputs have.
pub(super) fn completed(node: &Node, inputs: &[(&'static str, InputData)], cooked: Cooked) -> Cooked {
    let wires: Vec<&Arc<Geometry>> = inputs.iter().flat_map(|(_, data)| data.now.iter().chain(&data.start)).collect();
    let complete = |geometry: &Arc<Geometry>| {
        let mut complete = Geometry::clone(geometry);
        let kinds: BTreeSet<Kind> = geometry.parts().map(Component::kind).collect();
        for kind in kinds {
            let Some(part) = complete.part_mut(kind) else { continue };
            for (name, owner, rows) in node.writes.iter().map(|attribute| attribute.spec()) {
                add(part, owner, name, &without_rows(rows));
            }
            for (owner, name, column) in wires.iter().filter_map(|wire| wire.part(kind)).flat_map(Component::columns) {
                add(part, owner, name, &column.gather(&[]));
            }
        }
        Arc::new(complete)
    };
    cooked.iter().map(complete).collect()
}

/// Adds a column without rows, unless there is one of that name or the owner has rows.
fn add(part: &mut Component, owner: Owner, name: &str, column: &Column) {
    if part.describe(name).is_none() && part.table(owner).rows() == 0 {
        // A column without rows fits an owner without rows, unless the name has another fixed type.
        let _ = part.set_column(owner, name, column.clone());
    }
}

fn without_rows(kind: ColumnType) -> Column {
    match kind {
        ColumnType::F1 => Column::new(Vec::<f32>::new()),
        ColumnType::F3 => Column::new(Vec::<[f32; 3]>::new()),
        ColumnType::F4 => Column::new(Vec::<[f32; 4]>::new()),
        ColumnType::I1 => Column::new(Vec::<i32>::new()),
        ColumnType::I3 => Column::new(Vec::<[i32; 3]>::new()),
        ColumnType::I4 => Column::new(Vec::<[i32; 4]>::new()),
    }
}
