//! Closed forms: one spring, free fall, a hanging chain, a bar that is pulled, the order of the method.

use super::*;
use std::f64::consts::TAU;

/// Two particles of `mass`, joined by a spring of length 1 that is stretched by `stretch`.
fn pair(mass: f64, stiffness: f64, damping: f64, stretch: f64) -> (Body, State) {
    let spring = Spring { ends: [0, 1], stiffness, damping, length: 1.0 };
    let body = Body::of_springs(&[[0.0; 3], [1.0, 0.0, 0.0]], &[mass, mass], &[spring]).unwrap();
    let mut state = State::at_rest(&body);
    state.positions[1][0] += stretch;
    (body, state)
}

fn stretch(state: &State) -> f64 {
    state.positions[1][0] - state.positions[0][0] - 1.0
}

/// The largest error over one period of `steps` steps, ÷ the first stretch.
fn error_over_a_period(mass: f64, stiffness: f64, zeta: f64, steps: u32, integrator: Integrator) -> f64 {
    let reduced = 0.5 * mass;
    let omega = (stiffness / reduced).sqrt();
    let (body, mut state) = pair(mass, stiffness, 2.0 * zeta * omega * reduced, 0.1);
    let frame = Frame { seconds: TAU / omega / f64::from(steps), integrator, ..BARE };
    let mut solver = Solver::new(&body);
    let mut worst = 0.0_f64;
    for step in 1..=steps {
        let _ = solver.step(&body, &mut state, &frame);
        let phase = TAU * f64::from(step) / f64::from(steps);
        let damped = (1.0 - zeta * zeta).sqrt();
        let exact = libm::exp(-zeta * phase) * (libm::cos(damped * phase) + zeta / damped * libm::sin(damped * phase));
        worst = worst.max((stretch(&state) / 0.1 - exact).abs());
    }
    worst
}

#[test]
fn a_spring_swings_as_the_closed_form_does() {
    for (mass, stiffness) in [(1.0, 1.0), (1e-6, 1e12), (1e6, 1e-6), (1e-6, 1e-6), (1e6, 1e12)] {
        for zeta in [0.0, 0.1, 0.5] {
            let error = error_over_a_period(mass, stiffness, zeta, 200, Integrator::Default);
            assert!(error < 2e-4, "m {mass}, k {stiffness}, damping {zeta}: {error}");
        }
    }
}

#[test]
fn tr_bdf2_is_of_order_two_and_implicit_euler_of_order_one() {
    for (integrator, order) in [(Integrator::Default, 2.0), (Integrator::Euler, 1.0)] {
        let errors = [200, 400, 800].map(|steps| error_over_a_period(1.0, 1.0, 0.1, steps, integrator));
        for pair in errors.windows(2) {
            let slope = libm::log2(pair[0] / pair[1]);
            assert!((slope - order).abs() < 0.1, "{integrator:?}: {errors:?} fall with {slope}");
        }
    }
}

#[test]
fn a_spring_is_bounded_by_its_start_at_every_step() {
    for seconds in [1e-3, 1.0, 1e3, 1e9] {
        for integrator in [Integrator::Default, Integrator::Euler] {
            let (body, mut state) = pair(1.0, 1.0, 0.0, 0.1);
            let frame = Frame { seconds, integrator, ..BARE };
            let mut solver = Solver::new(&body);
            for _ in 0..50 {
                let report = solver.step(&body, &mut state, &frame);
                assert!(report.kinetic + report.elastic <= 0.5 * 0.01 * (1.0 + 1e-6));
                assert!(stretch(&state).abs() <= 0.1 * (1.0 + 1e-6));
            }
        }
    }
}

#[test]
fn what_falls_freely_keeps_its_shape_and_follows_the_parabola() {
    for integrator in [Integrator::Default, Integrator::Accurate { tolerance: 1e-4 }] {
        let body = block_body([6, 5, 4], 0.1, &material(1000.0, 1e6, 0.01));
        let start = State::at_rest(&body);
        let mut state = start.clone();
        let frame = Frame { gravity: [0.0, -9.81, 2.0], volume: 1.0, integrator, ..BARE };
        let _ = steps(&body, &mut state, &frame, 24);
        for (after, before) in state.positions.iter().zip(&start.positions) {
            let fallen: V3 = V3::from(*after) - V3::from(*before);
            assert!((fallen - V3::new(0.0, -0.5 * 9.81, 1.0)).norm() < 1e-9, "{fallen}");
        }
    }
}

