//! Safe repairs of a polygon surface: merging duplicate points, dropping faces that bound nothing.
//!
//! A safe repair never opens a closed surface and moves no point. A face without area is therefore kept as long as
//! its corners are different points, since its neighbours need it. Points at the same position are merged where an
//! edge is open, as along texture seams, and within connected parts; two bodies that touch stay separate.

use std::collections::BTreeMap;

use super::grid::GridPoint;
use super::surface_fault::SurfaceFault;

/// A polygon mesh.
#[derive(Clone, Copy, Debug)]
pub struct PolygonSurface<'a> {
    /// First corner of each face, and the number of corners at the end.
    pub starts: &'a [u32],
    /// Point of each corner, counter-clockwise seen from outside.
    pub corners: &'a [u32],
    /// Positions, metres.
    pub points: &'a [[f32; 3]],
}

/// Number of repairs of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RepairCounts {
    /// Points merged with another at the same position.
    pub joined_points: usize,
    /// Points dropped because they had no face, or lost it.
    pub loose_points: usize,
    /// Faces dropped: with fewer than three points, or duplicates.
    pub dropped_faces: usize,
    /// Faces that lost a corner and were kept.
    pub trimmed_faces: usize,
    /// Faces flipped.
    pub turned_faces: usize,
}

impl RepairCounts {
    /// Whether there were no repairs.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Total number of repairs.
    pub fn count(&self) -> usize {
        self.joined_points + self.loose_points + self.dropped_faces + self.trimmed_faces + self.turned_faces
    }
}

/// Polygons under repair, over the points of the input.
#[derive(Clone, Debug, Default)]
pub(super) struct Polygons {
    pub(super) starts: Vec<u32>,
    pub(super) corners: Vec<u32>,
    /// Input face of each polygon.
    pub(super) faces: Vec<u32>,
}

impl Polygons {
    pub(super) fn len(&self) -> usize {
        self.faces.len()
    }

    pub(super) fn get(&self, face: usize) -> &[u32] {
        &self.corners[self.starts[face] as usize..self.starts[face + 1] as usize]
    }

    fn push(&mut self, corners: &[u32], face: u32) {
        self.corners.extend_from_slice(corners);
        self.starts.push(self.corners.len() as u32);
        self.faces.push(face);
    }

    fn empty() -> Self {
        Self { starts: vec![0], ..Self::default() }
    }

    /// All sides of all polygons, sorted.
    pub(super) fn sides(&self) -> Vec<PolygonSide> {
        let mut sides = Vec::with_capacity(self.corners.len());
        for polygon in 0..self.len() {
            let corners = self.get(polygon);
            for (k, &from) in corners.iter().enumerate() {
                let to = corners[(k + 1) % corners.len()];
                sides.push(PolygonSide {
                    ends: [from.min(to), from.max(to)],
                    polygon: polygon as u32,
                    rises: from < to,
                });
            }
        }
        sides.sort_unstable();
        sides
    }
}

/// A side of a polygon: its ends, lower first, and whether it runs from the lower one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PolygonSide {
    pub(super) ends: [u32; 2],
    pub(super) polygon: u32,
    pub(super) rises: bool,
}

