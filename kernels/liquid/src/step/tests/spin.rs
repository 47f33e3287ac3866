use super::plain::Still;
use super::*;
use numerics::vector::length;

/// Angular momentum about the line x = y = 32.
fn spin(liquid: &Liquid<impl Surface>) -> f64 {
    let motion = liquid.motion();
    let mut sum = 0.0;
    for (at, cell) in motion.rows().iter().enumerate() {
        let [x, y, _] = cell.map(f64::from);
        let u = |axis: usize| f64::from(motion.velocity().faces()[axis][at]);
        sum += (x - 32.0) * u(1) - (y - 32.0) * u(0);
    }
    sum
}

const TURN: f32 = std::f32::consts::TAU;

/// A disk of 19.2 cells radius with a free surface, turned once in so many substeps; what is left of its angular momentum.
/// The surface stays: a free disk, whose pressure is below that of the air, is not stable.
fn turned_disk(splitting: Splitting, scheme: Scheme, substeps: u32) -> f64 {
    let domain = Domain::closed([0; 3], [64, 64, 2]);
    let surface = Still::new(domain, |[x, y, _]| length([x - 32.0, y - 32.0, 0.0]) - 19.2);
    let settings = LiquidSettings { splitting, scheme, cfl: 1e9, tolerance: 1e-5, ..LiquidSettings::new(domain, 1.0) };
    let mut liquid = Liquid::new(settings, surface);
    liquid.set_velocity(|[x, y, _]| [-TURN * (y - 32.0), TURN * (x - 32.0), 0.0], &WEIGHTLESS);
    let start = spin(&liquid);
    for _ in 0..substeps {
        let report = liquid.step_frame(&WEIGHTLESS, 1.0 / f64::from(substeps));
        assert_eq!((report.substeps, report.solves_cut_short), (1, 0));
    }
    spin(&liquid) / start
}

#[test]
fn a_turn_keeps_its_angular_momentum() {
    let kept = |substeps, scheme| turned_disk(Splitting::KeepsSpin, scheme, substeps);
    for (substeps, scheme) in [(100, Scheme::MacCormack), (100, Scheme::SemiLagrangian), (50, Scheme::MacCormack)] {
        let kept = kept(substeps, scheme);
        assert!((kept - 1.0).abs() < 0.01, "{substeps} {scheme:?}: {kept}");
    }
    // What it is without.
    let plain = turned_disk(Splitting::Plain, Scheme::MacCormack, 50);
    assert!(plain < 0.76, "{plain}");
}
