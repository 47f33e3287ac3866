//! Which triangles of a mesh enclose volume.

use numerics::vector::{Vec3, cross, scale, sub};
use numerics::volume::six_volumes;

use crate::sets::Sets;

/// Triangles of a mesh, with their numbers in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Part {
    pub(super) corners: Vec<[u32; 3]>,
    pub(super) numbers: Vec<u32>,
}

/// The triangles of a mesh, sorted into closed pieces and open ones. It stays the same while points move.
///
/// A piece is all that is connected through points; points in the same place count as one. It is closed where every edge
/// is used equally often in both directions. Counter-clockwise faces are seen from outside; a mesh whose closed pieces
/// have negative volume in all counts as turned inside out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShapeTopology {
    pub(super) solid: Part,
    pub(super) sheet: Part,
    pub(super) is_inside_out: bool,
}

impl ShapeTopology {
    /// The topology of `triangles`, each three indices of `points`.
    ///
    /// # Panics
    /// Where an index is out of range.
    pub fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let place = welded(points);
        let welded: Vec<_> = triangles.iter().map(|corners| corners.map(|corner| place[corner as usize])).collect();
        let open = open_points(&welded, points.len());
        let (mut solid, mut sheet) = (Part::default(), Part::default());
        for (number, corners) in triangles.iter().enumerate() {
            let part = if open[welded[number][0] as usize] { &mut sheet } else { &mut solid };
            part.corners.push(*corners);
            part.numbers.push(number as u32);
        }
        let origin = solid.corners.first().map_or([0.0; 3], |corners| points[corners[0] as usize]);
        let volume = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|corner| points[corner as usize]);
            six_volumes([origin, a, b, c])
        };
        let is_inside_out = solid.corners.iter().map(volume).sum::<f64>() < 0.0;
        Self { solid, sheet, is_inside_out }
    }

    /// The points of each triangle.
    pub(super) fn corners(&self) -> Vec<[u32; 3]> {
        let mut corners = vec![[0; 3]; self.solid.numbers.len() + self.sheet.numbers.len()];
        for part in [&self.solid, &self.sheet] {
            part.numbers.iter().zip(&part.corners).for_each(|(number, of)| corners[*number as usize] = *of);
        }
        corners
    }

    /// A vector out of the solid, perpendicular to a triangle of a closed piece.
    pub(super) fn normal(&self, points: &[Vec3], triangle: u32) -> Vec3 {
        let Ok(at) = self.solid.numbers.binary_search(&triangle) else { return [0.0; 3] };
        let [a, b, c] = self.solid.corners[at].map(|corner| points[corner as usize]);
        let normal = cross(sub(b, a), sub(c, a));
        if self.is_inside_out { scale(normal, -1.0) } else { normal }
    }

    /// Number of triangles that belong to open pieces. They enclose nothing.
    pub fn open_triangles(&self) -> usize {
        self.sheet.numbers.len()
    }
}

/// For each point, the first one in the same place.
fn welded(points: &[Vec3]) -> Vec<u32> {
    // + 0 makes −0 and 0 the same bits.
    let key = |point: u32| points[point as usize].map(|x| (x + 0.0).to_bits());
    let mut order: Vec<_> = (0..points.len() as u32).map(|point| (key(point), point)).collect();
    order.sort_unstable();
    let mut first = vec![0; points.len()];
    for same in order.chunk_by(|a, b| a.0 == b.0) {
        same.iter().for_each(|(_, point)| first[*point as usize] = same[0].1);
    }
    first
}

/// Whether each point belongs to an open piece.
fn open_points(triangles: &[[u32; 3]], points: usize) -> Vec<bool> {
    let mut pieces = Sets::new(points);
    let mut edges = Vec::with_capacity(3 * triangles.len());
    for [a, b, c] in triangles {
        pieces.join(*a, *b);
        pieces.join(*a, *c);
        for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
            edges.push((from.min(to), from.max(to), from < to));
        }
    }
    edges.sort_unstable();
    let mut open = vec![false; points];
    for same in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let forward = same.iter().filter(|edge| edge.2).count();
        if same[0].0 != same[0].1 && 2 * forward != same.len() {
            open[pieces.first(same[0].0) as usize] = true;
        }
    }
    (0..points as u32).map(|point| open[pieces.first(point) as usize]).collect()
}
