//! The sections of a crate file: a tree of specs as tables that refer to each other by number.
//!
//! Tokens are names, fields are (name, value) pairs, field sets are what specs have; equal ones are stored once. The tree
//! itself is a list of paths, depth first, with jumps. The limit: one tree a file, written when it is complete.

use std::collections::BTreeMap;

use super::coding::{chunk, ints};

/// What a spec is, by its number in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SpecType {
    Attribute = 1,
    Prim = 6,
    PseudoRoot = 7,
}

/// A prim, attribute or the root above all prims.
#[derive(Debug)]
pub(super) struct Spec {
    /// Its own name, not its path.
    pub(super) name: String,
    pub(super) kind: SpecType,
    /// Names and value reps.
    pub(super) fields: Vec<(&'static str, u64)>,
    /// Attributes first, then prims.
    pub(super) children: Vec<Spec>,
}

impl Spec {
    /// A spec with no field and no child.
    pub(super) fn new(name: &str, kind: SpecType) -> Self {
        Self { name: name.to_owned(), kind, fields: Vec::new(), children: Vec::new() }
    }

    /// Adds a field.
    pub(super) fn field(&mut self, name: &'static str, value: u64) {
        self.fields.push((name, value));
    }

    /// Paths from here down, this one included.
    fn paths(&self) -> usize {
        1 + self.children.iter().map(Self::paths).sum::<usize>()
    }
}

/// The tables in the making.
#[derive(Debug)]
pub(super) struct Structure {
    tokens: Numbered<String>,
    /// Tokens that are strings' text.
    strings: Numbered<u32>,
    fields: Numbered<(u32, u64)>,
    sets: BTreeMap<Vec<u32>, u32>,
    /// All sets one after the other, each with an [`END`].
    set_list: Vec<u32>,
    paths: Vec<Path>,
}

/// After each field set.
const END: u32 = u32::MAX;

#[derive(Debug)]
struct Path {
    element: i32,
    jump: i32,
    set: u32,
    kind: SpecType,
}

impl Default for Structure {
    fn default() -> Self {
        let mut tokens = Numbered::default();
        // Properties are told from prims by the sign of their token, and 0 has none: nothing may be called by token 0.
        tokens.number(String::new());
        Self {
            tokens,
            strings: Numbered::default(),
            fields: Numbered::default(),
            sets: BTreeMap::new(),
            set_list: Vec::new(),
            paths: Vec::new(),
        }
    }
}

impl Structure {
    /// The index of a token.
    pub(super) fn token(&mut self, text: &str) -> u32 {
        self.tokens.number(text.to_owned())
    }

    /// The index of a string.
    pub(super) fn string(&mut self, text: &str) -> u32 {
        let token = self.token(text);
        self.strings.number(token)
    }

    /// Name and bytes of each section, in the order of the file.
    pub(super) fn sections(mut self, root: &Spec) -> [(&'static str, Vec<u8>); 6] {
        self.add(root, false);
        let Self { tokens, strings, fields, set_list, paths, .. } = self;
        let places = || 0..paths.len() as i32;
        let text: Vec<u8> = tokens.list.iter().flat_map(|token| token.bytes().chain([0])).collect();
        let values: Vec<u8> = fields.list.iter().flat_map(|(_, value)| value.to_le_bytes()).collect();
        let names = fields.list.iter().map(|(name, _)| name.cast_signed());
        let string_tokens = strings.list.iter().flat_map(|token| token.to_le_bytes());
        [
            ("TOKENS", [&count(tokens.list.len())[..], &count(text.len()), &sized(&chunk(&text))].concat()),
            ("STRINGS", count(strings.list.len()).into_iter().chain(string_tokens).collect()),
            ("FIELDS", [&count(fields.list.len())[..], &ints(names), &sized(&chunk(&values))].concat()),
            ("FIELDSETS", [&count(set_list.len())[..], &ints(set_list.iter().map(|n| n.cast_signed()))].concat()),
            (
                "PATHS",
                [
                    &count(paths.len())[..],
                    &count(paths.len()),
                    &ints(places()),
                    &ints(paths.iter().map(|path| path.element)),
                    &ints(paths.iter().map(|path| path.jump)),
                ]
                .concat(),
            ),
            (
                "SPECS",
                [
                    &count(paths.len())[..],
                    &ints(places()),
                    &ints(paths.iter().map(|path| path.set.cast_signed())),
                    &ints(paths.iter().map(|path| path.kind as i32)),
                ]
                .concat(),
            ),
        ]
    }

    /// Adds a spec and all below it; `sibling` says whether another one of the same parent follows.
    fn add(&mut self, spec: &Spec, sibling: bool) {
        let token = self.token(&spec.name).cast_signed();
        let element = if spec.kind == SpecType::Attribute { -token } else { token };
        let jump = match (spec.children.is_empty(), sibling) {
            (true, false) => -2,
            (false, false) => -1,
            (true, true) => 0,
            (false, true) => spec.paths() as i32,
        };
        let set = self.field_set(&spec.fields);
        self.paths.push(Path { element, jump, set, kind: spec.kind });
        for (i, child) in spec.children.iter().enumerate() {
            self.add(child, i + 1 < spec.children.len());
        }
    }

    fn field_set(&mut self, fields: &[(&'static str, u64)]) -> u32 {
        let set: Vec<u32> = fields
            .iter()
            .map(|(name, value)| {
                let name = self.token(name);
                self.fields.number((name, *value))
            })
            .collect();
        let start = self.set_list.len() as u32;
        let list = &mut self.set_list;
        *self.sets.entry(set).or_insert_with_key(|set| {
            list.extend_from_slice(set);
            list.push(END);
            start
        })
    }
}

/// Values in the order they came, each once.
#[derive(Debug)]
struct Numbered<T> {
    list: Vec<T>,
    numbers: BTreeMap<T, u32>,
}

impl<T> Default for Numbered<T> {
    fn default() -> Self {
        Self { list: Vec::new(), numbers: BTreeMap::new() }
    }
}

impl<T: Ord + Clone> Numbered<T> {
    fn number(&mut self, value: T) -> u32 {
        let next = self.list.len() as u32;
        let list = &mut self.list;
        *self.numbers.entry(value).or_insert_with_key(|value| {
            list.push(value.clone());
            next
        })
    }
}

fn count(n: usize) -> [u8; 8] {
    (n as u64).to_le_bytes()
}

/// Bytes with their length before them.
fn sized(bytes: &[u8]) -> Vec<u8> {
    [&count(bytes.len())[..], bytes].concat()
}
