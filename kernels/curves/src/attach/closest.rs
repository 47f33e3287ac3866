//! The point of a skin that is closest to a root. This file is the only one that uses parry.
//!
//! parry's bounding volume hierarchy is searched nearest box first, and its triangles give the closest point on a face.
//! parry does not define which of equally close faces it finds. Here that is settled, so that the result depends on
//! positions and faces only, not on the shape of the hierarchy:
//!
//! * Corners are passed in the order of their coordinates. Faces that share an edge, and faces that lie on each other,
//!   then give the same bits for the same closest point, in whichever order their corners are listed.
//! * parry skips boxes and faces that are exactly as far as the best so far. Here they are visited, and of equally
//!   close faces the one listed first is taken. A closest point that rounding put outside its face's box is moved into
//!   it, so a box is never farther than its contents.
//!
//! A leaf of the hierarchy holds consecutive faces that are near each other, as in the usual mesh: building it for single
//! faces took longer than searching it.
//!
//! Guarantees: the same bits on any number of threads; no panic for any position. Coordinates are f32, and f64 holds
//! fourth powers of their differences. Limit: faces without area are ignored unless there are no others; faces with a
//! non-finite corner always are.

use crate::surface::SurfacePoint;
use numerics::vector::{DVec3, to_f64};
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};
use parry3d_f64::query::PointQueryWithLocation;
use parry3d_f64::shape::Triangle;
use std::cell::Cell;

/// Each leaf's box is enlarged by this fraction of its longest side, because parry splits by volume and a flat skin has
/// none.
const THICKENED: f64 = 1.0 / 256.0;

/// Largest number of faces in a leaf.
const LEAF_FACES: usize = 8;

/// A leaf's longest side is at most this many times that of its first face.
const LEAF_SPREAD: f64 = 3.0;

/// The faces of a skin, to be searched.
pub(super) struct ClosestFaces {
    /// In the order in which they are listed.
    faces: Vec<SortedFace>,
    /// Index of the first face of each leaf, and the number of faces at the end.
    leaf_starts: Vec<u32>,
    hierarchy: Bvh,
}

/// A triangle with its corners in the order of their coordinates.
struct SortedFace {
    /// Index in the list of triangles.
    triangle: u32,
    /// For each corner its position in the listed triangle.
    slots: [u8; 3],
    /// In f32, which takes half the memory.
    corners: [[f32; 3]; 3],
}

/// The closest point so far.
#[derive(Clone, Copy)]
struct Candidate {
    /// Distance squared.
    square: f64,
    /// Index in `faces`.
    face: u32,
    /// Of the sorted corners.
    weights: [f64; 3],
}

