//! The rotation nearest to a matrix.
//!
//! The unit quaternion that maximises the trace of Rᵀ·A is the eigenvector of the largest eigenvalue of a symmetric 4×4
//! matrix (Horn 1987). Its characteristic polynomial has real roots only, so Newton's method from above converges
//! monotonically to the largest one (Theobald 2005); the eigenvector is a column of the adjugate.
//!
//! Guarantees: for a rotation times any positive scale, that rotation to 1e-14; smooth in the matrix, mirrored and flat
//! ones included, as long as the nearest rotation is unique; otherwise `None`; the same bits for one matrix and for
//! sixteen side by side. Limit: a matrix of rank 1, or one that mirrors and scales its two smaller axes equally, has a
//! circle of equally near rotations.

use numerics::lanes::{F64x16, LANES, get_f64, set_f64};
use numerics::simd::kernel;
use numerics::vector::{DMat3, DQuat, DVec3, unit_quaternion};

/// A bound on the derivative of the characteristic polynomial at the root, for a matrix of norm 1:
/// 8·(σ₂+σ₃)(σ₁+σ₃)(σ₁+σ₂), 12 for a rotation and 0 where the nearest one is not unique. At this value the rounding of
/// f32 positions rotates by about 0.01 radians; ten times farther from ambiguity it is less than the motion of a skin
/// in a frame.
const AMBIGUOUS: f64 = 1e-4;

/// Steps of Newton's method: about 6 are used, and 40 near a double root.
const MAX_STEPS: usize = 64;

/// The rotation R that minimises |A − R| (w ≥ 0); `None` if several are about equally near, or A is not finite.
pub fn nearest_rotation(a: &DMat3) -> Option<DQuat> {
    let quartic = Quartic::of([0, 1, 2].map(|k| a.row(k).transpose()));
    let mut root = START;
    for _ in 0..MAX_STEPS {
        let next = quartic.newton(root);
        if next == root {
            break;
        }
        root = next;
    }
    quartic.is_single(root).then(|| unit_quaternion(quartic.eigenvector(root)))
}

kernel! {
    /// [`nearest_rotation`] of a matrix on each lane, given by columns.
    pub(super) fn nearest_rotations(columns: &[F64x16; 9]) -> [Option<DQuat>; LANES] = nearest;
}

#[inline(always)]
fn nearest(columns: &[F64x16; 9]) -> [Option<DQuat>; LANES] {
    let mut quartics = QuarticLanes::ZERO;
    for lane in 0..LANES {
        let row = |k: usize| DVec3::new(columns[k].0[lane], columns[3 + k].0[lane], columns[6 + k].0[lane]);
        quartics.set(lane, Quartic::of([row(0), row(1), row(2)]));
    }
    let mut roots = F64x16([START; LANES]);
    for _ in 0..MAX_STEPS {
        let next = F64x16::from_fn(|lane| quartics.get(lane).newton(roots.0[lane]));
        if next == roots {
            break;
        }
        roots = next;
    }
    let mut rotations = [F64x16::ZERO; 4];
    for lane in 0..LANES {
        let rotation = quartics.get(lane).eigenvector(roots.0[lane]);
        for (component, value) in rotations.iter_mut().zip(rotation) {
            component.0[lane] = value;
        }
    }
    let [x, y, z, w] = &rotations;
    let rotation = |lane: usize| unit_quaternion([x.0[lane], y.0[lane], z.0[lane], w.0[lane]]);
    std::array::from_fn(|lane| quartics.get(lane).is_single(roots.0[lane]).then(|| rotation(lane)))
}

/// No root lies above the sum of the singular values, which is at most √3 times the norm.
const START: f64 = 1.732_050_807_568_877_2;

/// The characteristic polynomial of Horn's matrix, x⁴ − 2x² + `linear`·x + `constant`. Every function is free of
/// branches, so that a loop over lanes runs side by side.
#[derive(Clone, Copy, Debug)]
struct Quartic {
    /// Of A, scaled to norm 1; not finite where A is zero or not finite.
    rows: [DVec3; 3],
    linear: f64,
    constant: f64,
}

impl Quartic {
    #[inline(always)]
    fn of(rows: [DVec3; 3]) -> Self {
        let entries = rows.iter().flat_map(DVec3::iter);
        let largest = entries.fold(0.0_f64, |most, x| if x.abs() <= most { most } else { x.abs() });
        // Scaled to about 1, so that squares neither vanish nor overflow.
        let rows = rows.map(|row| row / largest);
        let norm = rows.iter().flat_map(DVec3::iter).map(|x| x * x).sum::<f64>().sqrt();
        let rows = rows.map(|row| row / norm);

        let [x, y, z] = &rows;
        let cofactors = [y.cross(z), z.cross(x), x.cross(y)];
        let linear = -8.0 * x.dot(&cofactors[0]);
        let constant = 1.0 - 4.0 * cofactors.iter().flat_map(DVec3::iter).map(|x| x * x).sum::<f64>();
        Self { rows, linear, constant }
    }

