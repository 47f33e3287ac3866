use super::*;
use std::collections::BTreeSet;

/// Cells of a ragged shape: two drops, a bar and single cells, on both sides of 0.
fn ragged() -> Vec<Cell> {
    let ball =
        |cell: Cell, centre: Cell, r2: i32| (0..3).map(|axis| (cell[axis] - centre[axis]).pow(2)).sum::<i32>() < r2;
    let mut cells = vec![[-9, 3, 2], [9, -9, -9]];
    for z in -8..8 {
        for y in -8..8 {
            for x in -8..8 {
                let cell = [x, y, z];
                if ball(cell, [-4, -3, 0], 10) || ball(cell, [4, 3, 1], 14) || (y, z) == (6, -6) && x % 3 != 0 {
                    cells.push(cell);
                }
            }
        }
    }
    cells
}

fn set(rows: &CellRows) -> BTreeSet<Cell> {
    rows.iter().collect()
}

fn near(cells: &[Cell], by: i32) -> BTreeSet<Cell> {
    let steps = || -by..=by;
    let around = |c: &Cell| {
        let c = *c;
        steps().flat_map(move |z| steps().flat_map(move |y| steps().map(move |x| [c[0] + x, c[1] + y, c[2] + z])))
    };
    cells.iter().flat_map(around).collect()
}

#[test]
fn rows_hold_exactly_the_cells_of_the_list() {
    let cells = ragged();
    let rows = CellRows::from_cells(&cells);
    assert_eq!(set(&rows), cells.iter().copied().collect());
    assert_eq!(rows.len(), set(&rows).len());
    for (at, cell) in rows.iter().enumerate() {
        assert_eq!(rows.find(cell), Some(at));
    }
    for cell in near(&cells, 2) {
        assert_eq!(rows.find(cell).is_some(), cells.contains(&cell), "{cell:?}");
    }
    assert_eq!(rows.bounds(), Some(([-9, -9, -9], [10, 7, 5])));
}

/// Cells of spans, of the gaps between them and beyond, in orders that make a finder forget and remember.
#[test]
fn a_finder_finds_what_is_stored_and_nothing_else() {
    let cells = ragged();
    let rows = CellRows::from_cells(&cells);
    let mut asked: Vec<_> = near(&cells, 3).into_iter().chain([[i32::MIN, 0, 0], [i32::MAX, 3, 1]]).collect();
    for turn in 0..3 {
        let finder = Finder::new(&rows);
        for cell in &asked {
            assert_eq!(finder.find(*cell), rows.find(*cell), "{turn} {cell:?}");
        }
        let third = asked.len() / 3;
        asked.rotate_left(third);
        asked.sort_by_key(|[x, y, z]| (x % 11, z * turn, *y));
    }
}

#[test]
fn dilated_rows_hold_the_cells_nearby_and_spans_never_touch() {
    let cells = ragged();
    for by in [0, 1, 3] {
        let rows = CellRows::from_cells(&cells).dilated(by);
        assert_eq!(set(&rows), near(&cells, by), "{by}");
        for (_, spans) in rows.rows() {
            assert!(spans.windows(2).all(|pair| pair[0].end < pair[1].start), "{spans:?}");
        }
    }
}

#[test]
fn unions_clips_filters_and_halves_are_those_of_sets() {
    let cells = ragged();
    let rows = CellRows::from_cells(&cells);
    let block = CellRows::cuboid([-2, -3, -20], [3, 9, 1]);
    assert_eq!(set(&rows.union(&block)), &set(&rows) | &set(&block));
    assert_eq!(set(&block.union(&rows)), &set(&rows) | &set(&block));
    assert_eq!(set(&rows.clipped([-2, -3, -20], [3, 9, 1])), &set(&rows) & &set(&block));
    let odd = rows.filtered(|[x, y, z], at| {
        assert_eq!(rows.find([x, y, z]), Some(at));
        (x + y + z) % 2 != 0
    });
    assert_eq!(set(&odd), cells.iter().copied().filter(|c| c.iter().sum::<i32>() % 2 != 0).collect());
    assert_eq!(set(&rows.halved()), cells.iter().map(|cell| cell.map(|n| n.div_euclid(2))).collect());
}

