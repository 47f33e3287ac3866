//! The CVs in the frame, sorted so that sixteen successive ones see nearly the same triangles.
//!
//! Curves may lie in memory in any order and may be long, so CVs are sorted instead of curves: into the cells of a grid
//! across the wind, in two layers along it, along a Hilbert curve, in two passes.

use super::Shield;
use super::frame::{Frame, Gap};
use numerics::lanes::{F32x16, LANES, get, set};
use numerics::masked::Masked;
use numerics::parallel;
use numerics::simd::{Path, kernel};
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
    /// Curve by curve.
    views: Vec<View>,
    /// Indices of all CVs, sorted so that successive ones are close to each other.
    sorted: Vec<u32>,
    /// The index in `sorted` of each CV.
    order: Vec<u32>,
    /// The first CV of each curve, and the end of the last.
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
            return Self { views: Vec::new(), sorted: Vec::new(), order: Vec::new(), starts: vec![0] };
        };
        let points = &points[base as usize..starts[starts.len() - 1] as usize];
        let starts: Vec<u32> = starts.iter().map(|start| start - base).collect();
        let still = View { at: [0.0; 3], gap: Gap::default(), reach: 0.0 };
        let mut views = vec![still; points.len()];
        let tasks = split(&mut views, &starts);
        let path = Path::chosen();
        let bounds = parallel::map(tasks, |_, (curves, views)| {
            write_views(path, frame, curves, &points[curves[0] as usize..], shield, (base + curves[0]) as usize, views)
        });
        let bounds = bounds.iter().fold(Bounds::NONE, Bounds::and);
        let (sorted, order) = sorted(&views, &bounds);
        Self { views, sorted, order, starts }
    }

    /// Number of CVs.
    pub(super) fn len(&self) -> usize {
        self.views.len()
    }

    /// The indices of all CVs, sorted so that successive ones are close to each other.
    pub(super) fn sorted(&self) -> &[u32] {
        &self.sorted
    }

    /// All CVs, curve by curve.
    pub(super) fn all(&self) -> &[View] {
        &self.views
    }

    /// The CVs with these indices, of which there is at least one; others repeat the first.
    #[inline]
    pub(super) fn group(&self, cvs: &[u32]) -> [View; LANES] {
        let mut group = [self.views[cvs[0] as usize]; LANES];
        for (view, cv) in group.iter_mut().zip(cvs) {
            *view = self.views[*cv as usize];
        }
        group
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

/// The indices of views sorted by cell (stable), and the index there of each.
fn sorted(views: &[View], bounds: &Bounds) -> (Vec<u32>, Vec<u32>) {
    let mut bits = 1;
    while bits < FINEST && IN_CELL << (2 * bits) < views.len() {
        bits += 1;
    }
    let grid = Grid::around(bounds, bits);
    let mut cells = vec![0; views.len()];
    let (path, tasks) = (Path::chosen(), cells.chunks_mut(TASK_CELLS).zip(views.chunks(TASK_CELLS)));
    parallel::for_each(tasks, |_, (cells, views)| write_cells(path, views, &grid, cells));
    let mut next = vec![0_u32; (2 << (2 * bits)) + 1];
    for cell in &cells {
        next[*cell as usize + 1] += 1;
    }
    let mut sum = 0;
    for count in &mut next {
        sum += *count;
        *count = sum;
    }
    let mut sorted = vec![0; views.len()];
    let mut order = cells;
    for (view, index) in order.iter_mut().enumerate() {
        let next = &mut next[*index as usize];
        *index = *next;
        sorted[*next as usize] = view as u32;
        *next += 1;
    }
    (sorted, order)
}

/// Smallest and largest coordinates; NaN is ignored.
#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    const NONE: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    #[inline]
    fn and(self, other: &Self) -> Self {
        Self {
            low: [0, 1, 2].map(|axis| self.low[axis].min(other.low[axis])),
            high: [0, 1, 2].map(|axis| self.high[axis].max(other.high[axis])),
        }
    }
}

/// Cells across the wind, in two layers: CVs of the windward half have little upwind of them, those of the other half
/// much. A group of both would test much for all.
struct Grid {
    low: [f32; 2],
    /// Cells per unit of length.
    fine: [f32; 2],
    /// Index of the last cell along an axis.
    last: f32,
    /// Where the windward layer begins.
    middle: f32,
    bits: u32,
}

impl Grid {
    /// 2^`bits` cells along each axis of each layer.
    fn around(Bounds { low, high }: &Bounds, bits: u32) -> Self {
        let last = ((1_u32 << bits) - 1) as f32;
        let size = (high[0] - low[0]).max(high[1] - low[1]);
        let fine = if size > 0.0 && size < f32::INFINITY { (last + 1.0) / size } else { 0.0 };
        let middle = 0.5 * low[2] + 0.5 * high[2];
        Self { low: [low[0], low[1]], fine: [fine; 2], last, middle, bits }
    }

    /// The layer of a point, and its cell in there; any for NaN.
    #[inline(always)]
    fn cell(&self, at: Vec3) -> [u32; 3] {
        // A signed number is converted in fewer instructions.
        let along = |axis: usize| ((at[axis] - self.low[axis]) * self.fine[axis]).clamp(0.0, self.last) as i32 as u32;
        [along(0), along(1), u32::from(at[2] > self.middle)]
    }
}

kernel! {
    /// Writes the views of curves, whose first CV is the first of `points` and row `row` of a mask; returns their bounds.
    fn write_views(
        frame: &Frame,
        curves: &[u32],
        points: &[Vec3],
        shield: &Shield<'_>,
        row: usize,
        views: &mut [View],
    ) -> Bounds = write_views_body;
}

