use super::*;
use crate::rows::Cell;
use numerics::vector::{length, sub};

/// Liquid where `level_set` < 0 in a box of cells of size 1 with walls all round.
struct Case {
    rows: CellRows,
    level_set: Vec<f32>,
    open: FaceFields<f32>,
    solid: FaceFields<f32>,
    viscosity: Vec<f32>,
    slip: f32,
    periods: Periods,
}

impl Case {
    fn new(size: Cell, viscosity: f32, level_set: impl Fn([f32; 3]) -> f32 + Sync) -> Self {
        let rows = CellRows::cuboid([0; 3], size);
        let level_set = rows.tabulate(|cell| level_set(cell.map(|i| i as f32 + 0.5)));
        let open = rows.tabulate_each(|cell| [0, 1, 2].map(|axis| if cell[axis] == 0 { 0.0 } else { 1.0 }));
        let solid = rows.tabulate_each(|cell| {
            [0, 1, 2].map(|axis| {
                let at = |other: usize| cell[other] as f32 + if other == axis { 0.0 } else { 0.5 };
                (0..3).map(|other| at(other).min(size[other] as f32 - at(other))).fold(f32::MAX, f32::min)
            })
        });
        let viscosity = vec![viscosity; rows.len()];
        Self { rows, level_set, open, solid, viscosity, slip: 0.0, periods: Periods::NONE }
    }

    fn ball(n: i32, viscosity: f32) -> Self {
        let middle = 0.5 * n as f32;
        Self::new([n; 3], viscosity, |p| length(sub(p, [middle; 3])) - 0.33 * n as f32)
    }

    fn solver(&self) -> StokesSolver {
        let density = vec![1.0; self.rows.len()];
        let [[ox, oy, oz], [sx, sy, sz]] = [&self.open, &self.solid];
        StokesSolver::new(&StokesGrid {
            rows: &self.rows,
            level_set: &self.level_set,
            open: [ox, oy, oz],
            solid_distance: [sx, sy, sz],
            density: &density,
            viscosity: &self.viscosity,
            slip: &|_, _| self.slip,
            periods: self.periods,
        })
    }
}

/// A velocity at free faces from the faces' positions.
fn velocity(solver: &StokesSolver, of: impl Fn([f64; 3]) -> [f64; 3] + Sync) -> FaceFields<f64> {
    solver.rows().tabulate_each(|cell| {
        let at = solver.rows().find(cell).unwrap();
        [0, 1, 2].map(|axis| {
            let position = [0, 1, 2].map(|other| f64::from(cell[other]) + if other == axis { 0.0 } else { 0.5 });
            if solver.is_free(axis, at) { of(position)[axis] } else { 0.0 }
        })
    })
}

fn solve(solver: &StokesSolver, u: &mut FaceFields<f64>, tolerance: f64) -> StokesSolved {
    let len = solver.rows().len();
    let stop = StokesStop { velocity: tolerance, flow: tolerance, iterations: 80 };
    let before = u.clone();
    solver.solve(&before, u, &mut vec![0.0; len], &vec![0.0; len], stop)
}

