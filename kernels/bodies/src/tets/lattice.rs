//! The tets of a body-centred cubic lattice.
//!
//! Lattice points are the corners and the centres of cubes. A tet joins the centres of two cubes that share a face with
//! an edge of that face; the four edges of a face give the four tets around the line between the centres. Coordinates
//! count in half sides of a cube, so corners have even and centres odd ones.

use numerics::vector::DVec3;

/// Tets of a cube: four across its face towards each axis.
const TETS: u32 = 12;

/// Corners of a face, as signs along the two axes that follow the face's, counter-clockwise about it.
const AROUND: [[i32; 2]; 4] = [[-1, -1], [1, -1], [1, 1], [-1, 1]];

/// Distance within which a triangle touches a tet, in half sides, for rounding.
const TOUCH: f64 = 1e-6;

/// A box of cubes.
pub(super) struct Lattice {
    /// The lowest corner, metres.
    origin: DVec3,
    half: f64,
    /// Cubes along each axis.
    count: [u32; 3],
    /// As a number that may be too large.
    cubes: f64,
}

impl Lattice {
    /// Around a box, with one cube to spare on all sides and the same centre; cubes have the given `side`.
    pub(super) fn around(low: DVec3, high: DVec3, side: f64) -> Self {
        let side = if side > 0.0 { side } else { 1.0 };
        let count = [0, 1, 2].map(|k| ((high[k] - low[k]) / side).ceil() + 3.0);
        let extent = DVec3::from(count) * side;
        let origin = (low + high) * 0.5 - extent * 0.5;
        let cubes = count.iter().product();
        Self { origin, half: 0.5 * side, count: count.map(|n| n as u32), cubes }
    }

    /// Number of cubes.
    pub(super) fn cubes(&self) -> f64 {
        self.cubes
    }

    /// Half the side of a cube, metres.
    pub(super) fn half_side(&self) -> f64 {
        self.half
    }

    /// Number of tets, those that reach out of the box included.
    pub(super) fn tets(&self) -> u32 {
        TETS * self.count.iter().product::<u32>()
    }

    /// Number of points: corners first, then centres.
    pub(super) fn points(&self) -> u32 {
        self.corner_count() + self.count.iter().product::<u32>()
    }

    fn corner_count(&self) -> u32 {
        self.count.iter().map(|n| n + 1).product()
    }

    /// Position in half sides from the origin.
    pub(super) fn coordinates(&self, p: DVec3) -> DVec3 {
        (p - self.origin) / self.half
    }

    /// Position of a point, metres.
    pub(super) fn position(&self, point: u32) -> DVec3 {
        self.origin + DVec3::from(self.place(point).map(f64::from)) * self.half
    }

    /// Whether a point is not on the outside of the box, where nothing is inside.
    pub(super) fn is_near(&self, point: u32) -> bool {
        let place = self.place(point);
        (0..3).all(|k| place[k] > 1 && place[k] < 2 * self.count[k] as i32 - 1)
    }

    fn place(&self, point: u32) -> [i32; 3] {
        let corners = self.corner_count();
        let (index, counts, odd) = match point.checked_sub(corners) {
            Some(index) => (index, self.count, 1),
            None => (point, self.count.map(|n| n + 1), 0),
        };
        [index % counts[0], index / counts[0] % counts[1], index / counts[0] / counts[1]].map(|k| 2 * k as i32 + odd)
    }

    fn point(&self, place: [i32; 3]) -> u32 {
        let odd = place[0] & 1;
        let [x, y, z] = place.map(|k| (k >> 1) as u32);
        let [nx, ny] = [self.count[0] + 1 - odd as u32, self.count[1] + 1 - odd as u32];
        (z * ny + y) * nx + x + if odd == 1 { self.corner_count() } else { 0 }
    }

    /// Whether a tet's second centre is in the box.
    pub(super) fn exists(&self, tet: u32) -> bool {
        let (cube, axis, _) = self.parts(tet);
        cube[axis] + 1 < self.count[axis]
    }

