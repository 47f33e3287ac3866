//! The viscous equation on a grid with cells twice as large: the same discretisation, from means of masses and
//! viscosities over the volume that each coarse value stands for.

use crate::grids::{Children, at_low_face};
use crate::rows::{Cell, CellRows, Finder, Periods};
use crate::stencil::Stencil;

use super::extension::Extensions;
use super::level::{FaceKind, HALO, Level, lower};
use crate::velocity::FaceFields;

/// Least mass of a free coarse face: where the surface only just reaches it.
const LEAST_MASS: f32 = 0.25;

/// The next coarser grid; `None` where no cell of it is liquid.
pub(super) fn coarsened(fine: &Level) -> Option<Level> {
    let periods = fine.images.periods().halved();
    let candidates = fine.rows().halved();
    let near = || Finer::new(fine);
    let [is_liquid] = candidates.tabulate_with(near, |fine, cell, _| [periods.holds(cell) && fine.is_liquid(cell)]);
    let liquid = thick(fine, periods, candidates.filtered(|_, at| is_liquid[at]));
    if liquid.is_empty() {
        return None;
    }
    let rows = periods.stored(liquid.dilated(HALO + 1), HALO + 1);
    let images = periods.images(&rows);
    // Next to liquid, with the upper faces of what is there.
    let active = periods.gathered(liquid.dilated(1).grown_up());
    let start = || (Finer::new(fine), Finder::new(&liquid));
    let kinds: FaceFields<FaceKind> = rows.tabulate_with(start, |(fine, liquid), cell, _| {
        let is_liquid = |cell: Cell| liquid.find(periods.home(cell)).is_some();
        [0, 1, 2].map(|axis| {
            if fine.is_solid(periods.home(cell), axis) {
                FaceKind::Solid
            } else if is_liquid(cell) || is_liquid(lower(cell, axis)) {
                FaceKind::Free
            } else {
                FaceKind::Air
            }
        })
    });
    let field = |values: Vec<f32>| rows.resampled(&active, &values, 0.0);
    let start = || (Finer::new(fine), Finder::new(&rows), Finder::new(&active));
    let masses: FaceFields<f32> = active.tabulate_with(start, |(fine, rows, _), cell, _| {
        let at = rows.find(cell);
        let is_free = |axis: usize| at.is_some_and(|at| kinds[axis][at] == FaceKind::Free);
        [0, 1, 2].map(|axis| if is_free(axis) { fine.mass(cell, axis).max(LEAST_MASS) } else { 0.0 })
    });
    let extensions = Extensions::new(&rows, &images, &kinds);
    // A stress on a face that is not active would have no reaction there, and the matrix no symmetry.
    let has_velocity = |rows: &Finder<'_>, active: &Finder<'_>, axis: usize, cell: Cell| {
        let cell = periods.home(cell);
        let is_known = |at: usize| kinds[axis][at] != FaceKind::Air || extensions.reaches(axis, at);
        active.find(cell).is_some() && rows.find(cell).is_some_and(is_known)
    };
    let stresses = active.tabulate_with(start, |(fine, rows, active), cell, _| {
        let has_velocity = |axis: usize, cell: Cell| has_velocity(rows, active, axis, cell);
        let shear = |axis: usize| fine.shear(cell, axis, has_velocity);
        [fine.normal(cell, has_velocity), shear(0), shear(1), shear(2)]
    });
    let [normal, shear @ ..] = stresses.map(field);
    let mass = masses.map(field);
    let [liquid] =
        rows.tabulate_with(|| Finder::new(&liquid), |liquid, cell, _| [liquid.find(periods.home(cell)).is_some()]);
    let stencil = Stencil::within(rows.clone(), active.clone());
    let level = Level {
        stencil,
        liquid,
        kinds,
        mass,
        normal,
        shear,
        extensions: Some(extensions),
        inverse_diagonal: FaceFields::default(),
        images,
    };
    Some(level.with_diagonal())
}

/// The cells with another beside them, or a solid, along every axis. What is a single cell thick has no shear stress of its
/// own: a correction there would bend it freely.
fn thick(fine: &Level, periods: Periods, mut cells: CellRows) -> CellRows {
    loop {
        let start = || (Finer::new(fine), Finder::new(&cells));
        let [holds] = cells.tabulate_with(start, |(fine, cells), cell, _| {
            let is_held = |near: Cell, face: Cell, axis: usize| {
                cells.find(periods.home(near)).is_some() || fine.is_solid(periods.home(face), axis)
            };
            let holds = |axis: usize| {
                let mut above = cell;
                above[axis] += 1;
                is_held(above, above, axis) || is_held(lower(cell, axis), cell, axis)
            };
            [(0..3).all(holds)]
        });
        let kept = cells.filtered(|_, at| holds[at]);
        if kept.len() == cells.len() {
            return kept;
        }
        cells = kept;
    }
}

