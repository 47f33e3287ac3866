//! Flows in which viscosity decides.

use liquid::step::Solid;
use numerics::vector::{length, sub};

use super::*;

pub(super) fn figures() -> Vec<Figure> {
    let channels = [8, 16].map(channel);
    let films = [8, 16].map(|n| film(n, 1e3));
    let thick = film(8, 1e7);
    let columns = [1e3, 1e4, 1e6].map(|viscosity| column(viscosity, 16, SMOOTH, 6.0));
    let sheets = [1e3, 1e4, 1e6].map(|viscosity| column(viscosity, 1, REPEATS, 8.0));
    vec![
        Figure::error("flow between plates, 8 cells: profile g·y(H − y)/2ν", channels[0], 0.03, ""),
        Figure::within("its order of accuracy", &[order(channels)], [1.8, 2.3]),
        Figure::error("film on a slope, 8 cells: profile up to ρg sin α H²/2μ", films[0].max(thick), 0.03, ""),
        Figure::within("its order of accuracy", &[order(films)], [1.8, 2.3]),
        Figure::error("a plate drags liquid along, cutting cells: linear profile", couette(), 0.03, ""),
        Figure::within("a column on a frictionless base sinks, ÷ ρgH²/6μ, 10³…10⁶ Pa·s", &columns, [0.85, 1.15]),
        Figure::within("the same one cell thick between periodic sides, ÷ ρgH²/8μ", &sheets, [0.98, 1.02]),
        Figure::within(
            "drag of balls of 3.2 cells radius in a lattice ÷ Hasimoto's (1959)",
            &[balls(16, 0.2)],
            [0.9, 1.1],
        )
        .missed(),
        Figure::within("the same of 6.4 cells", &[balls(32, 0.2)], [0.9, 1.1]),
    ]
}

/// How fast an error falls from one grid to the next with cells half as large.
fn order([coarse, fine]: [f64; 2]) -> f64 {
    libm::log2(coarse / fine)
}

/// Liquid fills a channel of `n` cells between plates; the error of its steady profile.
fn channel(n: i32) -> f64 {
    let cell = 1.0 / f64::from(n);
    let settings =
        LiquidSettings { tolerance: 1e-7, ..LiquidSettings::new(domain([3, n, 2], [REPEATS, SHUT, REPEATS]), cell) };
    let mut liquid = at_rest(settings, |_| -9.0);
    let viscosity = 1e5;
    let thickness = |_| viscosity;
    let around = Surroundings::new(&|_| [1.0, 0.0, 0.0], &thickness);
    frames(&mut liquid, &around, 4, FRAME);
    let (found, exact): (Vec<_>, Vec<_>) = (0..n)
        .map(|y| {
            let height = (f64::from(y) + 0.5) * cell;
            (face(&liquid, 0, [1, y, 1]), 0.5 * height * (1.0 - height) * 1000.0 / viscosity)
        })
        .unzip();
    error(&found, &exact)
}

/// A film `n` cells thick on a slope of 30°, between two centres of cells; the error of its steady profile.
fn film(n: i32, viscosity: f64) -> f64 {
    let (thick, cell) = (0.08, 0.08 / (f64::from(n) + 0.2));
    let settings = LiquidSettings {
        tolerance: 1e-7,
        ..LiquidSettings::new(domain([3, n + 4, 2], [REPEATS, SHUT, REPEATS]), cell)
    };
    let mut liquid = at_rest(settings, |p| p[1] - n as f32 - 0.2);
    let pull = [0.5 * GRAVITY, -0.866 * GRAVITY, 0.0];
    let (gravity, thickness) = (|_| pull, |_| viscosity);
    let around = Surroundings::new(&gravity, &thickness);
    frames(&mut liquid, &around, 6, FRAME);
    let (found, exact): (Vec<_>, Vec<_>) = (0..n)
        .map(|y| {
            let height = (f64::from(y) + 0.5) * cell;
            (face(&liquid, 0, [1, y, 1]), pull[0] * height * (thick - 0.5 * height) * 1000.0 / viscosity)
        })
        .unzip();
    error(&found, &exact)
}

