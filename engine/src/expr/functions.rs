//! The functions of the language: name, number of arguments, and operation.
//!
//! Parser, checks and code generation use this table. A new function needs a line here, and an arm in `check` and in
//! `lower` unless it is one instruction per component.

use super::code::{Binary, Unary};

/// The largest number of arguments of any function.
pub(super) const MOST_ARGUMENTS: usize = 8;

/// A function.
#[derive(Debug, PartialEq)]
pub(super) struct Function {
    pub(super) name: &'static str,
    /// Smallest and largest number of arguments.
    pub(super) arguments: (usize, usize),
    pub(super) kind: FunctionKind,
    /// How a call is written, for hints.
    pub(super) usage: &'static str,
}

/// The operation of a function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum FunctionKind {
    /// Works component by component; a scalar is used for all components.
    Each(Each),
    /// Takes scalars or one 3-vector.
    Noise,
    /// Takes scalars.
    Rand,
    /// Combines scalars to a vector; one scalar fills three components.
    Vector,
    Length,
    Distance,
    Dot,
    Cross,
    Normalize,
}

/// The operation on each component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Each {
    Unary(Unary),
    /// From left to right if there are more than two arguments.
    Binary(Binary),
    Scale(f64),
    Fract,
    Clamp,
    Mix,
    Step,
    Smoothstep,
    Fit,
}

/// All functions, in the order of `HELP`.
pub(super) const FUNCTIONS: &[Function] = &[
    each("sin", 1, Each::Unary(Unary::Sin), "sin(x)"),
    each("cos", 1, Each::Unary(Unary::Cos), "cos(x)"),
    each("tan", 1, Each::Unary(Unary::Tan), "tan(x)"),
    each("asin", 1, Each::Unary(Unary::Asin), "asin(x)"),
    each("acos", 1, Each::Unary(Unary::Acos), "acos(x)"),
    each("atan", 1, Each::Unary(Unary::Atan), "atan(x)"),
    each("atan2", 2, Each::Binary(Binary::Atan2), "atan2(y, x)"),
    each("radians", 1, Each::Scale(std::f64::consts::PI / 180.0), "radians(degrees)"),
    each("degrees", 1, Each::Scale(180.0 / std::f64::consts::PI), "degrees(radians)"),
    each("sqrt", 1, Each::Unary(Unary::Sqrt), "sqrt(x)"),
    each("exp", 1, Each::Unary(Unary::Exp), "exp(x)"),
    each("log", 1, Each::Unary(Unary::Log), "log(x)"),
    each("pow", 2, Each::Binary(Binary::Power), "pow(x, exponent)"),
    each("mod", 2, Each::Binary(Binary::Modulo), "mod(x, divisor)"),
    each("abs", 1, Each::Unary(Unary::Abs), "abs(x)"),
    each("sign", 1, Each::Unary(Unary::Sign), "sign(x)"),
    each("floor", 1, Each::Unary(Unary::Floor), "floor(x)"),
    each("ceil", 1, Each::Unary(Unary::Ceil), "ceil(x)"),
    each("round", 1, Each::Unary(Unary::Round), "round(x)"),
    each("fract", 1, Each::Fract, "fract(x)"),
    several("min", Each::Binary(Binary::Min), "min(a, b, …)"),
    several("max", Each::Binary(Binary::Max), "max(a, b, …)"),
    each("clamp", 3, Each::Clamp, "clamp(x, low, high)"),
    each("mix", 3, Each::Mix, "mix(a, b, share)"),
    each("step", 2, Each::Step, "step(edge, x)"),
    each("smoothstep", 3, Each::Smoothstep, "smoothstep(low, high, x)"),
    each("fit", 5, Each::Fit, "fit(x, from_low, from_high, to_low, to_high)"),
    function("noise", (1, 3), FunctionKind::Noise, "noise(P)` or `noise(x, y, z)"),
    function("rand", (1, 2), FunctionKind::Rand, "rand(i)` or `rand(i, j)"),
    function("vec", (1, 4), FunctionKind::Vector, "vec(x, y, z)"),
    function("length", (1, 1), FunctionKind::Length, "length(v)"),
    function("distance", (2, 2), FunctionKind::Distance, "distance(a, b)"),
    function("dot", (2, 2), FunctionKind::Dot, "dot(a, b)"),
    function("cross", (2, 2), FunctionKind::Cross, "cross(a, b)"),
    function("normalize", (1, 1), FunctionKind::Normalize, "normalize(v)"),
];

/// Names from other languages, and what to write instead.
pub(super) const FOREIGN: &[(&str, &str)] = &[
    ("lerp", "mix"),
    ("ln", "log"),
    ("random", "rand"),
    ("snoise", "noise"),
    ("saturate", "clamp(x, 0, 1)"),
    ("trunc", "sign(x)*floor(abs(x))"),
    ("fmod", "mod"),
    ("mag", "length"),
    ("norm", "normalize"),
    ("set", "vec"),
    ("vec3", "vec"),
    ("vector", "vec"),
    ("exp2", "2^x"),
    ("log2", "log(x)/log(2)"),
    ("log10", "log(x)/log(10)"),
    ("and", "&&"),
    ("or", "||"),
    ("not", "!"),
    ("true", "1"),
    ("false", "0"),
];

const fn function(name: &'static str, arguments: (usize, usize), kind: FunctionKind, usage: &'static str) -> Function {
    Function { name, arguments, kind, usage }
}

const fn each(name: &'static str, arguments: usize, each: Each, usage: &'static str) -> Function {
    function(name, (arguments, arguments), FunctionKind::Each(each), usage)
}

const fn several(name: &'static str, each: Each, usage: &'static str) -> Function {
    function(name, (2, MOST_ARGUMENTS), FunctionKind::Each(each), usage)
}

/// The function of that name.
pub(super) fn find(name: &str) -> Option<&'static Function> {
    FUNCTIONS.iter().find(|function| function.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_consistent() {
        for (k, function) in FUNCTIONS.iter().enumerate() {
            let (fewest, most) = function.arguments;
            assert!(1 <= fewest && fewest <= most && most <= MOST_ARGUMENTS, "{}", function.name);
            assert!(function.usage.starts_with(&format!("{}(", function.name)));
            assert!(FUNCTIONS[..k].iter().all(|other| other.name != function.name));
            assert_eq!(find(function.name), Some(function));
        }
    }

    #[test]
    fn names_of_other_languages_are_not_functions() {
        for (name, ours) in FOREIGN {
            assert!(find(name).is_none(), "{name}");
            let called = ours.split('(').next().unwrap();
            assert!(find(called).is_some() || !called.chars().all(char::is_alphabetic), "{ours}");
        }
    }
}