#[test]
fn values_follow_their_cells_to_other_rows() {
    let rows = CellRows::from_cells(&ragged());
    let other = CellRows::cuboid([-5, -5, -5], [5, 5, 5]);
    let number = |cell: Cell| cell[0] + 100 * cell[1] + 10_000 * cell[2];
    let field: Vec<i32> = other.iter().map(number).collect();
    let moved = rows.resampled(&other, &field, -1);
    for (cell, value) in rows.iter().zip(moved) {
        assert_eq!(value, if other.find(cell).is_some() { number(cell) } else { -1 });
    }
}

#[test]
fn no_cells_make_no_rows() {
    let none = CellRows::from_cells(&[]);
    assert!(none.is_empty() && none.bounds().is_none() && none.iter().next().is_none());
    assert_eq!(none.find([0; 3]), None);
    assert!(none.dilated(3).is_empty() && none.halved().is_empty());
    let block = CellRows::cuboid([0; 3], [2; 3]);
    assert_eq!((none.union(&block), block.union(&none)), (block.clone(), block));
}

#[test]
fn cells_around_within_a_box_are_those_around_that_it_holds() {
    let rows = CellRows::from_cells(&[[0, 0, 0], [5, 2, -3], [6, 2, -3], [9, 9, 9]]);
    for (low, high) in [([-2, -1, -4], [7, 4, 2]), ([3, 3, 3], [12, 12, 12]), ([30, 0, 0], [40, 9, 9])] {
        for by in [0, 1, 3] {
            assert_eq!(rows.dilated_within(by, low, high), rows.dilated(by).clipped(low, high));
        }
    }
    // All around it are more than 2³² cells.
    let within = rows.dilated_within(2000, [-2; 3], [12; 3]);
    assert_eq!(within.len(), 14 * 14 * 14);
}

#[test]
fn cells_around_reach_as_far_as_a_ball_and_little_farther() {
    let cells = [[0, 0, 0], [5, 2, -3], [6, 2, -3], [9, 9, 9]];
    let rows = CellRows::from_cells(&cells);
    let (low, high) = ([-4, -9, -9], [30, 12, 30]);
    for by in [0, 1, 2, 3, 5, 8] {
        let rounded = rows.rounded_within(by, low, high);
        for cell in CellRows::cuboid(low, high).iter() {
            let square = |other: &Cell| (0..3).map(|axis| (cell[axis] - other[axis]).pow(2)).sum::<i32>();
            let distance = f64::from(cells.iter().map(square).min().unwrap()).sqrt();
            let is_in = rounded.find(cell).is_some();
            assert!(is_in || distance > f64::from(by), "{by} {cell:?}");
            assert!(!is_in || distance <= 1.2 * f64::from(by) + 0.8, "{by} {cell:?}");
        }
        assert_eq!(rounded, rounded.clipped(low, high));
        assert!(rows.dilated_within(by, low, high).union(&rounded).len() == rows.dilated_within(by, low, high).len());
    }
    assert!(rows.rounded_within(2, [20; 3], [30; 3]).is_empty());
}

#[test]
fn rows_without_cells_around_a_set_are_not_stored() {
    let cells = ragged();
    let tight = CellRows::from_cells(&cells);
    let wide = CellRows::cuboid([-40; 3], [50; 3]).filtered(|cell, _| cells.contains(&cell));
    assert_eq!(wide, tight, "the same set, whatever box it was looked for in");
    assert_eq!((wide.low, wide.size), ([-9, -9], [16, 14]));
    for by in [1, 2] {
        assert_eq!(wide.dilated(by), tight.dilated(by));
    }
    assert_eq!(CellRows::cuboid([0; 3], [9; 3]).filtered(|_, _| false), CellRows::default());
}
