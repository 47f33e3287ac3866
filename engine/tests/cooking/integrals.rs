//! Integrals of params over time.

use std::sync::Arc;

use engine::expr::{Expr, Scope};
use engine::param::{Keyframes, ParamType, Shape, Source};
use numerics::ramp::Interpolation;

use crate::builder::{Cooked, TestGraph, at, engine, keyed};
use crate::nodes::{DRIFT, SOURCE, SPREAD};

fn drift(first: i64, speed: Source, upto: f32) -> TestGraph {
    let mut graph = TestGraph::new(first, 100);
    let a = graph.add("a", &SOURCE).set("amount", 0.0_f32).done();
    graph.add("drift", &DRIFT).source("speed", speed).set("upto", upto).wire("points", a).out();
    graph
}

fn cook(graph: &TestGraph, frames: &[f64]) -> Cooked {
    let frames: Vec<_> = frames.iter().map(|frame| at(*frame)).collect();
    graph.cook_with(&engine(2, 1 << 30), &frames, None)
}

#[test]
fn constant_speed_is_exact_at_any_frame() {
    let graph = drift(1, Source::Constant(f32::erase(3.0)), 0.0);
    let cooked = cook(&graph, &[-12.0, 0.0, 10.5, 24.0, 1e8]);
    assert_eq!(cooked.xs(), [-1.5, 0.0, 1.3125, 3.0, 1.25e7]);
}

#[test]
fn keyframed_speed_has_the_closed_form() {
    // v = f/12 m/s up to frame 24, then 2: ∫ = f²/576 m, then 1 + (f − 24)/12.
    let graph = drift(1, keyed(&[(0.0, 0.0), (24.0, 2.0)]), 0.0);
    let cooked = cook(&graph, &[0.0, 1.0, 6.5, 12.0, 24.0, 30.0]);
    for (frame, x) in [(0.0, 0.0), (1.0, 1.0 / 576.0), (6.5, 42.25 / 576.0), (12.0, 0.25), (24.0, 1.0), (30.0, 1.5)] {
        assert!((cooked.x(frame) - x).abs() <= 1e-7, "frame {frame}: {} for {x}", cooked.x(frame));
    }
}

#[test]
fn smooth_keyframes_have_the_closed_form() {
    // s(t) = 3t² − 2t³ with t = f/24: ∫₀^f = (t³ − t⁴/2) · 1 s.
    let keys = vec![(0.0, f32::erase(0.0)), (24.0, f32::erase(1.0))];
    let keys = Keyframes { keys, interpolation: Interpolation::Smooth };
    let graph = drift(1, Source::Keys(Arc::new(keys), f32::shape()), 0.0);
    let cooked = cook(&graph, &[6.0, 12.0, 17.75]);
    for frame in [6.0, 12.0, 17.75] {
        let t = frame / 24.0;
        let exact = (t * t * t - 0.5 * t * t * t * t) as f32;
        assert!((cooked.x(frame) - exact).abs() <= 1e-7, "frame {frame}: {} for {exact}", cooked.x(frame));
    }
}

#[test]
fn an_expression_has_the_closed_form() {
    // ∫₀^t sin(5t) dt = (1 − cos 5t)/5; with four Gauss points per frame the error is far below the precision of f32.
    let speed = Expr::parse("sin(5*time)", &Scope::default()).expect("an expression");
    let graph = drift(-20, Source::Exprs(Arc::new(vec![speed]), Shape::Float, Arc::default()), 0.0);
    let frames = [1.0, 7.5, 31.0, 96.0, -20.0];
    let cooked = cook(&graph, &frames);
    for frame in frames {
        let exact = ((1.0 - libm::cos(5.0 * frame / 24.0)) / 5.0) as f32;
        assert!((cooked.x(frame) - exact).abs() <= 1e-7, "frame {frame}: {} for {exact}", cooked.x(frame));
    }
}

