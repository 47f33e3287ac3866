//! Removal of slivers: nearly flat tets, which Delaunay tetrahedralisations contain even between well-spaced points.
//!
//! Three local operations, each taken only if the worst tet it involves becomes better: an interior edge is replaced by
//! triangles across the ring of tets around it (edge removal; the best triangulation of the ring by Klincsek's dynamic
//! programming, as in Klingner & Shewchuk 2007), a face by an edge (2-3 flip), and an interior point is moved to where
//! the worst tet around it is best. Then flat tets that lie on the surface are taken away where that leaves all faces
//! and edges of the surface: on the two halves of a flat quad.
//!
//! Points of the surface do not move, its edges and faces are not removed, and the tets fill the same space, apart
//! from the flat tets that are taken away. Sequential in a fixed order, so that results have the same bits for any
//! number of threads. Limit: flat tets below two triangles of the surface stay.

use numerics::vector::{DVec3, Vec3, to_f64};
use std::collections::BTreeMap;

use super::boundary::{faces_of, sorted};
use super::quality::measure;
use super::solid::{SLIVER, TASK};

/// Tets of lower quality are improved if possible.
const POOR: f64 = 0.2;

/// Passes over the poor tets.
const PASSES: usize = 4;

/// Most tets around an edge that is removed.
const MOST_AROUND: usize = 9;

/// Relative gain below which nothing is changed, so that rounding cannot make passes undo each other.
const GAIN: f64 = 1e-3;

/// Most rounds of moving a point, and the shares of a direction that a round tries.
const ROUNDS: usize = 6;
const SHARES: [f64; 5] = [1.0, 0.5, 0.25, 0.1, 0.04];

/// What must not change.
pub(super) struct Unchanged<'a> {
    /// Number of points on the surface, which come first.
    pub(super) points: usize,
    /// Its edges, lower point first, sorted.
    pub(super) edges: &'a [[u32; 2]],
    /// Its triangles.
    pub(super) triangles: &'a [[u32; 3]],
}

/// Tets under improvement.
pub(super) struct Improver<'a> {
    surface: Unchanged<'a>,
    /// The surface's triangles by their sorted corners.
    faces: Vec<[u32; 3]>,
    /// Unit of length: metres.
    step: f64,
    points: &'a mut [Vec3],
    tets: Vec<[u32; 4]>,
    bodies: Vec<u32>,
    /// Quality of each tet; 0 if it is flat or inverted.
    quality: Vec<f64>,
    live: Vec<bool>,
    /// First entry in `members` of each point among the tets at the start.
    starts: Vec<u32>,
    members: Vec<u32>,
    /// Tets made since, by point.
    later: BTreeMap<u32, Vec<u32>>,
}

/// New tets for some old ones.
struct Change {
    old: Vec<u32>,
    new: Vec<[u32; 4]>,
    /// The worst quality of the new ones.
    quality: f64,
}

impl<'a> Improver<'a> {
    /// Of `tets` of `bodies` over `points`, measured in units of `step` metres, so that no squared length over- or
    /// underflows.
    pub(super) fn new(
        surface: Unchanged<'a>,
        step: f64,
        points: &'a mut [Vec3],
        tets: Vec<[u32; 4]>,
        bodies: Vec<u32>,
    ) -> Self {
        let mut faces: Vec<[u32; 3]> = surface.triangles.iter().map(|face| sorted(*face)).collect();
        faces.sort_unstable();
        let mut starts = vec![0_u32; points.len() + 1];
        tets.as_flattened().iter().for_each(|corner| starts[*corner as usize + 1] += 1);
        (0..points.len()).for_each(|point| starts[point + 1] += starts[point]);
        let (mut next, mut members) = (starts.clone(), vec![0; 4 * tets.len()]);
        for (tet, corners) in (0..).zip(&tets) {
            for corner in corners {
                members[next[*corner as usize] as usize] = tet;
                next[*corner as usize] += 1;
            }
        }
        let live = vec![true; tets.len()];
        let mut new = Self {
            surface,
            faces,
            step,
            points,
            tets,
            bodies,
            quality: vec![0.0; live.len()],
            live,
            starts,
            members,
            later: BTreeMap::new(),
        };
        let mut quality = std::mem::take(&mut new.quality);
        numerics::parallel::fill(&mut quality, TASK, |tet| new.quality_of(new.tets[tet]));
        new.quality = quality;
        new
    }

