//! Bodies too soft to carry their weight, of which all particles meet what they touch, not only those of the skin; and
//! bodies that a plate leaves no room.

use super::bodies::{Block, FRAME, THICKNESS, block};
use super::*;
use crate::mass_spring::{BodySolver, FrameReport, Material, Mesh, SoftBody, SolverFrame, State};
use numerics::masked::Masked;

/// A block, `stiffness` Pa and `density` kg/m³, on the ground at 0 under `gravity`.
struct Drop {
    shape: Block,
    stiffness: f64,
    density: f64,
    gravity: f64,
}

impl Drop {
    fn run(&self, frames: usize) -> (State, FrameReport) {
        let (points, tets, faces) = &self.shape;
        let plain = |value| Masked::uniform(value);
        let material =
            Material { density: plain(self.density), stiffness: plain(self.stiffness), damping: plain(0.01) };
        let body = SoftBody::new(&Mesh { points, tets, ..Mesh::default() }, &material, &[]).unwrap();
        let skins = [BodySkin::new(points, faces, &body.springs()).unwrap()];
        let ground = Some(Ground { up: [0.0, 1.0, 0.0], height: 0.0, thickness: THICKNESS, friction: 0.5 });
        let scene = CollisionScene { skins: &skins, ground, ..CollisionScene::default() };
        let gravity = [0.0, -self.gravity, 0.0];
        let frame = SolverFrame { contacts: Some(&scene), seconds: FRAME, gravity, ..SolverFrame::default() };
        let mut state = State::at_rest(&body);
        let mut solver = BodySolver::new(&body);
        let mut report = FrameReport::default();
        for _ in 0..frames {
            report = solver.step(&body, &mut state, &frame);
        }
        (state, report)
    }
}

fn lowest(state: &State) -> f64 {
    state.positions.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min)
}

#[test]
fn bodies_of_any_stiffness_and_density_land_above_the_ground() {
    let drops = [1e-6, 1.0, 1e3, 1e6, 1e12].map(|stiffness| (stiffness, 1e3, 9.81));
    let dense = [1e-6, 1.0, 1e6].map(|density| (5e3, density, 9.81));
    let heavy = [(5e3, 1e3, 1e4), (1e-6, 1e6, 1e4), (1e12, 1e-6, 1e4)];
    for (stiffness, density, gravity) in drops.into_iter().chain(dense).chain(heavy) {
        let shape = block([4; 3], 0.1, [0.0, 0.05, 0.0]);
        let (state, report) = Drop { shape, stiffness, density, gravity }.run(24);
        let low = lowest(&state);
        assert!(low > -2.0 * THICKNESS, "E {stiffness}, {density} kg/m³, {gravity} m/s²: {low} m, {report:?}");
    }
}

/// E ÷ (ρgh) is 0.08.
#[test]
fn a_body_too_soft_to_carry_its_weight_sags_within_its_skin() {
    for (cells, most_inverted) in [(4, 0.1), (8, 0.06)] {
        let shape = block([cells; 3], 0.4 / cells as f64, [0.0, 0.2, 0.0]);
        let tets = shape.1.len() as f64;
        let (state, report) = Drop { shape, stiffness: 300.0, density: 1e3, gravity: 9.81 }.run(48);
        let low = lowest(&state);
        assert!(low > 0.0 && (report.volume_ratio - 1.0).abs() < 0.03, "{cells} cells: {low} m, {report:?}");
        let inverted = f64::from(report.inverted_tets) / tets;
        assert!(inverted < most_inverted, "{cells} cells: {inverted} of the tets are inverted");
    }
}

