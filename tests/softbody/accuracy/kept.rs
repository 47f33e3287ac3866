//! Conservation of momentum and energy, and free fall, measured on the solver, since the node outputs no velocities.

use std::f64::consts::TAU;

use bodies::mass_spring::Integrator;
use numerics::random::Key;

use super::*;

fn momentum(body: &SoftBody, state: &State) -> V {
    let each = state.velocities.iter().zip(body.masses());
    each.fold([0.0; 3], |sum, (v, mass)| plus_multiple(sum, *v, mass))
}

fn angular(body: &SoftBody, state: &State) -> V {
    let each = state.positions.iter().zip(&state.velocities).zip(body.masses());
    each.fold([0.0; 3], |sum, ((x, v), mass)| plus_multiple(sum, DVec3::from(*x).cross(&DVec3::from(*v)).into(), mass))
}

/// A block that rotates, stretches and moves.
fn thrown(damping: f64) -> (SoftBody, State) {
    let body = block([5, 4, 3], 0.1, 1e5, damping);
    let mut state = State::at_rest(&body);
    for (index, v) in state.velocities.iter_mut().enumerate() {
        let key = Key::new(1).of(index as u64);
        let own: V = std::array::from_fn(|k| 0.2 * (key.of(k as u64).f64() - 0.5));
        let arm = plus_multiple(state.positions[index], [0.25, 0.2, 0.15], -1.0);
        *v = plus_multiple(
            plus_multiple([0.3, -0.2, 0.5], DVec3::new(0.2, 3.0, -1.0).cross(&DVec3::from(arm)).into(), 1.0),
            own,
            1.0,
        );
    }
    (body, state)
}

/// The relative change of its momentum in 200 steps.
fn lost_momentum(integrator: Integrator, volume: f64) -> f64 {
    let (body, mut state) = thrown(0.0);
    let before = momentum(&body, &state);
    steps(&body, &mut state, &SolverFrame { integrator, volume, ..BARE }, 200);
    distance(&momentum(&body, &state), &before) / DVec3::from(before).norm()
}

/// The same for two coupled blocks that pull at each other.
fn lost_by_a_pair() -> f64 {
    let one = shapes::block([2; 3], 0.1, [0.0; 3]);
    let mut points: Vec<V> = one.positions().iter().map(|p| p.map(f64::from)).collect();
    let mut tets = one.tet_corners().to_vec();
    let lower = points.len() as u32;
    points.extend(points.clone().iter().map(|[x, y, z]| [*x, y + 0.25, *z]));
    tets.extend(one.tet_corners().iter().map(|tet| tet.map(|corner| corner + lower)));
    let joint = |i: u32| BodySpring { ends: [i + 6, lower + i], stiffness: 500.0, damping: 1.0, length: 0.05 };
    let joints: Vec<BodySpring> = [0, 1, 2, 9, 10, 11, 18, 19, 20].map(joint).into();
    let body = made(&points, &tets, 1e5, 0.01, &joints);
    let mut state = State::at_rest(&body);
    state.velocities[lower as usize..].fill([0.2, 0.3, -0.1]);
    let before = momentum(&body, &state);
    steps(&body, &mut state, &SolverFrame { volume: 1.0, ..BARE }, 100);
    distance(&momentum(&body, &state), &before) / DVec3::from(before).norm()
}

/// Relative loss of angular momentum of a block that rotates about z, over a number of steps with a number of steps per
/// turn; and how many of them were implicit Euler, which loses two thirds.
fn lost_turning(modulus: f64, steps_a_turn: f64, count: usize) -> (f64, u32) {
    let body = block([4, 3, 3], 0.1, modulus, 0.0);
    let mut state = State::at_rest(&body);
    for (x, v) in state.positions.iter_mut().zip(&mut state.velocities) {
        *x = plus_multiple(*x, [0.2, 0.15, 0.15], -1.0);
        *v = DVec3::z().cross(&DVec3::from(*x)).into();
    }
    let before = angular(&body, &state);
    let reports = steps(&body, &mut state, &SolverFrame { seconds: TAU / steps_a_turn, ..BARE }, count);
    let lost = distance(&angular(&body, &state), &before) / DVec3::from(before).norm();
    (lost, reports.iter().map(|report| report.euler_steps).sum())
}

