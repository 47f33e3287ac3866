//! Scale along the axes, then turn, then move, about a pivot: what it does to positions and to all that hangs on them.
//!
//! Promise: computed in f64 and rounded once; what is not turned or scaled is not touched, so moving alone adds one
//! number a coordinate; each row stands alone, on any number of threads. Limit: a quaternion says turns only, so
//! orientations follow the turn and neither scale nor mirror.

use rayon::prelude::*;

/// Rows a thread takes at a time.
const CHUNK: usize = 4096;

/// Quaternion x, y, z, w.
type Quat = [f64; 4];

/// Row by row.
type Matrix = [[f64; 3]; 3];

/// A map of space: `pivot + move + turn·(scale·(p − pivot))`.
#[derive(Clone, Debug)]
pub struct Affine {
    pivot: [f64; 3],
    offset: [f64; 3],
    /// `None` where nothing is scaled or turned.
    linear: Option<Linear>,
}

#[derive(Clone, Debug)]
struct Linear {
    turn: Quat,
    /// Turn · scale.
    vectors: Matrix,
    /// What normals are multiplied by, up to a positive factor.
    normals: Matrix,
    /// The turn alone, for normals that `normals` makes zero.
    turned: Matrix,
    mirrors: bool,
    size: f64,
}

impl Affine {
    /// Scales along x, y and z, turns by the unit quaternion `turn` (x, y, z, w), both about `pivot`, then moves.
    pub fn new(scale: [f64; 3], turn: Quat, pivot: [f64; 3], offset: [f64; 3]) -> Self {
        let still = turn[..3].iter().all(|x| *x == 0.0) && scale.iter().all(|factor| *factor == 1.0);
        let linear = (!still).then(|| Linear::new(scale, turn));
        Self { pivot, offset, linear }
    }

    /// Whether nothing moves at all.
    pub fn is_identity(&self) -> bool {
        self.linear.is_none() && self.offset.iter().all(|x| *x == 0.0)
    }

    /// Whether it turns or scales, so that vectors change too.
    pub fn is_linear(&self) -> bool {
        self.linear.is_some()
    }

    /// Whether it turns a left hand into a right one.
    pub fn mirrors(&self) -> bool {
        self.linear.as_ref().is_some_and(|linear| linear.mirrors)
    }

    /// What lengths without a direction are multiplied by: the cube root of how volumes grow, so the scale itself where
    /// it is the same along all axes.
    pub fn size(&self) -> f64 {
        self.linear.as_ref().map_or(1.0, |linear| linear.size)
    }

    /// Maps positions.
    pub fn points(&self, rows: &mut [[f32; 3]]) {
        match &self.linear {
            None => each(rows, |p| std::array::from_fn(|k| (f64::from(p[k]) + self.offset[k]) as f32)),
            Some(linear) => each(rows, |p| {
                let arm = std::array::from_fn(|k| f64::from(p[k]) - self.pivot[k]);
                let arm = times(&linear.vectors, arm);
                std::array::from_fn(|k| (arm[k] + (self.pivot[k] + self.offset[k])) as f32)
            }),
        }
    }

    /// Maps differences of positions, such as velocities: scaled and turned, not moved.
    pub fn vectors(&self, rows: &mut [[f32; 3]]) {
        let Some(linear) = &self.linear else { return };
        each(rows, |v| times(&linear.vectors, v.map(f64::from)).map(|x| x as f32));
    }

    /// Maps normals: still perpendicular to the mapped surface, still outward, of length 1. A zero one stays zero; one
    /// that lies in a direction scaled to nothing is turned alone.
    pub fn normals(&self, rows: &mut [[f32; 3]]) {
        let Some(linear) = &self.linear else { return };
        each(rows, |n| {
            let n = n.map(f64::from);
            let normal = unit(times(&linear.normals, n)).or_else(|| unit(times(&linear.turned, n)));
            normal.unwrap_or([0.0; 3]).map(|x| x as f32)
        });
    }

