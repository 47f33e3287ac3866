//! What an artist wants to see besides the outputs: controls, colliders and lattices as thin lines, and the wind.
//!
//! Guides are found by the names of inputs and params above the drawn outputs. Colliders and controls are cooked along as
//! further outputs of the graph, which costs nothing where the drawn outputs need them. Limit: what lies above a node
//! that moves geometry ([`MOVERS`]) is not where it would be drawn, and is left out.

use engine::geometry::{Column, Component, Geometry, Kind, Owner};
use engine::graph::{Body, Graph, GraphNode, GraphOutput, Link};
use engine::param::Value;
use engine::time::Frame;
use preview::Layer;

/// Inputs whose wires are drawn.
const INPUTS: [&str; 2] = ["colliders", CONTROLS];
const CONTROLS: &str = "controls";
/// Attributes of a Gust_Control: points of its outline, and 1 for cubes.
const RUN: &str = "gust_points";
const SHAPE: &str = "gust_shape";
/// Nodes behind which positions are other ones.
const MOVERS: [&str; 2] = ["Transform", "Curve_Attach"];
/// The node with a box of control points, and the one behind which its box is still of interest.
const LATTICE: &str = "Lattice_Deform";
const MERGE: &str = "Merge";
/// The param that is a wind's direction.
const WIND: &str = "wind_dir";
/// Guides of a picture; more would hide it.
const MOST: usize = 16;
/// Points of a Gust_Control's own frame before those of its outline.
const AXIS_POINTS: usize = 4;

/// The guides of a request.
#[derive(Clone, Debug, Default)]
pub(super) struct Guides {
    /// Names of the guides that are cooked, for the caption; they are the graph's last outputs.
    cooked: Vec<&'static str>,
    /// Position of the first of them.
    first: usize,
    /// Nodes with a lattice.
    lattices: Vec<usize>,
    /// The node whose wind is shown: the last one.
    wind: Option<usize>,
}

impl Guides {
    /// Finds the guides of `outputs`, and adds those that must be cooked to the graph's outputs.
    pub(super) fn add_to(graph: &mut Graph, outputs: &[usize]) -> Self {
        let shown: Vec<Link> = outputs.iter().map(|output| graph.outputs[*output].from).collect();
        let mut guides = Self { first: graph.outputs.len(), ..Self::default() };
        let mut links: Vec<(&'static str, Link)> = Vec::new();
        let is_merge = |node: &GraphNode| node.type_name() == MERGE;
        guides.lattices = above(graph, &shown, is_merge);
        guides.lattices.retain(|node| graph.nodes[*node].type_name() == LATTICE);
        for node in above(graph, &shown, |node| !MOVERS.contains(&node.type_name())) {
            let GraphNode { body: Body::Node { node: declared, inputs, specs, .. }, .. } = &graph.nodes[node] else {
                continue;
            };
            if specs.iter().any(|spec| spec.name == WIND) {
                guides.wind = guides.wind.max(Some(node));
            }
            for (input, wires) in declared.inputs.iter().zip(inputs) {
                let Some(name) = INPUTS.into_iter().find(|name| *name == input.spec().name) else { continue };
                links.extend(wires.iter().map(|link| (name, *link)));
            }
        }
        links.sort_unstable();
        links.dedup_by_key(|(_, link)| *link);
        links.retain(|(_, link)| !shown.contains(link));
        links.truncate(MOST);
        for (name, from) in links {
            // Otherwise all attributes would be cooked.
            let attributes = if name == CONTROLS { vec![RUN.into(), SHAPE.into()] } else { Vec::new() };
            graph.outputs.push(GraphOutput { name: name.into(), from, attributes: Some(attributes), v: false });
            guides.cooked.push(name);
        }
        guides
    }

    /// Positions of the outputs that were added to the graph.
    pub(super) fn outputs(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.cooked.len()
    }

    /// Whether controls are among the guides.
    pub(super) fn has_controls(&self) -> bool {
        self.cooked.contains(&CONTROLS)
    }

    /// The name of an added output.
    pub(super) fn name(&self, output: usize) -> &'static str {
        output.checked_sub(self.first).and_then(|index| self.cooked.get(index)).copied().unwrap_or_default()
    }