    /// The first cube of a tet, the axis towards the second, and the edge.
    fn parts(&self, tet: u32) -> ([u32; 3], usize, usize) {
        let (cube, local) = (tet / TETS, tet % TETS);
        let cube = [cube % self.count[0], cube / self.count[0] % self.count[1], cube / self.count[0] / self.count[1]];
        (cube, (local / 4) as usize, (local % 4) as usize)
    }

    fn tet(&self, cube: [u32; 3], axis: usize, edge: usize) -> u32 {
        ((cube[2] * self.count[1] + cube[1]) * self.count[0] + cube[0]) * TETS + 4 * axis as u32 + edge as u32
    }

    fn places(&self, tet: u32) -> [[i32; 3]; 4] {
        let (cube, axis, edge) = self.parts(tet);
        let centre = cube.map(|k| 2 * k as i32 + 1);
        let mut next = centre;
        next[axis] += 2;
        let corner = |edge: usize| {
            let mut place = centre;
            place[axis] += 1;
            place[(axis + 1) % 3] += AROUND[edge % 4][0];
            place[(axis + 2) % 3] += AROUND[edge % 4][1];
            place
        };
        [centre, next, corner(edge), corner(edge + 1)]
    }

    /// The points of a tet that exists, positively oriented.
    pub(super) fn corners(&self, tet: u32) -> [u32; 4] {
        self.places(tet).map(|place| self.point(place))
    }

    /// The tet that contains a position in half sides, which is at least a cube inside the box.
    pub(super) fn tet_at(&self, at: DVec3) -> u32 {
        let mut cube = [0, 1, 2].map(|k| ((at[k] * 0.5).floor().max(0.0) as u32).min(self.count[k] - 1));
        let from = DVec3::from([0, 1, 2].map(|k| at[k] - f64::from(2 * cube[k] + 1)));
        // Across the face that the position is closest to; there, the edge that it is closest to.
        let axis = from.iamax();
        let (first, second) = ((axis + 1) % 3, (axis + 2) % 3);
        let edge = match from[first].abs() > from[second].abs() {
            true if from[first] > 0.0 => 1,
            true => 3,
            false if from[second] > 0.0 => 2,
            false => 0,
        };
        if from[axis] < 0.0 {
            cube[axis] = cube[axis].saturating_sub(1);
        }
        self.tet(cube, axis, edge)
    }

    /// Adds the tets that a triangle, with corners in half sides, touches.
    pub(super) fn touched(&self, triangle: &[DVec3; 3], found: &mut Vec<u32>) {
        let [a, b, c] = triangle;
        let (low, high) = (a.inf(b).inf(c), a.sup(b).sup(c));
        // A tet reaches from its first cube into the next one.
        let cubes = [0, 1, 2].map(|k| {
            let first = ((low[k] - TOUCH) * 0.5).floor() - 1.0;
            let last = ((high[k] + TOUCH) * 0.5).floor();
            (first.max(0.0) as u32)..(last.max(0.0) as u32 + 1).min(self.count[k])
        });
        for z in cubes[2].clone() {
            for y in cubes[1].clone() {
                for x in cubes[0].clone() {
                    for local in 0..TETS {
                        let tet = self.tet([x, y, z], (local / 4) as usize, (local % 4) as usize);
                        let at = self.places(tet).map(|place| DVec3::from(place.map(f64::from)));
                        let low_tet = at[0].inf(&at[1]).inf(&at[2]).inf(&at[3]);
                        let high_tet = at[0].sup(&at[1]).sup(&at[2]).sup(&at[3]);
                        let apart = (0..3).any(|k| low_tet[k] > high[k] + TOUCH || high_tet[k] < low[k] - TOUCH);
                        if !apart && self.exists(tet) && meet(triangle, &at) {
                            found.push(tet);
                        }
                    }
                }
            }
        }
    }
}