/// The finer grid, for a thread to look cells up in.
struct Finer<'a> {
    level: &'a Level,
    cells: Finder<'a>,
}

impl<'a> Finer<'a> {
    fn new(level: &'a Level) -> Self {
        Self { level, cells: Finder::new(level.rows()) }
    }

    /// Whether at least as many children are liquid as air.
    fn is_liquid(&self, coarse: Cell) -> bool {
        let fine = self.level;
        let is_air = |at: usize| fine.kinds.iter().any(|kinds| kinds[at] == FaceKind::Air);
        Children::of(&self.cells, coarse, |at| fine.liquid[at], is_air).are_liquid()
    }

    /// Whether at least two of the four fine faces are solid.
    fn is_solid(&self, coarse: Cell, axis: usize) -> bool {
        let kinds = &self.level.kinds[axis];
        let is_solid = |cell: &Cell| self.cells.find(*cell).is_some_and(|at| kinds[at] == FaceKind::Solid);
        at_low_face(coarse, axis).iter().filter(|cell| is_solid(cell)).count() >= 2
    }

    /// The sum over the fine values in a coarse one's volume, each times its share of that volume: `halfway` along the axes
    /// where the coarse value lies on a plane of fine ones, so that those beside it count half.
    fn sum(&self, coarse: Cell, halfway: [bool; 3], value: impl Fn(usize) -> f32) -> f32 {
        let fine = self.level;
        let steps = halfway
            .map(|halfway| if halfway { [(-1, 0.5), (0, 1.0), (1, 0.5)] } else { [(0, 1.0), (1, 1.0), (0, 0.0)] });
        let mut sum = 0.0;
        for (dz, weight_z) in steps[2] {
            for (dy, weight_y) in steps[1] {
                for (dx, weight_x) in steps[0] {
                    let weight = weight_x * weight_y * weight_z;
                    let cell = [2 * coarse[0] + dx, 2 * coarse[1] + dy, 2 * coarse[2] + dz];
                    if weight > 0.0
                        && let Some(at) = self.cells.find(cell)
                    {
                        sum += weight * value(fine.images.home(at));
                    }
                }
            }
        }
        sum
    }

    fn mass(&self, coarse: Cell, axis: usize) -> f32 {
        let fine = self.level;
        self.sum(coarse, [0, 1, 2].map(|other| other == axis), |at| fine.mass[axis][at])
    }

    /// A quarter of the sum, as the same velocities have a quarter of the squared strain. 0 where a face has no velocity.
    fn normal(&self, coarse: Cell, has_velocity: impl Fn(usize, Cell) -> bool) -> f32 {
        let fine = self.level;
        let has_both = |axis: usize| {
            let mut above = coarse;
            above[axis] += 1;
            has_velocity(axis, coarse) && has_velocity(axis, above)
        };
        if (0..3).all(has_both) { 0.25 * self.sum(coarse, [false; 3], |at| fine.normal[at]) } else { 0.0 }
    }

    /// 0 where one of the four faces at the edge has no velocity.
    fn shear(&self, coarse: Cell, axis: usize, has_velocity: impl Fn(usize, Cell) -> bool) -> f32 {
        let fine = self.level;
        let (side, other) = ((axis + 1) % 3, (axis + 2) % 3);
        let faces = [(side, coarse), (side, lower(coarse, other)), (other, coarse), (other, lower(coarse, side))];
        if !faces.into_iter().all(|(axis, cell)| has_velocity(axis, cell)) {
            return 0.0;
        }
        let halfway = [0, 1, 2].map(|along| along != axis);
        let total = self.sum(coarse, halfway, |at| fine.shear[axis][at]);
        // What lies inside a solid does not soften the edge beside it.
        let outside = self.sum(coarse, halfway, |at| {
            let is_inside =
                fine.shear[axis][at] == 0.0 && [side, other].map(|axis| fine.kinds[axis][at]) == [FaceKind::Solid; 2];
            if is_inside { 0.0 } else { 1.0 }
        });
        if outside > 0.0 { 2.0 * total / outside } else { 0.0 }
    }
}
