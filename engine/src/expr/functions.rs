//! The functions of the language: name, how many arguments, and what each does.
//!
//! One table: parser, checks, code and help read it. A new function is a line here, and where it is
//! not one instruction per component an arm in `check` and in `lower`.

use super::code::{Binary, Unary};

/// Most arguments that any function takes.
pub(super) const MOST_ARGUMENTS: usize = 8;

/// A function as a text calls it.
#[derive(Debug, PartialEq)]
pub(super) struct Function {
    pub(super) name: &'static str,
    /// Fewest and most arguments.
    pub(super) arguments: (usize, usize),
    pub(super) does: Does,
    /// How a call is written, for hints.
    pub(super) usage: &'static str,
}

/// What a function does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Does {
    /// Component by component, a scalar stands for all components.
    Each(Each),
    /// Scalars, or one vector of three.
    Noise,
    /// Scalars.
    Rand,
    /// Scalars to a vector; one scalar fills three components.
    Vector,
    Length,
    Distance,
    Dot,
    Cross,
    Normalize,
}

/// What is done with each component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Each {
    Unary(Unary),
    /// From left to right where there are more than two.
    Binary(Binary),
    Scale(f64),
    Fract,
    Clamp,
    Mix,
    Step,
    Smoothstep,
    Fit,
}

/// Aligned with what `HELP` says of each.
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
    function("noise", (1, 3), Does::Noise, "noise(P)` or `noise(x, y, z)"),
    function("rand", (1, 2), Does::Rand, "rand(i)` or `rand(i, j)"),
    function("vec", (1, 4), Does::Vector, "vec(x, y, z)"),
    function("length", (1, 1), Does::Length, "length(v)"),
    function("distance", (2, 2), Does::Distance, "distance(a, b)"),
    function("dot", (2, 2), Does::Dot, "dot(a, b)"),
    function("cross", (2, 2), Does::Cross, "cross(a, b)"),
    function("normalize", (1, 1), Does::Normalize, "normalize(v)"),
];

/// What other languages call a function or a value, and what it is called here.
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

const fn function(name: &'static str, arguments: (usize, usize), does: Does, usage: &'static str) -> Function {
    Function { name, arguments, does, usage }
}

const fn each(name: &'static str, arguments: usize, each: Each, usage: &'static str) -> Function {
    function(name, (arguments, arguments), Does::Each(each), usage)
}

const fn several(name: &'static str, each: Each, usage: &'static str) -> Function {
    function(name, (2, MOST_ARGUMENTS), Does::Each(each), usage)
}

/// The function of that name.
pub(super) fn find(name: &str) -> Option<&'static Function> {
    FUNCTIONS.iter().find(|function| function.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_sound() {
        for (k, function) in FUNCTIONS.iter().enumerate() {
            let (fewest, most) = function.arguments;
            assert!(1 <= fewest && fewest <= most && most <= MOST_ARGUMENTS, "{}", function.name);
            assert!(function.usage.starts_with(&format!("{}(", function.name)));
            assert!(FUNCTIONS[..k].iter().all(|other| other.name != function.name));
            assert_eq!(find(function.name), Some(function));
        }
    }

    #[test]
    fn foreign_names_are_not_ours() {
        for (name, ours) in FOREIGN {
            assert!(find(name).is_none(), "{name}");
            let called = ours.split('(').next().unwrap();
            assert!(find(called).is_some() || !called.chars().all(char::is_alphabetic), "{ours}");
        }
    }
}
