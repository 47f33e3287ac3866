use super::plain::Still;
use super::*;
use crate::marked::MarkedSurface;
use numerics::vector::{length, sub};

const FRAME: f64 = 1.0 / 24.0;
const GRAVITY: f64 = 9.81;

/// The force on the solid in the last of four frames, N, in cells of 1/20 m.
fn force(
    domain: Domain,
    viscosity: f64,
    liquid: impl Fn(Vec3) -> f32 + Sync,
    solid: &(dyn Fn(f64, Vec3) -> f32 + Sync),
) -> [f64; 3] {
    let settings = LiquidSettings { tolerance: 1e-6, ..LiquidSettings::new(domain, 0.05) };
    let mut liquid = Liquid::new(settings, Still::new(domain, liquid));
    let viscosity = |_| viscosity;
    let around = Surroundings { viscosity: &viscosity, solid: Some(Solid::still(solid)), ..FALLING };
    let reports = (0..4).map(|_| liquid.step_frame(&around, FRAME));
    reports.last().unwrap().solid_force
}

/// The weight of so many cells of liquid, N.
fn weight(cells: f64) -> f64 {
    1000.0 * GRAVITY * 0.05 * 0.05 * 0.05 * cells
}

#[test]
fn a_ball_under_water_has_the_lift_of_what_it_displaces() {
    let domain = Domain::closed([0; 3], [20; 3]);
    let lift = weight(4.0 / 3.0 * std::f64::consts::PI * 125.0);
    for viscosity in [0.0, 100.0] {
        for centre in [[10.0; 3], [10.3, 9.4, 9.1]] {
            let ball = move |_: f64, p: Vec3| length(sub(p, centre)) - 5.0;
            let [x, y, z] = force(domain, viscosity, |p| p[1] - 18.2, &ball);
            assert!((y / lift - 1.0).abs() < 0.02, "{viscosity} {y} {lift}");
            assert!(x.abs() < 0.01 * lift && z.abs() < 0.01 * lift, "{viscosity} {x} {z}");
        }
    }
}

/// Nothing pushes up from under a floor.
#[test]
fn a_floor_carries_the_pool_on_it() {
    let domain = Domain::closed([0; 3], [8, 20, 8]);
    for floor in [2.6_f32, 3.0, 2.2] {
        let solid = move |_: f64, p: Vec3| p[1] - floor;
        let [x, y, z] = force(domain, 0.0, |p| p[1] - 17.2, &solid);
        let expected = -weight(64.0 * (17.2 - f64::from(floor)));
        assert!((y / expected - 1.0).abs() < 1e-4, "{floor}: {y} {expected}");
        assert!(x.abs() < 1e-3 * y.abs() && z.abs() < 1e-3 * y.abs(), "{x} {z}");
    }
}

/// Thick liquid between two plates creeps down as fast as the plates let it: they carry its weight.
#[test]
fn plates_carry_the_thick_liquid_between_them() {
    let walls = [[Wall::Closed; 2], [Wall::Closed; 2], [Wall::FreeSlip; 2]];
    let domain = Domain { walls, ..Domain::closed([0; 3], [16, 40, 3]) };
    for viscosity in [1e3, 1e6] {
        let plates = |_: f64, p: Vec3| (p[0] - 4.3).min(11.6 - p[0]);
        let [x, y, z] = force(domain, viscosity, |p| (p[1] - 32.2).max(11.7 - p[1]), &plates);
        let expected = -weight(7.3 * 20.5 * 3.0);
        assert!((y / expected - 1.0).abs() < 0.02, "{viscosity}: {y} {expected}");
        assert!(x.abs() < 1e-3 * y.abs() && z.abs() < 1e-3 * y.abs(), "{x} {z}");
    }
}

