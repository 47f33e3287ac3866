//! Splits a text into tokens, one at a time.
//!
//! Promise: any string is read in one pass with constant memory; after a fault the next call continues after it. Limit:
//! names are ASCII; their meaning is not known here.

use super::error::{ExprError, Position};
use super::suggest::shortened;

/// A token with its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Token<'a> {
    pub(super) kind: TokenKind<'a>,
    pub(super) text: &'a str,
    pub(super) position: Position,
}

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TokenKind<'a> {
    Number(f64),
    Name(&'a str),
    /// `@name`: the attribute with that name, even if something else has the same name.
    Attribute(&'a str),
    Symbol(Symbol),
    Newline,
    End,
}

/// Operators and punctuation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Symbol {
    Plus,
    Minus,
    Star,
    Slash,
    Percent,
    Caret,
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    Equal,
    NotEqual,
    And,
    Or,
    Not,
    Question,
    Colon,
    Open,
    Close,
    Comma,
    Dot,
    Semicolon,
    Assign,
    AddAssign,
    SubtractAssign,
    MultiplyAssign,
    DivideAssign,
}

/// If one is a prefix of another, the longer comes first.
const SYMBOLS: &[(&str, Symbol)] = &[
    ("+=", Symbol::AddAssign),
    ("-=", Symbol::SubtractAssign),
    ("*=", Symbol::MultiplyAssign),
    ("/=", Symbol::DivideAssign),
    ("<=", Symbol::LessEqual),
    (">=", Symbol::GreaterEqual),
    ("==", Symbol::Equal),
    ("!=", Symbol::NotEqual),
    ("&&", Symbol::And),
    ("||", Symbol::Or),
    ("+", Symbol::Plus),
    ("-", Symbol::Minus),
    ("*", Symbol::Star),
    ("/", Symbol::Slash),
    ("%", Symbol::Percent),
    ("^", Symbol::Caret),
    ("<", Symbol::Less),
    (">", Symbol::Greater),
    ("!", Symbol::Not),
    ("?", Symbol::Question),
    (":", Symbol::Colon),
    ("(", Symbol::Open),
    (")", Symbol::Close),
    (",", Symbol::Comma),
    (".", Symbol::Dot),
    (";", Symbol::Semicolon),
    ("=", Symbol::Assign),
];

/// Operators from other languages, and what to write instead.
const FOREIGN: &[(&str, &str)] = &[
    ("**", "write a power as `^`"),
    ("&", "write a logical and as `&&`"),
    ("|", "write a logical or as `||`"),
    ("[", "write components as `.x`, `.y`, `.z`, `.w`, and vectors as `vec(x, y, z)`"),
    ("{", "write vectors as `vec(x, y, z)`"),
    ("#", "comments start with `//`"),
];

/// Reads tokens from a text.
pub(super) struct Lexer<'a> {
    rest: &'a str,
    position: Position,
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Lexer { rest: text, position: Position::START }
    }

    /// The next token; at the end of the text always `TokenKind::End`.
    pub(super) fn next(&mut self) -> Result<Token<'a>, ExprError> {
        self.skip_blanks();
        let position = self.position;
        let token = |kind, text| Ok(Token { kind, text, position });
        let Some(first) = self.rest.chars().next() else { return token(TokenKind::End, "") };

        if first == '\n' {
            let text = self.take(1);
            self.position = Position { line: position.line + 1, column: 1 };
            return token(TokenKind::Newline, text);
        }
        if let Some(length) = number_length(self.rest) {
            let text = self.take(length);
            return match text.parse::<f64>() {
                Ok(value) if value.is_finite() => token(TokenKind::Number(value), text),
                _ => Err(position.fault(format!("the number `{}` is too large", shortened(text)))),
            };
        }
        if let Some(length) = name_length(self.rest) {
            let text = self.take(length);
            return token(TokenKind::Name(text), text);
        }
        if first == '@'
            && let Some(length) = name_length(&self.rest[1..])
        {
            let text = self.take(1 + length);
            return token(TokenKind::Attribute(&text[1..]), text);
        }
        for (text, hint) in FOREIGN {
            if self.rest.starts_with(text) && !self.rest.starts_with("&&") && !self.rest.starts_with("||") {
                self.take(text.len());
                return Err(position.fault(format!("`{text}` is not an operator")).hint(*hint));
            }
        }
        for (text, symbol) in SYMBOLS {
            if self.rest.starts_with(text) {
                return token(TokenKind::Symbol(*symbol), self.take(text.len()));
            }
        }
        self.take(first.len_utf8());
        let fault = position.fault(format!("unexpected character `{}`", first.escape_debug()));
        Err(if first == '@' { fault.hint("write an attribute as `@name`") } else { fault })
    }

    /// Skips blanks and a comment, but not the end of the line.
    fn skip_blanks(&mut self) {
        let end = self.rest.find(|c: char| c == '\n' || !c.is_whitespace()).unwrap_or(self.rest.len());
        self.take(end);
        if self.rest.starts_with("//") {
            let end = self.rest.find('\n').unwrap_or(self.rest.len());
            self.take(end);
        }
    }

    fn take(&mut self, bytes: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(bytes);
        self.rest = rest;
        self.position.column += taken.chars().count() as u32;
        taken
    }
}