    /// Improves poor tets, and returns all of them with their bodies.
    pub(super) fn run(mut self) -> (Vec<[u32; 4]>, Vec<u32>) {
        for _ in 0..PASSES {
            let mut poor: Vec<u32> = (0..self.tets.len() as u32).filter(|tet| self.is_poor(*tet, POOR)).collect();
            poor.sort_by(|a, b| self.quality[*a as usize].total_cmp(&self.quality[*b as usize]).then(a.cmp(b)));
            let mut changed = false;
            for tet in poor {
                changed |= self.is_poor(tet, POOR) && self.improve(tet);
            }
            if !changed {
                break;
            }
        }
        self.drop_flat();
        self.finish()
    }

    /// All tets with their bodies.
    pub(super) fn finish(self) -> (Vec<[u32; 4]>, Vec<u32>) {
        let (tets, bodies) = (&self.tets, &self.bodies);
        let kept = (0..tets.len()).filter(|tet| self.live[*tet]);
        kept.map(|tet| (tets[tet], bodies[tet])).unzip()
    }

    fn is_poor(&self, tet: u32, limit: f64) -> bool {
        self.live[tet as usize] && self.quality[tet as usize] < limit
    }

    /// Tries everything on a tet; returns whether something changed.
    fn improve(&mut self, tet: u32) -> bool {
        let corners = self.tets[tet as usize];
        let pairs = (0..4).flat_map(|j| (0..j).map(move |i| [corners[i], corners[j]]));
        let by_edge = pairs.filter_map(|ends| self.without_edge(ends));
        let by_face = faces_of(&corners).into_iter().filter_map(|face| self.without_face(tet, face));
        let best = by_edge.chain(by_face).reduce(|a, b| if b.quality > a.quality { b } else { a });
        if let Some(change) = best {
            self.apply(change);
            return true;
        }
        let on_surface = self.surface.points;
        let mut moved = false;
        for corner in corners.into_iter().filter(|corner| *corner as usize >= on_surface) {
            moved |= self.relocate(corner);
        }
        moved
    }

    fn at(&self, point: u32) -> DVec3 {
        to_f64(self.points[point as usize]) / self.step
    }

    fn quality_of(&self, tet: [u32; 4]) -> f64 {
        let measured = measure(&tet.map(|corner| self.at(corner)));
        if measured.volume > 0.0 { measured.quality } else { 0.0 }
    }

    /// The live tets at a point.
    fn around(&self, point: u32) -> impl Iterator<Item = u32> {
        let range = self.starts[point as usize] as usize..self.starts[point as usize + 1] as usize;
        let later = self.later.get(&point).into_iter().flatten();
        self.members[range].iter().chain(later).copied().filter(|tet| self.live[*tet as usize])
    }

    /// The live tets with all these points.
    fn with<const N: usize>(&self, points: [u32; N]) -> Vec<u32> {
        let has = |tet: &u32| points.iter().all(|point| self.tets[*tet as usize].contains(point));
        self.around(points[0]).filter(has).collect()
    }

    /// The points around an interior edge, counter-clockwise seen from its second end; `None` if the tets around it do
    /// not close up.
    fn ring(&self, [a, b]: [u32; 2], tets: &[u32]) -> Option<Vec<u32>> {
        let links: Vec<[u32; 2]> = tets.iter().map(|tet| opposite(self.tets[*tet as usize], [a, b])).collect();
        let mut ring = vec![links.first()?[0]];
        for _ in 0..links.len() {
            let last = ring[ring.len() - 1];
            let mut next = links.iter().filter(|link| link[0] == last);
            let [_, to] = next.next()?;
            if next.next().is_some() {
                return None;
            }
            ring.push(*to);
        }
        let last = ring.pop()?;
        let closed = last == ring[0] && !ring[1..].contains(&last);
        closed.then_some(ring)
    }

