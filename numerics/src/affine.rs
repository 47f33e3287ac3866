//! Affine maps: scaling along the axes, then a rotation, then a translation, about a pivot; applied to positions and to
//! every kind of attribute that goes with them.
//!
//! Promise: computed in f64 and rounded once; a translation alone adds one number to each coordinate and leaves all else
//! untouched; every row is independent, so any number of threads gives the same bits. Limit: a quaternion expresses
//! rotations only, so orientations follow the rotation and neither scale nor mirror.

use crate::parallel;
use crate::vector::{DMat3, DQuat, DVec3, direction, to_f32, to_f64, unit_quaternion};
use nalgebra::Quaternion;

/// Rows a thread takes at a time.
const CHUNK: usize = 4096;

/// A map of space: `pivot + translation + rotation·(scale·(p − pivot))`.
#[derive(Clone, Debug)]
pub struct Affine {
    pivot: DVec3,
    translation: DVec3,
    /// `None` where nothing is scaled or rotated.
    linear: Option<Linear>,
}

#[derive(Clone, Debug)]
struct Linear {
    rotation: DQuat,
    /// Rotation · scale.
    vectors: DMat3,
    /// What normals are multiplied by, up to a positive factor.
    normals: DMat3,
    /// The rotation alone, for normals that `normals` maps to zero.
    rotated: DMat3,
    mirrors: bool,
    size: f64,
}

impl Affine {
    /// Scales along x, y and z, rotates by the unit quaternion `rotation` (x, y, z, w), both about `pivot`, then
    /// translates; metres.
    pub fn new(scale: [f64; 3], rotation: [f64; 4], pivot: [f64; 3], translation: [f64; 3]) -> Self {
        let is_still = rotation[..3].iter().all(|x| *x == 0.0) && scale.iter().all(|factor| *factor == 1.0);
        let linear = (!is_still).then(|| Linear::new(scale.into(), rotation));
        Self { pivot: pivot.into(), translation: translation.into(), linear }
    }

    /// Whether nothing moves at all.
    pub fn is_identity(&self) -> bool {
        self.linear.is_none() && self.translation == DVec3::zeros()
    }

    /// Whether it rotates or scales, so that vectors change too.
    pub fn is_linear(&self) -> bool {
        self.linear.is_some()
    }

    /// Whether it turns a left hand into a right one.
    pub fn mirrors(&self) -> bool {
        self.linear.as_ref().is_some_and(|linear| linear.mirrors)
    }

    /// What lengths without a direction are multiplied by: the cube root of the factor of volumes, so the scale itself
    /// where it is the same along all axes.
    pub fn size(&self) -> f64 {
        self.linear.as_ref().map_or(1.0, |linear| linear.size)
    }

    /// Maps positions.
    pub fn points(&self, rows: &mut [[f32; 3]]) {
        match &self.linear {
            None => each(rows, |p| to_f32(to_f64(p) + self.translation)),
            Some(linear) => {
                let to = self.pivot + self.translation;
                each(rows, |p| to_f32(linear.vectors * (to_f64(p) - self.pivot) + to));
            }
        }
    }

    /// Maps differences of positions, such as velocities: scaled and rotated, not translated.
    pub fn vectors(&self, rows: &mut [[f32; 3]]) {
        let Some(linear) = &self.linear else { return };
        each(rows, |v| to_f32(linear.vectors * to_f64(v)));
    }

    /// Maps normals: still perpendicular to the mapped surface, still outward, of length 1. A zero one stays zero; one
    /// along a direction that is scaled to 0 is rotated only.
    pub fn normals(&self, rows: &mut [[f32; 3]]) {
        let Some(linear) = &self.linear else { return };
        each(rows, |n| {
            let n = to_f64(n);
            let normal = direction(linear.normals * n).or_else(|| direction(linear.rotated * n));
            normal.map_or([0.0; 3], to_f32)
        });
    }

