//! Contacts together with the solver: bodies at rest, pressed and rolled over.

use super::*;
use crate::mass_spring::{BodySolver, Material, Mesh, SoftBody, SolverFrame, State};
use crate::tets::{boundary, cubes};
use numerics::masked::Masked;

pub(super) const FRAME: f64 = 1.0 / 24.0;

pub(super) type Block = (Vec<[f64; 3]>, Vec<[u32; 4]>, Vec<[u32; 3]>);

/// A block of cubes of `side` with its lowest corner at `at`: particles, tets, and outward surface triangles.
pub(super) fn block(cells: [usize; 3], side: f64, at: [f64; 3]) -> Block {
    let (points, tets) = cubes(cells, at, cells.map(|n| side * n as f64));
    let narrow: Vec<_> = points.iter().map(|p| p.map(|x| x as f32)).collect();
    let outer = boundary(&tets, &narrow).iter().map(|face| face.corners).collect();
    (points, tets, outer)
}

fn body(points: &[[f64; 3]], tets: &[[u32; 4]], stiffness: f64) -> SoftBody {
    let plain = |value| Masked::uniform(value);
    let material = Material { density: plain(1000.0), stiffness: plain(stiffness), damping: plain(0.02) };
    SoftBody::new(&Mesh { points, tets, ..Mesh::default() }, &material, &[]).unwrap()
}

#[test]
fn a_block_on_a_mesh_plate_comes_to_rest_and_does_not_sink() {
    let thickness = 2e-3;
    // 8 × 8 squares, not aligned with those of the block.
    let mut plate = Vec::new();
    for z in 0..9 {
        plate.extend((0..9).map(|x| [0.113 * f64::from(x) - 0.3, 0.0, 0.107 * f64::from(z) - 0.3]));
    }
    let squares = (0..64u32).map(|k| (k % 8) + 9 * (k / 8));
    let triangles: Vec<[u32; 3]> = squares.flat_map(|a| [[a, a + 9, a + 10], [a, a + 10, a + 1]]).collect();
    let plate = [Obstacle::new(&triangles, &[pose(0.0, &plate)], FRAME, thickness, 0.5).unwrap()];
    for (stiffness, side) in [(5e4, 0.1), (5e3, 0.02)] {
        let (points, tets, faces) = block([3, 3, 3], side, [0.03, 0.9 * thickness, 0.05]);
        let body = body(&points, &tets, stiffness);
        let skins = [BodySkin::new(&points, &faces, &body.springs()).unwrap()];
        let self_contact = Some(ContactParams { thickness, friction: 0.5 });
        let scene = CollisionScene { skins: &skins, obstacles: &plate, self_contact, ..CollisionScene::default() };
        let frame = SolverFrame { contacts: Some(&scene), seconds: FRAME, ..SolverFrame::default() };
        let mut state = State::at_rest(&body);
        let mut solver = BodySolver::new(&body);
        for number in 0..240 {
            let report = solver.step(&body, &mut state, &frame);
            let lowest = state.positions.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
            assert!(lowest > 0.0, "frame {number}: {lowest} {report:?}");
            let speed = fastest(&state);
            assert!(number < 120 || speed < 1e-4 * 9.81 * FRAME, "frame {number}: {} g·dt", speed / (9.81 * FRAME));
        }
    }
}

fn fastest(state: &State) -> f64 {
    state.velocities.iter().map(|v| DVec3::from(*v).norm()).fold(0.0, f64::max)
}

pub(super) const THICKNESS: f64 = 1e-3;

/// A pin that rolls ten thicknesses a frame, 1 cm deep in the block of [`rolled_over`].
fn rolling(frame: f64) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let (points, triangles) = cylinder(8, 0.05, 0.3);
    let distance = frame * 10.0 * THICKNESS;
    let (sine, cosine) = libm::sincos(-distance / 0.05);
    let put = |[x, y, z]: &[f64; 3]| [cosine * x - sine * y - 0.08 + distance, sine * x + cosine * y + 0.1, z + 0.06];
    (points.iter().map(put).collect(), triangles)
}

/// Depth of the deepest of `points` in the pin.
fn deepest(points: &[[f64; 3]], pin: &[[f64; 3]], faces: &[[u32; 3]]) -> f64 {
    let side = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|corner| DVec3::from(pin[corner as usize]));
        (a, (b - a).cross(&(c - a)).normalize())
    };
    let sides: Vec<(DVec3, DVec3)> = faces.iter().map(side).collect();
    let depth =
        |p: &[f64; 3]| -sides.iter().map(|(a, n)| n.dot(&(DVec3::from(*p) - a))).fold(f64::NEG_INFINITY, f64::max);
    points.iter().map(depth).fold(0.0, f64::max)
}

