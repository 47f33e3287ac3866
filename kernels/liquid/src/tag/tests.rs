//! Linear functions, sides, continuity, bounds, hostile points.

use numerics::random::Key;
use numerics::vector::{add, dot, length, scale, sub};

use super::*;

const SPACING: f32 = 0.1;

/// About a point each square of [`SPACING`], scattered over 2 × 2 at height `z`.
fn sheet(z: f32, key: u64) -> Vec<Vec3> {
    let key = Key::new(key);
    let cells = (0..20).flat_map(|y| (0..20).map(move |x| [x, y]));
    let place = |[x, y]: [u64; 2]| {
        let at = |axis: u64, cell: u64| (cell as f32 + key.of(x).of(y).of(axis).f32()) * SPACING;
        [at(0, x), at(1, y), z]
    };
    cells.map(place).collect()
}

/// A grid of places between the rims of such a sheet.
fn places(z: f32, from: f32, to: f32) -> Vec<Vec3> {
    let at = |n: u32| from + (to - from) * n as f32 / 30.0;
    (0..=30).flat_map(|y| (0..=30).map(move |x| [at(x), at(y), z])).collect()
}

fn linear(p: Vec3) -> f32 {
    dot(p, [0.5, -0.25, 0.3]) + 1.0
}

fn values(points: &[Vec3], value: impl Fn(Vec3) -> f32) -> Vec<f32> {
    points.iter().map(|p| value(*p)).collect()
}

fn tag(source: &TagSource<'_>, places: &[Vec3], normals: Option<&[Vec3]>, radius: f64, rows: &[f32]) -> TaggedPlaces {
    source.tag(places, normals, radius, &[TagValues { rows, width: 1 }])
}

#[test]
fn the_radius_of_a_sheet_is_two_spacings() {
    let points = sheet(0.0, 1);
    let radius = TagSource::new(&points, None).suitable_radius();
    assert!((1.8..2.2).contains(&(radius / f64::from(SPACING))), "{radius}");
    let twice: Vec<Vec3> = points.iter().map(|p| scale(*p, 2.0)).collect();
    assert!((TagSource::new(&twice, None).suitable_radius() / radius - 2.0).abs() < 1e-6);
    for points in [&points[..0], &points[..1], &[[1.0; 3]; 30]] {
        assert_eq!(TagSource::new(points, None).suitable_radius().to_bits(), 0);
    }
}

#[test]
fn a_linear_function_is_reproduced_up_to_the_rim() {
    let points = sheet(0.0, 2);
    let source = TagSource::new(&points, None);
    let radius = source.suitable_radius();
    let places = places(0.0, 0.02, 1.98);
    let tagged = tag(&source, &places, None, radius, &values(&points, linear));
    assert_eq!(tagged.far, 0);
    // The mean alone is off by 1e-2, at the rim by 4e-2. In a corner even the fit is limited.
    let rim = |x: f32| !(0.2..1.8).contains(&x);
    for (place, value) in places.iter().zip(&tagged.rows[0]).filter(|(p, _)| !rim(p[0]) || !rim(p[1])) {
        assert!((value - linear(*place)).abs() < 4e-3, "{place:?}: {value} {}", linear(*place));
    }
}

#[test]
fn a_constant_stays_to_the_bit_and_a_value_within_the_range() {
    let points = sheet(0.0, 3);
    let source = TagSource::new(&points, None);
    let places = places(0.05, -0.5, 2.5);
    let colour: Vec<f32> = points.iter().flat_map(|_| [0.62, 0.09, 0.04]).collect();
    let steps = values(&points, |p| if p[0] < 1.0 { -1.0 } else { 3.0 });
    let attributes = [TagValues { rows: &colour, width: 3 }, TagValues { rows: &steps, width: 1 }];
    let tagged = source.tag(&places, None, 0.2, &attributes);
    assert!(tagged.far > 0 && tagged.far < places.len());
    assert!(tagged.rows[0].chunks(3).all(|row| row == [0.62, 0.09, 0.04]));
    assert_eq!(tagged.rows[1].len(), places.len());
    assert!(tagged.rows[1].iter().all(|x| (-1.0..=3.0).contains(x)));
    for (place, value) in places.iter().zip(&tagged.rows[1]) {
        if (place[0] - 1.0).abs() > 0.2 {
            assert_eq!(*value, if place[0] < 1.0 { -1.0 } else { 3.0 }, "{place:?}");
        }
    }
}

#[test]
fn both_sides_of_a_thin_sheet_keep_their_own_values() {
    let [low, high] = [sheet(0.0, 4), sheet(0.02, 5)];
    let points = [low.clone(), high.clone()].concat();
    let up = |n: usize| if n < low.len() { [0.0, 0.0, -2.0] } else { [0.0, 0.0, 0.5] };
    let normals: Vec<Vec3> = (0..points.len()).map(up).collect();
    let rows: Vec<f32> = (0..points.len()).map(|n| if n < low.len() { 0.0 } else { 1.0 }).collect();
    let source = TagSource::new(&points, Some(&normals));
    let places = places(0.01, 0.1, 1.9);
    for (facing, value) in [(-1.0, 0.0), (1.0, 1.0)] {
        let facing = vec![[0.0, 0.0, facing]; places.len()];
        let tagged = tag(&source, &places, Some(&facing), 0.2, &rows);
        assert_eq!((tagged.far, &tagged.rows[0]), (0, &vec![value; places.len()]));
    }
    let both = tag(&source, &places, None, 0.2, &rows);
    assert!(both.rows[0].iter().all(|x| (0.1..0.9).contains(x)));
}