    /// Maps orientations: quaternions x, y, z, w, rotated.
    pub fn orientations(&self, rows: &mut [[f32; 4]]) {
        let Some(linear) = &self.linear else { return };
        each(rows, |q| {
            let rotated = linear.rotation.quaternion() * Quaternion::from(q.map(f64::from));
            rotated.coords.map(|x| x as f32).into()
        });
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
    fn new(scale: DVec3, rotation: [f64; 4]) -> Self {
        let rotation = unit_quaternion(rotation);
        let rotated = DMat3::from_columns(&[DVec3::x(), DVec3::y(), DVec3::z()].map(|axis| rotation * axis));
        let times_columns = |factors: DVec3| DMat3::from_fn(|row, k| rotated[(row, k)] * factors[k]);
        let [x, y, z] = scale.abs().into();
        let mirrors = scale.iter().filter(|factor| **factor < 0.0).count() % 2 == 1;
        // The inverse does not exist at a scale of 0, cofactors do; of factors ≤ 1 they cannot overflow.
        let largest = x.max(y).max(z).max(f64::MIN_POSITIVE);
        let [a, b, c] = (scale / largest).into();
        let outward = if mirrors { -1.0 } else { 1.0 };
        let size = if x == y && y == z { x } else { libm::cbrt(x) * libm::cbrt(y) * libm::cbrt(z) };
        Self {
            rotation,
            vectors: times_columns(scale),
            normals: times_columns(DVec3::new(b * c, a * c, a * b) * outward),
            rotated,
            mirrors,
            size,
        }
    }
}

fn each<T: Copy + Send + Sync>(rows: &mut [T], map: impl Fn(T) -> T + Sync) {
    parallel::for_each(rows.chunks_mut(CHUNK), |_, rows| rows.iter_mut().for_each(|row| *row = map(*row)));
}

#[cfg(test)]
mod tests {
    use super::*;

    const STILL: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
    const ORIGIN: [f64; 3] = [0.0; 3];

    fn about_z(degrees: f64) -> [f64; 4] {
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
    fn scales_then_rotates_then_translates_about_the_pivot() {
        // (2, 1, 0) less the pivot (1, 1, 0) is (1, 0, 0); scaled (3, 0, 0); rotated (0, 3, 0); back at the pivot and translated (1, 4, 5).
        let map = Affine::new([3.0, 1.0, 1.0], about_z(90.0), [1.0, 1.0, 0.0], [0.0, 0.0, 5.0]);
        assert_close(mapped([2.0, 1.0, 0.0], |p| map.points(p)), [1.0, 4.0, 5.0]);
        assert_close(mapped([1.0, 1.0, 0.0], |p| map.points(p)), [1.0, 1.0, 5.0]);
        assert_close(mapped([2.0, 1.0, 0.0], |v| map.vectors(v)), [-1.0, 6.0, 0.0]);
    }

    #[test]
    fn a_translation_alone_leaves_vectors_and_ignores_the_pivot() {
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
    fn a_zero_normal_stays_zero_and_one_in_a_flattened_plane_is_rotated() {
        let flat = Affine::new([1.0, 0.0, 1.0], about_z(90.0), ORIGIN, ORIGIN);
        assert_eq!(mapped([0.0; 3], |n| flat.normals(n)), [0.0; 3]);
        assert_close(mapped([1.0, 0.0, 0.0], |n| flat.normals(n)), [0.0, 1.0, 0.0]);
        let nothing = Affine::new([0.0; 3], STILL, ORIGIN, ORIGIN);
        assert_eq!(mapped([0.0, 1.0, 0.0], |n| nothing.normals(n)), [0.0, 1.0, 0.0]);
        assert!(!nothing.mirrors());
    }

    #[test]
    fn orientations_are_rotated_on_the_left() {
        // About x by 90° first, then about z by 90°: y → z stays.
        let h = std::f32::consts::FRAC_1_SQRT_2;
        let map = Affine::new([2.0; 3], about_z(90.0), ORIGIN, ORIGIN);
        assert_close(mapped([h, 0.0, 0.0, h], |q| map.orientations(q)), [0.5, 0.5, 0.5, 0.5]);
    }

    #[test]
    fn lengths_scale_by_the_cube_root_of_volume() {
        let width = |scale| mapped(0.5, |w| Affine::new(scale, STILL, ORIGIN, ORIGIN).lengths(w));
        assert_eq!(width([3.0; 3]), 1.5);
        assert_eq!(width([-2.0, 2.0, 2.0]), 1.0);
        assert_eq!(width([8.0, 1.0, 1.0]), 1.0);
        assert_eq!(width([1.0, 0.0, 1.0]), 0.0);
    }

    #[test]
    fn a_rotation_about_a_near_pivot_is_exact_far_from_the_origin() {
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
