//! Compares the language with a second interpreter: random trees are printed, parsed and run, and also evaluated
//! directly.

use numerics::vector::DVec3;
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use super::super::code::{modulo, power};
use super::*;
use crate::geometry::Column;

/// An expression tree that is evaluated recursively. Vectors have three components.
#[derive(Clone, Debug)]
enum Tree {
    Number(f64),
    Time,
    Control,
    Px(usize),
    P,
    Unary(&'static str, Box<Tree>),
    Binary(&'static str, Box<[Tree; 2]>),
    Choice(Box<[Tree; 3]>),
    Call(&'static str, Vec<Tree>),
    Component(Box<Tree>, usize),
}

const P_ROWS: [[f32; 3]; 3] = [[0.5, -2.0, 3.25], [0.0, 1e-3, 700.0], [-1.0, 1.0, 0.1]];

fn scalar() -> BoxedStrategy<Tree> {
    let leaf = prop_oneof![
        prop::sample::select(vec![0.0, 1.0, 2.0, 0.5, 3.75, 1e-9, 1e12]).prop_map(Tree::Number),
        Just(Tree::Time),
        Just(Tree::Control),
        (0..3usize).prop_map(Tree::Px),
    ];
    leaf.prop_recursive(6, 48, 3, |inner| {
        let vector = vector(inner.clone());
        let boxed = |tree: Tree| Box::new(tree);
        let pair = (inner.clone(), inner.clone());
        let operators = vec!["+", "-", "*", "/", "%", "^", "<", "<=", ">", ">=", "==", "!=", "&&", "||"];
        prop_oneof![
            1 => (prop::sample::select(vec!["-", "!"]), inner.clone())
                .prop_map(move |(op, a)| Tree::Unary(op, boxed(a))),
            4 => (prop::sample::select(operators), pair.clone())
                .prop_map(|(op, (a, b))| Tree::Binary(op, Box::new([a, b]))),
            1 => (pair.clone(), inner.clone()).prop_map(|((a, b), c)| Tree::Choice(Box::new([a, b, c]))),
            1 => (prop::sample::select(vec!["sin", "abs", "floor", "sqrt", "exp", "fract"]), inner.clone())
                .prop_map(|(name, a)| Tree::Call(name, vec![a])),
            1 => (prop::sample::select(vec!["min", "max", "atan2", "step"]), pair.clone())
                .prop_map(|(name, (a, b))| Tree::Call(name, vec![a, b])),
            1 => (prop::sample::select(vec!["clamp", "mix"]), pair, inner)
                .prop_map(|(name, (a, b), c)| Tree::Call(name, vec![a, b, c])),
            1 => vector.clone().prop_map(|v| Tree::Call("length", vec![v])),
            1 => (vector.clone(), vector.clone()).prop_map(|(a, b)| Tree::Call("dot", vec![a, b])),
            1 => (vector, 0..3usize).prop_map(move |(v, k)| Tree::Component(boxed(v), k)),
        ]
    })
    .boxed()
}

fn vector(scalar: impl Strategy<Value = Tree> + Clone + 'static) -> BoxedStrategy<Tree> {
    let triple = (scalar.clone(), scalar.clone(), scalar.clone());
    let plain = prop_oneof![Just(Tree::P), triple.prop_map(|(x, y, z)| Tree::Call("vec", vec![x, y, z])),];
    prop_oneof![
        plain.clone(),
        (prop::sample::select(vec!["+", "-", "*"]), plain.clone(), plain.clone())
            .prop_map(|(op, a, b)| Tree::Binary(op, Box::new([a, b]))),
        (scalar, plain.clone()).prop_map(|(s, v)| Tree::Binary("*", Box::new([s, v]))),
        (plain.clone(), plain.clone()).prop_map(|(a, b)| Tree::Call("cross", vec![a, b])),
        plain.prop_map(|v| Tree::Call("normalize", vec![v])),
    ]
    .boxed()
}

/// The precedence in C; 9 and 10 for what is never bracketed.
fn precedence(tree: &Tree) -> u8 {
    match tree {
        Tree::Choice(_) => 1,
        Tree::Binary(op, _) => match *op {
            "||" => 2,
            "&&" => 3,
            "==" | "!=" => 4,
            "<" | "<=" | ">" | ">=" => 5,
            "+" | "-" => 6,
            "*" | "/" | "%" => 7,
            _ => 9,
        },
        Tree::Unary(..) => 8,
        _ => 10,
    }
}

/// Prints a tree with brackets only where they are needed, so that precedence is tested.
fn print(tree: &Tree) -> String {
    let bracketed = |tree: &Tree, by: u8| {
        let text = print(tree);
        if precedence(tree) < by { format!("({text})") } else { text }
    };
    match tree {
        Tree::Number(value) => format!("{value:?}"),
        Tree::Time => "time".to_owned(),
        Tree::Control => "strength".to_owned(),
        Tree::Px(k) => format!("P.{}", ["x", "y", "z"][*k]),
        Tree::P => "P".to_owned(),
        Tree::Unary(op, a) => format!("{op}{}", bracketed(a, 8)),
        Tree::Binary(op, pair) => {
            let own = precedence(tree);
            let [a, b] = &**pair;
            match *op {
                // Right-associative, and the exponent may have a sign.
                "^" => format!("{}^{}", bracketed(a, 10), bracketed(b, 8)),
                // Comparisons do not chain.
                "==" | "!=" | "<" | "<=" | ">" | ">=" => {
                    format!("{} {op} {}", bracketed(a, own + 1), bracketed(b, own + 1))
                }
                _ => format!("{} {op} {}", bracketed(a, own), bracketed(b, own + 1)),
            }
        }
        Tree::Choice(parts) => {
            let [a, b, c] = &**parts;
            format!("{} ? {} : {}", bracketed(a, 2), print(b), bracketed(c, 1))
        }
        Tree::Call(name, arguments) => {
            let arguments: Vec<String> = arguments.iter().map(print).collect();
            format!("{name}({})", arguments.join(", "))
        }
        Tree::Component(of, k) => format!("{}.{}", bracketed(of, 10), ["x", "y", "z"][*k]),
    }
}

#[derive(Clone, Copy)]
enum Value {
    Scalar(f64),
    Vector([f64; 3]),
}

impl Value {
    fn scalar(self) -> f64 {
        match self {
            Value::Scalar(x) => x,
            Value::Vector(_) => panic!("a vector where the tree has a scalar"),
        }
    }

    fn vector(self) -> [f64; 3] {
        match self {
            Value::Scalar(x) => [x; 3],
            Value::Vector(v) => v,
        }
    }
}

fn binary(op: &str, a: f64, b: f64) -> f64 {
    let truth = |holds: bool| if holds { 1.0 } else { 0.0 };
    match op {
        "+" => a + b,
        "-" => a - b,
        "*" => a * b,
        "/" => a / b,
        "%" => modulo(a, b),
        "^" => power(a, b),
        "<" => truth(a < b),
        "<=" => truth(a <= b),
        ">" => truth(a > b),
        ">=" => truth(a >= b),
        "==" => truth(a == b),
        _ => truth(a != b),
    }
}

fn minimum(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.min(b) }
}

fn maximum(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

fn walk(tree: &Tree, p: [f32; 3]) -> Value {
    let number = |tree: &Tree| walk(tree, p).scalar();
    let scalar = Value::Scalar;
    match tree {
        Tree::Number(value) => scalar(*value),
        Tree::Time => scalar(ENV.time),
        Tree::Control => scalar(ENV.controls[0]),
        Tree::Px(k) => scalar(f64::from(p[*k])),
        Tree::P => Value::Vector(p.map(f64::from)),
        Tree::Unary("-", a) => scalar(-number(a)),
        Tree::Unary(_, a) => scalar(if number(a) == 0.0 { 1.0 } else { 0.0 }),
        Tree::Binary("&&", pair) => scalar(if number(&pair[0]) != 0.0 && number(&pair[1]) != 0.0 { 1.0 } else { 0.0 }),
        Tree::Binary("||", pair) => scalar(if number(&pair[0]) != 0.0 || number(&pair[1]) != 0.0 { 1.0 } else { 0.0 }),
        Tree::Binary(op, pair) => match (walk(&pair[0], p), walk(&pair[1], p)) {
            (Value::Scalar(a), Value::Scalar(b)) => scalar(binary(op, a, b)),
            (a, b) => {
                let (a, b) = (a.vector(), b.vector());
                Value::Vector([0, 1, 2].map(|k| binary(op, a[k], b[k])))
            }
        },
        Tree::Choice(parts) => walk(&parts[if number(&parts[0]) != 0.0 { 1 } else { 2 }], p),
        Tree::Component(of, k) => scalar(walk(of, p).vector()[*k]),
        Tree::Call(name, arguments) => {
            let x = |k: usize| number(&arguments[k]);
            let v = |k: usize| DVec3::from(walk(&arguments[k], p).vector());
            match *name {
                "sin" => scalar(libm::sin(x(0))),
                "abs" => scalar(x(0).abs()),
                "floor" => scalar(x(0).floor()),
                "sqrt" => scalar(x(0).sqrt()),
                "exp" => scalar(libm::exp(x(0))),
                "fract" => scalar(x(0) - x(0).floor()),
                "min" => scalar(minimum(x(0), x(1))),
                "max" => scalar(maximum(x(0), x(1))),
                "atan2" => scalar(libm::atan2(x(0), x(1))),
                "step" => scalar(if x(1) >= x(0) { 1.0 } else { 0.0 }),
                "clamp" => scalar(minimum(maximum(x(0), x(1)), x(2))),
                "mix" => scalar(x(0) * (1.0 - x(2)) + x(1) * x(2)),
                "length" => scalar(v(0).norm()),
                "dot" => scalar(v(0).dot(&v(1))),
                "vec" => Value::Vector([x(0), x(1), x(2)]),
                "cross" => Value::Vector(v(0).cross(&v(1)).into()),
                _ => {
                    let length = v(0).norm();
                    Value::Vector(v(0).map(|x| if length == 0.0 { 0.0 } else { x / length }).into())
                }
            }
        }
    }
}

/// The value in an f32 column; `None` if it is out of range.
fn stored(value: f64) -> Option<f32> {
    (value as f32).is_finite().then_some(value as f32)
}

#[test]
fn random_trees_have_the_value_of_a_second_interpreter() {
    let config = ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() };
    let p = Column::new(P_ROWS.to_vec());
    TestRunner::new(config)
        .run(&scalar(), |tree| {
            let text = print(&tree);
            let program = Program::parse(&format!("a = {text}"), &SCOPE);
            let program = program.map_err(|faults| TestCaseError::fail(format!("{text}: {faults:?}")))?;
            let expected = P_ROWS.map(|row| stored(walk(&tree, row).scalar()));
            match program.run(&ENV, &[("P", &p)], P_ROWS.len()) {
                Ok(written) => {
                    let Column::F1(rows) = &written[0].1 else {
                        return Err(TestCaseError::fail("not a scalar"));
                    };
                    let rows: Vec<Option<f32>> = rows.iter().copied().map(Some).collect();
                    prop_assert_eq!(rows, expected, "{}", text);
                }
                Err(RunError::Value(bad)) => {
                    let first = expected.iter().position(Option::is_none);
                    prop_assert_eq!(Some(bad.element), first, "{}", text);
                }
                Err(other) => return Err(TestCaseError::fail(format!("{text}: {other}"))),
            }
            Ok(())
        })
        .unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn one_number_and_a_batch_have_the_same_bits() {
    let config = ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() };
    // A param cannot read attributes, so a control takes the role of `P`.
    let controls = [("strength", Width::Scalar), ("P", Width::Vec3)];
    let scope = Scope { controls: &controls };
    TestRunner::new(config)
        .run(&scalar(), |tree| {
            let row = P_ROWS[0].map(f64::from);
            let numbers = [0.75, row[0], row[1], row[2]];
            let expr = Expr::parse(&print(&tree), &scope).map_err(|fault| TestCaseError::fail(fault.to_string()))?;
            let found = expr.eval(&Env { controls: &numbers, ..ENV });
            let expected = walk(&tree, P_ROWS[0]).scalar();
            let same = found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan();
            prop_assert!(same, "{} is {found}, not {expected}", print(&tree));
            Ok(())
        })
        .unwrap_or_else(|error| panic!("{error}"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let text = String::from_utf8_lossy(&bytes);
        let _ = Expr::parse(&text, &SCOPE);
        let _ = Program::parse(&text, &SCOPE);
    }

    #[test]
    fn arbitrary_tokens_never_panic(
        words in prop::collection::vec(
            prop::sample::select(vec![
                "P", ".x", ".w", "time", "let", "a", "=", "+=", "(", ")", ",", "+", "-", "*", "^", "?",
                ":", "<", "==", "&&", "!", "1", "0.5", "sin(", "vec(", "noise(", "clamp(", "\n", ";",
                "@P", "//", "orient", "id", "é", "&",
            ]),
            0..40,
        )
    ) {
        let text = words.join(" ");
        let _ = Expr::parse(&text, &SCOPE);
        if let Ok(program) = Program::parse(&text, &SCOPE) {
            let p = Column::new(P_ROWS.to_vec());
            let _ = program.run(&ENV, &[("P", &p)], P_ROWS.len());
        }
    }
}
