//! The triangle closest to a point, among many: a tree of boxes, built once.
//!
//! Promise: of triangles equally close the one listed first, however the tree is built. f64 throughout. Limit: triangles
//! without area are left out.

pub(super) type Point = [f64; 3];

/// Triangles in a leaf at most.
const LEAF: usize = 4;

/// The tree.
pub(super) struct Closest<'a> {
    points: &'a [[f32; 3]],
    /// Place in the list, and corners; in the tree's order.
    triangles: Vec<(u32, [u32; 3])>,
    boxes: Vec<Box3>,
}

/// A box around a run of triangles; without children it is a leaf.
struct Box3 {
    low: Point,
    high: Point,
    run: [usize; 2],
    children: Option<[usize; 2]>,
}

/// Where on which triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub(super) corners: [u32; 3],
    /// Weights of the corners, which add up to 1.
    pub(super) weights: Point,
}

impl<'a> Closest<'a> {
    /// Over triangles of `points`; none where no triangle has an area.
    pub(super) fn new(points: &'a [[f32; 3]], triangles: impl Iterator<Item = [u32; 3]>) -> Option<Self> {
        let listed = (0..).zip(triangles);
        let triangles: Vec<_> = listed.filter(|(_, corners)| has_area(corners.map(|k| at(points, k)))).collect();
        if triangles.is_empty() {
            return None;
        }
        let mut tree = Self { points, triangles, boxes: Vec::new() };
        tree.split(0, tree.triangles.len());
        Some(tree)
    }

    /// Adds the box of a run, and those below it; gives its place.
    fn split(&mut self, first: usize, end: usize) -> usize {
        let points = self.points;
        let run = &mut self.triangles[first..end];
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for corner in run.iter().flat_map(|(_, corners)| corners) {
            let p = at(points, *corner);
            low = std::array::from_fn(|k| low[k].min(p[k]));
            high = std::array::from_fn(|k| high[k].max(p[k]));
        }
        let place = self.boxes.len();
        self.boxes.push(Box3 { low, high, run: [first, end], children: None });
        if end - first > LEAF {
            let size: Point = std::array::from_fn(|k| high[k] - low[k]);
            let axis = (0..3).fold(0, |most, k| if size[k] > size[most] { k } else { most });
            let middle = |corners: &[u32; 3]| corners.iter().map(|k| at(points, *k)[axis]).sum::<f64>();
            let half = run.len() / 2;
            run.select_nth_unstable_by(half, |a, b| middle(&a.1).total_cmp(&middle(&b.1)).then(a.0.cmp(&b.0)));
            let left = self.split(first, first + half);
            let right = self.split(first + half, end);
            self.boxes[place].children = Some([left, right]);
        }
        place
    }

    /// The closest point to `p` on any triangle.
    pub(super) fn find(&self, p: Point) -> Found {
        let mut best = (f64::INFINITY, u32::MAX, Found { corners: self.triangles[0].1, weights: [1.0, 0.0, 0.0] });
        let mut stack = vec![(self.boxes[0].distance(p), 0)];
        while let Some((distance, place)) = stack.pop() {
            // One as far as the best may hold a triangle that is listed before it.
            if distance > best.0 {
                continue;
            }
            let found = &self.boxes[place];
            let Some(children) = found.children else {
                for (listed, corners) in &self.triangles[found.run[0]..found.run[1]] {
                    let triangle = corners.map(|k| at(self.points, k));
                    let weights = closest_weights(p, triangle);
                    let away: Point =
                        std::array::from_fn(|k| (0..3).map(|i| weights[i] * triangle[i][k]).sum::<f64>() - p[k]);
                    let distance = dot(away, away);
                    if distance < best.0 || (distance == best.0 && *listed < best.1) {
                        best = (distance, *listed, Found { corners: *corners, weights });
                    }
                }
                continue;
            };
            let mut both = children.map(|child| (self.boxes[child].distance(p), child));
            if both[0].0 < both[1].0 {
                both.swap(0, 1);
            }
            stack.extend(both);
        }
        best.2
    }
}