    #[inline(always)]
    fn slope(&self, x: f64) -> f64 {
        (4.0 * x * x - 4.0) * x + self.linear
    }

    /// The next step towards the largest root; `x` once there is none.
    #[inline(always)]
    fn newton(&self, x: f64) -> f64 {
        let value = (x * x - 2.0) * x * x + self.linear * x + self.constant;
        let slope = self.slope(x);
        let next = x - value / slope;
        if (value > 0.0) & (slope > 0.0) & (next < x) { next } else { x }
    }

    /// Whether the largest root is far enough from the others; false where A is zero or not finite.
    #[inline(always)]
    fn is_single(&self, root: f64) -> bool {
        self.slope(root) > AMBIGUOUS
    }

    /// Horn's matrix, whose dominant eigenvector is the rotation as w, x, y, z.
    #[inline(always)]
    fn horn(&self) -> [[f64; 4]; 4] {
        let [x, y, z] = &self.rows;
        let ([xx, yx, zx], [xy, yy, zy], [xz, yz, zz]) = ([x.x, x.y, x.z], [y.x, y.y, y.z], [z.x, z.y, z.z]);
        [
            [xx + yy + zz, yz - zy, zx - xz, xy - yx],
            [yz - zy, xx - yy - zz, xy + yx, zx + xz],
            [zx - xz, xy + yx, yy - xx - zz, yz + zy],
            [xy - yx, zx + xz, yz + zy, zz - xx - yy],
        ]
    }

    /// The unit eigenvector of a single root, as x, y, z, w with w ≥ 0.
    #[inline(always)]
    fn eigenvector(&self, root: f64) -> [f64; 4] {
        let mut less = self.horn();
        for k in 0..4 {
            less[k][k] -= root;
        }
        // The adjugate is the eigenvector times itself, up to a factor: the row with the largest diagonal entry is the
        // most accurate.
        let rows = adjugate(&less);
        let (mut best, mut largest) = (rows[0], rows[0][0].abs());
        for k in 1..4 {
            let larger = rows[k][k].abs() > largest;
            largest = if larger { rows[k][k].abs() } else { largest };
            for component in 0..4 {
                best[component] = if larger { rows[k][component] } else { best[component] };
            }
        }
        let [w, x, y, z] = best;
        let length = (w * w + x * x + y * y + z * z).sqrt();
        let length = if w < 0.0 { -length } else { length };
        [x / length, y / length, z / length, w / length]
    }
}

/// Sixteen of them.
struct QuarticLanes {
    rows: [[F64x16; 3]; 3],
    linear: F64x16,
    constant: F64x16,
}

impl QuarticLanes {
    const ZERO: Self = Self { rows: [[F64x16::ZERO; 3]; 3], linear: F64x16::ZERO, constant: F64x16::ZERO };

    #[inline(always)]
    fn set(&mut self, lane: usize, quartic: Quartic) {
        for k in 0..3 {
            set_f64(&mut self.rows[k], lane, quartic.rows[k]);
        }
        self.linear.0[lane] = quartic.linear;
        self.constant.0[lane] = quartic.constant;
    }

    #[inline(always)]
    fn get(&self, lane: usize) -> Quartic {
        let [x, y, z] = &self.rows;
        let rows = [get_f64(x, lane), get_f64(y, lane), get_f64(z, lane)];
        Quartic { rows, linear: self.linear.0[lane], constant: self.constant.0[lane] }
    }
}

