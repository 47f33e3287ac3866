//! Liquid that meets solids.

use super::*;
use crate::marked::MarkedSurface;

const CELL: f64 = 0.05;

/// Energy per mass, J/kg, above a plate on which solids are cut off at `top`, in cells.
fn energy(liquid: &Liquid<MarkedSurface>, domain: &Domain, top: f32) -> f64 {
    let (view, motion) = (liquid.surface().view(), liquid.motion());
    let share = |cell: [i32; 3]| {
        let Some(at) = view.rows.find(cell).filter(|_| domain.contains(cell)) else { return 0.0 };
        let in_solid = top - (cell[1] as f32 + 0.5);
        f64::from((0.5 - view.phi[at].max(in_solid)).clamp(0.0, 1.0))
    };
    let [mut mass, mut height] = [0.0; 2];
    for cell in view.rows.iter() {
        mass += share(cell);
        height += share(cell) * (f64::from(cell[1]) + 0.5 - f64::from(top)) * CELL;
    }
    (9.81 * height + kinetic_energy(motion, share)) / mass
}

/// A block of 8 x 6 x 8 cells falls on a plate in a closed box; the largest energy per mass in 23 frames ÷ that of the start.
fn splash(top: f32, cfl: f64) -> f64 {
    let domain = Domain::closed([0; 3], [20; 3]);
    let surface = MarkedSurface::new(domain, 1, block([6.0, 9.0, 6.0], [14.0, 15.0, 14.0]), 0, 1);
    let mut liquid = Liquid::new(LiquidSettings { cfl, ..LiquidSettings::new(domain, CELL) }, surface);
    let plate = |_: f64, p: Vec3| p[1] - top;
    let around = Surroundings { solid: Some(Solid::still(&plate)), ..FALLING };
    liquid.set_velocity(|_| [0.0; 3], &around);
    let start = energy(&liquid, &domain, top);
    let mut most = 0.0_f64;
    for _ in 0..23 {
        liquid.step_frame(&around, 1.0 / 24.0);
        most = most.max(energy(&liquid, &domain, top));
    }
    most / start
}

#[test]
fn a_splash_gains_no_energy() {
    for (top, cfl) in [(4.0, 0.5), (4.0, 1.0), (4.0, 2.0), (3.74, 1.0), (3.74, 2.0)] {
        let most = splash(top, cfl);
        assert!(most < 1.02, "{top} {cfl}: {most}");
    }
    // Where the plate cuts cells, short substeps still gain some at the first touch.
    let most = splash(3.74, 0.5);
    assert!(most < 1.15, "{most}");
}
