//! Goals, resets of the rest shape, plastic flow and tearing.

use super::*;

/// Whether a particle of the 3 × 3 × 3 block of 0.1 m cells is an interior one.
fn is_inside(x: &[f64; 3]) -> bool {
    x.iter().all(|x| (0.05..0.25).contains(x))
}

/// Half as high, and wider to keep the volume.
fn flat(x: [f64; 3]) -> [f64; 3] {
    let wider = std::f64::consts::SQRT_2;
    [x[0] * wider, x[1] * 0.5, x[2] * wider]
}

#[test]
fn a_goal_pulls_like_a_damped_spring() {
    let body = SoftBody::of_springs(&[[0.0; 3]], &[3.0], &[]).unwrap();
    let mut state = State::at_rest(&body);
    let goal = GoalSpring { particle: 0, between: [[1.0, 0.0, 0.0]; 2], strength: 4.0, damping: 4.0 };
    let goals = [goal];
    let frame = SolverFrame { seconds: 0.01, goals: &goals, ..BARE };
    let report = steps(&body, &mut state, &frame, 100);
    // Critically damped with ω = 2: 1 − (1 + 2t)e^(−2t).
    let exact = 1.0 - 3.0 * libm::exp(-2.0);
    assert!((state.positions[0][0] - exact).abs() < 1e-5);
    assert!((report.goal_energy - 0.5 * 3.0 * 4.0 * (1.0 - exact) * (1.0 - exact)).abs() < 1e-4);
    // Two goals of one particle act like one of their total strength.
    let half = GoalSpring { strength: 2.0, damping: 2.0, ..goal };
    let mut again = State::at_rest(&body);
    let _ = steps(&body, &mut again, &SolverFrame { seconds: 0.01, goals: &[half, half], ..BARE }, 100);
    assert!((again.positions[0][0] - state.positions[0][0]).abs() < 1e-12);
}

#[test]
fn a_body_stays_in_a_goal_that_became_its_rest_shape() {
    let body = block_body([3, 3, 3], 0.1, &material(1000.0, 1e4, 0.2));
    let mut state = State::at_rest(&body);
    let shape: Vec<[f64; 3]> = state.positions.iter().map(|x| flat(*x)).collect();
    let goals: Vec<GoalSpring> = (0..body.len())
        .filter(|i| is_inside(&state.positions[*i]))
        .map(|i| GoalSpring { particle: i as u32, between: [shape[i]; 2], strength: 1e4, damping: 100.0 })
        .collect();
    assert_eq!(goals.len(), 8);
    let drawn = SolverFrame { goals: &goals, ..SolverFrame { volume: 1.0, ..BARE } };
    let mut solver = BodySolver::new(&body);
    for number in 0..240 {
        if (24..28).contains(&number) {
            // A quarter, a third, a half, then all of the remaining change.
            let _ = reset(&body, &mut state, &shape, 1.0 / f64::from(28 - number), 1.0);
        }
        let force_implicit_euler = (24..28).contains(&number);
        let _ = solver.step(&body, &mut state, &SolverFrame { force_implicit_euler, ..drawn });
    }
    let report = steps(&body, &mut state, &SolverFrame { goals: &[], ..drawn }, 96);
    for (x, goal) in state.positions.iter().zip(&shape) {
        assert!((DVec3::from(*x) - DVec3::from(*goal)).norm() < 1e-4, "{x:?} for {goal:?}");
    }
    assert!(report.elastic < 1e-6 && (report.volume_ratio - 1.0).abs() < 1e-6, "{report:?}");
}

#[test]
fn a_reset_keeps_dents_and_returns_the_energy_it_adds() {
    let body = block_body([2, 2, 2], 0.1, &material(1000.0, 1e4, 0.02));
    let mut state = State::at_rest(&body);
    state.dents.iter_mut().for_each(|dent| *dent = 0.9);
    let shape: Vec<[f64; 3]> = state.positions.iter().map(|x| x.map(|x| 2.0 * x)).collect();
    let energy = |state: &State| {
        let length = |[a, b]: [u32; 2]| {
            (DVec3::from(state.positions[a as usize]) - DVec3::from(state.positions[b as usize])).norm()
        };
        let each = body.springs().into_iter().enumerate();
        each.map(|(i, ends)| {
            let strain = length(ends) - state.lengths[i] * state.dents[i];
            0.5 * body.stiffness[i] * strain * strain
        })
        .sum::<f64>()
    };
    let before = energy(&state);
    let brought = reset(&body, &mut state, &shape, 0.5, 1.0);
    assert!((brought - (energy(&state) - before)).abs() < 1e-9 * brought.abs());
    for (length, rest) in state.lengths.iter().zip(&body.lengths) {
        assert!((length / rest - 1.5).abs() < 1e-12);
    }
    assert!(state.dents.iter().all(|dent| *dent == 0.9));
    let _ = reset(&body, &mut state, &shape, 1.0, 0.0);
    assert!(state.dents.iter().all(|dent| *dent == 1.0));
    assert!((state.lengths[0] / body.lengths[0] - 2.0).abs() < 1e-12);
    let nowhere = vec![[f64::NAN; 3]; body.len()];
    let kept = state.clone();
    assert_eq!(reset(&body, &mut state, &nowhere, 1.0, 0.0), 0.0);
    assert_eq!(state, kept, "particles without a goal stay");
}

