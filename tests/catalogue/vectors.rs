//! One mathematics: sums, products and lengths of three-vectors, and products of quaternions, are defined in
//! `numerics::vector` and nowhere else.

use std::collections::BTreeSet;

use super::tokens::{Token, tokens};
use super::{root, sources};

/// The one file that may define them.
const VECTOR: &str = "numerics/src/vector.rs";

/// Forms that other files have, and why they may.
const EXEMPT: [(&str, &str, &str); 11] = [
    ("conformance/src/samples.rs", "|X| X * X).sum::<f32>().sqrt()", "of a quaternion"),
    ("engine/src/geometry/volume.rs", "[0, 1, 2].map(|K| A[K] - B[K])", "numbers of cells"),
    ("numerics/src/closest_point.rs", "A[0] * B[0] + A[1] * B[1] + A[2] * B[2]", "a mean of vectors"),
    ("kernels/liquid/src/level_set/mod.rs", "[0, 1, 2].map(|K| A[K] - B[K])", "numbers of cells"),
    ("kernels/liquid/src/level_set/mod.rs", "[0, 1, 2].map(|K| A[K] + B[K])", "numbers of cells"),
    ("kernels/bodies/src/mass_spring/galerkin.rs", "from_fn(|K| A[K] - B[K])", "six rigid modes"),
    ("kernels/curves/src/attach/rotation.rs", "|X| X * X).sum::<f64>().sqrt()", "of a matrix, row by row"),
    ("kernels/curves/src/deform/turns.rs", "X * X + Y * Y + Z * Z", "of four quaternions side by side"),
    ("kernels/curves/src/jiggle/tests/oscillator.rs", "from_fn(|K| A[K] + B[K])", "4 × 4 matrices"),
    ("numerics/src/noise/mod.rs", "|X| X * X).sum::<f64>().sqrt()", "of any number of octaves"),
    ("tests/wind/accuracy/swing.rs", "from_fn(|K| A[K] + B[K])", "4 × 4 matrices"),
];

/// What functions of three-vectors and quaternions are called.
const NAMES: [&str; 20] = [
    "add",
    "compose",
    "cross",
    "diff",
    "difference",
    "dot",
    "hamilton",
    "length",
    "minus",
    "mul",
    "multiply",
    "norm",
    "normalize",
    "normalized",
    "plus",
    "product",
    "scale",
    "sub",
    "unit",
    "unit_vector",
];

/// How three-vectors and quaternions are written as the type of a parameter.
const VECTORS: [&str; 11] = [
    "[f32; 3]",
    "[f64; 3]",
    "[T; 3]",
    "[f32; 4]",
    "[f64; 4]",
    "[T; 4]",
    "Vec3",
    "DVec3",
    "Vector3<f64>",
    "Quat",
    "DQuat",
];

/// Forms of what `numerics::vector` defines, and what to write instead. A capital letter is any operand.
const FORMS: [(&str, &str); 19] = [
    ("A[1] * B[2] - A[2] * B[1]", "cross"),
    ("A.y * B.z - A.z * B.y", "cross"),
    ("A[(K + 1) % 3] * B[(K + 2) % 3]", "cross"),
    ("A[0] * B[0] + A[1] * B[1] + A[2] * B[2]", "dot"),
    ("A.x * B.x + A.y * B.y + A.z * B.z", "dot"),
    ("X * X + Y * Y + Z * Z", "dot"),
    ("(0..3).map(|K| A[K] * B[K]).sum::<f32>", "dot"),
    ("(0..3).map(|K| A[K] * B[K]).sum::<f64>", "dot"),
    ("|X| X * X).sum::<f32>().sqrt()", "length"),
    ("|X| X * X).sum::<f64>().sqrt()", "length"),
    ("(A[K] - B[K]) * (A[K] - B[K])", "length"),
    ("from_fn(|K| A[K] - B[K])", "sub"),
    ("[0, 1, 2].map(|K| A[K] - B[K])", "sub"),
    ("[A[0] - B[0], A[1] - B[1], A[2] - B[2]]", "sub"),
    ("from_fn(|K| A[K] + B[K])", "add"),
    ("[0, 1, 2].map(|K| A[K] + B[K])", "add"),
    ("[A[0] + B[0], A[1] + B[1], A[2] + B[2]]", "add"),
    ("from_fn(|K| f64::from(A[K]))", "to_f64"),
    ("W * X + A * V + B * Z - C * Y, W * Y - A * Z + B * V + C * X", "compose"),
];