#[test]
fn implicit_euler_falls_by_its_own_sum() {
    let body = block_body([2, 2, 2], 0.1, &material(1000.0, 1e6, 0.01));
    let mut state = State::at_rest(&body);
    let frame = Frame { gravity: [0.0, -9.81, 0.0], integrator: Integrator::Euler, ..BARE };
    let _ = steps(&body, &mut state, &frame, 24);
    // Σ i·g·h² over 24 steps of 1/24.
    assert!((state.positions[0][1] + 9.81 * 300.0 / 576.0).abs() < 1e-9);
}

#[test]
fn a_hanging_chain_stretches_by_the_weight_below() {
    let count = 6;
    let points: Vec<[f64; 3]> = (0..count).map(|i| [0.0, -f64::from(i), 0.0]).collect();
    let springs: Vec<Spring> =
        (1..count).map(|i| Spring { ends: [i - 1, i], stiffness: 500.0, damping: 50.0, length: 1.0 }).collect();
    let body = Body::of_springs(&points, &[2.0; 6], &springs).unwrap();
    let mut state = State::at_rest(&body);
    let pins = [Pin { particle: 0, between: [[0.0; 3]; 2] }];
    let _ = steps(&body, &mut state, &Frame { pins: &pins, volume: 0.0, ..Frame::default() }, 1000);
    for i in 1..count as usize {
        let length = state.positions[i - 1][1] - state.positions[i][1];
        let weight = 2.0 * 9.81 * f64::from(count - i as u32);
        assert!((length - 1.0 - weight / 500.0).abs() < 1e-9, "spring {i} is {length} long");
    }
}

#[test]
fn a_pulled_bar_has_the_stiffness_asked_for_at_any_resolution() {
    let mut moduli = Vec::new();
    for cells in [2_u32, 4, 6] {
        let body = block_body([5 * cells, cells, cells], 1.0 / f64::from(cells), &material(100.0, 1e5, 0.05));
        let mut state = State::at_rest(&body);
        let at =
            |x: f64| -> Vec<usize> { (0..body.len()).filter(|i| (body.rest_point(*i)[0] - x).abs() < 1e-9).collect() };
        let mut pins = Vec::new();
        for (x, to) in [(0.0, 0.0), (5.0, 5.05)] {
            pins.extend(at(x).iter().map(|particle| {
                let [_, y, z] = body.rest_point(*particle);
                Pin { particle: *particle as u32, between: [[to, y, z]; 2] }
            }));
        }
        let report = steps(&body, &mut state, &Frame { pins: &pins, ..BARE }, 300);
        let mean = |x: f64| at(x).iter().map(|i| state.positions[*i][0]).sum::<f64>() / at(x).len() as f64;
        // Away from the clamped ends; F = 2U ÷ Δ on 1 m².
        let strain = mean(3.0) - mean(2.0) - 1.0;
        moduli.push(2.0 * report.elastic / 0.05 / strain / 1e5);
    }
    assert!(moduli.iter().all(|e| (0.88..1.12).contains(e)), "{moduli:?}");
    assert!((moduli[1] / moduli[2] - 1.0).abs() < 0.03, "{moduli:?}");
}

#[test]
fn a_cantilever_settles_where_its_springs_balance() {
    let body = block_body([8, 2, 2], 0.125, &material(1000.0, 1e6, 0.02));
    let start = State::at_rest(&body);
    let pins: Vec<Pin> = (0..body.len())
        .filter(|i| start.positions[*i][0] == 0.0)
        .map(|i| Pin { particle: i as u32, between: [start.positions[i]; 2] })
        .collect();
    let frame = Frame { pins: &pins, volume: 0.0, ..Frame::default() };
    let mut state = start.clone();
    let _ = steps(&body, &mut state, &frame, 400);
    // Static equilibrium of the same springs: what is left of each particle's weight.
    let mut left: Vec<V3> = body.masses().iter().map(|mass| V3::new(0.0, -9.81 * mass, 0.0)).collect();
    for (spring, [a, b]) in body.springs().into_iter().enumerate() {
        let d = V3::from(state.positions[a as usize]) - V3::from(state.positions[b as usize]);
        let pull = d.normalize() * (body.stiffnesses()[spring] * (d.norm() - body.lengths()[spring]));
        left[a as usize] -= pull;
        left[b as usize] += pull;
    }
    for (place, left) in left.iter().enumerate().filter(|(place, _)| start.positions[*place][0] > 0.0) {
        // The softest direction of a particle among its neighbours has some k = E·cell.
        assert!(left.norm() / (1e6 * 0.125) < 1e-6, "{place} feels {left}");
    }
    let sag = start.positions[8][1] - state.positions[8][1];
    assert!(sag > 0.05, "it sags by {sag}");
}
