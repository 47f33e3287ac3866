//! Distances between two shapes whose points do not match: from each point of one to the nearest point of the other, and
//! the other way.

use engine::geometry::{Component, Topology};
use numerics::tree::TriangleTree;
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
        // The tree finds the triangle in f32; its distance is taken in f64.
        let each = from.iter().zip(found).map(|(point, found)| match found {
            Some(found) => {
                let corners = other.triangles[found.triangle as usize];
                to_triangle(to_f64(*point), corners.map(|corner| to_f64(other.positions[corner as usize])))
            }
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