/// What a source defines by itself: names of functions and closures, and forms.
fn defined(source: &str) -> Vec<String> {
    let forms = FORMS.map(|(form, _)| (tokens(form), form));
    let tokens = tokens(source);
    let mut vectors: Vec<Vec<Token>> = VECTORS.iter().map(|name| super::tokens::tokens(name)).collect();
    vectors.extend(aliases(&tokens, &vectors));
    let mut found = Vec::new();
    for at in 0..tokens.len() {
        let rest = &tokens[at..];
        found.extend(function(rest, &vectors).filter(|name| NAMES.contains(name)));
        // A term of a longer sum, or the last field of an operand.
        let is_part = at > 0 && ['+', '.'].map(Token::Mark).contains(&tokens[at - 1]);
        // Most tokens begin no form: an operand goes on with a field, an index or a product.
        let is_operand = rest[0].word().is_some() && matches!(rest.get(1), Some(Token::Mark('.' | '[' | '*')));
        let begins = |form: &[Token]| if operand(&form[0]).is_some() { is_operand } else { form[0] == rest[0] };
        let form = forms.iter().filter(|(form, _)| begins(form)).find(|(form, _)| {
            matches(form, rest, &mut Vec::new()).is_some_and(|end| rest.get(end) != Some(&Token::Mark('+')))
        });
        found.extend(form.filter(|_| !is_part).map(|(_, form)| *form));
    }
    found.into_iter().map(str::to_owned).collect()
}

/// Names that a source gives to a three-vector's type.
fn aliases(tokens: &[Token], vectors: &[Vec<Token>]) -> Vec<Vec<Token>> {
    let named = tokens.windows(3).enumerate().filter(|(_, three)| three[0].is("type") && three[2] == Token::Mark('='));
    named
        .filter(|(at, _)| vectors.iter().any(|vector| tokens[at + 3..].starts_with(vector)))
        .map(|(_, three)| vec![three[1].clone()])
        .collect()
}

/// The name of the function or closure that begins here, if it takes vectors, and besides them numbers only.
fn function<'t>(tokens: &'t [Token], vectors: &[Vec<Token>]) -> Option<&'t str> {
    let name = tokens.get(1)?.word()?;
    let parameters = if tokens[0].is("fn") {
        let open = tokens.iter().position(|token| *token == Token::Mark('('))?;
        closed(&tokens[open..])
            .filter(|parameters| !parameters.starts_with(&[Token::Mark('&'), Token::Word("mut".into())]))?
    } else if tokens[0].is("let") && tokens[2..].first() == Some(&Token::Mark('=')) {
        let open = 3 + usize::from(tokens.get(3)?.is("move"));
        let inside = tokens.get(open..)?.strip_prefix(&[Token::Mark('|')])?;
        &inside[..inside.iter().position(|token| *token == Token::Mark('|'))?]
    } else {
        return None;
    };
    let (mut takes_vectors, mut takes_others) = (false, false);
    let types = parameters.iter().enumerate().filter(|(_, token)| **token == Token::Mark(':'));
    for (colon, _) in types {
        let of = &parameters[colon + 1..];
        let of = of.strip_prefix(&[Token::Mark('&')]).unwrap_or(of);
        let is_vector = vectors.iter().any(|vector| of.starts_with(vector));
        takes_vectors |= is_vector;
        takes_others |=
            !is_vector && !["f32", "f64", "T"].iter().any(|number| of.first().is_some_and(|t| t.is(number)));
    }
    (takes_vectors && !takes_others).then_some(name)
}

/// What parentheses that open here contain.
fn closed(tokens: &[Token]) -> Option<&[Token]> {
    let mut depth = 0;
    let end = tokens.iter().position(|token| {
        depth += i32::from(*token == Token::Mark('(')) - i32::from(*token == Token::Mark(')'));
        depth == 0
    })?;
    Some(&tokens[1..end])
}

/// The letter of a form that stands for an operand.
fn operand(token: &Token) -> Option<char> {
    token.word().and_then(|word| word.parse().ok()).filter(char::is_ascii_uppercase)
}