/// Whether a triangle and a tet meet or nearly so: no axis separates them.
fn meet(triangle: &[DVec3; 3], tet: &[DVec3; 4]) -> bool {
    let apart = |axis: DVec3| {
        let span = |points: &[DVec3]| {
            points
                .iter()
                .map(|p| p.dot(&axis))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
        };
        let ((low, high), (low_tet, high_tet)) = (span(triangle), span(tet));
        let touch = TOUCH * axis.norm();
        low > high_tet + touch || low_tet > high + touch
    };
    let sides = [triangle[1] - triangle[0], triangle[2] - triangle[1], triangle[0] - triangle[2]];
    let edges = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(i, j): (usize, usize)| tet[j] - tet[i]);
    let faces = [(0, 1), (0, 2), (1, 2), (3, 4)].map(|(i, j): (usize, usize)| edges[i].cross(&edges[j]));
    !apart(sides[0].cross(&sides[1]))
        && !faces.into_iter().any(apart)
        && !sides.iter().flat_map(|side| edges.iter().map(move |edge| side.cross(edge))).any(apart)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice() -> Lattice {
        Lattice::around(DVec3::new(0.0, 1.0, -2.0), DVec3::new(1.0, 2.5, -1.0), 0.5)
    }

    #[test]
    fn tets_are_positive_and_fill_the_space_between_the_outermost_centres() {
        let lattice = lattice();
        let mut sum = 0.0;
        for tet in (0..lattice.tets()).filter(|tet| lattice.exists(*tet)) {
            let [a, b, c, d] = lattice.corners(tet).map(|point| lattice.position(point));
            let volume = (b - a).dot(&(c - a).cross(&(d - a))) / 6.0;
            assert!((volume / (0.125 / 12.0) - 1.0).abs() < 1e-12, "12 tets fill a cube");
            sum += volume;
        }
        // 5 × 6 × 5 cubes: between 4 × 6 × 5 and so on pairs of centres there is two thirds of half a cube each.
        let pairs = 4 * 6 * 5 + 5 * 5 * 5 + 5 * 6 * 4;
        assert!((sum / (0.125 * f64::from(pairs) / 3.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn points_have_the_numbers_of_their_places() {
        let lattice = lattice();
        for point in 0..lattice.points() {
            assert_eq!(lattice.point(lattice.place(point)), point);
        }
    }

    #[test]
    fn the_tet_at_a_position_contains_it() {
        let lattice = lattice();
        let key = numerics::random::Key::new(5);
        for n in 0..2000 {
            let at = DVec3::from([0, 1, 2].map(|k| 2.0 + 5.0 * key.of(n).of(k).f64()));
            let corners = lattice.places(lattice.tet_at(at)).map(|place| DVec3::from(place.map(f64::from)));
            let volume = |[a, b, c, d]: [DVec3; 4]| (b - a).dot(&(c - a).cross(&(d - a)));
            for k in 0..4 {
                let mut with = corners;
                with[k] = at;
                assert!(volume(with) >= -1e-12, "{at}");
            }
        }
    }

    #[test]
    fn a_triangle_touches_the_tets_that_contain_its_points_and_none_that_is_apart() {
        let lattice = lattice();
        let triangle = [DVec3::new(2.1, 2.3, 2.2), DVec3::new(7.4, 3.1, 2.9), DVec3::new(3.3, 6.2, 5.8)];
        let mut found = Vec::new();
        lattice.touched(&triangle, &mut found);
        let normal = (triangle[1] - triangle[0]).cross(&(triangle[2] - triangle[0])).normalize();
        for tet in &found {
            let heights =
                lattice.places(*tet).map(|place| normal.dot(&(DVec3::from(place.map(f64::from)) - triangle[0])));
            assert!(
                heights.iter().any(|h| *h >= -1e-5) && heights.iter().any(|h| *h <= 1e-5),
                "its plane cuts the tet"
            );
        }
        for i in 0..=20 {
            for j in 0..=20 - i {
                let [u, v] = [f64::from(i) / 20.0, f64::from(j) / 20.0];
                let at = triangle[0] * (1.0 - u - v) + triangle[1] * u + triangle[2] * v;
                assert!(found.contains(&lattice.tet_at(at)));
            }
        }
    }
}
