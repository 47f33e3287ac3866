//! Distances between two shapes whose points do not match: from each point of one to the nearest point of the other, and
//! the other way.

use engine::geometry::{Component, Topology};
use numerics::lanes::LANES;
use numerics::tree::{Boxes, Region, TriangleTree};
use numerics::vector::{DVec3, to_f64};

use super::norms::{Differences, element_pairs};

/// Adds the distances of both ways, weighted by area or length. Meshes are compared as surfaces, tets by the faces that only one tet has, curves by
/// pairs of polylines; points have no surface.
///
/// # Errors
/// If they have no surface, or one of them is empty.
pub(super) fn both_ways(a: &Component, b: &Component, into: &mut Differences) -> Result<(), String> {
    match (a.topology(), b.topology()) {
        (Topology::Curves(of_a), Topology::Curves(of_b)) => {
            let mut ways = [Vec::new(), Vec::new()];
            let pairs = element_pairs(a, b)?;
            into.count(a.element_count() + b.element_count(), pairs.len());
            for (i, j) in pairs {
                let (p, q) = (&a.positions()[of_a.range(i)], &b.positions()[of_b.range(j)]);
                let way = |from: &[[f32; 3]], to: &[[f32; 3]]| -> Vec<(f64, f64)> {
                    let distances = from.iter().map(|point| to_polyline(to_f64(*point), to));
                    distances.zip(lengths(from)).collect()
                };
                [way(p, q), way(q, p)].into_iter().zip(&mut ways).for_each(|(own, all)| all.extend(own));
            }
            into.extend_both_ways(ways);
            return Ok(());
        }
        (Topology::Points, _) => {
            return Err("the norm `surface` needs a mesh, tets or curves, but the output has only points".into());
        }
        _ => {}
    }
    let (a, b) = (Surface::of(a), Surface::of(b));
    if a.triangles.is_empty() && b.triangles.is_empty() {
        return Ok(());
    }
    if a.triangles.is_empty() || b.triangles.is_empty() {
        return Err("one of two results has no surface".into());
    }
    into.extend_both_ways([a.to(&b), b.to(&a)]);
    Ok(())
}

/// Triangles to be searched.
struct Surface<'a> {
    positions: &'a [[f32; 3]],
    triangles: Vec<[u32; 3]>,
    tree: TriangleTree,
}

impl<'a> Surface<'a> {
    fn of(part: &'a Component) -> Self {
        let positions = part.positions();
        let triangles = match part.topology() {
            Topology::Tets(tets) => boundary(tets),
            _ => part.triangles().corners.clone(),
        };
        Self { positions, tree: TriangleTree::build(positions, &triangles), triangles }
    }

    /// The distance of each of its points to the nearest point of `other`, with a third of the area of the triangles around
    /// it.
    fn to(&self, other: &Self) -> Vec<(f64, f64)> {
        let mut used: Vec<u32> = self.triangles.as_flattened().to_vec();
        used.sort_unstable();
        used.dedup();
        let from: Vec<[f32; 3]> = used.iter().map(|point| self.positions[*point as usize]).collect();
        let found = other.tree.closest_each(&from, f32::INFINITY);
        let each = from.iter().zip(found).map(|(point, found)| match found {
            Some(found) => other.distance(*point, found.triangle),
            None => f64::NAN,
        });
        let mut areas = vec![0.0; self.positions.len()];
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|corner| to_f64(self.positions[corner as usize]));
            let third = (b - a).cross(&(c - a)).norm() / 6.0;
            corners.iter().for_each(|corner| areas[*corner as usize] += third);
        }
        each.zip(used.iter().map(|point| areas[*point as usize])).collect()
    }
}