/// The repaired polygons, or the first fault unless `safe` repairs are allowed.
pub(super) fn repaired_polygons(
    surface: &PolygonSurface,
    grid_points: &[GridPoint],
    safe: bool,
) -> Result<(Polygons, RepairCounts), SurfaceFault> {
    let mut polygons = Polygons::empty();
    for (face, run) in surface.starts.windows(2).enumerate() {
        polygons.push(&surface.corners[run[0] as usize..run[1] as usize], face as u32);
    }
    let mut changes = RepairCounts::default();
    polygons = tidied(polygons, safe, &mut changes)?;
    if let Some(onto) = joins(&polygons, grid_points) {
        let moved: Vec<u32> = (0..grid_points.len() as u32).filter(|point| onto[*point as usize] != *point).collect();
        if let Some(&point) = moved.first().filter(|_| !safe) {
            return Err(SurfaceFault::DuplicatePoint { points: [onto[point as usize], point], count: moved.len() });
        }
        changes.joined_points = moved.len();
        polygons.corners.iter_mut().for_each(|corner| *corner = onto[*corner as usize]);
        polygons = tidied(polygons, safe, &mut changes)?;
    }
    let mut used = vec![false; grid_points.len()];
    polygons.corners.iter().for_each(|corner| used[*corner as usize] = true);
    let loose = used.iter().filter(|used| !**used).count() - changes.joined_points;
    if let Some(point) = used.iter().position(|used| !used).filter(|_| !safe) {
        return Err(SurfaceFault::UnusedPoint { point: point as u32, count: loose });
    }
    changes.loose_points = loose;
    Ok((polygons, changes))
}

/// Removes degenerate and duplicate polygons.
fn tidied(polygons: Polygons, safe: bool, changes: &mut RepairCounts) -> Result<Polygons, SurfaceFault> {
    let before = polygons.len();
    let (polygons, trimmed) = trimmed(polygons);
    if let Some(&face) = trimmed.first().filter(|_| !safe) {
        return Err(SurfaceFault::Degenerate { face, count: trimmed.len() });
    }
    changes.trimmed_faces += trimmed.len() - (before - polygons.len());
    let (polygons, pairs) = once_each(polygons);
    if let Some(&faces) = pairs.first().filter(|_| !safe) {
        return Err(SurfaceFault::DuplicateFace { faces, count: pairs.len() });
    }
    changes.dropped_faces += before - polygons.len();
    Ok(polygons)
}

/// For each point the one it is merged with; `None` if no two points coincide.
fn joins(polygons: &Polygons, grid_points: &[GridPoint]) -> Option<Vec<u32>> {
    let mut order: Vec<u32> = (0..grid_points.len() as u32).collect();
    order.sort_unstable_by_key(|point| (grid_points[*point as usize], *point));
    let heaps =
        order.chunk_by(|a, b| grid_points[*a as usize] == grid_points[*b as usize]).filter(|heap| heap.len() > 1);
    let heaps: Vec<&[u32]> = heaps.collect();
    if heaps.is_empty() {
        return None;
    }
    let mut open = vec![false; grid_points.len()];
    for sides in polygons.sides().chunk_by(|a, b| a.ends == b.ends).filter(|sides| sides.len() != 2) {
        sides[0].ends.iter().for_each(|end| open[*end as usize] = true);
    }
    // Connected components after merging points at open edges.
    let mut pieces = SignedUnionFind::new(grid_points.len());
    for heap in &heaps {
        heap.iter().filter(|point| open[**point as usize]).fold(None, |first: Option<u32>, point| {
            first.inspect(|first| pieces.join(*first, *point, false).unwrap_or(())).or(Some(*point))
        });
    }
    for polygon in 0..polygons.len() {
        let corners = polygons.get(polygon);
        corners.iter().for_each(|corner| pieces.join(corners[0], *corner, false).unwrap_or(()));
    }
    let mut onto: Vec<u32> = (0..grid_points.len() as u32).collect();
    for heap in heaps {
        let mut first_of = BTreeMap::new();
        for point in heap {
            onto[*point as usize] = *first_of.entry(pieces.root(*point).0).or_insert(*point);
        }
    }
    Some(onto)
}