    /// The lattices at a frame, as lines.
    pub(super) fn lattices(&self, graph: &Graph, frame: Frame) -> Option<Geometry> {
        let mut lines = Lines::default();
        for node in &self.lattices {
            let value = |name| value(graph, *node, name, frame);
            let (Some(Value::Int3(cells)), Some(Value::Vec3(from)), Some(Value::Vec3(to))) =
                (value("divisions"), value("from"), value("to"))
            else {
                continue;
            };
            let offsets = match value("offsets") {
                Some(Value::Vec3s(offsets)) => offsets.to_vec(),
                _ => Vec::new(),
            };
            lines.lattice(cells, from, to, &offsets);
        }
        lines.geometry()
    }

    /// Direction of the wind at a frame.
    pub(super) fn wind(&self, graph: &Graph, frame: Frame) -> Option<[f32; 3]> {
        match value(graph, self.wind?, WIND, frame)? {
            Value::Vec3(direction) => Some(direction.map(|x| x as f32)),
            _ => None,
        }
    }
}

/// A param of a node at a frame.
fn value(graph: &Graph, node: usize, name: &str, frame: Frame) -> Option<Value> {
    let Body::Node { specs, params, .. } = &graph.nodes[node].body else { return None };
    let index = specs.iter().position(|spec| spec.name == name)?;
    Some(params.get(index)?.at(frame.number(), graph.scene.clock()))
}

/// The nodes that `links` depend on, ascending, found by going up only through nodes that `passes` accepts.
fn above(graph: &Graph, links: &[Link], passes: impl Fn(&GraphNode) -> bool) -> Vec<usize> {
    let mut seen = vec![false; graph.nodes.len()];
    let mut open: Vec<usize> = links.iter().map(|link| link.node).collect();
    while let Some(node) = open.pop() {
        if !std::mem::replace(&mut seen[node], true) && passes(&graph.nodes[node]) {
            open.extend(graph.nodes[node].inputs().iter().flatten().map(|link| link.node));
        }
    }
    (0..seen.len()).filter(|node| seen[*node]).collect()
}

/// The lines of a guide: edges of meshes, outlines of controls, curves as they are. `None` without any.
pub(super) fn lines_of(geometry: &Geometry) -> Option<Geometry> {
    let mut lines = Lines::default();
    if let Some((mesh, faces)) = geometry.mesh().and_then(|mesh| Some((mesh, mesh.faces()?))) {
        let sides = (0..faces.runs.len()).flat_map(|face| {
            let corners = faces.face(face);
            (0..corners.len()).map(|k| [corners[k], corners[(k + 1) % corners.len()]])
        });
        let mut edges: Vec<[u32; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        edges.dedup();
        let at = |row: u32| mesh.positions()[row as usize];
        edges.iter().for_each(|[a, b]| lines.add([at(*a), at(*b)]));
    }
    if let Some(points) = geometry.points() {
        lines.controls(points);
    }
    if let Some(curves) = geometry.curves() {
        curves.runs().ranges().for_each(|range| lines.add(curves.positions()[range].iter().copied()));
    }
    lines.geometry()
}

/// Whether a geometry is a Gust_Control, which is drawn as lines wherever it comes from.
pub(super) fn is_control(geometry: &Geometry) -> bool {
    geometry.parts().count() == 1
        && geometry.volume().is_none()
        && geometry.points().is_some_and(|part| runs(part).is_some())
}

/// An output without the controls that were merged into it, which are drawn as lines; `None` if there are none.
pub(super) fn without_controls(geometry: &Geometry) -> Option<Geometry> {
    let runs = runs(geometry.points()?)?;
    let rest = geometry.kinds().any(|kind| kind != Kind::Points);
    (rest && runs.iter().all(|run| *run > 0)).then(|| {
        let mut geometry = geometry.clone();
        geometry.remove(Kind::Points);
        geometry
    })
}

/// Points of the control that each point belongs to.
fn runs(points: &Component) -> Option<&[i32]> {
    whole_numbers(points, RUN)
}

fn whole_numbers<'a>(points: &'a Component, name: &str) -> Option<&'a [i32]> {
    match points.table(Owner::Point).column(name)? {
        Column::I1(rows) => Some(rows),
        _ => None,
    }
}

