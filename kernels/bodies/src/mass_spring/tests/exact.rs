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

/// Gravity from 0 to g within a frame of a second, and drag from 0 to 4/s: a body falls by g/6, and a thrown one keeps
/// e⁻² of its speed.
#[test]
fn gravity_and_drag_that_change_within_a_frame_act_as_their_integrals() {
    let body = block_body([2, 2, 2], 0.1, &material(1e3, 1e4, 0.01));
    let errors = |integrator, substeps| -> [f64; 2] {
        let falls = |time: f64| Ambient { gravity: [0.0, -9.81 * time, 0.0], drag: 0.0 };
        let slows = |time: f64| Ambient { gravity: [0.0; 3], drag: 4.0 * time };
        let frame = SolverFrame { seconds: 1.0, integrator, substeps, ..BARE };
        let start = State::at_rest(&body);
        let mut state = start.clone();
        let falling = SolverFrame { gravity: [0.0, -9.81, 0.0], during: Some(&falls), ..frame };
        let report = steps(&body, &mut state, &falling, 1);
        if integrator == Integrator::Default && substeps >= 16 {
            let lost = report.energy_lost / report.kinetic;
            assert!(lost.abs() < 2.0 / f64::from(substeps * substeps), "{lost} of the energy lost");
        }
        let fallen = start.positions[3][1] - state.positions[3][1];
        let mut state = start;
        state.velocities.fill([2.0, 0.0, 0.0]);
        let _ = steps(&body, &mut state, &SolverFrame { drag: 4.0, during: Some(&slows), ..frame }, 1);
        [fallen / (9.81 / 6.0) - 1.0, 0.5 * state.velocities[3][0] / libm::exp(-2.0) - 1.0].map(f64::abs)
    };
    for (integrator, order) in [(Integrator::Default, 1.8..2.3), (Integrator::Euler, 0.8..1.2)] {
        let found = [16, 64, 256].map(|substeps| errors(integrator, substeps));
        for what in [0, 1] {
            let orders = [0, 1].map(|k| libm::log2(found[k][what] / found[k + 1][what]) / 2.0);
            assert!(orders.iter().all(|found| order.contains(found)), "{integrator:?}: orders {orders:?} of {found:?}");
        }
    }
    let found = errors(Integrator::Accurate { tolerance: 1e-5 }, 0);
    assert!(found.iter().all(|error| *error < 1e-3), "{found:?}");
}