impl ClosestFaces {
    /// The faces among `triangles`, indices of `points` (metres), that a root can be bound to; `None` if there are
    /// none.
    ///
    /// # Panics
    /// If a corner is out of range.
    pub(super) fn new(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> Option<Self> {
        let sorted = |(triangle, corners): (usize, &[u32; 3])| {
            let corners = corners.map(|corner| points[corner as usize]);
            let finite = corners.as_flattened().iter().all(|x| x.is_finite());
            finite.then(|| SortedFace::new(triangle as u32, corners))
        };
        let finite = || triangles.iter().enumerate().filter_map(sorted);
        let mut faces = Vec::with_capacity(triangles.len());
        faces.extend(finite().filter(SortedFace::has_area));
        if faces.is_empty() {
            faces.extend(finite());
        }
        let (leaf_starts, boxes) = leaves(&faces);
        let hierarchy = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        (!faces.is_empty()).then_some(Self { faces, leaf_starts, hierarchy })
    }

    /// The closest point to each root; the first corner of the first face for a root that is not finite.
    pub(super) fn find_each(&self, roots: &[[f32; 3]]) -> Vec<SurfacePoint> {
        // Consecutive roots are usually near each other, so the face of the last one bounds the search.
        let mut hint = 0;
        let find = |root: &[f32; 3]| {
            let found = self.find(*root, hint);
            hint = found.face;
            self.surface_point(found)
        };
        roots.iter().map(find).collect()
    }

    /// The closest point to `root`. The result does not depend on the face given as `hint`.
    fn find(&self, root: [f32; 3], hint: u32) -> Candidate {
        if !root.iter().all(|x| x.is_finite()) {
            return Candidate { square: f64::INFINITY, face: 0, weights: [1.0, 0.0, 0.0] };
        }
        let root = parry(to_f64(root));
        let best = Cell::new(self.faces[hint as usize].closest(hint, root));
        // A box or face exactly as far as the best so far is visited, as it may hold a face listed before it.
        let box_distance = |node: &BvhNode, _| outside(node.mins(), node.maxs(), root).length_squared().next_down();
        let leaf_distance = |leaf: u32, _| {
            let ends = [leaf, leaf + 1].map(|leaf| self.leaf_starts[leaf as usize]);
            for face in ends[0]..ends[1] {
                best.set(self.faces[face as usize].closer(face, root, best.get()));
            }
            Some(best.get().square)
        };
        self.hierarchy.find_best(best.get().square, box_distance, leaf_distance);
        best.get()
    }

    /// Permutes the weights to the order of the listed triangle's corners.
    fn surface_point(&self, Candidate { face, weights, .. }: Candidate) -> SurfacePoint {
        let SortedFace { triangle, slots, .. } = self.faces[face as usize];
        let mut listed = [0.0; 3];
        for (slot, weight) in slots.into_iter().zip(weights) {
            listed[usize::from(slot)] = weight;
        }
        SurfacePoint { triangle, weights: listed }
    }
}

impl SortedFace {
    fn new(triangle: u32, corners: [[f32; 3]; 3]) -> Self {
        let mut slots = [0, 1, 2];
        // A sorting network.
        for [first, second] in [[0, 1], [1, 2], [0, 1]] {
            let [a, b] = [slots[first], slots[second]].map(|slot: u8| corners[usize::from(slot)]);
            // Without a branch, as it could not be predicted.
            let swapped = usize::from(comes_before(b, a));
            let pair = [slots[first], slots[second], slots[first]];
            (slots[first], slots[second]) = (pair[swapped], pair[swapped + 1]);
        }
        Self { triangle, slots, corners: slots.map(|slot| corners[usize::from(slot)]) }
    }

    fn has_area(&self) -> bool {
        self.shape().scaled_normal().length_squared() > 0.0
    }

    fn shape(&self) -> Triangle {
        let [a, b, c] = self.corners.map(|corner| parry(to_f64(corner)));
        Triangle::new(a, b, c)
    }

    fn exact_box(&self) -> Aabb {
        let [a, b, c] = self.corners;
        let least = |axis: usize| lesser(lesser(a[axis], b[axis]), c[axis]);
        let most = |axis: usize| larger(larger(a[axis], b[axis]), c[axis]);
        let [mins, maxs] = [[least(0), least(1), least(2)], [most(0), most(1), most(2)]].map(|p| parry(to_f64(p)));
        Aabb::new(mins, maxs)
    }

    /// The closest point to `root` if it replaces `so_far`, otherwise `so_far`; `face` is the index of this face.
    fn closer(&self, face: u32, root: Vector, so_far: Candidate) -> Candidate {
        let Aabb { mins, maxs } = self.exact_box();
        if outside(mins, maxs, root).length_squared() > so_far.square {
            return so_far;
        }
        let found = self.closest(face, root);
        let replaces = found.square < so_far.square || (found.square == so_far.square && face < so_far.face);
        if replaces { found } else { so_far }
    }

