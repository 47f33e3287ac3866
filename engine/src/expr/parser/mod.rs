//! Parses a text into nodes by operator precedence (Pratt).
//!
//! Promise: any string gives nodes or faults with positions, never a panic; time is linear in the length of the text
//! and the stack is bounded by [`MAX_DEPTH`]. A program reports the first fault of every line, up to [`MAX_FAULTS`].
//! Limit: widths are not checked here but in `check`.

mod names;
mod operators;
mod statements;

use std::collections::BTreeMap;

use super::Scope;
use super::ast::{Ast, COMPONENTS, Node, NodeId, Statement, Target};
use super::code::Unary;
use super::error::{ExprError, Position};
use super::functions;
use super::lexer::{Lexer, Symbol, Token, TokenKind};
pub use names::RESERVED;
use names::{check_count, unexpected};
use operators::{CONDITION, EQUALITY, LOWEST, ORDER, POWER, Precedence, SIGN, infix, is_assignment};

/// Longest text, in bytes.
pub(super) const MAX_TEXT: usize = 1 << 20;
/// The largest number of numbers, names, operators and calls in a text.
pub(super) const MAX_NODES: usize = 4096;
/// Deepest nesting of brackets, signs, powers and conditions. A level takes some hundred bytes of stack; typical texts
/// have about ten.
pub(super) const MAX_DEPTH: usize = 200;
/// The largest number of faults that a program reports.
pub(super) const MAX_FAULTS: usize = 50;

/// Parses an expression: no attributes, one value for `target`.
pub(super) fn expression(text: &str, scope: &Scope<'_>, target: Target) -> Result<Ast, ExprError> {
    let mut parser = Parser::new(text, scope, Language::Expression)?;
    // In an expression a newline is a blank, as between brackets.
    parser.open = 1;
    if parser.peek()?.kind == TokenKind::End {
        return Err(Position::START.fault("the expression is empty"));
    }
    let value = parser.expression(LOWEST)?;
    let end = parser.next()?;
    if end.kind != TokenKind::End {
        return Err(unexpected(&end, "an operator or the end"));
    }
    let position = Position::START;
    parser.ast.statements.push(Statement { target, position, value });
    Ok(parser.ast)
}

/// Parses a program: assignments, one per line or separated by `;`.
pub(super) fn program(text: &str, scope: &Scope<'_>) -> Result<Ast, Vec<ExprError>> {
    let mut parser = Parser::new(text, scope, Language::Program).map_err(|fault| vec![fault])?;
    let mut faults = Vec::new();
    loop {
        match parser.statement() {
            Ok(true) => {}
            Ok(false) => break,
            Err(fault) => {
                faults.push(fault);
                if parser.ast.nodes.len() >= MAX_NODES || faults.len() >= MAX_FAULTS {
                    break;
                }
                parser.recover();
            }
        }
    }
    if faults.is_empty() { Ok(parser.ast) } else { Err(faults) }
}

#[derive(Clone, Copy, PartialEq)]
enum Language {
    Expression,
    Program,
}

struct Parser<'a> {
    lexer: Lexer<'a>,
    peeked: Option<Token<'a>>,
    /// Whether the last token taken ended a line.
    line_ended: bool,
    scope: &'a Scope<'a>,
    language: Language,
    /// Open brackets at the next token; inside brackets a newline is a blank.
    open: usize,
    depth: usize,
    ast: Ast,
    attributes: BTreeMap<&'a str, u32>,
    locals: BTreeMap<&'a str, NodeId>,
}

impl<'a> Parser<'a> {
    fn new(text: &'a str, scope: &'a Scope<'a>, language: Language) -> Result<Self, ExprError> {
        if text.len() > MAX_TEXT {
            let fact = format!("the text has {} bytes, more than {MAX_TEXT}", text.len());
            return Err(Position::START.fault(fact));
        }
        Ok(Parser {
            lexer: Lexer::new(text),
            peeked: None,
            line_ended: false,
            scope,
            language,
            open: 0,
            depth: 0,
            ast: Ast::default(),
            attributes: BTreeMap::new(),
            locals: BTreeMap::new(),
        })
    }

