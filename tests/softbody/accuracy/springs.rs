//! Single springs and chains of springs, of which all bodies are made, against closed forms.

use std::f64::consts::TAU;

use bodies::mass_spring::Integrator;

use super::*;

/// Initial stretch ÷ the spring's length.
const STRETCH: f64 = 0.1;

/// Two particles of `mass`, joined by a stretched spring of length 1.
fn pair(mass: f64, stiffness: f64, damping: f64) -> (SoftBody, State) {
    let spring = BodySpring { ends: [0, 1], stiffness, damping, length: 1.0 };
    let body = SoftBody::of_springs(&[[0.0; 3], [1.0, 0.0, 0.0]], &[mass, mass], &[spring]).unwrap();
    let mut state = State::at_rest(&body);
    state.positions[1][0] += STRETCH;
    (body, state)
}

fn stretch(state: &State) -> f64 {
    state.positions[1][0] - state.positions[0][0] - 1.0
}

/// The largest error over one period of `steps` steps, ÷ the initial stretch.
fn error(mass: f64, stiffness: f64, zeta: f64, steps: u32, integrator: Integrator) -> f64 {
    let reduced = 0.5 * mass;
    let omega = (stiffness / reduced).sqrt();
    let (body, mut state) = pair(mass, stiffness, 2.0 * zeta * omega * reduced);
    let frame = SolverFrame { seconds: TAU / omega / f64::from(steps), integrator, ..BARE };
    let mut solver = BodySolver::new(&body);
    largest((1..=steps).map(|step| {
        let _ = solver.step(&body, &mut state, &frame);
        let phase = TAU * f64::from(step) / f64::from(steps);
        let damped = (1.0 - zeta * zeta).sqrt();
        let exact = libm::exp(-zeta * phase) * (libm::cos(damped * phase) + zeta / damped * libm::sin(damped * phase));
        (stretch(&state) / STRETCH - exact).abs()
    }))
}

fn every_spring() -> f64 {
    let powers = |from: i32, to: i32| (from..=to).step_by(3).map(|n| libm::pow(10.0, f64::from(n)));
    let all = powers(-6, 6).flat_map(|mass| powers(-6, 12).map(move |stiffness| (mass, stiffness)));
    let each = all.flat_map(|(mass, stiffness)| {
        [0.0, 0.1, 0.5].map(|zeta| error(mass, stiffness, zeta, 200, Integrator::Default))
    });
    largest(each)
}

/// Order of convergence, from each halving of the step.
fn orders(integrator: Integrator) -> Vec<f64> {
    let errors = [200, 400, 800].map(|steps| error(1.0, 1.0, 0.1, steps, integrator));
    errors.windows(2).map(|pair| libm::log2(pair[0] / pair[1])).collect()
}

/// The largest relative rise of energy and stretch above their initial values, at steps of 1e-3 to 1e9 s for ω = √2.
fn beyond_start() -> f64 {
    let start = 0.5 * STRETCH * STRETCH;
    let one = |seconds: f64, integrator: Integrator| {
        let (body, mut state) = pair(1.0, 1.0, 0.0);
        let frame = SolverFrame { seconds, integrator, ..BARE };
        let mut solver = BodySolver::new(&body);
        largest((0..50).map(|_| {
            let report = solver.step(&body, &mut state, &frame);
            ((report.kinetic + report.elastic) / start).max(stretch(&state).abs() / STRETCH) - 1.0
        }))
    };
    let all = [1e-3, 0.1, 1.0, 10.0, 1e3, 1e6, 1e9].into_iter();
    largest(all.flat_map(|seconds| [Integrator::Default, Integrator::Euler].map(|how| one(seconds, how))))
}

/// The largest error over the slowest period of a chain of eight particles, held at one end, of alternately 1 kg and
/// `light`, ÷ the amplitude of the slowest mode, which alone is excited.
fn chain(light: f64) -> f64 {
    const COUNT: usize = 8;
    let masses: [f64; COUNT] = std::array::from_fn(|i| if i % 2 == 0 { light } else { 1.0 });
    // K·u = ω²·M·u by inverse iteration: springs of 1 N/m pass each force on to the held end.
    let solved = |force: [f64; COUNT]| {
        let mut u = [0.0; COUNT];
        let mut before = 0.0;
        for i in 0..COUNT {
            before += force[i..].iter().sum::<f64>();
            u[i] = before;
        }
        u
    };
    let (mut u, mut slowest) = ([1.0; COUNT], 0.0);
    for _ in 0..100 {
        let next = solved(std::array::from_fn(|i| masses[i] * u[i]));
        let size = next.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        slowest = 1.0 / size;
        u = next.map(|x| x / size);
    }
    let amplitude = 1e-3;
    let points: Vec<V> = (0..=COUNT).map(|i| [i as f64, 0.0, 0.0]).collect();
    let link = |i: u32| BodySpring { ends: [i, i + 1], stiffness: 1.0, damping: 0.0, length: 1.0 };
    let springs: Vec<BodySpring> = (0..COUNT as u32).map(link).collect();
    let body = SoftBody::of_springs(&points, &[&[1.0], &masses[..]].concat(), &springs).unwrap();
    let mut state = State::at_rest(&body);
    (0..COUNT).for_each(|i| state.positions[i + 1][0] += amplitude * u[i]);
    let pins = [bodies::mass_spring::Pin { particle: 0, between: [[0.0; 3]; 2] }];
    let frame = SolverFrame { seconds: TAU / slowest.sqrt() / 200.0, pins: &pins, ..BARE };
    let mut solver = BodySolver::new(&body);
    largest((1..=200).map(|step| {
        let _ = solver.step(&body, &mut state, &frame);
        let swing = amplitude * libm::cos(TAU * f64::from(step) / 200.0);
        largest((0..COUNT).map(|i| (state.positions[i + 1][0] - points[i + 1][0] - swing * u[i]).abs())) / amplitude
    }))
}

pub(super) fn figures() -> Vec<Figure> {
    vec![
        Figure::error(
            "One spring over a period of 200 steps: error, k 1e-6 to 1e12 N/m, m 1e-6 to 1e6 kg",
            every_spring(),
            2e-4,
            "",
        ),
        Figure::within("its order of convergence", &orders(Integrator::Default), [1.9, 2.1]),
        Figure::within("its order with `euler`", &orders(Integrator::Euler), [0.9, 1.1]),
        Figure::error(
            "growth of energy and stretch beyond their initial values, steps of 1e-3 to 1e9 s",
            beyond_start(),
            1e-6,
            "",
        ),
        Figure::error(
            "a chain with a mass ratio of 1e9: error over one period of its slowest mode",
            chain(1e-9),
            1e-3,
            "",
        ),
    ]
}
