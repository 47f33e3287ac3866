//! The instructions that a text is compiled to, and the loop that runs them.
//!
//! Everything is scalar: a vector is three or four values. Instruction k writes value k and reads only earlier ones, so
//! a run is one pass over a flat list, on one number or on a batch: the same code, hence the same bits. Values that are
//! the same for all elements come first.
//!
//! Promise: no instruction fails; a division by zero is an infinity or NaN, and NaN is never lost by `min`, `max` or
//! `clamp`. Transcendental functions are those of the `libm` crate, the others are correctly rounded, so every CPU
//! gives the same bits. Limit: comparisons with NaN are false.

use super::random;

/// The index of a value and of the instruction that computes it.
pub(super) type Id = u32;

/// A value that is not computed by an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Input {
    Frame,
    Time,
    Fps,
    Seed,
    Count,
    /// A number of a control: `at` is its index among the numbers of all controls, `control` that of the control.
    Control {
        control: u32,
        at: u32,
    },
    Index,
    Attribute {
        attribute: u32,
        component: u32,
    },
}

impl Input {
    pub(super) fn is_uniform(self) -> bool {
        !matches!(self, Input::Index | Input::Attribute { .. })
    }
}

/// Functions of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Unary {
    Negate,
    Not,
    Abs,
    Sign,
    Floor,
    Ceil,
    Round,
    Sqrt,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Exp,
    Log,
    /// Rounds to the nearest f32.
    Single,
}

/// Functions of two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Modulo,
    Power,
    Min,
    Max,
    Atan2,
    Less,
    LessEqual,
    Equal,
    NotEqual,
    And,
    Or,
}

/// One instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Inst {
    /// The bits of an f64.
    Constant(u64),
    Input(Input),
    Unary(Unary, Id),
    Binary(Binary, Id, Id),
    /// Condition, value where it is not 0, value where it is.
    Select(Id, Id, Id),
    Noise(Id, Id, Id),
    Random(Id, Id),
}

impl Inst {
    pub(super) fn operands(&self) -> impl Iterator<Item = Id> + use<> {
        let operands = match *self {
            Inst::Constant(_) | Inst::Input(_) => [None, None, None],
            Inst::Unary(_, a) => [Some(a), None, None],
            Inst::Binary(_, a, b) | Inst::Random(a, b) => [Some(a), Some(b), None],
            Inst::Select(a, b, c) | Inst::Noise(a, b, c) => [Some(a), Some(b), Some(c)],
        };
        operands.into_iter().flatten()
    }

    pub(super) fn renamed(self, names: &[Id]) -> Inst {
        let name = |id: Id| names[id as usize];
        match self {
            Inst::Constant(_) | Inst::Input(_) => self,
            Inst::Unary(op, a) => Inst::Unary(op, name(a)),
            Inst::Binary(op, a, b) => Inst::Binary(op, name(a), name(b)),
            Inst::Select(a, b, c) => Inst::Select(name(a), name(b), name(c)),
            Inst::Noise(a, b, c) => Inst::Noise(name(a), name(b), name(c)),
            Inst::Random(a, b) => Inst::Random(name(a), name(b)),
        }
    }
}

/// `out[k] = f(a[k])`; a loop of known length over arrays, which the compiler unrolls.
fn map<const N: usize>(a: &[f64; N], out: &mut [f64; N], f: impl Fn(f64) -> f64) {
    for (out, a) in out.iter_mut().zip(a) {
        *out = f(*a);
    }
}

fn zip<const N: usize>(a: &[f64; N], b: &[f64; N], out: &mut [f64; N], f: impl Fn(f64, f64) -> f64) {
    for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
        *out = f(*a, *b);
    }
}