#[test]
fn integrals_do_not_depend_on_which_frames_are_requested() {
    let speed = || keyed(&[(-30.0, 0.3), (-7.0, 1.1), (3.0, 0.1), (24.0, 2.0), (31.0, -1.0)]);
    let graph = drift(-20, speed(), 0.0);
    let frames: Vec<f64> = (-40..60).map(|k| f64::from(k) * 0.7).map(|f| (f * 10.0).round() / 10.0).collect();
    let together = cook(&graph, &frames);
    for frame in frames.iter().step_by(7) {
        assert_eq!(cook(&graph, &[*frame]).x(*frame).to_bits(), together.x(*frame).to_bits(), "frame {frame}");
    }
}

#[test]
fn before_the_scenes_start_params_are_constant() {
    // v = 1 + (f + 10)/10 from frame −10 to 10, 1 before. x(5) reads the integral up to frame −15.
    let graph = drift(-10, keyed(&[(-10.0, 1.0), (10.0, 3.0)]), 20.0);
    // ∫₀^−10 (2 + f/10) df = −20 + 5 = −15 frames; five more frames at 1: −20 frames, at 24 frames per second.
    let exact = -20.0 / 24.0;
    assert!((cook(&graph, &[5.0]).x(5.0) - exact).abs() <= 1e-6);
    // Keyframes before the scene's start have no effect.
    let other = drift(-10, keyed(&[(-14.0, 9.0), (-10.0, 1.0), (10.0, 3.0)]), 20.0);
    assert_eq!(cook(&other, &[5.0]).x(5.0).to_bits(), cook(&graph, &[5.0]).x(5.0).to_bits());
}

#[test]
fn several_integrands_are_integrated_independently() {
    let mut graph = TestGraph::new(1, 100);
    let a = graph.add("a", &SOURCE).set("amount", 0.0_f32).done();
    graph.add("spread", &SPREAD).keyed("speed", &[(0.0, 0.0), (24.0, 2.0)]).wire("points", a).out();
    // v = f/12 m/s: ∫ = f²/576 m, ∫ v² = f³/10,368.
    for frame in [1.0, 6.5, 24.0] {
        let (exact, x) = (frame * frame / 576.0 + frame * frame * frame / 10_368.0, cook(&graph, &[frame]).x(frame));
        assert!((f64::from(x) - exact).abs() <= 1e-6, "frame {frame}: {x} for {exact}");
    }
    // −1 and its square cancel.
    let mut graph = TestGraph::new(1, 100);
    let a = graph.add("a", &SOURCE).set("amount", 0.0_f32).done();
    graph.add("spread", &SPREAD).set("speed", -1.0_f32).wire("points", a).out();
    assert_eq!(cook(&graph, &[24.0]).x(24.0), 0.0);
}

#[test]
fn illegal_past_values_matter_only_if_an_integral_reads_them() {
    let graph = |share: &[(f64, f32)]| {
        let mut graph = TestGraph::new(1, 100);
        let a = graph.add("a", &SOURCE).set("amount", 0.0_f32).done();
        let spread = graph.add("spread", &SPREAD).keyed("speed", &[(0.0, 0.0), (24.0, 2.0)]);
        spread.keyed("share", share).wire("points", a).out();
        graph
    };
    let illegal_before = graph(&[(3.0, -1.0), (5.0, 1.0)]);
    assert!(cook(&illegal_before, &[3.0]).error().contains("`share` is -1"));
    let legal = graph(&[(3.0, 1.0), (5.0, 1.0)]);
    assert_eq!(cook(&illegal_before, &[12.0]).x(12.0).to_bits(), cook(&legal, &[12.0]).x(12.0).to_bits());
}

#[test]
fn an_integral_cannot_reach_into_the_future() {
    let graph = drift(1, keyed(&[(0.0, 0.0), (24.0, 2.0)]), -2.0);
    let error = cook(&graph, &[5.0]).error();
    assert!(error.contains("an integral up to frame 7, which is after frame 5"), "{error}");
}
