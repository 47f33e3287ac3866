//! Parses the assignments of a program.

use super::super::ast::{Node, NodeId, Statement, Target};
use super::super::error::{ExprError, Position};
use super::super::functions;
use super::super::lexer::{Symbol, Token, TokenKind};
use super::Parser;
use super::names::{RESERVED, unexpected};
use super::operators::{LOWEST, infix, is_assignment};

/// The target of a statement while its value is parsed.
#[derive(Clone, Copy)]
enum Assigned<'a> {
    Local(&'a str),
    Attribute(u32, Option<u32>),
}

impl<'a> Parser<'a> {
    /// Parses one statement and the end of its line; false at the end of the text.
    pub(super) fn statement(&mut self) -> Result<bool, ExprError> {
        let end = |token: &Token<'_>| {
            let semicolon = TokenKind::Symbol(Symbol::Semicolon);
            token.kind == TokenKind::Newline || token.kind == semicolon
        };
        let mut first = self.next()?;
        while end(&first) {
            first = self.next()?;
        }
        let (target, assign) = match first.kind {
            TokenKind::End => return Ok(false),
            TokenKind::Name("let") => {
                let name = self.next()?;
                let TokenKind::Name(text) = name.kind else {
                    return Err(unexpected(&name, "a name after `let`"));
                };
                self.check_free(text, name.position)?;
                let assign = self.next()?;
                if assign.kind != TokenKind::Symbol(Symbol::Assign) {
                    return Err(unexpected(&assign, "`=`"));
                }
                (Assigned::Local(text), assign)
            }
            TokenKind::Name(text) | TokenKind::Attribute(text) => {
                let component = match self.next_if(Symbol::Dot)? {
                    Some(_) => Some(self.component_name()?),
                    None => None,
                };
                let assign = self.next()?;
                if !matches!(assign.kind, TokenKind::Symbol(symbol) if is_assignment(symbol)) {
                    let fault = unexpected(&assign, "`=`");
                    return Err(fault.hint("a line is an assignment: `name = expression`"));
                }
                if first.kind == TokenKind::Name(text) {
                    self.check_assignable(text, first.position)?;
                }
                (Assigned::Attribute(self.attribute(text), component), assign)
            }
            _ => {
                let fault = unexpected(&first, "the name of an attribute");
                return Err(fault.hint("a line is an assignment: `name = expression`"));
            }
        };

        let value = match (target, assign.kind) {
            (Assigned::Attribute(attribute, component), TokenKind::Symbol(symbol)) if symbol != Symbol::Assign => {
                self.updated(attribute, component, symbol, first.position, assign.position)?
            }
            _ => self.expression(LOWEST)?,
        };
        let last = self.next()?;
        if !end(&last) && last.kind != TokenKind::End {
            return Err(unexpected(&last, "an operator or the end of the line"));
        }

        let target = match target {
            Assigned::Attribute(attribute, component) => Target::Attribute { attribute, component },
            Assigned::Local(name) => {
                if self.locals.insert(name, value).is_none() {
                    self.ast.locals.push(name.to_owned());
                }
                Target::Local
            }
        };
        self.ast.statements.push(Statement { target, position: first.position, value });
        Ok(true)
    }

    /// The value of `target symbol expression`, such as `P.y += 1`.
    fn updated(
        &mut self,
        attribute: u32,
        component: Option<u32>,
        symbol: Symbol,
        target: Position,
        position: Position,
    ) -> Result<NodeId, ExprError> {
        let mut old = self.push(Node::Attribute(attribute), target)?;
        if let Some(component) = component {
            old = self.push(Node::Component(old, component), target)?;
        }
        let change = self.expression(LOWEST)?;
        match infix(symbol) {
            Some((_, operator)) => self.push(Node::Binary(operator, old, change), position),
            None => Ok(change),
        }
    }

    /// Continues after a fault at the next line.
    pub(super) fn recover(&mut self) {
        let parsed = self.ast.statements.last().map_or(0, |last| last.value as usize + 1);
        self.ast.nodes.truncate(parsed);
        self.ast.positions.truncate(parsed);
        (self.open, self.depth) = (0, 0);
        let stop = |kind| matches!(kind, TokenKind::Newline | TokenKind::End);
        while !self.line_ended && !matches!(self.peek(), Ok(token) if stop(token.kind)) {
            self.peeked = None;
        }
    }

    /// Refuses a name that is reserved, a function or a control.
    fn check_free(&self, name: &str, position: Position) -> Result<(), ExprError> {
        let fact = if RESERVED.contains(&name) {
            format!("`{name}` is reserved and cannot be assigned")
        } else if functions::find(name).is_some() {
            format!("`{name}` is a function and cannot be assigned")
        } else if self.scope.control(name).is_some() {
            format!("`{name}` is a control and cannot be assigned")
        } else {
            return Ok(());
        };
        Err(position.fault(fact))
    }

    fn check_assignable(&self, name: &str, position: Position) -> Result<(), ExprError> {
        let attribute = format!("for an attribute with that name, write `@{name}`");
        self.check_free(name, position).map_err(|fault| fault.hint(attribute.as_str()))?;
        if self.locals.contains_key(name) {
            let fault = position.fault(format!("`{name}` is a `let` value and cannot be assigned"));
            return Err(fault.hint(format!("to redefine it, write `let {name} = …`; {attribute}")));
        }
        Ok(())
    }
}
