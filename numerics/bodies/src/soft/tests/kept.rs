//! What has to be kept: momentum, energy, bits.

use super::*;

/// A block that turns, stretches and moves.
fn thrown(seed: u64) -> (Body, State) {
    let body = block_body([5, 4, 3], 0.1, &material(1000.0, 1e5, 0.0));
    let mut state = State::at_rest(&body);
    for (index, v) in state.velocities.iter_mut().enumerate() {
        let arm = V3::from(state.positions[index]) - V3::new(0.25, 0.2, 0.15);
        *v = (V3::new(0.3, -0.2, 0.5) + V3::new(0.2, 3.0, -1.0).cross(&arm) + random(seed, index) * 0.2).into();
    }
    (body, state)
}

#[test]
fn linear_momentum_is_kept_to_rounding() {
    for (integrator, volume) in [(Integrator::Default, 0.0), (Integrator::Default, 1.0), (Integrator::Euler, 1.0)] {
        let (body, mut state) = thrown(1);
        let before = momentum(&body, &state);
        let _ = steps(&body, &mut state, &Frame { integrator, volume, ..BARE }, 200);
        let after = momentum(&body, &state);
        assert!((after - before).norm() < 1e-10 * before.norm(), "{integrator:?}: {before} became {after}");
    }
}

#[test]
fn angular_momentum_is_kept_to_the_order_of_the_method() {
    // A body whose springs a step resolves, and one a thousand times too stiff for that.
    for (stiffness, ordered) in [(1e5, true), (1e6, false), (1e8, false)] {
        let body = block_body([4, 3, 3], 0.1, &material(1000.0, stiffness, 0.0));
        let middle = V3::new(0.2, 0.15, 0.15);
        let mut lost = Vec::new();
        for steps_a_turn in [100.0, 200.0] {
            let mut state = State::at_rest(&body);
            for (x, v) in state.positions.iter_mut().zip(&mut state.velocities) {
                *v = V3::z().cross(&(V3::from(*x) - middle)).into();
                *x = (V3::from(*x) - middle).into();
            }
            let before = angular_momentum(&body, &state);
            let seconds = std::f64::consts::TAU / steps_a_turn;
            let report = steps(&body, &mut state, &Frame { seconds, ..BARE }, 1000);
            assert_eq!(report.euler_steps, 0);
            lost.push((angular_momentum(&body, &state) - before).norm() / before.norm());
        }
        assert!(lost.iter().all(|lost| *lost < 2e-3), "E {stiffness}: {lost:?}");
        assert!(!ordered || lost[1] < 0.3 * lost[0], "{lost:?}");
    }
}

#[test]
fn a_rigid_turn_and_shift_meets_no_force() {
    let body = block_body([3, 3, 3], 0.1, &material(1000.0, 1e9, 0.01));
    let mut state = State::at_rest(&body);
    let turn = nalgebra::Rotation3::from_scaled_axis(V3::new(0.3, -1.2, 0.7));
    let turned: Vec<[f64; 3]> =
        state.positions.iter().map(|x| (turn * V3::from(*x) + V3::new(5.0, -3.0, 2.0)).into()).collect();
    state.positions.clone_from(&turned);
    let report = steps(&body, &mut state, &Frame { volume: 1.0, ..BARE }, 5);
    for (a, b) in state.positions.iter().zip(&turned) {
        assert!((V3::from(*a) - V3::from(*b)).norm() < 1e-12);
    }
    assert!(report.elastic < 1e-12 && report.volume_energy < 1e-12 && (report.volume_ratio - 1.0).abs() < 1e-12);
}

#[test]
fn without_drive_energy_never_rises_above_the_start() {
    for (integrator, volume, damping) in [
        (Integrator::Default, 0.0, 0.0),
        (Integrator::Default, 1.0, 0.01),
        (Integrator::Euler, 1.0, 0.0),
        (Integrator::Accurate { tolerance: 1e-3 }, 1.0, 0.01),
    ] {
        let mut body = block_body([5, 4, 3], 0.1, &material(1000.0, 1e5, 0.0));
        body.set_material(&material(1000.0, 1e5, damping)).unwrap();
        let (_, mut state) = thrown(7);
        let mut solver = Solver::new(&body);
        let frame = Frame { integrator, volume, ..BARE };
        let all = |report: &Report| report.kinetic + report.elastic + report.volume_energy;
        let masses = body.masses();
        let start: f64 = state.velocities.iter().zip(&masses).map(|(v, m)| 0.5 * m * V3::from(*v).norm_squared()).sum();
        for number in 0..100 {
            let after = all(&solver.step(&body, &mut state, &frame));
            assert!(after <= start * (1.0 + 1e-6), "{integrator:?}: {start} became {after} in frame {number}");
        }
    }
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
            let frame = Frame { pins: &pins, ..Frame::default() };
            let mut solver = Solver::new(&body);
            let mut reports = Vec::new();
            for _ in 0..8 {
                reports.push(solver.step(&body, &mut state, &frame));
                if resume {
                    let text = format!("{state:?}");
                    state = state.clone();
                    assert_eq!(text, format!("{state:?}"));
                    solver = Solver::new(&body);
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
fn nothing_to_do_costs_nothing_and_changes_no_bit() {
    let body = block_body([2, 2, 2], 0.1, &material(1000.0, 1e5, 0.01));
    let mut state = State::at_rest(&body);
    let before = state.clone();
    let report = steps(&body, &mut state, &Frame { seconds: 0.0, ..Frame::default() }, 1);
    assert_eq!((state.positions, state.velocities), (before.positions, before.velocities));
    assert_eq!((report.newton, report.cg), (0, 0));
    let empty = Body::of_springs(&[], &[], &[]).unwrap();
    let _ = steps(&empty, &mut State::at_rest(&empty), &Frame::default(), 2);
}
