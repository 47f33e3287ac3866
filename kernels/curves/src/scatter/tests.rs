//! Tests of spreading points and growing curves.

use super::*;

/// The square 0…1 in x and z, facing up, as two triangles.
const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]];
const HALVES: [[u32; 3]; 2] = [[0, 2, 1], [0, 3, 2]];

fn positions_of(positions: &[[f32; 3]], triangles: &[[u32; 3]], points: &[SurfacePoint]) -> Vec<DVec3> {
    points.iter().map(|point| point.position(positions, triangles)).collect()
}

/// Distance of each position to the nearest other, in units of √(1 ÷ positions).
fn gaps(positions: &[DVec3]) -> Vec<f64> {
    let nearest = |i: usize| {
        let others = positions.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, other)| (*other - positions[i]).norm()).fold(f64::INFINITY, f64::min)
    };
    (0..positions.len()).map(|i| nearest(i) * (positions.len() as f64).sqrt()).collect()
}

#[test]
fn points_are_neither_close_together_nor_leave_gaps() {
    let square = ScatterSurface::new(&SQUARE, &HALVES);
    for count in [30, 100, 300, 1000, 3000] {
        let points = square.spread(count, Key::new(3));
        assert_eq!(points.len(), count);
        let positions = positions_of(&SQUARE, &HALVES, &points);
        let gaps = gaps(&positions);
        let least = gaps.iter().copied().fold(f64::INFINITY, f64::min);
        let mean = gaps.iter().sum::<f64>() / count as f64;
        assert!(least > 0.47 && mean > 0.71, "{count}: least {least}, mean {mean}");
        // The largest gap: 0.71 for a square lattice, 1.6 and more for random points.
        let lattice = (0..1600).map(|k| DVec3::new(f64::from(k % 40) / 39.0, 0.0, f64::from(k / 40) / 39.0));
        let farthest = lattice
            .map(|at| positions.iter().map(|position| (*position - at).norm()).fold(f64::INFINITY, f64::min))
            .fold(0.0, f64::max);
        assert!(farthest * (count as f64).sqrt() < 1.6, "{count}: {farthest}");
    }
}

#[test]
fn a_shorter_list_begins_a_longer_one() {
    let square = ScatterSurface::new(&SQUARE, &HALVES);
    let long = square.spread(2000, Key::new(1));
    for count in [0, 1, 7, 500, 1999] {
        assert_eq!(square.spread(count, Key::new(1)), long[..count]);
    }
}

#[test]
fn the_number_of_points_is_proportional_to_area() {
    let sphere = numerics::shapes::sphere([2.0; 3], 8);
    let positions: Vec<[f32; 3]> = sphere.points.iter().map(|p| p.map(|x| x as f32)).collect();
    let (mut triangles, mut first, mut ends) = (Vec::new(), 0, Vec::new());
    for (face, count) in sphere.counts.iter().enumerate() {
        let corners = &sphere.corners[first..first + *count as usize];
        triangles.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
        first += corners.len();
        if (face + 1) % 32 == 0 {
            ends.push(triangles.len());
        }
    }
    let whole = ScatterSurface::new(&positions, &triangles);
    let count = 20_000;
    let points = whole.spread(count, Key::new(9));
    let mut start = 0;
    for end in ends {
        let band = ScatterSurface::new(&positions, &triangles[start..end]);
        let expected = band.area() / whole.area() * count as f64;
        let found = points.iter().filter(|point| (start..end).contains(&(point.triangle as usize))).count() as f64;
        // The number of random points would deviate by √expected.
        assert!((found - expected).abs() < 1.2 * expected.sqrt(), "{found} of {expected}");
        start = end;
    }
}

#[test]
fn both_sides_of_a_thin_sheet_are_filled_equally() {
    let low = SQUARE.map(|p| [p[0], p[1] - 1e-3, p[2]]);
    let sheet = [SQUARE, low].concat();
    let triangles = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]];
    let points = ScatterSurface::new(&sheet, &triangles).spread(1000, Key::new(2));
    let above = points.iter().filter(|point| point.triangle < 2).count();
    assert!(above.abs_diff(500) < 20, "{above}");
    // Sides that face in the same direction count as one sheet: together they are as sparse as one.
    let doubled = [[0, 2, 1], [0, 3, 2], [4, 6, 5], [4, 7, 6]];
    let points = ScatterSurface::new(&sheet, &doubled).spread(1000, Key::new(2));
    let gaps = gaps(&positions_of(&sheet, &doubled, &points));
    // The area is counted twice, so the spacing is that of 500 points at least.
    assert!(gaps.iter().all(|gap| *gap > 0.42));
}

#[test]
fn any_number_of_threads_gives_the_same_points() {
    let runs = [1, 2, 7].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| ScatterSurface::new(&SQUARE, &HALVES).spread(3000, Key::new(5)))
    });
    assert_eq!(runs[0], runs[1]);
    assert_eq!(runs[0], runs[2]);
}

