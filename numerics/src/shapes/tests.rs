//! Shapes are closed, face outward and fill the size asked for.

use super::*;
use crate::vector::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Triangles of all faces, fanned.
fn triangles(shape: &Polygons) -> Vec<[DVec3; 3]> {
    let mut found = Vec::new();
    let mut first = 0;
    for count in &shape.counts {
        let face = &shape.corners[first..first + *count as usize];
        found.extend(
            (1..face.len() - 1).map(|k| [face[0], face[k], face[k + 1]].map(|c| shape.points[c as usize].into())),
        );
        first += face.len();
    }
    found
}

/// Signed: positive where faces look outwards.
fn volume(shape: &Polygons) -> f64 {
    triangles(shape).iter().map(|[a, b, c]| a.dot(&b.cross(c)) / 6.0).sum()
}

fn area(shape: &Polygons) -> f64 {
    triangles(shape).iter().map(|[a, b, c]| (b - a).cross(&(c - a)).norm()).sum::<f64>() / 2.0
}

/// Number of directed edges that do not have exactly one counterpart: 0 for a closed surface.
fn open_edges(shape: &Polygons) -> usize {
    let mut walks: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    let mut first = 0;
    for count in &shape.counts {
        let face = &shape.corners[first..first + *count as usize];
        for k in 0..face.len() {
            *walks.entry([face[k], face[(k + 1) % face.len()]]).or_default() += 1;
        }
        first += face.len();
    }
    walks.iter().filter(|([a, b], count)| a == b || **count != 1 || walks.get(&[*b, *a]) != Some(&1)).count()
}

fn euler(shape: &Polygons) -> i64 {
    let (points, faces, walks) = (shape.points.len(), shape.counts.len(), shape.corners.len());
    points as i64 - walks as i64 / 2 + faces as i64
}

fn bounds(shape: &Polygons) -> [[f64; 3]; 2] {
    let low = (0..3).map(|k| shape.points.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min));
    let high = (0..3).map(|k| shape.points.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max));
    [low.collect::<Vec<_>>().try_into().unwrap(), high.collect::<Vec<_>>().try_into().unwrap()]
}

/// All solids of a size, with their Euler characteristic.
fn solids(size: [f64; 3], n: usize) -> Vec<(&'static str, Polygons, i64)> {
    vec![
        ("block", block(size, [n; 3]), 2),
        ("slab", block(size, [n, 1, n + 2]), 2),
        ("sphere", sphere(size, n), 2),
        ("cylinder", cylinder(size, n), 2),
        ("capsule", capsule(size, n), 2),
        ("torus", torus(size, n), 0),
        ("bowl", bowl(size, 0.05, n).unwrap(), 2),
    ]
}

#[test]
fn solids_are_closed_face_outwards_and_fill_their_bounds_exactly() {
    for size in [[1.0, 1.0, 1.0], [0.3, 1.7, 2.1], [4.0, 0.2, 1.1], [0.7, 0.3, 0.9]] {
        for n in [1, 2, 3, 7, 16] {
            for (name, shape, characteristic) in solids(size, n) {
                let what = format!("{name} of {size:?} with {n}");
                assert_eq!(open_edges(&shape), 0, "{what}");
                assert_eq!(euler(&shape), characteristic, "{what}");
                assert!(volume(&shape) > 0.0, "{what}");
                assert_eq!(bounds(&shape), [size.map(|x| -0.5 * x), size.map(|x| 0.5 * x)], "{what}");
                assert!(shape.corners.iter().all(|corner| (*corner as usize) < shape.points.len()), "{what}");
            }
        }
    }
}

#[test]
fn no_coordinate_is_negative_zero() {
    for (name, shape, _) in solids([1.0, 2.0, 3.0], 4) {
        assert!(shape.points.as_flattened().iter().all(|x| *x != 0.0 || x.is_sign_positive()), "{name}");
    }
}

#[test]
fn a_block_has_its_own_volume_and_area() {
    let shape = block([2.0, 3.0, 5.0], [4, 2, 3]);
    assert!((volume(&shape) - 30.0).abs() < 1e-12);
    assert!((area(&shape) - 62.0).abs() < 1e-12);
    // 2·(4·2 + 2·3 + 4·3) quads.
    assert_eq!((shape.counts.len(), shape.points.len()), (52, 54));
}

#[test]
fn a_cylinder_is_a_prism_of_four_n_sides() {
    for n in [1, 5, 16] {
        let sides = (4 * n) as f64;
        let base = sides / 2.0 * 0.25 * libm::sin(2.0 * PI / sides);
        let side = sides * 2.0 * libm::sin(PI / sides) * 0.5 * 3.0;
        let shape = cylinder([1.0, 3.0, 1.0], n);
        assert!((volume(&shape) - 3.0 * base).abs() < 1e-12, "{n}");
        assert!((area(&shape) - (2.0 * base + side)).abs() < 1e-12, "{n}");
    }
}

