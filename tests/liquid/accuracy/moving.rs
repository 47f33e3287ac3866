//! Flows in which inertia decides.

use liquid::step::Solid;
use liquid::velocity::{MacVelocity, Sampler};

use super::*;

/// T = t·√(2g/a) and Z = front ÷ a of a column twice as high as its base a (Martin and Moyce 1952).
const MEASURED: [(f64, f64); 7] =
    [(1.63, 1.89), (1.83, 2.11), (1.98, 2.33), (2.2, 2.56), (2.32, 2.78), (2.51, 3.0), (2.65, 3.22)];

/// Ghia, Ghia and Shin (1982), Re 100: the least u on the vertical middle, the largest and the least v on the horizontal.
const CAVITY: [f64; 3] = [-0.2140, 0.1796, -0.2538];

pub(super) fn figures(effort: Effort) -> Vec<Figure> {
    let (rest, off) = rest(effort.choose(48, 240));
    let (fronts, slope) = dam(effort.choose(16, 32));
    let found = cavity(effort.choose(&[(16, 12.0), (32, 4.0)], &[(32, 16.0), (64, 6.0), (128, 4.0)]));
    vec![
        Figure::error("a pool at rest: speed ÷ g·Δt", rest, 1e-4, "").has_coarse_form(effort),
        Figure::error("its surface moves, 240 frames", off, 1e-3, " cells").has_coarse_form(effort),
        Figure::error("a stream downhill for 100 frames: speed g·t", stream(), 1e-4, ""),
        Figure::error(
            "vortices in a free-slip box of 64² cells decay at the rate of the grid's second difference",
            vortices(effort.choose(32, 64)),
            0.01,
            "",
        )
        .has_coarse_form(effort),
        Figure::within("a dam breaks: front ÷ measured, T 1.63…2.65", &fronts, [0.95, 1.2]).has_coarse_form(effort),
        Figure::within("slope of the front ÷ 1.304", &[slope / 1.304], [0.92, 1.08]).has_coarse_form(effort),
        Figure::within(
            "a lid drives a full box of 128² cells, Re 100: velocities ÷ Ghia's (1982)",
            &[0, 1, 2].map(|n| found[n] / CAVITY[n]),
            [0.95, 1.05],
        )
        .has_coarse_form(effort),
    ]
}

/// A pool: its largest speed ÷ g·Δt, and how far its surface moves, in cells.
fn rest(count: u32) -> (f64, f64) {
    let around = Surroundings::new(&|_| [0.0, -GRAVITY, 0.0], &|_| 0.0);
    let mut liquid = at_rest(LiquidSettings::new(Domain::closed([0; 3], [16; 3]), 1.0 / 16.0), |p| p[1] - 9.3);
    let mut speed = 0.0_f64;
    for _ in 0..count {
        let report = liquid.step_frame(&around, FRAME);
        let faces = liquid.motion().velocity().faces().iter().flatten();
        let largest = faces.fold(0.0_f32, |most, u| most.max(u.abs()));
        speed = speed.max(f64::from(largest) * f64::from(report.substeps) / (GRAVITY * FRAME));
    }
    let mesh = liquid.surface().mesh(None);
    let free = mesh.points.iter().map(|p| p[1]).filter(|y| *y > 1.0 && (y - y.round()).abs() > 0.2);
    (speed, free.fold(0.0, |most, y| most.max(f64::from((y - 9.3).abs()))))
}

/// A pool between periodic sides, pulled along.
fn stream() -> f64 {
    let settings = LiquidSettings::new(domain([7, 8, 3], [REPEATS, SHUT, SHUT]), 0.1);
    let mut liquid = at_rest(settings, |p| p[1] - 4.3);
    let around = Surroundings::new(&|_| [0.5, -GRAVITY, 0.0], &|_| 0.0);
    frames(&mut liquid, &around, 100, FRAME);
    let found: Vec<f64> = (0..7 * 4).map(|at| face(&liquid, 0, [at % 7, at / 7, 1])).collect();
    error(&found, &vec![0.5 * 100.0 * FRAME; found.len()])
}