/// A velocity without any order, between −1 and 1.
fn noise([x, y, z]: [f64; 3]) -> [f64; 3] {
    [0_u64, 1, 2].map(|axis| {
        let mut bits = ((2.0 * x) as u64) << 40 ^ ((2.0 * y) as u64) << 20 ^ (2.0 * z) as u64 ^ axis << 60;
        bits = (bits ^ bits >> 31).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        bits = (bits ^ bits >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    })
}

fn largest_difference(a: &FaceFields<f64>, b: &FaceFields<f64>) -> f64 {
    let differences = (0..3).flat_map(|axis| a[axis].iter().zip(&b[axis]).map(|(a, b)| (a - b).abs()));
    differences.fold(0.0, f64::max)
}

/// Viscosity does not resist a body that falls, or turns without strain: the viscous part of a turn of 0.05 a step is
/// rounding alone. (Pressure answers its centrifugal force in the next step.)
#[test]
fn rigid_motions_are_kept_whatever_the_viscosity() {
    for viscosity in [LIGHT, 1.0, 1e4, 1e9] {
        let solver = Case::ball(20, viscosity).solver();
        let turning = |[x, y, z]: [f64; 3]| {
            [0.05 * (z - 10.0) - 0.02 * (y - 10.0), 0.02 * (x - 10.0) - 0.4, -0.05 * (x - 10.0) + 0.1]
        };
        let before = velocity(&solver, turning);
        let mut u = before.clone();
        let solved = solve(&solver, &mut u, 1e-5);
        assert_eq!(solved.iterations, 0, "{viscosity:e}: {solved:?}");
        assert_eq!(largest_difference(&u, &before), 0.0);
    }
}

/// The momentum of noise is that of the rigid motion it becomes: nearly rigid liquid keeps its spin.
#[test]
fn nearly_rigid_liquid_turns_noise_into_rigid_motion() {
    let solver = Case::ball(24, 1e8).solver();
    let turning = |[x, y, z]: [f64; 3]| [0.1 * (z - 12.0), 0.3, -0.1 * (x - 12.0) + 0.02 * (y - 12.0)];
    let mut u = velocity(&solver, |p| [0, 1, 2].map(|axis| turning(p)[axis] + 0.1 * noise(p)[axis]));
    let before = u.clone();
    let solved = solve(&solver, &mut u, 1e-7);
    assert!(solved.velocity < 1e-7 && solved.flow < 1e-7, "{solved:?}");
    let level = solver.viscous.finest();
    let momentum = |u: &FaceFields<f64>| {
        let mut sums = [0.0; 4];
        for (at, [x, _, z]) in level.rows().iter().enumerate() {
            let mass = |axis: usize| f64::from(level.mass[axis][at]) * u[axis][at];
            (0..3).for_each(|axis| sums[axis] += mass(axis));
            sums[3] += mass(0) * (f64::from(z) + 0.5 - 12.0) - mass(2) * (f64::from(x) + 0.5 - 12.0);
        }
        sums
    };
    let (before, after) = (momentum(&before), momentum(&u));
    let mass: f64 = level.mass.iter().flatten().map(|mass| f64::from(*mass)).sum::<f64>() / 3.0;
    for axis in 0..3 {
        assert!((after[axis] - before[axis]).abs() < 2e-3 * 0.3 * mass, "{axis}: {before:?} {after:?}");
    }
    assert!((after[3] / before[3] - 1.0).abs() < 5e-3, "{before:?} {after:?}");
    // No strain is left.
    let mut stresses = Stresses::zero(level.rows().len());
    let mut product = u.clone();
    level.apply(&mut u, &mut stresses, &mut product);
    let strained = (0..3).flat_map(|axis| product[axis].iter().zip(&u[axis]).zip(&level.mass[axis]));
    let force = strained.map(|((product, u), mass)| (product - u * f64::from(*mass)).abs()).fold(0.0, f64::max);
    assert!(force < 1.0, "{force}");
}

/// What is solved for by smoothing alone has the same velocity, in about as many iterations, as what is solved for by multigrid.
#[test]
fn light_liquid_goes_over_into_viscous_liquid() {
    let free = |p: [f32; 3]| length(sub(p, [12.0; 3])) - 7.9;
    let on_floor = |p: [f32; 3]| p[1] - 9.3 - 0.2 * p[0];
    let shapes: [&(dyn Fn([f32; 3]) -> f32 + Sync); 2] = [&free, &on_floor];
    for shape in shapes {
        let solved = [LIGHT, 1.0001 * LIGHT].map(|viscosity| {
            let solver = Case::new([24; 3], viscosity, shape).solver();
            assert_eq!(solver.viscous.grids().len() == 1, viscosity <= LIGHT);
            let mut u = velocity(&solver, noise);
            let solved = solve(&solver, &mut u, 1e-7);
            assert!(solved.velocity <= 1e-7 && solved.flow <= 1e-7, "{solved:?}");
            (u, solved.iterations)
        });
        let [(light, few), (viscous, more)] = solved;
        assert!(largest_difference(&light, &viscous) < 1e-4, "{}", largest_difference(&light, &viscous));
        assert!(few <= more + more / 4, "{few} {more}");
    }
}

/// Taylor–Green vortices in a full box with free-slip walls decay by the grid's own wave number: a step divides them by
/// 1 + ν̂·2(2 − 2 cos k).
#[test]
fn vortices_decay_at_the_rate_of_the_grid() {
    let n = 16;
    let k = std::f64::consts::PI / f64::from(n);
    for viscosity in [0.1, 10.0, 1e4] {
        let mut case = Case::new([n, n, 4], viscosity, |_| -1.0);
        case.slip = 1.0;
        let solver = case.solver();
        let (sin, cos) = (libm::sin, libm::cos);
        let vortex = |[x, y, _]: [f64; 3]| [sin(k * x) * cos(k * y), -cos(k * x) * sin(k * y), 0.0];
        let before = velocity(&solver, vortex);
        let mut u = before.clone();
        let solved = solve(&solver, &mut u, 1e-12);
        let decay = 1.0 / (1.0 + f64::from(viscosity) * 2.0 * (2.0 - 2.0 * cos(k)));
        let expected = before.map(|u| u.iter().map(|u| u * decay).collect());
        assert!(largest_difference(&u, &expected) < 1e-9, "{viscosity}: {solved:?}");
    }
}

/// Flow between two plates H apart under a force: g·y(H − y)/(2ν), within 1/N² of its peak at N cells. The ends of the
/// channel move as the flow does.
#[test]
fn flow_between_plates_is_a_parabola_of_order_two() {
    let error = |n: i32| {
        let (viscosity, long) = (1e5, 3 * n);
        let mut case = Case::new([long, n, 4], viscosity, |_| -1.0);
        // Plates have no slip; the sides along the flow are taken far away.
        for axis in 0..3 {
            let rows = &case.rows;
            case.solid[axis] = rows.tabulate(|cell| {
                let y = cell[1] as f32 + if axis == 1 { 0.0 } else { 0.5 };
                y.min(n as f32 - y)
            });
        }
        let solver = case.solver();
        let height = f64::from(n);
        let exact = |y: f64| y * (height - y) / (2.0 * f64::from(viscosity));
        let rows = solver.rows().clone();
        let mut u = velocity(&solver, |_| [1.0, 0.0, 0.0]);
        for (at, [x, y, z]) in rows.iter().enumerate() {
            let is_inside = (0..n).contains(&y) && (0..4).contains(&z);
            if is_inside && (x == 0 || x == long) {
                u[0][at] = exact(f64::from(y) + 0.5);
            }
            // The sides move along, so that they do not hold the flow.
            if !(0..4).contains(&z) && (0..n).contains(&y) && (0..=long).contains(&x) {
                u[0][at] = exact(f64::from(y) + 0.5);
            }
        }
        // What the moving ends drive in and out.
        let mut inflow = vec![0.0; rows.len()];
        for (y, z) in (0..n).flat_map(|y| (0..4).map(move |z| (y, z))) {
            inflow[rows.find([0, y, z]).unwrap()] = exact(f64::from(y) + 0.5);
            inflow[rows.find([long - 1, y, z]).unwrap()] = -exact(f64::from(y) + 0.5);
        }
        let stop = StokesStop { velocity: 1e-8, flow: 1e-8, iterations: 200 };
        let before = u.clone();
        let solved = solver.solve(&before, &mut u, &mut vec![0.0; rows.len()], &inflow, stop);
        assert!(solved.iterations < 200, "{solved:?}");
        let column = (0..n).map(|y| (y, u[0][rows.find([long / 2, y, 2]).unwrap()]));
        let error = column.map(|(y, u)| (u - exact(f64::from(y) + 0.5)).abs()).fold(0.0, f64::max);
        error / exact(0.5 * height)
    };
    let (coarse, fine) = (error(8), error(16));
    assert!(coarse < 0.03 && fine < 0.3 * coarse, "{coarse} {fine}");
}

/// A slender column on a foot without friction sags at ρgH²/(6μ): three times the viscosity resists stretching. Solving
/// viscosity and pressure one after the other makes it 1.5 times too fast.
#[test]
fn a_slender_column_sags_at_three_times_its_viscosity() {
    for viscosity in [1e5, 1e8] {
        let (wide, high) = (8.0, 40.0);
        let mut case = Case::new([16, 44, 16], viscosity, |p| {
            let [x, y, z] = [(p[0] - 8.0).abs() - 0.5 * wide, p[1] - high, (p[2] - 8.0).abs() - 0.5 * wide];
            x.max(y).max(z)
        });
        case.slip = 1.0;
        let solver = case.solver();
        let mut u = velocity(&solver, |_| [0.0, -1.0, 0.0]);
        let solved = solve(&solver, &mut u, 1e-4 / f64::from(viscosity));
        let top = -u[1][solver.rows().find([8, 40, 8]).unwrap()];
        let expected = f64::from(high * high) / (6.0 * f64::from(viscosity));
        assert!((top / expected - 1.0).abs() < 0.05, "{viscosity:e}: {} {solved:?}", top / expected);
    }
}

#[test]
fn iterations_hardly_grow_with_the_grid_or_the_viscosity() {
    for viscosity in [1e-2, 1.0, 1e3, 1e6, 1e9] {
        let iterations = [16, 32].map(|n| {
            let solver = Case::ball(n, viscosity).solver();
            let mut u = velocity(&solver, noise);
            let solved = solve(&solver, &mut u, 1e-3);
            assert!(solved.velocity <= 1e-3 && solved.flow <= 1e-3, "{viscosity:e} {n}: {solved:?}");
            solved.iterations
        });
        assert!(iterations.iter().all(|iterations| *iterations <= 30), "{viscosity:e}: {iterations:?}");
    }
}

/// Without pressure, too: noise on a ball becomes what viscosity makes of it, whose own force is in balance.
#[test]
fn viscosity_alone_takes_few_iterations_whatever_it_is() {
    for viscosity in [1e-2, 1.0, 1e3, 1e6, 1e9] {
        let solver = Case::ball(24, viscosity).solver();
        let turning = |p: [f64; 3]| [0.2 * (p[1] - 12.0) + 0.1, -0.2 * (p[0] - 12.0), 0.3];
        let before = velocity(&solver, |p| [0, 1, 2].map(|axis| turning(p)[axis] + 0.1 * noise(p)[axis]));
        let mut u = before.clone();
        let solved = solver.solve_viscosity(&before, &mut u, ViscousStop { velocity: 1e-6, iterations: 60 });
        assert!(solved.velocity <= 1e-6 && solved.iterations <= 40, "{viscosity:e}: {solved:?}");
        let mut again = before.clone();
        let loose = solver.solve_viscosity(&before, &mut again, ViscousStop { velocity: 1e-2, iterations: 60 });
        assert!(loose.iterations <= solved.iterations && largest_difference(&u, &again) < 5e-2, "{loose:?}");
        let mut rigid = velocity(&solver, turning);
        let start = rigid.clone();
        let kept = solver.solve_viscosity(&start, &mut rigid, ViscousStop { velocity: 1e-6, iterations: 60 });
        assert_eq!((kept.iterations, largest_difference(&rigid, &start)), (0, 0.0), "{viscosity:e}");
    }
    let none = Case::new([8; 3], 1.0, |_| 1.0).solver();
    let mut still = velocity(&none, noise);
    let stop = ViscousStop { velocity: 1e-9, iterations: 10 };
    assert_eq!(none.solve_viscosity(&still.clone(), &mut still, stop), ViscousSolved::default());
}

/// Half of a ball is 1e8 times as viscous as the other half: the stiff half moves as a rigid body.
#[test]
fn a_jump_of_viscosity_is_solved() {
    let mut case = Case::ball(20, 1.0);
    let rows = &case.rows;
    case.viscosity = rows.tabulate(|cell| if cell[0] < 10 { 1e8 } else { 1.0 });
    let solver = case.solver();
    let mut u = velocity(&solver, noise);
    let solved = solve(&solver, &mut u, 1e-4);
    assert!(solved.velocity <= 1e-4 && solved.flow <= 1e-4, "{solved:?}");
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let solved = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let solver = Case::ball(36, 50.0).solver();
            let mut u = velocity(&solver, noise);
            solve(&solver, &mut u, 1e-4);
            u.map(|u| u.iter().map(|u| u.to_bits()).collect::<Vec<_>>())
        })
    };
    let one = solved(1);
    assert!(one.iter().flatten().any(|bits| *bits != 0));
    assert!(one == solved(2) && one == solved(7));
}

