//! From a grid of liquid to the matrix of its viscosity.

use crate::pressure::PressureSolver;
use crate::rows::{Cell, CellRows, Finder, Periods};
use crate::stencil::Stencil;

use super::StokesGrid;
use super::level::{FaceKind, Level, lower};
use crate::velocity::FaceFields;

/// Least distance of a solid from a face beside it, in cells: bounds the matrix.
const LEAST_SOLID_DISTANCE: f32 = 0.1;

/// What a liquid's faces are to velocity and pressure, besides the matrix.
#[derive(Clone, Debug)]
pub(super) struct Flow {
    /// Open share of each low face.
    pub open: FaceFields<f32>,
    /// What a difference of pressure does to a free face; 0 at others.
    pub gradient: FaceFields<f32>,
}

/// The fields of a grid on the rows of its pressure solver.
struct Fields<'a> {
    rows: &'a CellRows,
    pressure: &'a PressureSolver,
    level_set: Vec<f32>,
    density: Vec<f32>,
    viscosity: Vec<f32>,
    open: FaceFields<f32>,
    solid: FaceFields<f32>,
    slip: &'a (dyn Fn(usize, Cell) -> f32 + Sync),
    periods: Periods,
    kinds: FaceFields<FaceKind>,
}

pub(super) fn set_up(grid: &StokesGrid<'_>, pressure: &PressureSolver) -> (Level, Flow) {
    let rows = pressure.rows();
    let images = pressure.images();
    let field = |values: &[f32], outside| {
        let mut field = rows.resampled(grid.rows, values, outside);
        images.fill(&mut field);
        field
    };
    let open = grid.open.map(|open| field(open, 0.0));
    let mut fields = Fields {
        rows,
        pressure,
        level_set: field(grid.level_set, f32::MAX),
        density: field(grid.density, 1.0),
        viscosity: field(grid.viscosity, 0.0),
        solid: grid.solid_distance.map(|distance| field(distance, -0.5)),
        open,
        slip: grid.slip,
        periods: grid.periods,
        kinds: FaceFields::default(),
    };
    let active = grid.periods.gathered(pressure.stencil().active().grown_up());
    let finder = || Finder::new(rows);
    fields.kinds =
        rows.tabulate_with(finder, |finder, cell, at| [0, 1, 2].map(|axis| fields.kind(finder, cell, at, axis)));
    images.fill_each(&mut fields.kinds);
    let filled = rows.tabulate_with(finder, |finder, cell, at| {
        [if pressure.is_liquid(at) { fields.filled(finder, cell, at) } else { 0.0 }]
    });
    let [filled] = filled;
    let share =
        |fields: &Fields<'_>, finder: &Finder<'_>, cell, at, axis| fields.share(&filled, finder, cell, at, axis);
    let shares = fields.on_active(&active, share, 0.0);
    let mass = |fields: &Fields<'_>, finder: &Finder<'_>, cell: Cell, at: usize, axis: usize| {
        let is_free = fields.kinds[axis][at] == FaceKind::Free;
        if is_free { shares[axis][at] * fields.density_at(finder, cell, at, axis) } else { 0.0 }
    };
    let mass = fields.on_active(&active, mass, 0.0);
    let distances = pressure.surface_distances();
    let gradient: FaceFields<f32> = std::array::from_fn(|axis| {
        shares[axis].iter().zip(&distances[axis]).map(|(share, distance)| share / distance).collect()
    });
    let normal =
        (0..rows.len()).map(|at| if pressure.is_liquid(at) { 2.0 * fields.viscosity[at] } else { 0.0 }).collect();
    let shear = fields.on_active(&active, |fields, finder, cell, _, axis| fields.shear(finder, cell, axis), 0.0);
    let Fields { kinds, open, .. } = fields;
    let stencil = Stencil::within(rows.clone(), active);
    let liquid = (0..rows.len()).map(|at| pressure.is_liquid(at)).collect();
    let level = Level {
        stencil,
        liquid,
        kinds,
        mass,
        normal,
        shear,
        extensions: None,
        inverse_diagonal: FaceFields::default(),
        images: images.clone(),
    };
    (level.with_diagonal(), Flow { open, gradient })
}

