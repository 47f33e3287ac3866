use super::*;
use crate::marked::MarkedSurface;
use crate::volumes::VolumeTargets;

/// T = t·√(2g/a) and Z = front ÷ a of a column twice as high as its base a (Martin and Moyce 1952).
const MEASURED: [(f64, f64); 8] =
    [(1.43, 1.67), (1.63, 1.89), (1.83, 2.11), (1.98, 2.33), (2.2, 2.56), (2.32, 2.78), (2.51, 3.0), (2.65, 3.22)];

/// The farthest place on the floor that liquid has reached, in cells.
fn front(view: &PhiView<'_>) -> f64 {
    let row = view.rows.row(0, 1);
    let mut front = 0.0;
    for span in row {
        for x in span.start..span.end - 1 {
            let (a, b) = (view.phi[span.at(x)], view.phi[span.at(x + 1)]);
            if a < 0.0 && b >= 0.0 {
                front = f64::from(x) + 0.5 + f64::from(a / (a - b));
            }
        }
    }
    front
}

/// Kinetic and potential energy ÷ density · cell³, and the mean of x, in cells.
fn energy_and_middle(liquid: &Liquid<MarkedSurface>, domain: &Domain, cell: f64) -> [f64; 2] {
    let (view, motion) = (liquid.surface().view(), liquid.motion());
    let [mut mass, mut height, mut middle] = [0.0; 3];
    for (at, [x, y, _]) in view.rows.iter().enumerate().filter(|(_, cell)| domain.contains(*cell)) {
        let share = f64::from((0.5 - view.phi[at]).clamp(0.0, 1.0));
        mass += share;
        height += share * (f64::from(y) + 0.5) * cell;
        middle += share * (f64::from(x) + 0.5);
    }
    let share = |cell: [i32; 3]| {
        let at = view.rows.find(cell).filter(|_| domain.contains(cell));
        f64::from(at.map_or(0.0, |at| (0.5 - view.phi[at]).clamp(0.0, 1.0)))
    };
    [9.81 * height + kinetic_energy(motion, share), middle / mass]
}

/// With its volume kept, as the piece that sloshes: energy then shows what motion gains.
#[test]
fn a_dam_breaks_as_measured_and_then_sloshes() {
    let (base, cell) = (10.0_f32, 1.0 / 160.0);
    let domain = Domain::closed([0; 3], [50, 30, 2]);
    let block = block([-9.0; 3], [base, 2.0 * base, 9.0]);
    let settings = LiquidSettings::new(domain, cell);
    let mut surface = MarkedSurface::new(domain, 1, block, 0, 1);
    let mut targets = VolumeTargets::new(&mut surface, cell, None);
    let mut liquid = Liquid::new(settings.clone(), surface);
    let unit = (f64::from(base) * cell / (2.0 * 9.81)).sqrt();
    let [energy, _] = energy_and_middle(&liquid, &domain, cell);
    let (mut fronts, mut middles) = (vec![(0.0, 1.0)], Vec::new());
    for frame in 1..=170 {
        let report = liquid.step_frame(&FALLING, 0.1 * unit);
        assert!(report.max_divergence < 1e-4 && report.cfl_reached < 2.2, "{report:?}");
        let (mut surface, motion) = liquid.into_parts();
        let volume = targets.correct(&mut surface, None);
        liquid = Liquid::resume(settings.clone(), surface, motion);
        let time = 0.1 * f64::from(frame);
        if time < 3.2 {
            let front = front(&liquid.surface().view()) / f64::from(base);
            assert!(front < 1.0 + 2.0 * time, "{time} {front}");
            fronts.push((time, front));
        }
        let [now, middle] = energy_and_middle(&liquid, &domain, cell);
        middles.push(middle);
        assert!(now < 1.03 * energy && volume.drift.abs() < 0.01, "{time}: {now} {energy} {volume:?}");
    }
    let at = |time: f64| {
        let next = fronts.partition_point(|(t, _)| *t < time);
        let ((t0, a), (t1, b)) = (fronts[next - 1], fronts[next]);
        a + (b - a) * (time - t0) / (t1 - t0)
    };
    for (time, measured) in MEASURED.into_iter().filter(|(time, _)| *time > 1.6) {
        let ratio = at(time) / measured;
        assert!((0.95..1.2).contains(&ratio), "{time}: {ratio}");
    }
    let slope = (at(2.65) - at(1.63)) / 1.02;
    assert!((slope / 1.304 - 1.0).abs() < 0.08, "{slope}");
    // To the far side, and back.
    let (turn, far) = middles.iter().enumerate().fold((0, 0.0), |a, b| if *b.1 > a.1 { (b.0, *b.1) } else { a });
    let back = middles[turn..].iter().fold(far, |least, x| least.min(*x));
    assert!(far > 33.0 && back < 25.0, "{turn} {far} {back}");
}