/// A shape, and the volume and area that it approaches.
type Limiting = (&'static str, fn(usize) -> Polygons, f64, f64);

#[test]
fn round_shapes_approach_their_closed_forms_by_order_two() {
    let ball = |r: f64| (4.0 / 3.0 * PI * r * r * r, 4.0 * PI * r * r);
    let (r, thin) = (0.5, 0.4);
    let tube = 2.0 * PI * 0.4;
    let shapes: [Limiting; 4] = [
        ("sphere", |n| sphere([1.0; 3], n), ball(r).0, ball(r).1),
        ("capsule", |n| capsule([1.0, 3.0, 1.0], n), ball(r).0 + 2.0 * PI * r * r, ball(r).1 + 4.0 * PI * r),
        ("torus", |n| torus([1.0, 0.2, 1.0], n), tube * PI * 0.01, tube * 2.0 * PI * 0.1),
        (
            "bowl",
            |n| bowl([1.0, 0.5, 1.0], 0.1, n).unwrap(),
            (ball(r).0 - ball(thin).0) / 2.0,
            (ball(r).1 + ball(thin).1) / 2.0 + PI * (r * r - thin * thin),
        ),
    ];
    for (name, make, whole, surface) in shapes {
        let errors = [8, 16, 32].map(|n| [1.0 - volume(&make(n)) / whole, 1.0 - area(&make(n)) / surface]);
        for k in 0..2 {
            assert!(errors[2][k] > 0.0 && errors[2][k] < 1e-2, "{name}: {errors:?}");
            for pair in errors.windows(2) {
                assert!((3.6..4.4).contains(&(pair[0][k] / pair[1][k])), "{name}: {errors:?}");
            }
        }
    }
}

#[test]
fn corners_of_a_sphere_lie_on_it() {
    for [x, y, z] in sphere([2.0, 4.0, 6.0], 9).points {
        assert!((x * x + y * y / 4.0 + z * z / 9.0 - 1.0).abs() < 1e-14);
    }
}

#[test]
fn one_quad_a_quarter_makes_an_octahedron() {
    let shape = sphere([2.0; 3], 1);
    assert_eq!(shape.counts, [3; 8]);
    let expected =
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]];
    assert_eq!(shape.points, expected);
}

#[test]
fn a_grid_faces_up_and_is_open_at_its_border() {
    let shape = grid([2.0, 4.0], 3);
    assert_eq!((shape.counts.len(), shape.points.len()), (9, 16));
    assert!((area(&shape) - 8.0).abs() < 1e-12);
    assert!(triangles(&shape).iter().all(|[a, b, c]| (b - a).cross(&(c - a)).y > 0.0));
    assert_eq!(open_edges(&shape), 12);
    assert_eq!(bounds(&shape), [[-1.0, 0.0, -2.0], [1.0, 0.0, 2.0]]);
}

#[test]
fn a_low_torus_has_a_round_tube_and_a_high_one_keeps_its_hole() {
    // Around (0.4, 0), 0.1 from it.
    for [x, y, z] in torus([1.0, 0.2, 1.0], 4).points {
        let out = (x * x + z * z).sqrt() - 0.4;
        assert!((out * out + y * y - 0.01).abs() < 1e-14);
    }
    let hole = torus([1.0; 3], 4).points.iter().map(|[x, _, z]| x * x + z * z).fold(f64::INFINITY, f64::min).sqrt();
    assert!((hole - 1.0 / 6.0).abs() < 1e-14, "{hole}");
}

#[test]
fn a_capsule_too_short_for_a_side_is_a_sphere() {
    assert_eq!(capsule([1.0; 3], 4), sphere([1.0; 3], 4));
    assert_eq!(capsule([1.0, 0.5, 1.0], 4), sphere([1.0, 0.5, 1.0], 4));
    assert_eq!(open_edges(&capsule([1.0, 1.0 + 1e-12, 1.0], 3)), 0);
}

#[test]
fn a_bowl_needs_a_hollow() {
    let size = [1.0, 0.3, 1.0];
    assert!(bowl(size, 0.29, 4).is_some());
    for thickness in [0.3, 1.0, 0.0, -1.0, f64::NAN] {
        assert!(bowl(size, thickness, 4).is_none(), "{thickness}");
    }
}

#[test]
fn an_icosphere_is_closed_and_its_volume_approaches_the_balls_by_order_two() {
    let ball = |times| 4.0 / 3.0 * PI * 8.0 - volume(&icosphere(2.0, times));
    for times in 0..4 {
        let sphere = icosphere(2.0, times);
        assert_eq!(sphere.counts.len(), 20 << (2 * times));
        assert_eq!((open_edges(&sphere), euler(&sphere)), (0, 2), "{times}");
        assert!(sphere.points.iter().all(|p| (DVec3::from(*p).norm() - 2.0).abs() < 1e-12));
    }
    let order = libm::log2(ball(3) / ball(4));
    assert!((order - 2.0).abs() < 0.05, "{order}");
}
