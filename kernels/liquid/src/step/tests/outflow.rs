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