/// The adjugate of a symmetric matrix, by Laplace expansion along two pairs of rows: its minors of size 2 are shared.
#[inline(always)]
fn adjugate(&[[a, b, c, d], [_, e, f, g], [_, _, h, i], [_, _, _, j]]: &[[f64; 4]; 4]) -> [[f64; 4]; 4] {
    // Of the first two rows, by columns.
    let (s01, s02, s03) = (a * e - b * b, a * f - b * c, a * g - b * d);
    let (s12, s13, s23) = (b * f - e * c, b * g - e * d, c * g - f * d);
    // Of the last two rows.
    let (t02, t03) = (c * i - d * h, c * j - d * i);
    let (t12, t13, t23) = (f * i - g * h, f * j - g * i, h * j - i * i);

    let ww = e * t23 - f * t13 + g * t12;
    let wx = c * t13 - b * t23 - d * t12;
    let wy = g * s23 - i * s13 + j * s12;
    let wz = h * s13 - f * s23 - i * s12;
    let xx = a * t23 - c * t03 + d * t02;
    let xy = i * s03 - d * s23 - j * s02;
    let xz = c * s23 - h * s03 + i * s02;
    let yy = d * s13 - g * s03 + j * s01;
    let yz = f * s03 - c * s13 - i * s01;
    let zz = c * s12 - f * s02 + h * s01;
    [[ww, wx, wy, wz], [wx, xx, xy, xz], [wy, xy, yy, yz], [wz, xz, yz, zz]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Quaternion, Unit};
    use numerics::random::Key;
    use numerics::simd::Path;
    use numerics::vector::rotation;

    fn matrix(q: DQuat) -> DMat3 {
        DMat3::from_columns(&[DVec3::x(), DVec3::y(), DVec3::z()].map(|axis| q * axis))
    }

    fn apart(a: DQuat, b: DQuat) -> f64 {
        let sign = if a.coords.dot(&b.coords) < 0.0 { -1.0 } else { 1.0 };
        (a.coords - sign * b.coords).amax()
    }

    fn some_rotation(i: u64) -> DQuat {
        let [w, x, y, z] = std::array::from_fn(|k| Key::new(3).of(i).of(k as u64).f64() - 0.5);
        let q = Quaternion::new(w, x, y, z);
        Unit::new_unchecked(q / q.norm())
    }

    #[test]
    fn a_matrix_times_its_adjugate_is_its_determinant() {
        let matrix = [[2.0, 1.0, -1.0, 3.0], [1.0, 4.0, 2.0, 0.0], [-1.0, 2.0, 5.0, 1.0], [3.0, 0.0, 1.0, -2.0]];
        let adjugate = adjugate(&matrix);
        for (k, row) in matrix.iter().enumerate() {
            for column in 0..4 {
                let product: f64 = (0..4).map(|m| row[m] * adjugate[m][column]).sum();
                // Worked out by hand, by expansion along the last row.
                assert_eq!(product, if k == column { -225.0 } else { 0.0 }, "{k} {column}");
            }
        }
    }

    #[test]
    fn a_rotation_at_any_scale_is_found() {
        for i in 0..1000 {
            let q = some_rotation(i);
            for size in [1.0, 1e-150, 1e150] {
                let found = nearest_rotation(&(matrix(q) * size)).unwrap();
                assert!(apart(found, q) < 1e-14, "{q:?} {found:?}");
            }
        }
        for [x, y, z] in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.6, 0.8]] {
            let half_turn = Unit::new_unchecked(Quaternion::new(0.0, x, y, z));
            assert!(apart(nearest_rotation(&matrix(half_turn)).unwrap(), half_turn) < 1e-14);
        }
    }

    #[test]
    fn stretch_before_a_rotation_changes_nothing_and_shear_rotates_by_half() {
        // R·S with S symmetric and positive has R as its rotation, by definition of the polar decomposition.
        for i in 0..1000 {
            let (q, axes) = (some_rotation(i), matrix(some_rotation(i + 5000)));
            let stretch = DVec3::from([0, 1, 2].map(|k| Key::new(4).of(i).of(k).f64() + 1e-3));
            let symmetric = axes * DMat3::from_diagonal(&stretch) * axes.transpose();
            let found = nearest_rotation(&(matrix(q) * symmetric)).unwrap();
            assert!(apart(found, q) < 1e-12, "{stretch:?}");
        }
        // Simple shear by k rotates by −atan(k/2).
        let found = nearest_rotation(&DMat3::new(1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)).unwrap();
        assert!(apart(found, rotation(DVec3::z(), -libm::atan(0.5))) < 1e-14);
    }

    #[test]
    fn flat_matrices_have_a_rotation_and_lines_have_none() {
        let q = some_rotation(1);
        let scaled = |x, y, z| matrix(q) * DMat3::from_diagonal(&DVec3::new(x, y, z));
        assert!(apart(nearest_rotation(&scaled(2.0, 1.0, 0.0)).unwrap(), q) < 1e-14);
        for line in [0.0, 1e-6] {
            assert_eq!(nearest_rotation(&scaled(2.0, line, 0.0)), None);
        }
        // A mirroring matrix flips its smallest axis.
        assert!(apart(nearest_rotation(&scaled(3.0, 2.0, -1.0)).unwrap(), q) < 1e-14);
        assert_eq!(nearest_rotation(&DMat3::from_diagonal(&DVec3::new(-1.0, 1.0, 1.0))), None);
    }

    #[test]
    fn sixteen_side_by_side_have_the_bits_of_each_alone_on_every_path() {
        let random = |i: u64| DMat3::from_fn(|row, column| Key::new(5).of(i).of((3 * row + column) as u64).f64() - 0.5);
        let mut matrices: Vec<DMat3> = (0..13).map(random).collect();
        matrices.extend([DMat3::zeros(), DMat3::repeat(f64::NAN), matrix(some_rotation(7)) * 1e200]);
        let columns = std::array::from_fn(|entry| F64x16::from_fn(|lane| matrices[lane][entry]));
        let alone: Vec<_> = matrices.iter().map(nearest_rotation).collect();
        assert_eq!(alone.iter().filter(|found| found.is_none()).count(), 2);
        for path in Path::all() {
            assert_eq!(nearest_rotations(path, &columns).to_vec(), alone, "{}", path.name());
        }
    }

    #[test]
    fn zero_and_non_finite_matrices_have_no_rotation() {
        for x in [0.0, f64::NAN, f64::INFINITY] {
            assert_eq!(nearest_rotation(&DMat3::repeat(x)), None);
        }
    }
}
