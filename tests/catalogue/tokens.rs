//! Rust source as tokens: enough to find paths, names of types and string literals, ignoring the contents of comments.

/// A piece of source.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Token {
    /// A keyword, a name, or a number.
    Word(String),
    /// The contents of a string literal, escapes as they are written.
    Text(String),
    /// `::`
    Colons,
    /// Any other character.
    Mark(char),
}

impl Token {
    pub(crate) fn is(&self, word: &str) -> bool {
        matches!(self, Self::Word(found) if found == word)
    }

    pub(crate) fn word(&self) -> Option<&str> {
        match self {
            Self::Word(word) => Some(word),
            _ => None,
        }
    }
}

/// The tokens of a source; comments, lifetimes' quotes and character literals are left out.
pub(crate) fn tokens(source: &str) -> Vec<Token> {
    let mut rest = source;
    let mut tokens = Vec::new();
    while let Some(first) = rest.chars().next() {
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let skipped = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            block_comment(rest)
        } else if let Some((length, text)) = text(rest) {
            tokens.push(Token::Text(text));
            length
        } else if first == '\'' {
            quote(rest)
        } else if is_word(first) {
            let length = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
            tokens.push(Token::Word(rest[..length].to_owned()));
            length
        } else if rest.starts_with("::") {
            tokens.push(Token::Colons);
            2
        } else {
            tokens.extend((!first.is_whitespace()).then_some(Token::Mark(first)));
            first.len_utf8()
        };
        rest = &rest[skipped..];
    }
    tokens
}

/// The length of a block comment, comments within it included.
fn block_comment(rest: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < rest.len() {
        if rest[at..].starts_with("/*") {
            (depth, at) = (depth + 1, at + 2);
        } else if rest[at..].starts_with("*/") {
            (depth, at) = (depth - 1, at + 2);
            if depth == 0 {
                return at;
            }
        } else {
            at += rest[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    rest.len()
}

/// The length and contents of a string literal, raw or not, of bytes or characters.
fn text(rest: &str) -> Option<(usize, String)> {
    let body = rest.trim_start_matches(['b', 'c']);
    let raw = body.strip_prefix('r').filter(|body| body.trim_start_matches('#').starts_with('"'));
    if let Some(body) = raw {
        let hashes = body.len() - body.trim_start_matches('#').len();
        let open = rest.len() - body.len() + hashes + 1;
        let close = format!("\"{}", "#".repeat(hashes));
        let length = rest[open..].find(&close).unwrap_or(rest.len() - open);
        return Some(((open + length + close.len()).min(rest.len()), rest[open..open + length].to_owned()));
    }
    let open = rest.len() - body.strip_prefix('"')?.len();
    let mut escaped = false;
    let length = rest[open..].find(|c| {
        let ends = c == '"' && !escaped;
        escaped = c == '\\' && !escaped;
        ends
    })?;
    Some((open + length + 1, rest[open..open + length].to_owned()))
}

/// The length of a character literal, or of a lifetime's quote.
fn quote(rest: &str) -> usize {
    let mut chars = rest.char_indices().skip(1);
    match (chars.next(), chars.next()) {
        (Some((_, '\\')), Some((at, _))) => rest[at + 1..].find('\'').map_or(rest.len(), |end| at + 1 + end + 1),
        (Some(_), Some((at, '\''))) => at + 1,
        _ => 1,
    }
}

#[test]
fn words_in_comments_texts_and_characters_are_ignored() {
    let source = r##"
        // a /* b
        /* c /* d */ e */ f::g "h \" i" r#"j " k"# 'l' '\'' '"' m<'n>
    "##;
    let word = |word: &str| Token::Word(word.to_owned());
    let text = |text: &str| Token::Text(text.to_owned());
    let expected = [
        word("f"),
        Token::Colons,
        word("g"),
        text(r#"h \" i"#),
        text("j \" k"),
        word("m"),
        Token::Mark('<'),
        word("n"),
        Token::Mark('>'),
    ];
    assert_eq!(tokens(source), expected);
}
