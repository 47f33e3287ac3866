//! The instructions that a text becomes, and the one loop that runs them.
//!
//! Everything is scalar: a vector is three or four values. Instruction k writes value k and reads
//! only earlier ones, so a run is a walk over a flat list, on one number or on a batch of them: the
//! same code, hence the same bits. What does not differ between elements stands in front.
//!
//! Promise: no instruction fails; a division by zero is an infinity or NaN, and NaN is never lost
//! by `min`, `max` or `clamp`. Transcendental functions are those of the `libm` crate, the rest is
//! exactly rounded, so every CPU gives the same bits. Limit: comparisons with NaN are false.

use super::random;

/// Names a value by the instruction that makes it.
pub(super) type Id = u32;

/// What a value comes from when it is not computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Input {
    Frame,
    Time,
    Fps,
    Seed,
    Count,
    /// The number at `at` of all controls' numbers in a row; `control` counts controls.
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
    /// To the nearest f32.
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

/// The rest of a division rounded down: 0 or of the sign of `b`, so that `frame % 24` repeats
/// before frame 0 as it does after.
pub(super) fn modulo(a: f64, b: f64) -> f64 {
    let rest = a % b;
    if rest != 0.0 && (rest < 0.0) != (b < 0.0) { rest + b } else { rest }
}

/// `a` to the power of `b`. A square is a product: exactly rounded, and thirty times faster.
pub(super) fn power(a: f64, b: f64) -> f64 {
    if b == 2.0 { a * a } else { libm::pow(a, b) }
}

/// Instructions, in an order in which they can run.
#[derive(Clone, Debug, Default)]
pub(super) struct Code {
    insts: Vec<Inst>,
    /// How many of them, from the first, give the same for every element.
    uniform: usize,
}

impl Code {
    /// Of instructions in an order in which they can run, the first `uniform` of which give the same
    /// for every element.
    pub(super) fn new(insts: Vec<Inst>, uniform: usize) -> Self {
        Code { insts, uniform }
    }

    /// How many values a run makes.
    pub(super) fn len(&self) -> usize {
        self.insts.len()
    }

    /// How many of the values, from the first, are the same for every element.
    pub(super) fn uniform(&self) -> usize {
        self.uniform
    }

    /// The value of `id` where it is a constant.
    pub(super) fn constant(&self, id: Id) -> Option<f64> {
        match self.insts.get(id as usize) {
            Some(Inst::Constant(bits)) => Some(f64::from_bits(*bits)),
            _ => None,
        }
    }

    /// Everything that a run reads.
    pub(super) fn inputs(&self) -> impl Iterator<Item = Input> {
        self.insts.iter().filter_map(|inst| match inst {
            Inst::Input(input) => Some(*input),
            Inst::Noise(..) | Inst::Random(..) => Some(Input::Seed),
            _ => None,
        })
    }

    /// Fills `values[k]` by instruction k, for k from `from` to the length of `values`.
    /// Values before `from` are taken as they are; `load` fills what comes from outside.
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
    fn modulo_follows_the_divisor() {
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
