//! All paths of a source file, those of `use` trees included, as paths from the crate's root.

use super::tokens::{Token, tokens};

/// A path that begins at `crate`, `self` or `super`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SourcePath {
    /// Its names, starting at the crate's root.
    pub(crate) names: Vec<String>,
    /// Whether it brings all of a module into scope, or a module under another name.
    pub(crate) opens: bool,
}

/// The paths in the source of a module whose own path is `module`. Names that are in scope by other means are not
/// found.
pub(crate) fn paths(source: &str, module: &[String]) -> Vec<SourcePath> {
    let mut found = Paths { tokens: tokens(source), at: 0, found: Vec::new() };
    // Enclosing inline modules, and the depth of braces at which each began.
    let mut inside: Vec<(String, usize)> = Vec::new();
    let mut depth = 0;
    while let Some(token) = found.tokens.get(found.at).cloned() {
        match token {
            Token::Mark('{') => depth += 1,
            Token::Mark('}') => {
                depth -= 1;
                inside.pop_if(|(_, began)| *began == depth);
            }
            Token::Word(word) => {
                let next = |k: usize| found.tokens.get(found.at + k);
                if let ("mod", Some(Token::Word(name)), Some(Token::Mark('{'))) = (&*word, next(1), next(2)) {
                    inside.push((name.clone(), depth));
                } else if word == "extern" && next(2).is_some_and(|token| token.is("self")) {
                    found.found.push(SourcePath { names: Vec::new(), opens: true });
                } else if ["crate", "self", "super"].contains(&&*word) || word == "use" {
                    let here: Vec<String> =
                        module.iter().cloned().chain(inside.iter().map(|(name, _)| name.clone())).collect();
                    found.at += usize::from(word == "use");
                    found.tree(&[], &here);
                    continue;
                }
            }
            _ => {}
        }
        found.at += 1;
    }
    found.found
}

struct Paths {
    tokens: Vec<Token>,
    at: usize,
    found: Vec<SourcePath>,
}

impl Paths {
    fn token(&self) -> Option<&Token> {
        self.tokens.get(self.at)
    }

    /// Reads a path, or a tree of them in braces, that begins here; `prefix` is the path before its braces.
    fn tree(&mut self, prefix: &[String], here: &[String]) {
        let mut names = prefix.to_vec();
        loop {
            match self.token().cloned() {
                Some(Token::Word(word)) => names.push(word),
                Some(Token::Mark('*')) if !names.is_empty() => {
                    self.at += 1;
                    return self.add(&names, here, true);
                }
                Some(Token::Mark('{')) => {
                    self.at += 1;
                    while self.token().is_some_and(|token| *token != Token::Mark('}')) {
                        let before = self.at;
                        self.tree(&names, here);
                        // A comma, or a token that does not belong to a tree of paths.
                        self.at += usize::from(self.token() == Some(&Token::Mark(',')) || self.at == before);
                    }
                    self.at += 1;
                    return;
                }
                _ => return self.add(&names, here, false),
            }
            self.at += 1;
            match self.token() {
                Some(Token::Colons) => self.at += 1,
                Some(token) if token.is("as") => {
                    self.at += 2;
                    return self.add(&names, here, true);
                }
                _ => return self.add(&names, here, false),
            }
        }
    }

    fn add(&mut self, names: &[String], here: &[String], opens: bool) {
        let mut names = names.iter();
        let mut path = match names.next().map(String::as_str) {
            Some("crate") => Vec::new(),
            Some("self") => here.to_vec(),
            Some("super") => here[..here.len().saturating_sub(1)].to_vec(),
            _ => return,
        };
        for name in names {
            match &**name {
                "super" => drop(path.pop()),
                "self" => {}
                name => path.push(name.to_owned()),
            }
        }
        self.found.push(SourcePath { names: path, opens });
    }
}

#[test]
fn trees_globs_and_other_names_are_read() {
    let source = r#"
        use crate::{a::{b, c as d}, e::*, self as f};
        use {crate::g, super::super::h};
        // use crate::never;
        fn k() { let x = super::l::m::<T>(); println!("crate::never"); }
        mod tests { use super::*; use self::n; }
        fn o() { super::p() }
    "#;
    let found = paths(source, &["x".into(), "y".into()]);
    let found: Vec<_> = found.iter().map(|path| (path.names.join("::"), path.opens)).collect();
    let expected = [
        ("a::b", false),
        ("a::c", true),
        ("e", true),
        ("", true),
        ("g", false),
        ("h", false),
        ("x::l::m", false),
        ("x::y", true),
        ("x::y::tests::n", false),
        ("x::p", false),
    ];
    assert_eq!(found, expected.map(|(path, opens)| (path.to_owned(), opens)));
}