/// The length in bytes of the number at the start of `text`: `2`, `2.`, `.5`, `1e-3`.
fn number_length(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let whole = digits(0);
    let mut length = whole;
    if bytes.get(length) == Some(&b'.') {
        let fraction = digits(length + 1);
        if whole + fraction == 0 {
            return None;
        }
        length += 1 + fraction;
    }
    if length == 0 {
        return None;
    }
    if matches!(bytes.get(length), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(length + 1), Some(b'+' | b'-')));
        let from = (length + 1 + sign).min(bytes.len());
        let exponent = digits(from);
        if exponent > 0 {
            length = from + exponent;
        }
    }
    Some(length)
}

/// The length in bytes of the name at the start of `text`: `[A-Za-z_][A-Za-z0-9_]*`.
fn name_length(text: &str) -> Option<usize> {
    let first = text.bytes().next()?;
    (first.is_ascii_alphabetic() || first == b'_')
        .then(|| text.bytes().take_while(|b| b.is_ascii_alphanumeric() || *b == b'_').count())
}

/// Whether `text` is a name and nothing else.
pub(super) fn is_name(text: &str) -> bool {
    name_length(text) == Some(text.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(text: &str) -> Vec<&str> {
        let mut lexer = Lexer::new(text);
        let mut found = Vec::new();
        loop {
            let token = lexer.next().unwrap();
            if token.kind == TokenKind::End {
                return found;
            }
            found.push(token.text);
        }
    }

    #[test]
    fn tokens_are_as_long_as_possible() {
        assert_eq!(texts("a<=b"), ["a", "<=", "b"]);
        assert_eq!(texts("P.y*=.5e-1+2."), ["P", ".", "y", "*=", ".5e-1", "+", "2."]);
        assert_eq!(texts("2e+x 3e"), ["2", "e", "+", "x", "3", "e"]);
        assert_eq!(texts("@P.x // all of it\n;"), ["@P", ".", "x", "\n", ";"]);
        assert_eq!(texts(" \t\r "), [""; 0]);
    }

    #[test]
    fn positions_count_characters_not_bytes() {
        let mut lexer = Lexer::new("// é\n\u{2003}x");
        assert_eq!(lexer.next().unwrap().kind, TokenKind::Newline);
        assert_eq!(lexer.next().unwrap().position, Position { line: 2, column: 2 });
    }

    #[test]
    fn reading_continues_after_a_fault() {
        let mut lexer = Lexer::new("é ** x");
        assert_eq!(lexer.next().unwrap_err().fact, "unexpected character `é`");
        let power = lexer.next().unwrap_err();
        assert_eq!((power.column, power.hint.as_deref()), (3, Some("write a power as `^`")));
        assert_eq!(lexer.next().unwrap().text, "x");
        assert_eq!(lexer.next().unwrap().kind, TokenKind::End);
        assert_eq!(lexer.next().unwrap().kind, TokenKind::End);
    }

    #[test]
    fn a_number_beyond_f64_is_a_fault() {
        let fact = Lexer::new("1e999").next().unwrap_err().fact;
        assert_eq!(fact, "the number `1e999` is too large");
        assert!(Lexer::new(&"9".repeat(400)).next().unwrap_err().fact.len() < 80);
    }
}