/// Under a plate that moves at U, at a height of h, thick liquid without end has a shear of U ÷ h: the plate is held back by
/// viscosity · U ÷ h on all of its area. Once it moves as told, so is what the solves are measured against.
#[test]
fn a_plate_over_liquid_without_end_is_held_back_on_all_of_its_area() {
    for (axis, count) in [(0, 4), (0, 7), (2, 5)] {
        let (mut walls, mut high) = ([[Wall::Closed; 2], [Wall::Closed; 2], [Wall::Closed; 2]], [3, 12, 3]);
        walls[2 - axis] = [Wall::FreeSlip; 2];
        walls[axis] = [Wall::Periodic; 2];
        high[axis] = count;
        let domain = Domain { walls, ..Domain::closed([0; 3], high) };
        let settings = LiquidSettings { tolerance: 1e-6, cfl: 1e9, ..LiquidSettings::new(domain, 0.05) };
        let mut liquid = Liquid::new(settings, Still::new(domain, |p| p[1] - 8.0));
        let mut velocity = [0.0; 3];
        velocity[axis] = 0.5;
        let (plate, moving) = (|_: f64, p: Vec3| 8.0 - p[1], |_: f64, _: Vec3| velocity);
        let solid = Some(Solid { distance: &plate, velocity: &moving, speed: 0.0 });
        let around = Surroundings { viscosity: &|_| 1e4, solid, ..WEIGHTLESS };
        let reports: Vec<LiquidReport> = (0..4).map(|_| liquid.step_frame(&around, FRAME)).collect();
        assert!(reports.iter().all(|report| report.solves_cut_short == 0), "{axis} {count}: {reports:?}");
        let expected = -1e4 * 0.5 / 0.4 * 3.0 * f64::from(count) * 0.05 * 0.05;
        let force = reports[3].solid_force[axis];
        assert!((force / expected - 1.0).abs() < 1e-3, "{axis} {count}: {force} {expected}");
    }
}

/// Whatever viscosity holds it together: what stands still is carried by its whole weight.
#[test]
fn a_plate_carries_the_weight_of_the_thick_block_on_it() {
    let mut domain = Domain::closed([0; 3], [20; 3]);
    domain.walls = [[Wall::Open; 2]; 3];
    for (floor, slip) in [(4.0_f32, 0.0), (4.4, 0.0), (4.4, 1.0), (3.7, 0.0)] {
        for viscosity in [1e4, 1e7] {
            let solid = move |_: f64, p: Vec3| p[1] - floor;
            let settings = LiquidSettings { tolerance: 1e-6, slip, ..LiquidSettings::new(domain, 0.05) };
            let high = floor + 8.0;
            let mut liquid = Liquid::new(settings, Still::new(domain, block([6.0, -99.0, 6.0], [14.0, high, 14.0])));
            let viscosity = |_| viscosity;
            let around = Surroundings { viscosity: &viscosity, solid: Some(Solid::still(&solid)), ..FALLING };
            let reports = [0; 4].map(|_| liquid.step_frame(&around, FRAME));
            let [x, y, z] = reports[3].solid_force;
            let expected = -weight(512.0);
            let name = format!("floor {floor}, slip {slip}, {:e} Pa·s", viscosity(0.0));
            assert!((y / expected - 1.0).abs() < 0.02, "{name}: {y} {expected}");
            assert!(x.abs() < 1e-3 * y.abs() && z.abs() < 1e-3 * y.abs(), "{name}: {x} {z}");
        }
    }
}

/// A ball that flies onto a plate without weight stops there: the plate has its momentum in the end. Where the plate
/// has the middle of no cell in it, what stops in the last half cell before it does not count.
#[test]
fn a_plate_stops_the_ball_that_flies_onto_it() {
    let mut domain = Domain::closed([0; 3], [48, 20, 48]);
    domain.walls = [[Wall::Open; 2]; 3];
    for (floor, viscosity, within) in [(3.4, 0.0, 0.06), (3.4, 1.0, 0.06), (3.0, 0.0, 0.18)] {
        let (radius, centre) = (6.0, [24.0, floor + 7.0, 24.0]);
        let ball = |p: Vec3| length(sub(p, centre)) - radius;
        let solid = move |_: f64, p: Vec3| p[1] - floor;
        let settings = LiquidSettings { slip: 1.0, ..LiquidSettings::new(domain, 0.05) };
        let mut liquid = Liquid::new(settings, MarkedSurface::new(domain, 1, ball, 0, 1));
        let viscosity = |_| viscosity;
        let around = Surroundings { viscosity: &viscosity, solid: Some(Solid::still(&solid)), ..WEIGHTLESS };
        liquid.set_velocity(|_| [0.0, -5.0, 0.0], &around);
        let momentum = 5.0 * 1000.0 * liquid.surface().mesh(None).volume() * 0.05 * 0.05 * 0.05;
        let given: f64 = (0..10).map(|_| -liquid.step_frame(&around, FRAME).solid_force[1] * FRAME).sum();
        assert!(
            (given / momentum - 1.0).abs() < within,
            "floor {floor}, {} Pa·s: {given} of {momentum}",
            viscosity(0.0)
        );
    }
}
