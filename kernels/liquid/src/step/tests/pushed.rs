use super::*;

/// A piston as high as the box moves into a pool; what is left outside it, and what the pool had, ÷ cell³.
fn pushed(viscosity: f64) -> [f64; 2] {
    // Sides two cells from the middle would hold thick liquid.
    let walls = [[Wall::Closed; 2], [Wall::Closed; 2], [Wall::FreeSlip; 2]];
    let domain = Domain { walls, ..Domain::closed([0; 3], [32, 24, 4]) };
    let cell = 1.0 / 16.0;
    let mut liquid = Liquid::new(LiquidSettings::new(domain, cell), PlainLevelSet::new(domain, |p| p[1] - 9.3));
    // 0.4 m/s: 6.4 cells a second, from 3.6 cells on.
    let speed = 0.4_f32;
    let place = |seconds: f64| 3.6 + f64::from(speed) / cell * seconds;
    let outside = |liquid: &Liquid<PlainLevelSet>, seconds: f64| {
        let (view, place) = (liquid.surface().view(), place(seconds));
        let share = |(at, cell): (usize, [i32; 3])| {
            let past = (f64::from(cell[0]) + 1.0 - place).clamp(0.0, 1.0);
            if domain.contains(cell) { past * f64::from((0.5 - view.phi[at]).clamp(0.0, 1.0)) } else { 0.0 }
        };
        view.rows.iter().enumerate().map(share).sum::<f64>()
    };
    let start = outside(&liquid, 0.0);
    let viscosity = move |_| viscosity;
    for frame in 0..24 {
        let now = f64::from(frame) / 24.0;
        let distance = |time: f64, p: Vec3| p[0] - place(now + time) as f32;
        let solid = Solid { distance: &distance, velocity: &|_, _| [speed, 0.0, 0.0], speed: f64::from(speed) };
        let around = Surroundings { viscosity: &viscosity, solid: Some(solid), ..FALLING };
        let report = liquid.step_frame(&around, 1.0 / 24.0);
        assert_eq!((report.caps_hit, report.solves_cut_short), (0, 0), "{report:?}");
    }
    [outside(&liquid, 1.0), start]
}

#[test]
fn a_piston_pushes_liquid_up_and_lets_none_through() {
    for viscosity in [0.0, 50.0] {
        let [left, start] = pushed(viscosity);
        assert!((left / start - 1.0).abs() < 0.03, "{viscosity}: {left} of {start}");
    }
}

/// Between a cylinder that turns and one that stands, of radii a and b, u = ω·a²/(b² − a²)·(b²/r − r): the largest error in a
/// box of n cells, ÷ ω·a.
fn between_cylinders(n: i32) -> f32 {
    let cylinders = Cylinders::new(n);
    let (domain, &Cylinders { a, b, .. }) = (cylinders.domain(), &cylinders);
    let (distance, turning) = (|_: f64, p: Vec3| cylinders.distance(p), |_: f64, p: Vec3| cylinders.velocity(p));
    let solid = Solid { distance: &distance, velocity: &turning, speed: 0.0 };
    let viscosity = |_| 1e5;
    let around = Surroundings { viscosity: &viscosity, solid: Some(solid), ..WEIGHTLESS };
    let settings = LiquidSettings { tolerance: 1e-6, cfl: 1e9, ..LiquidSettings::new(domain, 1.0 / f64::from(n)) };
    let mut liquid = Liquid::new(settings, PlainLevelSet::new(domain, |_| -5.0));
    liquid.step_frame(&around, 1.0 / 24.0);
    let report = liquid.step_frame(&around, 1.0 / 24.0);
    assert!(report.solves_cut_short == 0 && report.unbalanced < 1e-3, "{report:?}");
    cylinders.worst(liquid.motion(), |r| a * a / (b * b - a * a) * (b * b / r - r) / n as f32)
}

/// Curved walls are of the first order.
#[test]
fn a_turning_cylinder_takes_thick_liquid_along() {
    let [coarse, fine] = [40, 80].map(between_cylinders);
    assert!(coarse < 0.07 && fine < 0.035, "{coarse} {fine}");
}
