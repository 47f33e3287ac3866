//! The CVs in the frame, sorted so that sixteen successive ones see nearly the same triangles.
//!
//! Curves may lie in memory in any order and may be long, so CVs are sorted instead of curves: into the cells of a grid
//! across the wind, along a Z-order curve, in two passes.

use super::Shield;
use super::frame::{Frame, Gap};
use numerics::parallel;
use numerics::vector::Vec3;

/// A CV, from which a ray or cone is cast upwind.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub(super) at: Vec3,
    pub(super) gap: Gap,
    /// Largest distance upwind at which a collider shelters it; 0 or less: at none.
    pub(super) reach: f32,
}

/// The CVs of some curves.
pub(super) struct Views {
    sorted: Vec<View>,
    /// The index in `sorted` of each CV, curve by curve.
    order: Vec<u32>,
    /// The index in `order` where each curve starts, and where the last ends.
    starts: Vec<u32>,
}

/// Number of curves that a task transforms into the frame.
const TASK: usize = 256;

/// Number of CVs whose cells a task finds.
const TASK_CELLS: usize = 4096;

/// Average number of CVs in a cell.
const IN_CELL: usize = 4;

/// Log₂ of the largest number of cells along a side of the grid.
const FINEST: u32 = 8;

impl Views {
    /// The CVs `points[starts[i]..starts[i + 1]]`.
    pub(super) fn of(frame: &Frame, starts: &[u32], points: &[Vec3], shield: &Shield<'_>) -> Self {
        let Some(base) = starts.first().copied() else {
            return Self { sorted: Vec::new(), order: Vec::new(), starts: vec![0] };
        };
        let points = &points[base as usize..starts[starts.len() - 1] as usize];
        let starts: Vec<u32> = starts.iter().map(|start| start - base).collect();
        let still = View { at: [0.0; 3], gap: Gap::default(), reach: 0.0 };
        let mut views = vec![still; points.len()];
        let tasks = split(&mut views, &starts);
        parallel::for_each(tasks, |_, (curves, mut views)| {
            for ends in curves.windows(2) {
                let cvs = &points[ends[0] as usize..ends[1] as usize];
                let gap = frame.gap(cvs, shield.skin_gap);
                let (mine, rest) = views.split_at_mut(cvs.len());
                for ((view, cv), row) in mine.iter_mut().zip(cvs).zip((base + ends[0]) as usize..) {
                    *view = View { at: frame.at(*cv), gap, reach: frame.length(shield.offset.at(row)) };
                }
                views = rest;
            }
        });
        let (sorted, order) = sorted(&views);
        Self { sorted, order, starts }
    }

    /// All CVs, sorted so that neighbours are close to each other.
    pub(super) fn sorted(&self) -> &[View] {
        &self.sorted
    }

    /// Number of curves.
    pub(super) fn curves(&self) -> usize {
        self.starts.len() - 1
    }

    /// The indices in [`Views::sorted`] of the CVs of a curve.
    pub(super) fn of_curve(&self, curve: usize) -> &[u32] {
        &self.order[self.starts[curve] as usize..self.starts[curve + 1] as usize]
    }
}

/// Starts of some curves, and space for their CVs.
type Task<'a> = (&'a [u32], &'a mut [View]);

/// The curves in tasks, each with its part of `views`.
fn split<'a>(mut views: &'a mut [View], starts: &'a [u32]) -> Vec<Task<'a>> {
    let curves = starts.len() - 1;
    let mut tasks = Vec::with_capacity(curves.div_ceil(TASK));
    for first in (0..curves).step_by(TASK) {
        let end = curves.min(first + TASK);
        let (mine, rest) = views.split_at_mut((starts[end] - starts[first]) as usize);
        tasks.push((&starts[first..=end], mine));
        views = rest;
    }
    tasks
}

