//! Grids of the multigrid solvers, each with cells twice as large as those of the one before.

use crate::rows::{Cell, Finder};

/// `finest`, and what `coarsen` makes of each grid in turn, until one has `fewest` cells or less, or cannot be coarsened.
/// `cells`: how many a grid solves for.
pub(crate) fn coarsened_to<G>(
    fewest: usize,
    finest: G,
    cells: impl Fn(&G) -> usize,
    mut coarsen: impl FnMut(&G) -> Option<G>,
) -> Vec<G> {
    let mut grids = vec![finest];
    loop {
        let fine = &grids[grids.len() - 1];
        let count = cells(fine);
        if count <= fewest {
            return grids;
        }
        match coarsen(fine) {
            // Scattered drops, or a grid that is one cell wide, do not get coarser.
            Some(coarse) if cells(&coarse) * 10 <= count * 9 => grids.push(coarse),
            _ => return grids,
        }
    }
}

/// What the finer cells in a coarse one are.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Children {
    pub(crate) liquid: u32,
    pub(crate) air: u32,
}

impl Children {
    /// Those of `coarse` that are stored, by their places in fields.
    pub(crate) fn of(
        finer: &Finder<'_>,
        coarse: Cell,
        is_liquid: impl Fn(usize) -> bool,
        is_air: impl Fn(usize) -> bool,
    ) -> Self {
        let mut children = Self::default();
        for child in 0..8 {
            let offset = [child & 1, child >> 1 & 1, child >> 2];
            let Some(at) = finer.find([0, 1, 2].map(|axis| 2 * coarse[axis] + offset[axis])) else { continue };
            if is_liquid(at) {
                children.liquid += 1;
            } else if is_air(at) {
                children.air += 1;
            }
        }
        children
    }

    /// Whether the coarse cell is liquid: at least as many are as are air. Otherwise the number of iterations would grow with
    /// that of the grids.
    pub(crate) fn are_liquid(self) -> bool {
        self.liquid > 0 && self.liquid >= self.air
    }
}

/// The four finer cells whose low faces along `axis` make up that of a coarse one.
pub(crate) fn at_low_face(coarse: Cell, axis: usize) -> [Cell; 4] {
    let (side, other) = ((axis + 1) % 3, (axis + 2) % 3);
    [0, 1, 2, 3].map(|column| {
        let mut cell = coarse.map(|n| 2 * n);
        cell[side] += column & 1;
        cell[other] += column >> 1;
        cell
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::CellRows;

    #[test]
    fn grids_get_coarser_while_that_is_worth_it() {
        let grids = |finest: usize, coarsen: fn(usize) -> Option<usize>| {
            coarsened_to(150, finest, |cells| *cells, |cells| coarsen(*cells))
        };
        assert_eq!(grids(150, |cells| Some(cells / 8)), [150]);
        assert_eq!(grids(20_000, |cells| Some(cells / 8)), [20_000, 2_500, 312, 39]);
        assert_eq!(grids(20_000, |_| None), [20_000]);
        assert_eq!(grids(1000, |cells| Some(cells - 50)), [1000]);
    }

    #[test]
    fn a_coarse_cell_is_what_most_of_its_children_are() {
        let rows = CellRows::cuboid([0; 3], [2, 2, 1]);
        let finder = Finder::new(&rows);
        let children = |liquid: usize| Children::of(&finder, [0; 3], |at| at < liquid, |_| true);
        assert!((children(2).liquid, children(2).air) == (2, 2) && children(2).are_liquid());
        assert!(!children(1).are_liquid() && !children(0).are_liquid());
        assert_eq!(at_low_face([1, 0, 0], 0), [[2, 0, 0], [2, 1, 0], [2, 0, 1], [2, 1, 1]]);
    }
}
