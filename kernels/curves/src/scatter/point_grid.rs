//! A hash grid of points that is refined as more are added.
//!
//! Cells are cubes at least twice as wide as the spacing, so eight of them contain all points closer than it. Cells
//! that hash to the same chain cost time but do not affect results.

use numerics::vector::DVec3;

/// Accepted points, by position. No coordinate is negative.
pub(super) struct PointGrid {
    points: Vec<AcceptedPoint>,
    cells_per_metre: f64,
    /// Newest point of each chain.
    heads: Vec<u32>,
    least_chains: usize,
}

/// One accepted point.
pub(super) struct AcceptedPoint {
    /// Position relative to the lowest corner, metres.
    pub(super) at: DVec3,
    pub(super) triangle: u32,
    /// The next older point of its chain.
    older: u32,
}

/// The end of a chain.
const NONE: u32 = u32::MAX;

/// Cells are rebuilt once they are this much wider than needed: at 2 a cell holds four times as many points, at 1 they
/// would be rebuilt every round.
const TOO_WIDE: f64 = 1.3;

impl PointGrid {
    /// For points `spacing` metres apart, with at least `chains` chains.
    pub(super) fn new(spacing: f64, chains: usize) -> Self {
        let chains = chains.next_power_of_two();
        Self { points: Vec::new(), cells_per_metre: 0.5 / spacing, heads: vec![NONE; chains], least_chains: chains }
    }

    /// Adapts the cells to a smaller spacing.
    pub(super) fn refine(&mut self, spacing: f64) {
        let needed = 0.5 / spacing;
        if needed <= TOO_WIDE * self.cells_per_metre {
            return;
        }
        self.cells_per_metre = needed;
        // Until the next rebuild the number of points about doubles.
        self.heads = vec![NONE; (4 * self.points.len()).max(self.least_chains).next_power_of_two()];
        for row in 0..self.points.len() {
            let chain = self.chain_of(self.points[row].at);
            self.points[row].older = self.heads[chain];
            self.heads[chain] = row as u32;
        }
    }

    /// Adds a point.
    pub(super) fn add(&mut self, at: DVec3, triangle: u32) {
        let chain = self.chain_of(at);
        self.points.push(AcceptedPoint { at, triangle, older: self.heads[chain] });
        self.heads[chain] = (self.points.len() - 1) as u32;
    }

    /// Whether `matches` holds for any point from row `first` on that lies in the eight cells around `at`.
    #[inline]
    pub(super) fn any_near(&self, at: DVec3, first: usize, matches: impl Fn(&AcceptedPoint) -> bool) -> bool {
        let scaled = at * self.cells_per_metre;
        let own = [0, 1, 2].map(|k| scaled[k] as i64);
        // Along each axis the nearer neighbour. The point's own cell is most likely to contain a match and comes first.
        let next = [0, 1, 2].map(|k| if scaled[k] - (own[k] as f64) < 0.5 { -1 } else { 1 });
        (0..8).any(|corner: i64| {
            let cell = [0, 1, 2].map(|k| own[k].wrapping_add(next[k] * (corner >> k & 1)));
            let mut row = self.heads[self.chain(cell)];
            // A chain runs from its newest point to its oldest.
            while row != NONE && row as usize >= first {
                let point = &self.points[row as usize];
                if matches(point) {
                    return true;
                }
                row = point.older;
            }
            false
        })
    }

    fn chain_of(&self, at: DVec3) -> usize {
        self.chain([0, 1, 2].map(|k| (at[k] * self.cells_per_metre) as i64))
    }

    fn chain(&self, [x, y, z]: [i64; 3]) -> usize {
        let mixed = [(x, 0x9e37_79b9_7f4a_7c15), (y, 0xc2b2_ae3d_27d4_eb4f), (z, 0x1656_67b1_9e37_79f9)]
            .into_iter()
            .fold(0_u64, |sum, (cell, factor)| sum.wrapping_add((cell as u64).wrapping_mul(factor)));
        ((mixed ^ (mixed >> 29)) as usize ^ (mixed >> 47) as usize) & (self.heads.len() - 1)
    }
}