impl Fields<'_> {
    /// What `value` makes of each low face of the active cells, `outside` elsewhere.
    fn on_active<T: Copy + Default + Send + Sync>(
        &self,
        active: &CellRows,
        value: impl Fn(&Self, &Finder<'_>, Cell, usize, usize) -> T + Sync,
        outside: T,
    ) -> FaceFields<T> {
        let finder = || Finder::new(self.rows);
        let faces: FaceFields<T> = active.tabulate_with(finder, |finder, cell, _| match finder.find(cell) {
            Some(at) => [0, 1, 2].map(|axis| value(self, finder, cell, at, axis)),
            None => [outside; 3],
        });
        faces.map(|faces| self.rows.resampled(active, &faces, outside))
    }

    fn kind(&self, finder: &Finder<'_>, cell: Cell, at: usize, axis: usize) -> FaceKind {
        if self.open[axis][at] == 0.0 {
            return FaceKind::Solid;
        }
        let is_liquid = |at: usize| self.pressure.is_liquid(at);
        if is_liquid(at) || finder.find(lower(cell, axis)).is_some_and(is_liquid) {
            FaceKind::Free
        } else {
            FaceKind::Air
        }
    }

    /// The share of a free face's volume that is liquid: between the centres of the cells beside it, or from the centre of
    /// the liquid one to the surface. `filled`: see [`Self::filled`].
    fn share(&self, filled: &[f32], finder: &Finder<'_>, cell: Cell, at: usize, axis: usize) -> f32 {
        if self.kinds[axis][at] != FaceKind::Free {
            return 0.0;
        }
        let open = self.open[axis][at];
        match finder.find(lower(cell, axis)) {
            Some(below) if self.pressure.is_liquid(at) && self.pressure.is_liquid(below) => {
                open * 0.5 * (filled[at] + filled[below])
            }
            _ => open * self.pressure.surface_distances()[axis][at],
        }
    }

    /// The liquid of a cell, as a share of a cell's volume, with what reaches beyond it into air; exact where the surface
    /// is along the grid. Air behind closed faces does not count: cells beyond walls are such.
    fn filled(&self, finder: &Finder<'_>, cell: Cell, at: usize) -> f32 {
        let distances = self.pressure.surface_distances();
        let mut reach = f32::INFINITY;
        for axis in 0..3 {
            let mut above = cell;
            above[axis] += 1;
            let above = finder.find(above);
            for (face, air) in [(Some(at), finder.find(lower(cell, axis))), (above, above)] {
                let (Some(face), Some(air)) = (face, air) else { continue };
                if self.open[axis][face] > 0.0 && self.pressure.is_air(air) {
                    reach = reach.min(distances[axis][face]);
                }
            }
        }
        // Open walls are nearer than φ has it.
        if reach < f32::INFINITY { (0.5 + reach.min(-self.level_set[at])).clamp(0.5, 1.5) } else { 1.0 }
    }

    fn density_at(&self, finder: &Finder<'_>, cell: Cell, at: usize, axis: usize) -> f32 {
        let is_liquid = |at: &usize| self.pressure.is_liquid(*at);
        match (finder.find(lower(cell, axis)).filter(is_liquid), Some(at).filter(is_liquid)) {
            (Some(a), Some(b)) => 0.5 * (self.density[a] + self.density[b]),
            (Some(one), None) | (None, Some(one)) => self.density[one],
            (None, None) => 1.0,
        }
    }

    /// The viscosity of the edge along `axis` at the low corner of a cell: the harmonic mean of the liquid around it, as
    /// shear stress is the same on both sides of a jump. 0 where one of the four faces at the edge is in air: the
    /// surface has no shear stress. Air behind closed faces does not count. Beside a solid the velocity falls to the solid's over less than a cell.
    fn shear(&self, finder: &Finder<'_>, cell: Cell, axis: usize) -> f32 {
        let (side, other) = ((axis + 1) % 3, (axis + 2) % 3);
        let (mut inverse, mut liquid, mut air) = (0.0, 0.0, 0.0);
        let is_open = |face: usize, cell: Cell| finder.find(cell).is_some_and(|at| self.open[face][at] > 0.0);
        let across_side = [cell, lower(cell, other)].map(|cell| is_open(side, cell));
        let across_other = [cell, lower(cell, side)].map(|cell| is_open(other, cell));
        let corners = [
            (cell, across_side[0] || across_other[0]),
            (lower(cell, side), across_side[0] || across_other[1]),
            (lower(cell, other), across_side[1] || across_other[0]),
            (lower(lower(cell, side), other), across_side[1] || across_other[1]),
        ];
        for (corner, is_reached) in corners {
            let Some(at) = finder.find(corner) else { continue };
            if self.pressure.is_liquid(at) {
                if self.viscosity[at] <= 0.0 {
                    return 0.0;
                }
                inverse += 1.0 / self.viscosity[at];
                liquid += 1.0;
            } else if is_reached && self.pressure.is_air(at) {
                air += 1.0;
            }
        }
        let mut distance = 1.0_f32;
        let mut held: Option<f32> = None;
        for (face, step) in [(side, other), (other, side)] {
            let pair = [Some(cell), Some(lower(cell, step))].map(|cell| cell.and_then(|cell| finder.find(cell)));
            let kinds = pair.map(|at| at.map_or(FaceKind::Solid, |at| self.kinds[face][at]));
            if kinds.contains(&FaceKind::Air) {
                return 0.0;
            }
            if kinds[0] != kinds[1] {
                let from = |at: Option<usize>| at.map_or(-0.5, |at| self.solid[face][at]);
                let (free, solid) = if kinds[0] == FaceKind::Free { (0, 1) } else { (1, 0) };
                let (outside, inside) = (from(pair[free]).max(0.0), from(pair[solid]).min(0.0));
                if outside - inside > 0.0 {
                    distance = distance.min(outside / (outside - inside));
                }
                let wall = if solid == 0 { cell } else { lower(cell, step) };
                let slip = (self.slip)(face, self.periods.home(wall));
                held = Some(held.map_or(1.0 - slip, |held| held.min(1.0 - slip)));
            }
        }
        if liquid == 0.0 {
            return 0.0;
        }
        let viscosity = liquid / inverse * (1.0 - 0.25 * air);
        held.map_or(viscosity, |held| viscosity * held / distance.max(LEAST_SOLID_DISTANCE))
    }
}
