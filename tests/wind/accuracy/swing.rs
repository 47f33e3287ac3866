//! Jiggle against the exact solution of its equation.

use curves::jiggle::{Drag, Jiggle, Spring};
use numerics::ramp::Ramp;
use numerics::random::Key;
use std::f64::consts::PI;

use super::Figure;
use crate::cooked::{cook_in_order, graph};

type Square = [[f64; 4]; 4];

fn product(a: &Square, b: &Square) -> Square {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

/// e^M by scaling and squaring, applied to e^M − 1 so that a small M loses no precision.
fn exponential(m: Square) -> Square {
    let size = m.iter().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
    let halvings = (0..).find(|n| size / libm::exp2(f64::from(*n)) < 1e-3).unwrap();
    let small = m.map(|row| row.map(|x| x / libm::exp2(f64::from(halvings))));
    let (mut term, mut sum) = (small, small);
    for n in 2..8 {
        term = product(&term, &small).map(|row| row.map(|x| x / f64::from(n)));
        sum = std::array::from_fn(|i| std::array::from_fn(|j| sum[i][j] + term[i][j]));
    }
    for _ in 0..halvings {
        let square = product(&sum, &sum);
        sum = std::array::from_fn(|i| std::array::from_fn(|j| 2.0 * sum[i][j] + square[i][j]));
    }
    std::array::from_fn(|i| std::array::from_fn(|j| sum[i][j] + if i == j { 1.0 } else { 0.0 }))
}

fn applied(m: &Square, v: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|i| (0..4).map(|k| m[i][k] * v[k]).sum())
}

/// 1 if the damper resists motion relative to the target, otherwise 0.
fn share(drag: Drag) -> f64 {
    if drag == Drag::Target { 1.0 } else { 0.0 }
}

/// Position of the spring at each frame, for a target that moves linearly between `targets`; the state is (x, v/ω,
/// target, its speed/ω).
fn exact(phase: f64, zeta: f64, drag: Drag, targets: &[f32]) -> Vec<f64> {
    let row = [-1.0, -2.0 * zeta, 1.0, 2.0 * zeta * share(drag)];
    let step =
        exponential([[0.0, 1.0, 0.0, 0.0], row, [0.0, 0.0, 0.0, 1.0], [0.0; 4]].map(|row| row.map(|x| x * phase)));
    let mut state = [f64::from(targets[0]), 0.0];
    let mut found = vec![state[0]];
    for pair in targets.windows(2) {
        let [from, to] = [pair[0], pair[1]].map(f64::from);
        let [x, v, ..] = applied(&step, [state[0], state[1], from, (to - from) / phase]);
        state = [x, v];
        found.push(x);
    }
    found
}

/// So tall that restoring its length moves the tip along x by less than rounding.
const TALL: f32 = 1e5;

/// Positions of the tip of a tall segment with ω·`dt` = `phase` in each step.
fn swung(phase: f64, zeta: f64, drag: Drag, targets: &[f32]) -> Vec<f64> {
    let ramp = Ramp::constant(1.0);
    let spring = Spring { frequency: (phase / (2.0 * PI)).into(), damping: zeta.into(), softness: &ramp, drag };
    let at = |x: f32| [[0.0; 3], [x, TALL, 0.0]];
    let mut jiggle = Jiggle::at_rest(&[0, 2], &at(targets[0]), &at(targets[0]));
    let tip = |jiggle: &Jiggle| f64::from(jiggle.shape(1.0.into()).points[1][0]);
    let mut found = vec![tip(&jiggle)];
    for x in &targets[1..] {
        jiggle.step(&at(*x), &spring, 1.0, None);
        found.push(tip(&jiggle));
    }
    found
}

/// A pull that is released, a step, a ramp, a sine and noise, sampled once per frame.
fn signals() -> [Vec<f32>; 5] {
    let of = |signal: &dyn Fn(usize) -> f32| (0..60).map(signal).collect();
    [
        of(&|k| if k == 1 { 1.0 } else { 0.0 }),
        of(&|k| if k == 0 { 0.0 } else { 1.0 }),
        of(&|k| k as f32 / 60.0),
        of(&|k| libm::sin(0.4 * k as f64) as f32),
        of(&|k| Key::new(2).of(k as u64).between([-1.0, 1.0])),
    ]
}

