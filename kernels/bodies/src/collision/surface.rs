//! Connectivity of a triangle surface: edges, neighbours, orientation.
//!
//! Positions are passed to each call, so that one surface serves all poses. An edge with more than two triangles
//! keeps the first two.

use numerics::closest_point::{ClosestPoint, TriangleFeature};
use numerics::swept::SweptElements;
use numerics::vector::DVec3;

/// No triangle.
pub(super) const NONE: u32 = u32::MAX;

/// Triangles and their connectivity; degenerate triangles, which use a point twice, have no edges.
#[derive(Clone, Debug)]
pub(super) struct TriangleSurface {
    pub(super) triangles: Vec<[u32; 3]>,
    /// The triangles, for swept boxes.
    pub(super) swept: SweptElements<3>,
    pub(super) edges: Vec<Edge>,
    /// Edges of each triangle, from corner k to k + 1.
    sides: Vec<[u32; 3]>,
    /// Edges at each point.
    around: Lists,
    /// Points used by triangles, ascending.
    pub(super) vertices: Vec<u32>,
    /// Whether every edge has two consistently oriented triangles.
    pub(super) closed: bool,
}

/// An edge of one or two triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Edge {
    pub(super) ends: [u32; 2],
    /// Its triangles; the second is [`NONE`] on a boundary.
    pub(super) faces: [u32; 2],
    /// The corners of these triangles that are not on the edge.
    pub(super) opposite: [u32; 2],
}

/// A list of numbers for each point.
#[derive(Clone, Debug, Default)]
pub(super) struct Lists {
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Lists {
    /// Those of pairs of a point and a number, ascending and each once.
    pub(super) fn new(points: usize, mut pairs: Vec<[u32; 2]>) -> Self {
        pairs.sort_unstable();
        pairs.dedup();
        let start = |point: u32| pairs.partition_point(|pair| pair[0] < point) as u32;
        Self { starts: (0..=points as u32).map(start).collect(), items: pairs.iter().map(|pair| pair[1]).collect() }
    }

    /// The list of a point.
    pub(super) fn of(&self, point: u32) -> &[u32] {
        &self.items[self.starts[point as usize] as usize..self.starts[point as usize + 1] as usize]
    }
}

/// Positions of points, metres.
pub(super) type Positions<'a> = &'a [[f64; 3]];

/// Positions at a time between two poses, with linear motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment<'a> {
    pub(super) from: Positions<'a>,
    pub(super) to: Positions<'a>,
    /// Fraction of the time from the first to the second.
    pub(super) share: f64,
}

impl<'a> Moment<'a> {
    /// Exactly one pose.
    pub(super) fn of(pose: Positions<'a>) -> Self {
        Self { from: pose, to: pose, share: 1.0 }
    }

    /// Position of a point.
    #[inline(always)]
    pub(super) fn position(&self, point: u32) -> DVec3 {
        let to = DVec3::from(self.to[point as usize]);
        if self.share >= 1.0 { to } else { DVec3::from(self.from[point as usize]).lerp(&to, self.share) }
    }

    /// The sum of the positions of points times their weights.
    pub(super) fn weighted(&self, points: &[u32], weights: &[f64]) -> DVec3 {
        points.iter().zip(weights).map(|(point, weight)| self.position(*point) * *weight).sum()
    }
}

impl TriangleSurface {
    /// Connectivity of `triangles` over points, of which some `pose` is given; indices must be in range.
    pub(super) fn new(pose: Positions<'_>, triangles: &[[u32; 3]]) -> Self {
        let mut halves: Vec<([u32; 2], u32, u32)> = Vec::with_capacity(3 * triangles.len());
        for (face, corners) in (0u32..).zip(triangles).filter(|(_, [a, b, c])| a != b && b != c && c != a) {
            for k in 0..3u32 {
                let (from, to) = (corners[k as usize], corners[(k as usize + 1) % 3]);
                halves.push(([from.min(to), from.max(to)], face, k));
            }
        }
        halves.sort_unstable();
        let mut surface = Self {
            triangles: triangles.to_vec(),
            swept: SweptElements::new(triangles.to_vec(), pose),
            edges: Vec::with_capacity(halves.len() / 2),
            sides: vec![[NONE; 3]; triangles.len()],
            around: Lists::default(),
            vertices: Vec::new(),
            closed: !halves.is_empty(),
        };
        for group in halves.chunk_by(|a, b| a.0 == b.0) {
            let index = surface.edges.len() as u32;
            let mut edge = Edge { ends: group[0].0, faces: [NONE; 2], opposite: [NONE; 2] };
            for (slot, (_, face, k)) in group.iter().take(2).enumerate() {
                edge.faces[slot] = *face;
                edge.opposite[slot] = triangles[*face as usize][(*k as usize + 2) % 3];
            }
            for (_, face, k) in group {
                surface.sides[*face as usize][*k as usize] = index;
            }
            let forwards = group.iter().filter(|half| triangles[half.1 as usize][half.2 as usize] == edge.ends[0]);
            surface.closed &= group.len() == 2 && forwards.count() == 1;
            surface.edges.push(edge);
        }
        let ends = (0..).zip(&surface.edges).flat_map(|(index, edge)| edge.ends.map(|end| [end, index]));
        surface.around = Lists::new(pose.len(), ends.collect());
        surface.vertices = (0..pose.len() as u32).filter(|point| !surface.around.of(*point).is_empty()).collect();
        surface
    }