impl Box3 {
    /// Squared, 0 inside.
    fn distance(&self, p: Point) -> f64 {
        (0..3).map(|k| (self.low[k] - p[k]).max(p[k] - self.high[k]).max(0.0)).map(|x| x * x).sum()
    }
}

/// Weights of the closest point to `p` on a triangle with an area: which of its corners, edges or inside it is (Ericson,
/// Real-Time Collision Detection, 5.1.5).
fn closest_weights(p: Point, [a, b, c]: [Point; 3]) -> Point {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = sub(p, b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let cp = sub(p, c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - w, w];
    }
    let whole = 1.0 / (va + vb + vc);
    let (v, w) = (vb * whole, vc * whole);
    [1.0 - v - w, v, w]
}

fn has_area([a, b, c]: [Point; 3]) -> bool {
    let normal = cross(sub(b, a), sub(c, a));
    dot(normal, normal) > 0.0
}

pub(super) fn at(points: &[[f32; 3]], k: u32) -> Point {
    points[k as usize].map(f64::from)
}

pub(super) fn sub(a: Point, b: Point) -> Point {
    std::array::from_fn(|k| a[k] - b[k])
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::random::Key;

    #[test]
    fn the_tree_finds_what_a_look_at_all_triangles_finds() {
        let points: Vec<[f32; 3]> =
            (0..300).map(|k| [0, 1, 2].map(|axis| Key::new(3).of(k).of(axis).between([-1.0, 1.0]))).collect();
        let triangles: Vec<[u32; 3]> = (0..100).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let tree = Closest::new(&points, triangles.iter().copied()).unwrap();
        for k in 0..200 {
            let p = [0, 1, 2].map(|axis| f64::from(Key::new(4).of(k).of(axis).between([-2.0, 2.0])));
            let squared = |corners: [u32; 3]| {
                let triangle = corners.map(|k| at(&points, k));
                let weights = closest_weights(p, triangle);
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12 && weights.iter().all(|w| *w >= -1e-12));
                let on: Point = std::array::from_fn(|k| (0..3).map(|i| weights[i] * triangle[i][k]).sum());
                dot(sub(on, p), sub(on, p))
            };
            let least = triangles.iter().map(|corners| squared(*corners)).fold(f64::INFINITY, f64::min);
            assert_eq!(squared(tree.find(p).corners), least);
        }
    }

    #[test]
    fn closest_points_by_hand_and_the_first_of_two_equally_close() {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 2.0, 2.0]];
        let of = |triangles: &[[u32; 3]], p: Point| {
            let found = Closest::new(&points, triangles.iter().copied()).unwrap().find(p);
            (found.corners, found.weights)
        };
        let one = [[0, 1, 2]];
        assert_eq!(of(&one, [0.25, 0.25, 5.0]).1, [0.5, 0.25, 0.25]);
        assert_eq!(of(&one, [0.5, -3.0, 1.0]).1, [0.5, 0.5, 0.0]);
        assert_eq!(of(&one, [-1.0, -1.0, 0.0]).1, [1.0, 0.0, 0.0]);
        assert_eq!(of(&one, [2.0, 2.0, 0.0]).1, [0.0, 0.5, 0.5]);
        // On the edge between two: the first, whichever that is; a triangle without area is none.
        assert_eq!(of(&[[4, 4, 0], [0, 1, 2], [3, 2, 1]], [0.5, 0.5, 0.0]).0, [0, 1, 2]);
        assert_eq!(of(&[[3, 2, 1], [0, 1, 2]], [0.5, 0.5, 0.0]).0, [3, 2, 1]);
        assert!(Closest::new(&points, [[0, 0, 1], [0, 1, 1]].into_iter()).is_none());
    }
}