/// Where the form that begins here ends; each capital letter stands for one operand wherever it occurs.
fn matches<'t>(form: &[Token], tokens: &'t [Token], bound: &mut Vec<(char, &'t [Token])>) -> Option<usize> {
    let Some((first, rest)) = form.split_first() else { return Some(0) };
    let Some(letter) = operand(first) else {
        return (tokens.first()? == first).then(|| matches(rest, &tokens[1..], bound))?.map(|end| end + 1);
    };
    if let Some((_, operand)) = bound.iter().find(|(known, _)| *known == letter) {
        let length = operand.len();
        return tokens.starts_with(operand).then(|| matches(rest, &tokens[length..], bound))?.map(|end| end + length);
    }
    operands(tokens).into_iter().find_map(|length| {
        bound.push((letter, &tokens[..length]));
        let end = matches(rest, &tokens[length..], bound);
        if end.is_none() {
            bound.pop();
        }
        end.map(|end| end + length)
    })
}

/// The lengths of the operands that begin here: a name, then fields and indices of it.
fn operands(tokens: &[Token]) -> Vec<usize> {
    let is_name = |at: usize| tokens.get(at).is_some_and(|token| token.word().is_some());
    let mut lengths = Vec::new();
    let mut length = usize::from(is_name(0));
    // Three are enough for `self.a[k]`.
    while length > 0 && lengths.len() < 3 {
        lengths.push(length);
        let mark = |at: usize, mark: char| tokens.get(at) == Some(&Token::Mark(mark));
        if mark(length, '.') && is_name(length + 1) {
            length += 2;
        } else if mark(length, '[') && is_name(length + 1) && mark(length + 2, ']') {
            length += 3;
        } else {
            break;
        }
    }
    lengths
}

#[test]
fn products_and_lengths_of_three_vectors_are_defined_once() {
    let folders = ["benches", "conformance", "docs", "engine", "formats", "kernels", "nodes", "numerics", "preview"];
    let folders = folders.iter().chain(&["src", "studies", "tests", "xtask"]);
    let (mut doubles, mut exempt, mut vector) = (Vec::new(), BTreeSet::new(), Vec::new());
    for (file, source) in folders.flat_map(|folder| sources(&root().join(folder))) {
        let file = file.strip_prefix(root()).unwrap().display().to_string();
        for found in defined(&source) {
            match EXEMPT.iter().find(|(exempt, form, _)| *exempt == file && *form == found) {
                _ if file == VECTOR => vector.push(found),
                Some(known) => drop(exempt.insert(known)),
                None => {
                    let instead = FORMS.iter().find(|(form, _)| *form == found).map_or(&*found, |(_, instead)| instead);
                    doubles.push(format!("`{instead}` instead of `{found}` in {file}"));
                }
            }
        }
    }
    assert!(doubles.is_empty(), "use of `numerics::vector`:\n  {}", doubles.join("\n  "));
    assert_eq!(exempt, EXEMPT.iter().collect(), "exempt without need");
    for name in ["add", "compose", "cross", "dot", "length", "scale", "sub", "unit"] {
        assert_eq!(vector.iter().filter(|found| *found == name).count(), 1, "{name}");
    }
}

#[test]
fn definitions_are_found_in_all_their_forms() {
    let source = "pub(crate) fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {}
        fn unit([x, y, z]: [f64; 3]) -> [f64; 3] {}
        let cross = |a: DVec3, b: &DVec3| a.cross(b);
        type V = [f64; 3];
        fn add(a: V, b: V, share: f64) -> V {}
        fn product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {}
        // No vectors, or more than that:
        fn length(points: &[Vec3]) -> f64 {}
        fn dot(x: f32) -> Geometry {}
        let norm = normal.norm();
        fn length(&self, metres: f32) -> f32 {}
        fn add(&mut self, at: DVec3, triangle: u32) {}";
    assert_eq!(defined(source), ["dot", "unit", "cross", "add", "product"]);
    for (form, _) in FORMS {
        let written = form.replace('A', "self.a[k]").replace('B', "b").replace(['K', 'X'], "i");
        assert_eq!(defined(&format!("let c = {written};")), [form], "{written}");
    }
    // Four squares, different operands, a comment.
    assert_eq!(defined("w * w + x * x + y * y + z * z; // x * x + y * y + z * z"), [""; 0]);
    assert_eq!(defined("a[1] * b[2] - b[2] * a[1]"), [""; 0]);
}
