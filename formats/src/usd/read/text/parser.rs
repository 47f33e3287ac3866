//! The structure of `.usda`: prims, properties and metadata. Prims may be nested to any depth, so there is no recursion.

use std::collections::BTreeMap;

use super::lexer::Lexer;
use super::types::TextType;
use super::{REFERENCES, SAMPLES, TextData, handle, skip_value, written_type};
use crate::Result;
use crate::usd::read::bytes::Bytes;
use crate::usd::read::layer::{Data, Handle, Layer, NONE, Node, NodeKind, Reference, Samples, Tokens};

/// The layer of a text file.
///
/// # Errors
/// If the text is no USD.
pub(in super::super) fn layer(bytes: Bytes) -> Result<Layer> {
    let mut builder = Builder::default();
    let root = builder.node(NONE, "", NodeKind::Root);
    let mut lexer = Lexer::new(bytes.get(), 0);
    if lexer.peek() == Some(b'(') {
        builder.metadata(&mut lexer, root)?;
    }
    builder.prims(&mut lexer, root)?;
    let Builder { tokens, nodes, pending, samples, references, .. } = builder;
    let (mut sets, mut fields, mut nodes) = (Vec::new(), Vec::new(), nodes);
    for (node, own) in nodes.iter_mut().zip(pending) {
        node.set = sets.len() as u32;
        sets.extend(fields.len() as u32..(fields.len() + own.len()) as u32);
        sets.push(NONE);
        fields.extend(own);
    }
    let data = Data::Text(TextData { bytes, samples, references });
    Ok(Layer { tokens, nodes, sets, fields, data })
}

#[derive(Default)]
struct Builder {
    tokens: Tokens,
    known: BTreeMap<String, u32>,
    nodes: Vec<Node>,
    /// The last prim and the last property of each node.
    last: Vec<[u32; 2]>,
    /// The fields of each node.
    pending: Vec<Vec<(u32, Handle)>>,
    /// Properties by parent and name: one may be declared several times.
    properties: BTreeMap<(u32, u32), u32>,
    samples: Vec<Samples>,
    references: Vec<Vec<Reference>>,
}

impl Builder {
    fn token(&mut self, text: &str) -> u32 {
        if let Some(known) = self.known.get(text) {
            return *known;
        }
        let token = self.tokens.push(text);
        self.known.insert(text.to_owned(), token);
        token
    }

    fn node(&mut self, parent: u32, name: &str, kind: NodeKind) -> u32 {
        let (token, node) = (self.token(name), self.nodes.len() as u32);
        let is_property = matches!(kind, NodeKind::Attribute | NodeKind::Other);
        self.nodes.push(Node::new(token, kind, NONE));
        self.last.push([NONE; 2]);
        self.pending.push(Vec::new());
        if parent != NONE {
            let before = std::mem::replace(&mut self.last[parent as usize][usize::from(is_property)], node);
            let above = &mut self.nodes[parent as usize];
            match (before, is_property) {
                (NONE, false) => above.child = node,
                (NONE, true) => above.property = node,
                (before, _) => self.nodes[before as usize].next = node,
            }
        }
        node
    }

    fn property(&mut self, parent: u32, name: &str, kind: NodeKind) -> u32 {
        let token = self.token(name);
        if let Some(known) = self.properties.get(&(parent, token)) {
            return *known;
        }
        let node = self.node(parent, name, kind);
        self.properties.insert((parent, token), node);
        node
    }

    fn field(&mut self, node: u32, name: &str, handle: Handle) {
        let name = self.token(name);
        self.pending[node as usize].push((name, handle));
    }

