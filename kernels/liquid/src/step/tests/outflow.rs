use super::*;
use crate::marked::MarkedSurface;
use crate::volumes::VolumeTargets;

#[test]
fn liquid_leaves_through_open_walls_as_it_is_told() {
    let mut domain = Domain::closed([0; 3], [24, 12, 4]);
    domain.walls[0][1] = Wall::Open;
    let settings = LiquidSettings::new(domain, 1.0 / 24.0);
    let mut liquid = Liquid::new(settings, PlainLevelSet::new(domain, block([-9.0; 3], [20.0, 8.0, 30.0])));
    let start = volume(&liquid.surface().view(), &domain);
    let mut left = 0.0;
    for _ in 0..24 {
        let report = liquid.step_frame(&FALLING, 1.0 / 24.0);
        left += report.left_domain * (24.0 * 24.0 * 24.0);
    }
    let now = volume(&liquid.surface().view(), &domain);
    assert!(left > 0.3 * start && (start - now - left).abs() < 0.02 * start, "{start} {now} {left}");
}

/// A ball that flies through a corner of two open walls: what leaves is what it has lost, after every frame and in the end.
#[test]
fn what_leaves_through_open_walls_is_counted_at_any_substep() {
    let mut domain = Domain::closed([0; 3], [20; 3]);
    (domain.walls[0][1], domain.walls[1][0]) = (Wall::Open, Wall::Open);
    let ball = |p: Vec3| length([p[0] - 12.0, p[1] - 9.0, p[2] - 10.0]) - 5.0;
    let cell = 1.0 / 20.0;
    for cfl in [0.5, 2.0, 8.0] {
        let settings = LiquidSettings { cfl, ..LiquidSettings::new(domain, cell) };
        let mut surface = MarkedSurface::new(domain, 1, ball, 0, 1);
        let start = VolumeTargets::new(&mut surface, cell, None).volume();
        let mut liquid = Liquid::new(settings, surface);
        liquid.set_velocity(|_| [2.0, -1.2, 0.2], &WEIGHTLESS);
        let mut left = 0.0;
        for _ in 0..8 {
            let report = liquid.step_frame(&WEIGHTLESS, 0.05);
            left += report.left_domain;
            let told: f64 = liquid.outflow().iter().map(|outflow| outflow.volume).sum();
            assert!((told - report.left_domain).abs() < 1e-12 * start, "{told} {report:?}");
            let now = VolumeTargets::new(&mut liquid.surface().clone(), cell, None).volume();
            assert!((start - now - left).abs() < 0.03 * start, "{cfl}: {start} {now} {left}");
        }
        assert!((left / start - 1.0).abs() < 0.02, "{cfl}: {left} {start}");
    }
}

/// What lies beyond an open wall is air: a block that touches one leaves it behind, at its speed and with its volume.
#[test]
fn no_liquid_comes_in_through_open_walls() {
    let cell = 1.0 / 16.0;
    for (axis, side, resolution) in [(0, 0, 1), (1, 1, 1), (2, 1, 2)] {
        for cfl in [0.5, 2.0] {
            let mut domain = Domain::closed([0; 3], [16; 3]);
            domain.walls[axis][side] = Wall::Open;
            let [low, high] = if side == 0 { [-9.0, 6.0] } else { [10.0, 25.0] };
            let (mut from, mut to) = ([5.0; 3], [11.0; 3]);
            (from[axis], to[axis]) = (low, high);
            let surface = MarkedSurface::new(domain, resolution, block(from, to), 0, 1);
            let start = VolumeTargets::new(&mut surface.clone(), cell, None).volume();
            let mut liquid = Liquid::new(LiquidSettings { cfl, ..LiquidSettings::new(domain, cell) }, surface);
            let inward = if side == 0 { 1.0 } else { -1.0 };
            liquid.set_velocity(|_| [0, 1, 2].map(|k| if k == axis { inward } else { 0.0 }), &WEIGHTLESS);
            for _ in 0..6 {
                let report = liquid.step_frame(&WEIGHTLESS, 0.05);
                assert_eq!(report.left_domain, 0.0);
            }
            let now = VolumeTargets::new(&mut liquid.surface().clone(), cell, None).volume();
            // Air comes in up to a fifth of a cell late, of six.
            assert!((now / start - 1.0).abs() < 0.05, "{axis} {side} {cfl}: {start} {now}");
            let mesh = liquid.surface().mesh(None);
            let sum = mesh.points.iter().fold(0.0, |sum, point| sum + f64::from(point[axis]));
            let middle = sum / (mesh.points.len() as f64 * f64::from(resolution));
            let expected = if side == 0 { 3.0 + 0.3 * 16.0 } else { 13.0 - 0.3 * 16.0 };
            assert!((middle - expected).abs() < 0.3, "{axis} {side} {cfl}: {middle} {expected}");
        }
    }
}

/// A brim-full box whose floor's liquid is drained keeps a level that falls by what went.
#[test]
fn a_full_box_under_an_open_top_drains() {
    let cell = 0.1;
    let mut domain = Domain::closed([0; 3], [10, 10, 10]);
    domain.walls[1][1] = Wall::Open;
    let mut surface = MarkedSurface::new(domain, 1, block([-9.0; 3], [20.0; 3]), 0, 1);
    let start = VolumeTargets::new(&mut surface, cell, None).volume();
    let mut liquid = Liquid::new(LiquidSettings::new(domain, cell), surface);
    let distance = |_: f64, p: Vec3| length([p[0] - 5.0, p[1] - 2.5, p[2] - 5.0]) - 2.0;
    let sink = LiquidSink::new(
        SourceShape { distance: &distance, bounds: [[3, 0, 3], [7, 5, 7]] },
        Some(&|from, to| 0.5 * (to - from)),
    );
    let around = Surroundings { sinks: &[sink], ..FALLING };
    let (mut sunk, mut left) = (0.0, 0.0);
    for _ in 0..24 {
        let report = liquid.step_frame(&around, 1.0 / 24.0);
        (sunk, left) = (sunk + report.sunk, left + report.left_domain);
    }
    let now = VolumeTargets::new(&mut liquid.surface().clone(), cell, None).volume();
    assert!(sunk > 0.45 && left < 1e-3, "{sunk} {left}");
    assert!((start - now - sunk).abs() < 0.05 * start, "{start} {now} {sunk}");
}
