//! The binary operators: precedence and operation.

use super::super::ast::Operator;
use super::super::code::Binary;
use super::super::lexer::Symbol;

/// The precedence of an operator; a higher one binds more tightly.
pub(super) type Precedence = u8;
pub(super) const LOWEST: Precedence = 0;
pub(super) const CONDITION: Precedence = 1;
pub(super) const EQUALITY: Precedence = 4;
pub(super) const ORDER: Precedence = 5;
pub(super) const SIGN: Precedence = 8;
pub(super) const POWER: Precedence = 9;

pub(super) fn infix(symbol: Symbol) -> Option<(Precedence, Operator)> {
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
