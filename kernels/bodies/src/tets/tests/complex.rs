//! Delaunay complexes: by hand, then random, regular and degenerate.

use super::super::grid::{GridPoint, SIDE};
use super::super::{Delaunay, NONE, delaunay};
use super::{check, random, volume};
use numerics::random::Key;

#[test]
fn four_places_make_one_positive_tet() {
    for grid_points in [[[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]], [[0, 9, 0], [9, 0, 0], [0, 0, 0], [0, 0, 9]]] {
        let made = delaunay(&grid_points);
        assert_eq!(made.tets.len(), 1);
        assert_eq!(made.across, [[NONE; 4]]);
        check(&grid_points, &made);
    }
}

#[test]
fn a_place_beyond_a_face_adds_the_tet_on_it() {
    let grid_points = [[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9], [20, 20, 20]];
    let made = delaunay(&grid_points);
    check(&grid_points, &made);
    assert_eq!((made.tets.len(), volume(&grid_points, &made.tets)), (2, 9 * 9 * 60));
}

#[test]
fn a_place_within_a_tet_cuts_it_in_four() {
    let grid_points = [[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9], [2, 2, 2]];
    let made = delaunay(&grid_points);
    check(&grid_points, &made);
    assert_eq!((made.tets.len(), volume(&grid_points, &made.tets)), (4, 9 * 9 * 9));
}

#[test]
fn the_corners_of_a_cube_fill_it() {
    let grid_points: Vec<GridPoint> = (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(|bit| bit * SIDE)).collect();
    let made = delaunay(&grid_points);
    check(&grid_points, &made);
    assert!(made.tets.len() == 5 || made.tets.len() == 6);
    assert_eq!(volume(&grid_points, &made.tets), 6 * i128::from(SIDE).pow(3));
}

#[test]
fn random_places_of_any_spread_are_delaunay() {
    // Few bits make many places that are doubled, on planes and on spheres together.
    for (count, side) in [(5, SIDE), (50, 4), (500, 8), (3000, 1 << 10), (3000, SIDE)] {
        for seed in 0..4 {
            let grid_points = random(count, side, seed);
            check(&grid_points, &delaunay(&grid_points));
        }
    }
}

#[test]
fn a_grid_fills_its_hull_exactly() {
    for (n, pitch) in [(3, 1), (9, 1), (9, 1_048_573)] {
        let grid_points: Vec<GridPoint> =
            (0..n * n * n).map(|k| [k % n, k / n % n, k / n / n].map(|x| x * pitch)).collect();
        let made = delaunay(&grid_points);
        check(&grid_points, &made);
        assert_eq!(volume(&grid_points, &made.tets), 6 * i128::from((n - 1) * pitch).pow(3));
    }
}

#[test]
fn a_sphere_with_and_without_its_middle_is_delaunay() {
    // Whole points of x² + y² + z² = 3·35²: cospherical to the last bit, 4 and more to a face.
    let radius = 3 * 35 * 35;
    let mut grid_points: Vec<GridPoint> = Vec::new();
    for x in -61..=61 {
        for y in -61..=61_i32 {
            for z in -61..=61_i32 {
                if x * x + y * y + z * z == radius {
                    grid_points.push([x + 61, y + 61, z + 61]);
                }
            }
        }
    }
    assert!(grid_points.len() > 100);
    check(&grid_points, &delaunay(&grid_points));
    // The middle takes out all tets at once: a rim of hundreds of vertices.
    grid_points.push([61; 3]);
    check(&grid_points, &delaunay(&grid_points));
}

#[test]
fn flat_and_lined_up_and_heaped_places_have_no_tet() {
    let line: Vec<GridPoint> = (0..50).map(|k| [3 * k, 2 * k, k]).collect();
    let plane: Vec<GridPoint> = (0..50).map(|k| [k % 7, k / 7, k % 7 + 2 * (k / 7)]).collect();
    for grid_points in [vec![], vec![[1; 3]], vec![[1; 3]; 9], line, plane] {
        assert_eq!(delaunay(&grid_points), Delaunay::default());
    }
}

#[test]
fn the_first_places_may_lie_on_a_plane_and_the_last_doubled() {
    let mut grid_points: Vec<GridPoint> = (0..49).map(|k| [k % 7, k / 7, 0]).collect();
    grid_points.push([3, 3, 5]);
    grid_points.push([0, 0, 0]);
    let made = delaunay(&grid_points);
    check(&grid_points, &made);
    assert_eq!(made.doubled.len(), 1);
    assert_eq!(volume(&grid_points, &made.tets), 2 * 36 * 5);
}

#[test]
fn places_far_apart_and_close_together_are_delaunay() {
    let key = Key::new(3);
    // Clusters of a few steps at random places, and a needle of thousands of places on a line.
    let mut grid_points: Vec<GridPoint> = random(40, SIDE - 8, 1)
        .into_iter()
        .flat_map(|p| (0..20).map(move |k| p.map(|x| x + (key.of(k).of(x as u64).u64() % 8) as i32)))
        .collect();
    grid_points.extend((0..2000).map(|k| [8000 * k, 8000 * k, 5000 * k]));
    check(&grid_points, &delaunay(&grid_points));
}

#[test]
fn the_same_places_give_the_same_tets_and_all_orders_the_same_complex() {
    let grid_points = random(800, SIDE, 9);
    let made = delaunay(&grid_points);
    assert_eq!(made, delaunay(&grid_points));
    // No five of these are cospherical, so any order of the same places has the same tets.
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
