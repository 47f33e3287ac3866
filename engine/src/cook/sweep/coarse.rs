//! Outputs so far from the origin that single precision rounds their shape.

use super::Sweep;
use crate::cook::warnings::rounded;
use crate::geometry::{Component, Geometry, Kind};
use crate::note::{self, Note};
use crate::time::Frame;
use numerics::vector::to_f64;

/// Steps of positions, of the mean edge, from which on a note says so.
const COARSEST: f64 = 0.03125;

/// Positions that single precision rounds by a sizeable part of an edge.
pub(super) struct CoarsePositions {
    frame: Frame,
    kind: Kind,
    /// Their step and the mean edge or segment, m.
    step: f64,
    edge: f64,
}

impl CoarsePositions {
    /// Of the first component that has some.
    pub(super) fn of(geometry: &Geometry, frame: Frame) -> Option<Self> {
        geometry.parts().find_map(|part| {
            let points = part.positions();
            let largest = points.as_flattened().iter().fold(0.0_f32, |most, x| most.max(x.abs()));
            let step = f64::from(largest.next_up()) - f64::from(largest);
            let edge = mean_edge(part)?;
            (step > COARSEST * edge).then_some(Self { frame, kind: part.kind(), step, edge })
        })
    }
}

/// The mean length of the segments of curves, or of the sides of triangles or tets, m; `None` where all are 0.
fn mean_edge(part: &Component) -> Option<f64> {
    let points = part.positions();
    let length = |a: u32, b: u32| (to_f64(points[a as usize]) - to_f64(points[b as usize])).norm();
    let (sum, count) = match part.kind() {
        Kind::Curves => {
            let segments = part.runs().ranges().flat_map(|cvs| (cvs.start + 1)..cvs.end.max(cvs.start + 1));
            segments.fold((0.0, 0_usize), |(sum, count), cv| (sum + length(cv as u32 - 1, cv as u32), count + 1))
        }
        Kind::Mesh => {
            let triangles = part.triangles();
            let sum = triangles.corners.iter().map(|[a, b, c]| length(*a, *b) + length(*b, *c) + length(*c, *a)).sum();
            (sum, 3 * triangles.corners.len())
        }
        Kind::Tets => {
            let tets = part.tet_corners();
            (tets.iter().map(|[a, b, c, _]| length(*a, *b) + length(*b, *c) + length(*c, *a)).sum(), 3 * tets.len())
        }
        _ => (0.0, 0),
    };
    (sum > 0.0).then(|| sum / count as f64)
}

impl Sweep<'_, '_, '_> {
    /// Notes outputs that are so far from the origin that single precision rounds their shape.
    pub(super) fn note_coarse_positions(&mut self) {
        let graph = self.plan.graph;
        for (output, coarse) in std::mem::take(&mut self.observed.coarse) {
            let Some(coarse) = coarse else { continue };
            let output = &graph.outputs[output];
            let CoarsePositions { kind, step, edge, .. } = coarse;
            let text = format!(
                "output `{}`: positions of its {kind} step by {} m, and its edges are {} m long on average",
                output.name,
                rounded(step),
                rounded(edge),
            );
            let hint = "So far from the origin single precision rounds their shape, and nodes are less accurate. Move the scene near the \
                        origin, and set the scene's `origin` to where it was.";
            let from = &graph.nodes[output.from.node].id;
            self.report
                .notes
                .push(Note::new(note::kind::COARSE_POSITIONS, text).of_node(from).at(vec![coarse.frame]).hint(hint));
        }
    }
}
