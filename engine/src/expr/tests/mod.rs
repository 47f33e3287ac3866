//! Tests of the whole language: values, faults, programs, and comparison with a second interpreter.

mod faults;
mod programs;
mod reference;
mod values;

use super::*;

/// Frame 36 at 24 frames per second, `strength` 0.75, `wind` (1, 2, 3).
const ENV: Env<'_> = Env { frame: 36.0, time: 1.5, fps: 24.0, seed: 7.0, controls: &[0.75, 1.0, 2.0, 3.0] };

const SCOPE: Scope<'_> = Scope { controls: &[("strength", Width::Scalar), ("wind", Width::Vec3)] };

fn eval(text: &str) -> f64 {
    Expr::parse(text, &SCOPE).unwrap_or_else(|fault| panic!("`{text}`: {fault}")).eval(&ENV)
}

fn fault(text: &str) -> ExprError {
    Expr::parse(text, &SCOPE).expect_err(text)
}