#[test]
fn a_scene_scaled_by_a_power_of_two_gets_the_same_points() {
    let points =
        |scale: f32| ScatterSurface::new(&SQUARE.map(|p| p.map(|x| x * scale)), &HALVES).spread(500, Key::new(5));
    let expected = points(1.0);
    for exponent in [-90, -10, 1, 20, 60] {
        let scale = f32::from_bits(((127 + exponent) as u32) << 23);
        assert!(points(scale) == expected, "2^{exponent}");
    }
}

#[test]
fn a_surface_without_area_gets_no_points() {
    assert!(ScatterSurface::new(&[], &[]).spread(10, Key::new(0)).is_empty());
    let line = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    assert!(ScatterSurface::new(&line, &[[0, 1, 2]]).spread(10, Key::new(0)).is_empty());
    // Among others, triangles without area get no points.
    let triangles = [[0, 0, 1], [0, 2, 1], [1, 1, 1], [0, 3, 2], [2, 2, 0]];
    let points = ScatterSurface::new(&SQUARE, &triangles).spread(500, Key::new(0));
    assert_eq!(points.len(), 500);
    assert!(points.iter().all(|point| [1, 3].contains(&point.triangle)));
}

#[test]
fn a_stray_point_far_away_changes_nothing() {
    let stray = [SQUARE.to_vec(), vec![[-1e30; 3]]].concat();
    let points = |positions: &[[f32; 3]]| ScatterSurface::new(positions, &HALVES).spread(300, Key::new(4));
    assert_eq!(points(&stray), points(&SQUARE));
}

#[test]
fn weights_are_barycentric() {
    for point in ScatterSurface::new(&SQUARE, &HALVES).spread(1000, Key::new(8)) {
        assert!(point.weights.iter().all(|weight| (0.0..=1.0).contains(weight)));
        assert!((point.weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }
}

fn blade(lean: f32, around: f32) -> Blade {
    Blade { root: SurfacePoint { triangle: 0, weights: [0.25, 0.5, 0.25] }, length: 2.0, lean, around }
}

fn grown(positions: &[[f32; 3]], blade: Blade, cvs: usize) -> Vec<[f32; 3]> {
    grow(positions, &HALVES, &vertex_normals(positions, &HALVES), &[blade], cvs)
}

#[track_caller]
fn assert_close(found: &[[f32; 3]], expected: &[[f32; 3]]) {
    assert_eq!(found.len(), expected.len());
    let off = found.as_flattened().iter().zip(expected.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(off < 1e-6, "{found:?} is not {expected:?}");
}

#[test]
fn without_lean_a_blade_is_along_the_normal() {
    // Corners (0,0), (1,1), (1,0) by ¼, ½, ¼: the root is at (0.75, 0.5).
    let expected = [[0.75, 0.0, 0.5], [0.75, 1.0, 0.5], [0.75, 2.0, 0.5]];
    assert_close(&grown(&SQUARE, blade(0.0, 1.0), 3), &expected);
}

#[test]
fn the_direction_of_lean_is_measured_from_the_first_edge_about_the_normal() {
    let right = std::f32::consts::FRAC_PI_2;
    let h = std::f32::consts::FRAC_1_SQRT_2;
    // The first edge runs along (1, 0, 1).
    assert_close(&grown(&SQUARE, blade(right, 0.0), 2)[1..], &[[0.75 + 2.0 * h, 0.0, 0.5 + 2.0 * h]]);
    // A quarter turn about y brings it to (1, 0, −1).
    assert_close(&grown(&SQUARE, blade(right, right), 2)[1..], &[[0.75 + 2.0 * h, 0.0, 0.5 - 2.0 * h]]);
}

#[test]
fn blades_move_and_rotate_with_their_triangle() {
    // A quarter turn about z, then up by 5: x → y, y → −x.
    let turn = |p: &[f32; 3]| [-p[1], p[0] + 5.0, p[2]];
    let still = grown(&SQUARE, blade(0.7, 2.0), 4);
    let moved = grown(&SQUARE.map(|p| turn(&p)), blade(0.7, 2.0), 4);
    assert_close(&moved, &still.iter().map(turn).collect::<Vec<_>>());
}

#[test]
fn a_blade_on_a_triangle_without_area_is_upright() {
    let flat = [[1.0, 2.0, 3.0]; 4];
    assert_close(&grown(&flat, blade(0.0, 0.0), 2), &[[1.0, 2.0, 3.0], [1.0, 4.0, 3.0]]);
    assert!(grown(&flat, blade(0.4, 0.3), 5).as_flattened().iter().all(|x| x.is_finite()));
}

#[test]
fn normals_of_points_are_weighted_by_area() {
    // A big triangle facing y and one of half its area facing x share an edge along z.
    let positions = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, -1.0, 0.0], [9.0; 3]];
    let normals = vertex_normals(&positions, &[[0, 1, 2], [0, 3, 1]]);
    let (y, x) = (2.0 / 5.0_f64.sqrt(), -1.0 / 5.0_f64.sqrt());
    assert!((normals[0][0] - x).abs() < 1e-15 && (normals[0][1] - y).abs() < 1e-15, "{normals:?}");
    assert_eq!(normals[2], DVec3::y());
    assert_eq!(normals[4], DVec3::zeros());
}
