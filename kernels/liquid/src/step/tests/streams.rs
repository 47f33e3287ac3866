//! Waves that a stream carries along.

use super::*;
use crate::marked::MarkedSurface;
use numerics::trig;

/// The side of a cell, m, and the length of a substep, s.
const CELL: f64 = 0.01;
const SECONDS: f64 = 1.0 / 48.0;

/// The box of a stream with a wave of `length` cells.
fn channel(length: i32) -> Domain {
    let walls = [[Wall::Periodic; 2], [Wall::FreeSlip; 2], [Wall::Periodic; 2]];
    Domain { walls, ..Domain::closed([0; 3], [length, 14, 3]) }
}

/// A wave of `length` cells and 0.2 cells amplitude on a stream 8 cells deep that moves `way` cells a substep.
fn stream(length: i32, way: f64, max_iterations: u32) -> Liquid<MarkedSurface> {
    let domain = channel(length);
    let settings = LiquidSettings { cfl: 16.0, max_substeps: 1, max_iterations, ..LiquidSettings::new(domain, CELL) };
    let k = std::f32::consts::TAU / length as f32;
    let hill = move |p: Vec3| p[1] - 8.1 - 0.2 * trig::sin_cos(k * p[0]).1;
    let mut liquid = Liquid::new(settings, MarkedSurface::new(domain, 1, hill, 0, 1));
    let speed = (way * CELL / SECONDS) as f32;
    liquid.set_velocity(|_| [speed, 0.0, 0.0], &FALLING);
    liquid
}

/// The largest amplitudes of its wave in successive periods, cells.
fn amplitudes(length: i32, way: f64, substeps: u32) -> Vec<f64> {
    let (domain, mut liquid) = (channel(length), stream(length, way, 200));
    let k = std::f32::consts::TAU / length as f32;
    let amplitude = |liquid: &Liquid<MarkedSurface>| {
        let view = liquid.surface().view();
        let mut sums = [0.0; 2];
        for (at, cell) in view.rows.iter().enumerate() {
            if domain.contains(cell) {
                let share = f64::from((0.5 - view.phi[at]).clamp(0.0, 1.0));
                let (sin, cos) = trig::sin_cos(k * (cell[0] as f32 + 0.5));
                sums[0] += share * f64::from(sin);
                sums[1] += share * f64::from(cos);
            }
        }
        2.0 * (sums[0] * sums[0] + sums[1] * sums[1]).sqrt() / f64::from(3 * length)
    };
    let mut all = vec![amplitude(&liquid)];
    for _ in 0..substeps {
        liquid.step_frame(&FALLING, SECONDS);
        all.push(amplitude(&liquid));
    }
    all.chunks(8).map(|part| part.iter().copied().fold(0.0, f64::max)).collect()
}

/// A stream moves waves along and leaves them as they are, in substeps in which it moves by three cells, too. Moved with the
/// velocity of the start of each substep, waves of 16 cells grew sixfold in these 48, of 8 cells fivefold in 16.
#[test]
fn a_stream_carries_its_waves_along() {
    for (length, most) in [(16, 0.1), (8, 0.25)] {
        let rest = amplitudes(length, 0.0, 47);
        for way in [2.0, 3.0] {
            let all = amplitudes(length, way, 47);
            for (period, (own, rest)) in all.iter().zip(&rest).enumerate() {
                let (fades, grows) = (1.0 - own / rest, own / 0.2 - 1.0);
                assert!(fades < most && grows < 0.02, "{length} {way}, {period}: {all:.3?} {rest:.3?}");
            }
        }
    }
}

/// The mean velocity that the surface of a stream moves with is solved for, and that counts: its iterations, and that it ends
/// early where few are allowed.
#[test]
fn the_solve_for_the_mean_velocity_is_counted() {
    let reports = |way: f64, most: u32| {
        let mut liquid = stream(16, way, most);
        [0, 1].map(|_| liquid.step_frame(&FALLING, SECONDS))
    };
    let counts = |report: &LiquidReport| (report.solves_cut_short, report.pressure_iterations);
    // At rest first; then what the stream moves has a mean velocity.
    assert_eq!(counts(&reports(0.0, 1)[0]), (1, 1));
    assert_eq!(counts(&reports(2.0, 1)[1]), (2, 2));
    assert_eq!(reports(2.0, 200)[1].solves_cut_short, 0);
}
