//! Thick liquid that spreads over a plate.

use crate::marked::MarkedSurface;

use super::*;

/// What a drop of 100 Pa·s gains of its volume while it spreads over a plate at this height, in cells of 9 mm, without
/// correction.
fn gained(height: f32) -> f64 {
    let domain = Domain::closed([0; 3], [32, 12, 32]);
    let drop = |p: Vec3| (libm::hypotf(p[0] - 16.1, p[2] - 16.3) - 5.0).max(p[1] - height - 5.0);
    let (plate, still) = (|p: Vec3| p[1] - height, |_: f64, p: Vec3| p[1] - height);
    let mut surface = MarkedSurface::new(domain, 1, drop, 0, 1);
    surface.meet(&plate);
    let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.009), surface);
    let around = Surroundings { viscosity: &|_| 100.0, solid: Some(Solid::still(&still)), ..FALLING };
    let mut spread = |frames: u32| {
        (0..frames).for_each(|_| {
            liquid.step_frame(&around, 1.0 / 24.0);
        });
        liquid.surface().mesh(Some(&plate)).volume()
    };
    // At first its edges are rounded.
    let before = spread(6);
    spread(30) / before - 1.0
}

#[test]
fn a_drop_that_spreads_keeps_its_volume() {
    for height in [4.0, 3.74, 3.4] {
        let gained = gained(height);
        assert!(gained.abs() < 0.025, "a plate at {height}: {gained}");
    }
}