/// The largest relative rise of energy above its initial value in 100 steps.
fn gained(integrator: Integrator, volume: f64, damping: f64) -> f64 {
    let (body, mut state) = thrown(damping);
    let each = state.velocities.iter().zip(body.masses());
    let start: f64 = each
        .map(|(v, mass)| {
            let speed = DVec3::from(*v).norm();
            0.5 * mass * speed * speed
        })
        .sum();
    let reports = steps(&body, &mut state, &SolverFrame { integrator, volume, ..BARE }, 100);
    largest(reports.iter().map(|report| (report.kinetic + report.elastic + report.volume_energy) / start - 1.0))
}

/// The largest error of a particle's displacement in a second of free fall, metres; `fallen` × gravity is exact.
fn fall(integrator: Integrator, fallen: f64) -> f64 {
    let body = block([6, 5, 4], 0.1, 1e6, 0.01);
    let start = State::at_rest(&body);
    let mut state = start.clone();
    let gravity = [0.0, -9.81, 2.0];
    steps(&body, &mut state, &SolverFrame { gravity, volume: 1.0, integrator, ..BARE }, 24);
    let each = state.positions.iter().zip(&start.positions);
    largest(each.map(|(after, before)| distance(after, &plus_multiple(*before, gravity, fallen))))
}

pub(super) fn figures(effort: Effort) -> Vec<Figure> {
    let accurate = Integrator::Accurate { tolerance: 1e-3 };
    let cases = [(Integrator::Default, 0.0), (Integrator::Default, 1.0), (Integrator::Euler, 1.0), (accurate, 1.0)];
    let moduli = effort.choose(&[1e5][..], &[1e5, 1e6, 1e8]);
    let turns: Vec<(f64, u32)> = moduli.iter().map(|modulus| lost_turning(*modulus, 100.0, 1000)).collect();
    let finer = lost_turning(1e5, 200.0, 2000);
    let gains = [
        gained(Integrator::Default, 0.0, 0.0),
        gained(Integrator::Default, 1.0, 0.01),
        gained(Integrator::Euler, 1.0, 0.0),
        gained(accurate, 1.0, 0.01),
    ];
    // Σ i·h² over 24 steps of 1/24.
    let euler = fall(Integrator::Euler, 300.0 / 576.0);
    vec![
        Figure::error(
            "A free body: momentum lost in 200 steps",
            largest(cases.map(|(integrator, volume)| lost_momentum(integrator, volume))),
            1e-10,
            "",
        ),
        Figure::error("the same for two coupled bodies", lost_by_a_pair(), 1e-9, ""),
        Figure::error(
            "angular momentum lost in 1,000 steps, 100 per turn, E 1e5 to 1e8 Pa",
            largest(turns.iter().map(|turn| turn.0)),
            2e-3,
            "",
        )
        .has_coarse_form(effort),
        Figure::within("order at which that loss falls with the step", &[libm::log2(turns[0].0 / finer.0)], [1.8, 3.2]),
        Figure::never(
            "number of those steps that fell back to `euler`",
            turns.iter().map(|turn| turn.1 as usize).sum(),
            1000 * turns.len(),
        )
        .has_coarse_form(effort),
        Figure::error("growth of energy without external driving, with and without damping", largest(gains), 1e-6, ""),
        Figure::error(
            "free fall over a second: distance from the parabola",
            largest([fall(Integrator::Default, 0.5), fall(accurate, 0.5)]),
            1e-9,
            " m",
        ),
        Figure::error("the same with `euler`: distance from its exact sum", euler, 1e-9, " m"),
    ]
}