    fn worst(&self, tets: &[u32]) -> f64 {
        tets.iter().map(|tet| self.quality[*tet as usize]).fold(f64::INFINITY, f64::min)
    }

    /// The best tets without an edge, if they are better and the edge may go.
    fn without_edge(&self, mut ends: [u32; 2]) -> Option<Change> {
        ends.sort_unstable();
        if self.surface.edges.binary_search(&ends).is_ok() {
            return None;
        }
        let old = self.with(ends);
        if !(3..=MOST_AROUND).contains(&old.len()) {
            return None;
        }
        let ring = self.ring(ends, &old)?;
        let n = ring.len();
        // The best worst quality, and the middle corner, of the triangulated ring from i to j.
        let (mut best, mut middle) = ([[f64::INFINITY; MOST_AROUND]; MOST_AROUND], [[0; MOST_AROUND]; MOST_AROUND]);
        let pair =
            |i: usize, k: usize, j: usize| [[ring[i], ring[k], ring[j], ends[1]], [ring[i], ring[j], ring[k], ends[0]]];
        for span in 2..n {
            for i in 0..n - span {
                let j = i + span;
                best[i][j] = -1.0;
                for k in i + 1..j {
                    let [above, below] = pair(i, k, j).map(|tet| self.quality_of(tet));
                    let quality = above.min(below).min(best[i][k]).min(best[k][j]);
                    if quality > best[i][j] {
                        (best[i][j], middle[i][j]) = (quality, k);
                    }
                }
            }
        }
        let quality = best[0][n - 1];
        if quality <= self.worst(&old) + GAIN {
            return None;
        }
        let (mut new, mut spans) = (Vec::with_capacity(2 * n - 4), vec![[0, n - 1]]);
        while let Some([i, j]) = spans.pop() {
            if j - i > 1 {
                let k = middle[i][j];
                new.extend(pair(i, k, j));
                spans.extend([[i, k], [k, j]]);
            }
        }
        Some(Change { old, new, quality })
    }

    /// Three tets around a new edge across a face between two tets, if they are better and the face may go.
    fn without_face(&self, tet: u32, face: [u32; 3]) -> Option<Change> {
        if self.faces.binary_search(&sorted(face)).is_ok() {
            return None;
        }
        let other = self.with(face).into_iter().find(|other| *other != tet)?;
        let apex = |tet: u32| self.tets[tet as usize].into_iter().find(|corner| !face.contains(corner));
        // The face faces away from the first tet, so its corners run counter-clockwise seen from the other.
        let (from, to) = (apex(tet)?, apex(other)?);
        let [a, b, c] = face;
        let new = [[a, b], [b, c], [c, a]].map(|[u, v]| [from, to, u, v]);
        let quality = new.iter().map(|tet| self.quality_of(*tet)).fold(f64::INFINITY, f64::min);
        let old = vec![tet, other];
        (quality > self.worst(&old) + GAIN).then(|| Change { old, new: new.to_vec(), quality })
    }

    fn apply(&mut self, change: Change) {
        let body = self.bodies[change.old[0] as usize];
        change.old.iter().for_each(|tet| self.live[*tet as usize] = false);
        for corners in change.new {
            let tet = self.tets.len() as u32;
            self.quality.push(self.quality_of(corners));
            self.tets.push(corners);
            self.bodies.push(body);
            self.live.push(true);
            corners.iter().for_each(|corner| self.later.entry(*corner).or_default().push(tet));
        }
    }