    /// Everything after the header.
    fn prims(&mut self, lexer: &mut Lexer<'_>, root: u32) -> Result<()> {
        let mut open = vec![root];
        while let Some(byte) = lexer.peek() {
            let above = *open.last().unwrap_or(&root);
            if byte == b'}' {
                if open.len() == 1 {
                    return Err(lexer.error("`}` closes nothing"));
                }
                lexer.at += 1;
                open.pop();
                continue;
            }
            let start = *lexer;
            match lexer.word() {
                specifier @ ("def" | "over" | "class") => open.push(self.prim(lexer, above, specifier)?),
                "variantSet" => {
                    self.field(above, "variantSetNames", 0);
                    lexer.quoted()?;
                    lexer.expect(b'=')?;
                    lexer.skip_brackets()?;
                }
                "reorder" => {
                    lexer.word();
                    lexer.expect(b'=')?;
                    skip_value(lexer)?;
                }
                _ if above == root => return Err(start.error(format!("{}, expected a prim", start.found()))),
                _ => {
                    *lexer = start;
                    self.statement(lexer, above)?;
                }
            }
        }
        if open.len() > 1 {
            let fact = format!("`{}` has no end", self.tokens.get(self.nodes[open[open.len() - 1] as usize].name));
            return Err(lexer.error(fact));
        }
        Ok(())
    }

    /// A prim up to the bracket that opens it.
    fn prim(&mut self, lexer: &mut Lexer<'_>, above: u32, specifier: &str) -> Result<u32> {
        let start = lexer.at - specifier.len();
        let kind = if lexer.peek() == Some(b'"') { None } else { Some((lexer.at, lexer.word())) };
        let name = lexer.quoted()?;
        let node = self.node(above, &name, NodeKind::Prim);
        // A word is read as a text.
        if let Some((at, _)) = kind.filter(|(_, word)| !word.is_empty()) {
            self.field(node, "typeName", handle(TextType::UNKNOWN.code(), at));
        }
        if specifier != "def" {
            self.field(node, "specifier", handle(TextType::UNKNOWN.code(), start));
        }
        if lexer.peek() == Some(b'(') {
            self.metadata(lexer, node)?;
        }
        lexer.expect(b'{')?;
        Ok(node)
    }

    /// A property.
    fn statement(&mut self, lexer: &mut Lexer<'_>, prim: u32) -> Result<()> {
        let start = *lexer;
        const PREFIXES: [&str; 9] =
            ["custom", "uniform", "varying", "config", "prepend", "append", "add", "delete", "reorder"];
        while PREFIXES.iter().any(|prefix| lexer.take_word(prefix)) {}
        if lexer.take_word("rel") {
            let name = lexer.word();
            if name.is_empty() {
                return Err(start.error("a relationship has no name"));
            }
            if lexer.take(b'=') {
                skip_value(lexer)?;
            }
            if lexer.peek() == Some(b'(') {
                lexer.skip_brackets()?;
            }
            return Ok(());
        }
        lexer.peek();
        let type_at = lexer.at;
        let kind = written_type(lexer)?;
        let name = lexer.word();
        if name.is_empty() {
            return Err(start.error(format!("{}, expected a property", start.found())));
        }
        let (name, part) = name.split_once('.').unwrap_or((name, "default"));
        let attribute = self.property(prim, name, NodeKind::Attribute);
        if self.pending[attribute as usize].is_empty() {
            self.field(attribute, "typeName", handle(TextType::UNKNOWN.code(), type_at));
        }
        if lexer.take(b'=') {
            match part {
                "timeSamples" => {
                    let samples = self.samples(lexer, kind)?;
                    self.field(attribute, "timeSamples", samples);
                }
                "default" | "spline" => {
                    lexer.peek();
                    self.field(attribute, part, handle(kind.code(), lexer.at));
                    skip_value(lexer)?;
                }
                // A connection.
                _ => skip_value(lexer)?,
            }
        }
        if lexer.peek() == Some(b'(') {
            self.metadata(lexer, attribute)?;
        }
        Ok(())
    }

