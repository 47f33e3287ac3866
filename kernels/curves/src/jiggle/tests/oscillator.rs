//! One spring against the exact solution of its equation.

use super::*;

/// e^M by scaling and squaring for a 4 × 4 matrix M: a reference that shares no formula with the kernel.
fn exponential(m: [[f64; 4]; 4]) -> [[f64; 4]; 4] {
    let size = m.iter().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
    let mut halvings = 0;
    let mut scale = 1.0;
    while size * scale > 1e-3 {
        halvings += 1;
        scale *= 0.5;
    }
    let product = |a: &[[f64; 4]; 4], b: &[[f64; 4]; 4]| -> [[f64; 4]; 4] {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
    };
    let small = m.map(|row| row.map(|x| x * scale));
    // e^M − 1, so that squaring loses nothing of a small M: (1 + X)² − 1 = 2X + X².
    let mut term = small;
    let mut sum = small;
    for n in 2..8 {
        term = product(&term, &small).map(|row| row.map(|x| x / f64::from(n)));
        sum = std::array::from_fn(|i| std::array::from_fn(|j| sum[i][j] + term[i][j]));
    }
    for _ in 0..halvings {
        let square = product(&sum, &sum);
        sum = std::array::from_fn(|i| std::array::from_fn(|j| 2.0 * sum[i][j] + square[i][j]));
    }
    for k in 0..4 {
        sum[k][k] += 1.0;
    }
    sum
}

/// Position of a spring after each of the steps between `targets`, by the matrix exponential on (x, v/ω, target, its
/// speed/ω).
fn exact(phase: f64, zeta: f64, drag: Drag, targets: &[f32]) -> Vec<f64> {
    let d = if drag == Drag::Target { 1.0 } else { 0.0 };
    let row = [-1.0, -2.0 * zeta, 1.0, 2.0 * zeta * d];
    let step =
        exponential([[0.0, 1.0, 0.0, 0.0], row, [0.0, 0.0, 0.0, 1.0], [0.0; 4]].map(|row| row.map(|x| x * phase)));
    let mut state = [f64::from(targets[0]), 0.0];
    let mut found = vec![state[0]];
    for pair in targets.windows(2) {
        let [from, to] = [pair[0], pair[1]].map(f64::from);
        let all = [state[0], state[1], from, (to - from) / phase];
        state = std::array::from_fn(|i| (0..4).map(|k| step[i][k] * all[k]).sum());
        found.push(state[0]);
    }
    found
}

fn run(phase: f64, zeta: f64, drag: Drag, targets: &[f32]) -> Vec<f64> {
    let ramp = soft();
    let mut jiggle = Jiggle::at_rest(&ONE, &at(targets[0]), &at(targets[0]));
    let mut found = vec![free(&jiggle)];
    for x in &targets[1..] {
        jiggle.step(&at(*x), &spring(phase, zeta, &ramp, drag), 1.0, None);
        found.push(free(&jiggle));
    }
    found
}

/// Step, ramp, sine and noise, sampled once a frame.
fn signals(frames: usize) -> [Vec<f32>; 4] {
    let of = |signal: &dyn Fn(usize) -> f32| (0..frames).map(signal).collect();
    [
        of(&|k| if k == 0 { 0.0 } else { 1.0 }),
        of(&|k| k as f32 / frames as f32),
        of(&|k| numerics::trig::sin_cos(0.4 * k as f32).0),
        of(&|k| Key::new(2).of(k as u64).between([-1.0, 1.0])),
    ]
}

#[test]
fn any_step_and_damping_gives_the_exact_response_to_the_piecewise_linear_target() {
    for zeta in [1e-3, 0.025, 0.3, 0.999_999, 1.0, 1.000_001, 3.0, 10.0] {
        for phase in [1e-6, 1e-4, 1e-2, 0.3, 1.0, 3.0, 7.0, 100.0, 1e4, 1e6] {
            for drag in [Drag::Target, Drag::World] {
                for targets in signals(100) {
                    let (found, exact) = (run(phase, zeta, drag, &targets), exact(phase, zeta, drag, &targets));
                    // Squaring a stiff exponential costs the reference digits.
                    let tolerance = 1e-9 + 4e-16 * phase * (1.0 + zeta);
                    assert!(tolerance < 1e-6);
                    for (frame, (found, exact)) in found.iter().zip(&exact).enumerate() {
                        let error = (found - exact).abs();
                        assert!(error < tolerance, "{zeta} {phase} {drag:?} frame {frame}: {found} for {exact}");
                    }
                }
            }
        }
    }
}

#[test]
fn free_decay_by_hand() {
    // The target moves from 1 to 0 within a step so short that the spring does not respond; then x = e^(−ζωt)(cos σωt +
    // ζ/σ·sin σωt) for ζ < 1, (1 + ωt)·e^(−ωt) for ζ = 1. The first step is the limit of a step of zero length.
    let (phase, frames) = (0.37, 60);
    for zeta in [0.025, 0.6, 1.0] {
        let ramp = soft();
        let mut jiggle = Jiggle::at_rest(&ONE, &at(1.0), &at(1.0));
        jiggle.step(&at(0.0), &spring(1e-12, zeta, &ramp, Drag::World), 1.0, None);
        // Velocities are in metres per step, and that step was short.
        jiggle.batches[0].states[1].velocity = [F64x16::ZERO; 3];
        for frame in 1..=frames {
            jiggle.step(&at(0.0), &spring(phase, zeta, &ramp, Drag::Target), 1.0, None);
            let t = phase * f64::from(frame);
            let sigma = (1.0 - zeta * zeta).sqrt();
            let exact = match zeta < 1.0 {
                true => libm::exp(-zeta * t) * (libm::cos(sigma * t) + zeta / sigma * libm::sin(sigma * t)),
                false => (1.0 + t) * libm::exp(-t),
            };
            assert!((free(&jiggle) - exact).abs() < 1e-11, "{zeta} frame {frame}: {} for {exact}", free(&jiggle));
        }
    }
}