    /// Moves an interior point so that the worst tet around it becomes better; returns whether it moved. A round
    /// tries steps towards the neighbours' centroid and along the gradient of the worst tet's volume.
    fn relocate(&mut self, point: u32) -> bool {
        let tets: Vec<u32> = self.around(point).collect();
        let (start, mut best) = (self.points[point as usize], self.worst(&tets));
        let before = best;
        for _ in 0..ROUNDS {
            let (from, here) = (self.points[point as usize], self.at(point));
            let directions = self.directions(point, &tets);
            let mut found = from;
            for (direction, share) in directions.iter().flat_map(|by| SHARES.map(|share| (by, share))) {
                let to = (here + direction * share) * self.step;
                self.points[point as usize] = [to.x as f32, to.y as f32, to.z as f32];
                let each = tets.iter().map(|tet| self.quality_of(self.tets[*tet as usize]));
                let worst = each.fold(f64::INFINITY, f64::min);
                if worst > best {
                    (best, found) = (worst, self.points[point as usize]);
                }
            }
            self.points[point as usize] = found;
            if found == from {
                break;
            }
        }
        if best <= before + GAIN {
            self.points[point as usize] = start;
            return false;
        }
        tets.iter().for_each(|tet| self.quality[*tet as usize] = self.quality_of(self.tets[*tet as usize]));
        true
    }

    /// Where to look for a better position of a point: its way to the centroid of its neighbours, and one as long as
    /// its mean distance from them, along which the worst tet grows.
    fn directions(&self, point: u32, tets: &[u32]) -> [DVec3; 2] {
        let here = self.at(point);
        let (mut centroid, mut distance) = (DVec3::zeros(), 0.0);
        let mut worst = (f64::INFINITY, DVec3::zeros());
        for tet in tets {
            let corners = self.tets[*tet as usize];
            for other in corners.into_iter().filter(|other| *other != point) {
                centroid += self.at(other) - here;
                distance += (self.at(other) - here).norm();
            }
            let quality = self.quality_of(corners);
            let own = corners.iter().position(|corner| *corner == point);
            if let Some(own) = own.filter(|_| quality < worst.0) {
                let [a, b, c] = faces_of(&corners)[own].map(|corner| self.at(corner));
                worst = (quality, -(b - a).cross(&(c - a)));
            }
        }
        let count = 3.0 * tets.len().max(1) as f64;
        [centroid / count, worst.1.try_normalize(0.0).unwrap_or_default() * (distance / count)]
    }

    /// Takes away slivers that lie with two faces on the surface, where those meet in an edge that is none of the
    /// surface's: the other two faces are the same quad, cut along its other diagonal.
    fn drop_flat(&mut self) {
        for tet in 0..self.tets.len() as u32 {
            let corners = self.tets[tet as usize];
            if !self.is_poor(tet, SLIVER) || corners.iter().any(|corner| *corner as usize >= self.surface.points) {
                continue;
            }
            let outer: Vec<[u32; 3]> =
                faces_of(&corners).into_iter().filter(|face| self.with(*face).len() == 1).collect();
            let [first, second] = outer[..] else { continue };
            let mut shared: Vec<u32> = first.into_iter().filter(|corner| second.contains(corner)).collect();
            shared.sort_unstable();
            let [a, b] = shared[..] else { continue };
            let rest = opposite(corners, [a, b]);
            let around = self.with(rest);
            let is_interior = self.ring(rest, &around).is_some();
            if is_interior && self.surface.edges.binary_search(&[a, b]).is_err() {
                self.live[tet as usize] = false;
            }
        }
    }
}

/// The other two corners of a tet with these, in the order that makes (a, b, c, d) an even permutation of the tet.
fn opposite(tet: [u32; 4], [a, b]: [u32; 2]) -> [u32; 2] {
    let place = |point: u32| tet.iter().position(|corner| *corner == point).unwrap_or(0);
    let (i, j) = (place(a), place(b));
    let rest: Vec<usize> = (0..4).filter(|k| *k != i && *k != j).collect();
    let [k, l] = [rest[0], rest[1]];
    let order = [i, j, k, l];
    let swaps = (0..4).flat_map(|n| (0..n).map(move |m| (m, n))).filter(|(m, n)| order[*m] > order[*n]).count();
    if swaps % 2 == 0 { [tet[k], tet[l]] } else { [tet[l], tet[k]] }
}