    /// The closest point to `root`; `face` is the index of this face.
    fn closest(&self, face: u32, root: Vector) -> Candidate {
        let (projected, location) = self.shape().project_local_point_and_get_location(root, true);
        let Aabb { mins, maxs } = self.exact_box();
        let point = projected.point.clamp(mins, maxs);
        let weights = location.barycentric_coordinates().unwrap_or([1.0, 0.0, 0.0]);
        Candidate { square: (point - root).length_squared(), face, weights: proper(weights) }
    }
}

/// Clamps weights that rounding has brought below 0 or above 1.
fn proper(weights: [f64; 3]) -> [f64; 3] {
    if weights.iter().all(|weight| (0.0..=1.0).contains(weight)) {
        return weights;
    }
    let clamped = weights.map(|weight| weight.clamp(0.0, 1.0));
    let sum = clamped[0] + clamped[1] + clamped[2];
    if sum > 0.0 { clamped.map(|weight| weight / sum) } else { [1.0, 0.0, 0.0] }
}

/// How far `p` is outside of a box, axis by axis.
fn outside(mins: Vector, maxs: Vector, p: Vector) -> Vector {
    (mins - p).max(p - maxs).max(Vector::ZERO)
}

/// Where each leaf's faces start, with the number of faces at the end, and the leaves' boxes.
fn leaves(faces: &[SortedFace]) -> (Vec<u32>, Vec<Aabb>) {
    let (mut starts, mut boxes) = (Vec::new(), Vec::<Aabb>::new());
    // The longest that the last leaf's sides may get.
    let mut limit = 0.0;
    for (index, face) in faces.iter().enumerate() {
        let own = face.exact_box();
        let fits = |joined: &Aabb, start: u32| {
            index - (start as usize) < LEAF_FACES && joined.extents().max_element() <= limit
        };
        let joined = boxes.last().map(|leaf| Aabb::new(leaf.mins.min(own.mins), leaf.maxs.max(own.maxs)));
        match joined.zip(starts.last()).filter(|(joined, start)| fits(joined, **start)) {
            Some((joined, _)) => *boxes.last_mut().expect("it has been joined") = joined,
            None => {
                starts.push(index as u32);
                limit = LEAF_SPREAD * own.extents().max_element();
                boxes.push(own);
            }
        }
    }
    starts.push(faces.len() as u32);
    let thickened = |exact: Aabb| {
        let by = THICKENED * exact.extents().max_element();
        Aabb::new(exact.mins - by, exact.maxs + by)
    };
    (starts, boxes.into_iter().map(thickened).collect())
}

/// The order of corners: by x, then y, then z.
fn comes_before(a: [f32; 3], b: [f32; 3]) -> bool {
    if a[0] == b[0] { (a[1], a[2]) < (b[1], b[2]) } else { a[0] < b[0] }
}

fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

fn parry(v: DVec3) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::random::Key;
    use numerics::shapes;

    type Mesh = (Vec<[f32; 3]>, Vec<[u32; 3]>);

    fn sphere() -> Mesh {
        let sphere = shapes::sphere([2.0; 3], 8);
        (sphere.points.iter().map(|p| p.map(|x| x as f32)).collect(), sphere.triangles())
    }