impl Surface<'_> {
    /// The distance of a point in f64, from the triangle that is nearest in f32. Of triangles that are equally near in f32
    /// another may be nearer: what differs by little is far from its error otherwise.
    fn distance(&self, point: [f32; 3], triangle: u32) -> f64 {
        let to = |triangle: u32| {
            let corners = self.triangles[triangle as usize];
            to_triangle(to_f64(point), corners.map(|corner| to_f64(self.positions[corner as usize])))
        };
        let mut least = to(triangle);
        let mut walk = self.tree.walk(Ball::new(point, least));
        while let Some((block, mut lanes)) = walk.next() {
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                let distance = to(self.tree.blocks()[block].triangle[lane]);
                if distance < least {
                    least = distance;
                    *walk.region() = Ball::new(point, least);
                }
            }
        }
        least
    }
}

/// All that may be as near to a point as `square` is far.
struct Ball {
    centre: [f32; 3],
    square: f32,
}

impl Ball {
    fn new(centre: [f32; 3], radius: f64) -> Self {
        // Above the rounding of squares.
        Self { centre, square: (radius * radius * (1.0 + 1e-5)) as f32 }
    }
}

impl Region for Ball {
    fn meeting(&self, boxes: &Boxes) -> u16 {
        let meets = |lane: &usize| {
            let outside = |axis: usize| {
                let x = self.centre[axis];
                (boxes.low[axis].0[*lane] - x).max(x - boxes.high[axis].0[*lane]).max(0.0)
            };
            (0..3).map(|axis| outside(axis) * outside(axis)).sum::<f32>() <= self.square
        };
        (0..LANES).filter(meets).fold(0, |mask, lane| mask | 1 << lane)
    }
}

/// The area of a mesh, or of the faces that only one tet has.
pub(super) fn area(part: &Component) -> f64 {
    let triangles = match part.topology() {
        Topology::Tets(tets) => boundary(tets),
        _ => part.triangles().corners.clone(),
    };
    let area = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| to_f64(part.positions()[corner as usize]));
        (b - a).cross(&(c - a)).norm() / 2.0
    };
    triangles.iter().map(area).sum()
}

/// The faces that only one tet has.
fn boundary(tets: &[[u32; 4]]) -> Vec<[u32; 3]> {
    let faces_of = |[a, b, c, d]: [u32; 4]| [[b, c, d], [a, d, c], [a, b, d], [a, c, b]];
    let sorted = |mut face: [u32; 3]| {
        face.sort_unstable();
        face
    };
    let mut faces: Vec<_> = tets.iter().flat_map(|tet| faces_of(*tet)).map(|face| (sorted(face), face)).collect();
    faces.sort_unstable();
    faces.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1).map(|same| same[0].1).collect()
}

/// Half of the lengths of the segments at each point of a polyline.
fn lengths(line: &[[f32; 3]]) -> Vec<f64> {
    let mut lengths = vec![0.0; line.len()];
    for (index, pair) in line.windows(2).enumerate() {
        let half = (to_f64(pair[1]) - to_f64(pair[0])).norm() / 2.0;
        lengths[index] += half;
        lengths[index + 1] += half;
    }
    lengths
}

/// The distance of a point to a polyline.
fn to_polyline(point: DVec3, line: &[[f32; 3]]) -> f64 {
    match line {
        [] => f64::NAN,
        [only] => (point - to_f64(*only)).norm(),
        _ => line
            .windows(2)
            .map(|pair| to_segment(point, to_f64(pair[0]), to_f64(pair[1])))
            .fold(f64::INFINITY, f64::min),
    }
}

fn to_segment(point: DVec3, a: DVec3, b: DVec3) -> f64 {
    let (along, from) = (b - a, point - a);
    let square = along.dot(&along);
    let share = if square > 0.0 { (from.dot(&along) / square).clamp(0.0, 1.0) } else { 0.0 };
    (from - along * share).norm()
}

