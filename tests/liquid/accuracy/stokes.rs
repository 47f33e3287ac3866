//! A viscous step of a flow that is known.

use std::f64::consts::PI;

use liquid::fields::largest;
use liquid::rows::{CellRows, Periods};
use liquid::velocity::Site;
use liquid::viscosity::{StokesGrid, StokesSolver, StokesStop};

use super::*;

/// Viscosity · Δt ÷ density, m²: pressure and viscosity decide, inertia hardly.
const THICKNESS: f64 = 1.0;

pub(super) fn figures(effort: Effort) -> Vec<Figure> {
    let sizes = effort.choose(&[8, 16, 32][..], &[16, 32, 64, 128]);
    let solved: Vec<(f64, u32)> = sizes.iter().map(|n| manufactured(*n)).collect();
    let orders: Vec<f64> = solved.windows(2).map(|pair| libm::log2(pair[0].0 / pair[1].0)).collect();
    let (first, last) = (f64::from(solved[0].1), f64::from(solved[solved.len() - 1].1));
    vec![
        Figure::within("a manufactured flow in a box, 16³…128³ cells: order of accuracy", &orders, [1.8, 2.3])
            .has_coarse_form(effort),
        Figure::within("its iterations in the finest grid ÷ in the coarsest", &[last / first], [0.5, 2.0])
            .has_coarse_form(effort),
    ]
}

/// A flow in a box of 1 m that is 0 at all walls and keeps volume, and what a step must start from to end in it under a
/// pressure of cos πx cos πy cos πz.
fn flow([x, y, z]: [f64; 3]) -> [[f64; 3]; 2] {
    let wave = |x: f64| {
        let ((sin, cos), (sin_2, cos_2)) = (libm::sincos(PI * x), libm::sincos(2.0 * PI * x));
        // sin² and sin 2, their second derivatives, cos and its derivative.
        let square = [sin * sin, 2.0 * PI * PI * cos_2];
        (square, [sin_2, -4.0 * PI * PI * sin_2], [cos, -PI * sin])
    };
    let [(sx, tx, cx), (sy, ty, cy), (sz, _, cz)] = [wave(x), wave(y), wave(z)];
    let product = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        let laplacian = a[1] * b[0] * c[0] + a[0] * b[1] * c[0] + a[0] * b[0] * c[1];
        [a[0] * b[0] * c[0], laplacian]
    };
    let [u, v] = [product(sx, ty, sz), product(tx, sy, sz).map(|x| -x)];
    let gradient = [cx[1] * cy[0] * cz[0], cx[0] * cy[1] * cz[0], cx[0] * cy[0] * cz[1]];
    let before = |of: [f64; 2], axis: usize| of[0] - THICKNESS * of[1] + gradient[axis];
    [[u[0], v[0], 0.0], [before(u, 0), before(v, 1), before([0.0; 2], 2)]]
}

/// The largest error of the velocity in `n`³ cells ÷ the largest velocity, and the iterations to a millionth.
fn manufactured(n: i32) -> (f64, u32) {
    let rows = CellRows::cuboid([0; 3], [n; 3]);
    let level_set = vec![-9.0; rows.len()];
    let open = rows.tabulate_each(|cell| [0, 1, 2].map(|axis| if cell[axis] == 0 { 0.0 } else { 1.0 }));
    let solid = rows.tabulate_each(|cell| {
        [0, 1, 2]
            .map(|axis| Site::FACES[axis].of(cell).iter().fold(f32::MAX, |least, x| least.min(*x).min(n as f32 - x)))
    });
    let (size, density) = (f64::from(n), vec![1.0; rows.len()]);
    let viscosity = vec![(THICKNESS * size * size) as f32; rows.len()];
    let [[open_x, open_y, open_z], [x, y, z]] = [&open, &solid];
    let solver = StokesSolver::new(&StokesGrid {
        rows: &rows,
        level_set: &level_set,
        open: [open_x, open_y, open_z],
        solid_distance: [x, y, z],
        density: &density,
        viscosity: &viscosity,
        slip: &|_, _| 0.0,
        periods: Periods::NONE,
    });
    let on_faces = |which: usize| -> [Vec<f64>; 3] {
        solver.rows().tabulate_each(|cell| {
            let at = solver.rows().find(cell);
            [0, 1, 2].map(|axis| {
                let place = Site::FACES[axis].of(cell).map(|x| f64::from(x) / size);
                at.filter(|at| solver.is_free(axis, *at)).map_or(0.0, |_| flow(place)[which][axis])
            })
        })
    };
    let (exact, before) = (on_faces(0), on_faces(1));
    let fastest = exact.iter().map(|u| largest(u)).fold(0.0, f64::max);
    let len = solver.rows().len();
    let (mut found, mut q) = (exact.each_ref().map(|u| vec![0.0; u.len()]), vec![0.0; len]);
    let stop = StokesStop { velocity: 1e-6 * fastest, flow: 1e-6 * fastest, iterations: 100 };
    let solved = solver.solve(&before, &mut found, &mut q, &vec![0.0; len], stop);
    let errors = found.iter().zip(&exact).map(|(found, exact)| error(found, exact));
    (errors.take(2).fold(0.0, f64::max), solved.iterations)
}