    /// Unconnected triangles.
    fn soup(count: u32) -> Mesh {
        let points = (0..3 * u64::from(count)).map(|k| some_point(3, k, 1.0)).collect();
        (points, (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect())
    }

    fn some_point(seed: u64, k: u64, size: f32) -> [f32; 3] {
        [0, 1, 2].map(|axis| Key::new(seed).of(k).of(axis).between([-size, size]))
    }

    fn some_roots(count: u64) -> Vec<[f32; 3]> {
        (0..count).map(|k| some_point(4, k, 2.0)).collect()
    }

    fn found((points, triangles): &Mesh, roots: &[[f32; 3]]) -> Vec<SurfacePoint> {
        ClosestFaces::new(points, triangles).unwrap().find_each(roots)
    }

    /// Distance to a triangle: the smallest to its sides, or that to its plane if the projection is inside.
    fn distance(root: [f32; 3], corners: [[f32; 3]; 3]) -> f64 {
        let [a, b, c] = corners.map(|corner| to_f64(corner) - to_f64(root));
        let side = |a: DVec3, b: DVec3| {
            let ab = b - a;
            (a + ab * (-a.dot(&ab) / ab.norm_squared()).clamp(0.0, 1.0)).norm()
        };
        let sides = side(a, b).min(side(b, c)).min(side(c, a));
        let normal = (b - a).cross(&(c - a));
        let inside = [(a, b), (b, c), (c, a)].iter().all(|(a, b)| normal.dot(&a.cross(b)) >= 0.0);
        if inside { sides.min(normal.dot(&a).abs() / normal.norm()) } else { sides }
    }

    #[test]
    fn no_face_is_closer_than_the_one_found() {
        for mesh in [sphere(), soup(200)] {
            let roots = some_roots(300);
            for (root, found) in roots.iter().zip(found(&mesh, &roots)) {
                let corners = |triangle: &[u32; 3]| triangle.map(|corner| mesh.0[corner as usize]);
                let least = mesh.1.iter().map(|face| distance(*root, corners(face))).fold(f64::INFINITY, f64::min);
                let away = (found.position(&mesh.0, &mesh.1) - to_f64(*root)).norm();
                assert!((away - least).abs() < 1e-12, "{away} {least}");
                assert!((found.weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn closest_points_worked_out_by_hand() {
        let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let roots = [[0.25, 0.25, 5.0], [0.5, -3.0, 1.0], [-1.0, -1.0, 0.0], [2.0, 2.0, 0.0]];
        let expected = [[0.5, 0.25, 0.25], [0.5, 0.5, 0.0], [1.0, 0.0, 0.0], [0.0, 0.5, 0.5]];
        for turn in 0..3 {
            let face = [0, 1, 2].map(|k| (k + turn) % 3);
            for (found, expected) in found(&(points.clone(), vec![face]), &roots).iter().zip(expected) {
                assert_eq!(found.weights, face.map(|corner| expected[corner as usize]));
            }
        }
    }

    #[test]
    fn the_first_of_equally_close_faces_is_taken() {
        // Two faces share the edge from 0 to 1; the root is off that edge, outside of both.
        for k in 0..500 {
            let [a, b, root] = [0, 1, 2].map(|which| some_point(10 + which, k, 1.0));
            let (a64, b64) = (to_f64(a), to_f64(b));
            let share = Key::new(20).of(k).f64();
            let on = a64 + (b64 - a64) * share;
            let outwards = to_f64(root) - on;
            let outwards = outwards - (b64 - a64) * (outwards.dot(&(b64 - a64)) / (b64 - a64).norm_squared());
            let across = (b64 - a64).cross(&outwards).normalize();
            let behind = [1.0, -1.0].map(|side| numerics::vector::to_f32(on - outwards + across * side));
            let points = vec![a, b, behind[0], behind[1]];
            let root = numerics::vector::to_f32(on + outwards);
            for (first, second) in [([0, 1, 2], [1, 0, 3]), ([2, 0, 1], [0, 1, 3]), ([0, 2, 1], [3, 0, 1])] {
                let both = [(first, second), (second, first)].map(|(first, second)| {
                    let mesh = (points.clone(), vec![first, second, first]);
                    let found = found(&mesh, &[root])[0];
                    assert_eq!(found.triangle, 0, "{k}");
                    found.position(&mesh.0, &mesh.1)
                });
                assert!((both[0] - both[1]).norm() < 1e-15);
            }
        }
    }

    #[test]
    fn neighbours_that_are_listed_together_share_a_leaf_and_are_found_as_if_they_did_not() {
        let (points, together) = sphere();
        let count = together.len();
        let apart: Vec<[u32; 3]> = (0..count).map(|k| together[k * 101 % count]).collect();
        let leaves = |triangles: &[[u32; 3]]| ClosestFaces::new(&points, triangles).unwrap().leaf_starts.len() - 1;
        assert!(leaves(&together) < count / 4 && leaves(&apart) > count / 2, "{count} {}", leaves(&together));
        let roots = some_roots(200);
        let [listed, mixed] = [&together, &apart].map(|faces| found(&(points.clone(), faces.clone()), &roots));
        for (listed, mixed) in listed.iter().zip(mixed) {
            assert_eq!(listed.position(&points, &together), mixed.position(&points, &apart));
        }
    }

    #[test]
    fn the_hint_and_the_order_of_roots_change_nothing() {
        let mesh = sphere();
        let faces = ClosestFaces::new(&mesh.0, &mesh.1).unwrap();
        // The centre is about equally far from all faces.
        let mut roots = some_roots(60);
        roots.push([0.0; 3]);
        for root in roots {
            let expected = faces.find(root, 0);
            for hint in [1, 17, 100, faces.faces.len() as u32 - 1] {
                let found = faces.find(root, hint);
                assert_eq!(
                    (found.face, found.square, found.weights),
                    (expected.face, expected.square, expected.weights)
                );
            }
        }
    }

    #[test]
    fn faces_without_area_are_used_only_where_there_are_no_others() {
        let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [5.0; 3]];
        assert_eq!(found(&(points.clone(), vec![[3, 3, 0], [0, 1, 2]]), &[[4.0; 3]])[0].triangle, 1);
        let line = found(&(points.clone(), vec![[0, 1, 1], [0, 0, 1]]), &[[0.25, 3.0, 0.0]])[0];
        assert_eq!((line.triangle, line.position(&points, &[[0, 1, 1]])), (0, DVec3::new(0.25, 0.0, 0.0)));
        let dot = found(&(points.clone(), vec![[3, 3, 3]]), &[[0.0; 3]])[0];
        assert_eq!(dot.position(&points, &[[3, 3, 3]]), DVec3::repeat(5.0));
    }

    #[test]
    fn no_position_panics() {
        let values = [0.0, -0.0, 1.0, 1e-45, -1e-38, 1e7, -1e7, f32::MAX, f32::MIN, f32::NAN, f32::INFINITY];
        let pick = |seed: u64, k: u64| {
            [0, 1, 2].map(|axis| values[(Key::new(seed).of(k).of(axis).u64() % values.len() as u64) as usize])
        };
        for seed in 0..200 {
            let points: Vec<[f32; 3]> = (0..12).map(|k| pick(seed, k)).collect();
            let corner = |k: u64| (Key::new(seed + 1000).of(k).u64() % 12) as u32;
            let triangles: Vec<[u32; 3]> = (0..20).map(|k| [0, 1, 2].map(|c| corner(3 * k + c))).collect();
            let roots: Vec<[f32; 3]> = (0..20).map(|k| pick(seed + 2000, k)).collect();
            let Some(faces) = ClosestFaces::new(&points, &triangles) else { continue };
            for found in faces.find_each(&roots) {
                assert!(found.weights.iter().all(|weight| (0.0..=1.0).contains(weight)), "{found:?}");
            }
        }
        assert!(ClosestFaces::new(&[], &[]).is_none());
        assert!(ClosestFaces::new(&[[f32::NAN; 3]], &[[0, 0, 0]]).is_none());
    }

    #[test]
    fn ten_thousand_kilometres_away_a_face_is_found_to_the_rounding_of_its_corners() {
        let (points, triangles) = sphere();
        // Whole metres there, so that adding 1e7 is exact.
        let points: Vec<[f32; 3]> = points.iter().map(|p| p.map(|x| (1000.0 * x).round())).collect();
        let far: Vec<[f32; 3]> = points.iter().map(|p| p.map(|x| x + 1e7)).collect();
        let roots: Vec<[f32; 3]> = some_roots(200).iter().map(|p| p.map(|x| (1000.0 * x).round())).collect();
        let far_roots: Vec<[f32; 3]> = roots.iter().map(|p| p.map(|x| x + 1e7)).collect();
        let expected = found(&(points, triangles.clone()), &roots);
        for (found, expected) in found(&(far, triangles), &far_roots).iter().zip(expected) {
            assert_eq!(found.triangle, expected.triangle);
            assert!((0..3).all(|k| (found.weights[k] - expected.weights[k]).abs() < 1e-9));
        }
    }
}
