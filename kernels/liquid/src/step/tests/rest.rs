use super::*;
use crate::marked::MarkedSurface;
use numerics::vector::length;

/// 240 frames of a pool whose surface lies at `depth` in a box of 16³ cells; the largest speed in them ÷ g·Δt, the largest
/// change of φ near the surface, and the iterations after the first frames.
fn rest(depth: f32, cell: f64, solid: Option<Solid<'_>>, tolerance: f64) -> (f64, f32, u32) {
    let domain = Domain::closed([0; 3], [16; 3]);
    let settings = LiquidSettings { tolerance, ..LiquidSettings::new(domain, cell) };
    let mut liquid = Liquid::new(settings, PlainLevelSet::new(domain, |p| p[1] - depth));
    let around = Surroundings { solid, ..FALLING };
    let (mut speed, mut iterations) = (0.0_f64, 0);
    for frame in 0..240 {
        let report = liquid.step_frame(&around, 1.0 / 24.0);
        assert_eq!((report.caps_hit, report.solves_cut_short), (0, 0));
        iterations += if frame < 4 { 0 } else { report.pressure_iterations };
        speed = speed.max(largest(&liquid) * f64::from(report.substeps) / (9.81 / 24.0));
    }
    let view = liquid.surface().view();
    let off = |(at, cell): (usize, [i32; 3])| {
        let exact = Site::Centre.of(cell)[1] - depth;
        if exact.abs() < 0.9 && domain.contains(cell) { (view.phi[at] - exact).abs() } else { 0.0 }
    };
    (speed, view.rows.iter().enumerate().map(off).fold(0.0, f32::max), iterations)
}

#[test]
fn a_pool_at_rest_stays_at_rest() {
    for (depth, cell) in [(9.3, 0.0625), (9.3, 0.0078125), (7.5, 0.0625)] {
        let (speed, off, _) = rest(depth, cell, None, 1e-6);
        assert!(speed < 1e-5 && off < 1e-4, "{depth} {cell}: {speed} {off}");
    }
    // A surface on the centres of cells, where rounding decides which are liquid, too.
    for (depth, most) in [(9.3, 240), (7.5, 960)] {
        let (speed, off, iterations) = rest(depth, 0.0625, None, 1e-4);
        assert!(speed < 1e-4 && off < 1e-3 && iterations < most, "{depth}: {speed} {off} {iterations}");
    }
}

#[test]
fn a_floor_that_cuts_cells_does_not_disturb_the_rest() {
    let floor = |_: f64, p: Vec3| p[1] - 2.6;
    let floor = Some(Solid::still(&floor));
    let (speed, off, _) = rest(9.3, 0.0625, floor, 1e-6);
    assert!(speed < 1e-5 && off < 1e-4, "{speed} {off}");
    let (speed, off, iterations) = rest(9.3, 0.0625, floor, 1e-4);
    assert!(speed < 1e-4 && off < 1e-3 && iterations < 240, "{speed} {off} {iterations}");
}

/// The largest speed in two seconds of a pool, 6 cells deep, that should rest; ÷ g·Δt.
fn unrest(solid: &(dyn Fn(Vec3) -> f32 + Sync)) -> f64 {
    let domain = Domain::closed([0; 3], [16, 10, 16]);
    let mut surface = MarkedSurface::new(domain, 1, |p| p[1] - 6.0, 0, 1);
    surface.meet(&|p| solid(p));
    let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.05), surface);
    let distance = |_: f64, p: Vec3| solid(p);
    let around = Surroundings { solid: Some(Solid::still(&distance)), ..FALLING };
    fastest(&mut liquid, &around, 48)
}

#[test]
fn a_pool_rests_around_a_body_that_leans() {
    let ball = |p: Vec3| length([p[0] - 8.0, p[1] - 7.6, p[2] - 8.0]) - 3.0;
    let (sin, cos) = libm::sincosf(20.0_f32.to_radians());
    let cylinder = |p: Vec3| {
        let [x, y, z] = [p[0] - 8.0, p[1] - 5.0, p[2] - 8.0];
        length([x, cos * z - sin * y, 0.0]) - 2.0
    };
    let speeds = [unrest(&ball), unrest(&cylinder)];
    assert!(speeds.iter().all(|speed| *speed < 1e-4), "{speeds:?}");
}

