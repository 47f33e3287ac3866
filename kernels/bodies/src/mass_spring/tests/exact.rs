//! Closed forms in addition to those in tests/softbody/accuracy: a hanging chain, a rotating spring, weights.

use super::*;

#[test]
fn a_hanging_chain_stretches_by_the_weight_below() {
    let count = 6;
    let points: Vec<[f64; 3]> = (0..count).map(|i| [0.0, -f64::from(i), 0.0]).collect();
    let springs: Vec<BodySpring> =
        (1..count).map(|i| BodySpring { ends: [i - 1, i], stiffness: 500.0, damping: 50.0, length: 1.0 }).collect();
    let body = SoftBody::of_springs(&points, &[2.0; 6], &springs).unwrap();
    let mut state = State::at_rest(&body);
    let pins = [Pin { particle: 0, between: [[0.0; 3]; 2] }];
    let _ = steps(&body, &mut state, &SolverFrame { pins: &pins, volume: 0.0, ..SolverFrame::default() }, 1000);
    for i in 1..count as usize {
        let length = state.positions[i - 1][1] - state.positions[i][1];
        let weight = 2.0 * 9.81 * f64::from(count - i as u32);
        assert!((length - 1.0 - weight / 500.0).abs() < 1e-9, "spring {i} is {length} long");
    }
}

/// Two masses rotating about each other stretch their spring by mω²r/k, 8e-4 of its length. A dashpot must not add to
/// that, since rotation does not change the length. At 9.5° a frame the velocity of the ends along the spring at the
/// end of a step would look like a change of length by 1 − cos 9.5°.
#[test]
fn a_dashpot_does_not_damp_rotation() {
    let points = [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]];
    for integrator in [Integrator::Default, Integrator::Euler] {
        for damping in [0.0, 1e2, 1e4, 1e6] {
            let spring = BodySpring { ends: [0, 1], stiffness: 1e4, damping, length: 1.0 };
            let body = SoftBody::of_springs(&points, &[1.0; 2], &[spring]).unwrap();
            let mut state = State::at_rest(&body);
            state.velocities = vec![[0.0, -2.0, 0.0], [0.0, 2.0, 0.0]];
            let mut solver = BodySolver::new(&body);
            for frame in 0..24 {
                let _ = solver.step(&body, &mut state, &SolverFrame { integrator, ..BARE });
                let length = (DVec3::from(state.positions[1]) - DVec3::from(state.positions[0])).norm();
                assert!((length - 1.0).abs() < 2.5e-3, "{integrator:?}, {damping}: {length} long in frame {frame}");
            }
        }
    }
}

#[test]
fn the_piece_that_carries_its_weight_worst_gives_the_ratio_of_stiffness_to_weight() {
    let (mut points, mut tets) = block([4, 2, 2], 0.1);
    let first = points.len() as u32;
    let (other, others) = block([2, 3, 2], 0.1);
    points.extend(other.iter().map(|[x, y, z]| [x + 1.0, *y, *z]));
    tets.extend(others.iter().map(|tet| tet.map(|corner| corner + first)));
    let body = SoftBody::new(&Mesh { points: &points, tets: &tets, ..Mesh::default() }, &material(1e3, 1e4, 0.0), &[])
        .unwrap();
    // Their heights along x and along y, metres.
    for (gravity, height) in [([-9.81, 0.0, 0.0], 0.4), ([0.0, -9.81, 0.0], 0.3), ([0.0, 2.0, 0.0], 0.3)] {
        let exact = 1e4 / (1e3 * DVec3::from(gravity).norm() * height);
        let ratio = body.stiffness_to_weight(gravity);
        assert!((ratio / exact - 1.0).abs() < 1e-12, "{ratio} is not {exact}");
    }
    assert_eq!(body.stiffness_to_weight([0.0; 3]), f64::INFINITY);
}
