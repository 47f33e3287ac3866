//! How much of cells is liquid.

use numerics::vector::{Vec3, add};

use crate::level_set::PhiView;
use crate::rows::{Cell, Finder};
use crate::step::Surface;
use crate::step::domain::Domain;
use crate::velocity::{Site, trilinear};

/// Places along the edge of a surface cell where its share of liquid is looked at.
const LOOKS: i32 = 2;

/// |φ| of a cell, in cells, from which on it is all liquid or all air.
const WHOLE: f32 = 1.0;

/// The cell of the domain that a cell repeats, or is next to.
pub(super) fn inner(domain: &Domain, cell: Cell) -> Cell {
    let home = domain.periods().home(cell);
    [0, 1, 2].map(|axis| home[axis].clamp(domain.low[axis], domain.high[axis] - 1))
}

/// How much of cells is liquid.
pub(super) struct Shares<'a> {
    domain: &'a Domain,
    /// φ of the surface.
    view: PhiView<'a>,
    /// The same on its own cells, and how many of these lie along a cell's edge.
    finest: PhiView<'a>,
    fine: i32,
}

impl<'a> Shares<'a> {
    pub(super) fn of(surface: &'a dyn Surface, domain: &'a Domain) -> Self {
        let (finest, fine) = surface.finest_view();
        Self { domain, view: surface.view(), finest, fine }
    }

    /// The shares of a cell that are liquid if the surface moves outward by so many cells: by φ in the middle of 2³
    /// parts of each surface cell, interpolated trilinearly; and the middle of the first of them, in cells. Fast where successive
    /// cells are near each other.
    pub(super) fn reader<const N: usize>(&self) -> impl FnMut(Cell, [f32; N]) -> ([f32; N], Vec3) {
        let (coarse, looks, around) = (Finder::new(self.view.rows), self.looks(), self.around());
        let mut near = Vec::new();
        let per_cell = (LOOKS * self.fine) as f32;
        move |cell, outward| {
            let phi = coarse.find(cell).map_or(self.view.outside, |at| self.view.phi[at]);
            if phi.abs() > WHOLE || !self.domain.contains(cell) {
                let is_whole = phi < 0.0 && self.domain.contains(cell);
                return ([if is_whole { 1.0 } else { 0.0 }; N], Site::Centre.of(cell));
            }
            around(cell, &mut near);
            let (mut sums, mut moment) = ([0.0; N], [0.0; 3]);
            for look in &looks {
                let depth = -LOOKS as f32 * trilinear(look.corners.map(|corner| near[corner]), look.t);
                let shares = outward.map(|outward| (0.5 + per_cell * outward + depth).clamp(0.0, 1.0));
                (0..N).for_each(|n| sums[n] += shares[n]);
                (0..3).for_each(|axis| moment[axis] += shares[0] * look.place[axis]);
            }
            let middle = moment.map(|moment| moment / sums[0].max(f32::MIN_POSITIVE));
            (sums.map(|sum| sum / looks.len() as f32), add(Site::Centre.of(cell), middle))
        }
    }

    /// φ of the surface cells of a cell and those around, x fastest.
    fn around(&self) -> impl Fn(Cell, &mut Vec<f32>) {
        let (finder, r, view) = (Finder::new(self.finest.rows), self.fine, &self.finest);
        let size = r as usize + 2;
        let [periods, start] = [self.domain.periods().0, self.domain.low].map(|cells| cells.map(|x| r * x));
        move |cell, near| {
            let along = |axis: usize, n: usize| match (r * cell[axis] - 1 + n as i32, periods[axis]) {
                (at, 0) => at.clamp(view.low[axis], view.high[axis] - 1),
                (at, period) => start[axis] + (at - start[axis]).rem_euclid(period),
            };
            let phi = |n: usize| {
                let cell = [along(0, n % size), along(1, n / size % size), along(2, n / size / size)];
                finder.find(cell).map_or(view.outside, |at| view.phi[at])
            };
            near.clear();
            near.extend((0..size * size * size).map(phi));
        }
    }

