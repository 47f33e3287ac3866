use super::plain::Still;
use super::*;
use numerics::vector::length;

/// What a frame of 1/24 s of this viscosity, Pa·s, takes place in.
fn thick(viscosity: &(dyn Fn(f64) -> f64 + Sync)) -> Surroundings<'_> {
    Surroundings { viscosity, ..FALLING }
}

/// The highest place of a surface along the middle, in cells.
fn top(liquid: &Liquid<PlainLevelSet>, [x, z]: [i32; 2]) -> f64 {
    let view = liquid.surface().view();
    let phi = |y: i32| view.rows.find([x, y, z]).map_or(view.outside, |at| view.phi[at]);
    let high = liquid.settings.domain.high[1];
    let found = (0..high).rev().find(|y| phi(*y) < 0.0 && phi(*y + 1) >= 0.0);
    found.map_or(0.0, |y| f64::from(y) + 0.5 + f64::from(phi(y) / (phi(y) - phi(y + 1))))
}

/// How far the top of a block on a floor of no slip sinks in 0.2 s, in cells, and what that took. The surface follows the
/// velocity of the substep before, so in the first it stays.
fn slump(viscosity: f64, frames: u32) -> (f64, LiquidReport) {
    let domain = Domain::closed([0; 3], [32, 20, 32]);
    let settings = LiquidSettings { cfl: 100.0, ..LiquidSettings::new(domain, 1.0 / 32.0) };
    let shape = PlainLevelSet::new(domain, block([10.0, -99.0, 10.0], [22.0, 14.3, 22.0]));
    let mut liquid = Liquid::new(settings, shape);
    let viscosity = |_| viscosity;
    let mut report = LiquidReport::default();
    for _ in 0..frames {
        report.add(&liquid.step_frame(&thick(&viscosity), 0.2 / f64::from(frames)));
    }
    assert_eq!((report.substeps, report.viscous_substeps, report.solves_cut_short), (frames, frames, 0), "{report:?}");
    let share = f64::from(frames - 1) / f64::from(frames);
    ((14.3 - top(&liquid, [16, 16])) / share, report)
}

#[test]
fn thick_liquid_sinks_at_its_own_rate_in_any_number_of_steps() {
    let (fine, _) = slump(400.0, 32);
    for frames in [4, 8, 16] {
        let (sunk, report) = slump(400.0, frames);
        assert!((sunk / fine - 1.0).abs() < 0.05, "{frames} steps: {sunk} against {fine}; {report:?}");
    }
}

/// Without inertia the rate is inverse to the viscosity.
#[test]
fn ten_times_the_viscosity_is_a_tenth_of_the_rate() {
    let rates = [4e4, 4e5, 4e6].map(|viscosity| slump(viscosity, 8).0 * viscosity);
    assert!((rates[1] / rates[0] - 1.0).abs() < 0.01, "{rates:?}");
    assert!((rates[2] / rates[1] - 1.0).abs() < 0.01, "{rates:?}");
}

/// What is left of the angular momentum of a disk of 12.3 cells radius between walls without friction, turned by half a turn
/// in 48 frames. The surface stays, as in the tests of spin.
#[test]
fn viscosity_does_not_resist_turning() {
    let walls = [[Wall::Closed; 2], [Wall::Closed; 2], [Wall::FreeSlip; 2]];
    let domain = Domain { walls, ..Domain::closed([0; 3], [40, 40, 2]) };
    let disk = |[x, y, _]: Vec3| length([x - 20.0, y - 20.0, 0.0]) - 12.3;
    for viscosity in [0.0, 1.0, 1e3, 1e7] {
        let viscosity = |_| viscosity;
        let around = Surroundings { viscosity: &viscosity, ..WEIGHTLESS };
        let settings = LiquidSettings { cfl: 1e9, tolerance: 1e-5, ..LiquidSettings::new(domain, 1.0 / 24.0) };
        let mut liquid = Liquid::new(settings, Still::new(domain, disk));
        let rate = std::f32::consts::FRAC_PI_2 / 24.0;
        liquid.set_velocity(|[x, y, _]| [rate * (20.0 - y), rate * (x - 20.0), 0.0], &around);
        let spin = |liquid: &Liquid<Still>| {
            let motion = liquid.motion();
            motion.rows().iter().enumerate().fold(0.0, |sum, (at, cell)| {
                let [x, y, _] = cell.map(|x| f64::from(x) - 20.0);
                let u = |axis: usize| f64::from(motion.velocity().faces()[axis][at]);
                sum + x * u(1) - y * u(0)
            })
        };
        let before = spin(&liquid);
        for _ in 0..48 {
            liquid.step_frame(&around, 1.0 / 24.0);
        }
        let left = spin(&liquid) / before;
        assert!((left - 1.0).abs() < 0.01, "{}: {left}", viscosity(0.0));
    }
}

