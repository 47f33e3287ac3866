//! A level set on smaller cells.

use super::cubic::cubic;
use super::{PhiView, RowBlocks, floor};
use crate::rows::{Cell, CellRows};

/// φ, in cells, beyond which it is not interpolated: the values around it may be those of no distance.
const NEAR: f32 = 3.0;

/// The cube that is interpolated in, and its row of cubes.
struct Cube<'a> {
    blocks: RowBlocks<'a>,
    cube: Cell,
}

/// φ on cells `by` times smaller, which are counted from the same corner: tricubic near the surface. In units of the smaller
/// cells.
pub fn refined(view: PhiView<'_>, by: u32) -> (CellRows, Vec<f32>) {
    let n = by as i32;
    let rows = view.rows.clipped(view.low, view.high).refined(n);
    let start = || None::<Cube<'_>>;
    let [phi] = rows.tabulate_with(start, |last, cell, _| {
        let coarse = cell.map(|x| x.div_euclid(n));
        let own = view.rows.find(coarse).map_or(view.outside, |at| view.phi[at]);
        if own.abs() > NEAR {
            return [own * by as f32];
        }
        let middle = cell.map(|x| (x as f32 + 0.5) / by as f32);
        let cube = middle.map(|x| floor(x - 0.5));
        let follows = |last: &Cube<'_>| last.cube[1..] == cube[1..] && last.cube[0] <= cube[0];
        if !last.as_ref().is_some_and(follows) {
            *last = Some(Cube { blocks: RowBlocks::new(view, cube[1], cube[2]), cube });
        }
        let Some(last) = last else { return [own] };
        last.cube = cube;
        let at = std::array::from_fn(|k| middle[k] - 0.5 - cube[k] as f32);
        [cubic(&last.blocks.at(cube[0]), at).0 * by as f32]
    });
    (rows, phi)
}

#[cfg(test)]
mod tests {
    use numerics::vector::{length, sub};

    use super::*;
    use crate::extract::{Placement, extract};

    /// A ball, and the same on cells three times smaller.
    #[test]
    fn a_ball_on_smaller_cells_is_rounder_and_where_it_was() {
        let rows = CellRows::cuboid([0; 3], [16; 3]);
        let (centre, radius) = ([8.2, 7.9, 8.0], 5.0);
        let phi = rows.tabulate(|cell| (length(sub(cell.map(|x| x as f32 + 0.5), centre)) - radius).clamp(-5.0, 5.0));
        let view = PhiView { rows: &rows, phi: &phi, outside: 5.0, low: [0; 3], high: [16; 3] };
        let (fine_rows, fine_phi) = refined(view, 3);
        assert_eq!(fine_rows.len(), 27 * rows.len());
        let fine = PhiView { rows: &fine_rows, phi: &fine_phi, outside: 15.0, low: [0; 3], high: [48; 3] };
        let mesh = extract(fine, Placement::Projected);
        for point in &mesh.points {
            let off = length(sub(point.map(|x| x / 3.0), centre)) - radius;
            assert!(off.abs() < 0.01, "{off}");
        }
        let ball = 4.0 / 3.0 * std::f64::consts::PI * 125.0;
        let coarse = extract(view, Placement::Projected).volume();
        let volume = mesh.volume() / 27.0;
        assert!((volume - ball).abs() < 0.3 * (coarse - ball).abs(), "{volume} {coarse} {ball}");
    }

    #[test]
    fn the_same_cells_have_the_same_values() {
        let rows = CellRows::cuboid([-3, 2, 0], [9, 11, 7]);
        let phi = rows.tabulate(|[x, y, z]| 0.3 * x as f32 - 0.1 * y as f32 + 0.2 * z as f32);
        let view = PhiView { rows: &rows, phi: &phi, outside: 5.0, low: [-3, 2, 0], high: [9, 11, 7] };
        let (same, values) = refined(view, 1);
        assert_eq!(same, rows);
        for (a, b) in values.iter().zip(&phi) {
            assert!((a - b).abs() < 1e-6);
        }
    }
}