    fn looks(&self) -> Vec<Look> {
        let (size, looks) = (self.fine as usize + 2, (LOOKS * self.fine) as usize);
        let look = |n: usize| {
            let along = [n % looks, n / looks % looks, n / looks / looks].map(|look| look as f32 + 0.5);
            // From the middle of the first surface cell.
            let from_first = along.map(|along| along / LOOKS as f32 + 0.5);
            let [x, y, z] = from_first.map(|x| x as usize);
            let first = x + size * (y + size * z);
            Look {
                place: along.map(|along| along / looks as f32 - 0.5),
                corners: std::array::from_fn(|k| first + (k & 1) + size * ((k >> 1 & 1) + size * (k >> 2))),
                t: from_first.map(f32::fract),
            }
        };
        (0..looks * looks * looks).map(look).collect()
    }
}

/// A place where a cell is looked at.
struct Look {
    /// From the middle of the cell, in cells.
    place: Vec3,
    /// The surface cells around it, of those of the cell and around it, and where between them.
    corners: [usize; 8],
    t: Vec3,
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use numerics::vector::length;

    use super::*;
    use crate::marked::MarkedSurface;
    use crate::rows::CellRows;
    use crate::step::Wall;

    /// The sum of the shares of all cells of a ball of 4.3 cells radius, as it is and 0.1 cells larger.
    fn ball(domain: Domain, resolution: u32, middle: Vec3) -> [f64; 2] {
        let home = |p: Vec3| {
            [0, 1, 2].map(|n| {
                let way = p[n] - middle[n];
                if domain.periods().0[n] > 0 { way - 16.0 * (way / 16.0).round() } else { way }
            })
        };
        let surface = MarkedSurface::new(domain, resolution, |p| length(home(p)) - 4.3, 0, 1);
        let shares = Shares::of(&surface, &domain);
        let mut share = shares.reader();
        CellRows::cuboid(domain.low, domain.high).iter().fold([0.0; 2], |sums, cell| {
            let (shares, _) = share(cell, [0.0, 0.1]);
            [0, 1].map(|n| sums[n] + f64::from(shares[n]))
        })
    }

    #[test]
    fn balls_hold_their_volume_also_across_periods() {
        let closed = Domain::closed([0; 3], [16; 3]);
        let periodic = Domain { walls: [[Wall::Periodic; 2]; 3], ..closed };
        let volume = |radius: f64| 4.0 / 3.0 * PI * radius.powi(3);
        for resolution in [1, 2] {
            for (domain, middle) in [(closed, [8.1, 7.7, 8.4]), (periodic, [0.3, 15.2, 8.0])] {
                let [here, more] = ball(domain, resolution, middle);
                // Interpolated linearly, φ is too high where the surface bulges, in surface cells by up to 2 · 0.125 ÷ radius.
                let missing = 4.0 * PI * 4.3 * 4.3 * 0.22 / 4.3 / f64::from(resolution * resolution);
                assert!(((here + missing) / volume(4.3) - 1.0).abs() < 0.01, "{resolution}: {here}");
                assert!(
                    ((more - here) / (volume(4.4) - volume(4.3)) - 1.0).abs() < 0.03,
                    "{resolution}: {here} {more}"
                );
            }
        }
    }

    /// Liquid that touches a wall goes on beyond it: cells next to it are full.
    #[test]
    fn a_pool_holds_its_depth() {
        let domain = Domain::closed([0; 3], [6, 8, 6]);
        let surface = MarkedSurface::new(domain, 1, |p| p[1] - 3.3, 0, 1);
        let (shares, mut sum) = (Shares::of(&surface, &domain), 0.0);
        let mut share = shares.reader();
        for cell in CellRows::cuboid(domain.low, domain.high).dilated(2).iter() {
            sum += share(cell, [0.0]).0[0];
        }
        assert!((sum / (36.0 * 3.3) - 1.0).abs() < 1e-3, "{sum}");
    }
}
