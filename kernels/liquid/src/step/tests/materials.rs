use super::plain::Still;
use super::*;
use numerics::vector::{length, sub};

const FRAME: f64 = 1.0 / 24.0;

fn of(viscosity: f32, density: f32) -> LiquidMaterial {
    LiquidMaterial { viscosity: Some(viscosity), density: Some(density), phase: 0 }
}

/// A liquid of two materials that touch and differ 10⁶ times in viscosity and twice in density falls as one.
#[test]
fn liquids_of_different_materials_fall_together() {
    let domain = Domain::closed([0; 3], [12, 24, 12]);
    let ball = |p: Vec3| length(sub(p, [6.0, 17.0, 6.0])) - 4.5;
    let settings = LiquidSettings { cfl: 4.0, ..LiquidSettings::new(domain, 1.0 / 24.0) };
    let mut liquid = Liquid::new(settings, PlainLevelSet::new(domain, ball));
    liquid.set_materials(|p| if p[0] < 6.2 { of(1e5, 2000.0) } else { of(0.1, 1000.0) });
    let (frames, step) = (10, 0.02);
    for _ in 0..frames {
        let report = liquid.step_frame(&FALLING, step);
        assert_eq!((report.viscous_substeps, report.solves_cut_short), (report.substeps, 0), "{report:?}");
    }
    let (motion, speed) = (liquid.motion(), -9.81 * step * f64::from(frames));
    for (at, _) in motion.known.iter().enumerate().filter(|(_, mask)| **mask == 7) {
        let [x, y, z] = [0, 1, 2].map(|axis| f64::from(motion.velocity().faces()[axis][at]));
        assert!((y / speed - 1.0).abs() < 1e-3 && x.abs() + z.abs() < 1e-3 * -speed, "{x} {y} {z} of {speed}");
    }
}

/// What is left of the angular momentum of a disk of two halves, one 10⁶ times as thick as the other, after half a turn.
#[test]
fn liquids_of_different_viscosity_turn_together() {
    let walls = [[Wall::Closed; 2], [Wall::Closed; 2], [Wall::FreeSlip; 2]];
    let domain = Domain { walls, ..Domain::closed([0; 3], [28, 28, 2]) };
    let disk = |[x, y, _]: Vec3| length([x - 14.0, y - 14.0, 0.0]) - 9.3;
    let settings = LiquidSettings { cfl: 1e9, tolerance: 1e-5, ..LiquidSettings::new(domain, 1.0 / 16.0) };
    let mut liquid = Liquid::new(settings, Still::new(domain, disk));
    let rate = std::f32::consts::FRAC_PI_2 / 16.0;
    liquid.set_velocity(|[x, y, _]| [rate * (14.0 - y), rate * (x - 14.0), 0.0], &WEIGHTLESS);
    liquid.set_materials(|p| of(if p[1] > 14.0 { 1e6 } else { 1.0 }, 1000.0));
    let spin = |liquid: &Liquid<Still>| {
        let motion = liquid.motion();
        motion.rows().iter().enumerate().fold(0.0, |sum, (at, cell)| {
            let [x, y, _] = cell.map(|x| f64::from(x) - 14.0);
            let u = |axis: usize| f64::from(motion.velocity().faces()[axis][at]);
            sum + x * u(1) - y * u(0)
        })
    };
    let before = spin(&liquid);
    for _ in 0..32 {
        let report = liquid.step_frame(&WEIGHTLESS, 1.0 / 16.0);
        assert_eq!((report.substeps, report.solves_cut_short), (1, 0), "{report:?}");
    }
    let left = spin(&liquid) / before;
    assert!((left - 1.0).abs() < 0.02, "{left}");
    // The halves have changed places, and are still halves.
    let materials = liquid.motion().materials().unwrap();
    let thick = materials.materials().map(|material| material.viscosity == Some(1e6));
    let right = materials.points().iter().zip(thick).filter(|(p, thick)| (p[1] < 14.0) == *thick).count();
    assert!(right as f64 > 0.93 * materials.points().len() as f64, "{right} of {}", materials.points().len());
}

/// What the middle of a ball does that is `ratio` times as dense as what is around it, ÷ the law, in a spherical box of n
/// cells across. A ball of radius a in one of radius b starts to fall with g·(ρ − 1)/(ρ + c), c = (b³ + 2a³)/(2(b³ − a³))
/// (Stokes 1843), rigid or not: what it moves around it falls up.
fn falling_ball(n: i32, ratio: f32, viscosity: f32) -> f64 {
    let (middle, b) = (0.5 * n as f32, 0.5 * n as f32 - 1.0);
    let a = 0.5 * b;
    let wall = move |_: f64, p: Vec3| b - length(sub(p, [middle; 3]));
    let around = Surroundings { solid: Some(Solid::still(&wall)), ..FALLING };
    let added = f64::from((b * b * b + 2.0 * a * a * a) / (2.0 * (b * b * b - a * a * a)));
    let domain = Domain::closed([0; 3], [n; 3]);
    let settings = LiquidSettings { tolerance: 1e-3, ..LiquidSettings::new(domain, 1.0 / f64::from(n)) };
    let mut liquid = Liquid::new(settings, Still::new(domain, |_| -5.0));
    liquid.set_materials(|p| match length(sub(p, [middle; 3])) < a {
        true => of(viscosity, 1000.0 * ratio),
        false => LiquidMaterial::default(),
    });
    let report = liquid.step_frame(&around, 0.01);
    let is_viscous = u32::from(viscosity > 0.0);
    assert_eq!((report.viscous_substeps, report.solves_cut_short), (is_viscous, 0), "{report:?}");
    let motion = liquid.motion();
    let at = motion.rows().find([n / 2; 3]).unwrap();
    let ratio = f64::from(ratio);
    f64::from(motion.velocity().faces()[1][at]) / (-9.81 * 0.01 * (ratio - 1.0) / (ratio + added))
}