    /// The samples of an attribute. One that is written like the one before is the same value.
    fn samples(&mut self, lexer: &mut Lexer<'_>, kind: TextType) -> Result<Handle> {
        let mut samples: Vec<(f64, Handle)> = Vec::new();
        let mut written: &[u8] = &[];
        lexer.expect(b'{')?;
        while !lexer.take(b'}') {
            if lexer.take(b',') {
                continue;
            }
            let time = lexer.number()?;
            lexer.expect(b':')?;
            lexer.peek();
            let at = lexer.at;
            skip_value(lexer)?;
            let own = &lexer.text[at..lexer.at];
            let value = match samples.last() {
                Some((_, before)) if own == written => *before,
                _ => handle(kind.code(), at),
            };
            written = own;
            samples.push((time, value));
        }
        if samples.iter().any(|(time, _)| !time.is_finite()) {
            return Err(lexer.error("a time of a sample is not finite"));
        }
        // Of equal times the last counts.
        samples.reverse();
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        samples.dedup_by(|later, first| later.0 == first.0);
        let (times, values): (Vec<f64>, Vec<Handle>) = samples.into_iter().unzip();
        self.samples.push(Samples { times: times.into(), values: values.into() });
        Ok(handle(SAMPLES, self.samples.len() - 1))
    }

    /// Fields in brackets.
    fn metadata(&mut self, lexer: &mut Lexer<'_>, node: u32) -> Result<()> {
        lexer.expect(b'(')?;
        while !lexer.take(b')') {
            if matches!(lexer.peek(), Some(b'"' | b'\'')) {
                lexer.quoted()?;
                continue;
            }
            let start = *lexer;
            let mut key = lexer.word();
            let operation = match key {
                "add" | "prepend" | "append" | "delete" | "reorder" => {
                    let operation = key;
                    key = lexer.word();
                    operation
                }
                _ => "",
            };
            if key.is_empty() {
                return Err(start.error(format!("{}, expected metadata", start.found())));
            }
            lexer.expect(b'=')?;
            lexer.peek();
            let at = lexer.at;
            match key {
                _ if matches!(operation, "delete" | "reorder") => skip_value(lexer)?,
                "references" | "payload" => {
                    let found = references(lexer)?;
                    self.add_references(node, key, found);
                }
                _ => {
                    skip_value(lexer)?;
                    let name = if key == "variantSets" { "variantSetNames" } else { key };
                    self.field(node, name, handle(TextType::UNKNOWN.code(), at));
                }
            }
        }
        Ok(())
    }

    fn add_references(&mut self, node: u32, key: &str, found: Vec<Reference>) {
        let token = self.token(key);
        let known = self.pending[node as usize].iter().find(|(name, _)| *name == token);
        match known.map(|(_, handle)| (*handle & ((1 << 56) - 1)) as usize) {
            Some(list) => self.references[list].extend(found),
            None => {
                self.references.push(found);
                self.field(node, key, handle(REFERENCES, self.references.len() - 1));
            }
        }
    }
}

/// `@file@</prim> (offset = 1)`, one or a list of them, or `None`.
fn references(lexer: &mut Lexer<'_>) -> Result<Vec<Reference>> {
    if lexer.take_word("None") {
        return Ok(Vec::new());
    }
    let is_list = lexer.take(b'[');
    let mut all = Vec::new();
    loop {
        let start = *lexer;
        let asset = if lexer.peek() == Some(b'@') { lexer.quoted()? } else { String::new() };
        let prim = if lexer.peek() == Some(b'<') { lexer.quoted()? } else { String::new() };
        if lexer.at == start.at || (asset.is_empty() && prim.is_empty()) {
            if is_list && lexer.take(b']') {
                return Ok(all);
            }
            return Err(start.error(format!("{}, expected a reference", start.found())));
        }
        let mut reference = Reference { asset, prim, offset: 0.0, scale: 1.0 };
        if lexer.take(b'(') {
            while !lexer.take(b')') {
                let key = lexer.word();
                lexer.expect(b'=')?;
                match key {
                    "offset" => reference.offset = lexer.number()?,
                    "scale" => reference.scale = lexer.number()?,
                    _ => skip_value(lexer)?,
                }
            }
        }
        all.push(reference);
        if !is_list {
            return Ok(all);
        }
        lexer.take(b',');
        if lexer.take(b']') {
            return Ok(all);
        }
    }
}