/// A solid slides over liquid, its underside within cells; the error of the steady profile.
fn couette() -> f64 {
    let (n, top) = (12, 10.3_f64);
    let settings =
        LiquidSettings { tolerance: 1e-7, ..LiquidSettings::new(domain([4, n, 2], [REPEATS, SHUT, REPEATS]), 0.1) };
    let mut liquid = at_rest(settings, |_| -9.0);
    let distance = |_: f64, p: Vec3| top as f32 - p[1];
    let solid = Solid { distance: &distance, velocity: &|_, _| [0.5, 0.0, 0.0], speed: 0.0 };
    let around = Surroundings { solid: Some(solid), ..Surroundings::new(&|_| [0.0; 3], &|_| 1e5) };
    frames(&mut liquid, &around, 4, FRAME);
    let (found, exact): (Vec<_>, Vec<_>) =
        (0..10).map(|y| (face(&liquid, 0, [1, y, 1]), 0.5 * (f64::from(y) + 0.5) / top)).unzip();
    error(&found, &exact)
}

/// A column 8 cells wide and 40 high, 0.08 m, without friction at its foot; its speed at the top ÷ ρgH²/(`share`·μ).
fn column(viscosity: f64, depth: i32, sides: [Wall; 2], share: f64) -> f64 {
    let settings = LiquidSettings {
        tolerance: 1e-6,
        ..LiquidSettings::new(domain([16, 44, depth], [OPEN, [Wall::FreeSlip, Wall::Open], sides]), 0.002)
    };
    let ends = if depth == 1 { [-99.0, 99.0] } else { [4.0, 12.0] };
    let mut liquid = at_rest(settings, block([4.0, -99.0, ends[0]], [12.0, 40.0, ends[1]]));
    let thickness = |_| viscosity;
    let around = Surroundings::new(&|_| [0.0, -GRAVITY, 0.0], &thickness);
    // Long against the time in which speed settles, short against that in which it sinks by 1 %.
    liquid.step_frame(&around, 0.02);
    let middle = if depth == 1 { 0 } else { depth / 2 };
    -face(&liquid, 1, [8, 40, middle]) / (1000.0 * GRAVITY * 0.08 * 0.08 / (share * viscosity))
}

/// A ball of `radius`, m, in a periodic box of `n` cells and 1 m, held in liquid that is driven past it; its drag ÷ that of Hasimoto, J. Fluid
/// Mech. 5 (1959), by the mean velocity.
fn balls(n: i32, radius: f64) -> f64 {
    let (cell, viscosity) = (1.0 / f64::from(n), 1e5);
    let settings = LiquidSettings { tolerance: 1e-5, ..LiquidSettings::new(domain([n; 3], [REPEATS; 3]), cell) };
    let mut liquid = at_rest(settings, |_| -9.0);
    let middle = [0.5 * n as f32; 3];
    let distance = |_: f64, p: Vec3| length(sub(p, middle)) - (radius / cell) as f32;
    let thickness = |_| viscosity;
    let around =
        Surroundings { solid: Some(Solid::still(&distance)), ..Surroundings::new(&|_| [1.0, 0.0, 0.0], &thickness) };
    frames(&mut liquid, &around, 3, FRAME);
    // What flows through a plane.
    let through: f64 = (0..n * n).map(|at| face(&liquid, 0, [0, at % n, at / n])).sum();
    let mean = through / f64::from(n * n);
    let share = 4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius;
    let side = libm::cbrt(share);
    let slower = 1.0 - 1.7601 * side + share - 1.5593 * share * share;
    // The pressure that drives it acts on the ball as well.
    1000.0 * slower / (6.0 * std::f64::consts::PI * viscosity * radius * mean)
}