/// The middle one of 27 particles moves out through its skin, into another body and towards a plate.
#[test]
fn inner_particles_meet_obstacles_and_other_skins_but_not_their_own() {
    let (points, tets, faces) = block([2; 3], 0.1, [0.0; 3]);
    let (other, others, outer) = block([1; 3], 0.04, [0.08, 0.08, 0.22]);
    let first = points.len() as u32;
    let all: Vec<[f64; 3]> = points.iter().chain(&other).copied().collect();
    let shifted: Vec<[u32; 3]> = outer.iter().map(|face| face.map(|corner| corner + first)).collect();
    let tets = tets.iter().copied().chain(others.iter().map(|tet| tet.map(|corner| corner + first)));
    let links: Vec<[u32; 2]> = tets.flat_map(|[a, b, c, d]| [[a, b], [a, c], [a, d]]).chain([[26, first]]).collect();
    let skins = BodySkin::several(&all, &[], &[&faces, &shifted], &links).unwrap();
    assert_eq!(skins[0].touching, (0..first).collect::<Vec<_>>(), "the one in the middle is found by its links");
    assert_eq!(skins[1].touching, (first..all.len() as u32).collect::<Vec<_>>());

    let inner = points.iter().position(|p| *p == [0.1; 3]).unwrap() as u32;
    let mut to = all.clone();
    to[inner as usize] = [0.1, 0.1, 0.24];
    let touch = Some(ContactParams { thickness: 1e-3, friction: 0.5 });
    let (plate, triangles) = cuboid([1.0, 1.0, 0.02]);
    let plate: Vec<[f64; 3]> = plate.iter().map(|[x, y, z]| [*x, *y, z + 0.3]).collect();
    let obstacles = [Obstacle::new(&triangles, &[pose(0.0, &plate)], 1.0, 0.06, 0.5).unwrap()];
    let mine = |scene: &CollisionScene<'_>| {
        find(scene, &all, &to, [0.0, 1.0]).iter().filter(|contact| contact.points[0] == inner).count()
    };
    let bare = CollisionScene { skins: &skins, ..CollisionScene::default() };
    assert_eq!(mine(&CollisionScene { body_contact: touch, ..bare }), 1);
    assert_eq!(mine(&CollisionScene { obstacles: &obstacles, ..bare }), 1);
    assert_eq!(mine(&CollisionScene { self_contact: touch, ..bare }), 0);
}

/// A plate comes down to the ground, stays there and lifts off. There is no room under it, which is given up soon and
/// said; afterwards the block has its volume, on the ground and below the plate.
#[test]
fn a_block_under_a_plate_that_leaves_no_room_comes_back_below_it() {
    let (points, tets, faces) = block([3; 3], 0.1 / 3.0, [0.0, 2.0 * THICKNESS, 0.0]);
    let (plate, triangles) = cuboid([2.0, 0.1, 2.0]);
    let foot = |time: f64| if time < 9.0 { (0.11 - 0.11 * time / 3.0).max(0.0) } else { 0.05 * (time - 9.0) };
    let ground = Some(Ground { up: [0.0, 1.0, 0.0], height: 0.0, thickness: THICKNESS, friction: 0.5 });
    for stiffness in [5e3, 1e9] {
        let plain = |value| Masked::uniform(value);
        let material = Material { density: plain(1e3), stiffness: plain(stiffness), damping: plain(0.01) };
        let body = SoftBody::new(&Mesh { points: &points, tets: &tets, ..Mesh::default() }, &material, &[]).unwrap();
        let skins = [BodySkin::new(&points, &faces, &body.springs()).unwrap()];
        let (mut state, mut solver) = (State::at_rest(&body), BodySolver::new(&body));
        for frame in 0..24 {
            let poses = [0.0, 0.5, 1.0].map(|share| {
                let foot = foot(f64::from(frame) + share);
                pose(share, &plate.iter().map(|[x, y, z]| [*x, y + 0.05 + foot, *z]).collect::<Vec<_>>())
            });
            let plate = [Obstacle::new(&triangles, &poses, FRAME, THICKNESS, 0.5).unwrap()];
            let scene = CollisionScene { skins: &skins, obstacles: &plate, ground, ..CollisionScene::default() };
            let frame_input = SolverFrame { contacts: Some(&scene), seconds: FRAME, ..SolverFrame::default() };
            let report = solver.step(&body, &mut state, &frame_input);
            let jammed = (2..9).contains(&frame);
            assert_eq!(report.jammed > 0, jammed, "E {stiffness}, frame {frame}: {report:?}");
            assert!(!jammed || report.newton <= 100, "E {stiffness}, frame {frame}: {report:?}");
            let highest = state.positions.iter().map(|p| p[1]).fold(0.0, f64::max);
            assert!(frame < 12 || highest < foot(f64::from(frame + 1)), "E {stiffness}, frame {frame}: {highest} m");
            assert!(frame < 23 || (report.volume_ratio - 1.0).abs() < 0.02, "E {stiffness}: {report:?}");
        }
        assert!(lowest(&state) > 0.0);
    }
}