#[test]
fn a_dense_ball_sinks_and_a_light_one_rises_at_the_rate_of_its_added_mass() {
    for (n, ratio, viscosity) in [(22, 2.0, 0.0), (22, 0.5, 0.0), (14, 2.0, 1e4)] {
        let rate = falling_ball(n, ratio, viscosity);
        assert!((rate - 1.0).abs() < 0.08, "{n} cells, {ratio} times as dense, {viscosity} Pa·s: {rate}");
    }
}

/// A light liquid on a heavy one is at rest.
#[test]
fn layers_at_rest_stay_at_rest() {
    for viscosity in [0.0, 10.0] {
        let domain = Domain::closed([0; 3], [8, 16, 8]);
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.0625), PlainLevelSet::new(domain, |p| p[1] - 12.3));
        liquid.set_materials(|p| {
            if p[1] < 6.0 {
                LiquidMaterial { density: Some(5000.0), viscosity: None, phase: 0 }
            } else {
                LiquidMaterial::default()
            }
        });
        let viscosity = |_| viscosity;
        let around = Surroundings { viscosity: &viscosity, ..FALLING };
        for frame in 0..24 {
            liquid.step_frame(&around, FRAME);
            assert!(largest(&liquid) < 1e-4 * 9.81 * FRAME, "{frame}: {}", largest(&liquid));
        }
        let materials = liquid.motion().materials().unwrap();
        let mut all = materials.points().iter().zip(materials.materials());
        assert!(all.all(|(p, material)| (p[1] < 6.0) == (material.density == Some(5000.0))));
    }
}

/// Two layers between a cylinder that turns and one that stands: u = A·r + B/r in each, where viscosity · B is the same in
/// both, the torque.
#[test]
fn layers_share_the_shear_by_their_viscosities() {
    let cylinders = Cylinders::new(40);
    let (domain, &Cylinders { n, a, b }) = (cylinders.domain(), &cylinders);
    let (size, m) = (n as f32, 0.3 * n as f32);
    let (distance, turning) = (|_: f64, p: Vec3| cylinders.distance(p), |_: f64, p: Vec3| cylinders.velocity(p));
    let solid = Solid { distance: &distance, velocity: &turning, speed: 0.0 };
    let around = Surroundings { solid: Some(solid), ..WEIGHTLESS };
    for [inner, outer] in [[1e5_f32, 1e6], [1e6, 1e5]] {
        let settings =
            LiquidSettings { cfl: 1e9, max_iterations: 60, ..LiquidSettings::new(domain, 1.0 / f64::from(n)) };
        let mut liquid = Liquid::new(settings, Still::new(domain, |_| -5.0));
        liquid.set_materials(|p| of(if cylinders.radius(p) < m { inner } else { outer }, 1000.0));
        for _ in 0..2 {
            liquid.step_frame(&around, FRAME);
        }
        // At a: the speed of the cylinder, a/size. At m: both the same. At b: 0.
        let (first, second) = (1.0 / inner, 1.0 / outer);
        let torque = 1.0 / size / (first * (1.0 / (a * a) - 1.0 / (m * m)) + second * (1.0 / (m * m) - 1.0 / (b * b)));
        let exact = |r: f32| match r < m {
            true => r * (1.0 / size - torque * first * (1.0 / (a * a) - 1.0 / (r * r))),
            false => r * torque * second * (1.0 / (r * r) - 1.0 / (b * b)),
        };
        let worst = cylinders.worst(liquid.motion(), exact);
        assert!(worst < 0.08, "{inner} {outer}: {worst}");
    }
}

/// A box of two halves that touch and differ up to 10¹² times in viscosity turns about its middle: every solve reaches its
/// tolerance, and nothing becomes faster.
#[test]
fn halves_of_any_viscosities_turn_without_gaining_speed() {
    let domain = Domain { walls: [[Wall::Open; 2]; 3], ..Domain::closed([-8; 3], [8; 3]) };
    for (thin, thick) in [(1e3, 1e9), (0.1, 1e5), (1e-3, 1e9)] {
        let body = block([-4.0, -4.0, -3.0], [4.0, 4.0, 3.0]);
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.05), PlainLevelSet::new(domain, body));
        let rate = std::f32::consts::TAU * 0.05;
        liquid.set_velocity(|[x, y, _]| [-rate * y, rate * x, 0.0], &WEIGHTLESS);
        liquid.set_materials(|p| of(if p[1] > 0.0 { thick } else { thin }, 1000.0));
        for frame in 0..7 {
            let report = liquid.step_frame(&WEIGHTLESS, FRAME);
            assert_eq!(report.solves_cut_short, 0, "{thin:e} {thick:e}, frame {frame}: {report:?}");
            let fastest = largest(&liquid) / f64::from(4.0 * rate);
            assert!(fastest < 1.25, "{thin:e} {thick:e}, frame {frame}: {fastest}");
        }
    }
}
