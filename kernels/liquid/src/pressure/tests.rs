use super::*;
use crate::open_share::open_share;
use crate::rows::Cell;
use crate::stencil::Run;
use numerics::vector::{length, sub};

/// What a test solves on: liquid where `level_set` < 0, in a box of `n`³ cells of size 1 with walls all round.
struct Case {
    rows: CellRows,
    level_set: Vec<f32>,
    weights: [Vec<f32>; 3],
}

impl Case {
    fn new(n: i32, level_set: impl Fn([f32; 3]) -> f32 + Sync, solid: impl Fn([f32; 3]) -> f32 + Sync) -> Self {
        let rows = CellRows::cuboid([0; 3], [n; 3]);
        let level_set = rows.tabulate(|cell| level_set(cell.map(|i| i as f32 + 0.5)));
        let weights = rows.tabulate_each(|cell| [0, 1, 2].map(|axis| open_face(&solid, cell, axis)));
        Self { rows, level_set, weights }
    }

    fn solver(&self) -> PressureSolver {
        let [x, y, z] = &self.weights;
        PressureSolver::new(&PressureGrid {
            rows: &self.rows,
            level_set: &self.level_set,
            weights: [x, y, z],
            periods: Periods::NONE,
        })
    }

    fn weight(&self, axis: usize, cell: Cell) -> f64 {
        self.rows.find(cell).map_or(0.0, |at| f64::from(self.weights[axis][at]))
    }

    /// The net inflow of each cell of the solver for a velocity at low faces.
    fn inflow(&self, solver: &PressureSolver, velocity: impl Fn(usize, Cell) -> f64 + Sync) -> Vec<f64> {
        solver.rows().tabulate(|cell| {
            let through = |axis, face| self.weight(axis, face) * velocity(axis, face);
            let net = |axis: usize| {
                let mut above = cell;
                above[axis] += 1;
                through(axis, cell) - through(axis, above)
            };
            net(0) + net(1) + net(2)
        })
    }

    /// The largest net flow of a liquid cell once the gradient of `q` is taken from `velocity`.
    fn left(&self, solver: &PressureSolver, q: &[f64], velocity: impl Fn(usize, Cell) -> f64 + Sync) -> f64 {
        let rows = solver.rows();
        let mut changed: [Vec<f64>; 3] = rows.tabulate_each(|cell| [0, 1, 2].map(|axis| velocity(axis, cell)));
        solver.for_each_gradient(q, |axis, at, gradient| changed[axis][at] -= gradient);
        let after = self.inflow(solver, |axis, cell| rows.find(cell).map_or(0.0, |at| changed[axis][at]));
        solver.stencil().runs().iter().flat_map(Run::range).map(|at| after[at].abs()).fold(0.0, f64::max)
    }
}

