//! Detection of self-intersections.
//!
//! Exact on the grid: two triangles intersect if a side of one passes through the interior of the other. Triangles
//! that only touch or are coplanar do not count; shells that overlap in this way are found later by their winding
//! numbers.

use super::grid::GridPoint;
use super::predicates::{At, orient};
use numerics::parallel;
use numerics::tree::TriangleTree;

/// Triangles that a thread takes at a time.
const TASK: usize = 32;

/// The first pair of intersecting triangles, and the number of pairs.
pub(super) fn crossing(
    grid_points: &[GridPoint],
    triangles: &[[u32; 3]],
    tree: &TriangleTree,
) -> Option<([u32; 2], usize)> {
    let found = |first: usize| {
        let own = triangles[first];
        let corners = own.map(|corner| grid_points[corner as usize]);
        let bound = |pick: fn(i32, i32) -> i32| {
            [0, 1, 2].map(|k| pick(pick(corners[0][k], corners[1][k]), corners[2][k]) as f32)
        };
        let (mut least, mut count) = (u32::MAX, 0);
        tree.visit_box(bound(i32::min), bound(i32::max), |block, lanes| {
            for (lane, other) in block.triangle.iter().enumerate() {
                // Each pair once; triangles with a common edge intersect only there, unless they are coplanar.
                if lanes >> lane & 1 == 0 || *other as usize <= first {
                    continue;
                }
                let theirs = triangles[*other as usize];
                if own.iter().filter(|corner| theirs.contains(corner)).count() < 2
                    && triangles_cross(grid_points, own, theirs)
                {
                    least = least.min(*other);
                    count += 1;
                }
            }
        });
        (count > 0).then_some(([first as u32, least], count))
    };
    let both = |(pair, count): ([u32; 2], usize), (_, more): ([u32; 2], usize)| (pair, count + more);
    let parts = parallel::map((0..triangles.len()).step_by(TASK), |_, first| {
        (first..triangles.len().min(first + TASK)).filter_map(found).reduce(both)
    });
    parts.into_iter().flatten().reduce(both)
}

fn triangles_cross(grid_points: &[GridPoint], a: [u32; 3], b: [u32; 3]) -> bool {
    let at = |triangle: [u32; 3]| triangle.map(|corner| At::from(grid_points[corner as usize].map(f64::from)));
    let (at_a, at_b) = (at(a), at(b));
    let (Some(a_sides), Some(b_sides)) = (sides(&at_b, &at_a), sides(&at_a, &at_b)) else { return false };
    pierces(&at_a, a_sides, &at_b) || pierces(&at_b, b_sides, &at_a)
}

/// Orientation of the corners of a triangle relative to the plane of another; `None` unless they are on both sides.
fn sides(plane: &[At; 3], of: &[At; 3]) -> Option<[f64; 3]> {
    let sides = [0, 1, 2].map(|k| orient(&plane[0], &plane[1], &plane[2], &of[k]));
    (sides.iter().any(|side| *side > 0.0) && sides.iter().any(|side| *side < 0.0)).then_some(sides)
}

/// Whether a side of a triangle passes through the interior of another, given the sides of its plane on which the
/// corners lie.
fn pierces(triangle: &[At; 3], sides: [f64; 3], through: &[At; 3]) -> bool {
    (0..3).any(|k| {
        let (from, to) = (k, (k + 1) % 3);
        if !(sides[from] > 0.0 && sides[to] < 0.0 || sides[from] < 0.0 && sides[to] > 0.0) {
            return false;
        }
        let turn = |i: usize| orient(&triangle[from], &triangle[to], &through[i], &through[(i + 1) % 3]);
        let turns = [turn(0), turn(1), turn(2)];
        turns.iter().all(|turn| *turn > 0.0) || turns.iter().all(|turn| *turn < 0.0)
    })
}