/// Frames of a block under the pin, each advanced by `step`; returns the largest depth in any.
fn rolled_over(frames: u32, mut step: impl FnMut(&CollisionScene<'_>) -> Vec<[f64; 3]>, skins: &[BodySkin]) -> f64 {
    let ground = Some(Ground { up: [0.0, 1.0, 0.0], height: -THICKNESS, thickness: THICKNESS, friction: 0.8 });
    let mut worst = 0.0_f64;
    for frame in 0..frames {
        let [(from, faces), (to, _)] = [frame, frame + 1].map(|frame| rolling(f64::from(frame)));
        let pin = [Obstacle::new(&faces, &[pose(0.0, &from), pose(1.0, &to)], FRAME, THICKNESS, 0.3).unwrap()];
        let points = step(&CollisionScene { skins, obstacles: &pin, ground, ..CollisionScene::default() });
        worst = worst.max(deepest(&points, &to, &faces));
    }
    worst
}

#[test]
fn projecting_onto_contacts_keeps_vertices_outside_a_rolling_pin() {
    let (points, _, faces) = block([12, 3, 6], 0.02, [0.0; 3]);
    let skins = [BodySkin::new(&points, &faces, &[]).unwrap()];
    let mut now = points.clone();
    // Vertices that are moved only by projection onto their contacts.
    let put = |scene: &CollisionScene<'_>| {
        let mut contacts = find(scene, &now, &now, [0.0, 1.0]);
        contacts.retain(|contact| contact.weights[1] == 0.0);
        for _ in 0..50 {
            for contact in &contacts {
                let (p, n) = (DVec3::from(now[contact.points[0] as usize]), DVec3::from(contact.normal));
                let lacks = (contact.offset + contact.gap - n.dot(&p)).max(0.0);
                now[contact.points[0] as usize] = (p + n * lacks).into();
            }
        }
        assert!(now.iter().all(|p| p[1] > -1e-9));
        now.clone()
    };
    let worst = rolled_over(30, put, &skins);
    assert!(worst < 0.01 * THICKNESS, "{worst}");
}

#[test]
fn no_vertex_sinks_deeper_into_a_rolling_pin_than_its_thickness() {
    let (points, tets, faces) = block([12, 3, 6], 0.02, [0.0; 3]);
    // With steps in which the pin moves ten thicknesses, and steps in which it moves less than one.
    for (stiffness, substeps) in [(2e4, 0), (5e3, 0), (2e4, 16)] {
        let body = body(&points, &tets, stiffness);
        let skins = [BodySkin::new(&points, &faces, &body.springs()).unwrap()];
        let mut state = State::at_rest(&body);
        let mut solver = BodySolver::new(&body);
        let step = |scene: &CollisionScene<'_>| {
            let frame = SolverFrame { contacts: Some(scene), seconds: FRAME, substeps, ..SolverFrame::default() };
            let report = solver.step(&body, &mut state, &frame);
            assert_eq!((report.stopped, report.inverted_tets), (0, 0));
            assert!(state.positions.iter().all(|p| p[1] > -THICKNESS));
            assert!(fastest(&state) < 1.0, "{report:?}");
            state.positions.clone()
        };
        let worst = rolled_over(30, step, &skins);
        assert!(worst < THICKNESS, "{worst}");
    }
}

/// A block of dough under a box whose lower side is `height` above the ground; passes the state after each frame to
/// `each`.
fn pressed(frames: u32, height: impl Fn(f64) -> f64, mut each: impl FnMut(u32, &State)) {
    let (points, tets, faces) = block([6, 4, 6], 0.02, [0.0, THICKNESS, 0.0]);
    let body = body(&points, &tets, 5e3);
    let skins = [BodySkin::new(&points, &faces, &body.springs()).unwrap()];
    let (plate, triangles) = cuboid([0.4, 0.02, 0.4]);
    let ground = Some(Ground { up: [0.0, 1.0, 0.0], height: 0.0, thickness: THICKNESS, friction: 0.5 });
    let mut state = State::at_rest(&body);
    let mut solver = BodySolver::new(&body);
    for frame in 0..frames {
        let poses = [0.0, 1.0].map(|share| {
            let height = height(f64::from(frame) + share) + 0.01;
            let at: Vec<[f64; 3]> = plate.iter().map(|[x, y, z]| [x + 0.06, y + height, z + 0.06]).collect();
            pose(share, &at)
        });
        let plate = [Obstacle::new(&triangles, &poses, FRAME, THICKNESS, 0.5).unwrap()];
        let scene = CollisionScene { skins: &skins, obstacles: &plate, ground, ..CollisionScene::default() };
        let report = solver.step(
            &body,
            &mut state,
            &SolverFrame { contacts: Some(&scene), seconds: FRAME, ..SolverFrame::default() },
        );
        let highest = state.positions.iter().map(|p| p[1]).fold(0.0, f64::max);
        let lowest = state.positions.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
        assert!(lowest > 0.0 && highest < height(f64::from(frame + 1)), "frame {frame}: {lowest} {highest} {report:?}");
        assert!(fastest(&state) < 2.0, "frame {frame}: {report:?}");
        each(frame, &state);
    }
}

