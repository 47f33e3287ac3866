//! Splits `.usda` text into words, strings, asset paths and brackets. White space and comments separate them.

use crate::error::FilePosition;
use crate::{FormatError, Result};

/// A place in a text.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lexer<'a> {
    pub(super) text: &'a [u8],
    pub(super) at: usize,
}

/// Bytes that end a word.
fn ends_word(byte: u8) -> bool {
    byte.is_ascii_whitespace() || b"()[]{}=,;\"'@<>#".contains(&byte)
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a [u8], at: usize) -> Self {
        Self { text, at }
    }

    /// An error here.
    pub(super) fn error(&self, fact: impl Into<String>) -> FormatError {
        let before = &self.text[..self.at.min(self.text.len())];
        let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
        FormatError::at(FilePosition::Line(line), fact)
    }

    /// What stands here, for messages.
    pub(super) fn found(&self) -> String {
        let rest = self.text.get(self.at..).unwrap_or_default();
        let line = rest.iter().take(24).take_while(|byte| !byte.is_ascii_whitespace());
        match String::from_utf8_lossy(&line.copied().collect::<Vec<u8>>()).into_owned() {
            empty if empty.is_empty() => "the end of the file".into(),
            found => format!("`{found}`"),
        }
    }

    /// Skips white space, comments and semicolons; the next byte, if there is one.
    pub(super) fn peek(&mut self) -> Option<u8> {
        loop {
            match *self.text.get(self.at)? {
                b'#' => self.skip_line(),
                b';' => self.at += 1,
                byte if byte.is_ascii_whitespace() => self.at += 1,
                byte => return Some(byte),
            }
        }
    }

    fn skip_line(&mut self) {
        let rest = &self.text[self.at..];
        self.at += rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
    }

    /// Whether `byte` comes next; if so it is taken.
    pub(super) fn take(&mut self, byte: u8) -> bool {
        let is_next = self.peek() == Some(byte);
        self.at += usize::from(is_next);
        is_next
    }

    pub(super) fn expect(&mut self, byte: u8) -> Result<()> {
        if self.take(byte) {
            return Ok(());
        }
        Err(self.error(format!("{}, expected `{}`", self.found(), char::from(byte))))
    }

    /// The next word; empty if something else comes next.
    pub(super) fn word(&mut self) -> &'a str {
        self.peek();
        let rest = self.text.get(self.at..).unwrap_or_default();
        let length = rest.iter().position(|byte| ends_word(*byte)).unwrap_or(rest.len());
        self.at += length;
        std::str::from_utf8(&rest[..length]).unwrap_or_default()
    }

    /// Whether `word` comes next; if so it is taken.
    pub(super) fn take_word(&mut self, word: &str) -> bool {
        let before = *self;
        let is_next = self.word() == word;
        if !is_next {
            *self = before;
        }
        is_next
    }

    /// A number.
    pub(super) fn number(&mut self) -> Result<f64> {
        self.peek();
        let rest = self.text.get(self.at..).unwrap_or_default();
        let length = rest.iter().position(|byte| ends_word(*byte) || *byte == b':').unwrap_or(rest.len());
        let number = std::str::from_utf8(&rest[..length]).ok().and_then(parsed);
        let number = number.ok_or_else(|| self.error(format!("{}, expected a number", self.found())))?;
        self.at += length;
        Ok(number)
    }

    /// A string, an asset path or a path, without its delimiters.
    pub(super) fn quoted(&mut self) -> Result<String> {
        let Some(open) = self.peek() else { return Err(self.error("the end of the file, expected a string")) };
        let (bytes, has_escapes) = self.skip_quoted(open)?;
        let text = String::from_utf8_lossy(bytes);
        Ok(if has_escapes { unescaped(&text) } else { text.into_owned() })
    }

    /// Goes past a string, an asset path or a path that starts here with `open`; what is inside, and whether it may have
    /// escapes.
    pub(super) fn skip_quoted(&mut self, open: u8) -> Result<(&'a [u8], bool)> {
        let rest = &self.text[self.at..];
        let long = matches!(open, b'"' | b'\'' | b'@') && rest.get(1) == Some(&open) && rest.get(2) == Some(&open);
        let close = if open == b'<' { b'>' } else { open };
        let (start, end): (usize, &[u8]) = if long { (3, &[close; 3]) } else { (1, &[close]) };
        let has_escapes = matches!(open, b'"' | b'\'');
        let mut at = start;
        loop {
            match rest.get(at) {
                None => break,
                Some(b'\n') if !long => break,
                Some(b'\\') if has_escapes => at += 2,
                Some(_) if rest[at..].starts_with(end) => {
                    self.at += at + end.len();
                    return Ok((&rest[start..at], has_escapes));
                }
                Some(_) => at += 1,
            }
        }
        Err(self.error(format!("a text that starts with `{}` has no end", char::from(open))))
    }

    /// Goes past a bracket and all up to the one that closes it.
    pub(super) fn skip_brackets(&mut self) -> Result<()> {
        let start = *self;
        let mut depth = 0_usize;
        while let Some(byte) = self.peek() {
            match byte {
                b'(' | b'[' | b'{' => depth += 1,
                b')' | b']' | b'}' => depth = depth.saturating_sub(1),
                b'"' | b'\'' | b'@' | b'<' => {
                    self.skip_quoted(byte)?;
                    continue;
                }
                _ => {}
            }
            self.at += 1;
            if depth == 0 {
                return Ok(());
            }
        }
        Err(start.error(format!("{} has no end", start.found())))
    }
}