    fn peek(&mut self) -> Result<Token<'a>, ExprError> {
        loop {
            let token = match self.peeked {
                Some(token) => token,
                None => self.lexer.next()?,
            };
            self.peeked = Some(token);
            if token.kind != TokenKind::Newline || self.open == 0 {
                return Ok(token);
            }
            self.peeked = None;
        }
    }

    fn next(&mut self) -> Result<Token<'a>, ExprError> {
        self.line_ended = false;
        let token = self.peek()?;
        self.peeked = None;
        self.line_ended = token.kind == TokenKind::Newline;
        Ok(token)
    }

    fn next_if(&mut self, symbol: Symbol) -> Result<Option<Token<'a>>, ExprError> {
        let found = self.peek()?.kind == TokenKind::Symbol(symbol);
        if found { self.next().map(Some) } else { Ok(None) }
    }

    fn open(&mut self, symbol: Symbol) -> Result<Option<Token<'a>>, ExprError> {
        let found = self.next_if(symbol)?;
        self.open += usize::from(found.is_some());
        Ok(found)
    }

    /// Consumes the `)` that closes `opened`.
    fn close(&mut self, opened: &Token<'a>, expected: &str) -> Result<(), ExprError> {
        let token = self.next()?;
        if token.kind != TokenKind::Symbol(Symbol::Close) {
            let Position { line, column } = opened.position;
            let here = if line == token.position.line {
                format!("column {column}")
            } else {
                format!("line {line}, column {column}")
            };
            let fault = unexpected(&token, expected);
            return Err(match fault.hint {
                None => fault.hint(format!("the `(` at {here} is not closed")),
                Some(_) => fault,
            });
        }
        self.open -= 1;
        Ok(())
    }

    fn push(&mut self, node: Node, position: Position) -> Result<NodeId, ExprError> {
        if self.ast.nodes.len() >= MAX_NODES {
            let fact = format!("the text has more than {MAX_NODES} numbers, names and operators");
            return Err(position.fault(fact));
        }
        self.ast.nodes.push(node);
        self.ast.positions.push(position);
        Ok((self.ast.nodes.len() - 1) as NodeId)
    }

    fn attribute(&mut self, name: &'a str) -> u32 {
        let attributes = &mut self.ast.attributes;
        *self.attributes.entry(name).or_insert_with(|| {
            attributes.push(name.to_owned());
            (attributes.len() - 1) as u32
        })
    }

    /// Parses an expression of operators with at least the precedence `lowest`.
    fn expression(&mut self, lowest: Precedence) -> Result<NodeId, ExprError> {
        let start = self.peek()?.position;
        if self.depth == MAX_DEPTH {
            let fault = start.fault(format!("nested deeper than {MAX_DEPTH} levels"));
            return Err(match self.language {
                Language::Program => fault.hint("split it with `let`"),
                Language::Expression => fault,
            });
        }
        self.depth += 1;
        let mut left = self.operand()?;
        let mut compared = None;
        loop {
            let token = self.peek()?;
            let TokenKind::Symbol(symbol) = token.kind else { break };
            if symbol == Symbol::Question && CONDITION >= lowest {
                left = self.condition(left)?;
                continue;
            }
            let Some((precedence, operator)) = infix(symbol) else { break };
            if precedence < lowest || is_assignment(symbol) {
                break;
            }
            if precedence == EQUALITY || precedence == ORDER {
                if compared == Some(precedence) {
                    let fault = token.position.fault("comparisons cannot be chained");
                    return Err(fault.hint("write `a < b && b < c`"));
                }
                compared = Some(precedence);
            }
            self.next()?;
            // `^` is right-associative, and its exponent may have a sign: 2^-3^2 = 2^(-(3^2)).
            let right = self.expression(if precedence == POWER { SIGN } else { precedence + 1 })?;
            left = self.push(Node::Binary(operator, left, right), token.position)?;
        }
        self.depth -= 1;
        Ok(left)
    }

    /// The rest of `condition ? yes : no`, from the `?`.
    fn condition(&mut self, condition: NodeId) -> Result<NodeId, ExprError> {
        let question = self.next()?;
        let yes = self.expression(LOWEST)?;
        let colon = self.next()?;
        if colon.kind != TokenKind::Symbol(Symbol::Colon) {
            let fault = unexpected(&colon, "`:`");
            return Err(fault.hint("write `condition ? yes : no`"));
        }
        let no = self.expression(CONDITION)?;
        self.push(Node::Select(condition, yes, no), question.position)
    }

    /// Parses an operand with its signs and component accesses.
    fn operand(&mut self) -> Result<NodeId, ExprError> {
        if let Some(opened) = self.open(Symbol::Open)? {
            let inner = self.expression(LOWEST)?;
            self.close(&opened, "an operator or `)`")?;
            return self.components(inner);
        }
        let token = self.next()?;
        let node = match token.kind {
            TokenKind::Symbol(Symbol::Plus) => return self.expression(SIGN),
            TokenKind::Symbol(Symbol::Minus) => Node::Unary(Unary::Negate, self.expression(SIGN)?),
            TokenKind::Symbol(Symbol::Not) => Node::Unary(Unary::Not, self.expression(SIGN)?),
            TokenKind::Number(value) => Node::Number(value),
            TokenKind::Attribute(name) => self.attribute_node(name, token.position)?,
            TokenKind::Name(name) => match self.open(Symbol::Open)? {
                Some(opened) => self.call(name, token.position, &opened)?,
                None => self.named(name, token.position)?,
            },
            _ => return Err(unexpected(&token, "a value")),
        };
        let is_signed = matches!(node, Node::Unary(..));
        let id = self.push(node, token.position)?;
        if is_signed { Ok(id) } else { self.components(id) }
    }

    /// Parses any number of `.x` after an operand.
    fn components(&mut self, mut of: NodeId) -> Result<NodeId, ExprError> {
        while let Some(dot) = self.next_if(Symbol::Dot)? {
            let component = self.component_name()?;
            of = self.push(Node::Component(of, component), dot.position)?;
        }
        Ok(of)
    }

    fn component_name(&mut self) -> Result<u32, ExprError> {
        let token = self.next()?;
        if let TokenKind::Name(name) = token.kind {
            let colours = ["r", "g", "b", "a"];
            let matches = |k: &usize| COMPONENTS[*k] == name || colours[*k] == name;
            if let Some(k) = (0..COMPONENTS.len()).find(matches) {
                return Ok(k as u32);
            }
        }
        let hint = "components are `.x`, `.y`, `.z`, `.w`, or `.r`, `.g`, `.b`, `.a`";
        Err(unexpected(&token, "a component").hint(hint))
    }

    /// Parses a call after its `(`.
    fn call(&mut self, name: &str, position: Position, opened: &Token<'a>) -> Result<Node, ExprError> {
        let Some(function) = functions::find(name) else {
            return Err(self.unknown_function(name, position));
        };
        let mut arguments = Vec::new();
        if self.peek()?.kind != TokenKind::Symbol(Symbol::Close) {
            arguments.push(self.expression(LOWEST)?);
            while self.next_if(Symbol::Comma)?.is_some() {
                arguments.push(self.expression(LOWEST)?);
            }
        }
        self.close(opened, "`,` or `)`")?;
        check_count(function, arguments.len(), position)?;
        let first = self.ast.arguments.len() as u32;
        self.ast.arguments.extend_from_slice(&arguments);
        Ok(Node::Call(function, first, arguments.len() as u32))
    }
}
