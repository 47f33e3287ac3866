//! Free-form deformation against maps known in closed form.

use super::*;
use numerics::random::Key;
use numerics::vector::to_f64;

const UNIT: [[f64; 3]; 2] = [[0.0; 3], [1.0; 3]];
const BASES: [LatticeBasis; 2] = [LatticeBasis::Trilinear, LatticeBasis::Bernstein];
const EXTRAPOLATIONS: [Extrapolation; 2] = [Extrapolation::Hold, Extrapolation::Extend];

/// One offset for each control point, from its position in the unit box.
fn offsets(divisions: [usize; 3], offset: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<[f32; 3]> {
    let mut offsets = Vec::new();
    for k in 0..=divisions[2] {
        for j in 0..=divisions[1] {
            for i in 0..=divisions[0] {
                let position = [0, 1, 2].map(|axis| [i, j, k][axis] as f64 / divisions[axis] as f64);
                offsets.push(offset(position).map(|x| x as f32));
            }
        }
    }
    offsets
}

fn random(count: usize, [low, high]: [f32; 2]) -> Vec<[f32; 3]> {
    (0..count).map(|row| [0, 1, 2].map(|k| Key::new(8).of(row as u64).of(k).between([low, high]))).collect()
}

fn noisy(divisions: [usize; 3]) -> Vec<[f32; 3]> {
    random(control_points(divisions).unwrap(), [-0.3, 0.3])
}

#[track_caller]
fn assert_close(a: &[[f32; 3]], b: &[[f64; 3]], within: f64) {
    for (a, b) in a.iter().zip(b) {
        let near = |k: usize| (f64::from(a[k]) - b[k]).abs() <= within * b[k].abs().max(1.0);
        assert!((0..3).all(near), "{a:?} is not {b:?}");
    }
}

#[test]
fn one_corner_moves_the_centre_by_an_eighth_and_the_far_corner_not_at_all() {
    let mut moved = vec![[0.0; 3]; 8];
    moved[7] = [8.0, 0.0, -16.0];
    for basis in BASES {
        let lattice = DeformationLattice::new(UNIT, [1; 3], &moved, basis, Extrapolation::Hold).unwrap();
        let out = lattice.deform(&[[0.5; 3], [0.0; 3], [1.0; 3], [1.0, 1.0, 0.5]], true);
        assert_eq!(out.points, [[1.5, 0.5, -1.5], [0.0; 3], [9.0, 1.0, -15.0], [5.0, 1.0, -7.5]]);
        // D = uvw·(8, 0, −16): its derivative in the middle is ¼ of that along each axis.
        assert_eq!(out.jacobians[0], DMat3::new(3.0, 2.0, 2.0, 0.0, 1.0, 0.0, -4.0, -4.0, -3.0));
    }
}

#[test]
fn with_two_divisions_the_centre_control_point_moves_the_centre_fully_or_by_an_eighth() {
    let mut moved = vec![[0.0; 3]; 27];
    moved[13] = [0.0, 8.0, 0.0];
    let at = |basis| {
        let lattice = DeformationLattice::new(UNIT, [2; 3], &moved, basis, Extrapolation::Hold).unwrap();
        lattice.deform(&[[0.5; 3], [0.25, 0.5, 0.5]], false).points
    };
    assert_eq!(at(LatticeBasis::Trilinear), [[0.5, 8.5, 0.5], [0.25, 4.5, 0.5]]);
    // 2t(1 − t) is ½ in the middle and 3/8 at a quarter.
    assert_eq!(at(LatticeBasis::Bernstein), [[0.5, 1.5, 0.5], [0.25, 1.25, 0.5]]);
}

#[test]
fn affine_offsets_give_the_affine_map_inside_and_extrapolated() {
    // Multiples of an eighth, so that f32 holds the offsets exactly: extrapolation would magnify rounding.
    let map = DMat3::new(0.375, -0.75, 0.25, 0.5, -0.375, 0.125, -0.25, 0.625, 0.875);
    let affine = |p: [f64; 3]| (map * DVec3::from(p)).map(|x| 0.25 + x).into();
    for divisions in [[1, 1, 1], [3, 2, 5], [4, 16, 2], [16, 1, 7]] {
        let offsets = offsets(divisions, affine);
        for basis in BASES {
            for extrapolation in EXTRAPOLATIONS {
                let lattice = DeformationLattice::new(UNIT, divisions, &offsets, basis, extrapolation).unwrap();
                let extends =
                    extrapolation == Extrapolation::Extend && divisions.iter().all(|cells| cells.is_power_of_two());
                let range = if extends { [-3.0, 4.0] } else { [0.0, 1.0] };
                let points = random(100, range);
                let expected: Vec<[f64; 3]> =
                    points.iter().map(|p| (to_f64(*p) + DVec3::from(affine(p.map(f64::from)))).into()).collect();
                let out = lattice.deform(&points, true);
                assert_close(&out.points, &expected, 1e-6);
                for jacobian in out.jacobians {
                    for row in 0..3 {
                        for axis in 0..3 {
                            let own = f64::from(u8::from(row == axis));
                            assert!((jacobian[(row, axis)] - own - map[(row, axis)]).abs() < 2e-6);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn points_outside_a_held_box_move_as_its_nearest_point() {
    let offsets = noisy([2, 3, 1]);
    for basis in BASES {
        let lattice = DeformationLattice::new(UNIT, [2, 3, 1], &offsets, basis, Extrapolation::Hold).unwrap();
        let moved = |p: [f32; 3]| {
            let out = lattice.deform(&[p], true);
            ([0, 1, 2].map(|k| f64::from(out.points[0][k]) - f64::from(p[k])), out.jacobians[0])
        };
        let ((far, slopes), (near, _)) = (moved([7.0, 0.25, -3.0]), moved([1.0, 0.25, 0.0]));
        assert!((0..3).all(|k| (far[k] - near[k]).abs() < 1e-6));
        let columns = [0, 2].map(|axis| slopes.column(axis).into_owned());
        assert_eq!(columns, [DVec3::x(), DVec3::z()], "only y has an effect there");
    }
}

#[test]
fn a_point_that_rounding_puts_outside_has_the_slopes_of_the_inside() {
    // Mirrored along x and z, in a box as large as its contents: 0.36 is larger in f32 than in f64.
    let corners = [[0.24, 0.0, 0.0], [0.36, 1.0, 1.0]];
    let turned = offsets([1; 3], |[x, _, z]| [-1.12 * x, 0.0, -2.0 * z]);
    for basis in BASES {
        let lattice = DeformationLattice::new(corners, [1; 3], &turned, basis, Extrapolation::Hold).unwrap();
        let jacobians = lattice.deform(&[[0.36, 0.5, 0.5], [0.3, 0.5, 0.5], [0.37, 0.5, 0.5]], true).jacobians;
        assert!((jacobians[0].m11 - jacobians[1].m11).abs() < 1e-6 && jacobians[0].m11 < -8.0);
        assert_eq!(jacobians[2].m11, 1.0);
    }
}

#[test]
fn zero_offsets_keep_every_bit() {
    let points = [[-0.0, 0.1, 1e-40], [0.3, -0.0, 7e20]];
    for basis in BASES {
        let offsets = vec![[0.0, -0.0, 0.0]; 60];
        let lattice =
            DeformationLattice::new([[-1.0; 3], [1.0; 3]], [2, 3, 4], &offsets, basis, Extrapolation::Extend).unwrap();
        assert!(lattice.is_identity());
        let out = lattice.deform(&points, true);
        let bits = |points: &[[f32; 3]]| points.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&out.points), bits(&points));
        assert_eq!((out.min_determinant, out.folded), (1.0, 0));
    }
}

#[test]
fn the_jacobian_is_the_derivative_of_the_map() {
    // Away from the planes between cells, so that a step stays in its cell.
    let step = 1.0 / 256.0;
    let offsets = noisy([2, 3, 4]);
    let along = [0.1, 0.4, 0.6, 0.85, -0.7, 1.9];
    for basis in BASES {
        for extrapolation in EXTRAPOLATIONS {
            let lattice = DeformationLattice::new(UNIT, [2, 3, 4], &offsets, basis, extrapolation).unwrap();
            for n in 0..216 {
                let p = [along[n % 6], along[n / 6 % 6], along[n / 36]];
                let jacobian = lattice.deform(&[p], true).jacobians[0];
                for axis in 0..3 {
                    let aside = |by: f32| {
                        let mut p = p;
                        p[axis] += by;
                        lattice.deform(&[p], false).points[0].map(f64::from)
                    };
                    let (low, high) = (aside(-step), aside(step));
                    for row in 0..3 {
                        let slope = (high[row] - low[row]) / (2.0 * f64::from(step));
                        assert!((slope - jacobian[(row, axis)]).abs() < 3e-3, "{basis:?} {extrapolation:?} {p:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn cells_meet_without_a_gap() {
    let offsets = noisy([3, 3, 3]);
    for basis in BASES {
        for extrapolation in EXTRAPOLATIONS {
            let lattice = DeformationLattice::new(UNIT, [3; 3], &offsets, basis, extrapolation).unwrap();
            for seam in [0.0_f32, 1.0 / 3.0, 2.0 / 3.0, 1.0] {
                let [below, above] = [-1e-6, 1e-6].map(|by| lattice.deform(&[[0.2, seam + by, 0.7]], false).points[0]);
                assert!((0..3).all(|k| (below[k] - above[k]).abs() < 1e-5), "{seam}");
            }
        }
    }
}

#[test]
fn folded_points_are_counted() {
    // The upper half comes down through the lower: y + D = y − 1.5·y.
    let flip = offsets([1; 3], |[_, y, _]| [0.0, -1.5 * y, 0.0]);
    let flat = offsets([1; 3], |[_, y, _]| [0.0, -y, 0.0]);
    for basis in BASES {
        let out = |offsets: &[[f32; 3]]| {
            DeformationLattice::new(UNIT, [1; 3], offsets, basis, Extrapolation::Hold)
                .unwrap()
                .deform(&random(40, [0.0, 1.0]), false)
        };
        assert_eq!((out(&flip).folded, out(&flip).min_determinant), (40, -0.5));
        assert_eq!((out(&flat).folded, out(&flat).min_determinant), (40, 0.0));
    }
}

#[test]
fn normals_stay_perpendicular_and_vectors_and_orientations_follow() {
    // Sheared: x + y, y, z. A face along x keeps its normal y; one along y rotates.
    let shear = DMat3::new(1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    let mut normals = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3]];
    map_normals(&mut normals, &[shear; 3]);
    let h = std::f32::consts::FRAC_1_SQRT_2;
    assert_eq!(normals, [[0.0, 1.0, 0.0], [h, -h, 0.0], [0.0; 3]]);
    let mut vectors = [[0.0, 2.0, 3.0]];
    map_vectors(&mut vectors, &[shear]);
    assert_eq!(vectors, [[2.0, 2.0, 3.0]]);
    // A quarter turn about z, and three times as large.
    let mut orientations = [[0.0, 0.0, 0.0, 1.0], [0.1, 0.2, 0.3, 0.4]];
    let quarter_turn = DMat3::new(0.0, -3.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 3.0);
    map_orientations(&mut orientations, &[quarter_turn, DMat3::zeros()]);
    assert!(orientations[0].iter().zip([0.0, 0.0, h, h]).all(|(a, b)| (a - b).abs() < 1e-6));
    assert_eq!(orientations[1], [0.1, 0.2, 0.3, 0.4], "the zero matrix has no nearest rotation");
}

#[test]
fn a_folded_surface_has_the_normal_of_its_winding() {
    // Mirrored in y, the faces still wound as they were: a × b = z becomes −z.
    let mirror = DMat3::from_diagonal(&DVec3::new(1.0, -1.0, 1.0));
    let mut normals = [[0.0, 0.0, 1.0]];
    map_normals(&mut normals, &[mirror]);
    assert_eq!(normals, [[0.0, 0.0, -1.0]]);
}

#[test]
fn scaling_everything_scales_the_result() {
    let (offsets, points) = (noisy([2; 3]), random(64, [-0.5, 1.5]));
    for size in [1.0 / 1024.0, 1024.0, 1e-30, 1e30] {
        for basis in BASES {
            let scaled = |rows: &[[f32; 3]]| rows.iter().map(|row| row.map(|x| x * size)).collect::<Vec<_>>();
            let one = DeformationLattice::new(UNIT, [2; 3], &offsets, basis, Extrapolation::Extend)
                .unwrap()
                .deform(&points, false);
            let large = scaled(&offsets);
            let corners = [[0.0; 3], [f64::from(size); 3]];
            let lattice = DeformationLattice::new(corners, [2; 3], &large, basis, Extrapolation::Extend).unwrap();
            let out = lattice.deform(&scaled(&points), false);
            for (a, b) in out.points.as_flattened().iter().zip(one.points.as_flattened()) {
                assert!((a / size - b).abs() < 1e-6);
            }
            assert_eq!(out.folded, one.folded);
        }
    }
}

#[test]
fn invalid_lattices_are_refused() {
    let offsets = vec![[0.0; 3]; 8];
    let lattice = |corners, divisions| {
        DeformationLattice::new(corners, divisions, &offsets, LatticeBasis::Bernstein, Extrapolation::Hold)
    };
    assert!(lattice(UNIT, [1; 3]).is_some());
    assert!(lattice(UNIT, [1, 1, 2]).is_none());
    assert!(lattice(UNIT, [7, 0, 0]).is_none());
    assert!(lattice([[0.0; 3], [1.0, 0.0, 1.0]], [1; 3]).is_none());
    assert!(lattice([[0.0; 3], [1.0, f64::NAN, 1.0]], [1; 3]).is_none());
    assert_eq!(control_points([usize::MAX, 1, 1]), None);
    assert_eq!(control_points([1 << 31; 3]), None);
    let none = DeformationLattice::new(UNIT, [1; 3], &offsets, LatticeBasis::Bernstein, Extrapolation::Hold)
        .unwrap()
        .deform(&[], true);
    assert_eq!((none.points.len(), none.min_determinant, none.folded), (0, 1.0, 0));
}

#[test]
fn every_path_and_any_number_of_threads_give_the_same_bits() {
    let points = random(10_001, [-0.4, 1.4]);
    for (basis, extrapolation) in
        [(LatticeBasis::Trilinear, Extrapolation::Extend), (LatticeBasis::Bernstein, Extrapolation::Hold)]
    {
        let offsets = noisy([4, 3, 2]);
        let lattice = DeformationLattice::new(UNIT, [4, 3, 2], &offsets, basis, extrapolation).unwrap();
        let one = lattice.deform_on(Path::BASELINE, &points, true);
        assert!(one.points.as_flattened().iter().all(|x| x.is_finite()));
        for path in Path::all() {
            for threads in [1, 2, 7] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                assert!(pool.install(|| lattice.deform_on(path, &points, true)) == one, "{path:?} {threads}");
            }
        }
        let alone: Vec<_> = points[..50].iter().map(|p| lattice.deform(&[*p], false).points[0]).collect();
        assert_eq!(alone, one.points[..50], "a point's bits do not depend on its neighbours");
    }
}