#[inline(always)]
fn write_views_body(
    frame: &Frame,
    curves: &[u32],
    points: &[Vec3],
    shield: &Shield<'_>,
    row: usize,
    views: &mut [View],
) -> Bounds {
    let reach = frame.length(Masked::uniform(shield.offset.value).at(0));
    let (mut low, mut high) = ([F32x16::splat(f32::INFINITY); 3], [F32x16::splat(f32::NEG_INFINITY); 3]);
    for (views, points) in views.chunks_mut(LANES).zip(points.chunks(LANES)) {
        // A lane without a CV repeats the first.
        let mut at = points[0].map(F32x16::splat);
        for lane in 0..views.len() {
            set(&mut at, lane, points[lane]);
        }
        let at = frame.at_lanes(&at);
        for axis in 0..3 {
            low[axis] = at[axis].least(&low[axis]);
            high[axis] = at[axis].most(&high[axis]);
        }
        for lane in 0..views.len() {
            (views[lane].at, views[lane].reach) = (get(&at, lane), reach);
        }
    }
    if shield.offset.mask.is_some() {
        for k in 0..views.len() {
            views[k].reach = frame.length(shield.offset.at(row + k));
        }
    }
    for k in 1..curves.len() {
        let cvs = (curves[k - 1] - curves[0]) as usize..(curves[k] - curves[0]) as usize;
        let gap = frame.gap(&points[cvs.clone()], shield.skin_gap);
        for view in &mut views[cvs] {
            view.gap = gap;
        }
    }
    let mut bounds = Bounds::NONE;
    for lane in 0..LANES {
        bounds = bounds.and(&Bounds { low: get(&low, lane), high: get(&high, lane) });
    }
    bounds
}

kernel! {
    /// The index of each view's cell along a Hilbert curve through its layer.
    fn write_cells(views: &[View], grid: &Grid, cells: &mut [u32]) = write_cells_body;
}

#[inline(always)]
fn write_cells_body(views: &[View], grid: &Grid, cells: &mut [u32]) {
    for (views, cells) in views.chunks(LANES).zip(cells.chunks_mut(LANES)) {
        let mut at = [F32x16::splat(0.0); 3];
        for lane in 0..views.len() {
            set(&mut at, lane, views[lane].at);
        }
        let (mut x, mut y, mut layer) = ([0; LANES], [0; LANES], [0; LANES]);
        for lane in 0..LANES {
            [x[lane], y[lane], layer[lane]] = grid.cell(get(&at, lane));
        }
        let along = hilbert(x, y, grid.bits);
        for lane in 0..cells.len() {
            cells[lane] = along[lane] + (layer[lane] << (2 * grid.bits));
        }
    }
}

/// The positions along a Hilbert curve of cells of a grid of 2^`bits` cells a side. Cells that follow each other touch,
/// unlike those along a Z-order curve, whose jumps make some groups of CVs wide.
#[inline(always)]
fn hilbert(mut x: [u32; LANES], mut y: [u32; LANES], bits: u32) -> [u32; LANES] {
    let mut along = [0; LANES];
    for bit in (0..bits).rev() {
        for lane in 0..LANES {
            let (right, up) = (x[lane] >> bit & 1, y[lane] >> bit & 1);
            along[lane] = along[lane] << 2 | ((right << 1 | right) ^ up);
            // The curve through the two lower quadrants is turned: axes swap, in the right one also both ends.
            let lower = up.wrapping_sub(1);
            let swapped = (x[lane] ^ y[lane]) & lower;
            let flip = lower & 0_u32.wrapping_sub(right);
            (x[lane], y[lane]) = (x[lane] ^ swapped ^ flip, y[lane] ^ swapped ^ flip);
        }
    }
    along
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
        let at = |index: &u32| views.views[views.sorted()[*index as usize] as usize].at;
        let found: Vec<Vec3> = (0..views.curves()).flat_map(|curve| views.of_curve(curve)).map(at).collect();
        assert_eq!(found, points.iter().map(|point| frame.at(*point)).collect::<Vec<_>>());
        let cells: Vec<u32> = {
            let of_view = |view: &View| Bounds { low: view.at, high: view.at };
            let bounds = views.views.iter().fold(Bounds::NONE, |bounds, view| bounds.and(&of_view(view)));
            let grid = Grid::around(&bounds, 1);
            let sorted: Vec<View> = views.sorted().iter().map(|cv| views.views[*cv as usize]).collect();
            let mut cells = vec![0; sorted.len()];
            write_cells(Path::chosen(), &sorted, &grid, &mut cells);
            cells
        };
        assert!(cells.is_sorted() && cells[0] < cells[7], "{cells:?}");
    }

    #[test]
    fn a_hilbert_curve_passes_each_cell_once_and_never_jumps() {
        for bits in 1..=5 {
            let side = 1 << bits;
            let mut cells = vec![None; 1 << (2 * bits)];
            for x in 0..side {
                for y in 0..side {
                    let along = hilbert([x; LANES], [y; LANES], bits)[0];
                    assert!(cells[along as usize].replace([x, y]).is_none());
                }
            }
            let cells: Vec<[u32; 2]> = cells.into_iter().map(|cell| cell.unwrap()).collect();
            for pair in cells.windows(2) {
                assert_eq!(pair[0][0].abs_diff(pair[1][0]) + pair[0][1].abs_diff(pair[1][1]), 1, "{bits} {pair:?}");
            }
        }
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