/// Polygons without degenerate corners, and the faces that had any.
fn trimmed(polygons: Polygons) -> (Polygons, Vec<u32>) {
    let mut left: Vec<u32> = Vec::new();
    let mut trim = |polygon: usize| {
        left.clear();
        left.extend_from_slice(polygons.get(polygon));
        let mut k = 0;
        while left.len() > 2 && k < left.len() {
            let [next, after] = [1, 2].map(|steps| (k + steps) % left.len());
            if left[k] == left[next] {
                left.remove(next);
                k = 0;
            } else if left[k] == left[after] {
                left.remove(next.max(after));
                left.remove(next.min(after));
                k = 0;
            } else {
                k += 1;
            }
        }
        left.clone()
    };
    let touched: Vec<usize> = (0..polygons.len()).filter(|p| trim(*p).len() < polygons.get(*p).len().max(3)).collect();
    if touched.is_empty() {
        return (polygons, Vec::new());
    }
    let mut kept = Polygons::empty();
    for polygon in 0..polygons.len() {
        let corners = trim(polygon);
        if corners.len() > 2 {
            kept.push(&corners, polygons.faces[polygon]);
        }
    }
    let touched = touched.into_iter().map(|polygon| polygons.faces[polygon]).collect();
    (kept, touched)
}

/// The polygons without duplicates, which have the same corners in the same or opposite order; and the pairs of
/// duplicates.
fn once_each(polygons: Polygons) -> (Polygons, Vec<[u32; 2]>) {
    let sorted = |polygon: u32| {
        let mut corners = polygons.get(polygon as usize).to_vec();
        corners.sort_unstable();
        corners
    };
    let sums: Vec<u64> = (0..polygons.len())
        .map(|polygon| {
            polygons
                .get(polygon)
                .iter()
                .fold(0, |sum: u64, corner| sum.wrapping_add(numerics::random::Key::new(u64::from(*corner)).u64()))
        })
        .collect();
    let mut order: Vec<u32> = (0..polygons.len() as u32).collect();
    order.sort_unstable_by_key(|polygon| (sums[*polygon as usize], *polygon));
    let (mut drop, mut pairs) = (vec![false; polygons.len()], Vec::new());
    for same in order.chunk_by(|a, b| sums[*a as usize] == sums[*b as usize]) {
        for (k, later) in same.iter().enumerate().skip(1) {
            let is_first = |first: &&u32| !drop[**first as usize] && sorted(**first) == sorted(*later);
            if let Some(first) = same[..k].iter().find(is_first) {
                pairs.push([*first, *later].map(|polygon| polygons.faces[polygon as usize]));
                drop[*later as usize] = true;
            }
        }
    }
    if pairs.is_empty() {
        return (polygons, pairs);
    }
    pairs.sort_unstable();
    let mut kept = Polygons::empty();
    for polygon in (0..polygons.len()).filter(|polygon| !drop[*polygon]) {
        kept.push(polygons.get(polygon), polygons.faces[polygon]);
    }
    (kept, pairs)
}

/// Union-find with a sign: which elements are connected, and which of them are oriented oppositely.
pub(super) struct SignedUnionFind {
    /// A lower element of the same set, or the element itself; and whether this one is oriented oppositely.
    towards: Vec<(u32, bool)>,
}

impl SignedUnionFind {
    pub(super) fn new(count: usize) -> Self {
        Self { towards: (0..count as u32).map(|k| (k, false)).collect() }
    }

    /// The lowest element of the set, and whether this one is oriented oppositely.
    pub(super) fn root(&mut self, of: u32) -> (u32, bool) {
        let (mut at, mut turned) = (of, false);
        while self.towards[at as usize].0 != at {
            let (next, once) = self.towards[at as usize];
            let (after, twice) = self.towards[next as usize];
            self.towards[at as usize] = (after, once != twice);
            turned ^= once != twice;
            at = after;
        }
        (at, turned)
    }

    /// Connects two elements, with the same or opposite orientation.
    ///
    /// # Errors
    /// If they are already connected with the other orientation.
    pub(super) fn join(&mut self, a: u32, b: u32, turned: bool) -> Result<(), ()> {
        let ((a, a_turned), (b, b_turned)) = (self.root(a), self.root(b));
        let turned = turned ^ a_turned ^ b_turned;
        if a == b {
            return if turned { Err(()) } else { Ok(()) };
        }
        self.towards[a.max(b) as usize] = (a.min(b), turned);
        Ok(())
    }
}
