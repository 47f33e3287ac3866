//! Guarantees of the expression language for arbitrary text.

use engine::expr::{Env, Expr, ExprError, Program, Scope, Uses, Width};
use engine::geometry::Column;

const SCOPE: Scope<'_> = Scope { controls: &[("gain", Width::Scalar), ("dir", Width::Vec3), ("tint", Width::Vec4)] };

const ENV: Env<'_> =
    Env { frame: 12.5, time: 0.25, fps: 50.0, seed: 7.0, controls: &[0.5, 1.0, 0.0, -0.25, 0.1, 0.2, 0.3, 1.0] };

/// Numbers of rows that programs run over: none, a few, more than one batch.
const ROWS: [usize; 3] = [0, 3, 70];

/// Evaluates `text` as an expression and runs it as a program.
///
/// # Panics
/// If a fault has no position in the text, a value depends on something its text does not use, or a program writes other
/// attributes than it declares.
pub(crate) fn check(text: &str) {
    match Expr::parse(text, &SCOPE) {
        Ok(expr) => check_expr(&expr),
        Err(fault) => check_fault(&fault, text),
    }
    match Program::parse(text, &SCOPE) {
        Ok(program) => ROWS.into_iter().for_each(|rows| check_program(&program, rows)),
        Err(faults) => {
            assert!(!faults.is_empty(), "a program that does not parse has faults");
            faults.iter().for_each(|fault| check_fault(fault, text));
        }
    }
}

fn check_fault(fault: &ExprError, text: &str) {
    let line = text.split('\n').nth(fault.line.wrapping_sub(1));
    assert!(line.is_some_and(|line| (1..=line.chars().count() + 1).contains(&fault.column)), "{fault:?}");
}

/// An environment in which everything that is not used has another value.
fn unused_changed(uses: &Uses, numbers: &mut Vec<f64>) -> [f64; 4] {
    let mut at = 0;
    for (index, (_, width)) in SCOPE.controls.iter().enumerate() {
        let is_used = uses.controls.contains(&index);
        numbers.extend(ENV.controls[at..at + width.count()].iter().map(|x| if is_used { *x } else { 9.0 }));
        at += width.count();
    }
    let (frame, time) = if uses.time { (ENV.frame, ENV.time) } else { (99.0, 3.0) };
    [frame, time, if uses.fps { ENV.fps } else { 24.0 }, if uses.seed { ENV.seed } else { 8.0 }]
}

fn check_expr(expr: &Expr) {
    let value = expr.eval(&ENV);
    let mut controls = Vec::new();
    let [frame, time, fps, seed] = unused_changed(expr.uses(), &mut controls);
    let other = expr.eval(&Env { frame, time, fps, seed, controls: &controls });
    for same in std::iter::once(other).chain(expr.constant()) {
        assert!(value == same || value.is_nan() && same.is_nan(), "{value} and {same}");
    }
}

/// Columns of every type, with the largest and smallest numbers.
fn columns(rows: usize) -> Vec<(&'static str, Column)> {
    const SINGLE: [f32; 7] = [0.0, 1.0, -0.0, f32::MAX, f32::MIN_POSITIVE, -0.75, f32::MIN];
    const WHOLE: [i32; 5] = [0, i32::MAX, -1, i32::MIN, 3];
    fn rows_of<T: Copy, const N: usize>(numbers: &[T], rows: usize) -> Vec<[T; N]> {
        (0..rows).map(|row| std::array::from_fn(|k| numbers[(row * N + k) % numbers.len()])).collect()
    }
    vec![
        ("P", Column::new(rows_of::<f32, 3>(&SINGLE, rows))),
        ("orient", Column::new(rows_of::<f32, 4>(&SINGLE, rows))),
        ("mask", Column::new(rows_of::<f32, 1>(&SINGLE, rows).into_flattened())),
        ("id", Column::new(rows_of::<i32, 1>(&WHOLE, rows).into_flattened())),
        ("cell", Column::new(rows_of::<i32, 3>(&WHOLE, rows))),
        ("corners", Column::new(rows_of::<i32, 4>(&WHOLE, rows))),
    ]
}

fn check_program(program: &Program, rows: usize) {
    let columns = columns(rows);
    let all: Vec<(&str, &Column)> = columns.iter().map(|(name, column)| (*name, column)).collect();
    let Ok(written) = program.run(&ENV, &all, rows) else { return };
    assert!(written.iter().map(|(name, _)| name).eq(program.writes()), "{:?}", program.writes());
    for (name, column) in &written {
        assert_eq!(column.len(), rows, "{name}");
        let before = columns.iter().find(|(other, _)| other == name);
        assert!(before.is_none_or(|(_, before)| before.kind() == column.kind()), "{name} keeps its type");
    }
    // Columns that are neither read nor written do not matter.
    let named = |name: &str| program.reads().iter().chain(program.writes()).any(|other| other == name);
    let named: Vec<(&str, &Column)> = all.iter().copied().filter(|(name, _)| named(name)).collect();
    assert!(program.run(&ENV, &named, rows).as_ref() == Ok(&written), "the same attributes again");
}
