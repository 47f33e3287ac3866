use super::*;
use crate::marked::MarkedSurface;
use crate::shape::{MovingShape, ShapeSettings, ShapeTopology};
use crate::volumes::VolumeTargets;
use numerics::shapes::block as cuboid;
use numerics::vector::{add, sub};

const FRAME: f64 = 1.0 / 24.0;

/// A tank with walls of three cells, half full, moves with its liquid by 1.6 cells a frame: the liquid stays what it is, where
/// it is in the tank.
#[test]
fn a_closed_tank_takes_its_liquid_along() {
    let domain = Domain { walls: [[Wall::Open; 2]; 3], ..Domain::closed([-60; 3], [60; 3]) };
    let (cell, velocity) = (0.05, [1.3_f32, 0.7, -0.4]);
    let settings = LiquidSettings::new(domain, cell);
    let moved = |seconds: f64| velocity.map(|u| u * (seconds / cell) as f32);
    let (outer, inner) = (cuboid([18.0; 3], [1; 3]), cuboid([12.0; 3], [1; 3]));
    let points: Vec<Vec3> = outer.points.iter().chain(&inner.points).map(|p| p.map(|x| x as f32)).collect();
    let (mut triangles, first) = (outer.triangles(), outer.points.len() as u32);
    triangles.extend(inner.triangles().into_iter().map(|[a, b, c]| [a + first, c + first, b + first]));
    let topology = ShapeTopology::new(&points, &triangles);
    let shapes = ShapeSettings { thicken: true, ..ShapeSettings::new(domain.low, domain.high) };
    let mut tank = MovingShape::new(&topology, &points, &points, &shapes);

    let mut surface = MarkedSurface::new(domain, 1, block([-6.0; 3], [6.0, 0.0, 6.0]), 0, 1);
    let at_start = |p: Vec3| tank.distance(0.0, p);
    surface.meet(&at_start);
    let mut targets = VolumeTargets::new(&mut surface, cell, Some(&at_start));
    let (started, around) = (targets.volume(), Surroundings { viscosity: &|_| 1.0, ..WEIGHTLESS });
    let mut liquid = Liquid::new(settings.clone(), surface);
    let still = |_: f64, p: Vec3| tank.distance(0.0, p);
    liquid.set_velocity(|_| velocity, &Surroundings { solid: Some(Solid::still(&still)), ..around });
    let (mut surface, mut motion) = liquid.into_parts();
    for frame in 1..=12 {
        let place = moved(f64::from(frame) * FRAME);
        tank = tank.next_frame(&topology, &points.iter().map(|p| add(*p, place)).collect::<Vec<_>>());
        let distance = |time: f64, p: Vec3| tank.distance((time / FRAME) as f32, p);
        let solid = Solid {
            distance: &distance,
            velocity: &|_, _| velocity,
            speed: f64::from(numerics::vector::length(velocity)),
        };
        let mut liquid = Liquid::resume(settings.clone(), surface, motion);
        liquid.step_frame(&Surroundings { solid: Some(solid), ..around }, FRAME);
        (surface, motion) = liquid.into_parts();
        let at_end = |p: Vec3| tank.distance(1.0, p);
        let report = targets.correct(&mut surface, Some(&at_end));
        assert!(report.pieces == 1 && report.lost.is_empty(), "{frame}: {report:?}");
        assert!((report.volume / started - 1.0).abs() < 3e-3, "{frame}: {report:?}");
        let phi = surface.phi_outside(&at_end);
        let in_tank = block([-7.5; 3], [7.5; 3]);
        let is_outside = |cell: Cell| in_tank(sub(Site::Centre.of(cell), place)) > 0.0;
        let outside =
            surface.view().rows.iter().zip(&phi).filter(|(cell, phi)| **phi < 0.0 && is_outside(*cell)).count();
        assert_eq!(outside, 0, "{frame}");
    }
}
