//! Whether `pi` is a term of a value: then the value is in radians, whatever unit was meant.

use super::ast::{Ast, Node};
use super::code::{Binary, Unary};
use super::functions::{Each, FunctionKind};

/// Whether `pi` reaches the value of the last node as a term or factor. Not through a function such as `sin` or
/// `degrees`, whose result has another unit, nor as a divisor, which converts to degrees.
pub(super) fn is_term(ast: &Ast) -> bool {
    let mut terms: Vec<bool> = Vec::with_capacity(ast.nodes.len());
    for node in &ast.nodes {
        let of = |id: &u32| terms.get(*id as usize).copied().unwrap_or(false);
        let term = match node {
            Node::Number(number) => *number == std::f64::consts::PI,
            Node::Input(_) | Node::Control(_) | Node::Attribute(_) => false,
            Node::Local(value) | Node::Unary(_, value) | Node::Component(value, _) => of(value),
            Node::Binary(operator, left, right) => match operator.op {
                Binary::Divide => of(left) && !of(right),
                _ => of(left) || of(right),
            },
            Node::Select(_, yes, no) => of(yes) || of(no),
            Node::Call(function, first, count) => {
                let keeps_unit = matches!(
                    function.kind,
                    FunctionKind::Vector
                        | FunctionKind::Each(
                            Each::Binary(Binary::Min | Binary::Max) | Each::Unary(Unary::Abs) | Each::Clamp | Each::Mix
                        )
                );
                let arguments = ast.arguments.iter().skip(*first as usize).take(*count as usize);
                keeps_unit && arguments.into_iter().any(of)
            }
        };
        terms.push(term);
    }
    terms.last().copied().unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use crate::expr::{Expr, Scope};

    #[test]
    fn pi_is_a_term_where_it_reaches_the_value_in_radians() {
        let is_term = |text: &str| Expr::parse(text, &Scope::default()).unwrap().has_pi_as_term();
        for text in ["pi", "pi/2", "-pi*time", "frame < 3 ? 0 : pi", "clamp(pi, 0, 90)", "mix(0, 2*pi, time)"] {
            assert!(is_term(text), "{text}");
        }
        let has_vector = |text: &str| Expr::parse_components(text, &Scope::default()).unwrap()[0].has_pi_as_term();
        assert!(has_vector("vec(0, pi*time, 0)") && !has_vector("vec(0, sin(pi*time), 0)"));
        for text in ["30*sin(2*pi*time)", "degrees(pi/2)", "2*180/pi", "90", "atan2(1, time)*180/pi", "pi/pi"] {
            assert!(!is_term(text), "{text}");
        }
    }
}