#[test]
fn no_liquid_and_single_cells_are_solved() {
    let none = Case::new([8; 3], 1.0, |_| 1.0).solver();
    assert_eq!(solve(&none, &mut velocity(&none, noise), 1e-9).iterations, 0);
    let drops = Case::new([16; 3], 1e6, |p| if p.iter().all(|x| *x as i32 % 4 == 1) { -0.3 } else { 0.2 }).solver();
    let solved = solve(&drops, &mut velocity(&drops, noise), 1e-6);
    assert!(solved.velocity <= 1e-6 && solved.flow <= 1e-6, "{solved:?}");
}

#[test]
fn coarse_grids_are_as_symmetric_as_the_fine_one() {
    // A velocity's work on the force of another is that of the other on its own.
    for lift in [0.0, 0.27, 0.44, 0.81] {
        let case = Case::new([16; 3], 1e6, |p| length(sub(p, [8.0, 7.3 + lift, 8.0])) - 4.5);
        let solver = case.solver();
        let grids = solver.viscous.grids();
        assert!(grids.len() > 1);
        for (number, level) in grids.iter().enumerate() {
            let any = |shift: f64| -> FaceFields<f64> {
                let values = level.rows().tabulate_each(|cell| noise(cell.map(|x| f64::from(x) + shift)));
                let free = |axis: usize, at: usize, u: f64| if level.mass[axis][at] > 0.0 { u } else { 0.0 };
                let own = |axis: usize| values[axis].iter().enumerate().map(|(at, u)| free(axis, at, *u)).collect();
                [own(0), own(1), own(2)]
            };
            let (mut a, mut b) = (any(64.0), any(300.0));
            let len = level.rows().len();
            let mut stresses = Stresses::zero(len);
            let mut force = |u: &mut FaceFields<f64>| {
                let mut out: FaceFields<f64> = std::array::from_fn(|_| vec![0.0; len]);
                level.apply(u, &mut stresses, &mut out);
                out
            };
            let (of_a, of_b) = (force(&mut a), force(&mut b));
            let work = |u: &FaceFields<f64>, f: &FaceFields<f64>| -> f64 {
                (0..3).map(|axis| u[axis].iter().zip(&f[axis]).map(|(u, f)| u * f).sum::<f64>()).sum()
            };
            let scale = (work(&a, &of_a) * work(&b, &of_b)).sqrt();
            let skew = (work(&a, &of_b) - work(&b, &of_a)).abs() / scale;
            assert!(skew < 1e-10, "grid {number}, {lift}: {skew:e}");
        }
    }
}