    /// Edges at a point.
    pub(super) fn edges_at(&self, point: u32) -> impl Iterator<Item = &Edge> {
        self.around.of(point).iter().map(|edge| &self.edges[*edge as usize])
    }

    #[inline]
    pub(super) fn corners(&self, at: &Moment<'_>, face: u32) -> [DVec3; 3] {
        let [a, b, c] = self.triangles[face as usize];
        [at.position(a), at.position(b), at.position(c)]
    }

    /// The point closest to `point` on some triangles.
    pub(super) fn nearest(
        &self,
        at: &Moment<'_>,
        faces: impl Iterator<Item = u32>,
        point: DVec3,
    ) -> Option<ClosestPoint> {
        let each = faces.map(|face| ClosestPoint::on(face, point, self.corners(at, face)));
        each.reduce(|best, next| if next.distance < best.distance { next } else { best })
    }

    /// Unit normal; `None` without a triangle, and for one without area.
    pub(super) fn normal(&self, at: &Moment<'_>, face: u32) -> Option<DVec3> {
        let [a, b, c] = self.triangles.get(face as usize)?.map(|corner| at.position(corner));
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(&ac);
        let length = normal.norm();
        (length > 1e-12 * ab.norm() * ac.norm()).then(|| normal / length)
    }

    /// The side of a triangle opposite to corner `k`; degenerate triangles have none.
    fn side(&self, face: u32, k: usize) -> Option<&Edge> {
        self.edges.get(self.sides[face as usize][(k + 1) % 3] as usize)
    }

    /// The triangle across that side.
    pub(super) fn across(&self, face: u32, k: usize) -> Option<u32> {
        self.side(face, k)?.faces.into_iter().find(|other| *other != face && *other != NONE)
    }

    /// Outward direction at a point of a triangle: the angle-weighted mean of the adjacent normals (Bærentzen & Aanæs
    /// 2005), which gives the correct side for any point that has this one as its closest.
    pub(super) fn outward(&self, at: &Moment<'_>, nearest: &ClosestPoint) -> DVec3 {
        let corners = self.triangles[nearest.face as usize];
        let normal = |face: u32| self.normal(at, face).unwrap_or_default();
        match nearest.feature() {
            TriangleFeature::Inside => normal(nearest.face),
            TriangleFeature::Side(k) => match self.side(nearest.face, k) {
                Some(edge) => normal(edge.faces[0]) + normal(edge.faces[1]),
                None => DVec3::zeros(),
            },
            TriangleFeature::Corner(k) => {
                let here = at.position(corners[k]);
                let mut sum = DVec3::zeros();
                for edge in self.edges_at(corners[k]) {
                    let other = if edge.ends[0] == corners[k] { edge.ends[1] } else { edge.ends[0] };
                    let along = at.position(other) - here;
                    for (face, third) in edge.faces.into_iter().zip(edge.opposite).filter(|(face, _)| *face != NONE) {
                        let side = at.position(third) - here;
                        sum += normal(face) * libm::atan2(along.cross(&side).norm(), along.dot(&side));
                    }
                }
                sum
            }
        }
    }

    /// Whether no adjacent triangle is nearer than `nearest` to a point at the offset `away` from it.
    pub(super) fn is_nearest_around(&self, at: &Moment<'_>, nearest: &ClosestPoint, away: &DVec3) -> bool {
        /// Sine of the angle that is tolerated on a neighbour's side: above rounding, below any intended angle.
        const SLACK: f64 = 1e-9;
        let corners = self.triangles[nearest.face as usize];
        let length = away.norm();
        let behind = |to: u32| {
            let direction = at.position(to) - nearest.point;
            away.dot(&direction) <= SLACK * length * direction.norm()
        };
        match nearest.feature() {
            TriangleFeature::Inside => true,
            TriangleFeature::Side(k) => self
                .side(nearest.face, k)
                .is_none_or(|edge| edge.opposite.into_iter().all(|third| third == NONE || behind(third))),
            TriangleFeature::Corner(k) => {
                self.edges_at(corners[k]).all(|edge| edge.ends.into_iter().all(|end| end == corners[k] || behind(end)))
            }
        }
    }

    /// Walks across nearly flat edges to the triangle whose projection contains `point`: the contact plane of a point
    /// that slid on from where it crossed the surface. Returns the closest point there, and the normal.
    pub(super) fn walk_to(&self, at: &Moment<'_>, face: u32, point: DVec3) -> (ClosestPoint, Option<DVec3>) {
        /// Largest number of triangles passed.
        const MOST: usize = 64;
        /// Cosine of the angle at an edge beyond which the next triangle belongs to another side.
        const BEND: f64 = 0.5;
        let (mut face, mut before) = (face, NONE);
        let mut normal = self.normal(at, face);
        for _ in 0..MOST {
            let Some(here) = normal else { break };
            let weights = numerics::closest_point::projected(point, self.corners(at, face), here);
            let mut sides = [0, 1, 2];
            sides.sort_by(|a, b| weights[*a].total_cmp(&weights[*b]));
            let outside = sides.into_iter().filter(|k| weights[*k] < 0.0);
            let next = outside.filter_map(|k| self.across(face, k)).find_map(|next| {
                let there = self.normal(at, next)?;
                (next != before && there.dot(&here) >= BEND).then_some((next, there))
            });
            let Some((next, there)) = next else { break };
            (before, face, normal) = (face, next, Some(there));
        }
        (ClosestPoint::on(face, point, self.corners(at, face)), normal)
    }
}
