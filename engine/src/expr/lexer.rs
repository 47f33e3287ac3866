//! Cuts a text into tokens, one at a time.
//!
//! Promise: any string is read in one pass and constant memory; after a fault the next call goes on behind it.
//! Limit: names are ASCII; nothing here knows what a name means.

use super::error::{ExprError, Place};
use super::suggest::shortened;

/// A piece of text with its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Token<'a> {
    pub(super) kind: TokenKind<'a>,
    pub(super) text: &'a str,
    pub(super) place: Place,
}

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TokenKind<'a> {
    Number(f64),
    Name(&'a str),
    /// `@name`: the attribute of that name, whatever else has it.
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

/// Longest first where one begins another.
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

/// What other languages write, and what this one writes instead.
const FOREIGN: &[(&str, &str)] = &[
    ("**", "a power is written `^`"),
    ("&", "a logical and is written `&&`"),
    ("|", "a logical or is written `||`"),
    ("[", "components are written `.x`, `.y`, `.z`, `.w`, and vectors `vec(x, y, z)`"),
    ("{", "vectors are written `vec(x, y, z)`"),
    ("#", "a comment begins with `//`"),
];

/// Reads tokens from a text.
pub(super) struct Lexer<'a> {
    rest: &'a str,
    place: Place,
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Lexer { rest: text, place: Place::START }
    }

    /// The next token; at the end of the text `TokenKind::End`, again and again.
    pub(super) fn next(&mut self) -> Result<Token<'a>, ExprError> {
        self.skip_blanks();
        let place = self.place;
        let token = |kind, text| Ok(Token { kind, text, place });
        let Some(first) = self.rest.chars().next() else { return token(TokenKind::End, "") };

        if first == '\n' {
            let text = self.take(1);
            self.place = Place { line: place.line + 1, column: 1 };
            return token(TokenKind::Newline, text);
        }
        if let Some(length) = number_length(self.rest) {
            let text = self.take(length);
            return match text.parse::<f64>() {
                Ok(value) if value.is_finite() => token(TokenKind::Number(value), text),
                _ => Err(place.fault(format!("the number `{}` is too large", shortened(text)))),
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
                return Err(place.fault(format!("`{text}` is no operator here")).hint(*hint));
            }
        }
        for (text, symbol) in SYMBOLS {
            if self.rest.starts_with(text) {
                return token(TokenKind::Symbol(*symbol), self.take(text.len()));
            }
        }
        self.take(first.len_utf8());
        let fault = place.fault(format!("`{}` has no meaning here", first.escape_debug()));
        Err(if first == '@' { fault.hint("an attribute is written `@name`") } else { fault })
    }

    /// Passes blanks and a comment, but not the end of the line.
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
        self.place.column += taken.chars().count() as u32;
        taken
    }
}

/// Bytes of the number that `text` begins with: `2`, `2.`, `.5`, `1e-3`.
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

/// Bytes of the name that `text` begins with: `[A-Za-z_][A-Za-z0-9_]*`.
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
    fn tokens_are_cut_greedily() {
        assert_eq!(texts("a<=b"), ["a", "<=", "b"]);
        assert_eq!(texts("P.y*=.5e-1+2."), ["P", ".", "y", "*=", ".5e-1", "+", "2."]);
        assert_eq!(texts("2e+x 3e"), ["2", "e", "+", "x", "3", "e"]);
        assert_eq!(texts("@P.x // all of it\n;"), ["@P", ".", "x", "\n", ";"]);
        assert_eq!(texts(" \t\r "), [""; 0]);
    }

    #[test]
    fn places_count_characters_not_bytes() {
        let mut lexer = Lexer::new("// é\n\u{2003}x");
        assert_eq!(lexer.next().unwrap().kind, TokenKind::Newline);
        assert_eq!(lexer.next().unwrap().place, Place { line: 2, column: 2 });
    }

    #[test]
    fn reading_goes_on_behind_a_fault() {
        let mut lexer = Lexer::new("é ** x");
        assert_eq!(lexer.next().unwrap_err().fact, "`é` has no meaning here");
        let power = lexer.next().unwrap_err();
        assert_eq!((power.column, power.hint.as_deref()), (3, Some("a power is written `^`")));
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
