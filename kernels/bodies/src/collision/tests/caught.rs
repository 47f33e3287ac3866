//! Memory of side: particles come back to the side of a plate from which they went in.

use super::bodies::{FRAME, THICKNESS, block};
use super::*;
use crate::mass_spring::{BodySolver, Material, Mesh, SoftBody, SolverFrame, State};
use numerics::masked::Masked;

/// A plate of 1 × 0.02 × 1 m with its lower side at these heights at the start and at the end of a frame.
fn plate(feet: [f64; 2]) -> Obstacle {
    let (points, triangles) = cuboid([1.0, 0.02, 1.0]);
    let at = |foot: f64| points.iter().map(|[x, y, z]| [*x, y + 0.01 + foot, *z]).collect::<Vec<_>>();
    let poses = [pose(0.0, &at(feet[0])), pose(1.0, &at(feet[1]))];
    Obstacle::new(&triangles, &poses, FRAME, THICKNESS, 0.5).unwrap()
}

/// The first particle of a cube goes up through a still plate at 0.2 m; the others stay below it.
#[test]
fn a_particle_that_went_through_a_plate_is_drawn_back_to_its_side() {
    let (points, _, faces) = block([1; 3], 0.1, [0.0; 3]);
    let skins = [BodySkin::new(&points, &faces, &[]).unwrap()];
    let obstacles = [plate([0.2, 0.2])];
    let scene = CollisionScene { skins: &skins, obstacles: &obstacles, ..CollisionScene::default() };
    let moved = |at: [f64; 3]| {
        let mut moved = points.clone();
        moved[0] = at;
        moved
    };
    let below = |caught: &[CaughtParticle]| {
        let corners = caught.iter().map(|caught| obstacles[0].surface.triangles[caught.face as usize]);
        caught.len() == 1 && corners.flatten().all(|corner| obstacles[0].at(0.0)[corner as usize][1] == 0.2)
    };
    let inside = scene.caught_after(&points, &moved([0.03, 0.215, 0.02]));
    assert!(below(&inside) && inside[0].particle == 0, "{inside:?}");
    let beyond = scene.caught_after(&points, &moved([0.03, 0.25, 0.02]));
    assert!(below(&beyond), "{beyond:?}");
    let scene = CollisionScene { caught: &beyond, ..scene };
    let from = moved([0.03, 0.25, 0.02]);
    let contacts: Vec<Contact> = self::find(&scene, &from, &from, [0.0, 1.0]);
    // 50 mm beyond the lower side, of which 10 gaps go in this step.
    let [contact] = contacts[..] else { panic!("{contacts:?}") };
    assert_eq!((contact.points[0], contact.normal), (0, [0.0, -1.0, 0.0]));
    assert!((contact.offset - (-0.2 - 0.04)).abs() < 1e-12, "{contact:?}");
    let around = CollisionScene { caught: &[], ..scene }.caught_after(&from, &from);
    assert!(below(&around), "it came around the rim, its edges go through: {around:?}");
    let kept = |to: [f64; 3]| !scene.caught_after(&from, &moved(to)).is_empty();
    assert!(kept([0.03, 0.21, 0.02]) && kept([-0.2, 0.4, 0.02]));
    assert!(!kept([0.03, 0.19, 0.02]), "it is back");
    assert!(!kept([0.7, 0.22, 0.02]), "it is beside the plate");
    let ground = Some(Ground { up: [0.0, 1.0, 0.0], height: 0.21, thickness: THICKNESS, friction: 0.5 });
    assert!(CollisionScene { ground, ..scene }.caught_after(&from, &from).is_empty(), "no way back");
    let all: Vec<[f64; 3]> = points.iter().map(|p| [p[0], p[1] + 0.3, p[2]]).collect();
    assert!(CollisionScene { caught: &[], ..scene }.caught_after(&points, &all).is_empty(), "the plate passed it all");
}

/// A thin plate comes down until it leaves 3 mm above the ground, or none, and lifts off again.
#[test]
fn skin_on_the_wrong_side_of_a_plate_comes_back_after_release() {
    for (cells, left) in [(4, 3e-3), (3, 0.0)] {
        let (points, tets, faces) = block([cells; 3], 0.1 / cells as f64, [-0.05, 2.0 * THICKNESS, -0.05]);
        let foot = |time: f64| {
            if time < 9.0 { (0.11 - (0.11 - left) * time / 3.0).max(left) } else { left + 0.05 * (time - 9.0) }
        };
        let ground = Some(Ground { up: [0.0, 1.0, 0.0], height: 0.0, thickness: THICKNESS, friction: 0.5 });
        let plain = |value| Masked::uniform(value);
        let material = Material { density: plain(1e3), stiffness: plain(5e3), damping: plain(0.01) };
        let body = SoftBody::new(&Mesh { points: &points, tets: &tets, ..Mesh::default() }, &material, &[]).unwrap();
        let skins = [BodySkin::new(&points, &faces, &body.springs()).unwrap()];
        let (mut state, mut solver) = (State::at_rest(&body), BodySolver::new(&body));
        let (mut caught, mut most) = (Vec::new(), 0);
        for frame in 0..20 {
            let plate = [plate([0.0, 1.0].map(|share| foot(f64::from(frame) + share)))];
            let scene =
                CollisionScene { skins: &skins, obstacles: &plate, ground, caught: &caught, ..Default::default() };
            let before = state.positions.clone();
            let input = SolverFrame { contacts: Some(&scene), seconds: FRAME, ..SolverFrame::default() };
            let report = solver.step(&body, &mut state, &input);
            assert!(report.newton < 1000, "{left}, frame {frame}: {report:?}");
            caught = scene.caught_after(&before, &state.positions);
            most = most.max(caught.len());
        }
        let highest = state.positions.iter().map(|p| p[1]).fold(0.0, f64::max);
        assert!(most > 0 && caught.is_empty() && highest < foot(20.0), "{left}: {most}, {caught:?}, {highest} m");
    }
}