/// Whether all points of `guide` are points of `layers`: it is visible already.
pub(super) fn is_visible(guide: &Geometry, layers: &[Layer<'_>]) -> bool {
    let bits = |p: &[f32; 3]| p.map(f32::to_bits);
    let parts = layers.iter().filter(|layer| !layer.is_guide).flat_map(|layer| layer.geometry.parts());
    let mut known: Vec<[u32; 3]> = parts.flat_map(|part| part.positions().iter().map(bits)).collect();
    known.sort_unstable();
    let mut points = guide.parts().flat_map(|part| part.positions().iter().map(bits));
    points.all(|p| known.binary_search(&p).is_ok())
}

/// Polylines being collected.
#[derive(Default)]
struct Lines {
    counts: Vec<u32>,
    points: Vec<[f32; 3]>,
}

impl Lines {
    fn add(&mut self, line: impl IntoIterator<Item = [f32; 3]>) {
        let before = self.points.len();
        self.points.extend(line);
        self.counts.push((self.points.len() - before) as u32);
    }

    fn geometry(self) -> Option<Geometry> {
        let curves = (!self.counts.is_empty()).then(|| Component::curves(self.counts, self.points).ok())?;
        curves.map(Geometry::from)
    }

    /// The circles of a sphere, or the twelve edges of each of two cubes.
    fn controls(&mut self, points: &Component) {
        let Some(runs) = runs(points) else { return };
        let shapes = whole_numbers(points, SHAPE).unwrap_or_default();
        let at = points.positions();
        let mut first = 0;
        while let Some(count) = runs.get(first).and_then(|run| usize::try_from(*run).ok()).filter(|count| *count > 0) {
            let Some(outline) = at.get(first + AXIS_POINTS..first + count) else { return };
            let cubes = shapes.get(first) == Some(&1);
            let pieces = if cubes { 24 } else { 3 };
            for line in outline.chunks_exact((outline.len() / pieces).max(1)) {
                let back = if cubes { None } else { line.first() };
                self.add(line.iter().chain(back).copied());
            }
            first += count;
        }
    }

    /// The lines between neighbouring control points.
    fn lattice(&mut self, cells: [i64; 3], from: [f64; 3], to: [f64; 3], offsets: &[[f32; 3]]) {
        let points = cells.map(|cells| usize::try_from(cells).unwrap_or(1).max(1) + 1);
        let row = |[i, j, k]: [usize; 3]| i + points[0] * (j + points[1] * k);
        let at = |index: [usize; 3]| -> [f32; 3] {
            let moved = offsets.get(row(index)).copied().unwrap_or_default();
            std::array::from_fn(|k| {
                let share = index[k] as f64 / (points[k] - 1) as f64;
                (from[k] + (to[k] - from[k]) * share) as f32 + moved[k]
            })
        };
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for (a, b) in (0..points[u]).flat_map(|a| (0..points[v]).map(move |b| (a, b))) {
                let index = |along: usize| {
                    let mut index = [0; 3];
                    (index[axis], index[u], index[v]) = (along, a, b);
                    index
                };
                self.add((0..points[axis]).map(|along| at(index(along))));
            }
        }
    }
}

#[cfg(test)]
mod tests;