#[test]
fn thick_liquid_at_rest_stays_at_rest() {
    let domain = Domain::closed([0; 3], [16; 3]);
    for viscosity in [1.0, 1e4] {
        let viscosity = |_| viscosity;
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.0625), PlainLevelSet::new(domain, |p| p[1] - 9.3));
        let mut iterations = 0;
        for frame in 0..48 {
            let report = liquid.step_frame(&thick(&viscosity), 1.0 / 24.0);
            iterations += if frame < 4 { 0 } else { report.coupled_iterations };
            assert!(largest(&liquid) < 1e-4 * 9.81 / 24.0, "{frame}: {}", largest(&liquid));
        }
        assert!(iterations < 44, "{iterations}");
    }
}

/// A wall of free slip does not hold a falling curtain; a closed one does.
#[test]
fn walls_of_free_slip_hold_nothing() {
    let speed = |wall: Wall, slip: f32| {
        let walls = [[wall; 2], [Wall::Closed; 2], [Wall::FreeSlip; 2]];
        let domain = Domain { walls, ..Domain::closed([0; 3], [8, 40, 4]) };
        let settings = LiquidSettings { slip, ..LiquidSettings::new(domain, 1.0 / 32.0) };
        let mut liquid =
            Liquid::new(settings, PlainLevelSet::new(domain, block([-99.0, 20.0, -99.0], [99.0, 34.0, 99.0])));
        let viscosity = |_| 1e4;
        for _ in 0..2 {
            liquid.step_frame(&thick(&viscosity), 1.0 / 24.0);
        }
        largest(&liquid) / (9.81 / 12.0)
    };
    for (wall, slip) in [(Wall::FreeSlip, 0.0), (Wall::Closed, 1.0)] {
        assert!((speed(wall, slip) - 1.0).abs() < 1e-3, "{}", speed(wall, slip));
    }
    assert!(speed(Wall::Closed, 0.0) < 0.05, "{}", speed(Wall::Closed, 0.0));
}

#[test]
fn viscosity_is_left_out_below_its_bound() {
    let domain = Domain::closed([0; 3], [8; 3]);
    for (coupling, viscosity, expected) in [
        (Coupling::Auto, 0.0, 0),
        (Coupling::Auto, 1e-3, 0),
        (Coupling::Auto, 10.0, 1),
        (Coupling::On, 1e-3, 1),
        (Coupling::Off, 1e-3, 0),
        (Coupling::Off, 10.0, 1),
    ] {
        let settings = LiquidSettings { coupling, cfl: 100.0, ..LiquidSettings::new(domain, 0.1) };
        let mut liquid = Liquid::new(settings, PlainLevelSet::new(domain, |p| p[1] - 4.2));
        let viscosity = |_| viscosity;
        assert_eq!(liquid.step_frame(&thick(&viscosity), 1.0 / 24.0).viscous_substeps, expected);
    }
}

/// A ball that is hardly deformable: whichever cells it fills, its trembling stops and it falls by g·Δt.
#[test]
fn nearly_rigid_liquid_falls_freely_wherever_it_is() {
    let domain = Domain::closed([0; 3], [16; 3]);
    let trembling = |[x, y, z]: Vec3| {
        let wave = |x: f32| (x - x.floor() - 0.5) * 0.02;
        [wave(0.37 * y + 0.2 * z), -0.7 + wave(0.53 * z - 0.31 * x), wave(0.77 * x)]
    };
    let speed = |liquid: &Liquid<PlainLevelSet>| {
        let faces = &liquid.motion().velocity().faces()[1];
        let moving: Vec<f64> = faces.iter().map(|u| f64::from(*u)).filter(|u| *u != 0.0).collect();
        moving.iter().sum::<f64>() / moving.len() as f64
    };
    for n in 0..24 {
        let middle = 6.9 + 0.123 * n as f32;
        let ball = |p: Vec3| length([p[0] - 8.0, p[1] - middle, p[2] - 8.0]) - 3.52;
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 1.0 / 16.0), PlainLevelSet::new(domain, ball));
        let around = thick(&|_| 1e8);
        liquid.set_velocity(trembling, &around);
        let report = liquid.step_frame(&around, 1.0 / 240.0);
        assert!(report.solves_cut_short == 0 && report.coupled_iterations < 40, "{middle}: {report:?}");
        assert!((speed(&liquid) + 0.7 + 9.81 / 240.0).abs() < 0.01, "{middle}: {}", speed(&liquid));
    }
}
