//! Edges of one surface that go through another, which no point shows: a thin rod through the face of a coarse mesh, say.
//!
//! Limit: how deep a body goes through itself is not measured, only by how many edges.

use super::solid::{Solid, Solids};
use super::surface::{Edge, Moment, TriangleSurface};
use super::{BodySkin, CollisionScene, Overlap, OverlapPartner, TASK, overlap};
use numerics::parallel;
use numerics::swept::{self, SweptBoxTree};
use numerics::tree::Cuboid;
use numerics::vector::DVec3;

/// How far an edge is in a surface.
#[derive(Default)]
struct Pierced {
    /// Middles of its stretches within a closed one.
    within: Vec<[f64; 3]>,
    /// For an open one the distance to which both of its ends are on either side, metres.
    deepest: f64,
}

impl CollisionScene<'_> {
    /// The largest distance below a surface that an edge of another one reaches, metres; 0 if none goes through another.
    pub(super) fn deepest_piercing(&self, solids: &Solids<'_>) -> f64 {
        let mut deepest = 0.0_f64;
        for ((index, own), skin) in solids[0].iter().enumerate().zip(self.skins) {
            let released = skin.released(&own.points);
            for other in self.partners(solids, index) {
                let (mut edges, mut others) = (own.surface.edge_indices(), other.surface.edge_indices());
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
                if own
                    .reaches(&own.surface.edge_indices(), &other)
                    .max(other.reaches(&other.surface.edge_indices(), &own))
                    > 0.0
                {
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
            let (surface, tree, rest) = (&skin.surface, skin.surface.swept.sweep(&boxes, 0.0), Moment::of(&skin.rest));
            let crosses = |edge: &Edge, face: u32, at: &Moment<'_>| {
                crossing(edge.ends.map(|end| at.position(end)), surface.corners(at, face)).is_some()
            };
            let crossed = surface.each_edge(&surface.edge_indices(), &boxes, &tree, |_, edge, faces| {
                let goes_through = |face: &u32| {
                    let corners = surface.triangles[*face as usize];
                    !edge.ends.iter().any(|end| corners.contains(end))
                        && crosses(edge, *face, &at)
                        && !crosses(edge, *face, &rest)
                };
                faces.iter().copied().find(goes_through)
            });
            crossed.len()
        };
        self.skins.iter().map(of_skin).sum()
    }

    /// The edges of a skin that go through the surface of an obstacle, with contact points at `x` and the obstacle at the end
    /// of the frame: by index, with the triangles that they meet first from either end.
    pub(super) fn cut_edges(&self, skin: usize, obstacle: usize, x: &[[f64; 3]]) -> Vec<(usize, [u32; 2])> {
        let (skin, obstacle) = (&self.skins[skin], &self.obstacles[obstacle]);
        let points = obstacle.at(1.0);
        let [own, boxes] = [swept::swept_boxes(&[x]), swept::swept_boxes(&[&points])];
        let tree = obstacle.surface.swept.sweep(&boxes, 0.0);
        if !swept::overlap(&swept::bounds_of_finite(&skin.surface.vertices, &own), &tree.bounds) {
            return Vec::new();
        }
        let at = Moment::of(&points);
        let surface = &skin.surface;
        surface.each_edge(&surface.edge_indices(), &own, &tree, |index, edge, faces| {
            let ends = edge.ends.map(|end| DVec3::from(x[end as usize]));
            let met = |face: &u32| Some((crossing(ends, obstacle.surface.corners(&at, *face))?.0, *face));
            let mut met: Vec<(f64, u32)> = faces.iter().filter_map(met).collect();
            met.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            Some((index as usize, [met.first()?.1, met.last()?.1]))
        })
    }
}

impl TriangleSurface {
    fn edge_indices(&self) -> Vec<u32> {
        (0..self.edges.len() as u32).collect()
    }

    /// What `find` makes of some edges, with their indices, and of the triangles near them among those of a `tree`. `boxes` are
    /// those of the points.
    fn each_edge<R: Send>(
        &self,
        edges: &[u32],
        boxes: &[Cuboid],
        tree: &SweptBoxTree<'_>,
        find: impl Fn(u32, &Edge, &[u32]) -> Option<R> + Sync,
    ) -> Vec<R> {
        parallel::concat(parallel::map(edges.chunks(TASK), |_, edges| {
            let mut faces = Vec::new();
            let found = edges.iter().filter_map(|index| {
                let edge = &self.edges[*index as usize];
                tree.overlapping(&swept::bounds_of(&edge.ends, boxes), &mut faces);
                find(*index, edge, &faces)
            });
            found.collect()
        }))
    }
}

impl Solid<'_> {
    /// The same with its points moved below the surface by a distance.
    fn below(&self, distance: f64) -> Self {
        let points = overlap::below(&self.points, self.surface, distance);
        let boxes = swept::swept_boxes(&[&points]);
        Self { points: points.into(), boxes: boxes.into(), ..self.clone() }
    }

    /// The largest distance below the surface of `other` that some of its edges reach.
    fn reaches(&self, edges: &[u32], other: &Solid<'_>) -> f64 {
        let tree = other.surface.swept.sweep(&other.boxes, 0.0);
        let pierced =
            self.surface.each_edge(edges, &self.boxes, &tree, |_, edge, faces| self.pierce(edge, other, faces));
        let deepest = pierced.iter().map(|pierced| pierced.deepest).fold(0.0, f64::max);
        let within: Vec<[f64; 3]> = pierced.into_iter().flat_map(|pierced| pierced.within).collect();
        other.distances(&within).into_iter().flatten().fold(deepest, f64::max)
    }

    /// How far an edge is in `other`, which it may cross at some `faces`.
    fn pierce(&self, edge: &Edge, other: &Solid<'_>, faces: &[u32]) -> Option<Pierced> {
        let [p, q] = edge.ends.map(|end| DVec3::from(self.points[end as usize]));
        let (at, mut pierced) = (Moment::of(&other.points), Pierced::default());
        // Where it goes in, and where it comes out.
        let mut crossed: Vec<(f64, bool)> = Vec::new();
        for face in faces {
            let corners = other.surface.corners(&at, *face);
            let Some((share, sides)) = crossing([p, q], corners) else { continue };
            crossed.push((share, sides[0] > 0.0));
            pierced.deepest = pierced.deepest.max(sides[0].abs().min(sides[1].abs()));
        }
        crossed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        if other.surface.closed {
            let begins = (0.0, !crossed.first()?.1);
            let all: Vec<(f64, bool)> = [begins].into_iter().chain(crossed).chain([(1.0, false)]).collect();
            let stretches = all.windows(2).filter(|pair| pair[0].1);
            let middles = stretches.map(|pair| p.lerp(&q, 0.5 * (pair[0].0 + pair[1].0)).into());
            pierced = Pierced { within: middles.collect(), deepest: 0.0 };
        }
        Some(pierced)
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