fn worst_response() -> f64 {
    let mut worst = 0.0_f64;
    for zeta in [0.025, 1.0, 10.0] {
        for phase in [1e-6, 1e-4, 1e-2, 0.3, 1.0, 3.0, 100.0, 1e4, 1e6] {
            for drag in [Drag::Target, Drag::World] {
                for targets in signals() {
                    let pairs = swung(phase, zeta, drag, &targets).into_iter().zip(exact(phase, zeta, drag, &targets));
                    worst = pairs.map(|(a, b)| (a - b).abs()).fold(worst, f64::max);
                }
            }
        }
    }
    worst
}

/// Orders of convergence to the response to a true sine as the frame rate increases; the state is (x, v, s, c) with s'
/// = Ωc, c' = −Ωs, at ω = 1.
fn orders() -> Vec<f64> {
    let (forcing, end) = (2.0_f64, 12.0);
    let mut orders = Vec::new();
    for zeta in [0.025, 0.3, 1.0] {
        for drag in [Drag::Target, Drag::World] {
            let row = [-1.0, -2.0 * zeta, 1.0, 2.0 * zeta * share(drag) * forcing];
            let all = [[0.0, 1.0, 0.0, 0.0], row, [0.0, 0.0, 0.0, forcing], [0.0, 0.0, -forcing, 0.0]];
            let truth = applied(&exponential(all.map(|row| row.map(|x| x * end))), [0.0, 0.0, 0.0, 1.0])[0];
            let error = |steps: u32| {
                let dt = end / f64::from(steps);
                let targets: Vec<f32> = (0..=steps).map(|k| libm::sin(forcing * dt * f64::from(k)) as f32).collect();
                (swung(dt, zeta, drag, &targets)[steps as usize] - truth).abs()
            };
            let errors = [60, 120, 240].map(error);
            orders.extend(errors.windows(2).map(|pair| libm::log2(pair[0] / pair[1])));
        }
    }
    orders
}

/// Number of frames that have other bits when they are cooked alone or in another order, and of all that were tried.
fn other_bits() -> [usize; 2] {
    let nodes = r#"
        "fur": { "type": "Curve_In", "params": { "points": [[0, 0, 0], [0, 1, 0], [0, 2, 0], [0, 2, 1]] } },
        "wind": { "type": "Curve_Wind", "inputs": { "curves": "fur" },
                  "params": { "wind_dir": { "keyframes": [[1, [1, 0, 0]], [30, [0, 0.3, 1]], [60, [-1, 0, 0.2]]] } } },
        "swing": { "type": "Curve_Jiggle", "inputs": { "curves": "wind" }, "params": { "frequency": 1.3 } }"#;
    let graph = graph(nodes, &["swing"], 96);
    let all: Vec<i64> = (1..=96).collect();
    let expected = cook_in_order(&graph, &all, 1);
    let mut runs: Vec<Vec<i64>> = all.iter().step_by(5).map(|frame| vec![*frame]).collect();
    runs.push(all.iter().rev().copied().collect());
    let (mut others, mut tried) = (0, 0);
    for (run, threads) in runs.iter().zip([1, 2, 7].into_iter().cycle()) {
        for (frame, found) in run.iter().zip(cook_in_order(&graph, run, threads)) {
            tried += 1;
            others += usize::from(found != expected[*frame as usize - 1]);
        }
    }
    [others, tried]
}

pub(super) fn figures() -> Vec<Figure> {
    let [others, frames] = other_bits();
    vec![
        Figure::error(
            "Curve_Jiggle: error of the response to pull, step, ramp, sine and noise, ζ 0.025 to 10, ω·dt 1e-6 to 1e6",
            worst_response(),
            1e-5,
            "",
        ),
        Figure::within("order of convergence to the response to a true sine", &orders(), [1.8, 2.2]),
        Figure::never("frames with other bits if they are cooked alone or backwards", others, frames),
    ]
}