    /// Maps orientations: quaternions x, y, z, w, turned.
    pub fn orientations(&self, rows: &mut [[f32; 4]]) {
        let Some(linear) = &self.linear else { return };
        each(rows, |q| product(linear.turn, q.map(f64::from)).map(|x| x as f32));
    }

    /// Maps lengths without a direction, such as widths; see [`Affine::size`].
    pub fn lengths(&self, rows: &mut [f32]) {
        let size = self.size();
        if size != 1.0 {
            each(rows, |length| (f64::from(length) * size) as f32);
        }
    }
}

impl Linear {
    fn new(scale: [f64; 3], turn: Quat) -> Self {
        let turned = matrix(turn);
        let columns = |factors: [f64; 3]| turned.map(|row| [0, 1, 2].map(|k| row[k] * factors[k]));
        let [x, y, z] = scale.map(f64::abs);
        let mirrors = scale.iter().filter(|factor| **factor < 0.0).count() % 2 == 1;
        // Cofactors stay where an inverse ends, at a scale of 0; brought to at most 1 they cannot overflow.
        let largest = x.max(y).max(z).max(f64::MIN_POSITIVE);
        let [a, b, c] = scale.map(|factor| factor / largest);
        let outward = if mirrors { -1.0 } else { 1.0 };
        let size = if x == y && y == z { x } else { libm::cbrt(x) * libm::cbrt(y) * libm::cbrt(z) };
        Self {
            turn,
            vectors: columns(scale),
            normals: columns([b * c, a * c, a * b].map(|cofactor| cofactor * outward)),
            turned,
            mirrors,
            size,
        }
    }
}

fn each<T: Copy + Send + Sync>(rows: &mut [T], map: impl Fn(T) -> T + Sync) {
    rows.par_chunks_mut(CHUNK).for_each(|rows| rows.iter_mut().for_each(|row| *row = map(*row)));
}