/// The views sorted by cell (stable), and the new index of each.
fn sorted(views: &[View]) -> (Vec<View>, Vec<u32>) {
    let mut bits = 1;
    while bits < FINEST && IN_CELL << (2 * bits) < views.len() {
        bits += 1;
    }
    let grid = Grid::around(views, bits);
    let mut cells = vec![0; views.len()];
    parallel::fill(&mut cells, TASK_CELLS, |view| grid.cell(views[view].at));
    let mut next = vec![0_u32; (1 << (2 * bits)) + 1];
    for cell in &cells {
        next[*cell as usize + 1] += 1;
    }
    let mut sum = 0;
    for count in &mut next {
        sum += *count;
        *count = sum;
    }
    let mut out = views.to_vec();
    let mut order = cells;
    for (index, view) in order.iter_mut().zip(views) {
        let next = &mut next[*index as usize];
        *index = *next;
        out[*next as usize] = *view;
        *next += 1;
    }
    (out, order)
}

/// Cells across the wind.
struct Grid {
    low: [f32; 2],
    /// Cells per unit of length.
    fine: [f32; 2],
    /// Index of the last cell along an axis.
    last: f32,
}

impl Grid {
    /// 2^`bits` cells along each axis.
    fn around(views: &[View], bits: u32) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for view in views {
            for axis in 0..2 {
                let x = view.at[axis];
                low[axis] = if x < low[axis] { x } else { low[axis] };
                high[axis] = if x > high[axis] { x } else { high[axis] };
            }
        }
        let last = ((1_u32 << bits) - 1) as f32;
        let size = (high[0] - low[0]).max(high[1] - low[1]);
        let fine = if size > 0.0 && size < f32::INFINITY { (last + 1.0) / size } else { 0.0 };
        Self { low, fine: [fine; 2], last }
    }

    /// The index of a point's cell along a Z-order curve; any cell for NaN.
    fn cell(&self, at: Vec3) -> u32 {
        let mut cell = 0;
        for axis in 0..2 {
            let along = ((at[axis] - self.low[axis]) * self.fine[axis]).clamp(0.0, self.last);
            cell |= spread(along as u32) << axis;
        }
        cell
    }
}

/// Spreads sixteen bits, with a zero between neighbours.
fn spread(x: u32) -> u32 {
    let x = (x | x << 8) & 0x00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
}

#[cfg(test)]
mod tests {
    use super::super::tests::STILL;
    use super::*;

    #[test]
    fn cvs_are_sorted_by_cell_and_found_again() {
        // Two curves of a row of CVs across the wind, their numbers shuffled.
        let along = [5, 2, 7, 0, 3, 6, 1, 4];
        let points: Vec<Vec3> = along.iter().map(|k| [0.0, *k as f32, 0.0]).collect();
        let frame = Frame::of([0.0, 0.0, 1.0], &points, &[]).unwrap();
        let views = Views::of(&frame, &[0, 3, 8], &points, &STILL);
        let at = |index: &u32| views.sorted()[*index as usize].at;
        let found: Vec<Vec3> = (0..views.curves()).flat_map(|curve| views.of_curve(curve)).map(at).collect();
        assert_eq!(found, points.iter().map(|point| frame.at(*point)).collect::<Vec<_>>());
        let cells: Vec<u32> = {
            let grid = Grid::around(views.sorted(), 1);
            views.sorted().iter().map(|view| grid.cell(view.at)).collect()
        };
        assert!(cells.is_sorted() && cells[0] < cells[7], "{cells:?}");
    }

    #[test]
    fn nan_and_coincident_points_are_sorted_too() {
        let points = [[f32::NAN; 3], [f32::INFINITY, 0.0, 0.0], [1.0, 2.0, 3.0], [1.0, 2.0, 3.0]];
        let frame = Frame::of([0.0, 0.0, 1.0], &points, &[]).unwrap();
        for n in 0..=4 {
            let starts: Vec<u32> = (0..=n).collect();
            assert_eq!(Views::of(&frame, &starts, &points, &STILL).sorted().len(), n as usize);
        }
    }
}
