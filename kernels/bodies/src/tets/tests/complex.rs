//! Delaunay tetrahedralisations: by hand, random, regular and degenerate.

use super::super::grid::{GridPoint, SIDE};
use super::super::{Delaunay, NONE, delaunay};
use super::{check, random, volume};
use numerics::random::Key;

#[test]
fn four_points_make_one_positive_tet() {
    for grid_points in [[[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]], [[0, 9, 0], [9, 0, 0], [0, 0, 0], [0, 0, 9]]] {
        let made = delaunay(&grid_points);
        assert_eq!(made.tets.len(), 1);
        assert_eq!(made.across, [[NONE; 4]]);
        check(&grid_points, &made);
    }
}

#[test]
fn a_point_beyond_a_face_adds_a_tet_on_it() {
    let grid_points = [[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9], [20, 20, 20]];
    let made = delaunay(&grid_points);
    check(&grid_points, &made);
    assert_eq!((made.tets.len(), volume(&grid_points, &made.tets)), (2, 9 * 9 * 60));
}

#[test]
fn a_point_inside_a_tet_splits_it_in_four() {
    let grid_points = [[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9], [2, 2, 2]];
    let made = delaunay(&grid_points);
    check(&grid_points, &made);
    assert_eq!((made.tets.len(), volume(&grid_points, &made.tets)), (4, 9 * 9 * 9));
}

#[test]
fn the_corners_of_a_cube_fill_the_cube() {
    let grid_points: Vec<GridPoint> = (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(|bit| bit * SIDE)).collect();
    let made = delaunay(&grid_points);
    check(&grid_points, &made);
    assert!(made.tets.len() == 5 || made.tets.len() == 6);
    assert_eq!(volume(&grid_points, &made.tets), 6 * i128::from(SIDE).pow(3));
}

#[test]
fn random_points_are_delaunay_at_any_spread() {
    // Few bits give many points that are duplicate, coplanar and cospherical at once.
    for (count, side) in [(5, SIDE), (50, 4), (500, 8), (3000, 1 << 10), (3000, SIDE)] {
        for seed in 0..4 {
            let grid_points = random(count, side, seed);
            check(&grid_points, &delaunay(&grid_points));
        }
    }
}

#[test]
fn a_regular_grid_fills_its_hull_exactly() {
    for (n, pitch) in [(3, 1), (9, 1), (9, 1_048_573)] {
        let grid_points: Vec<GridPoint> =
            (0..n * n * n).map(|k| [k % n, k / n % n, k / n / n].map(|x| x * pitch)).collect();
        let made = delaunay(&grid_points);
        check(&grid_points, &made);
        assert_eq!(volume(&grid_points, &made.tets), 6 * i128::from((n - 1) * pitch).pow(3));
    }
}

#[test]
fn cospherical_points_are_delaunay_with_and_without_the_centre() {
    // Integer points with x² + y² + z² = 3·35²: exactly cospherical, four and more to a face.
    let radius = 3 * 35 * 35;
    let mut grid_points: Vec<GridPoint> = Vec::new();
    for x in -61..=61 {
        for y in -61..=61_i32 {
            for z in -61..=61_i32 {
                if [x, y, z].iter().map(|x| x * x).sum::<i32>() == radius {
                    grid_points.push([x + 61, y + 61, z + 61]);
                }
            }
        }
    }
    assert!(grid_points.len() > 100);
    check(&grid_points, &delaunay(&grid_points));
    // The centre removes all tets at once: a cavity with hundreds of boundary vertices.
    grid_points.push([61; 3]);
    check(&grid_points, &delaunay(&grid_points));
}

#[test]
fn coplanar_collinear_and_coinciding_points_have_no_tets() {
    let line: Vec<GridPoint> = (0..50).map(|k| [3 * k, 2 * k, k]).collect();
    let plane: Vec<GridPoint> = (0..50).map(|k| [k % 7, k / 7, k % 7 + 2 * (k / 7)]).collect();
    for grid_points in [vec![], vec![[1; 3]], vec![[1; 3]; 9], line, plane] {
        assert_eq!(delaunay(&grid_points), Delaunay::default());
    }
}

#[test]
fn leading_points_may_be_coplanar_and_later_ones_duplicate() {
    let mut grid_points: Vec<GridPoint> = (0..49).map(|k| [k % 7, k / 7, 0]).collect();
    grid_points.push([3, 3, 5]);
    grid_points.push([0, 0, 0]);
    let made = delaunay(&grid_points);
    check(&grid_points, &made);
    assert_eq!(made.doubled.len(), 1);
    assert_eq!(volume(&grid_points, &made.tets), 2 * 36 * 5);
}

#[test]
fn clustered_and_collinear_points_are_delaunay() {
    let key = Key::new(3);
    // Clusters a few steps wide at random positions, and a needle of thousands of collinear points.
    let mut grid_points: Vec<GridPoint> = random(40, SIDE - 8, 1)
        .into_iter()
        .flat_map(|p| (0..20).map(move |k| p.map(|x| x + (key.of(k).of(x as u64).u64() % 8) as i32)))
        .collect();
    grid_points.extend((0..2000).map(|k| [8000 * k, 8000 * k, 5000 * k]));
    check(&grid_points, &delaunay(&grid_points));
}

#[test]
fn the_same_points_give_the_same_tets_in_any_order() {
    let grid_points = random(800, SIDE, 9);
    let made = delaunay(&grid_points);
    assert_eq!(made, delaunay(&grid_points));
    // No five of these are cospherical, so any order gives the same tets.
    let reversed: Vec<GridPoint> = grid_points.iter().rev().copied().collect();
    let named = |tets: &[[u32; 4]], name: &dyn Fn(u32) -> u32| {
        let sorted = |tet: &[u32; 4]| {
            let mut tet = tet.map(name);
            tet.sort_unstable();
            tet
        };
        let mut tets: Vec<_> = tets.iter().map(sorted).collect();
        tets.sort_unstable();
        tets
    };
    let last = grid_points.len() as u32 - 1;
    assert_eq!(named(&made.tets, &|k| k), named(&delaunay(&reversed).tets, &|k| last - k));
}