/// ½g·t², in substeps of any length.
#[test]
fn a_blob_falls_freely() {
    for steps in [6, 10, 40] {
        falls(steps);
    }
}

/// A ball falls for 0.3 s in so many substeps.
fn falls(steps: u32) {
    let domain = Domain::closed([0; 3], [24, 48, 24]);
    let ball = |p: Vec3| length([p[0] - 12.0, p[1] - 38.0, p[2] - 12.0]) - 6.0;
    let settings = LiquidSettings { cfl: 1e3, ..LiquidSettings::new(domain, 1.0 / 48.0) };
    let mut liquid = Liquid::new(settings, PlainLevelSet::new(domain, ball));
    liquid.set_velocity(|_| [0.0; 3], &FALLING);
    let height = |liquid: &Liquid<PlainLevelSet>| {
        let (view, mut sums) = (liquid.surface().view(), [0.0; 2]);
        for (at, cell) in view.rows.iter().enumerate() {
            let share = f64::from((0.5 - view.phi[at]).clamp(0.0, 1.0));
            sums = [sums[0] + share, sums[1] + share * (f64::from(cell[1]) + 0.5) / 48.0];
        }
        sums[1] / sums[0]
    };
    let start = height(&liquid);
    let (mut substeps, step) = (0, 0.3 / f64::from(steps));
    for _ in 0..steps {
        let report = liquid.step_frame(&FALLING, step);
        assert_eq!(report.pressure_iterations, 0);
        substeps += report.substeps;
    }
    assert!(steps == 6 || substeps == steps, "{substeps}");
    let (speed, way) = (9.81 * 0.3, 0.5 * 9.81 * 0.3 * 0.3);
    let motion = liquid.motion();
    for (at, _) in motion.known.iter().enumerate().filter(|(_, mask)| **mask & 2 == 2) {
        let u = f64::from(motion.velocity().faces()[1][at]);
        assert!((u / -speed - 1.0).abs() < 1e-5, "{u} {speed}");
    }
    // Past the liquid as in it.
    let past = liquid.velocity(4);
    assert!(past.rows().len() > 2 * motion.liquid_cells());
    assert!(past.faces()[1].iter().all(|u| (f64::from(*u) / -speed - 1.0).abs() < 1e-5));
    let fallen = start - height(&liquid);
    assert!((fallen / way - 1.0).abs() < 1e-3, "{steps}: {fallen} {way}");
}

/// Liquid that moves along a floor which cuts cells keeps its way: nothing sticks and nothing sinks in.
#[test]
fn a_block_slides_on_a_floor_that_cuts_cells() {
    let domain = Domain::closed([0; 3], [40, 14, 3]);
    let floor = |_: f64, p: Vec3| p[1] - 2.6;
    let around = Surroundings { solid: Some(Solid::still(&floor)), ..WEIGHTLESS };
    let settings = LiquidSettings::new(domain, 1.0 / 16.0);
    let mut liquid = Liquid::new(settings, PlainLevelSet::new(domain, block([4.0, -9.0, -9.0], [16.0, 9.0, 9.0])));
    liquid.set_velocity(|_| [1.0, 0.0, 0.0], &around);
    let start = volume(&liquid.surface().view(), &domain);
    for _ in 0..20 {
        liquid.step_frame(&around, 0.05);
    }
    let faces = liquid.motion().velocity().faces();
    let moving = liquid.motion().known.iter().zip(&faces[0]).filter(|(mask, u)| *mask & 1 == 1 && **u != 0.0);
    assert!(moving.clone().count() > 200 && moving.clone().all(|(_, u)| (u - 1.0).abs() < 1e-3));
    let kept = volume(&liquid.surface().view(), &domain) / start;
    assert!((kept - 1.0).abs() < 0.05, "{kept}");
}