/// A column whose sides lie between faces, on a floor without friction, is squeezed by its weight and goes nowhere: what
/// moves it along the floor, or turns it about the vertical, is rounding of its weight.
#[test]
fn a_column_on_a_floor_without_friction_is_moved_nowhere() {
    for viscosity in [10.0, 1e4, 1e8] {
        let sides = |x: f32, low: f32, high: f32| (low - x).max(x - high);
        let column = |[x, y, z]: [f32; 3]| sides(x, 3.37, 8.61).max(sides(z, 3.52, 8.48)).max(y - 14.45);
        let solver = Case { slip: 1.0, ..Case::new([12, 20, 12], viscosity, column) }.solver();
        let before = velocity(&solver, |_| [0.0, -1.0, 0.0]);
        let mut u = before.clone();
        solve(&solver, &mut u, 1e-6);
        let level = solver.viscous.finest();
        let (mut weight, mut moved) = (0.0, [0.0; 3]);
        for (at, [x, _, z]) in level.rows().iter().enumerate() {
            let gained = [0, 1, 2].map(|axis| f64::from(level.mass[axis][at]) * (u[axis][at] - before[axis][at]));
            weight += f64::from(level.mass[1][at]);
            moved[0] += gained[0];
            moved[1] += gained[2];
            moved[2] += gained[0] * (f64::from(z) + 0.5) - gained[2] * (f64::from(x) + 0.5);
        }
        assert!(moved.iter().all(|moved| moved.abs() < 1e-6 * weight), "{viscosity:e}: {moved:?} {weight}");
    }
}