#[test]
fn dough_pressed_to_three_fifths_of_its_height_recovers() {
    let height = |frame: f64| {
        let down = if frame < 24.0 { frame / 24.0 } else { (36.0 - frame) / 12.0 };
        0.08 + 2.0 * THICKNESS - 0.4 * 0.08 * down
    };
    let mut top = 0.0;
    pressed(96, height, |_, state| top = state.positions.iter().map(|p| p[1]).fold(0.0, f64::max));
    assert!(top > 0.075, "{top}");
}

#[test]
fn dough_hit_by_fifteen_thicknesses_in_a_frame_stays_outside() {
    let height = |frame: f64| 0.09 - 0.015 * frame.min(3.0);
    pressed(24, height, |_, _| {});
}

#[test]
fn bits_under_contact_are_the_same_for_any_number_of_threads_and_after_a_resume() {
    let (points, tets, faces) = block([6, 3, 4], 0.02, [0.0; 3]);
    let body = body(&points, &tets, 5e3);
    let skins = [BodySkin::new(&points, &faces, &body.springs()).unwrap()];
    let whole = |threads: usize, resumed: bool| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut state = State::at_rest(&body);
            let mut solver = BodySolver::new(&body);
            let step = |scene: &CollisionScene<'_>| {
                if resumed {
                    solver = BodySolver::new(&body);
                    state = state.clone();
                }
                let _ =
                    solver.step(&body, &mut state, &SolverFrame { contacts: Some(scene), ..SolverFrame::default() });
                state.positions.clone()
            };
            rolled_over(14, step, &skins);
            state
        })
    };
    let one = whole(1, false);
    assert!(one == whole(3, false) && one == whole(2, true));
}

/// A corner that has slipped beyond a plate is kept on that side. Once it stretches edges to more than eight times
/// their length, they are released, and it returns.
#[test]
fn a_corner_snagged_on_a_plate_is_released_when_overstretched() {
    let (side, thick) = (0.1, 0.02);
    let (points, tets, faces) = block([3, 3, 3], side, [0.0; 3]);
    let body = body(&points, &tets, 1e4);
    let skins = [BodySkin::new(&points, &faces, &body.springs()).unwrap()];
    let corner = points.iter().position(|p| p.iter().all(|x| *x > 2.9 * side)).unwrap();
    for (high, hangs) in [(0.5, true), (1.5, false)] {
        let (mut plate, triangles) = cuboid([2.0, thick, 2.0]);
        plate.iter_mut().for_each(|p| p[1] += high - 0.5 * thick);
        let obstacles = [Obstacle::new(&triangles, &[pose(0.0, &plate)], FRAME, THICKNESS, 0.5).unwrap()];
        let scene = CollisionScene { skins: &skins, obstacles: &obstacles, ..CollisionScene::default() };
        let frame = SolverFrame {
            contacts: Some(&scene),
            seconds: FRAME,
            gravity: [0.0; 3],
            drag: 4.0,
            ..SolverFrame::default()
        };
        let mut state = State::at_rest(&body);
        state.positions[corner][1] = high + 0.1;
        assert_eq!(skins[0].released_edges(&state.positions) == 0, hangs);
        let mut solver = BodySolver::new(&body);
        for _ in 0..48 {
            let _ = solver.step(&body, &mut state, &frame);
        }
        let at = state.positions[corner][1];
        assert_eq!(at > high, hangs, "beyond {high} m, then at {at} m");
        assert_eq!(skins[0].released_edges(&state.positions), 0);
    }
}