#[test]
fn the_lag_behind_a_steady_ramp_is_zero_or_two_zeta_over_omega() {
    // x'' = 0, x' = target' in ξ = −2ζ(1 − d)·V/ω.
    let targets: Vec<f32> = (0..400).map(|k| k as f32 * 0.125).collect();
    for (drag, lag) in [(Drag::Target, 0.0), (Drag::World, 2.0 * 0.5 / 0.8 * 0.125)] {
        let last = run(0.8, 0.5, drag, &targets)[399];
        assert!((f64::from(targets[399]) - last - lag).abs() < 1e-9, "{drag:?}");
    }
}

#[test]
fn the_error_for_a_sine_falls_with_the_square_of_the_step() {
    // Of x'' = −2ζ(x' − d·cos) − (x − sin) at ω = 1 and target sin(2t): steady part by complex division.
    let (zeta, forcing, end) = (0.3, 2.0_f64, 12.0);
    let error = |steps: u32| {
        let dt = end / f64::from(steps);
        let ramp = soft();
        let (mut jiggle, mut time) = (Jiggle::at_rest(&ONE, &at(0.0), &at(0.0)), 0.0);
        let mut fine = Vec::new();
        for k in 1..=steps {
            time = dt * f64::from(k);
            jiggle.step(&at(libm::sin(forcing * time) as f32), &spring(1.0, zeta, &ramp, Drag::Target), dt, None);
            fine.push(free(&jiggle));
        }
        // The homogeneous part, from rest at x = 0, x' = 0, is added to the steady one.
        let (re, im) = (1.0 - forcing * forcing, 2.0 * zeta * forcing);
        // H = (1 + iq)/(re + i·im), q = 2ζ·forcing: steady x = Im(H·e^{i·forcing·t}).
        let size = re * re + im * im;
        let (hr, hi) = ((re + im * im) / size, (im * re - im) / size);
        let steady = |t: f64| hr * libm::sin(forcing * t) + hi * libm::cos(forcing * t);
        let speed = forcing * hr;
        let sigma = (1.0 - zeta * zeta).sqrt();
        let (x0, v0) = (-hi, -speed);
        let own = libm::exp(-zeta * time)
            * (x0 * libm::cos(sigma * time) + (v0 + zeta * x0) / sigma * libm::sin(sigma * time));
        (fine[fine.len() - 1] - steady(time) - own).abs()
    };
    let errors = [60, 120, 240].map(error);
    assert!(errors[0] < 1e-2, "{errors:?}");
    for pair in errors.windows(2) {
        assert!((3.6..4.4).contains(&(pair[0] / pair[1])), "{errors:?}");
    }
}

#[test]
fn extremes_stay_finite_and_bounded_by_the_targets() {
    let targets = &signals(60)[3];
    for frequency in [1e-30, 1e-6, 1.0, 1e9, 1e30] {
        for zeta in [1e-30, 1e-3, 1.0, 1e6, 3e38] {
            for drag in [Drag::Target, Drag::World] {
                for dt in [1e-6, 1.0 / 24.0, 1e3] {
                    let found = run(2.0 * PI * frequency * dt, zeta, drag, targets);
                    assert!(found.iter().all(|x| x.abs() < 200.0), "{frequency} {zeta} {drag:?} {dt}: {found:?}");
                }
            }
        }
    }
}

#[test]
fn the_window_bounds_the_influence_of_the_initial_state_tightly() {
    for zeta in [0.025, 0.3, 0.9, 0.999, 1.0, 1.001, 2.0, 10.0] {
        for phase in [0.02, 0.3, 2.0] {
            for tolerance in [1e-2, 1e-3, 1e-6] {
                let steps = steps_to_forget(phase, [zeta; 2], tolerance);
                let ramp = soft();
                let left = |offset: f64, pace: f64, steps: u32| {
                    let mut jiggle = Jiggle::at_rest(&ONE, &at(0.0), &at(0.0));
                    jiggle.batches[0].states[1].offset[0].0[0] = offset;
                    jiggle.batches[0].states[1].velocity[0].0[0] = pace * phase;
                    let mut most = 0.0_f64;
                    for step in 0..steps + 40 {
                        if step >= steps {
                            most = most.max(free(&jiggle).abs());
                        }
                        jiggle.step(&at(0.0), &spring(phase, zeta, &ramp, Drag::World), 1.0, None);
                    }
                    most
                };
                let both = |steps| [1.0, -1.0].map(|pace| left(1.0, pace, steps)).into_iter().fold(0.0, f64::max);
                assert!(both(steps) <= tolerance, "{zeta} {phase} {tolerance}: {steps} steps");
                assert!(both(steps / 2) > tolerance || steps < 4, "{zeta} {phase} {tolerance}: {steps} steps");
            }
        }
    }
    assert_eq!(steps_to_forget(0.3, [0.3; 2], 10.0), 0);
    assert_eq!(steps_to_forget(0.0, [0.3; 2], 1e-3), u32::MAX);
    assert!(steps_to_forget(0.3, [0.1, 4.0], 1e-3) >= steps_to_forget(0.3, [0.1; 2], 1e-3));
    // By hand, far from ζ = 1: ln((1 + 11·0.05)·1000) ÷ (10 − √99) ÷ 1 = 146.6 steps.
    assert_eq!(steps_to_forget(1.0, [10.0; 2], 1e-3), 147);
}