/// Taylor–Green vortices at Re 100, a sixth of their life long; the error of their decay.
fn vortices(n: i32) -> f64 {
    let (cell, k) = (1.0 / f64::from(n), std::f64::consts::PI / f64::from(n));
    let settings = LiquidSettings {
        tolerance: 1e-6,
        cfl: 0.5,
        ..LiquidSettings::new(domain([n, n, 1], [SMOOTH, SMOOTH, REPEATS]), cell)
    };
    let mut liquid = at_rest(settings, |_| -9.0);
    let viscosity = 10.0;
    let thickness = |_| viscosity;
    let around = Surroundings::new(&|_| [0.0; 3], &thickness);
    let at = |x: f32| libm::sincos(k * f64::from(x));
    let vortex = |[x, y, _]: Vec3| {
        let ((sin_x, cos_x), (sin_y, cos_y)) = (at(x), at(y));
        [(sin_x * cos_y) as f32, (-cos_x * sin_y) as f32, 0.0]
    };
    liquid.set_velocity(vortex, &around);
    let energy = |liquid: &Liquid<MarkedSurface>| {
        let square = |cell: [i32; 3]| [0, 1].map(|axis| face(liquid, axis, cell)).iter().map(|u| u * u).sum::<f64>();
        (0..n * n).map(|at| square([at % n, at / n, 0])).sum::<f64>()
    };
    let (start, seconds) = (energy(&liquid), 1.0);
    frames(&mut liquid, &around, 24, seconds / 24.0);
    // The rate of the grid's second difference.
    let rate = 2.0 * (2.0 - 2.0 * libm::cos(k)) * viscosity / 1000.0 / (cell * cell);
    ((energy(&liquid) / start).sqrt() / libm::exp(-rate * seconds) - 1.0).abs()
}

/// The front of a slab whose base has `n` cells ÷ that measured, and the slope of the front.
fn dam(n: i32) -> (Vec<f64>, f64) {
    let cell = 0.05715 / f64::from(n);
    let settings = LiquidSettings::new(domain([5 * n, 3 * n, 1], [SHUT, SHUT, REPEATS]), cell);
    let mut liquid = at_rest(settings, block([-99.0; 3], [n as f32, 2.0 * n as f32, 99.0]));
    let around = Surroundings::new(&|_| [0.0, -GRAVITY, 0.0], &|_| 0.0);
    let unit = (0.05715_f64 / (2.0 * GRAVITY)).sqrt();
    let mut now = 0.0;
    let fronts = MEASURED.map(|(time, _)| {
        liquid.step_frame(&around, (time - now) * unit);
        now = time;
        let front = liquid.surface().mesh(None).points.iter().fold(0.0_f32, |front, p| front.max(p[0]));
        f64::from(front) / f64::from(n)
    });
    let slope = (fronts[6] - fronts[0]) / (MEASURED[6].0 - MEASURED[0].0);
    (fronts.iter().zip(MEASURED).map(|(front, (_, measured))| front / measured).collect(), slope)
}

/// A lid slides over a full box at 1 m/s; [`CAVITY`] as it is found on the last of several grids. Each has so many cells
/// along a side and runs so many seconds, from where the one before ended.
fn cavity(grids: &[(i32, f64)]) -> [f64; 3] {
    let mut ended: Option<(i32, MacVelocity)> = None;
    let mut found = [0.0; 3];
    for (n, seconds) in grids {
        let (n, cell) = (*n, 1.0 / f64::from(*n));
        let settings = LiquidSettings::new(domain([n, n + 2, 1], [SHUT, SHUT, REPEATS]), cell);
        let mut liquid = at_rest(settings, |_| -9.0);
        let lid = |_: f64, p: Vec3| n as f32 - p[1];
        let solid = Solid { distance: &lid, velocity: &|_, _| [1.0, 0.0, 0.0], speed: 0.0 };
        let around = Surroundings { solid: Some(solid), ..Surroundings::new(&|_| [0.0; 3], &|_| 10.0) };
        if let Some((coarse, velocity)) = &ended {
            let size = *coarse as f32 / n as f32;
            let at = |[x, y, _]: Vec3| velocity.at(&mut Sampler::new(velocity.rows()), [x * size, y * size, 0.5]);
            liquid.set_velocity(at, &around);
        }
        frames(&mut liquid, &around, (2.0 * seconds) as u32, 0.5);
        let half = n / 2;
        let u: Vec<f64> = (0..n).map(|y| face(&liquid, 0, [half, y, 0])).collect();
        let v: Vec<f64> = (0..n).map(|x| face(&liquid, 1, [x, half, 0])).collect();
        let least = |of: &[f64]| of.iter().copied().fold(f64::INFINITY, f64::min);
        found = [least(&u), v.iter().copied().fold(0.0, f64::max), least(&v)];
        ended = Some((n, liquid.velocity(2)));
    }
    found
}
