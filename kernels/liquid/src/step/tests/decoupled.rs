//! Pressure and viscosity one after the other: what is right about it, and by how much the rest is wrong.

use super::*;

const PERIODIC: [Wall; 2] = [Wall::Periodic; 2];

fn decoupled(domain: Domain, cell: f64) -> LiquidSettings {
    LiquidSettings { coupling: Coupling::Off, tolerance: 1e-6, ..LiquidSettings::new(domain, cell) }
}

/// The velocities of faces that move.
fn moving(liquid: &Liquid<impl Surface>, axis: usize) -> Vec<(Vec3, f64)> {
    let motion = liquid.motion();
    let faces = motion.rows().iter().zip(&motion.velocity().faces()[axis]);
    faces.filter(|(_, u)| **u != 0.0).map(|(cell, u)| (Site::FACES[axis].of(cell), f64::from(*u))).collect()
}

#[test]
fn free_fall_is_not_slowed() {
    let domain = Domain::closed([0; 3], [16; 3]);
    let ball = |p: Vec3| length([p[0] - 8.1, p[1] - 8.3, p[2] - 7.8]) - 3.5;
    for viscosity in [1.0, 1e4, 1e8] {
        let mut liquid = Liquid::new(decoupled(domain, 1.0 / 16.0), PlainLevelSet::new(domain, ball));
        let around = Surroundings { viscosity: &|_| viscosity, ..FALLING };
        let report = liquid.step_frame(&around, 1.0 / 48.0);
        assert!(report.viscous_substeps > 0 && report.solves_cut_short == 0, "{report:?}");
        let falling = moving(&liquid, 1);
        assert!(falling.len() > 100);
        for (p, u) in falling {
            assert!((u * 48.0 / -9.81 - 1.0).abs() < 1e-3, "{viscosity}: {u} at {p:?}");
        }
    }
}

/// A disk of 12.3 cells radius between walls without friction, turned by half a turn in 48 frames.
#[test]
fn nearly_rigid_liquid_keeps_its_spin() {
    let walls = [[Wall::Closed; 2], [Wall::Closed; 2], [Wall::FreeSlip; 2]];
    let domain = Domain { walls, ..Domain::closed([0; 3], [40, 40, 2]) };
    let disk = |[x, y, _]: Vec3| length([x - 20.0, y - 20.0, 0.0]) - 12.3;
    let settings = LiquidSettings { cfl: 1e9, ..decoupled(domain, 1.0 / 24.0) };
    let mut liquid = Liquid::new(settings, plain::Still::new(domain, disk));
    let around = Surroundings { viscosity: &|_| 1e6, ..WEIGHTLESS };
    let rate = std::f32::consts::FRAC_PI_2 / 24.0;
    liquid.set_velocity(|[x, y, _]| [rate * (20.0 - y), rate * (x - 20.0), 0.0], &around);
    let spin = |liquid: &Liquid<plain::Still>| {
        let along = |axis: usize, across: usize, sign: f64| {
            let own = moving(liquid, axis).into_iter();
            own.map(|(p, u)| sign * u * (f64::from(p[across]) - 20.0)).sum::<f64>()
        };
        along(1, 0, 1.0) + along(0, 1, -1.0)
    };
    let before = spin(&liquid);
    let mut report = LiquidReport::default();
    for _ in 0..48 {
        report.add(&liquid.step_frame(&around, 1.0 / 24.0));
    }
    assert_eq!((report.viscous_substeps, report.solves_cut_short), (48, 0), "{report:?}");
    assert!((spin(&liquid) / before - 1.0).abs() < 0.02, "{}", spin(&liquid) / before);
}

/// A plate slides over liquid, its underside within cells.
#[test]
fn a_plate_drags_liquid_along() {
    let (n, top) = (12, 10.3_f32);
    let domain = Domain { walls: [PERIODIC, [Wall::Closed; 2], PERIODIC], ..Domain::closed([0; 3], [4, n, 2]) };
    let mut liquid = Liquid::new(decoupled(domain, 0.1), PlainLevelSet::new(domain, |_| -9.0));
    let distance = |_: f64, p: Vec3| top - p[1];
    let solid = Solid { distance: &distance, velocity: &|_, _| [0.5, 0.0, 0.0], speed: 0.0 };
    let around = Surroundings { solid: Some(solid), ..Surroundings::new(&|_| [0.0; 3], &|_| 1e5) };
    let report = (0..4).fold(LiquidReport::default(), |mut report, _| {
        report.add(&liquid.step_frame(&around, 1.0 / 24.0));
        report
    });
    assert!(report.viscosity_residual <= 1e-6 && report.viscosity_iterations > 0, "{report:?}");
    assert_eq!(report.coupled_iterations, 0);
    let below = moving(&liquid, 0).into_iter().filter(|(p, _)| (0.0..10.0).contains(&p[1]));
    let errors: Vec<f64> = below.map(|(p, u)| (u / 0.5 - f64::from(p[1] / top)).abs()).collect();
    assert!(errors.len() >= 80 && errors.iter().all(|error| *error < 0.03), "{errors:?}");
}

/// The known error: pressure holds up a thin column as if it had no viscosity, and then viscosity stretches it.
#[test]
fn a_column_one_cell_thick_sinks_too_fast() {
    let walls = [[Wall::Open; 2], [Wall::FreeSlip, Wall::Open], PERIODIC];
    let domain = Domain { walls, ..Domain::closed([0; 3], [16, 44, 1]) };
    let speed = |coupling: Coupling, viscosity: f64| {
        let settings = LiquidSettings { coupling, ..decoupled(domain, 0.002) };
        let shape = PlainLevelSet::new(domain, block([4.0, -99.0, -99.0], [12.0, 40.0, 99.0]));
        let mut liquid = Liquid::new(settings, shape);
        let report = liquid.step_frame(&Surroundings { viscosity: &|_| viscosity, ..FALLING }, 0.02);
        assert_eq!(report.solves_cut_short, 0, "{report:?}");
        // ρgH²/8μ.
        largest(&liquid) / (1000.0 * 9.81 * 0.08 * 0.08 / (8.0 * viscosity))
    };
    for viscosity in [1e3, 1e4, 1e6] {
        let [right, wrong] = [Coupling::On, Coupling::Off].map(|coupling| speed(coupling, viscosity));
        assert!((right - 1.0).abs() < 0.05, "{viscosity}: {right}");
        assert!((1.4..2.0).contains(&wrong), "{viscosity}: {wrong}");
    }
}