#[test]
fn springs_flow_only_above_the_yield_strain() {
    let spring = BodySpring { ends: [0, 1], stiffness: 100.0, damping: 0.0, length: 1.0 };
    let body = SoftBody::of_springs(&[[0.0; 3], [1.0, 0.0, 0.0]], &[1.0; 2], &[spring]).unwrap();
    let plasticity = Plasticity { yield_strain: 0.1, creep: 2.0 };
    let at = |stretch: f64| {
        let mut state = State::at_rest(&body);
        state.positions[1][0] = 1.0 + stretch;
        let freed = flow(&body, &mut state, plasticity, 0.5, None);
        (state.dents[0], freed)
    };
    assert_eq!(at(0.09), (1.0, 0.0));
    assert_eq!(at(-0.1 + 1e-12).0, 1.0);
    // 1 − e^(−1) of the 0.2 above the yield strain of 0.1.
    let share = 1.0 - libm::exp(-1.0);
    let (dent, freed) = at(0.3);
    assert!((dent - (1.0 + 0.2 * share)).abs() < 1e-12);
    assert!((freed - 50.0 * (0.09 - (1.3 - dent) * (1.3 - dent))).abs() < 1e-9);
    assert!((at(-0.3).0 - (1.0 - 0.2 * share)).abs() < 1e-12);
    assert!(at(1e9).0 <= 10.0 && at(-1.0).0 >= 0.1);
    let mut state = State::at_rest(&body);
    state.positions[1][0] = 5.0;
    assert_eq!(flow(&body, &mut state, Plasticity { yield_strain: 0.0, creep: 2.0 }, 1.0, None), 0.0);
}

#[test]
fn the_energy_returned_by_flow_is_missing_from_the_next_report() {
    let body = block_body([2, 2, 2], 0.1, &material(1000.0, 1e4, 0.02));
    let mut state = State::at_rest(&body);
    state.positions.iter_mut().for_each(|x| x[1] *= 0.7);
    let still = SolverFrame { seconds: 0.0, ..BARE };
    let before = steps(&body, &mut state, &still, 1).elastic;
    let work = flow(&body, &mut state, Plasticity { yield_strain: 0.05, creep: 10.0 }, 1.0 / 24.0, None);
    let after = steps(&body, &mut state, &still, 1).elastic;
    assert!(work > 0.1 * before, "{work} of {before}");
    assert!((before - work - after).abs() < 1e-12 * before, "{before} − {work} is not {after}");
}

#[test]
fn deformation_towards_a_goal_is_not_plastic() {
    let body = block_body([1, 1, 1], 1.0, &material(1000.0, 1e4, 0.02));
    let plasticity = Plasticity { yield_strain: 0.1, creep: 2.0 };
    let rest = State::at_rest(&body).positions;
    let scaled = |by: f64| rest.iter().map(|x| x.map(|x| x * by)).collect::<Vec<_>>();
    let goal = scaled(2.0);
    let dents = |by: f64, drawn: &[[f64; 3]]| {
        let mut state = State::at_rest(&body);
        state.positions = scaled(by);
        let _ = flow(&body, &mut state, plasticity, 0.5, Some(drawn));
        state.dents
    };
    let share = 1.0 - libm::exp(-1.0);
    let (past, short) = (1.0 + share * (1.4 - 0.1), 1.0 + share * (0.1 - 0.3));
    // Beyond the goal, and short of the rest shape: strain is relative to the nearer of both.
    for (by, dent) in [(1.0, 1.0), (1.5, 1.0), (2.0, 1.0), (2.19, 1.0), (4.8, past), (0.91, 1.0), (0.7, short)] {
        assert!(dents(by, &goal).iter().all(|own| (own - dent).abs() < 1e-9), "{by}: {dent}");
    }
    let nowhere = vec![[f64::NAN; 3]; rest.len()];
    assert!(dents(1.5, &nowhere).iter().all(|own| (own - (1.0 + share * 0.4)).abs() < 1e-9));
}

#[test]
fn a_torn_joint_neither_pulls_nor_counts() {
    let spring = |a: u32| BodySpring { ends: [a, a + 1], stiffness: 100.0, damping: 1.0, length: 1.0 };
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    let body = SoftBody::of_springs(&points, &[1.0; 3], &[spring(0), spring(1)]).unwrap();
    let mut state = State::at_rest(&body);
    state.positions[2][0] = 3.5;
    assert_eq!(tear(&body, &mut state, 3.0, 0.0), 0);
    assert_eq!(tear(&body, &mut state, 2.0, 0.0), 1);
    assert_eq!(tear(&body, &mut state, 2.0, 0.0), 0);
    let report = steps(&body, &mut state, &BARE, 10);
    assert_eq!((report.elastic, report.kinetic, report.worst_stretch), (0.0, 0.0, 1.0));
    assert_eq!(state.positions[2], [3.5, 0.0, 0.0]);
}

#[test]
fn distant_alternating_goals_stay_bounded() {
    for integrator in [Integrator::Default, Integrator::Euler] {
        let body = block_body([3, 3, 3], 0.1, &material(1000.0, 1e4, 0.02));
        let mut state = State::at_rest(&body);
        let rest = state.positions.clone();
        let mut solver = BodySolver::new(&body);
        for number in 0..24 {
            let away = if number % 2 == 0 { 1e3 } else { -1e3 };
            let goals: Vec<GoalSpring> = (0..body.len())
                .filter(|i| is_inside(&rest[*i]))
                .map(|i| {
                    let to = [rest[i][0] + away, rest[i][1], rest[i][2]];
                    GoalSpring { particle: i as u32, between: [to; 2], strength: 1e4, damping: 0.0 }
                })
                .collect();
            let _ =
                solver.step(&body, &mut state, &SolverFrame { goals: &goals, integrator, ..SolverFrame::default() });
            let far = state.positions.iter().flatten().fold(0.0_f64, |far, x| far.max(x.abs()));
            assert!(is_finite(&state) && far < 1e5, "{integrator:?}, frame {number}: {far}");
        }
    }
}