fn truth(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

impl Unary {
    pub(super) fn run<const N: usize>(self, a: &[f64; N], out: &mut [f64; N]) {
        match self {
            Unary::Negate => map(a, out, |a| -a),
            Unary::Not => map(a, out, |a| truth(a == 0.0)),
            Unary::Abs => map(a, out, f64::abs),
            Unary::Sign => map(a, out, |a| if a == 0.0 || a.is_nan() { a } else { a.signum() }),
            Unary::Floor => map(a, out, f64::floor),
            Unary::Ceil => map(a, out, f64::ceil),
            Unary::Round => map(a, out, f64::round),
            Unary::Sqrt => map(a, out, f64::sqrt),
            Unary::Sin => map(a, out, libm::sin),
            Unary::Cos => map(a, out, libm::cos),
            Unary::Tan => map(a, out, libm::tan),
            Unary::Asin => map(a, out, libm::asin),
            Unary::Acos => map(a, out, libm::acos),
            Unary::Atan => map(a, out, libm::atan),
            Unary::Exp => map(a, out, libm::exp),
            Unary::Log => map(a, out, libm::log),
            Unary::Single => map(a, out, |a| f64::from(a as f32)),
        }
    }
}

impl Binary {
    pub(super) fn run<const N: usize>(self, a: &[f64; N], b: &[f64; N], out: &mut [f64; N]) {
        match self {
            Binary::Add => zip(a, b, out, |a, b| a + b),
            Binary::Subtract => zip(a, b, out, |a, b| a - b),
            Binary::Multiply => zip(a, b, out, |a, b| a * b),
            Binary::Divide => zip(a, b, out, |a, b| a / b),
            Binary::Modulo => zip(a, b, out, modulo),
            Binary::Power => zip(a, b, out, power),
            Binary::Min => zip(a, b, out, |a, b| if b < a || b.is_nan() { b } else { a }),
            Binary::Max => zip(a, b, out, |a, b| if b > a || b.is_nan() { b } else { a }),
            Binary::Atan2 => zip(a, b, out, libm::atan2),
            Binary::Less => zip(a, b, out, |a, b| truth(a < b)),
            Binary::LessEqual => zip(a, b, out, |a, b| truth(a <= b)),
            Binary::Equal => zip(a, b, out, |a, b| truth(a == b)),
            Binary::NotEqual => zip(a, b, out, |a, b| truth(a != b)),
            Binary::And => zip(a, b, out, |a, b| truth(a != 0.0 && b != 0.0)),
            Binary::Or => zip(a, b, out, |a, b| truth(a != 0.0 || b != 0.0)),
        }
    }
}

/// The remainder of the division rounded down: 0 or with the sign of `b`, so that `frame % 24` is periodic below frame
/// 0 too.
pub(super) fn modulo(a: f64, b: f64) -> f64 {
    let rest = a % b;
    if rest != 0.0 && (rest < 0.0) != (b < 0.0) { rest + b } else { rest }
}

/// `a` to the power of `b`. A square is computed as a product, which is correctly rounded and thirty times faster.
pub(super) fn power(a: f64, b: f64) -> f64 {
    if b == 2.0 { a * a } else { libm::pow(a, b) }
}

/// Instructions in an executable order.
#[derive(Clone, Debug, Default)]
pub(super) struct Code {
    insts: Vec<Inst>,
    /// The number of instructions at the start whose values are the same for all elements.
    uniform: usize,
}

impl Code {
    /// From instructions in an executable order. The first `uniform` of them give the same value for all elements.
    pub(super) fn new(insts: Vec<Inst>, uniform: usize) -> Self {
        Code { insts, uniform }
    }

    /// The number of values that a run computes.
    pub(super) fn len(&self) -> usize {
        self.insts.len()
    }

    /// The number of values at the start that are the same for all elements.
    pub(super) fn uniform(&self) -> usize {
        self.uniform
    }

    /// The value of `id` if it is a constant.
    pub(super) fn constant(&self, id: Id) -> Option<f64> {
        match self.insts.get(id as usize) {
            Some(Inst::Constant(bits)) => Some(f64::from_bits(*bits)),
            _ => None,
        }
    }

    /// All inputs that a run reads.
    pub(super) fn inputs(&self) -> impl Iterator<Item = Input> {
        self.insts.iter().filter_map(|inst| match inst {
            Inst::Input(input) => Some(*input),
            Inst::Noise(..) | Inst::Random(..) => Some(Input::Seed),
            _ => None,
        })
    }

    /// Fills `values[k]` by instruction k, for k from `from` to the length of `values`. Values before `from` are used
    /// as they are; `load` fills inputs.
    pub(super) fn run<const N: usize>(
        &self,
        values: &mut [[f64; N]],
        from: usize,
        seed: f64,
        load: impl Fn(Input, &mut [f64; N]),
    ) {
        for (k, inst) in self.insts.iter().enumerate().take(values.len()).skip(from) {
            let (done, rest) = values.split_at_mut(k);
            let out = &mut rest[0];
            let value = |id: Id| &done[id as usize];
            match *inst {
                Inst::Constant(bits) => *out = [f64::from_bits(bits); N],
                Inst::Input(input) => load(input, out),
                Inst::Unary(op, a) => op.run(value(a), out),
                Inst::Binary(op, a, b) => op.run(value(a), value(b), out),
                Inst::Select(condition, yes, no) => {
                    let (condition, yes, no) = (value(condition), value(yes), value(no));
                    for k in 0..N {
                        out[k] = if condition[k] != 0.0 { yes[k] } else { no[k] };
                    }
                }
                Inst::Noise(x, y, z) => {
                    let (x, y, z) = (value(x), value(y), value(z));
                    for k in 0..N {
                        out[k] = random::noise(seed, [x[k], y[k], z[k]]);
                    }
                }
                Inst::Random(a, b) => zip(value(a), value(b), out, |a, b| random::rand(seed, a, b)),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modulo_has_the_sign_of_the_divisor() {
        assert_eq!(modulo(7.0, 3.0), 1.0);
        assert_eq!(modulo(-1.0, 24.0), 23.0);
        assert_eq!(modulo(1.0, -24.0), -23.0);
        assert_eq!(modulo(-24.0, 24.0), 0.0);
        assert_eq!(modulo(5.5, 2.0), 1.5);
        assert!(modulo(1.0, 0.0).is_nan());
    }

    #[test]
    fn min_and_max_keep_nan() {
        for (a, b) in [(f64::NAN, 1.0), (1.0, f64::NAN)] {
            for op in [Binary::Min, Binary::Max] {
                let mut out = [0.0];
                op.run(&[a], &[b], &mut out);
                assert!(out[0].is_nan());
            }
        }
    }
}