#[test]
fn values_change_continuously_where_points_come_and_go() {
    let mut points = sheet(0.0, 6);
    let rows: Vec<f32> = (0..points.len() as u64).map(|n| Key::new(7).of(n).f32()).collect();
    let place = [1.0, 1.0, 0.0];
    let (far, count) = (points.len() - 1, 4000_u32);
    let mut before: Option<f32> = None;
    // A point passes the place, from beyond the radius to beyond it.
    for n in 0..count {
        points[far] = [0.75 + 0.5 * n as f32 / count as f32, 1.02, 0.0];
        let source = TagSource::new(&points, None);
        let value = tag(&source, &[place], None, 0.2, &rows).rows[0][0];
        if let Some(before) = before {
            assert!((value - before).abs() < 2e-3, "{n}: {before} to {value}");
        }
        before = Some(value);
    }
}

#[test]
fn a_lone_point_and_a_second_one_that_comes_give_no_jump() {
    let rows = [0.0, 1.0];
    let place = [0.0; 3];
    let at = |second: f32| {
        let points = [[0.05, 0.0, 0.0], [second, 0.0, 0.0]];
        tag(&TagSource::new(&points, None), &[place], None, 0.1, &rows).rows[0][0]
    };
    assert_eq!(at(0.11), 0.0);
    let (mut before, mut largest) = (0.0, 0.0_f32);
    for n in 0..=1000 {
        let value = at(0.1 - 1e-5 * n as f32);
        largest = largest.max((value - before).abs());
        before = value;
    }
    assert!(largest < 1e-2, "{largest}");
}

#[test]
fn far_places_take_the_nearest_of_their_side() {
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [1.1, 0.0, 0.0]];
    let normals = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]];
    let source = TagSource::new(&points, Some(&normals));
    let places = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [1.0, 0.0, 0.0]];
    let up = [[0.0, 0.0, 1.0]; 3];
    let tagged = tag(&source, &places, Some(&up), 0.05, &[1.0, 2.0, 3.0]);
    assert_eq!((tagged.far, &tagged.rows[0][..]), (3, &[1.0, 3.0, 3.0][..]));
    let tagged = tag(&source, &places, None, 0.05, &[1.0, 2.0, 3.0]);
    assert_eq!((tagged.far, &tagged.rows[0][..]), (2, &[1.0, 2.0, 2.0][..]));
    let none = TagSource::new(&[], None).tag(&places, None, 1.0, &[TagValues { rows: &[], width: 3 }]);
    assert_eq!((none.far, &none.rows[0][..]), (3, &[0.0; 9][..]));
}

#[test]
fn a_turn_and_the_scale_do_not_matter() {
    let points = sheet(0.0, 8);
    let rows: Vec<f32> = (0..points.len() as u64).map(|n| Key::new(9).of(n).f32()).collect();
    let places = places(0.0, 0.0, 2.0);
    let plain = tag(&TagSource::new(&points, None), &places, None, 0.2, &rows);
    let moved = |p: &Vec3| {
        let [x, y, z] = scale(*p, 64.0);
        add([-y, x, z], [16.0, -8.0, 4.0])
    };
    let [points, places] = [&points, &places].map(|list| list.iter().map(moved).collect::<Vec<_>>());
    let turned = tag(&TagSource::new(&points, None), &places, None, 64.0 * 0.2, &rows);
    for (a, b) in plain.rows[0].iter().zip(&turned.rows[0]) {
        assert!((a - b).abs() < 1e-4, "{a} {b}");
    }
}

#[test]
fn hostile_points_give_finite_values() {
    let base = sheet(0.0, 10);
    let rows: Vec<f32> = (0..base.len()).map(|n| if n % 2 == 0 { f32::MAX } else { f32::MIN }).collect();
    for size in [1e-42, 1e-30, 1e30, 1e38] {
        let points: Vec<Vec3> = base.iter().map(|p| scale(sub(*p, [1.0, 1.0, 0.0]), size)).collect();
        let source = TagSource::new(&points, None);
        for radius in [0.0, 1e-300, source.suitable_radius(), 1e30, f64::from(f32::MAX)] {
            let tagged = tag(&source, &points[..40], None, radius, &rows);
            assert!(tagged.rows[0].iter().all(|x| x.is_finite()), "{size} {radius}");
        }
    }
    let far: Vec<Vec3> = base.iter().map(|p| add(*p, [1e7, 0.0, 0.0])).collect();
    let source = TagSource::new(&far, None);
    let tagged = tag(&source, &far, None, source.suitable_radius(), &vec![0.25; far.len()]);
    assert!(tagged.rows[0].iter().all(|x| *x == 0.25) && length(far[0]) > 9e6);
}