fn open_face(solid: &impl Fn([f32; 3]) -> f32, cell: Cell, axis: usize) -> f32 {
    if cell[axis] == 0 {
        return 0.0;
    }
    open_share([(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| {
        let mut node = cell;
        node[(axis + 1) % 3] += a;
        node[(axis + 2) % 3] += b;
        solid(node.map(|i| i as f32))
    }))
}

fn ball(centre: [f32; 3], radius: f32) -> impl Fn([f32; 3]) -> f32 {
    move |p| length(sub(p, centre)) - radius
}

const EXACT: Stop = Stop { flow: 1e-12, iterations: 60 };

/// A velocity without any order, the same wherever it is asked for: between −1 and 1.
fn noise(axis: usize, cell: Cell) -> f64 {
    let mut bits = (cell[0] as u64) << 40 ^ (cell[1] as u64) << 20 ^ cell[2] as u64 ^ (axis as u64) << 60;
    bits = (bits ^ bits >> 31).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ bits >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// Pressure grows with depth below the surface, wherever the surface cuts its cells and whatever solid cuts the liquid:
/// ρ g depth, so q = velocity of one step · depth in cells.
#[test]
fn a_pool_at_rest_has_the_pressure_of_its_depth_exactly() {
    let depth = 9.3;
    let (ball, floor) = (ball([7.0, 4.0, 8.5], 3.2), |p: [f32; 3]| p[1] - 0.4 - 0.1 * p[0]);
    let case = Case::new(16, |p| p[1] - depth, |p| ball(p).min(floor(p)));
    let solver = case.solver();
    let falling = |axis: usize, _: Cell| if axis == 1 { -0.25 } else { 0.0 };
    let mut residual = case.inflow(&solver, falling);
    let mut q = vec![0.0; residual.len()];
    let solved = solver.solve(&mut residual, &mut q, EXACT);
    assert!(solved.flow <= 1e-12 && solved.iterations < 30, "{solved:?}");
    for cell in solver.stencil().active().iter() {
        let q = q[solver.rows().find(cell).unwrap()];
        let expected = 0.25 * (f64::from(depth) - f64::from(cell[1]) - 0.5);
        assert!((q - expected).abs() < 1e-6, "{cell:?}: {q} {expected}");
    }
    // θ is stored in f32.
    assert!(case.left(&solver, &q, falling) < 1e-7);
    // The same step again starts from its own solution.
    let again = solver.solve(&mut case.inflow(&solver, falling), &mut q, Stop { flow: 1e-9, iterations: 60 });
    assert_eq!(again.iterations, 0);
}

#[test]
fn no_net_flow_is_left_of_any_velocity() {
    let (ball, other) = (ball([10.0, 10.0, 10.0], 8.3), ball([20.0, 22.0, 21.0], 5.0));
    let case = Case::new(28, |p| ball(p).min(other(p)), |p| p[0] + p[1] - 8.3);
    let solver = case.solver();
    let mut residual = case.inflow(&solver, noise);
    let mut q = vec![0.0; residual.len()];
    let solved = solver.solve(&mut residual, &mut q, Stop { flow: 1e-7, iterations: 60 });
    assert!(solved.flow < 1e-7 && solved.unbalanced == 0.0, "{solved:?}");
    assert!(case.left(&solver, &q, noise) < 1e-5);
}

/// A component that is closed all round takes no net inflow; its pressure is known but for a constant, and other
/// components do not suffer.
#[test]
fn a_full_box_is_solved_and_what_cannot_leave_it_is_told() {
    let lid = |p: [f32; 3]| (p[1] - 8.0).abs() - 0.6;
    let case = Case::new(16, |p| if p[1] < 8.0 { -1.0 } else { p[1] - 12.2 }, lid);
    let solver = case.solver();
    let mut residual = case.inflow(&solver, noise);
    let sealed = |cell: Cell| cell[1] < 8;
    let cells = solver.stencil().active().iter().filter(|cell| sealed(*cell)).count();
    // An inflow of 1 m/s into one cell of the sealed half.
    residual[solver.rows().find([3, 3, 3]).unwrap()] += 1.0;
    let mut q = vec![0.0; residual.len()];
    let solved = solver.solve(&mut residual, &mut q, Stop { flow: 1e-7, iterations: 60 });
    assert!(solved.flow < 1e-7, "{solved:?}");
    assert!((solved.unbalanced - 1.0 / cells as f64).abs() < 1e-6, "{solved:?} {cells}");
}

#[test]
fn iterations_hardly_grow_with_the_grid() {
    let iterations = [16, 32, 64].map(|n| {
        let size = n as f32;
        let ball = ball([0.4 * size, 0.3 * size, 0.5 * size], 0.2 * size);
        let case = Case::new(n, |p| p[1] - 0.5 * size, ball);
        let solver = case.solver();
        let mut residual = case.inflow(&solver, noise);
        let mut q = vec![0.0; residual.len()];
        solver.solve(&mut residual, &mut q, Stop { flow: 1e-5, iterations: 60 }).iterations
    });
    assert!(iterations[2] <= 2 * iterations[0] && iterations[2] <= 16, "{iterations:?}");
}

/// A surface that passes the centres of cells at any distance, as in a splash, down to where a cell holds next to nothing. A
/// correction from a coarser grid that did not know of that distance, and a guess that knows of another one, would take 31 and
/// 35 iterations.
#[test]
fn rough_surfaces_and_pressures_of_other_surfaces_cost_few_iterations() {
    let rough = |turn: i32| {
        let ball = ball([20.3, 19.6, 20.1], 14.0);
        move |p: [f32; 3]| {
            let by = noise(0, p.map(|x| x as i32 + 100 * turn)) as f32;
            if ball(p).abs() < 1.5 { by * by * by } else { ball(p) }
        }
    };
    let [before, case] = [1, 2].map(|turn| Case::new(40, rough(turn), |_| 1.0));
    let stop = Stop { flow: 1e-5, iterations: 60 };
    let (old, solver) = (before.solver(), case.solver());
    let mut guess = vec![0.0; old.rows().len()];
    old.solve(&mut before.inflow(&old, noise), &mut guess, stop);
    let iterations = |mut q: Vec<f64>| {
        let solved = solver.solve(&mut case.inflow(&solver, noise), &mut q, stop);
        assert!(solved.flow <= stop.flow && case.left(&solver, &q, noise) < 2e-5, "{solved:?}");
        solved.iterations
    };
    let from_zero = iterations(vec![0.0; solver.rows().len()]);
    let guessed = iterations(solver.rows().resampled(old.rows(), &guess, 0.0));
    assert!(from_zero <= 7 && guessed <= from_zero, "{from_zero} {guessed}");
}

#[test]
fn drops_of_one_cell_and_no_liquid_at_all_are_solved() {
    let none = Case::new(8, |_| 1.0, |_| 1.0);
    let solver = none.solver();
    let solved = solver.solve(&mut none.inflow(&solver, noise), &mut vec![0.0; solver.rows().len()], EXACT);
    assert_eq!(solved, Solved::default());
    let drops = Case::new(24, |p| if p.iter().all(|x| *x as i32 % 3 == 1) { -0.3 } else { 0.2 }, |_| 1.0);
    let solver = drops.solver();
    assert_eq!(solver.stencil().active().len(), 512);
    let mut q = vec![0.0; solver.rows().len()];
    let solved = solver.solve(&mut drops.inflow(&solver, noise), &mut q, Stop { flow: 1e-9, iterations: 60 });
    assert!(solved.flow <= 1e-9, "{solved:?}");
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let pressure = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let ball = ball([17.0, 20.0, 16.0], 14.0);
            let case = Case::new(40, ball, |p| p[1] - 9.3);
            let solver = case.solver();
            let mut q = vec![0.0; solver.rows().len()];
            solver.solve(&mut case.inflow(&solver, noise), &mut q, Stop { flow: 1e-6, iterations: 60 });
            q.iter().map(|q| q.to_bits()).collect::<Vec<_>>()
        })
    };
    let one = pressure(1);
    assert!(one.iter().any(|bits| *bits != 0));
    assert!(one == pressure(2) && one == pressure(7));
}
