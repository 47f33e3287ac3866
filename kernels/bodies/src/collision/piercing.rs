//! Edges of one surface that go through another, which no point shows: a thin rod through the face of a coarse mesh, say.
//!
//! Limit: how deep a body goes through itself is not measured, only by how many edges.

use super::obstacle::narrow;
use super::solid::{Solid, Solids};
use super::surface::{Edge, Moment};
use super::{BodySkin, CollisionScene, Overlap, OverlapPartner, TASK, overlap};
use numerics::parallel;
use numerics::swept::{self, SweptBoxTree};
use numerics::tree::TriangleTree;
use numerics::vector::DVec3;

/// How far edges are in a surface.
#[derive(Default)]
struct Pierced {
    /// Middles of the stretches of edges within a closed one.
    within: Vec<DVec3>,
    /// For open ones the largest distance to which both ends of an edge are on either side, metres.
    deepest: f64,
}

impl CollisionScene<'_> {
    /// The largest distance below a surface that an edge of another one reaches, metres; 0 if none goes through another.
    pub(super) fn deepest_piercing(&self, solids: &Solids<'_>) -> f64 {
        let mut deepest = 0.0_f64;
        for ((index, own), skin) in solids[0].iter().enumerate().zip(self.skins) {
            let released = skin.released(&own.points);
            for other in self.partners(solids, index) {
                let (mut edges, mut others) = (own.edges(), other.edges());
                if let OverlapPartner::Obstacle(obstacle) = other.is {
                    edges.retain(|edge| !super::has(&released.edges, *edge));
                    let sharp = &self.obstacles[obstacle].sharp_edges;
                    others = if released.faces.is_empty() { sharp.clone() } else { Vec::new() };
                }
                deepest = deepest.max(own.reaches(&edges, other)).max(other.reaches(&others, own));
            }
        }
        deepest
    }

    /// The pairs of a skin and a closed obstacle, or another skin, of which edges go through the other although no point is
    /// inside, so that they are not among `overlaps`: at the start of the frame, with contact points at `x`. Surfaces are tested
    /// a little below where they are, so that those that coincide count where what is below both crosses.
    pub fn crossings(&self, x: &[[f64; 3]], overlaps: &[Overlap]) -> Vec<(usize, OverlapPartner)> {
        let boxes = swept::swept_boxes(&[x]);
        let solids = self.solids(x, &boxes, 0.0);
        let mut found = Vec::new();
        for (skin, own) in solids[0].iter().enumerate().filter(|(_, own)| own.surface.closed) {
            for other in self.partners(&solids, skin).filter(|other| other.surface.closed) {
                let pair = (skin, other.is);
                if overlaps.iter().any(|overlap| (overlap.skin, overlap.partner) == pair) {
                    continue;
                }
                let [own, other] = [own, other].map(|solid| solid.below(overlap::BELOW * other.gap));
                if own.reaches(&own.edges(), &other).max(other.reaches(&other.edges(), &own)) > 0.0 {
                    found.push(pair);
                }
            }
        }
        found
    }

    /// Number of edges of skins that go through a triangle of the same skin, with contact points at `x`. Triangles with a
    /// point in common with the edge do not count, nor do those that it goes through at rest.
    pub fn self_crossings(&self, x: &[[f64; 3]]) -> usize {
        let (boxes, at) = (swept::swept_boxes(&[x]), Moment::of(x));
        let of_skin = |skin: &BodySkin| -> usize {
            let (surface, tree, rest) = (&skin.surface, skin.faces.sweep(&boxes, 0.0), Moment::of(&skin.rest));
            let crosses = |edge: &Edge, face: u32, at: &Moment<'_>| {
                crossing(edge.ends.map(|end| at.position(end)), surface.corners(at, face)).is_some()
            };
            let goes_through = |edge: &Edge, faces: &mut Vec<u32>| {
                tree.overlapping(&swept::bounds_of(&edge.ends, &boxes), faces);
                faces.iter().any(|face| {
                    let corners = surface.triangles[*face as usize];
                    !edge.ends.iter().any(|end| corners.contains(end))
                        && crosses(edge, *face, &at)
                        && !crosses(edge, *face, &rest)
                })
            };
            let counts = parallel::map(surface.edges.chunks(TASK), |_, edges| {
                let mut faces = Vec::new();
                edges.iter().filter(|edge| goes_through(edge, &mut faces)).count()
            });
            counts.into_iter().sum()
        };
        self.skins.iter().map(of_skin).sum()
    }

    /// The edges of a skin that go through the surface of an obstacle, with contact points at `x` and the obstacle at the end
    /// of the frame: by index, with the triangles that they meet first from either end.
    pub(super) fn cut_edges(&self, skin: usize, obstacle: usize, x: &[[f64; 3]]) -> Vec<(usize, [u32; 2])> {
        let (skin, obstacle) = (&self.skins[skin], &self.obstacles[obstacle]);
        let points = obstacle.at(1.0);
        let [own, boxes] = [swept::swept_boxes(&[x]), swept::swept_boxes(&[&points])];
        let tree = obstacle.faces.sweep(&boxes, 0.0);
        if !swept::overlap(&swept::bounds_of_finite(&skin.surface.vertices, &own), &tree.bounds) {
            return Vec::new();
        }
        let at = Moment::of(&points);
        let cut = |edge: &Edge, faces: &mut Vec<u32>| {
            tree.overlapping(&swept::bounds_of(&edge.ends, &own), faces);
            let ends = edge.ends.map(|end| DVec3::from(x[end as usize]));
            let met = |face: &u32| Some((crossing(ends, obstacle.surface.corners(&at, *face))?.0, *face));
            let mut met: Vec<(f64, u32)> = faces.iter().filter_map(met).collect();
            met.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            Some([met.first()?.1, met.last()?.1])
        };
        let indices: Vec<usize> = (0..skin.surface.edges.len()).collect();
        let parts = parallel::map(indices.chunks(TASK), |_, indices| {
            let mut faces = Vec::new();
            let found =
                indices.iter().filter_map(|index| Some((*index, cut(&skin.surface.edges[*index], &mut faces)?)));
            found.collect::<Vec<_>>()
        });
        parts.into_iter().flatten().collect()
    }
}