/// A number as USD writes it.
pub(super) fn parsed(text: &str) -> Option<f64> {
    let is_number = text.bytes().all(|byte| byte.is_ascii_digit() || b"+-.eE".contains(&byte));
    match text {
        "inf" => Some(f64::INFINITY),
        "-inf" => Some(f64::NEG_INFINITY),
        "nan" => Some(f64::NAN),
        _ => text.parse().ok().filter(|_| is_number),
    }
}

fn unescaped(text: &str) -> String {
    let mut out = String::new();
    let mut letters = text.chars();
    while let Some(letter) = letters.next() {
        if letter != '\\' {
            out.push(letter);
            continue;
        }
        match letters.next() {
            Some('n') => out.push('\n'),
            Some('r') => out.push('\r'),
            Some('t') => out.push('\t'),
            Some('x') => {
                let code: String = letters.by_ref().take(2).collect();
                out.extend(u32::from_str_radix(&code, 16).ok().and_then(char::from_u32));
            }
            other => out.extend(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_strings_and_brackets_are_told_apart() {
        let mut lexer =
            Lexer::new(b" # a comment\n primvars:x.y = \"a\\\"b\\x41\" @a b@ '''c\n''' [ (1, \"]\") ] x", 0);
        assert_eq!(lexer.word(), "primvars:x.y");
        lexer.expect(b'=').unwrap();
        assert_eq!(lexer.quoted().unwrap(), "a\"bA");
        assert_eq!(lexer.quoted().unwrap(), "a b");
        assert_eq!(lexer.quoted().unwrap(), "c\n");
        lexer.skip_brackets().unwrap();
        assert!(lexer.take_word("x"));
        assert_eq!(lexer.peek(), None);
    }

    #[test]
    fn what_has_no_end_is_an_error_with_its_line() {
        assert_eq!(
            Lexer::new(b"\n\n\"a\n", 2).quoted().unwrap_err().to_string(),
            "line 3: a text that starts with `\"` has no end"
        );
        assert_eq!(Lexer::new(b"[[1]", 0).skip_brackets().unwrap_err().to_string(), "line 1: `[[1]` has no end");
        assert_eq!(Lexer::new(b"x", 0).expect(b'=').unwrap_err().to_string(), "line 1: `x`, expected `=`");
    }

    #[test]
    fn numbers_are_those_of_usd() {
        for (text, expected) in [("1", 1.0), ("-0.5e-3", -0.5e-3), ("inf", f64::INFINITY), ("1.", 1.0), (".5", 0.5)] {
            assert_eq!(parsed(text), Some(expected));
        }
        assert!(parsed("nan").is_some_and(f64::is_nan));
        for text in ["", "infinity", "NaN", "1f", "0x1"] {
            assert_eq!(parsed(text), None, "{text}");
        }
    }
}