/// Newton and CG iterations of a stack of some boxes that come to rest on each other, without bounces.
fn stacked(boxes: usize) -> [f64; 2] {
    let (mut points, mut tets, mut surfaces) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..boxes {
        let (own, of_box, faces) = block([4; 3], 0.05, [0.03 * k as f64, 0.002 + 0.203 * k as f64, 0.02 * k as f64]);
        let first = points.len() as u32;
        points.extend(own);
        tets.extend(of_box.iter().map(|tet| tet.map(|corner| corner + first)));
        surfaces.push(faces.iter().map(|face| face.map(|corner| corner + first)).collect::<Vec<_>>());
    }
    let body = body(&points, &tets, 1e5);
    let surfaces: Vec<&[[u32; 3]]> = surfaces.iter().map(Vec::as_slice).collect();
    let skins = BodySkin::several(&points, &[], &surfaces, &body.springs()).unwrap();
    let ground = Some(Ground { up: [0.0, 1.0, 0.0], height: 0.0, thickness: THICKNESS, friction: 0.5 });
    let body_contact = Some(ContactParams { thickness: THICKNESS, friction: 0.5 });
    let scene = CollisionScene { skins: &skins, ground, body_contact, ..CollisionScene::default() };
    let frame = SolverFrame { contacts: Some(&scene), seconds: FRAME, bounce: Some(0.0), ..SolverFrame::default() };
    let (mut state, mut solver) = (State::at_rest(&body), BodySolver::new(&body));
    let (mut newton, mut cg) = (0, 0);
    for _ in 0..24 {
        let report = solver.step(&body, &mut state, &frame);
        assert_eq!(report.caps_hit, 0);
        (newton, cg) = (newton + report.newton, cg + report.cg);
    }
    [newton, cg].map(f64::from)
}

/// Contacts between bodies are part of the coarse system; without, two boxes take 5.3 times as many linear iterations for
/// each of Newton's. Linear solves are accurate enough that Newton's iterations hardly grow with the number of boxes.
#[test]
fn a_stack_of_boxes_takes_hardly_more_iterations_than_one() {
    let [one, two, three] = [1, 2, 3].map(stacked);
    println!("Newton and CG of 1, 2, 3 boxes: {one:?}, {two:?}, {three:?}");
    for many in [two, three] {
        assert!(many[1] / many[0] < 4.0 * one[1] / one[0], "{one:?}, {two:?}, {three:?}");
    }
}

/// A cube of 8 cm beside a paddle of 60 cm that turns about its middle within one frame, known at quarters of it.
#[test]
fn a_paddle_that_turns_by_any_angle_in_a_frame_hits_what_is_in_its_way() {
    let (paddle, triangles) = cuboid([0.6, 0.02, 0.4]);
    let turned = |degrees: f64| -> Vec<[f64; 3]> {
        let (sine, cosine) = libm::sincos(degrees.to_radians());
        paddle.iter().map(|[x, y, z]| [cosine * x - sine * y, sine * x + cosine * y, *z]).collect()
    };
    let (sine, cosine) = libm::sincos(20.0_f64.to_radians());
    let (points, tets, faces) = block([2; 3], 0.04, [0.2 * cosine - 0.04, 0.2 * sine - 0.04, -0.04]);
    let body = body(&points, &tets, 2e4);
    let skins = [BodySkin::new(&points, &faces, &body.springs()).unwrap()];
    for degrees in [100.0, 140.0, 170.0, 200.0, 250.0, 400.0] {
        for substeps in [0, 1] {
            let poses: [ObstaclePose; 5] = std::array::from_fn(|k| {
                let share = k as f64 / 4.0;
                pose(share, &turned(degrees * share))
            });
            let obstacles = [Obstacle::new(&triangles, &poses, FRAME, THICKNESS, 0.5).unwrap()];
            let scene = CollisionScene { skins: &skins, obstacles: &obstacles, ..CollisionScene::default() };
            let frame = SolverFrame { contacts: Some(&scene), gravity: [0.0; 3], substeps, ..SolverFrame::default() };
            let mut state = State::at_rest(&body);
            let report = BodySolver::new(&body).step(&body, &mut state, &frame);
            if substeps == 1 {
                assert_eq!(report.fast_turns, 1, "{degrees} degrees");
                continue;
            }
            let found = scene.penetration(&state.positions);
            let what = format!("{degrees} degrees: {found:?} {report:?}");
            println!("{what} {}", fastest(&state));
            assert!(fastest(&state) > 2.0 && found.inside == 0 && report.fast_turns == 0, "{what}");
        }
    }
    let far: Vec<[f64; 3]> = points.iter().map(|[x, y, z]| [x + 1.0, *y, *z]).collect();
    let obstacles =
        [Obstacle::new(&triangles, &[pose(0.0, &paddle), pose(1.0, &turned(170.0))], FRAME, THICKNESS, 0.5).unwrap()];
    let scene = CollisionScene { skins: &skins, obstacles: &obstacles, ..CollisionScene::default() };
    let steps = |x: &[[f64; 3]]| scene.least_steps(&ContactQuery { from: x, to: x, times: [0.0, 1.0] });
    assert_eq!((steps(&points), steps(&far)), (3, 1), "one in its way takes steps of 60 degrees at most");
}