impl Solid<'_> {
    /// The indices of all its edges.
    fn edges(&self) -> Vec<u32> {
        (0..self.surface.edges.len() as u32).collect()
    }

    /// The same with its points moved below the surface by a distance.
    fn below(&self, distance: f64) -> Self {
        let points = overlap::below(&self.points, self.surface, distance);
        let boxes = swept::swept_boxes(&[&points]);
        Self { points: points.into(), boxes: boxes.into(), ..self.clone() }
    }

    /// The largest distance below the surface of `other` that some of its edges reach.
    fn reaches(&self, edges: &[u32], other: &Solid<'_>) -> f64 {
        let tree = other.faces.sweep(&other.boxes, 0.0);
        let parts = parallel::map(edges.chunks(TASK), |_, edges| {
            let (mut pierced, mut faces) = (Pierced::default(), Vec::new());
            edges.iter().for_each(|edge| {
                self.pierce(&self.surface.edges[*edge as usize], (other, &tree), &mut faces, &mut pierced)
            });
            pierced
        });
        let deepest = parts.iter().map(|part| part.deepest).fold(0.0, f64::max);
        let within: Vec<[f64; 3]> = parts.iter().flat_map(|part| &part.within).map(|point| (*point).into()).collect();
        if within.is_empty() {
            return deepest;
        }
        let solid = TriangleTree::build(&narrow(&other.points), &other.surface.triangles);
        let closest = solid.closest_each(&narrow(&within), f32::INFINITY).into_iter().flatten();
        closest.map(|closest| f64::from(closest.distance)).fold(deepest, f64::max)
    }

    fn pierce(
        &self,
        edge: &Edge,
        (other, tree): (&Solid<'_>, &SweptBoxTree<'_>),
        faces: &mut Vec<u32>,
        pierced: &mut Pierced,
    ) {
        tree.overlapping(&swept::bounds_of(&edge.ends, &self.boxes), faces);
        let [p, q] = edge.ends.map(|end| DVec3::from(self.points[end as usize]));
        let at = Moment::of(&other.points);
        // Where it goes in, and where it comes out.
        let mut crossed: Vec<(f64, bool)> = Vec::new();
        for face in faces.iter() {
            let corners = other.surface.corners(&at, *face);
            let Some((share, sides)) = crossing([p, q], corners) else { continue };
            crossed.push((share, sides[0] > 0.0));
            if !other.surface.closed {
                pierced.deepest = pierced.deepest.max(sides[0].abs().min(sides[1].abs()));
            }
        }
        if crossed.is_empty() || !other.surface.closed {
            return;
        }
        crossed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let ends = [(0.0, !crossed[0].1), (1.0, false)];
        let all: Vec<(f64, bool)> = [ends[0]].into_iter().chain(crossed).chain([ends[1]]).collect();
        let stretches = all.windows(2).filter(|pair| pair[0].1);
        pierced.within.extend(stretches.map(|pair| p.lerp(&q, 0.5 * (pair[0].0 + pair[1].0))));
    }
}

/// Where a segment goes through a triangle, as a fraction of it, and the distances of its ends from the triangle's plane.
fn crossing([p, q]: [DVec3; 2], [a, b, c]: [DVec3; 3]) -> Option<(f64, [f64; 2])> {
    let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
    let sides = [p, q].map(|end| normal.dot(&(end - a)));
    if (sides[0] < 0.0) == (sides[1] < 0.0) || sides.contains(&0.0) {
        return None;
    }
    let way = q - p;
    let turns = [[a, b], [b, c], [c, a]].map(|[from, to]| way.dot(&(from - p).cross(&(to - p))));
    let inside = turns.iter().all(|turn| *turn >= 0.0) || turns.iter().all(|turn| *turn <= 0.0);
    inside.then_some((sides[0] / (sides[0] - sides[1]), sides))
}
