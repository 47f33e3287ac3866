//! The operators: how tightly each holds, and what it does.

use super::super::ast::Operator;
use super::super::code::Binary;
use super::super::lexer::Symbol;

/// How tightly an operator holds its operands, loosest first.
pub(super) type Power = u8;
pub(super) const LOOSEST: Power = 0;
pub(super) const CONDITION: Power = 1;
pub(super) const EQUALITY: Power = 4;
pub(super) const ORDER: Power = 5;
pub(super) const SIGN: Power = 8;
pub(super) const POWER: Power = 9;

pub(super) fn infix(symbol: Symbol) -> Option<(Power, Operator)> {
    let arithmetic = |op, text| Operator { text, op, swapped: false, on_vectors: true };
    let logic = |op, text| Operator { text, op, swapped: false, on_vectors: false };
    let swapped = |op, text| Operator { text, op, swapped: true, on_vectors: false };
    Some(match symbol {
        Symbol::Or => (2, logic(Binary::Or, "||")),
        Symbol::And => (3, logic(Binary::And, "&&")),
        Symbol::Equal => (EQUALITY, logic(Binary::Equal, "==")),
        Symbol::NotEqual => (EQUALITY, logic(Binary::NotEqual, "!=")),
        Symbol::Less => (ORDER, logic(Binary::Less, "<")),
        Symbol::LessEqual => (ORDER, logic(Binary::LessEqual, "<=")),
        Symbol::Greater => (ORDER, swapped(Binary::Less, ">")),
        Symbol::GreaterEqual => (ORDER, swapped(Binary::LessEqual, ">=")),
        Symbol::Plus | Symbol::AddAssign => (6, arithmetic(Binary::Add, "+")),
        Symbol::Minus | Symbol::SubtractAssign => (6, arithmetic(Binary::Subtract, "-")),
        Symbol::Star | Symbol::MultiplyAssign => (7, arithmetic(Binary::Multiply, "*")),
        Symbol::Slash | Symbol::DivideAssign => (7, arithmetic(Binary::Divide, "/")),
        Symbol::Percent => (7, arithmetic(Binary::Modulo, "%")),
        Symbol::Caret => (POWER, arithmetic(Binary::Power, "^")),
        _ => return None,
    })
}

pub(super) fn is_assignment(symbol: Symbol) -> bool {
    matches!(
        symbol,
        Symbol::Assign | Symbol::AddAssign | Symbol::SubtractAssign | Symbol::MultiplyAssign | Symbol::DivideAssign
    )
}