fn times(matrix: &Matrix, v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn matrix([x, y, z, w]: Quat) -> Matrix {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// First `b`, then `a`.
fn product([ax, ay, az, aw]: Quat, [bx, by, bz, bw]: Quat) -> Quat {
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

/// `v` at length 1; `None` where it is zero.
fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let largest = v.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let v = v.map(|x| x / largest);
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    (largest > 0.0).then(|| v.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    const STILL: Quat = [0.0, 0.0, 0.0, 1.0];
    const ORIGIN: [f64; 3] = [0.0; 3];

    fn about_z(degrees: f64) -> Quat {
        let half = degrees.to_radians() / 2.0;
        [0.0, 0.0, libm::sin(half), libm::cos(half)]
    }

    fn mapped<T: Copy>(row: T, map: impl Fn(&mut [T])) -> T {
        let mut rows = [row];
        map(&mut rows);
        rows[0]
    }

    #[track_caller]
    fn assert_close<const N: usize>(a: [f32; N], b: [f32; N]) {
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 2e-7 * b.abs().max(1.0)), "{a:?} is not {b:?}");
    }

    #[test]
    fn scales_then_turns_then_moves_about_the_pivot() {
        // (2, 1, 0) less the pivot (1, 1, 0) is (1, 0, 0); scaled (3, 0, 0); turned (0, 3, 0); back and moved (1, 4, 5).
        let map = Affine::new([3.0, 1.0, 1.0], about_z(90.0), [1.0, 1.0, 0.0], [0.0, 0.0, 5.0]);
        assert_close(mapped([2.0, 1.0, 0.0], |p| map.points(p)), [1.0, 4.0, 5.0]);
        assert_close(mapped([1.0, 1.0, 0.0], |p| map.points(p)), [1.0, 1.0, 5.0]);
        assert_close(mapped([2.0, 1.0, 0.0], |v| map.vectors(v)), [-1.0, 6.0, 0.0]);
    }

    #[test]
    fn moving_alone_leaves_vectors_and_needs_no_pivot() {
        let map = Affine::new([1.0; 3], STILL, [1e30, 0.0, 0.0], [0.5, 0.0, 0.0]);
        assert!(!map.is_identity() && !map.is_linear());
        assert_eq!(mapped([0.25, 7.0, 0.0], |p| map.points(p)), [0.75, 7.0, 0.0]);
        assert_eq!(mapped([0.1, 0.2, 0.3], |v| map.vectors(v)), [0.1, 0.2, 0.3]);
        assert!(Affine::new([1.0; 3], STILL, [3.0; 3], ORIGIN).is_identity());
        assert!(Affine::new([1.0; 3], [0.0, 0.0, 0.0, -1.0], ORIGIN, ORIGIN).is_identity());
    }

    #[test]
    fn normals_stay_perpendicular_and_outward() {
        // The plane x + y = 0 stretched twofold in x is x/2 + y = 0, whose normal is (1, 2, 0)/√5.
        let h = std::f32::consts::FRAC_1_SQRT_2;
        let normal = |scale: [f64; 3]| mapped([h, h, 0.0], |n| Affine::new(scale, STILL, ORIGIN, ORIGIN).normals(n));
        let (one, two) = (1.0 / 5.0_f32.sqrt(), 2.0 / 5.0_f32.sqrt());
        assert_close(normal([2.0, 1.0, 1.0]), [one, two, 0.0]);
        assert_close(normal([2e200, 1e200, 1e200]), [one, two, 0.0]);
        assert_close(normal([-1.0, 1.0, 1.0]), [-h, h, 0.0]);
        assert_close(normal([-1.0, -1.0, -1.0]), [-h, -h, 0.0]);
        assert_close(normal([1.0, 0.0, 1.0]), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn a_normal_without_direction_stays_so_and_one_in_a_flattened_plane_is_turned() {
        let flat = Affine::new([1.0, 0.0, 1.0], about_z(90.0), ORIGIN, ORIGIN);
        assert_eq!(mapped([0.0; 3], |n| flat.normals(n)), [0.0; 3]);
        assert_close(mapped([1.0, 0.0, 0.0], |n| flat.normals(n)), [0.0, 1.0, 0.0]);
        let nothing = Affine::new([0.0; 3], STILL, ORIGIN, ORIGIN);
        assert_eq!(mapped([0.0, 1.0, 0.0], |n| nothing.normals(n)), [0.0, 1.0, 0.0]);
        assert!(!nothing.mirrors());
    }

    #[test]
    fn orientations_are_turned_after_what_they_say() {
        // About x by 90° first, then about z by 90°: y → z stays.
        let h = std::f32::consts::FRAC_1_SQRT_2;
        let map = Affine::new([2.0; 3], about_z(90.0), ORIGIN, ORIGIN);
        assert_close(mapped([h, 0.0, 0.0, h], |q| map.orientations(q)), [0.5, 0.5, 0.5, 0.5]);
    }

    #[test]
    fn lengths_follow_the_cube_root_of_volume() {
        let width = |scale| mapped(0.5, |w| Affine::new(scale, STILL, ORIGIN, ORIGIN).lengths(w));
        assert_eq!(width([3.0; 3]), 1.5);
        assert_eq!(width([-2.0, 2.0, 2.0]), 1.0);
        assert_eq!(width([8.0, 1.0, 1.0]), 1.0);
        assert_eq!(width([1.0, 0.0, 1.0]), 0.0);
    }

    #[test]
    fn far_from_the_origin_a_turn_about_a_near_pivot_loses_nothing() {
        let map = Affine::new([1.0; 3], about_z(90.0), [1e6, 0.0, 0.0], ORIGIN);
        assert_eq!(mapped([1e6 + 1.0, 0.0, 0.0], |p| map.points(p)), [1e6, 1.0, 0.0]);
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let map = Affine::new([1.1, 0.7, -3.0], [0.5; 4], [0.1; 3], [7.0; 3]);
        let runs = [1, 7].map(|threads| {
            let mut rows: Vec<[f32; 3]> = (0..20_001).map(|k| [k as f32 * 0.1, 1.0, -0.3 * k as f32]).collect();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| map.points(&mut rows));
            rows
        });
        assert_eq!(runs[0], runs[1]);
    }
}
