use numerics::vector::sub;

use super::*;
use crate::carried::LiquidMaterial;
use crate::marked::MarkedSurface;
use crate::step::LiquidBall;

fn ball(place: Vec3) -> LiquidBall {
    LiquidBall { place, radius: 1.3, velocity: [0.8, 0.4, 0.0], material: LiquidMaterial::default() }
}

/// A ball that comes in above a pool flies as thrown, and the pool stays as it is.
#[test]
fn a_ball_flies_on_with_its_velocity() {
    let domain = Domain::closed([0; 3], [24, 20, 12]);
    let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.1), MarkedSurface::new(domain, 1, |p| p[1] - 4.0, 0, 1));
    let around = Surroundings::new(&|_| [0.0, -1.0, 0.0], &|_| 0.0);
    liquid.step_frame(&around, 0.1);
    liquid.add_ball(&ball([8.0, 12.0, 6.0]), None, 0.0);
    for _ in 0..5 {
        liquid.step_frame(&around, 0.1);
    }
    // 0.5 s at 0.8 m/s along x, and up by 0.4·0.5 − 0.5·0.25 m, less what substeps fall short of.
    let view = liquid.surface().view();
    let cells = view.rows.iter().enumerate().filter(|(at, cell)| view.phi[*at] < 0.0 && cell[1] > 6);
    let places: Vec<Vec3> = cells.map(|(_, cell)| cell.map(|x| x as f32 + 0.5)).collect();
    let centre = [0, 1, 2].map(|axis| places.iter().map(|p| p[axis]).sum::<f32>() / places.len() as f32);
    assert!(length(sub(centre, [12.0, 12.85, 6.0])) < 0.4, "{centre:?} of {}", places.len());
    let top = view.rows.iter().enumerate().filter(|(at, cell)| view.phi[*at] < 0.0 && cell[1] < 6);
    assert_eq!(top.map(|(_, cell)| cell[1]).max(), Some(3));
}

#[test]
fn a_ball_has_room_beside_walls_and_solids_or_is_none() {
    let domain = Domain::closed([0; 3], [20; 3]);
    // Solid up to a height of 3.
    let floor = |at: Vec3| at[1] - 3.0;
    let beside = |place: Vec3| ball(place).beside(&domain, &floor, |_| Some([0.0, 1.0, 0.0])).map(|ball| ball.place);
    let placed = beside([0.0, 2.5, 10.0]).unwrap();
    assert!(length(sub(placed, [1.3, 4.3, 10.0])) < 1e-5, "{placed:?}");
    assert_eq!(beside([10.0; 3]), Some([10.0; 3]));
    let solid = |_: Vec3| -1.0;
    assert_eq!(ball([10.0; 3]).beside(&domain, &solid, |_| None), None);
}