/// The distance of a point to a triangle: to its plane where the foot lies inside, else to its nearest edge.
fn to_triangle(point: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a));
    let length = normal.norm();
    let is_inside = |from: DVec3, to: DVec3| (to - from).cross(&(point - from)).dot(&normal) >= 0.0;
    if length > 0.0 && is_inside(a, b) && is_inside(b, c) && is_inside(c, a) {
        return ((point - a).dot(&normal) / length).abs();
    }
    to_segment(point, a, b).min(to_segment(point, b, c)).min(to_segment(point, c, a))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_spheres_are_as_far_apart_as_their_radii() {
        // An octahedron and the same twice as large: the nearest points of faces are 1/√3 apart, a corner is 1 from the
        // smaller one's.
        let octahedron = |r: f32| {
            let positions = vec![[r, 0., 0.], [-r, 0., 0.], [0., r, 0.], [0., -r, 0.], [0., 0., r], [0., 0., -r]];
            let faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
            Component::mesh(vec![3; 8], faces.concat(), positions).unwrap()
        };
        let mut found = Differences::default();
        both_ways(&octahedron(1.0), &octahedron(2.0), &mut found).unwrap();
        let found = found.numbers();
        assert_eq!(found.len(), 12);
        assert!(found[..6].iter().all(|x| (x - 1.0 / 3.0_f64.sqrt()).abs() < 1e-12), "{found:?}");
        assert!(found[6..].iter().all(|x| *x == 1.0), "{found:?}");
    }

    #[test]
    fn surfaces_that_almost_touch_are_compared_in_f64() {
        // Two wavy sheets, 1e-7 apart at coordinates of 1: the triangle that is nearest in f32 is often another.
        const SIDE: u32 = 12;
        let sheet = |lift: f32| {
            let at = |k: u32| {
                let [x, z] = [(k % SIDE) as f32 / 11.0, (k / SIDE) as f32 / 11.0];
                [x, 1.0 + 0.05 * libm::sinf(9.0 * x) * libm::cosf(7.0 * z) + lift * libm::sinf(40.0 * (x + z)), z]
            };
            let quad = |k: u32| [k, k + SIDE, k + 1, k + 1, k + SIDE, k + SIDE + 1];
            let quads = (0..SIDE * (SIDE - 1)).filter(|k| k % SIDE < SIDE - 1);
            let corners: Vec<u32> = quads.flat_map(quad).collect();
            Component::mesh(vec![3; corners.len() / 3], corners, (0..SIDE * SIDE).map(at).collect()).unwrap()
        };
        let (a, b) = (sheet(0.0), sheet(2e-7));
        let mut found = Differences::default();
        both_ways(&a, &b, &mut found).unwrap();
        let way = |from: &Component, to: &Component| -> Vec<f64> {
            let shape = |corners: &[u32; 3]| corners.map(|corner| to_f64(to.positions()[corner as usize]));
            let shapes: Vec<[DVec3; 3]> = to.triangles().corners.iter().map(shape).collect();
            let least =
                |point: &[f32; 3]| shapes.iter().map(|shape| to_triangle(to_f64(*point), *shape)).fold(1.0, f64::min);
            from.positions().iter().map(least).collect()
        };
        assert_eq!(found.numbers(), [way(&a, &b), way(&b, &a)].concat());
    }

    #[test]
    fn polylines_with_other_cvs_on_the_same_line_do_not_differ() {
        let curve = |cvs: &[f32]| {
            let positions: Vec<[f32; 3]> = cvs.iter().map(|y| [0.0, *y, 0.0]).collect();
            Component::curves(vec![cvs.len() as u32], positions).unwrap()
        };
        let mut found = Differences::default();
        both_ways(&curve(&[0.0, 0.5, 1.0]), &curve(&[0.0, 0.25, 1.0]), &mut found).unwrap();
        assert_eq!(found.numbers(), [0.0; 6]);
        both_ways(&curve(&[0.0, 1.0]), &curve(&[0.0, 2.0]), &mut found).unwrap();
        assert_eq!(found.numbers()[6..], [0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn the_boundary_of_two_tets_lacks_the_face_between_them() {
        assert_eq!(boundary(&[[0, 1, 2, 3], [1, 2, 3, 4]]).len(), 6);
        assert_eq!(boundary(&[[0, 1, 2, 3]]).len(), 4);
    }
}
