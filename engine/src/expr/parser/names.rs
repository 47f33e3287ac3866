//! Resolves names, and reports unknown ones.

use super::super::ast::Node;
use super::super::code::Input;
use super::super::error::{ExprError, Position};
use super::super::functions::{self, FOREIGN, FUNCTIONS, Function};
use super::super::lexer::{Symbol, Token, TokenKind, is_name};
use super::super::suggest::{listed, shortened};
use super::{Language, Parser};
use crate::geometry::fixed_type;

/// Names with a fixed meaning in the language, which controls and `let` values must not have and which attributes can
/// only have with `@`.
pub const RESERVED: [&str; 8] = ["frame", "time", "fps", "seed", "pi", "i", "count", "let"];

impl<'a> Parser<'a> {
    /// Resolves a name: names of the language first, then `let`, controls, attributes.
    pub(super) fn named(&mut self, name: &'a str, position: Position) -> Result<Node, ExprError> {
        let in_program = self.language == Language::Program;
        Ok(match name {
            "frame" => Node::Input(Input::Frame),
            "time" => Node::Input(Input::Time),
            "fps" => Node::Input(Input::Fps),
            "seed" => Node::Input(Input::Seed),
            "pi" => Node::Number(std::f64::consts::PI),
            "i" if in_program => Node::Input(Input::Index),
            "count" if in_program => Node::Input(Input::Count),
            _ => {
                if let Some(value) = self.locals.get(name) {
                    Node::Local(*value)
                } else if let Some(control) = self.scope.control(name) {
                    Node::Control(control as u32)
                } else if let Some(function) = functions::find(name) {
                    let fault = position.fault(format!("`{name}` is a function"));
                    return Err(fault.hint(format!("write `{}`", function.usage)));
                } else if in_program && name != "let" {
                    Node::Attribute(self.attribute(name))
                } else {
                    return Err(self.unknown_name(name, position));
                }
            }
        })
    }

    pub(super) fn attribute_node(&mut self, name: &'a str, position: Position) -> Result<Node, ExprError> {
        if self.language == Language::Program {
            return Ok(Node::Attribute(self.attribute(name)));
        }
        let fault = position.fault(format!("the attribute `{}` cannot be read here", shortened(name)));
        Err(fault.hint(
            "only Attribute_Expr reads attributes; a param can be masked by one: {\"value\": …, \"attribute\": \"…\"}",
        ))
    }

    fn unknown_name(&self, name: &str, position: Position) -> ExprError {
        let own = RESERVED[..5].iter().copied();
        let controls = self.scope.controls.iter().map(|(name, _)| *name).filter(|name| is_name(name));
        let candidates: Vec<&str> = own.chain(controls).collect();
        let listed = || listed(&candidates).map(|names| format!("known names: {names}"));
        let fault = position.fault(format!("unknown name `{}`", shortened(name)));
        if matches!(name, "i" | "count") || fixed_type(name).is_some() {
            return fault.hint("attributes, `i` and `count` can only be used in Attribute_Expr");
        }
        foreign(fault, name, candidates.iter().copied(), listed)
    }

    pub(super) fn unknown_function(&self, name: &str, position: Position) -> ExprError {
        let is_value = RESERVED.contains(&name)
            || self.locals.contains_key(name)
            || self.scope.control(name).is_some()
            || self.attributes.contains_key(name);
        if is_value {
            let name = shortened(name);
            let fault = position.fault(format!("`{name}` is a value, not a function"));
            return fault.hint(format!("to multiply, write `{name}*(…)`"));
        }
        let fault = position.fault(format!("there is no function `{}`", shortened(name)));
        foreign(fault, name, FUNCTIONS.iter().map(|function| function.name), || None)
    }
}

/// Adds a hint: the equivalent of a name of another language, or the most similar known name.
fn foreign<'n>(
    fault: ExprError,
    name: &str,
    candidates: impl IntoIterator<Item = &'n str>,
    otherwise: impl FnOnce() -> Option<String>,
) -> ExprError {
    match FOREIGN.iter().find(|(theirs, _)| *theirs == name) {
        Some((_, ours)) => fault.hint(format!("write `{ours}`")),
        None => fault.suggest(name, candidates, otherwise),
    }
}

pub(super) fn check_count(function: &Function, given: usize, position: Position) -> Result<(), ExprError> {
    let (fewest, most) = function.arguments;
    if (fewest..=most).contains(&given) {
        return Ok(());
    }
    let wanted = match (fewest, most) {
        (1, 1) => "1 argument".to_owned(),
        _ if fewest == most => format!("{fewest} arguments"),
        _ => format!("{fewest} to {most} arguments"),
    };
    let fault = position.fault(format!("`{}` takes {wanted}, not {given}", function.name));
    Err(fault.hint(format!("write `{}`", function.usage)))
}

pub(super) fn unexpected(token: &Token<'_>, expected: &str) -> ExprError {
    let found = match token.kind {
        TokenKind::End => "the end".to_owned(),
        TokenKind::Newline => "the end of the line".to_owned(),
        _ => format!("`{}`", shortened(token.text)),
    };
    let fault = token.position.fault(format!("expected {expected}, found {found}"));
    let after_value = expected.starts_with("an operator");
    match token.kind {
        TokenKind::Symbol(Symbol::Assign) if expected.ends_with("after `let`") => fault.hint("write `let name = …`"),
        TokenKind::Symbol(Symbol::Assign) => fault.hint("to compare, write `==`"),
        TokenKind::Number(_) | TokenKind::Name(_) | TokenKind::Attribute(_) | TokenKind::Symbol(Symbol::Open)
            if after_value =>
        {
            fault.hint("to multiply, write `*`")
        }
        TokenKind::Newline => fault.hint("to continue on the next line, enclose the expression in `(` and `)`"),
        _ => fault,
    }
}
