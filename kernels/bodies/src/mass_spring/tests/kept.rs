//! Invariants besides momentum and energy (which tests/softbody/accuracy covers): rest, bits.

use super::*;

#[test]
fn rigid_motion_causes_no_force() {
    let body = block_body([3, 3, 3], 0.1, &material(1000.0, 1e9, 0.01));
    let mut state = State::at_rest(&body);
    let turn = nalgebra::Rotation3::from_scaled_axis(DVec3::new(0.3, -1.2, 0.7));
    let turned: Vec<[f64; 3]> =
        state.positions.iter().map(|x| (turn * DVec3::from(*x) + DVec3::new(5.0, -3.0, 2.0)).into()).collect();
    state.positions.clone_from(&turned);
    let report = steps(&body, &mut state, &SolverFrame { volume: 1.0, ..BARE }, 5);
    for (a, b) in state.positions.iter().zip(&turned) {
        assert!((DVec3::from(*a) - DVec3::from(*b)).norm() < 1e-12);
    }
    assert!(report.elastic < 1e-12 && report.volume_energy < 1e-12 && (report.volume_ratio - 1.0).abs() < 1e-12);
}

#[test]
fn bits_are_the_same_for_any_number_of_threads_and_after_a_resume() {
    let body = block_body([20, 10, 10], 0.05, &material(1000.0, 1e5, 1e-3));
    let run = |threads: usize, resume: bool| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut state = State::at_rest(&body);
            let pins: Vec<Pin> = (0..body.len())
                .filter(|i| state.positions[*i][0] == 0.0)
                .map(|i| Pin { particle: i as u32, between: [state.positions[i]; 2] })
                .collect();
            let frame = SolverFrame { pins: &pins, ..SolverFrame::default() };
            let mut solver = BodySolver::new(&body);
            let mut reports = Vec::new();
            for _ in 0..8 {
                reports.push(solver.step(&body, &mut state, &frame));
                if resume {
                    let text = format!("{state:?}");
                    state = state.clone();
                    assert_eq!(text, format!("{state:?}"));
                    solver = BodySolver::new(&body);
                }
            }
            (reports, state)
        })
    };
    let one = run(1, false);
    assert_eq!(one, run(2, false));
    assert_eq!(one, run(7, false));
    assert_eq!(one, run(2, true));
}

#[test]
fn a_frame_of_zero_seconds_changes_no_bit() {
    let body = block_body([2, 2, 2], 0.1, &material(1000.0, 1e5, 0.01));
    let mut state = State::at_rest(&body);
    let before = state.clone();
    let report = steps(&body, &mut state, &SolverFrame { seconds: 0.0, ..SolverFrame::default() }, 1);
    assert_eq!((state.positions, state.velocities), (before.positions, before.velocities));
    assert_eq!((report.newton, report.cg), (0, 0));
    let empty = SoftBody::of_springs(&[], &[], &[]).unwrap();
    let _ = steps(&empty, &mut State::at_rest(&empty), &SolverFrame::default(), 2);
}
